//! Iterations of sequential impulses, and their acceleration.

use cgmath::{InnerSpace, Zero};

use super::islands::{DIRECTIONS, Islands, SearchStep};
use super::jam::saturate;
use super::rows::{ConstraintRow, IslandRows, PackedBodies, RowDetails, Rows, SearchDirections};
use super::{Constraint, RollingConstraint, SolverSettings};
use crate::constraint::{ContactImpulse, solve_rolling};
use crate::math::{RealVector, Scalar, Vec3, is_finite, length};
use crate::response::SolverBodies;

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
    packed: &mut Rows<S>,
    settings: &SolverSettings<S>,
) {
    packed.pack(marbles, constraints, islands);
    packed.solve_islands(marbles, islands, settings.threads, |mut rows| rows.iterate(settings));
    packed.unpack(marbles, constraints);
}

impl<S: Scalar> ConstraintRow<S> {
    /// Accumulated impulse, in m/s as in [`Constraint`].
    fn impulse(&self) -> Vec3<S> {
        self.impulse.along(self.normal)
    }

    /// True if the contact bears nothing, so that the search leaves it as it is.
    pub fn is_open(&self) -> bool {
        self.impulse.normal <= S::zero()
    }

    /// True if the contact bears nothing or all that it can, so that the search leaves it as it is.
    fn is_at_bound(&self) -> bool {
        self.is_open() || self.impulse.normal >= self.max_normal_impulse
    }

    /// Bounds an impulse by what the contact can bear.
    #[inline]
    fn saturate(&self, impulse: ContactImpulse<S>) -> ContactImpulse<S> {
        saturate(impulse, &self.cone, self.max_normal_impulse)
    }

    /// Projection of an impulse to the friction cone: no tension, and Coulomb friction.
    fn project_to_cone(&self, impulse: Vec3<S>) -> ContactImpulse<S> {
        self.saturate(self.cone.clamp(ContactImpulse::split(impulse, self.normal)))
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
        } else if normal_part > S::zero() {
            (self.max_normal_impulse - self.impulse.normal) / normal_part
        } else {
            S::infinity()
        }
    }

    /// Restricts the search directions to those that the contact can follow.
    fn restrict_directions(&self, search: &mut SearchDirections<S>) {
        if self.is_at_bound() {
            search.directions = [Vec3::zero(); DIRECTIONS];
            search.velocities = search.directions;
        } else if self.bounces
            || length(self.impulse.tangent)
                >= self.cone.max_friction(self.impulse.normal) * (S::one() - S::epsilon())
        {
            // Sliding friction stays at the cone, whichever way it slides. And the restitution of two
            // contacts can ask for more than friction in a corner can give, so that both would grow
            // without end; a contact that rests beside them asks for rest, which it can have.
            let normal = self.normal;
            search.directions = search.directions.map(|direction| normal * direction.dot(normal));
        }
    }
}

impl<S: Scalar> IslandRows<'_, '_, S> {
    /// Iterates over the contacts of the island until they converge or the iterations are used up.
    fn iterate(&mut self, settings: &SolverSettings<S>) {
        for left in (0..settings.iterations).rev() {
            self.pass();
            self.island.end_iteration(settings.restitution_threshold, settings.tolerance);
            if self.island.converged || left == 0 {
                break;
            }
            if self.island.accelerating {
                self.accelerate();
            }
        }
    }

    /// Solves each contact point once (Gauss–Seidel).
    fn pass(&mut self) {
        let rows = self.rows.iter_mut().zip(&mut *self.details).zip(&mut *self.searches);
        for ((row, details), search) in rows {
            let previous_impulse = row.impulse();
            let change = self.bodies.solve_point(row, details);
            search.directions[0] = row.impulse() - previous_impulse;
            if change > self.island.change && change > self.bodies.velocity_rounding(row) {
                self.island.change = change;
            }
        }
        self.island.solve_count += self.rows.len() as u64;
    }

    /// Accelerates a pass: extends it, together with the steps before, to the combination that
    /// brings the island nearest to its target velocities. Rows that bear nothing take no part.
    fn accelerate(&mut self) {
        self.island.begin_search();
        let Self { island, rows, details, searches, bodies } = self;
        let arms = |at: usize| &details[at].arms;
        for (at, (row, search)) in rows.iter().zip(searches.iter_mut()).enumerate() {
            row.restrict_directions(search);
            if !row.is_open() {
                search.velocity_error = bodies.velocity_error(row, arms(at));
            }
        }
        for (at, (row, search)) in closed(rows.iter().zip(searches.iter())) {
            bodies.apply_impulse(row, arms(at), search.directions[0]);
        }
        for (at, (row, search)) in closed(rows.iter().zip(searches.iter_mut())) {
            search.velocities[0] = search.velocity_error - bodies.velocity_error(row, arms(at));
            island.add_directions(row, search, bodies.velocity_rounding(row));
        }
        island.solve_weights();
        // Projected to the cones: inadmissible impulses would throw other marbles about.
        for (at, (row, search)) in closed(rows.iter().zip(searches.iter_mut())) {
            let [last, previous, _] = search.directions;
            let straight = island.combine(&search.directions);
            let direction = row.clamp_to_cone(straight);
            let clamped = direction - straight;
            let tangential = clamped - row.normal * clamped.dot(row.normal);
            let rounding = (row.impulse.normal + length(straight)) * S::epsilon();
            island.add_cone_limit(row.max_fraction(straight), length(tangential) > rounding);
            bodies.apply_impulse(row, arms(at), direction - last);
            // The oldest direction is dropped.
            search.directions = [straight, direction, previous];
            search.velocities =
                [island.combine(&search.velocities), Vec3::zero(), search.velocities[1]];
        }
        for (at, (row, search)) in closed(rows.iter().zip(searches.iter_mut())) {
            search.velocities[1] = search.velocity_error - bodies.velocity_error(row, arms(at));
            island.add_projected(row, search);
        }
        let (which, fraction) = match island.choose_step() {
            SearchStep::Projected(fraction) => (1, fraction),
            SearchStep::Straight(fraction) => (0, fraction),
        };
        let rows = rows.iter_mut().zip(searches.iter_mut()).enumerate();
        for (at, (row, search)) in rows.filter(|(_, (row, _))| !row.is_open()) {
            let direction = search.directions[which] * fraction;
            bodies.apply_impulse(row, arms(at), direction - search.directions[1]);
            // Cones are convex, so only rounding can lie outside.
            row.impulse = row.project_to_cone(row.impulse() + direction);
            search.velocities[1] = search.velocities[which] * fraction;
            search.directions[1] = direction;
        }
    }
}

