//! Iterations of sequential impulses, and their acceleration.

use cgmath::{InnerSpace, Zero};

use super::islands::{DIRECTIONS, Island, Islands, SearchStep};
use super::{Constraint, SolverSettings};
use crate::constraint::{ContactImpulse, solve_rolling};
use crate::math::{Scalar, Vec3, is_finite, length};
use crate::response::{InverseEffectiveMass, SolverBodies};

/// Iterates over the contacts of islands that have not converged, until they do or the iterations
/// are used up.
///
/// Plain Gauss–Seidel passes would need as many iterations as a marble is heavier than the one
/// below it. So after each pass the solver searches the best combination of this pass and the
/// accelerated steps before it: the pass is the preconditioner of a search in a small subspace, as
/// in Anderson mixing (*Iterative procedures for nonlinear integral equations*, 1965) and, for
/// contacts, Silcowitz, Niebe and Erleben, *A nonsmooth nonlinear conjugate gradient method for
/// interactive contact force problems*, 2010.
///
/// With `f` the impulses, `A f` the velocity change that they cause at the contacts and `w` the
/// requested one, passes and searches lower `½ f·A f − f·w`, the energy of the remaining error. A
/// pass ends the iterations, never a search.
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
    /// Projection of an impulse to the friction cone: no tension, and Coulomb friction.
    fn project_to_cone(&self, impulse: Vec3<S>) -> ContactImpulse<S> {
        self.cone.clamp(ContactImpulse::split(impulse, self.normal))
    }

    /// Change of the impulse, clamped to the cone.
    fn clamp_to_cone(&self, direction: Vec3<S>) -> Vec3<S> {
        let clamped = self.project_to_cone(self.impulse() + direction);
        self.normal * (clamped.normal - self.impulse.normal)
            + (clamped.tangent - self.impulse.tangent)
    }

    /// Largest fraction of a change for which the normal impulse stays admissible.
    fn max_fraction(&self, direction: Vec3<S>) -> S {
        let normal_part = direction.dot(self.normal);
        if normal_part < S::zero() {
            (self.cone.min_normal_impulse - self.impulse.normal) / normal_part
        } else {
            S::infinity()
        }
    }

    /// Restricts the search directions to those that the contact can follow.
    fn restrict_directions(&mut self, island_bounces: bool) {
        if self.impulse.normal <= S::zero() {
            self.search_directions = [Vec3::zero(); DIRECTIONS]; // an open contact has no impulse
        } else if island_bounces
            || length(self.impulse.tangent)
                >= self.cone.max_friction(self.impulse.normal) * (S::one() - S::epsilon())
        {
            // Sliding friction stays at the cone, whichever way it slides. And restitution can ask
            // for more than friction in a corner can give, so that both would grow without end.
            let normal = self.normal;
            self.search_directions =
                self.search_directions.map(|direction| normal * direction.dot(normal));
        }
    }
}

impl<S: Scalar> SolverBodies<'_, S> {
    /// Relative velocity of a contact's two points, in m/s.
    pub(super) fn relative_velocity_of(&self, c: &Constraint<S>) -> Vec3<S> {
        self.relative_velocity(c.a, c.b, c.arms, c.normal, c.surface_velocity)
    }

    /// Rounding of the velocities at a contact, in m/s. Smaller changes would only push fast bodies
    /// to one side.
    pub(super) fn velocity_rounding(&self, c: &Constraint<S>) -> S {
        let speed = |row: usize| self.velocity[row].magnitude();
        (speed(c.b) + c.a.marble().map_or_else(S::zero, speed)) * S::epsilon()
    }

    /// Velocity error: target minus relative velocity, in m/s.
    fn velocity_error_of(&self, c: &Constraint<S>) -> Vec3<S> {
        c.normal * c.target_normal_velocity + c.target_tangent_velocity
            - self.relative_velocity_of(c)
    }

    /// Solves one contact point. Returns the velocity change, in m/s.
    fn solve_point(&mut self, c: &mut Constraint<S>) -> S {
        let error = ContactImpulse::split(self.velocity_error_of(c), c.normal);
        let InverseEffectiveMass { normal, tangent } = c.inverse_effective_mass;
        let wanted = ContactImpulse { tangent: error.tangent * (normal / tangent), ..error };
        let mut impulse = c.impulse;
        let change = impulse.solve(wanted, None, &c.cone).along(c.normal);
        if !is_finite(change) {
            return S::zero(); // an overflow must not reach the other body
        }
        c.impulse = impulse;
        self.apply_impulse_pair(c, change);
        self.solve_rolling(c);
        change.magnitude()
    }

    /// Accelerates a pass: extends it, together with the steps before, to the combination that
    /// brings each island nearest to its target velocities.
    fn accelerate(&mut self, constraints: &mut [Constraint<S>], islands: &mut Islands<S>) {
        islands.list.iter_mut().for_each(Island::begin_search);
        for c in constraints.iter_mut() {
            let Some(island) = islands.accelerating(c) else { continue };
            c.restrict_directions(island.bounces);
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
        // Projected to the cones: inadmissible impulses would throw other marbles about.
        for c in constraints.iter_mut() {
            let Some(island) = islands.accelerating(c) else { continue };
            let (straight, direction_velocities) =
                (island.combine(&c.search_directions), island.combine(&c.direction_velocities));
            let direction = c.clamp_to_cone(straight);
            let clamped = direction - straight;
            let tangential = clamped - c.normal * clamped.dot(c.normal);
            let rounding = (c.impulse.normal + length(straight)) * S::epsilon();
            island.add_cone_limit(c.max_fraction(straight), length(tangential) > rounding);
            self.apply_impulse_pair(c, direction - c.search_directions[0]);
            // The oldest direction is dropped.
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
            // Cones are convex, so only rounding can lie outside.
            c.impulse = c.project_to_cone(c.impulse() + direction);
            (c.search_directions[1], c.direction_velocities[1]) = (direction, direction_velocities);
        }
    }

    /// Solves rolling and torsional friction: one step toward zero relative spin.
    fn solve_rolling(&mut self, c: &mut Constraint<S>) {
        let Some(rolling) = c.rolling else { return };
        let wanted = self.relative_spin(c) / -rolling.inverse_inertia;
        let load = c.impulse.normal / c.inverse_effective_mass.normal;
        let limits = [rolling.rolling_lever * load, rolling.torsional_lever * load];
        let mut angular_impulse = rolling.angular_impulse;
        let change = solve_rolling(&mut angular_impulse, wanted, c.normal, limits);
        if is_finite(change) {
            c.rolling = Some(super::RollingConstraint { angular_impulse, ..rolling });
            self.apply_angular_impulse_pair(c, change);
        }
    }

    /// Relative spin of a contact, in rad/s.
    pub(super) fn relative_spin(&self, c: &Constraint<S>) -> Vec3<S> {
        let first = c.a.marble().map_or_else(Vec3::zero, |a| self.unlocked_spin(a));
        self.unlocked_spin(c.b) - first
    }
}
