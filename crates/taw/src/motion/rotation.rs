use std::marker::PhantomData;

use cgmath::{InnerSpace, Rotation as _, Zero};

use crate::math::{Quat, Scalar, Vec3, cast_vector, normalize_and_length};

/// Rotation model of a world, ordered by how much it simulates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Rotation {
    /// No rotation, at no cost in memory and time.
    #[default]
    None,
    /// Visual rolling: marbles rotate as if they rolled without slipping over the walls that they
    /// touch, and keep their angular velocity in the air. Rotation follows the motion and does not
    /// affect it; capsules rotate about their axes only.
    Rolling,
    /// Rigid-body rotation of solid bodies of uniform density: friction and torques change the
    /// angular momentum. Without a response that has friction, only torques do.
    Dynamic,
}

/// Integrates a rotation by an angular velocity (axial vector in world space, rad/s) for `dt`
/// seconds: exact for a constant one.
#[must_use]
#[inline(always)]
#[expect(
    clippy::inline_always,
    reason = "passing four numbers in memory costs as much as the rest"
)]
pub fn integrate_rotation<S: Scalar>(
    rotation: Quat<S>,
    angular_velocity: Vec3<S>,
    dt: S,
) -> Quat<S> {
    if angular_velocity.is_zero() {
        return rotation; // to the bit
    }
    let half_angle = angular_velocity * (dt * S::from_f64(0.5));
    let squared = half_angle.magnitude2();
    let turn = if squared <= S::from_f64(SMALL) {
        Quat::from_sv(series(squared, COSINE), half_angle * series(squared, SINC))
    } else if let Some((axis, speed)) = normalize_and_length(angular_velocity) {
        axis_angle(axis, speed * dt)
    } else {
        return rotation;
    };
    renormalized(turn * rotation)
}

/// Rotation of unit length, given one that may have drifted from it.
#[inline]
fn renormalized<S: Scalar>(rotation: Quat<S>) -> Quat<S> {
    let excess = rotation.magnitude2() - S::one();
    if excess.abs() * excess.abs() <= S::epsilon() {
        // A step of Newton's method for the reciprocal root leaves 3/8 of the square.
        rotation * (S::one() - excess * S::from_f64(0.5))
    } else {
        rotation.normalize()
    }
}

/// Square of the half angle up to which series give sine and cosine to the rounding of `f64`.
const SMALL: f64 = 0.0625;
/// Coefficients of `cos x` and `sin x / x` by powers of `x²` (Taylor).
const COSINE: [f64; 7] = [
    1.0,
    -1.0 / 2.0,
    1.0 / 24.0,
    -1.0 / 720.0,
    1.0 / 40_320.0,
    -1.0 / 3_628_800.0,
    1.0 / 479_001_600.0,
];
const SINC: [f64; 7] = [
    1.0,
    -1.0 / 6.0,
    1.0 / 120.0,
    -1.0 / 5_040.0,
    1.0 / 362_880.0,
    -1.0 / 39_916_800.0,
    1.0 / 6_227_020_800.0,
];

/// Sum of a power series (Estrin 1960).
#[inline]
fn series<S: Scalar>(x: S, coefficients: [f64; 7]) -> S {
    let [a, b, c, d, e, f, g] = coefficients.map(S::from_f64);
    let squared = x * x;
    (a + b * x) + squared * ((c + d * x) + squared * ((e + f * x) + squared * g))
}

/// Rotation about a unit axis by `angle` radians.
fn axis_angle<S: Scalar>(axis: Vec3<S>, angle: S) -> Quat<S> {
    let (sin, cos) = (angle * S::from_f64(0.5)).sin_cos_portable();
    Quat::from_sv(cos, axis * sin)
}

/// Axes of the symmetric top closest to a body: its own axis, and the two across, whose inverse
/// moments differ least.
fn symmetric_axes<S: Scalar>(inverse: Vec3<S>) -> [usize; 3] {
    let apart = |[_, a, b]: [usize; 3]| (inverse[a] - inverse[b]).abs();
    let closer = |x, y| if apart(y) < apart(x) { y } else { x };
    closer(closer([2, 0, 1], [0, 1, 2]), [1, 2, 0])
}

/// Rotation of a torque-free rigid body.
///
/// The angular momentum is stored in the body's own axes, where its component about an unstable
/// axis can be tiny beside the others without losing digits. State and computation are in `f64` for
/// any scalar: the time when an unstable body flips depends on its energy to a few parts in a
/// million, which the rounding of a few thousand steps in `f32` would use up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeRotation<S> {
    attitude: Quat<f64>,
    momentum: Vec3<f64>,
    scalar: PhantomData<S>,
}