/// Rows that bear something, with their indices.
fn closed<'a, S: Scalar + 'a, T>(
    rows: impl Iterator<Item = (&'a ConstraintRow<S>, T)>,
) -> impl Iterator<Item = (usize, (&'a ConstraintRow<S>, T))> {
    rows.enumerate().filter(|(_, (row, _))| !row.is_open())
}

impl<S: Scalar> PackedBodies<'_, '_, S> {
    /// Solves one contact point. Returns the velocity change of its point, in m/s.
    fn solve_point(&mut self, row: &mut ConstraintRow<S>, details: &mut RowDetails<S>) -> S {
        let RowDetails { arms, rolling, .. } = details;
        let error = ContactImpulse::split(self.velocity_error(row, arms), row.normal);
        let tangent = rolling
            .as_ref()
            .and_then(|rolling| self.solve_blocked(row, rolling, error))
            .unwrap_or_else(|| error.tangent * row.tangent_ratio);
        let wanted = ContactImpulse { tangent, ..error };
        let mut impulse = row.impulse;
        let mut change = impulse.solve(wanted, None, &row.cone);
        if impulse.normal > row.max_normal_impulse {
            impulse = row.saturate(impulse);
            change = ContactImpulse {
                normal: impulse.normal - row.impulse.normal,
                tangent: impulse.tangent - row.impulse.tangent,
            };
        }
        let change = change.along(row.normal);
        if !is_finite(change) {
            return S::zero(); // an overflow must not reach the other body
        }
        row.impulse = impulse;
        self.apply_impulse(row, arms, change);
        let Some(rolling) = rolling else { return change.magnitude() };
        let spin_change = self.solve_rolling(row, rolling);
        // The contact point feels a change of rolling in the next pass.
        change.magnitude().max(spin_change * length(arms[1]))
    }

    /// Block solve of slip and rolling: tangential impulse, in m/s, that ends both at once; none if rolling
    /// friction cannot bear it. One after the other, they would need a dozen passes to agree.
    fn solve_blocked(
        &self,
        row: &ConstraintRow<S>,
        rolling: &RollingConstraint<S>,
        error: ContactImpulse<S>,
    ) -> Option<Vec3<S>> {
        let RollingConstraint { coupling, inverse_inertia, .. } = *rolling;
        if rolling.rolling_lever <= S::zero() {
            return None;
        }
        let spin = self.relative_spin(row).reject_from(row.normal);
        let tangent = (error.tangent + spin.cross(row.normal) * coupling) * rolling.blocked_ratio;
        let wanted = ContactImpulse { tangent, ..error };
        let impulse = row.saturate(row.cone.clamp(row.impulse.plus(wanted)));
        let friction = (impulse.tangent - row.impulse.tangent) / row.inverse_effective_mass;
        let angular_impulse = rolling.angular_impulse.reject_from(row.normal)
            - spin / inverse_inertia
            - row.normal.cross(friction) * coupling;
        let bearable = rolling.rolling_lever * impulse.normal / row.inverse_effective_mass;
        (length(angular_impulse) <= bearable).then_some(tangent)
    }

    /// Solves rolling and torsional friction: one step toward zero relative spin. Returns the change
    /// of the relative spin, in rad/s.
    fn solve_rolling(&mut self, row: &ConstraintRow<S>, rolling: &mut RollingConstraint<S>) -> S {
        let wanted = self.relative_spin(row) / -rolling.inverse_inertia;
        let load = row.impulse.normal / row.inverse_effective_mass;
        let limits = [rolling.rolling_lever * load, rolling.torsional_lever * load];
        let mut angular_impulse = rolling.angular_impulse;
        let change = solve_rolling(&mut angular_impulse, wanted, row.normal, limits);
        if !is_finite(change) {
            return S::zero();
        }
        rolling.angular_impulse = angular_impulse;
        self.apply_angular_impulse(row, change);
        length(change) * rolling.inverse_inertia
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

    /// Relative spin of a contact, in rad/s.
    pub(super) fn relative_spin(&self, c: &Constraint<S>) -> Vec3<S> {
        let first = c.a.marble().map_or_else(Vec3::zero, |a| self.unlocked_spin(a));
        self.unlocked_spin(c.b) - first
    }
}
