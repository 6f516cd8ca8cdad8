//! Impulse and work of walls and forces on balls, for the energy audit.

use cgmath::{InnerSpace, Zero};

use super::Swarm;
use super::chunk::Chunk;
use super::scratch::SwarmScratch;
use super::wall_contact::{WallContact, xyz};
use crate::math::{Row, Scalar, Vec3, cast_vector};

/// Impulse and work on a ball in a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OutsideWork {
    /// Impulse of walls, gravity and forces, in N s.
    pub impulse: Vec3<f64>,
    /// Work of moving walls, in joules.
    pub walls: f64,
    /// Work of forces other than gravity, in joules.
    pub forces: f64,
}

impl OutsideWork {
    const NONE: Self = Self { impulse: Vec3::new(0.0, 0.0, 0.0), walls: 0.0, forces: 0.0 };

    /// Records what a wall did to the velocity of a ball.
    pub(super) fn record_wall<S: Scalar>(
        &mut self,
        contact: &WallContact<S>,
        before: &Row<S>,
        after: &Row<S>,
    ) {
        let impulse = impulse(before, after);
        self.impulse += impulse;
        self.walls += impulse.dot(cast_vector(contact.surface));
    }

    /// Records the lift of a ball of this inverse mass that a wall pushes out: as far as the wall came in
    /// `h` seconds, its work against gravity.
    pub(super) fn record_push<S: Scalar>(
        &mut self,
        contact: &WallContact<S>,
        [push, h]: [S; 2],
        inverse_mass: S,
        gravity: Vec3<S>,
    ) {
        let came = (contact.surface.dot(contact.normal) * h).max(S::zero()).min(push);
        self.walls -= (contact.normal.dot(gravity) * came).as_f64() / inverse_mass.as_f64();
    }

    /// Records what a force did to the velocity of a ball, to which gravity adds this much.
    pub(super) fn record_force<S: Scalar>(
        &mut self,
        before: &Row<S>,
        after: &Row<S>,
        fall: Vec3<S>,
    ) {
        let impulse = impulse(before, after);
        self.impulse += impulse;
        let mean = (xyz(before) + xyz(after) + fall) * S::from_f64(0.5);
        self.forces += impulse.dot(cast_vector(mean));
    }
}

/// Impulse that changes the velocity of a row, in N s.
fn impulse<S: Scalar>(before: &Row<S>, after: &Row<S>) -> Vec3<f64> {
    let [old, new] = [before, after].map(|row| cast_vector::<S, f64>(xyz(row)));
    (new - old) / before[3].abs().as_f64()
}

impl<S: Scalar> Swarm<S> {
    /// Records [impulse and work](OutsideWork) on each ball in the next step.
    pub(crate) fn record_outside_work(&mut self) {
        let slots = self.ids.rows().len();
        self.scratch.outside_work.clear();
        self.scratch.outside_work.resize(slots, OutsideWork::NONE);
    }

    /// Impulse and work by slot in the last step, if they were recorded.
    pub(crate) fn take_outside_work(&mut self) -> Vec<OutsideWork> {
        std::mem::take(&mut self.scratch.outside_work)
    }

    /// Records what gravity does in a substep of `h` seconds.
    pub(super) fn record_gravity(&mut self, h: S) {
        if self.scratch.outside_work.is_empty() {
            return;
        }
        let fall = cast_vector::<S, f64>(self.gravity.unwrap_or_else(Vec3::zero) * h);
        for at in self.chunks.iter().filter(|chunk| !chunk.asleep).flat_map(Chunk::own_rows) {
            let (slot, inverse_mass) = (self.ids.slots()[at] as usize, self.velocity[at][3]);
            if inverse_mass.is_sign_positive() {
                self.scratch.outside_work[slot].impulse += fall / inverse_mass.as_f64();
            }
        }
    }

    /// Records what walls behind balls bore in a substep for others that press on the ball.
    pub(super) fn record_borne(&mut self) {
        if self.scratch.outside_work.is_empty() {
            return;
        }
        let SwarmScratch { backing, backing_speed, outside_work, .. } = &mut self.scratch;
        for (row, (behind, slot)) in backing.iter().zip(self.ids.slots()).enumerate() {
            let (borne, work) = (behind[3].max(S::zero()), &mut outside_work[*slot as usize]);
            work.impulse += cast_vector::<S, f64>(xyz(behind) * borne);
            let speed = backing_speed.get(row).copied().unwrap_or_default();
            work.walls += (borne * speed).as_f64();
        }
    }
}
