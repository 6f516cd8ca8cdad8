//! Sleep of chunks.

use std::mem::take;

use super::{leaves, wider};
use cgmath::Zero;

use crate::math::{Vec3, length};
use crate::swarm::batches::Batch;
use crate::swarm::chunk::Chunk;
use crate::swarm::grid::Grid;
use crate::swarm::kernels::{GROUNDED, squared};
use crate::swarm::simd::Row;
use crate::swarm::{StaticGeometry, Swarm};
use crate::workers::{DisjointSlice, parallel_for};

impl Swarm {
    /// Finds which chunks fall asleep or wake, and which balls may leave their skin in this step.
    pub(super) fn update_sleep(&mut self, dt: f32, gravity: Vec3<f32>) {
        let sleeps = self.model.sleeps;
        if !self.proxies.is_empty() {
            self.measure_speeds_beside_proxies();
        }
        let (grid, at, skin_left) = (&self.grid, &self.at[..], &self.skin_left[..]);
        let (slots, sleepless, bodies) = (self.ids.slots(), &self.sleepless, &self.body_slots);
        let has_proxies = !self.proxies.is_empty();
        let (all_may_sleep, reach) = (sleepless.is_empty(), self.reach_of_skins());
        // More than this are too many.
        let most = self.fast_movers.remaining(self.at.len()) + 1;
        let velocity = DisjointSlice::new(&mut self.velocity);
        let spin = DisjointSlice::new(&mut self.spin);
        let chunks = DisjointSlice::new(&mut self.chunks);
        parallel_for(self.scratch.threads, chunks.len(), |_, chunk| {
            // SAFETY: each thread has its own chunks, and their rows.
            let chunk = unsafe { &mut *chunks.row(chunk) };
            if chunk.asleep {
                return;
            }
            let (velocity, spin) =
                unsafe { (velocity.part(chunk.own_rows()), spin.part(chunk.own_rows())) };
            let skin_left = &skin_left[chunk.own_rows()];
            chunk.leaving.clear();
            let rows = (chunk.rows[0]..).zip(velocity.iter().zip(skin_left));
            // A path is known for one step.
            let leaving = rows.filter(|(_, (velocity, skin_left))| {
                leaves(velocity, **skin_left, dt) || **skin_left > reach
            });
            chunk.leaving.extend(leaving.map(|(row, _)| row).take(most));
            chunk.speed = largest_speeds(chunk, velocity, grid);
            let inverse_masses = velocity.iter().map(|velocity| [velocity[3].abs(); 2]);
            chunk.inverse_masses = inverse_masses.fold([f32::MAX, 0.0], wider);
            let own_slots = &slots[chunk.own_rows()];
            let fastest = chunk.fastest_own.unwrap_or(chunk.speed[0]);
            if !sleeps || fastest >= sleep_speed(gravity, chunk.radii[1]) {
                chunk.rest.end();
                return;
            }
            let rows = [&at[chunk.own_rows()], &*velocity, &*spin];
            let is_proxy = |row: usize| has_proxies && bodies.contains(own_slots[row]);
            let rests = chunk.rests(rows, is_proxy, gravity, dt);
            let may_sleep =
                || all_may_sleep || !own_slots.iter().any(|slot| sleepless.contains(*slot));
            if rests && may_sleep() {
                chunk.rest.end();
                chunk.fell_asleep = true;
                (chunk.asleep, chunk.speed) = (true, [0.0; 3]);
                chunk.leaving.clear();
                for (velocity, spin) in velocity.iter_mut().zip(spin) {
                    *velocity = [0.0, 0.0, 0.0, -velocity[3]];
                    *spin = [0.0, 0.0, 0.0, GROUNDED];
                }
            }
        });
        let chunks = &mut self.chunks;
        let fell_asleep =
            chunks.iter_mut().filter_map(|chunk| take(&mut chunk.fell_asleep).then_some(()));
        self.sleep_version += fell_asleep.count() as u64;
        self.wake_beside_fast(gravity);
    }

    /// Wakes the chunks beside balls that are fast enough to disturb them.
    fn wake_beside_fast(&mut self, gravity: Vec3<f32>) {
        let chunks = &mut self.chunks;
        for i in 0..chunks.len() {
            let before = i.checked_sub(1).map_or(0.0, |i| chunks[i].speed[2]);
            let after = chunks.get(i + 1).map_or(0.0, |chunk| chunk.speed[1]);
            // The lightest touch that would count among its smallest balls.
            let sleep_speed = sleep_speed(gravity, chunks[i].radii[0]);
            if chunks[i].asleep && before.max(after) > 2.0 * sleep_speed {
                chunks[i].wake(&mut self.velocity);
                self.sleep_version += 1;
            }
        }
    }

