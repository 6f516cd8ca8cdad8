//! Mass splitting: the contacts of one marble share its mass.

use cgmath::{Matrix3, SquareMatrix, Zero};

use super::contact::PenaltyContact;
use super::law::Springs;
use crate::math::Scalar;
use crate::response::InverseEffectiveMass;

/// Stiffness and damping demand of a marble's contacts in a substep.
///
/// A marble of N contacts is split into N marbles that share its mass (Tonge, Benevolenski and
/// Voroshilov, *Mass splitting for jitter-free parallel rigid body simulation*, 2012), in
/// proportion to the demand: then the stiffness of all contacts together, whatever their directions
/// and masses, is at most that of one contact at its limit, and no dashpots reverse a motion. Where
/// the total stays below the limit, no contact is softened. Springs and dashpots are split each by
/// their own demand: springs that were softened because dashpots have a common limit would not
/// bear what lies on them.
#[derive(Clone, Copy)]
pub(super) struct ContactLoad<S> {
    /// Fraction of the velocity that the dashpots take in a substep, by direction: the sum of f n nᵀ
    /// of normal ones, and of the part of tangential ones that does not turn the marble. More than
    /// one would reverse it.
    directed_damping: Matrix3<S>,
    /// Sum of the fractions, normal or tangential, whatever the directions.
    damping: S,
    /// Stiffness of the springs, as (ω dt)².
    stiffness: S,
    /// Number of contacts.
    pub count: S,
    /// A capsule turns by normal impulses too, so that directions alone do not tell how its
    /// contacts share it.
    has_capsule: bool,
}

impl<S: Scalar> ContactLoad<S> {
    pub fn none() -> Self {
        let zero = S::zero();
        Self {
            directed_damping: Matrix3::zero(),
            damping: zero,
            stiffness: zero,
            count: zero,
            has_capsule: false,
        }
    }

    pub fn add(&mut self, other: &Self) {
        self.directed_damping += other.directed_damping;
        self.damping += other.damping;
        self.stiffness += other.stiffness;
        self.count += other.count;
        self.has_capsule |= other.has_capsule;
    }

    /// Demand of a contact on one of its bodies, the first or the second.
    pub fn of(
        contact: &PenaltyContact<S>,
        springs: &Springs<S>,
        dt: S,
        half_damping: [S; 2],
        body: usize,
    ) -> Self {
        let inverse_mass = contact.inverse_effective_mass();
        let limits = [
            (springs.stiffness, inverse_mass.normal),
            (springs.tangent_stiffness, inverse_mass.tangent),
        ];
        let stiffness = limits.map(|(stiffness, inverse_mass)| stiffness * inverse_mass * dt * dt);
        let damping = half_damping.map(damped_fraction);
        // Normal and tangential motion of a sphere are independent.
        let total = |[normal, tangent]: [S; 2]| {
            if contact.has_capsule { normal + tangent } else { normal.max(tangent) }
        };
        let InverseEffectiveMass { normal, tangent } = contact.inverse_effective_masses[body];
        let across = if tangent > S::zero() { damping[1] * normal / tangent } else { S::zero() };
        let n = contact.normal;
        let along = Matrix3::from_cols(n * n.x, n * n.y, n * n.z);
        Self {
            directed_damping: along * (damping[0] - across) + Matrix3::from_value(across),
            damping: total(damping),
            stiffness: total(stiffness),
            count: S::one(),
            has_capsule: contact.has_capsule,
        }
    }

    /// Number of marbles that one is split into for its springs, at least one.
    pub fn spring_split(&self) -> S {
        // Stable is (ω dt)² plus twice the damped fraction below 4. And a marble with all its
        // contacts goes through at most an eighth of its oscillation per substep, so that the
        // motion is resolved.
        S::one().max(self.stiffness / S::from_f64(RESOLVED))
    }

    /// Number of marbles that one is split into for the dashpots of a contact of this demand,
    /// normal and tangential, at least one.
    pub fn dashpot_splits(&self, own: &Self) -> [S; 2] {
        let all = S::one().max(self.damping);
        if self.has_capsule {
            return [all; 2];
        }
        // Tangential dashpots turn the marble, too: what others have in common with them is counted
        // twice, so that all together stay stable.
        let normal = S::one().max(largest_eigenvalue(self.directed_damping));
        [normal, normal.max(self.damping + (self.damping - own.damping))]
    }
}

/// Fraction of the velocity that a dashpot takes in a substep.
pub(super) fn damped_fraction<S: Scalar>(half_damping: S) -> S {
    half_damping * S::from_f64(2.0) / (S::one() + half_damping)
}

/// Largest eigenvalue of a symmetric matrix (Smith 1961).
fn largest_eigenvalue<S: Scalar>(matrix: Matrix3<S>) -> S {
    let number = S::from_f64;
    let mean = matrix.trace() / number(3.0);
    let rest = matrix - Matrix3::from_value(mean);
    let spread = ((rest * rest).trace() / number(6.0)).max(S::zero()).sqrt();
    if !(spread > S::zero()) {
        return mean;
    }
    let cosine = (rest * spread.recip()).determinant() * number(0.5);
    let cosine = cosine.max(-S::one()).min(S::one());
    let angle = (S::one() - cosine * cosine).sqrt().atan2_portable(cosine) / number(3.0);
    mean + spread * number(2.0) * angle.sin_cos_portable().1
}

/// Square of π/4.
const RESOLVED: f64 = std::f64::consts::PI * std::f64::consts::PI / 16.0;
