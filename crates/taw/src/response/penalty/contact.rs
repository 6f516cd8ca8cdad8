//! Geometry and relative motion of a penalty contact.

use cgmath::{InnerSpace, Zero};

use super::{CORE, CORE_ROUNDING, PenaltySettings, SpringHistory};
use crate::contact::{Contact, ContactMaterial};
use crate::math::{Scalar, Vec3, cast_vector, is_finite, length};
use crate::response::impulse::BodyA;
use crate::response::{
    Colliders, ContactKey, EnergyLedger, ImpulseSample, InverseEffectiveMass, SolverBodies,
};

/// Penalty contact: bodies, geometry and relative motion.
#[derive(Clone, Debug)]
pub(super) struct PenaltyContact<S> {
    pub key: ContactKey,
    pub body_a: BodyA,
    /// First body; none for a wall.
    pub a: Option<usize>,
    pub b: usize,
    /// Lever arms, from the center of each body to the contact point, in metres.
    pub arms: [Vec3<S>; 2],
    /// Unit normal from a to b.
    pub normal: Vec3<S>,
    /// Penetration, in metres; of a contact with its forces, the part that loads its spring.
    pub penetration: S,
    /// Velocity of b's contact point relative to a's, and of the wall's surface, in m/s.
    pub relative_velocity: Vec3<S>,
    pub surface_velocity: Vec3<S>,
    /// Inverse effective mass of each body, a first.
    pub inverse_effective_masses: [InverseEffectiveMass<S>; 2],
    /// True if continuous detection stopped the marble, and it is half inside of this wall.
    pub core_touches: bool,
    pub has_capsule: bool,
    /// Set where impulses along the normal change the velocity along the tangents too: of capsules and
    /// of bodies with locked axes.
    pub is_coupled: bool,
    /// Sum of the curvatures, in 1/m.
    pub curvature: S,
    pub material: ContactMaterial<S>,
}

impl<S, W, F> PenaltySettings<'_, S, W, F>
where
    S: Scalar,
    W: Colliders<S>,
    F: Fn(usize) -> S,
{
    /// State of a contact; none without penetration, or if nothing can move.
    pub(super) fn active_contact(
        &self,
        marbles: &SolverBodies<S>,
        body_a: BodyA,
        contact: &Contact<S>,
        before: &[SpringHistory<S>],
    ) -> Option<PenaltyContact<S>> {
        let Contact { separation, .. } = *contact;
        let (a, b) = (body_a.marble(), contact.b as usize);
        // Displacement since the position of the step's own kick; see this module's docs.
        let moved = |row: usize| self.context.displacement_of(row, marbles.velocity[row]);
        let is_locked =
            a.into_iter().chain([b]).any(|row| !marbles.locked_axes(row).moves_freely());
        let has_capsule = a.into_iter().chain([b]).any(|row| marbles.capsule(row).is_some());
        let (penetration, normal, arms) = match a {
            Some(a) if !has_capsule => {
                let radii = [marbles.radius[a], marbles.radius[b]];
                let (penetration, normal, arms) =
                    geometry_before(contact, radii, moved(b) - moved(a));
                // An impact is where a contact begins; in between, what rests sways.
                let key = body_a.contact_key(contact);
                let begins = before.binary_search_by_key(&key, |history| history.key).is_err();
                let place = (normal, -penetration);
                let leaning = if begins {
                    marbles.impact_normal(body_a, b, place, &self.context)
                } else {
                    normal
                };
                let change = leaning - normal;
                let arms = [arms[0] + change * radii[0], arms[1] - change * radii[1]];
                (penetration, leaning, arms)
            }
            // Along the present normal: internal edges are known for that one, and the nearest
            // points of capsules move along them.
            _ => {
                let place = (contact.arms, contact.normal);
                let surface_velocity =
                    marbles.surface_velocity(body_a, b, place, self.context.walls);
                let wall_moved = surface_velocity * self.context.follow_time_of(b);
                let displacement = moved(b) - a.map_or(wall_moved, moved);
                (displacement.dot(contact.normal) - separation, contact.normal, contact.arms)
            }
        };
        let surface_velocity =
            marbles.surface_velocity(body_a, b, (arms, normal), self.context.walls);
        let core = marbles.radius[b] * S::from_f64(CORE * (1.0 - CORE_ROUNDING));
        let none = InverseEffectiveMass { normal: S::zero(), tangent: S::zero() };
        let found = PenaltyContact {
            key: body_a.contact_key(contact),
            body_a,
            a,
            b,
            arms,
            normal,
            penetration,
            relative_velocity: marbles.relative_velocity(body_a, b, arms, normal, surface_velocity),
            surface_velocity,
            inverse_effective_masses: [
                a.map_or(none, |a| marbles.inverse_effective_mass(a, arms[0], -normal)),
                marbles.inverse_effective_mass(b, arms[1], normal),
            ],
            core_touches: a.is_none() && self.context.is_ccd_stopped(b) && -separation >= core,
            has_capsule,
            is_coupled: has_capsule || is_locked,
            curvature: a.map_or_else(S::zero, |a| marbles.radius[a].recip())
                + marbles.radius[b].recip(),
            material: contact.material.clamped(),
        };
        (separation < S::zero() && found.is_active()).then_some(found)
    }
}