impl<S: Scalar> FreeRotation<S> {
    /// Creates a body with this attitude (from its principal axes to the world) and angular
    /// momentum (in kg m²/s, along its principal axes).
    #[must_use]
    pub fn new(attitude: Quat<S>, momentum: Vec3<S>) -> Self {
        let attitude = Quat::from_sv(attitude.s.as_f64(), cast_vector(attitude.v));
        Self { attitude, momentum: cast_vector(momentum), scalar: PhantomData }
    }

    /// Attitude: from the body's principal axes to the world.
    #[must_use]
    pub fn attitude(&self) -> Quat<S> {
        Quat::from_sv(S::from_f64(self.attitude.s), cast_vector(self.attitude.v))
    }

    /// Angular momentum in kg m²/s, along the body's principal axes.
    #[must_use]
    pub fn momentum(&self) -> Vec3<S> {
        cast_vector(self.momentum)
    }

    /// Steps by `dt` seconds, for a body with these principal moments of inertia (kg m², about its
    /// x, y and z axes, all above zero).
    ///
    /// A symmetric top, with two equal moments, is solved exactly for any `dt`. The excess of an
    /// asymmetric one is split off and applied half before, half after (Strang), which makes the
    /// step order 2 and reversible (Touma and Wisdom, *Lie-Poisson integrators for rigid body
    /// dynamics*, 1994; Dullweber, Leimkuhler and `McLachlan` 1997).
    #[must_use]
    pub fn step(self, inertia: Vec3<S>, dt: S) -> Self {
        let inverse: Vec3<f64> = inertia.map(|moment| 1.0 / moment.as_f64());
        let [alone, common, other] = symmetric_axes(inverse);
        let dt = dt.as_f64();
        // Rotates about one of the body's axes, by the excess of its inverse moment over the common
        // one.
        let turn_in_body = |body: Self, axis: usize, dt: f64| {
            let excess = inverse[axis] - inverse[common];
            let mut unit = Vec3::new(0.0, 0.0, 0.0);
            unit[axis] = 1.0;
            let turn = axis_angle(unit, body.momentum[axis] * excess * dt);
            Self {
                attitude: body.attitude * turn,
                momentum: turn.conjugate().rotate_vector(body.momentum),
                ..body
            }
        };
        let mut body = turn_in_body(self, other, 0.5 * dt);
        // The symmetric top rotates about its own axis and, with it, about the angular momentum.
        body = turn_in_body(body, alone, dt);
        let momentum = body.attitude.rotate_vector(body.momentum);
        body.attitude = integrate_rotation(body.attitude, momentum * inverse[common], dt);
        turn_in_body(body, other, 0.5 * dt)
    }

    /// Angular momentum in kg m²/s, in world space.
    #[must_use]
    pub fn angular_momentum(&self) -> Vec3<S> {
        cast_vector(self.attitude.rotate_vector(self.momentum))
    }

