//! Position projection (the lecture's method): the solver of
//! [`Response::Displacement`](super::Response::Displacement). Penetration of this substep is
//! undone, and velocities change by the displacement per substep; older penetration is resolved
//! afterwards without a change of velocity.

#[cfg(test)]
mod tests;

use cgmath::{InnerSpace, Zero};

use super::impulse::{BodyA, CachedImpulse, Context, SolverSettings};
use super::{Colliders, ContactKey, KeyedByContact, SolverBodies};
use crate::contact::{Contact, Contacts};
use crate::math::{Scalar, UnionFind, Vec3, is_finite, is_finite_point};
use crate::motion::MAX_ESCAPE;

/// Scratch buffers, kept for their memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct DisplacementScratch<S> {
    constraints: Vec<ApproachConstraint<S>>,
    initial_velocity: Vec<Vec3<S>>,
    islands: UnionFind,
    warm_starts: Vec<WarmStartSums<S>>,
}

/// Sums that scale the warm start of one island, in m²/s².
#[derive(Clone, Copy, Debug)]
struct WarmStartSums<S> {
    /// Cached change times the requested one, and times the achieved one.
    requested: S,
    achieved: S,
}

impl<S: Scalar> WarmStartSums<S> {
    /// Fraction of the warm start that comes closest to the requested changes.
    fn fraction(self) -> S {
        let fraction = self.requested / self.achieved;
        if self.achieved > S::zero() {
            fraction.max(S::zero()).min(S::one())
        } else if self.achieved.is_nan() {
            S::zero() // energies overflowed
        } else {
            S::one()
        }
    }
}

/// Contact constraint: lower bound of a separation speed.
#[derive(Clone, Copy, Debug)]
struct ApproachConstraint<S> {
    a: BodyA,
    b: usize,
    key: ContactKey,
    /// Index of its island. Islands do not influence each other, to the bit.
    island: u32,
    axis_offset: [S; 2],
    /// Unit normal from a to b.
    normal: Vec3<S>,
    /// Speed of the wall's surface along the normal, in m/s; zero between marbles.
    surface_speed: S,
    /// Lower bound of the separation speed, in m/s: zero, or negative where a separation is still
    /// open.
    min_separation_speed: S,
    /// Fraction of a change of the separation speed that both bodies take along the normal: half each, or
    /// all of it at a wall; more where locks take a part.
    fraction: S,
    /// Change of the separation speed accumulated in this substep, in m/s.
    velocity_change: S,
}

/// Solves contacts as the lecture restitutes, deepest first, each tested again: a wall stays,
/// marbles take half each. The lecture takes all penetration for motion of this frame, so that
/// older penetration turns into speed; here only approach is stopped. Changes accumulate, so that a
/// contact can take back what another one made superfluous, with a warm start (Catto, *Iterative
/// dynamics with temporal coherence*, 2005). Remaining penetration is resolved without a change of
/// velocity (Macklin et al., *Unified particle physics for real-time applications*, 2014, §4.4).
///
/// The contacts' rows exist. A row that would become infinite or NaN keeps its position, loses its
/// velocity, and is added to `quarantined`. `on_wall_impulse` receives the velocity changes by
/// walls: row, unit normal, change, and speed of the surface along the normal, in m/s.
pub(crate) fn solve_displacement<S: Scalar>(
    marbles: &mut SolverBodies<S>,
    contacts: &mut Contacts<S>,
    context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    scratch: &mut DisplacementScratch<S>,
    cache: &mut Vec<CachedImpulse<S>>,
    quarantined: &mut Vec<u32>,
    mut on_wall_impulse: impl FnMut(u32, Vec3<S>, [S; 2]),
) {
    let DisplacementScratch { constraints, initial_velocity, islands, warm_starts } = scratch;
    initial_velocity.clear();
    initial_velocity.extend_from_slice(marbles.velocity);
    prepare(marbles, contacts, context, constraints, islands);
    warm_start(marbles, constraints, cache, warm_starts);
    iterate(marbles, constraints, context.settings);
    for c in constraints.iter().filter(|c| c.a.marble().is_none()) {
        on_wall_impulse(c.b as u32, c.normal, [c.velocity_change, c.surface_speed]);
    }
    marbles.follow_velocity_changes(initial_velocity, context, quarantined);
    solve_positions(marbles, constraints, context);
    store_changes(constraints, cache);
}

