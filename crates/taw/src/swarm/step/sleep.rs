//! Sleep: who wakes, and why. Who falls asleep is in [`islands`](super::islands).

use std::mem::take;

use super::islands::MAX_JOINED;
use super::{leaves, wider};

use crate::handle::NO_ROW;
use crate::math::{Row, Scalar, Vec3, length};
use crate::motion::rest::{self, sleep_speed};
use crate::swarm::batches::Batch;
use crate::swarm::chunk::Chunk;
use crate::swarm::kernels::squared;
use crate::swarm::rest::RestRows;
use crate::swarm::sleep::SleepState;
use crate::swarm::wall_contact::WallContact;
use crate::swarm::{INFINITE_MASS, StaticGeometry, Swarm};
use crate::workers::{DisjointSlice, parallel_for};
use cgmath::Zero;

impl<S: Scalar> Swarm<S> {
    /// Finds which balls fall asleep or wake, and which may leave their skin in this step. Rest lasts
    /// another `dt` seconds if this is the first look in the step.
    pub(super) fn update_sleep(&mut self, dt: S, gravity: Vec3<S>, is_first: bool) {
        if !self.proxies.is_empty() {
            self.measure_speeds_beside_proxies();
        }
        let (at, skin_left) = (&self.at[..], &self.skin_left[..]);
        let (velocity, spin) = (&self.velocity[..], &self.spin[..]);
        let (slots, bodies) = (self.ids.slots(), &self.body_slots);
        let (has_proxies, reach) = (!self.proxies.is_empty(), self.reach_of_skins());
        let weight = length(gravity);
        let looks = self.model.sleeps && weight > S::zero() && is_first;
        // More than this are too many.
        let most = self.fast_movers.remaining(self.at.len()) + 1;
        let SleepState { rest, sleepless, held, .. } = &mut self.sleep;
        let rest = rest.shared();
        let chunks = DisjointSlice::new(&mut self.chunks);
        parallel_for(self.scratch.threads, chunks.len(), |_, chunk| {
            // SAFETY: each thread has its own chunks.
            let chunk = unsafe { &mut *chunks.row(chunk) };
            if chunk.asleep {
                return;
            }
            let rows = chunk.own_rows();
            chunk.asleep = rows.is_empty();
            let (at, velocity, spin) =
                (&at[rows.clone()], &velocity[rows.clone()], &spin[rows.clone()]);
            let skin_left = &skin_left[rows.clone()];
            chunk.leaving.clear();
            let numbered = (chunk.rows[0]..).zip(velocity.iter().zip(skin_left));
            // A path is known for one step.
            let leaving = numbered.filter(|(_, (velocity, skin_left))| {
                leaves(velocity, **skin_left, dt) || **skin_left > reach
            });
            chunk.leaving.extend(leaving.map(|(row, _)| row).take(most));
            // Not its spin: on a single point a ball may spin for ever.
            chunk.speed = velocity.iter().fold(S::zero(), |most, v| most.max(squared(*v))).sqrt();
            chunk.inverse_masses = inverse_masses(velocity);
            (chunk.rests, chunk.has_rested) = (false, false);
            if !looks {
                return;
            }
            // SAFETY: rows of the chunk.
            let mut rest = unsafe {
                RestRows {
                    place: rest.place.part(rows.clone()),
                    time: rest.time.part(rows.clone()),
                }
            };
            let slot = |row: usize| slots[rows.start + row];
            let is_proxy = |row: usize| has_proxies && bodies.contains(slot(row));
            rest.update([at, velocity, spin], is_proxy, weight, dt);
            chunk.end_rest_of_carried(&mut rest);
            let is_sleepless = |row| sleepless.contains(slot(row)) || held.contains(slot(row));
            chunk.find_rest([at, velocity], is_sleepless, is_proxy, &mut rest, weight);
        });
        if is_first {
            self.fall_asleep(length(gravity));
        }
        self.wake_beside_moving(gravity, dt);
    }

