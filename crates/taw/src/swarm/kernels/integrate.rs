//! Integration of rows: by their velocities in the full tier, before and after overlap is moved
//! apart in the lab's.

use crate::math::{Kernel, Row, Scalar, Simd};

/// Faster than this, in m/s, or further out, in metres, a ball is no longer a ball: squares of
/// such numbers and of sums of them are still finite.
pub(in crate::swarm) const MAX_MAGNITUDE: f64 = 1e15;

/// Integrates velocities, and positions by these.
pub(in crate::swarm) struct IntegratePositions<'a, S> {
    pub at: &'a mut [Row<S>],
    pub velocity: &'a mut [Row<S>],
    pub spin: &'a [Row<S>],
    pub skin_left: &'a mut [S],
    /// In m/s, and zero.
    pub change: Row<S>,
    /// In seconds, thrice, and zero.
    pub time: Row<S>,
    /// Displacement of balls in free flight, in metres, that makes the step second order (velocity
    /// Verlet): minus half the change of velocity by gravity times the time.
    pub correction: Row<S>,
    /// Least remaining skin, in metres; below it, `overrun` is set.
    pub least: S,
    pub overrun: &'a mut bool,
    /// The rows that were stopped because of where they would have gone.
    pub stopped: &'a mut Vec<u32>,
    pub first: u32,
}

impl<S: Scalar> Kernel<S> for IntegratePositions<'_, S> {
    #[inline(always)]
    fn run<L: Simd<Scalar = S>>(self) {
        // In registers, not behind a reference that any of the rows might be.
        let (change, time, correction) = (self.change, self.time, self.correction);
        let mut lowest = S::max_value();
        let rows = self.at.iter_mut().zip(self.velocity).zip(self.skin_left).zip(self.spin);
        for (row, (((at, velocity), skin_left), spin)) in rows.enumerate() {
            if velocity[3].is_sign_negative() {
                continue; // asleep
            }
            let new = sum(*velocity, change);
            let displacement = product(new, time);
            let displacement =
                if spin[3] == S::zero() { sum(displacement, correction) } else { displacement };
            let place = sum(*at, displacement);
            let ok = largest(new) < S::from_f64(MAX_MAGNITUDE)
                && largest(place) < S::from_f64(MAX_MAGNITUDE);
            if ok {
                (*velocity, *at) = (new, place);
                *skin_left -= squared(displacement).sqrt();
                lowest = lowest.min(*skin_left);
            } else {
                *velocity = [S::zero(), S::zero(), S::zero(), velocity[3]];
                self.stopped.push(self.first + row as u32);
            }
        }
        *self.overrun |= lowest < self.least;
    }
}

#[inline(always)]
fn sum<S: Scalar>(a: Row<S>, b: Row<S>) -> Row<S> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}

#[inline(always)]
fn product<S: Scalar>(a: Row<S>, b: Row<S>) -> Row<S> {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3]]
}

/// Of the three coordinates.
#[inline(always)]
pub(in crate::swarm) fn squared<S: Scalar>(a: Row<S>) -> S {
    a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
}

/// Of the three coordinates; NaN if one of them is.
#[inline(always)]
pub(in crate::swarm) fn largest<S: Scalar>(a: Row<S>) -> S {
    a[0].abs() + a[1].abs() + a[2].abs()
}

/// The first part of a step in the lab's tier: balls move on, and their velocities make room for
/// the places where they were.
pub(in crate::swarm) struct Predict<'a, S> {
    pub at: &'a mut [Row<S>],
    pub velocity: &'a mut [Row<S>],
    /// Way of each.
    pub displacement: &'a mut [S],
    pub change: Row<S>,
    pub time: Row<S>,
    pub stopped: &'a mut Vec<u32>,
    pub first: u32,
}

impl<S: Scalar> Kernel<S> for Predict<'_, S> {
    #[inline(always)]
    fn run<L: Simd<Scalar = S>>(self) {
        let rows = self.at.iter_mut().zip(self.velocity).zip(self.displacement);
        for (row, ((at, velocity), length)) in rows.enumerate() {
            let new = sum(*velocity, self.change);
            let displacement = product(new, self.time);
            let place = sum(*at, displacement);
            let ok = largest(new) < S::from_f64(MAX_MAGNITUDE)
                && largest(place) < S::from_f64(MAX_MAGNITUDE);
            let before = [at[0], at[1], at[2], velocity[3]];
            if ok {
                *at = place;
                *length = squared(displacement).sqrt();
            } else {
                *length = S::zero();
                self.stopped.push(self.first + row as u32);
            }
            *velocity = before;
        }
    }
}

/// The last part of it: velocities are what places became, though no ball is faster than it was
/// before others pushed it. (What is pushed out of a deep overlap would fly off otherwise.)
pub(in crate::swarm) struct UpdateVelocities<'a, S> {
    pub at: &'a [Row<S>],
    pub velocity: &'a mut [Row<S>],
    pub displacement: &'a [S],
    pub skin_left: &'a mut [S],
    pub per_second: Row<S>,
}

impl<S: Scalar> Kernel<S> for UpdateVelocities<'_, S> {
    #[inline(always)]
    fn run<L: Simd<Scalar = S>>(self) {
        let rows = self.at.iter().zip(self.velocity).zip(self.displacement).zip(self.skin_left);
        for (((at, velocity), expected), skin_left) in rows {
            let displacement =
                [at[0] - velocity[0], at[1] - velocity[1], at[2] - velocity[2], S::zero()];
            let length = squared(displacement).sqrt();
            *skin_left -= length;
            let part = if length > *expected { *expected / length } else { S::one() };
            let new = product(displacement, self.per_second);
            *velocity = [new[0] * part, new[1] * part, new[2] * part, velocity[3]];
        }
    }
}
