//! The iterations of the impulse method: velocities that all contacts agree on.

use cgmath::{InnerSpace, Zero};

use super::islands::{DIRECTIONS, Island, Islands, SearchStep};
use super::{Constraint, SolverSettings};
use crate::math::{Scalar, Vec3, is_finite, length};
use crate::response::SolverBodies;
use crate::response::impact::clamp_length;

/// Sweeps over the contacts until they agree, or as often as the settings allow, in those
/// islands that do not agree yet.
///
/// Sweep by sweep alone (Gauss and Seidel), a heavy marble on a light one would take as
/// many sweeps as it is times as heavy. So after each sweep the solver looks, of all impulses that
/// are some of this sweep and some of the ways that it went before, for the best ones: sweeps as
/// preconditioner of a search in a small subspace, as in Anderson's mixing (*Iterative procedures
/// for nonlinear integral equations*, 1965) and, for contacts, Silcowitz, Niebe and Erleben, *A
/// nonsmooth nonlinear conjugate gradient method for interactive contact force problems*, 2010.
///
/// With `f` the impulses, `A f` the change of velocity that they make at the contacts and `w`
/// the change that the contacts ask for, sweeps and searches lower `½ f·A f − f·w`, the
/// energy of what is still wanted. Sweeps end the iterations, never a search.
pub(super) fn iterate<S: Scalar>(
    marbles: &mut SolverBodies<S>,
    constraints: &mut [Constraint<S>],
    islands: &mut Islands<S>,
    settings: &SolverSettings<S>,
) {
    for iteration in 0..settings.iterations {
        for c in constraints.iter_mut() {
            if islands.of(c).converged {
                continue;
            }
            islands.solve_count += 1;
            let previous_impulse = c.impulse();
            let change = marbles.solve_point(c);
            c.search_directions[0] = c.impulse() - previous_impulse;
            let island = islands.of_mut(c);
            if change > island.change && change > marbles.velocity_rounding(c) {
                island.change = change;
            }
        }
        let is_last = iteration + 1 == settings.iterations;
        if islands.end_iteration(settings.restitution_threshold, settings.tolerance) || is_last {
            break;
        }
        marbles.accelerate(constraints, islands);
    }
}

impl<S: Scalar> Constraint<S> {
    /// The impulse along the normal and across it that is next to this one and that a contact
    /// can bear: nothing pulls, and friction is bounded by Coulomb's cone.
    fn project_to_cone(&self, impulse: Vec3<S>) -> (S, Vec3<S>) {
        let normal_part = impulse.dot(self.normal);
        let normal_impulse = normal_part.max(self.min_normal_impulse);
        (
            normal_impulse,
            clamp_length(impulse - self.normal * normal_part, self.max_friction(normal_impulse)),
        )
    }

    /// As much of a change of its impulse as it can bear.
    fn clamp_to_cone(&self, direction: Vec3<S>) -> Vec3<S> {
        let (normal_impulse, tangent_impulse) = self.project_to_cone(self.impulse() + direction);
        self.normal * (normal_impulse - self.normal_impulse)
            + (tangent_impulse - self.tangent_impulse)
    }

    /// Up to which part of a change of its impulse it still pushes.
    fn max_fraction(&self, direction: Vec3<S>) -> S {
        let normal_part = direction.dot(self.normal);
        if normal_part < S::zero() {
            (self.min_normal_impulse - self.normal_impulse) / normal_part
        } else {
            S::infinity()
        }
    }

    /// What friction can be at most beside this pressure.
    fn max_friction(&self, normal_impulse: S) -> S {
        self.friction * normal_impulse + self.friction_bound
    }
}

