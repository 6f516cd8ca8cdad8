//! Islands: balls that touch, and fall asleep together.

use std::mem::take;
use std::ops::Range;

use crate::math::{Scalar, UnionFind};
use crate::swarm::Swarm;
use crate::swarm::batches::Batch;
use crate::swarm::fast_movers::FastMovers;
use crate::swarm::kernels::{ContactImpulses, GROUNDED, squared};

/// Steps between two searches for islands: one takes as long as a pass over all pairs.
const STEPS_PER_SEARCH: u32 = 8;
/// Largest group asleep of balls that did not rest at one time, and that wakes with what leaves it. A large
/// heap sleeps and wakes part by part.
pub(super) const MAX_JOINED: usize = 512;

impl<S: Scalar> Swarm<S> {
    /// Puts islands to sleep of which all balls have rested under gravity, in m/s²; and in chunks of which
    /// all have, whatever they touch beyond, so that what rolls on a large heap keeps little of it awake.
    pub(super) fn fall_asleep(&mut self, gravity: S) {
        for i in 0..self.chunks.len() {
            if take(&mut self.chunks[i].rests) {
                let [first, end, _] = self.chunks[i].rows;
                self.put_islands_to_sleep(first..end, i.saturating_sub(1)..i + 1, |_, _| false);
            }
        }
        if self.chunks.iter().any(|chunk| chunk.has_rested && !chunk.asleep) {
            self.sleep.clock = (self.sleep.clock + 1) % STEPS_PER_SEARCH;
            if self.sleep.clock == 0 {
                let has_proxies = !self.proxies.is_empty();
                let is_restless = |swarm: &Self, row: u32| {
                    let (slot, sleep) = (swarm.ids.slots()[row as usize], &swarm.sleep);
                    let radius = swarm.at[row as usize][3];
                    !sleep.rest.lasts(row as usize, radius, gravity)
                        || sleep.is_sleepless(slot)
                        || has_proxies && swarm.body_slots.contains(slot)
                };
                let rows = 0..self.at.len() as u32;
                self.put_islands_to_sleep(rows, 0..self.chunks.len(), is_restless);
            }
        }
        for chunk in self.chunks.iter_mut().filter(|chunk| chunk.sleepers > 0) {
            let is_awake = |row: &u32| self.velocity[*row as usize][3].is_sign_positive();
            chunk.leaving.retain(is_awake);
        }
    }

    fn is_awake(&self, row: u32) -> bool {
        self.velocity[row as usize][3].is_sign_positive()
    }

    /// Puts those islands of some rows to sleep in which no ball is restless. Pairs of these rows are in the
    /// lists of some chunks.
    fn put_islands_to_sleep(
        &mut self,
        scope: Range<u32>,
        chunks: Range<usize>,
        is_restless: impl Fn(&Self, u32) -> bool,
    ) {
        let mut sets = take(&mut self.scratch.islands);
        let mut resting = take(&mut self.scratch.resting);
        let mut restless = take(&mut self.scratch.restless);
        let mut sleepers = take(&mut self.scratch.sleepers);
        self.join_islands(&scope, chunks, &mut sets, &mut sleepers);
        restless.clear();
        resting.clear();
        for row in scope.clone().filter(|row| self.is_awake(*row)) {
            let set = sets.set_of((row - scope.start) as usize);
            restless.resize(restless.len().max(set as usize + 1), false);
            if is_restless(self, row) {
                restless[set as usize] = true;
            } else {
                resting.push([set, row]);
            }
        }
        let set_of = |[row, by]: &[u32; 2]| [sets.set_of((by - scope.start) as usize), *row];
        resting.extend(sleepers.iter().map(set_of));
        resting.retain(|[set, _]| !restless[*set as usize]);
        resting.sort_unstable();
        let mut rows = take(&mut self.scratch.rows);
        for island in resting.chunk_by(|a, b| a[0] == b[0]) {
            rows.clear();
            rows.extend(island.iter().map(|[_, row]| *row));
            if rows.len() > MAX_JOINED {
                rows.retain(|row| self.is_awake(*row));
            }
            self.put_to_sleep(&rows);
        }
        (self.scratch.islands, self.scratch.resting) = (sets, resting);
        (self.scratch.restless, self.scratch.sleepers) = (restless, sleepers);
        self.scratch.rows = rows;
    }