    /// Wakes what sleeps beside balls that are fast enough to disturb it, or have left their place: it may
    /// have leant on them. A part of a large heap does not wake for one of those that settle about it.
    pub(super) fn wake_beside_moving(&mut self, gravity: Vec3<S>, dt: S) {
        if self.sleep.sleepers == 0 {
            return;
        }
        let gravity = length(gravity);
        let mut lists = take(&mut self.scratch.waking);
        lists.resize_with(self.chunks.len() + 1, Vec::new);
        let (chunks, velocity, at) = (&self.chunks, &self.velocity[..], &self.at[..]);
        let (slots, SleepState { rest, groups, .. }) = (self.ids.slots(), &self.sleep);
        let disturbs = |awake: usize, asleep: usize| {
            let [a, b] = [&at[awake], &at[asleep]];
            let speed = squared(velocity[awake]).sqrt();
            let apart = squared([b[0] - a[0], b[1] - a[1], b[2] - a[2], S::zero()]).sqrt();
            let (radii, gap) = (a[3] + b[3], apart - (a[3] + b[3]));
            // It touched where it was, as far away as it may have gone since, or will in this step.
            let reach = S::from_f64(rest::PLACE) * (S::from_f64(2.0) * a[3] + radii) + speed * dt;
            // Nothing turns it aside.
            let pushes =
                velocity[awake][3] <= S::from_f64(INFINITE_MASS) && !rest.is_at_rest(awake);
            (pushes || speed > S::from_f64(2.0) * sleep_speed(gravity, b[3]))
                && gap <= S::from_f64(2.0) * speed * dt
                || rest.has_left(awake)
                    && gap <= reach
                    && groups.visit(slots[asleep], MAX_JOINED, |_| ())
        };
        let list = |batches: &[Batch], waking: &mut Vec<u32>| {
            for pair in batches.iter().filter(|batch| !batch.is_idle).flat_map(Batch::pairs) {
                let [a, b] = pair.map(|row| row as usize);
                let asleep = [a, b].map(|row| velocity[row][3].is_sign_negative());
                match asleep {
                    [false, true] if disturbs(a, b) => waking.push(b as u32),
                    [true, false] if disturbs(b, a) => waking.push(a as u32),
                    _ => (),
                }
            }
        };
        let of_chunks = DisjointSlice::new(&mut lists);
        parallel_for(self.scratch.threads, chunks.len(), |_, i| {
            // SAFETY: each chunk has its own list.
            let waking = unsafe { &mut *of_chunks.row(i) };
            waking.clear();
            let both = [chunks.get(i), chunks.get(i + 1)];
            let both = || both.into_iter().flatten();
            if both().any(|chunk| chunk.sleepers > 0) && both().any(|chunk| !chunk.asleep) {
                list(&chunks[i].batches, waking);
            }
        });
        if let Some(last) = lists.last_mut() {
            last.clear();
            list(&self.fast_movers.batches, last);
        }
        for row in lists.iter_mut().flat_map(|waking| waking.drain(..)) {
            self.wake_group(row as usize);
        }
        self.scratch.waking = lists;
    }

    /// Wakes what swift balls may meet on their paths, however many chunks away.
    pub(super) fn wake_on_paths(&mut self) {
        if !self.has_swift() {
            return;
        }
        let (reach, fast_movers) = (self.reach_of_skins(), take(&mut self.fast_movers));
        for [a, b] in fast_movers.batches.iter().flat_map(Batch::pairs) {
            for [swift, met] in [[a as usize, b as usize], [b as usize, a as usize]] {
                if self.skin_left[swift] > reach && self.velocity[swift][3].is_sign_positive() {
                    self.wake_group(met);
                }
            }
        }
        for [a, b] in &fast_movers.crossing {
            let [a, b] = [*a as usize, *b as usize];
            for [swift, met] in [[a, b], [b, a]] {
                if self.velocity[swift][3].is_sign_positive() {
                    self.wake_group(met);
                }
            }
        }
        self.fast_movers = fast_movers;
    }

    /// Wakes a ball that something changes from outside; those that may lean on it wake when the step begins.
    pub(in crate::swarm) fn wake(&mut self, row: usize) {
        if self.model.sleeps {
            self.sleep.stirred.insert(self.ids.slots()[row]);
        }
        self.wake_group(row);
        self.sleep.rest.end(row);
    }