    /// Wakes what swift balls may meet on their paths, however many chunks away.
    pub(super) fn wake_on_paths(&mut self) {
        if !self.has_swift() {
            return;
        }
        let (reach, fast_movers) = (self.reach_of_skins(), take(&mut self.fast_movers));
        for [a, b] in fast_movers.batches.iter().flat_map(Batch::pairs) {
            for [swift, met] in [[a as usize, b as usize], [b as usize, a as usize]] {
                let [by, of] = [swift, met].map(|row| self.velocity[row][3]);
                if self.skin_left[swift] > reach && by.is_sign_positive() && of.is_sign_negative() {
                    self.wake(met);
                }
            }
        }
        for [a, b] in &fast_movers.crossing {
            let [a, b] = [*a as usize, *b as usize];
            for [swift, met] in [[a, b], [b, a]] {
                if self.velocity[swift][3].is_sign_positive()
                    && self.velocity[met][3].is_sign_negative()
                {
                    self.wake(met);
                }
            }
        }
        self.fast_movers = fast_movers;
    }

    /// Wakes a ball, and its chunk.
    pub(in crate::swarm) fn wake(&mut self, row: usize) {
        if self.pairs_valid {
            let chunks = &mut self.chunks;
            let chunk = chunks.partition_point(|chunk| chunk.rows[1] as usize <= row);
            if let Some(chunk) = chunks.get_mut(chunk) {
                self.sleep_version += u64::from(chunk.asleep);
                chunk.wake(&mut self.velocity);
            }
        }
        self.velocity[row][3] = self.velocity[row][3].abs();
    }

    /// Wakes all balls.
    pub(in crate::swarm) fn wake_all(&mut self) {
        for chunk in &mut self.chunks {
            chunk.asleep = false;
            chunk.rest.end();
        }
        let mut any = false;
        for velocity in &mut self.velocity {
            any |= velocity[3].is_sign_negative();
            velocity[3] = velocity[3].abs();
        }
        self.sleep_version += u64::from(any);
    }

    /// Wakes the chunks with balls near walls that changed since the last step.
    pub(super) fn wake_beside_changes(&mut self, walls: &dyn StaticGeometry) {
        let mut regions = Vec::new();
        let since = self.walls_identity.filter(|_| self.pairs_valid);
        let known = since
            .is_some_and(|since| walls.visit_changes_since(since, &mut |box_| regions.push(box_)));
        if !known {
            return self.wake_all();
        }
        for chunk in &mut self.chunks {
            let is_near = |row: usize| {
                let reach = self.at[row][3] + self.skin_left[row].max(0.0);
                regions.iter().any(|region| overlaps(region, &self.at[row], reach))
            };
            if (chunk.asleep || chunk.rest.began()) && chunk.own_rows().any(is_near) {
                self.sleep_version += u64::from(chunk.asleep);
                chunk.wake(&mut self.velocity);
            }
        }
    }
}

/// Largest speed of a ball of a chunk, of one in its first layer, and of one in its last, in m/s.
fn largest_speeds(chunk: &Chunk, velocity: &[Row], grid: &Grid) -> [f32; 3] {
    let fastest = |from: u32, to: u32| {
        let rows = (from - chunk.rows[0]) as usize..(to - chunk.rows[0]) as usize;
        // Not its spin: on a single point a ball may spin for ever.
        velocity[rows].iter().fold(0.0_f32, |most, v| most.max(squared(*v))).sqrt()
    };
    let [first, last] = [chunk.layers[0] + 1, chunk.layers[1] - 1];
    [
        fastest(chunk.rows[0], chunk.rows[1]),
        fastest(chunk.rows[0], grid.first_of_layer(first)),
        fastest(grid.first_of_layer(last), chunk.rows[1]),
    ]
}

/// Returns true if a box and one of this half width about a ball overlap, or may by rounding.
fn overlaps([low, high]: &[[f32; 3]; 2], at: &Row, reach: f32) -> bool {
    (0..3).all(|axis| {
        let reach = reach + 4.0 * f32::EPSILON * (at[axis].abs() + reach);
        at[axis] + reach >= low[axis] && at[axis] - reach <= high[axis]
    })
}

/// Speed in m/s up to which a ball counts as resting, by what gravity makes of it in its radius.
pub(in crate::swarm) fn sleep_speed(gravity: Vec3<f32>, radius: f32) -> f32 {
    if gravity.is_zero() { 0.0 } else { 0.05 * (length(gravity) * radius).sqrt() }
}
