//! Mass splitting: the contacts of one marble share its mass.

use super::contact::PenaltyContact;
use super::law::Springs;
use crate::math::Scalar;

/// Stiffness and damping demand of a marble's contacts in a substep.
///
/// A marble of N contacts is split into N marbles that share its mass (Tonge, Benevolenski and
/// Voroshilov, *Mass splitting for jitter-free parallel rigid body simulation*, 2012), in
/// proportion to the demand: then the stiffness of all contacts together, whatever their directions
/// and masses, is at most that of one contact at its limit, and no dashpots reverse a motion. Where
/// the total stays below the limit, no contact is softened. Springs and dashpots are split each by
/// their own demand: springs that were softened because dashpots have a common limit would not
/// bear what lies on them.
#[derive(Clone, Copy, Debug)]
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
    pub fn none() -> Self {
        Self { damping: S::zero(), stiffness: S::zero(), count: S::zero() }
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
        let inverse_mass = contact.inverse_effective_mass();
        let limits = [
            (springs.stiffness, inverse_mass.normal),
            (springs.tangent_stiffness, inverse_mass.tangent),
        ];
        let stiffness = limits.map(|(stiffness, inverse_mass)| stiffness * inverse_mass * dt * dt);
        let damping = half_damping.map(damped_fraction);
        // Normal and tangential motion of a free sphere are independent.
        let total = |[normal, tangent]: [S; 2]| {
            if contact.is_coupled { normal + tangent } else { normal.max(tangent) }
        };
        Self { damping: total(damping), stiffness: total(stiffness), count: S::one() }
    }

    /// Number of marbles that one is split into for its springs, at least one.
    pub fn spring_split(&self) -> S {
        // Stable is (ω dt)² plus twice the damped fraction below 4. And a marble with all its
        // contacts goes through at most an eighth of its oscillation per substep, so that the
        // motion is resolved.
        S::one().max(self.stiffness / S::from_f64(RESOLVED))
    }

    /// Number of marbles that one is split into for its dashpots, at least one.
    pub fn dashpot_split(&self) -> S {
        S::one().max(self.damping)
    }
}

/// Fraction of the velocity that a dashpot takes in a substep.
#[inline]
pub(super) fn damped_fraction<S: Scalar>(half_damping: S) -> S {
    half_damping * S::from_f64(2.0) / (S::one() + half_damping)
}

/// Fraction of a spring's impulse that its own dashpot, which acts half by the velocity before and
/// half by that after, leaves of it.
#[inline]
pub(super) fn undamped_fraction<S: Scalar>(damped_fraction: S) -> S {
    S::one() - damped_fraction * S::from_f64(0.5)
}

/// Square of π/4.
const RESOLVED: f64 = std::f64::consts::PI * std::f64::consts::PI / 16.0;
