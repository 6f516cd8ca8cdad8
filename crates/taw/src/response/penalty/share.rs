//! How the contacts of one marble share it.

use super::Touch;
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
pub(super) struct Load<S> {
    /// Of dashpots: the part of the velocity that all take in a substep; more than one would turn
    /// it back.
    damped: S,
    /// Of springs alone.
    sprung: S,
    /// How many contacts there are.
    pub count: S,
}

impl<S: Scalar> Load<S> {
    pub const fn none(zero: S) -> Self {
        Self { damped: zero, sprung: zero, count: zero }
    }

    pub fn add(&mut self, other: &Self) {
        self.damped += other.damped;
        self.sprung += other.sprung;
        self.count += other.count;
    }

    /// Of one contact, along the normal and across it.
    pub fn of(touch: &Touch<S>, springs: &Springs<S>, dt: S, drags: [S; 2]) -> Self {
        let number = S::constant;
        let give = touch.give();
        let asked = [(springs.slope, give.normal), (springs.across, give.tangent)];
        let sprung = asked.map(|(stiffness, give)| stiffness * give * dt * dt);
        let damped = drags.map(|drag| number(2.0) * drag / (S::one() + drag));
        // Of a ball, what is along and what is across are apart.
        let both = |[along, across]: [S; 2]| {
            if touch.is_of_rods { along + across } else { along.max(across) }
        };
        Self { damped: both(damped), sprung: both(sprung), count: S::one() }
    }

    /// Into how many marbles one is split, at least one.
    pub fn parts(&self) -> S {
        // Stable is what has (ω dt)² and twice the part that dashpots take below 4. And a marble
        // with all its contacts goes through an eighth of a turn of its oscillation in a
        // substep at most, so that it is still one.
        S::one().max(self.damped).max(self.sprung / S::constant(RESOLVED))
    }
}

/// The square of π/4.
const RESOLVED: f64 = std::f64::consts::PI * std::f64::consts::PI / 16.0;
