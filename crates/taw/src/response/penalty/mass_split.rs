//! Mass splitting: the contacts of one marble share its mass.

use super::contact::PenaltyContact;
use super::law::Springs;
use crate::math::Scalar;

/// Stiffness and damping demand of a marble's contacts in a substep.
///
/// A marble of N contacts is split into N marbles that share its mass (Tonge, Benevolenski and
/// Voroshilov, *Mass splitting for jitter-free parallel rigid body simulation*, 2012), in
/// proportion to the demand: then the stiffness of all contacts together, whatever their directions
/// and masses, is at most that of one contact at its limit. Where the total stays below the limit,
/// no contact is softened.
#[derive(Clone, Copy)]
pub(super) struct ContactLoad<S> {
    /// Fraction of the velocity that all dashpots take in a substep; more than one would reverse
    /// it.
    damping: S,
    /// Stiffness of the springs, as (ω dt)².
    stiffness: S,
    /// Number of contacts.
    pub count: S,
}

impl<S: Scalar> ContactLoad<S> {
    pub const fn none(zero: S) -> Self {
        Self { damping: zero, stiffness: zero, count: zero }
    }

    pub fn add(&mut self, other: &Self) {
        self.damping += other.damping;
        self.stiffness += other.stiffness;
        self.count += other.count;
    }

    /// Demand of one contact, normal and tangential.
    pub fn of(
        contact: &PenaltyContact<S>,
        springs: &Springs<S>,
        dt: S,
        half_damping: [S; 2],
    ) -> Self {
        let number = S::from_f64;
        let inverse_mass = contact.inverse_effective_mass();
        let limits = [
            (springs.stiffness, inverse_mass.normal),
            (springs.tangent_stiffness, inverse_mass.tangent),
        ];
        let stiffness = limits.map(|(stiffness, inverse_mass)| stiffness * inverse_mass * dt * dt);
        let damping = half_damping.map(|half| number(2.0) * half / (S::one() + half));
        // Normal and tangential motion of a sphere are independent.
        let total = |[normal, tangent]: [S; 2]| {
            if contact.has_capsule { normal + tangent } else { normal.max(tangent) }
        };
        Self { damping: total(damping), stiffness: total(stiffness), count: S::one() }
    }

    /// Number of marbles that one is split into, at least one.
    pub fn split_count(&self) -> S {
        // Stable is (ω dt)² plus twice the damped fraction below 4. And a marble with all its
        // contacts goes through at most an eighth of its oscillation per substep, so that the
        // motion is resolved.
        S::one().max(self.damping).max(self.stiffness / S::from_f64(RESOLVED))
    }
}

/// Square of π/4.
const RESOLVED: f64 = std::f64::consts::PI * std::f64::consts::PI / 16.0;