    /// Wakes a ball that sleeps, and all that fell asleep with it.
    fn wake_group(&mut self, row: usize) {
        if self.velocity[row][3].is_sign_positive() {
            return;
        }
        let (slots, rows) = (self.ids.slots(), self.ids.rows());
        let sleepers = &mut self.sleep.sleepers;
        let (velocity, rest, chunks) = (&mut self.velocity, &mut self.sleep.rest, &mut self.chunks);
        self.sleep.groups.dissolve(slots[row], |slot| {
            let row = rows[slot as usize] as usize;
            velocity[row][3] = velocity[row][3].abs();
            rest.end(row);
            *sleepers -= 1;
            if self.pairs_valid {
                let chunk = chunks.partition_point(|chunk| chunk.rows[1] as usize <= row);
                let chunk = &mut chunks[chunk];
                chunk.sleepers -= 1;
                (chunk.asleep, chunk.sleep_changed) = (false, true);
            }
        });
        *self.sleep_version += 1;
    }

    /// Wakes what sleeps beside balls that were changed from outside since the last step, and ends the rest
    /// of what is awake there.
    pub(in crate::swarm) fn wake_beside_stirred(&mut self) {
        if self.sleep.stirred.is_empty() {
            return;
        }
        let someone_rests = self.sleep.sleepers > 0 || self.sleep.rest.is_any_at_rest();
        if !(someone_rests && (self.pairs_valid || self.cache_valid)) {
            return self.sleep.stirred.clear();
        }
        let mut stirred = take(&mut self.sleep.stirred);
        let slots = self.ids.slots();
        // Pairs have the rows that balls had when they were found.
        let rows_now = self.cache_valid.then(|| inverse(&self.old_rows));
        let row_now = |then: u32| match &rows_now {
            Some(rows) => rows.get(then as usize).copied().unwrap_or(NO_ROW),
            None => then,
        };
        let row_then = |row: u32| if self.cache_valid { self.old_rows[row as usize] } else { row };
        let mut rows = take(&mut self.scratch.rows);
        rows.clear();
        rows.extend(stirred.iter().map(|slot| row_then(self.ids.rows()[slot as usize])));
        rows.sort_unstable();
        let of_chunks = self.chunks.iter().filter(|chunk| {
            let first = rows.partition_point(|row| *row < chunk.rows[0]);
            rows.get(first).is_some_and(|row| *row < chunk.rows[2])
        });
        let mut beside = Vec::new();
        let batches = of_chunks.flat_map(|chunk| &chunk.batches);
        for pair in batches.chain(&self.fast_movers.batches).flat_map(Batch::pairs) {
            let [a, b] = pair.map(row_now);
            if a != NO_ROW && b != NO_ROW {
                let is_stirred = |row: u32| stirred.contains(slots[row as usize]);
                let rests = |row: u32| {
                    let row = row as usize;
                    self.velocity[row][3].is_sign_negative() || self.sleep.rest.is_at_rest(row)
                };
                let both = [[a, b], [b, a]].into_iter();
                beside.extend(
                    both.filter(|[by, of]| is_stirred(*by) && rests(*of)).map(|[_, of]| of),
                );
            }
        }
        for row in beside.into_iter().map(|row| row as usize) {
            self.wake_group(row);
            self.sleep.rest.end(row);
        }
        stirred.clear();
        (self.sleep.stirred, self.scratch.rows) = (stirred, rows);
    }

    /// Wakes all balls.
    pub(crate) fn wake_all(&mut self) {
        for chunk in &mut self.chunks {
            chunk.sleep_changed |= chunk.sleepers > 0;
            (chunk.asleep, chunk.sleepers) = (false, 0);
        }
        for velocity in &mut self.velocity {
            velocity[3] = velocity[3].abs();
        }
        *self.sleep_version += u64::from(std::mem::take(&mut self.sleep.sleepers) > 0);
        self.sleep.rest.end_all();
        self.sleep.groups.clear();
        self.sleep.stirred.clear();
    }

    /// Wakes the balls near walls that changed since the last step.
    pub(super) fn wake_beside_changes(&mut self, walls: &dyn StaticGeometry<S>) {
        let mut regions = Vec::new();
        let known = self
            .walls_identity
            .0
            .is_some_and(|since| walls.visit_changes_since(since, &mut |box_| regions.push(box_)));
        if !known {
            return self.wake_all();
        }
        for row in 0..self.at.len() {
            let is_asleep = self.velocity[row][3].is_sign_negative();
            if is_asleep || self.sleep.rest.is_at_rest(row) {
                let reach = self.at[row][3] + self.skin_left[row].max(S::zero());
                if regions.iter().any(|region| overlaps(region, &self.at[row], reach)) {
                    self.wake(row);
                }
            }
        }
    }