    /// Joins balls that touch, by their place among these rows, with those asleep that they came to rest on
    /// and what fell asleep with these. Lists these sleepers, in order, each with one awake that joined it.
    fn join_islands(
        &self,
        scope: &Range<u32>,
        chunks: Range<usize>,
        sets: &mut UnionFind,
        sleepers: &mut Vec<[u32; 2]>,
    ) {
        sets.reset(scope.len());
        sleepers.clear();
        let (slots, rows) = (self.ids.slots(), self.ids.rows());
        let place = |row: u32| (row - scope.start) as usize;
        let next_sleeps = |i: usize| self.chunks.get(i + 1).is_none_or(|next| next.asleep);
        let near = self.chunks.get(chunks.clone()).unwrap_or_default();
        let near = near.first().map_or(0, |chunk| chunk.rows[0])
            ..near.last().map_or(0, |chunk| chunk.rows[2]);
        let of_chunks = chunks.map(|i| (i, &self.chunks[i]));
        let of_chunks = of_chunks.filter(|(i, chunk)| !(chunk.asleep && next_sleeps(*i)));
        let of_chunks = of_chunks.map(|(_, chunk)| (&chunk.batches, &chunk.impulses));
        let FastMovers { batches, impulses, rows: movers, .. } = &self.fast_movers;
        let has_movers = movers.iter().any(|row| near.contains(row));
        let of_movers = has_movers.then_some((batches, impulses));
        for (batches, impulses) in of_chunks.chain(of_movers) {
            for [a, b] in self.touching_pairs(batches, impulses) {
                let [awake, other] = if self.is_awake(a) { [a, b] } else { [b, a] };
                if !scope.contains(&awake) {
                    continue;
                }
                if !self.is_awake(other) {
                    let first = sleepers.len();
                    let visit = |slot: u32| sleepers.push([rows[slot as usize], awake]);
                    if !self.sleep.groups.visit(slots[other as usize], MAX_JOINED, visit) {
                        sleepers.truncate(first);
                    }
                } else if scope.contains(&other) {
                    sets.join(place(awake), place(other));
                }
            }
        }
        sleepers.sort_unstable();
        sleepers.dedup_by(|next, first| {
            let is_same = next[0] == first[0];
            if is_same {
                sets.join(place(next[1]), place(first[1]));
            }
            is_same
        });
    }

    /// Pairs of which one is awake, and that press on each other or touch.
    fn touching_pairs<'a>(
        &'a self,
        batches: &'a [Batch],
        impulses: &'a ContactImpulses<S>,
    ) -> impl Iterator<Item = [u32; 2]> + 'a {
        let touches = move |pair: [u32; 2]| {
            let [a, b] = pair.map(|row| &self.at[row as usize]);
            let (apart, radii) = ([b[0] - a[0], b[1] - a[1], b[2] - a[2], S::zero()], a[3] + b[3]);
            squared(apart) <= radii * radii
        };
        let batches = batches.iter().zip(&impulses.normal_impulse).filter(|(b, _)| !b.is_idle);
        let pairs = batches.flat_map(|(batch, impulses)| batch.pairs().zip(impulses));
        let awake = pairs.filter(|(pair, _)| pair.iter().any(|row| self.is_awake(*row)));
        awake
            .filter(move |(pair, impulse)| **impulse > S::zero() || touches(*pair))
            .map(|(pair, _)| pair)
    }

    /// Puts balls to sleep, and lets them wake together. Some may sleep already.
    fn put_to_sleep(&mut self, rows: &[u32]) {
        let slots = self.ids.slots();
        for row in rows.iter().filter(|row| !self.velocity[**row as usize][3].is_sign_positive()) {
            self.sleep.groups.dissolve(slots[*row as usize], |_| ());
        }
        self.sleep.groups.join(rows.iter().map(|row| slots[*row as usize]));
        let first = rows.first().copied().unwrap_or_default();
        let mut number = self.chunks.partition_point(|chunk| chunk.rows[1] <= first);
        for row in rows.iter().map(|row| *row as usize) {
            if self.velocity[row][3].is_sign_negative() {
                continue;
            }
            self.velocity[row] = [S::zero(), S::zero(), S::zero(), -self.velocity[row][3]];
            self.spin[row] = [S::zero(), S::zero(), S::zero(), S::from_f64(GROUNDED)];
            while self.chunks[number].rows[1] as usize <= row {
                number += 1;
            }
            let chunk = &mut self.chunks[number];
            chunk.sleepers += 1;
            self.sleep.sleepers += 1;
            (chunk.unread, chunk.sleep_changed) = (true, true);
            if chunk.sleepers == chunk.own_rows().len() {
                (chunk.asleep, chunk.speed) = (true, S::zero());
            }
        }
        *self.sleep_version += 1;
    }
}
