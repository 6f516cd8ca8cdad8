//! Balls that sink into others.

use super::{ContactImpulses, SolverParams, gather};
use crate::swarm::batches::Batch;
use crate::swarm::simd::{Kernel, LANES, Row, Simd};
use crate::swarm::vec3_wide::Vec3Wide;
use crate::workers::DisjointSlice;

/// Ball that sinks into another one, or into a wall.
#[derive(Clone, Copy, Debug)]
pub(in crate::swarm) struct Sinking {
    pub row: u32,
    /// Speed at which the two approach, in m/s.
    pub approach_speed: f32,
}

impl SolverParams {
    /// Returns true if a ball of this radius sinks: within a substep it comes nearer to what it touches by
    /// more than it may, and then overlaps by more than the slop.
    pub fn sinks(&self, approach_speed: f32, separation: f32, radius: f32, slop: f32) -> bool {
        let way = approach_speed * self.time;
        way > (self.max_sinking * radius).max(separation + slop * radius)
    }
}

impl ContactImpulses {
    /// Returns true if a pair that approaches so fast, in m/s, is left for the next bounce, as it bears nothing.
    pub fn bounces(
        &self,
        [batch, lane]: [usize; 2],
        approach_speed: f32,
        params: &SolverParams,
    ) -> bool {
        let numbers = self.numbers.get(batch);
        let restitution = numbers.map_or(params.restitution, |numbers| numbers.restitution[lane]);
        self.normal_impulse[batch][lane] == 0.0
            && restitution > 0.0
            && approach_speed > params.restitution_threshold
    }
}

/// Finds the balls of some batches that [sink](SolverParams::sinks) into each other.
pub(in crate::swarm) struct FindSinking<'a> {
    /// Centers and radii, and velocities.
    pub at: DisjointSlice<'a, Row>,
    pub velocity: DisjointSlice<'a, Row>,
    pub batches: &'a [Batch],
    pub impulses: &'a ContactImpulses,
    pub params: &'a SolverParams,
    pub found: &'a mut Vec<Sinking>,
}

impl Kernel for FindSinking<'_> {
    #[inline(always)]
    fn run<L: Simd>(self) {
        let Self { at, velocity, batches, impulses, params, found } = self;
        for (i, batch) in batches.iter().enumerate().filter(|(_, batch)| !batch.is_idle) {
            let [at_a, at_b] = gather::<L>(at, batch);
            let [a, b] = gather::<L>(velocity, batch);
            let displacement = Vec3Wide::of(&at_b) - Vec3Wide::of(&at_a);
            let relative = Vec3Wide::of(&b) - Vec3Wide::of(&a);
            let distance = displacement.dot(displacement).sqrt();
            // Both sides times the distance.
            let way = displacement.dot(relative) * L::splat(-params.time);
            let reach = at_a[3] + at_b[3];
            let smaller = reach - at_a[3].max(at_b[3]);
            let slop = smaller * L::splat(2.0 * params.slop);
            let most = (smaller * L::splat(params.max_sinking)).max(distance - reach + slop);
            let sinks = way.gt_mask(most * distance);
            if sinks == 0 {
                continue;
            }
            let mut speeds = [0.0; LANES];
            (way * (L::splat(1.0 / params.time) / distance)).store(&mut speeds);
            let lanes = 0..batch.count as usize;
            for lane in lanes.filter(|lane| sinks >> lane & 1 == 1) {
                let approach_speed = speeds[lane];
                if !impulses.bounces([i, lane], approach_speed, params) {
                    found.extend(batch.pair(lane).map(|row| Sinking { row, approach_speed }));
                }
            }
        }
    }
}