/// Prepares a constraint per contact, walls first, and assigns islands.
fn prepare<S: Scalar>(
    marbles: &SolverBodies<S>,
    contacts: &Contacts<S>,
    context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    constraints: &mut Vec<ApproachConstraint<S>>,
    islands: &mut UnionFind,
) {
    constraints.clear();
    constraints.extend(
        BodyA::of_each(contacts)
            .filter_map(|(a, contact)| marbles.approach_constraint(a, contact, context)),
    );
    islands.build(constraints.iter().map(|t| (t.a.marble(), t.b)), marbles.velocity.len());
    for c in constraints.iter_mut() {
        c.island = islands.set_of(c.b);
    }
}

/// Warm start: applies the changes of the last substep, scaled per island to the fraction that
/// comes closest to the requested changes, so that they give no energy. The iterations only
/// take energy, as each lowers `½ f·A f − f·w`, with `f` the changes, `A f` their effect on the
/// separation speeds, and `w` the requested one.
fn warm_start<S: Scalar>(
    marbles: &mut SolverBodies<S>,
    constraints: &mut [ApproachConstraint<S>],
    cache: &[CachedImpulse<S>],
    warm_starts: &mut Vec<WarmStartSums<S>>,
) {
    warm_starts.clear();
    warm_starts
        .resize(constraints.len(), WarmStartSums { requested: S::zero(), achieved: S::zero() });
    for c in constraints.iter_mut() {
        let Ok(at) = cache.binary_search_by_key(&c.key, CachedImpulse::key) else { continue };
        c.velocity_change = cache[at].normal_impulse();
        let (weighted_change, separation_speed) =
            (c.velocity_change * c.fraction, marbles.separation_speed(c));
        let warm_start = &mut warm_starts[c.island as usize];
        warm_start.requested += weighted_change * (c.min_separation_speed - separation_speed);
        warm_start.achieved -= weighted_change * separation_speed;
    }
    for c in constraints.iter() {
        marbles.apply_velocity_change(c, c.velocity_change);
    }
    for c in constraints.iter() {
        warm_starts[c.island as usize].achieved +=
            c.velocity_change * c.fraction * marbles.separation_speed(c);
    }
    for c in constraints.iter_mut() {
        let fraction = warm_starts[c.island as usize].fraction();
        marbles.apply_velocity_change(c, c.velocity_change * (fraction - S::one()));
        c.velocity_change *= fraction;
    }
}

/// Solves the constraints one after the other, until none changes or the iterations are used up.
fn iterate<S: Scalar>(
    marbles: &mut SolverBodies<S>,
    constraints: &mut [ApproachConstraint<S>],
    settings: &SolverSettings<S>,
) {
    let rounding = settings.restitution_threshold * S::epsilon();
    for _ in 0..settings.iterations {
        let solve = |any_changed: bool, c| marbles.solve_approach(c, rounding) || any_changed;
        if !constraints.iter_mut().fold(false, solve) {
            break;
        }
    }
}

/// Resolves the penetration that is left, without a change of velocity.
fn solve_positions<S: Scalar>(
    marbles: &mut SolverBodies<S>,
    constraints: &[ApproachConstraint<S>],
    context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
) {
    for _ in 0..context.settings.iterations {
        let separate = |any_moved: bool, c| marbles.separate(c, context) || any_moved;
        if !constraints.iter().fold(false, separate) {
            break;
        }
    }
    // Walls come last, so that nothing is pushed through the floor.
    for c in constraints.iter().filter(|c| c.a.marble().is_none()) {
        marbles.separate(c, context);
    }
}

/// Stores the changes of speed for the next substep's warm start. A contact that bears nothing has no entry.
fn store_changes<S: Scalar>(
    constraints: &[ApproachConstraint<S>],
    cache: &mut Vec<CachedImpulse<S>>,
) {
    cache.clear();
    let bearing = constraints.iter().filter(|c| c.velocity_change > S::zero());
    cache.extend(bearing.map(|c| CachedImpulse::of_normal_impulse(c.key, c.velocity_change)));
    cache.sort_unstable_by_key(CachedImpulse::key);
}

