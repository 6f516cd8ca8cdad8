//! Islands: balls that touch, and fall asleep together.

use std::mem::take;

use crate::math::UnionFind;
use crate::swarm::Swarm;
use crate::swarm::batches::Batch;
use crate::swarm::fast_movers::FastMovers;
use crate::swarm::kernels::{ContactImpulses, GROUNDED, squared};

/// Steps between two searches for islands: one takes as long as a pass over all pairs.
const STEPS_PER_SEARCH: u32 = 8;
/// Largest group asleep that joins what comes to rest on it, and wakes with what leaves it. A large heap
/// sleeps and wakes part by part.
pub(super) const MAX_JOINED: usize = 512;

impl Swarm {
    /// Puts balls to sleep that have rested under gravity, in m/s²: those of chunks in which all have,
    /// so that what rolls on a large heap keeps little of it awake, and those of islands in which all have.
    pub(super) fn fall_asleep(&mut self, gravity: f32) {
        let mut rows = take(&mut self.scratch.leaving);
        for i in 0..self.chunks.len() {
            if !std::mem::take(&mut self.chunks[i].rests) {
                continue;
            }
            rows.clear();
            let own = self.chunks[i].rows;
            rows.extend((own[0]..own[1]).filter(|row| self.is_awake(*row)));
            let slots = self.ids.slots();
            if !rows.is_empty()
                && !rows.iter().any(|row| self.sleep.sleepless.contains(slots[*row as usize]))
            {
                self.put_to_sleep(&rows);
            }
        }
        self.scratch.leaving = rows;
        if self.chunks.iter().any(|chunk| chunk.has_rested && !chunk.asleep) {
            self.sleep.clock = (self.sleep.clock + 1) % STEPS_PER_SEARCH;
            if self.sleep.clock == 0 {
                self.put_islands_to_sleep(gravity);
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

    /// Puts the islands to sleep of which all balls have rested. Proxies are in none of these.
    fn put_islands_to_sleep(&mut self, gravity: f32) {
        let mut sets = take(&mut self.scratch.islands);
        let mut resting = take(&mut self.scratch.resting);
        let mut restless = take(&mut self.scratch.restless);
        let mut sleepers = take(&mut self.scratch.sleepers);
        self.join_islands(&mut sets, &mut sleepers);
        restless.clear();
        resting.clear();
        let (slots, has_proxies) = (self.ids.slots(), !self.proxies.is_empty());
        for row in (0..self.at.len() as u32).filter(|row| self.is_awake(*row)) {
            let (set, slot) = (sets.set_of(row as usize), slots[row as usize]);
            let radius = self.at[row as usize][3];
            restless.resize(restless.len().max(set as usize + 1), false);
            if !self.sleep.rest.lasts(row as usize, radius, gravity)
                || self.sleep.sleepless.contains(slot)
                || has_proxies && self.body_slots.contains(slot)
            {
                restless[set as usize] = true;
            } else {
                resting.push([set, row]);
            }
        }
        resting.extend(sleepers.iter().map(|row| [sets.set_of(*row as usize), *row]));
        resting.retain(|[set, _]| !restless[*set as usize]);
        resting.sort_unstable();
        let mut rows = take(&mut sleepers);
        for island in resting.chunk_by(|a, b| a[0] == b[0]) {
            rows.clear();
            rows.extend(island.iter().map(|[_, row]| *row));
            self.put_to_sleep(&rows);
        }
        (self.scratch.islands, self.scratch.resting) = (sets, resting);
        (self.scratch.restless, self.scratch.sleepers) = (restless, rows);
    }

    /// Joins balls that touch, with those asleep that they came to rest on and what fell asleep with these.
    /// Lists these sleepers, in order.
    fn join_islands(&self, sets: &mut UnionFind, sleepers: &mut Vec<u32>) {
        sets.reset(self.at.len());
        sleepers.clear();
        let (slots, rows) = (self.ids.slots(), self.ids.rows());
        let next_sleeps = |i: usize| self.chunks.get(i + 1).is_none_or(|next| next.asleep);
        let of_chunks = self.chunks.iter().enumerate();
        let of_chunks = of_chunks.filter(|(i, chunk)| !(chunk.asleep && next_sleeps(*i)));
        let of_chunks = of_chunks.map(|(_, chunk)| (&chunk.batches, &chunk.impulses));
        let FastMovers { batches, impulses, .. } = &self.fast_movers;
        for (batches, impulses) in of_chunks.chain([(batches, impulses)]) {
            for [a, b] in self.touching_pairs(batches, impulses) {
                let Some(asleep) = [a, b].into_iter().find(|row| !self.is_awake(*row)) else {
                    sets.join(a as usize, b as usize);
                    continue;
                };
                let first = sleepers.len();
                let visit = |slot: u32| sleepers.push(rows[slot as usize]);
                if self.sleep.groups.visit(slots[asleep as usize], MAX_JOINED, visit) {
                    for row in sleepers[first..].iter().chain([&a, &b]) {
                        sets.join(a as usize, *row as usize);
                    }
                } else {
                    sleepers.truncate(first);
                }
            }
        }
        sleepers.sort_unstable();
        sleepers.dedup();
    }

    /// Pairs of which one is awake, and that press on each other or touch.
    fn touching_pairs<'a>(
        &'a self,
        batches: &'a [Batch],
        impulses: &'a ContactImpulses,
    ) -> impl Iterator<Item = [u32; 2]> + 'a {
        let touches = move |pair: [u32; 2]| {
            let [a, b] = pair.map(|row| &self.at[row as usize]);
            let (apart, radii) = ([b[0] - a[0], b[1] - a[1], b[2] - a[2], 0.0], a[3] + b[3]);
            squared(apart) <= radii * radii
        };
        let batches = batches.iter().zip(&impulses.normal_impulse).filter(|(b, _)| !b.is_idle);
        let pairs = batches.flat_map(|(batch, impulses)| batch.pairs().zip(impulses));
        let awake = pairs.filter(|(pair, _)| pair.iter().any(|row| self.is_awake(*row)));
        awake.filter(move |(pair, impulse)| **impulse > 0.0 || touches(*pair)).map(|(pair, _)| pair)
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
            self.velocity[row] = [0.0, 0.0, 0.0, -self.velocity[row][3]];
            self.spin[row] = [0.0, 0.0, 0.0, GROUNDED];
            while self.chunks[number].rows[1] as usize <= row {
                number += 1;
            }
            let chunk = &mut self.chunks[number];
            chunk.sleepers += 1;
            self.sleep.sleepers += 1;
            (chunk.unread, chunk.sleep_changed) = (true, true);
            if chunk.sleepers == chunk.own_rows().len() {
                (chunk.asleep, chunk.speed) = (true, 0.0);
            }
        }
        self.sleep_version += 1;
    }
}