/// Penetration, normal and arms of a contact of two balls before a displacement of the second
/// relative to the first: its normal turns by it, and forces along another one would change energy.
fn geometry_before<S: Scalar>(
    contact: &Contact<S>,
    radii: [S; 2],
    displacement: Vec3<S>,
) -> (S, Vec3<S>, [Vec3<S>; 2]) {
    let Contact { normal, separation, arms, .. } = *contact;
    let touching = radii[0] + radii[1];
    let apart = (touching + separation).max(S::zero());
    let between = normal * apart - displacement;
    let distance = length(between);
    if distance == S::zero() {
        return (touching, normal, arms);
    }
    // So that the penetration of a pebble in a boulder keeps its digits.
    let nearer = displacement.dot(normal * apart + between) / (apart + distance);
    let turned = between / distance;
    let change = turned - normal;
    let arms = [arms[0] + change * radii[0], arms[1] - change * radii[1]];
    (nearer - separation, turned, arms)
}

impl<S: Scalar> PenaltyContact<S> {
    /// True if there is a finite penetration, and a body that can move.
    fn is_active(&self) -> bool {
        self.penetration > S::zero()
            && self.penetration.is_finite()
            && self.inverse_effective_mass().normal > S::zero()
            && is_finite(self.relative_velocity)
    }

    pub fn inverse_effective_mass(&self) -> InverseEffectiveMass<S> {
        self.inverse_effective_masses[0].plus(self.inverse_effective_masses[1])
    }

    pub fn velocities(&self, marbles: &SolverBodies<S>) -> [Vec3<S>; 2] {
        [self.a.map_or_else(Vec3::zero, |a| marbles.velocity[a]), marbles.velocity[self.b]]
    }

    /// Relative velocity of the contact points now, in m/s.
    pub fn relative_velocity(&self, marbles: &SolverBodies<S>) -> Vec3<S> {
        let Self { body_a, b, arms, normal, surface_velocity, .. } = *self;
        marbles.relative_velocity(body_a, b, arms, normal, surface_velocity)
    }

    /// Velocity of b relative to a, in m/s, by their own velocities and that of the contact points:
    /// spins of balls do no work along any normal.
    pub fn without_spin(&self, [a, b]: [Vec3<S>; 2], relative_velocity: Vec3<S>) -> Vec3<S> {
        if self.has_capsule { relative_velocity } else { b - a - self.surface_velocity }
    }

    /// Books the energy of an impulse, after all were applied.
    pub fn record_energy(
        &self,
        marbles: &SolverBodies<S>,
        impulse: Vec3<S>,
        work: &mut EnergyLedger,
    ) {
        let mean_velocity =
            cast_vector::<S, f64>(self.relative_velocity + self.relative_velocity(marbles)) * 0.5;
        self.record_impulse(marbles, impulse, mean_velocity, work);
        work.collisions += 1;
    }

    pub fn record_impulse(
        &self,
        marbles: &SolverBodies<S>,
        impulse: Vec3<S>,
        mean_velocity: Vec3<f64>,
        work: &mut EnergyLedger,
    ) {
        let surface_velocity = Some(cast_vector(self.surface_velocity));
        let fixed_velocity = [
            self.a.map_or(surface_velocity, |a| marbles.fixed_velocity(a)),
            marbles.fixed_velocity(self.b),
        ];
        let (impulse, normal) = (cast_vector(impulse), cast_vector(self.normal));
        work.record_impulse(ImpulseSample { impulse, normal, mean_velocity, fixed_velocity });
    }

    #[inline]
    pub fn apply_impulse(&self, marbles: &mut SolverBodies<S>, impulse: Vec3<S>) {
        let [first, second] = self.arms;
        for (row, impulse, normal, arm) in
            [(Some(self.b), impulse, self.normal, second), (self.a, -impulse, -self.normal, first)]
        {
            let Some(row) = row else { continue };
            marbles.apply_impulse(row, impulse * marbles.inverse_mass[row], normal, arm);
        }
    }

    /// Angular impulse that would stop the relative spin, in kg m²/s, if `counts` contacts share
    /// each body; zero without rolling or torsional friction.
    pub fn rolling_impulse(&self, marbles: &SolverBodies<S>, counts: [S; 2]) -> Vec3<S> {
        let ContactMaterial { rolling_resistance, spinning_resistance, .. } = self.material;
        if rolling_resistance == S::zero() && spinning_resistance == S::zero() {
            return Vec3::zero();
        }
        let mut inverse_inertia = marbles.inverse_inertia(self.b) * counts[1];
        if let Some(a) = self.a {
            inverse_inertia += marbles.inverse_inertia(a) * counts[0];
        }
        if inverse_inertia > S::zero() {
            self.relative_spin(marbles) / inverse_inertia
        } else {
            Vec3::zero()
        }
    }

    /// Relative spin, in rad/s.
    pub fn relative_spin(&self, marbles: &SolverBodies<S>) -> Vec3<S> {
        let first = self.a.map_or_else(Vec3::zero, |a| marbles.unlocked_spin(a));
        marbles.unlocked_spin(self.b) - first
    }
}