    /// Marks the batches whose balls all sleep, for passes to skip them.
    pub(super) fn mark_idle_batches(&mut self) {
        let version = *self.sleep_version;
        if self.scratch.idle_marked_at.replace(version) == Some(version) {
            return;
        }
        for i in 0..self.chunks.len() {
            let next = self.chunks.get(i + 1);
            let next = next.map_or([false, true], |next| [next.sleep_changed, next.asleep]);
            let chunk = &mut self.chunks[i];
            let changed = std::mem::take(&mut chunk.sleep_changed) || next[0];
            chunk.marks_idle = changed && !(chunk.asleep && next[1]);
        }
        let velocity = &self.velocity;
        let is_asleep = |row: u32| velocity[row as usize][3].is_sign_negative();
        let chunks = DisjointSlice::new(&mut self.chunks);
        parallel_for(self.scratch.threads, chunks.len(), |_, chunk| {
            // SAFETY: each thread has its own chunks.
            let chunk = unsafe { &mut *chunks.row(chunk) };
            if chunk.marks_idle {
                for batch in &mut chunk.batches {
                    let is_idle = batch.pairs().flatten().all(is_asleep);
                    batch.is_idle = is_idle;
                }
            }
        });
    }
}

impl<S: Scalar> Chunk<S> {
    /// Ends the rest of balls that a moving wall bears. (A wall that bears a proxy moves as the proxy does.)
    fn end_rest_of_carried(&self, rest: &mut RestRows<S>) {
        let is_carried = |contact: &&WallContact<S>| {
            contact.impulse.normal > S::zero() && !contact.surface.is_zero() && !contact.bears_proxy
        };
        for contact in self.wall_contacts.iter().filter(is_carried) {
            rest.end((contact.row - self.rows[0]) as usize);
        }
    }

    /// Finds out if its balls have rested for long enough to sleep: all of them, or any that is no proxy; no
    /// sleepless one counts.
    fn find_rest(
        &mut self,
        [at, velocity]: [&[Row<S>]; 2],
        is_sleepless: impl Fn(usize) -> bool,
        is_proxy: impl Fn(usize) -> bool,
        rest: &mut RestRows<S>,
        gravity: S,
    ) {
        if self.fastest_own == Some(S::infinity()) {
            rest.end_all();
            return;
        }
        let awake = || (0..at.len()).filter(|row| velocity[*row][3].is_sign_positive());
        let lasts = |row: usize| rest.lasts(row, at[row][3], gravity);
        self.has_rested = awake().any(|row| lasts(row) && !is_sleepless(row) && !is_proxy(row));
        self.rests =
            awake().all(|row| rest.lasts(row, self.radii[1], gravity) && !is_sleepless(row));
    }
}

/// Place of each number in a list, or [`NO_ROW`]. Numbers that stand for nothing are left out.
fn inverse(numbers: &[u32]) -> Vec<u32> {
    let count = numbers.iter().filter(|number| **number != NO_ROW).max().map_or(0, |max| max + 1);
    let mut places = vec![NO_ROW; count as usize];
    for (place, number) in (0..).zip(numbers) {
        if let Some(of_number) = places.get_mut(*number as usize) {
            *of_number = place;
        }
    }
    places
}

/// Least and largest inverse mass of some balls, in 1/kg.
pub(in crate::swarm) fn inverse_masses<S: Scalar>(velocity: &[Row<S>]) -> [S; 2] {
    velocity.iter().map(|velocity| [velocity[3].abs(); 2]).fold([S::max_value(), S::zero()], wider)
}

/// Returns true if a box and one of this half width about a ball overlap, or may by rounding.
fn overlaps<S: Scalar>([low, high]: &[[S; 3]; 2], at: &Row<S>, reach: S) -> bool {
    (0..3).all(|axis| {
        let reach = reach + S::from_f64(4.0) * S::epsilon() * (at[axis].abs() + reach);
        at[axis] + reach >= low[axis] && at[axis] - reach <= high[axis]
    })
}
