//! Overlap that no motion brought about: of balls inserted into each other, of a radius or a wall that was
//! set. It is no energy, so it loads no spring, and is resolved by positions alone (Macklin et al.,
//! *Unified particle physics for real-time applications*, 2014, §4.4).

use cgmath::{InnerSpace, Zero};

use super::contact::PenaltyContact;
use super::force::ContactForce;
use super::{PenaltySettings, SpringHistory};
use crate::math::{Scalar, Vec3, is_finite_point, length};
use crate::response::{Colliders, SolverBodies};

/// Passes over all contacts per substep, each of which resolves half of what is left.
const PASSES: u32 = 3;

impl<S, W, F> PenaltySettings<'_, S, W, F>
where
    S: Scalar,
    W: Colliders<S>,
    F: Fn(usize) -> S,
{
    /// Overlap of a contact that loads no spring, in metres.
    pub(super) fn overlap(
        &self,
        contact: &PenaltyContact<S>,
        known: Option<SpringHistory<S>>,
        before: &[SpringHistory<S>],
        depths: &[S],
    ) -> S {
        known.map_or_else(
            || self.initial_overlap(contact, before, depths),
            |history| history.overlap.min(contact.penetration),
        )
    }

    /// Overlap of a new contact that its two did not move into, in metres; zero where they touched at the last
    /// kick. In a substep they come no deeper than they approach in it, twice that where forces slowed
    /// them, and what gravity adds; and in a wall, than twice as deep as the marble was in others, from which it
    /// may have come.
    fn initial_overlap(
        &self,
        contact: &PenaltyContact<S>,
        before: &[SpringHistory<S>],
        depths: &[S],
    ) -> S {
        let key = contact.key;
        let first = before.partition_point(|history| history.key < key.first_of_both());
        if before.get(first).is_some_and(|history| history.key.has_bodies_of(key)) {
            return S::zero();
        }
        let settings = self.context.settings;
        let approach_speed = -contact.relative_velocity.dot(contact.normal);
        let approach = approach_speed.max(S::zero()) * settings.dt;
        let fall = length(settings.gravity) * settings.dt * settings.dt;
        let depth = if contact.a.is_none() { depths[contact.b] } else { S::zero() };
        let motion = depth + approach;
        if contact.penetration > motion + motion + fall {
            contact.penetration - approach
        } else {
            S::zero()
        }
    }

    /// Moves apart what overlaps by no motion of its own, by mass, each marble by a part of its radius at
    /// most, and none deeper into a wall. What is pushed into another one overlaps that by no motion
    /// either.
    pub(super) fn part_overlaps(
        &self,
        marbles: &mut SolverBodies<S>,
        forces: &mut [ContactForce<S>],
        pushes: &mut Vec<Vec3<S>>,
    ) {
        if forces.iter().all(|force| force.history.overlap == S::zero()) {
            return;
        }
        pushes.clear();
        pushes.resize(marbles.position.len(), Vec3::zero());
        for _ in 0..PASSES {
            for force in forces.iter().filter(|force| force.history.overlap > S::zero()) {
                self.push_apart(marbles, force, pushes);
            }
            for ContactForce { contact, .. } in forces.iter().filter(|it| it.contact.a.is_none()) {
                let inward = pushes[contact.b].dot(contact.normal).min(S::zero());
                let out = marbles.locked_axes(contact.b).escape(contact.normal);
                pushes[contact.b] -= out * inward;
            }
        }
        for (position, push) in marbles.position.iter_mut().zip(&*pushes) {
            let pushed = *position + *push;
            if is_finite_point(pushed) {
                *position = pushed;
            }
        }
        for force in forces {
            let left = force.history.overlap - force.parted(pushes);
            force.history.overlap = if left.is_finite() { left.max(S::zero()) } else { S::zero() };
        }
    }

    /// Pushes the two of a contact apart by half of what is left of their overlap.
    fn push_apart(
        &self,
        marbles: &SolverBodies<S>,
        force: &ContactForce<S>,
        pushes: &mut [Vec3<S>],
    ) {
        let contact = &force.contact;
        let left = force.history.overlap - force.parted(pushes);
        let rows = [contact.a, Some(contact.b)];
        let share = |row: &usize| marbles.locked_axes(*row).share(contact.normal);
        let inverse_mass = |row: &usize| marbles.inverse_mass[*row] * share(row);
        let sum = rows.iter().flatten().map(inverse_mass).fold(S::zero(), |sum, x| sum + x);
        if left <= S::zero() || sum <= S::zero() {
            return;
        }
        let push = contact.normal * (left * S::from_f64(0.5) / sum);
        let moves = [(contact.a, -push), (Some(contact.b), push)]
            .map(|(row, push)| row.map(|row| (row, push * marbles.inverse_mass[row])))
            .map(|push| {
                push.map(|(row, push)| (row, marbles.locked_axes(row).free_translation(push)))
            });
        // One fraction for both, which keeps their center of mass.
        let mut fraction = S::one();
        for (row, push) in moves.iter().flatten() {
            let (distance, most) = (length(*push), self.max_push(marbles, *row));
            let free = (most - length(pushes[*row])).max(S::zero());
            // Along free axes, a wall at a small angle pushes far.
            let is_limited = contact.a.is_some() || !marbles.locked_axes(*row).moves_freely();
            if is_limited && free < distance {
                fraction = fraction.min(free / distance);
            }
        }
        for (row, push) in moves.into_iter().flatten() {
            pushes[row] += push * fraction;
        }
    }

    /// Largest distance by which other marbles push one in a substep, in metres.
    fn max_push(&self, marbles: &SolverBodies<S>, row: usize) -> S {
        marbles.radius[row] * self.context.settings.max_relative_push
    }
}

/// Deepest penetration of each marble into a wall at the last kick, in metres.
pub(super) fn depths_in_walls<S: Scalar>(
    before: &[SpringHistory<S>],
    marbles: usize,
    depths: &mut Vec<S>,
) {
    depths.clear();
    depths.resize(marbles, S::zero());
    for history in before {
        if let Some(depth) = history.key.marble_at_wall().and_then(|row| depths.get_mut(row)) {
            *depth = depth.max(history.penetration);
        }
    }
}

impl<S: Scalar> ContactForce<S> {
    /// Distance by which pushes part the two, in metres.
    fn parted(&self, pushes: &[Vec3<S>]) -> S {
        let first = self.contact.a.map_or_else(Vec3::zero, |a| pushes[a]);
        (pushes[self.contact.b] - first).dot(self.contact.normal)
    }
}
