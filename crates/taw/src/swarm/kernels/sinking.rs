//! Balls that sink into others.

use super::{ContactImpulses, SolverParams, gather};
use crate::math::{Kernel, LANES, Row, Scalar, Simd, Vec3Wide};
use crate::swarm::batches::Batch;
use crate::workers::DisjointSlice;

/// Ball that sinks into another one, or into a wall.
#[derive(Clone, Copy, Debug)]
pub(in crate::swarm) struct Sinking<S> {
    pub row: u32,
    /// Speed at which the two approach, in m/s.
    pub approach_speed: S,
}

impl<S: Scalar> SolverParams<S> {
    /// Returns true if a ball of this radius sinks: within a substep it comes nearer to what it touches by
    /// more than it may, and then overlaps by more than the slop.
    pub fn sinks(&self, approach_speed: S, separation: S, radius: S, slop: S) -> bool {
        let way = approach_speed * self.time;
        way > (self.max_sinking * radius).max(separation + slop * radius)
    }
}

impl<S: Scalar> ContactImpulses<S> {
    /// Returns true if a pair that approaches so fast, in m/s, is left for the next bounce, as it bears nothing.
    pub fn bounces(
        &self,
        [batch, lane]: [usize; 2],
        approach_speed: S,
        params: &SolverParams<S>,
    ) -> bool {
        let numbers = self.numbers.get(batch);
        let restitution = numbers.map_or(params.restitution, |numbers| numbers.restitution[lane]);
        self.normal_impulse[batch][lane] == S::zero()
            && restitution > S::zero()
            && approach_speed > params.restitution_threshold
    }
}

/// Finds the balls of some batches that [sink](SolverParams::sinks) into each other.
pub(in crate::swarm) struct FindSinking<'a, S> {
    /// Centers and radii, and velocities.
    pub at: DisjointSlice<'a, Row<S>>,
    pub velocity: DisjointSlice<'a, Row<S>>,
    pub batches: &'a [Batch],
    pub impulses: &'a ContactImpulses<S>,
    pub params: &'a SolverParams<S>,
    pub found: &'a mut Vec<Sinking<S>>,
}

impl<S: Scalar> Kernel<S> for FindSinking<'_, S> {
    #[inline(always)]
    fn run<L: Simd<Scalar = S>>(self) {
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
            let slop = smaller * L::splat(S::from_f64(2.0) * params.slop);
            let most = (smaller * L::splat(params.max_sinking)).max(distance - reach + slop);
            let sinks = way.gt_mask(most * distance);
            if sinks == 0 {
                continue;
            }
            let mut speeds = [S::zero(); LANES];
            (way * (L::splat(S::one() / params.time) / distance)).store(&mut speeds);
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
