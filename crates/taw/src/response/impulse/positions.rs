//! Position update and position correction, after velocities are solved.

use super::{Colliders, Constraint, Context};
use crate::math::{Point3, Scalar, Vec3, length};
use crate::response::SolverBodies;

/// Iterations of the position solver over penetrating contacts.
const POSITION_ITERATIONS: u32 = 3;

impl<S: Scalar> SolverBodies<'_, S> {
    /// Updates positions by the solver's velocity changes since `initial_velocity`: those of a
    /// bounce from its time of impact on, all others with the integrator's position weight.
    pub(super) fn update_positions(
        &mut self,
        initial_velocity: &[Vec3<S>],
        constraints: &[Constraint<S>],
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    ) {
        let follow_time = |row: usize| context.follow_time_of(row);
        for (row, initial_velocity) in initial_velocity.iter().enumerate() {
            let change = self.velocity[row] - initial_velocity;
            self.displace(row, context.displacement_of(row, change));
        }
        for c in constraints {
            let Some(time_since_impact) = c.time_since_impact else { continue };
            let impulse = c.impulse() / c.inverse_effective_mass.normal;
            for (row, impulse) in [(Some(c.b), impulse), (c.a.marble(), -impulse)] {
                let Some(row) = row else { continue };
                let change = impulse * self.inverse_mass[row];
                if !context.is_ccd_stopped(row) {
                    self.displace(row, change * (time_since_impact - follow_time(row)));
                }
            }
        }
    }

    /// Solves positions (nonlinear Gauss–Seidel): resolves half of the penetration beyond the slop
    /// per iteration, by mass, without pushing anything deeper into a wall than it was, nor far by
    /// other marbles.
    pub(super) fn solve_positions(
        &mut self,
        constraints: &[Constraint<S>],
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
        separations: &mut Vec<S>,
        uncorrected: &mut Vec<Point3<S>>,
    ) {
        uncorrected.clear();
        uncorrected.extend_from_slice(self.position);
        let walls = constraints.iter().take_while(|c| c.a.marble().is_none());
        separations.clear();
        separations.extend(walls.clone().map(|c| self.min_separation(c, context)));
        for _ in 0..POSITION_ITERATIONS {
            for c in constraints {
                self.solve_position(c, context, uncorrected);
            }
            for (c, separation) in walls.clone().zip(&*separations) {
                self.restore_wall_separation(c, *separation, context);
            }
        }
    }

    /// Lower bound of a wall contact's separation during the position solve, in metres: the present
    /// penetration, or the slop.
    fn min_separation(
        &self,
        c: &Constraint<S>,
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    ) -> S {
        let contact =
            self.normal_and_separation(self.position, c.a, c.b, c.axis_offset, context.walls);
        contact.map_or_else(S::neg_infinity, |(_, separation)| {
            separation.min(-self.allowed_penetration(c, context))
        })
    }

    /// Moves a marble back out of a wall that others pushed it into.
    fn restore_wall_separation(
        &mut self,
        c: &Constraint<S>,
        kept: S,
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    ) {
        let contact =
            self.normal_and_separation(self.position, c.a, c.b, c.axis_offset, context.walls);
        let Some((normal, separation)) = contact else { return };
        if separation < kept && self.inverse_mass[c.b] > S::zero() {
            let out = self.locked_axes(c.b).escape(normal);
            self.displace(c.b, out * (kept - separation));
        }
    }

    /// Allowed penetration (slop), in metres, so that resting marbles need not fall back in every
    /// substep.
    fn allowed_penetration(
        &self,
        c: &Constraint<S>,
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    ) -> S {
        let settings = context.settings;
        let min_radius =
            c.a.marble().map_or(self.radius[c.b], |a| self.radius[a].min(self.radius[c.b]));
        settings.slop.min(min_radius * settings.max_relative_slop)
    }

    fn solve_position(
        &mut self,
        c: &Constraint<S>,
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
        uncorrected: &[Point3<S>],
    ) {
        let contact =
            self.normal_and_separation(self.position, c.a, c.b, c.axis_offset, context.walls);
        let Some((normal, separation)) = contact else { return };
        let excess = -separation - self.allowed_penetration(c, context);
        if excess <= S::zero() {
            return;
        }
        let pseudo_impulse = normal * (excess * S::from_f64(0.5) / c.inverse_effective_mass.normal);
        let moves = [(Some(c.b), pseudo_impulse), (c.a.marble(), -pseudo_impulse)]
            .map(|(row, impulse)| row.map(|row| (row, impulse * self.inverse_mass[row])));
        let mut part = S::one();
        // Along free axes, a wall at a small angle pushes far.
        if c.a.marble().is_some() || !self.locked_axes(c.b).moves_freely() {
            for (row, displacement) in moves.into_iter().flatten() {
                let distance = length(displacement);
                let left = self.radius[row] * context.settings.max_relative_push
                    - length(self.position[row] - uncorrected[row]);
                if left < distance {
                    // One part for both, which keeps their center of mass.
                    part = part.min(left.max(S::zero()) / distance);
                }
            }
        }
        for (row, displacement) in moves.into_iter().flatten() {
            self.displace(row, displacement * part);
        }
    }
}
