//! How the contacts of one marble share it.

use super::PenaltyContact;
use super::law::Springs;
use crate::math::Scalar;

/// What the contacts of a marble ask of a substep, all together.
///
/// A marble of N contacts is split into N marbles that share its mass (Tonge, Benevolenski and
/// Voroshilov, *Mass splitting for jitter-free parallel rigid body simulation*, 2012), each by
/// what its contact asks for: then the stiffnesses of all contacts together, whatever their
/// directions and masses, are no more than that of one contact at its limit. Where N
/// contacts ask for less than that limit, none is softened.
#[derive(Clone, Copy)]
pub(super) struct ContactLoad<S> {
    /// Of dashpots: the part of the velocity that all take in a substep; more than one would turn
    /// it back.
    damping: S,
    /// Of springs alone.
    stiffness: S,
    /// How many contacts there are.
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

    /// Of one contact, along the normal and across it.
    pub fn of(
        contact: &PenaltyContact<S>,
        springs: &Springs<S>,
        dt: S,
        half_damping: [S; 2],
    ) -> Self {
        let number = S::constant;
        let inverse_mass = contact.inverse_effective_mass();
        let limits = [
            (springs.stiffness, inverse_mass.normal),
            (springs.tangent_stiffness, inverse_mass.tangent),
        ];
        let stiffness = limits.map(|(stiffness, inverse_mass)| stiffness * inverse_mass * dt * dt);
        let damping = half_damping.map(|half| number(2.0) * half / (S::one() + half));
        // Of a ball, what is along and what is across are apart.
        let total = |[normal, tangent]: [S; 2]| {
            if contact.has_capsule { normal + tangent } else { normal.max(tangent) }
        };
        Self { damping: total(damping), stiffness: total(stiffness), count: S::one() }
    }

    /// Into how many marbles one is split, at least one.
    pub fn split_count(&self) -> S {
        // Stable is what has (ω dt)² and twice the part that dashpots take below 4. And a marble
        // with all its contacts goes through an eighth of a turn of its oscillation in a
        // substep at most, so that it is still one.
        S::one().max(self.damping).max(self.stiffness / S::constant(RESOLVED))
    }
}

/// The square of π/4.
const RESOLVED: f64 = std::f64::consts::PI * std::f64::consts::PI / 16.0;