impl<S: Scalar> SolverBodies<'_, S> {
    /// Constraint of a contact: no approach beyond the separation that was open at the start of the
    /// substep.
    fn approach_constraint(
        &self,
        a: BodyA,
        contact: &Contact<S>,
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    ) -> Option<ApproachConstraint<S>> {
        let Contact { normal, separation, arms, along: axis_offset, .. } = *contact;
        if !separation.is_finite() {
            return None;
        }
        let b = contact.b as usize;
        let normal = self.impact_normal(a, b, (normal, separation), context);
        let share = |row: usize| self.locked_axes(row).share(normal);
        let shares = share(b) + a.marble().map_or_else(S::zero, share);
        if shares == S::zero() {
            return None; // locks bear it
        }
        let surface_speed = self.surface_velocity(a, b, (arms, normal), context.walls).dot(normal);
        let zero = S::zero();
        let mut c = ApproachConstraint {
            a,
            b,
            key: a.contact_key(contact),
            island: 0,
            axis_offset,
            normal,
            surface_speed,
            fraction: shares.recip(),
            min_separation_speed: zero,
            velocity_change: zero,
        };
        let follow_time = context.follow_time(a, b);
        // A body stopped by continuous detection does not follow.
        let is_ccd_stopped =
            context.is_ccd_stopped(b) || a.marble().is_some_and(|a| context.is_ccd_stopped(a));
        let min_separation_speed = if follow_time > S::zero() && !is_ccd_stopped {
            self.separation_speed(&c) - separation / follow_time
        } else {
            -separation / context.settings.dt
        };
        c.min_separation_speed = min_separation_speed.min(S::zero());
        Some(c)
    }

    /// Separation speed along the normal, in m/s.
    fn separation_speed(&self, c: &ApproachConstraint<S>) -> S {
        let first = c.a.marble().map_or_else(Vec3::zero, |a| self.velocity[a]);
        (self.velocity[c.b] - first).dot(c.normal) - c.surface_speed
    }

    /// Allowed penetration (slop), in metres, so that resting contacts persist where positions do
    /// not follow velocity changes within the substep; zero where they do.
    fn slop(
        &self,
        c: &ApproachConstraint<S>,
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    ) -> S {
        if context.follow_time(c.a, c.b) > S::zero() {
            return S::zero();
        }
        let radius_b = self.radius[c.b];
        let min_radius = c.a.marble().map_or(radius_b, |a| self.radius[a].min(radius_b));
        context.settings.slop.min(min_radius * context.settings.max_relative_slop)
    }

    /// Changes the separation speed of a contact.
    fn apply_velocity_change(&mut self, c: &ApproachConstraint<S>, velocity_change: S) {
        let change = c.normal * velocity_change * c.fraction;
        if let Some(a) = c.a.marble() {
            self.velocity[a] -= self.locked_axes(a).free_translation(change);
        }
        self.velocity[c.b] += self.locked_axes(c.b).free_translation(change);
    }

    /// Stops an approach, or takes back a superfluous change. False if the change is below
    /// `rounding`, in m/s.
    fn solve_approach(&mut self, c: &mut ApproachConstraint<S>, rounding: S) -> bool {
        let requested = c.min_separation_speed - self.separation_speed(c);
        let velocity_change = (c.velocity_change + requested).max(S::zero()) - c.velocity_change;
        if !velocity_change.is_finite() || velocity_change.abs() <= rounding {
            return false; // an overflow must not reach the other body
        }
        c.velocity_change += velocity_change;
        self.apply_velocity_change(c, velocity_change);
        true
    }

    /// Moves marbles by their velocity changes.
    fn follow_velocity_changes(
        &mut self,
        initial_velocity: &[Vec3<S>],
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
        quarantined: &mut Vec<u32>,
    ) {
        for (row, initial_velocity) in initial_velocity.iter().enumerate() {
            let velocity = self.velocity[row];
            let position =
                self.position[row] + (velocity - initial_velocity) * context.follow_time_of(row);
            if is_finite_point(position) && is_finite(velocity) {
                self.position[row] = position;
            } else {
                self.velocity[row] = Vec3::zero();
                quarantined.push(row as u32);
            }
        }
    }

    /// Resolves the penetration of a contact. False if there is none.
    fn separate(
        &mut self,
        c: &ApproachConstraint<S>,
        context: &Context<S, impl Colliders<S>, impl Fn(usize) -> S>,
    ) -> bool {
        let ApproachConstraint { a, b, axis_offset, .. } = *c;
        let contact = self.normal_and_separation(self.position, a, b, axis_offset, context.walls);
        let Some((normal, separation)) = contact else { return false };
        let excess = -separation - self.slop(c, context);
        if excess <= S::zero() {
            return false;
        }
        let displacement = normal * (excess * c.fraction.min(S::from_f64(MAX_ESCAPE)));
        for (row, displacement) in [(Some(b), displacement), (a.marble(), -displacement)] {
            let Some(row) = row else { continue };
            self.displace(row, displacement);
        }
        true
    }
}