impl<S: Scalar> SolverBodies<'_, S> {
    /// The relative velocity of a contact's two points, in m/s.
    pub(super) fn relative_velocity_of(&self, c: &Constraint<S>) -> Vec3<S> {
        self.relative_velocity(c.a, c.b, c.axis_offset, c.normal, c.surface_velocity)
    }

    /// Rounding of the velocities that a contact sees, in m/s. Below it, sweeps would only push
    /// what is fast to one side.
    pub(super) fn velocity_rounding(&self, c: &Constraint<S>) -> S {
        let speed = |row: usize| self.velocity[row].magnitude();
        (speed(c.b) + c.a.marble().map_or_else(S::zero, speed)) * S::epsilon()
    }

    /// The change of relative velocity that a contact still asks for, in m/s.
    fn velocity_error_of(&self, c: &Constraint<S>) -> Vec3<S> {
        c.normal * c.target_normal_velocity + c.target_tangent_velocity
            - self.relative_velocity_of(c)
    }

    /// One step toward what a contact asks for. Gives the change of velocity.
    fn solve_point(&mut self, c: &mut Constraint<S>) -> S {
        let velocity_error = self.velocity_error_of(c);
        let normal_part = velocity_error.dot(c.normal);
        let normal_impulse = (c.normal_impulse + normal_part).max(c.min_normal_impulse);
        let tangential = (velocity_error - c.normal * normal_part)
            * (c.inverse_effective_mass.normal / c.inverse_effective_mass.tangent);
        let tangent_impulse =
            clamp_length(c.tangent_impulse + tangential, c.max_friction(normal_impulse));
        let change =
            c.normal * (normal_impulse - c.normal_impulse) + (tangent_impulse - c.tangent_impulse);
        if !is_finite(change) {
            return S::zero(); // an overflow here must not reach the other one
        }
        (c.normal_impulse, c.tangent_impulse) = (normal_impulse, tangent_impulse);
        self.apply_impulse_pair(c, change);
        self.solve_rolling(c);
        change.magnitude()
    }

    /// Goes on from a sweep: along it and the ways before, as far along each as brings the contacts
    /// of each island nearest to what they ask for.
    fn accelerate(&mut self, constraints: &mut [Constraint<S>], islands: &mut Islands<S>) {
        islands.list.iter_mut().for_each(Island::begin_search);
        for c in constraints.iter_mut() {
            let Some(island) = islands.accelerating(c) else { continue };
            if c.normal_impulse <= S::zero() {
                c.search_directions = [Vec3::zero(); DIRECTIONS]; // it parts, and bears nothing
            } else if island.bounces
                || length(c.tangent_impulse)
                    >= c.max_friction(c.normal_impulse) * (S::one() - S::epsilon())
            {
                // It slides, whichever way it does. Or rebounds ask for what friction in a
                // corner cannot give, and both would grow against each other without end.
                c.search_directions =
                    c.search_directions.map(|direction| c.normal * direction.dot(c.normal));
            }
            c.velocity_error = self.velocity_error_of(c);
        }
        for c in constraints.iter().filter(|c| islands.of(c).accelerating) {
            self.apply_impulse_pair(c, c.search_directions[0]);
        }
        for c in constraints.iter_mut() {
            let Some(island) = islands.accelerating(c) else { continue };
            c.direction_velocities[0] = c.velocity_error - self.velocity_error_of(c);
            island.add_directions(c, self.velocity_rounding(c));
        }
        islands.list.iter_mut().for_each(Island::solve_weights);
        // Within the cones: what a contact cannot bear would throw others about.
        for c in constraints.iter_mut() {
            let Some(island) = islands.accelerating(c) else { continue };
            let (straight, direction_velocities) =
                (island.combine(&c.search_directions), island.combine(&c.direction_velocities));
            let direction = c.clamp_to_cone(straight);
            let clamped = direction - straight;
            let tangential = clamped - c.normal * clamped.dot(c.normal);
            let rounding = (c.normal_impulse + length(straight)) * S::epsilon();
            island.add_cone_limit(c.max_fraction(straight), length(tangential) > rounding);
            self.apply_impulse_pair(c, direction - c.search_directions[0]);
            // The oldest way makes room.
            (c.search_directions, c.direction_velocities) = (
                [straight, direction, c.search_directions[1]],
                [direction_velocities, Vec3::zero(), c.direction_velocities[1]],
            );
        }
        for c in constraints.iter_mut() {
            let Some(island) = islands.accelerating(c) else { continue };
            c.direction_velocities[1] = c.velocity_error - self.velocity_error_of(c);
            island.add_projected(c, c.search_directions[1], c.direction_velocities[1]);
        }
        for c in constraints.iter_mut() {
            let Some(island) = islands.accelerating(c) else { continue };
            let (direction, direction_velocities) = match island.choose_step() {
                SearchStep::Projected(fraction) => {
                    (c.search_directions[1] * fraction, c.direction_velocities[1] * fraction)
                }
                SearchStep::Straight(fraction) => {
                    (c.search_directions[0] * fraction, c.direction_velocities[0] * fraction)
                }
            };
            self.apply_impulse_pair(c, direction - c.search_directions[1]);
            // Between two points of a cone lies nothing outside of it, but for rounding.
            (c.normal_impulse, c.tangent_impulse) = c.project_to_cone(c.impulse() + direction);
            (c.search_directions[1], c.direction_velocities[1]) = (direction, direction_velocities);
        }
    }

    /// One step toward no relative spin, as far as the resistances can.
    fn solve_rolling(&mut self, c: &mut Constraint<S>) {
        let Some(rolling) = c.rolling else { return };
        let wanted = rolling.angular_impulse - self.relative_spin(c) / rolling.inverse_inertia;
        let max_force = c.normal_impulse / c.inverse_effective_mass.normal;
        let torsional = c.normal * wanted.dot(c.normal);
        let angular_impulse = clamp_length(wanted - torsional, rolling.rolling_lever * max_force)
            + clamp_length(torsional, rolling.torsional_lever * max_force);
        let change = angular_impulse - rolling.angular_impulse;
        if is_finite(change) {
            c.rolling = Some(super::RollingConstraint { angular_impulse, ..rolling });
            self.apply_angular_impulse_pair(c, change);
        }
    }

    /// How the second of a contact turns against the first, in rad/s.
    pub(super) fn relative_spin(&self, c: &Constraint<S>) -> Vec3<S> {
        let first = c.a.marble().map_or_else(Vec3::zero, |a| self.unlocked_spin(a));
        self.unlocked_spin(c.b) - first
    }
}