    /// Rotational kinetic energy, in joules.
    #[must_use]
    pub fn energy(&self, inertia: Vec3<S>) -> S {
        let parts = self.momentum.zip(cast_vector(inertia), |l, moment: f64| l * l / moment);
        S::from_f64(0.5 * (parts.x + parts.y + parts.z))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cgmath::One;

    #[test]
    fn what_does_not_turn_keeps_its_bits() {
        for (at, s) in [0.1_f32, 0.3, 0.5, 0.7, 0.9, 1.3].into_iter().enumerate() {
            let unit = Quat::new(s, 0.2, -0.3, 0.1 + at as f32).normalize();
            for rotation in [unit, unit * 1.000_000_4, unit * 0.9, Quat::new(0.0, 0.0, 0.0, 0.0)] {
                let still = Vec3::new(0.0, -0.0, 0.0);
                assert_eq!(integrate_rotation(rotation, still, 1.0 / 60.0), rotation);
            }
        }
    }

    /// Checks angles below and above the one up to which series serve, and those whose squares vanish.
    #[test]
    fn a_turn_has_the_digits_of_its_scalar_at_any_angle() {
        let axis = Vec3::new(2.0, 3.0, 6.0) / 7.0;
        let start = Quat::new(0.5, -0.5, 0.5, 0.5);
        for angle in [0.0, 1e-200, 1e-30, 1e-9, 1e-4, 0.03, 0.3, 0.499_999, 0.500_001, 0.7, 3.0] {
            let expected = axis_angle(axis, angle) * start;
            let double = integrate_rotation(start, axis * angle, 1.0);
            assert!((double - expected).magnitude() < 4e-16, "{angle}: {double:?}");
            let single = integrate_rotation(
                Quat::new(0.5_f32, -0.5, 0.5, 0.5),
                cast_vector(axis * angle),
                1.0,
            );
            let single = Quat::from_sv(f64::from(single.s), cast_vector(single.v));
            assert!((single - expected).magnitude() < 2e-7, "{angle}: {single:?}");
        }
    }

    /// Checks that rounding lets no length drift, and that a wrong one is set right.
    #[test]
    fn a_rotation_keeps_its_length() {
        let angular_velocity = Vec3::new(3.0, -20.0, 7.0_f32);
        let turned = (0..100_000)
            .fold(Quat::one(), |q, _| integrate_rotation(q, angular_velocity, 1.0 / 240.0));
        assert!((turned.magnitude() - 1.0).abs() < 2e-7, "{turned:?}");
        for length in [0.5, 0.9, 0.999, 1.001, 1.1, 3.0] {
            let set = integrate_rotation(Quat::one() * length, angular_velocity, 1e-3);
            assert!((set.magnitude() - 1.0).abs() < 2e-7, "{length}: {set:?}");
        }
    }

    #[test]
    fn a_turn_is_exact_however_long_the_step() {
        let angular_velocity = Vec3::new(0.3, -2.0, 0.7_f64);
        let once = integrate_rotation(Quat::one(), angular_velocity, 3.0);
        let many =
            (0..3000).fold(Quat::one(), |q, _| integrate_rotation(q, angular_velocity, 0.001));
        assert!((once - many).magnitude() < 1e-12 || (once + many).magnitude() < 1e-12);
    }

    #[test]
    fn a_symmetric_top_is_exact_however_long_the_step() {
        for inertia in [[1.0, 1.0, 3.0], [0.5, 2.0, 2.0], [2.0, 0.7, 2.0], [4.0, 4.0, 4.0]] {
            let inertia = Vec3::from(inertia);
            let start =
                FreeRotation::new(Quat::new(0.5, 0.5, -0.5, 0.5), Vec3::new(0.3, -2.0, 0.7_f64));
            let once = start.step(inertia, 3.0);
            let many = (0..3000).fold(start, |body, _| body.step(inertia, 0.001));
            let (once, many) = (once.attitude(), many.attitude());
            let apart = (once - many).magnitude().min((once + many).magnitude());
            assert!(apart < 1e-12, "{inertia:?}: {apart} apart");
        }
    }

    /// The box of the Dzhanibekov effect: turns about its middle axis, with a bit of
    /// the others. Gives (worst relative energy error, times at which the body's own
    /// angular velocity about y changed its sign).
    fn dzhanibekov<S: Scalar>(dt: f64) -> (f64, Vec<f64>) {
        let inertia = Vec3::new(1.6, 4.16, 5.44).map(S::from_f64);
        let angular_velocity = Vec3::new(0.01, 5.0, 0.01).map(S::from_f64);
        let momentum = Vec3::new(
            angular_velocity.x * inertia.x,
            angular_velocity.y * inertia.y,
            angular_velocity.z * inertia.z,
        );
        let mut body = FreeRotation::new(Quat::one(), momentum);
        let start = body.energy(inertia).as_f64();
        let (mut worst, mut flips, mut last): (f64, _, f64) = (0.0, Vec::new(), 1.0);
        for step in 1..=(100.0 / dt).round() as u32 {
            body = body.step(inertia, S::from_f64(dt));
            worst = worst.max((body.energy(inertia).as_f64() / start - 1.0).abs());
            let now = body.momentum().y.as_f64();
            if now * last < 0.0 {
                flips.push(f64::from(step) * dt);
            }
            last = now;
        }
        (worst, flips)
    }

    #[test]
    fn the_dzhanibekov_box_flips_twenty_times_in_100_seconds() {
        fn check<S: Scalar>() {
            for dt in [1.0 / 60.0, 1.0 / 240.0, 1e-3] {
                let (energy, flips) = dzhanibekov::<S>(dt);
                assert_eq!(flips.len(), 20, "in steps of {dt}");
                assert!(energy < 1e-4, "energy off by {energy} in steps of {dt}");
                // Runge–Kutta in f64: the first at 2.84256 s, then every 5.024785 s.
                let last = 2.84256 + 19.0 * 5.024_785;
                assert!((flips[19] - last).abs() < 0.02, "the last at {} s, not {last}", flips[19]);
            }
        }
        check::<f32>();
        check::<f64>();
    }
}
