use std::ops::Mul;

use cgmath::{EuclideanSpace, InnerSpace, One, Rotation as _, Zero};

use crate::frame::Bivector;
use crate::math::{Point3, Quat, Scalar, Vec3};

/// A rigid motion as one number: a rotor with a translational part. Motors compose by
/// multiplication, and a screw motion is one motor, not a rotation and a translation.
///
/// In projective geometric algebra it is an even multivector; after Clifford (1873), a dual
/// quaternion `real + ε dual`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor<S> {
    /// Rotation.
    pub real: Quat<S>,
    /// Half of the translation times the rotation.
    pub dual: Quat<S>,
}

/// Twist (velocity screw) of a rigid body in its own frame: the velocity of its origin and the
/// angular velocity, as one line bivector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist<S> {
    /// Angular velocity in rad/s, along the body's own axes.
    pub angular_velocity: Bivector<S>,
    /// Velocity of the origin in m/s, along the body's own axes.
    pub velocity: Vec3<S>,
}

/// An undirected line in Plücker coordinates (1865); in projective geometric algebra, a bivector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line<S> {
    /// Direction of the line.
    pub direction: Vec3<S>,
    /// Moment about the origin: any point of the line × the direction.
    pub moment: Vec3<S>,
}

impl<S: Scalar> Line<S> {
    /// The line through a point along a direction.
    #[must_use]
    pub fn through(point: Point3<S>, direction: Vec3<S>) -> Self {
        Self { direction, moment: point.to_vec().cross(direction) }
    }
}

impl<S: Scalar> Motor<S> {
    /// Creates the motion that rotates first and translates then.
    #[must_use]
    pub fn new(rotation: Quat<S>, translation: Vec3<S>) -> Self {
        let half = S::from_f64(0.5);
        Self { real: rotation, dual: Quat::from_sv(S::zero(), translation * half) * rotation }
    }

    /// The identity.
    #[must_use]
    pub fn identity() -> Self {
        Self::new(Quat::one(), Vec3::zero())
    }

    /// Rotation of the motion.
    #[must_use]
    pub fn rotation(self) -> Quat<S> {
        self.real
    }

    /// Translation of the origin.
    #[must_use]
    pub fn translation(self) -> Vec3<S> {
        (self.dual * self.real.conjugate()).v * S::from_f64(2.0)
    }

    /// Inverse motion: the reverse, in the algebra.
    #[must_use]
    pub fn inverse(self) -> Self {
        Self { real: self.real.conjugate(), dual: self.dual.conjugate() }
    }

    /// Transforms a point.
    #[must_use]
    pub fn transform_point(self, point: Point3<S>) -> Point3<S> {
        self.real.rotate_point(point) + self.translation()
    }

    /// Transforms the plane `normal · x = offset` and returns its normal and offset.
    #[must_use]
    pub fn transform_plane(self, normal: Vec3<S>, offset: S) -> (Vec3<S>, S) {
        let normal = self.real * normal;
        (normal, offset + normal.dot(self.translation()))
    }

    /// Transforms a line.
    #[must_use]
    pub fn transform_line(self, line: Line<S>) -> Line<S> {
        let direction = self.real * line.direction;
        let moment = self.real * line.moment + self.translation().cross(direction);
        Line { direction, moment }
    }

    /// Logarithm: the twist that makes this motion in one second, the short way round. Inverse of
    /// [`Motor::exp`].
    #[must_use]
    pub fn log(self) -> Twist<S> {
        let Self { real, dual } = if self.real.s < S::zero() {
            Self { real: -self.real, dual: -self.dual }
        } else {
            self
        };
        let (half, two) = (S::from_f64(0.5), S::from_f64(2.0));
        let sin = real.v.magnitude();
        let angle = sin.atan2_portable(real.s);
        let Screw { sinc, slope, .. } = Screw::of(angle * two, angle, half);
        let angular_velocity = real.v / sinc;
        let along = -dual.s * two / sinc;
        let velocity = (dual.v - angular_velocity * (along * slope)) / sinc;
        Twist { angular_velocity: angular_velocity.into(), velocity }
    }

    /// Exponential: the motion of a constant twist in `seconds`, exact for any duration.
    #[must_use]
    pub fn exp(twist: Twist<S>, seconds: S) -> Self {
        let angular_velocity = twist.angular_velocity.dual();
        let (rate, time) = (angular_velocity.magnitude(), seconds * S::from_f64(0.5));
        let Screw { cos, sinc, slope } = Screw::of(rate, rate * time, time);
        let along = angular_velocity.dot(twist.velocity);
        Self {
            real: Quat::from_sv(cos, angular_velocity * sinc),
            dual: Quat::from_sv(
                -along * time * sinc,
                twist.velocity * sinc + angular_velocity * (along * slope),
            ),
        }
    }

    /// Removes drift from a rigid motion: normalizes its length and makes its two parts orthogonal.
    #[must_use]
    pub fn normalized(self) -> Self {
        let length = self.real.magnitude();
        let real = self.real / length;
        let dual = self.dual / length;
        Self { real, dual: dual - real * real.dot(dual) }
    }
}

impl<S: Scalar> Mul for Motor<S> {
    type Output = Self;

    /// Composition, which applies `first` first.
    fn mul(self, first: Self) -> Self {
        Self { real: self.real * first.real, dual: self.real * first.dual + self.dual * first.real }
    }
}

/// Terms shared by the exponential and the logarithm.
struct Screw<S> {
    /// Cosine of the angle.
    cos: S,
    /// sin(angle) / rate.
    sinc: S,
    /// Derivative of `sinc`, over the rate.
    slope: S,
}

impl<S: Scalar> Screw<S> {
    /// Terms of an angle, which is the rate times the time.
    fn of(rate: S, angle: S, time: S) -> Self {
        let (sin, cos) = angle.sin_cos_portable();
        let squared = angle * angle;
        // Taylor series where both would suffer from cancellation.
        if angle.abs() < S::from_f64(1e-2) {
            let one = S::one();
            let [six, ten, twenty, twenty_eight] = [6.0, 10.0, 20.0, 28.0].map(S::from_f64);
            return Self {
                cos,
                sinc: time * (one - squared / six * (one - squared / twenty)),
                slope: -time * time * time / S::from_f64(3.0)
                    * (one - squared / ten * (one - squared / twenty_eight)),
            };
        }
        let sinc = sin / rate;
        Self { cos, sinc, slope: (time * cos - sinc) / (rate * rate) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cgmath::Rotation3;

    fn quarter_about_z() -> Quat<f64> {
        Quat::from_axis_angle(Vec3::unit_z(), cgmath::Deg(90.0))
    }

    #[test]
    fn a_motor_moves_as_its_rotation_and_translation_do() {
        let motor = Motor::new(quarter_about_z(), Vec3::new(1.0, 2.0, 3.0));
        let moved = motor.transform_point(Point3::new(1.0, 0.0, 0.0));
        assert!((moved - Point3::new(1.0, 3.0, 3.0)).magnitude() < 1e-15);
        let back = motor.inverse().transform_point(moved);
        assert!((back - Point3::new(1.0, 0.0, 0.0)).magnitude() < 1e-15);
        let twice = motor.mul(motor).transform_point(Point3::new(1.0, 0.0, 0.0));
        assert!((twice - motor.transform_point(moved)).magnitude() < 1e-15);
    }

    #[test]
    fn a_steady_twist_is_a_screw_however_long() {
        for angular_velocity in
            [Vec3::new(0.3, -2.0, 0.7_f64), Vec3::zero(), Vec3::new(0.0, 1e-9, 0.0)]
        {
            let twist = Twist {
                angular_velocity: angular_velocity.into(),
                velocity: Vec3::new(1.0, 0.5, -2.0),
            };
            let once = Motor::exp(twist, 3.0);
            let step = Motor::exp(twist, 0.003);
            let many = (0..1000).fold(Motor::identity(), |motor, _| motor.mul(step));
            let origin = Point3::origin();
            assert!(
                (once.transform_point(origin) - many.transform_point(origin)).magnitude() < 1e-12,
                "{angular_velocity:?}"
            );
            assert!((once.real - many.real).magnitude() < 1e-12);
            let Motor { real, dual } = many.normalized();
            assert!(real.dot(dual).abs() < 1e-15);
        }
    }

    #[test]
    fn the_logarithm_undoes_the_exponential() {
        for rate in [0.0, 1e-12, 1e-5, 0.01, 0.021, 0.5, 2.0, 3.1] {
            let angular_velocity = Vec3::new(0.48, -0.64, 0.6_f64) * rate;
            let twist = Twist {
                angular_velocity: angular_velocity.into(),
                velocity: Vec3::new(1.0, 0.5, -2.0),
            };
            let motor = Motor::exp(twist, 1.0);
            for motor in [motor, Motor { real: -motor.real, dual: -motor.dual }] {
                let Twist { angular_velocity, velocity } = motor.log();
                assert!(
                    (angular_velocity - twist.angular_velocity).dual().magnitude() < 1e-14,
                    "{rate}"
                );
                assert!((velocity - twist.velocity).magnitude() < 1e-12, "{rate}: {velocity:?}");
            }
        }
    }

    #[test]
    fn turning_on_a_circle_comes_round() {
        // 2 m/s forward and 1 rad/s to the left: a circle of 2 m radius.
        let twist = Twist {
            angular_velocity: Bivector::wedge(Vec3::unit_x(), Vec3::unit_y()),
            velocity: Vec3::new(2.0_f64, 0.0, 0.0),
        };
        let half = Motor::exp(twist, std::f64::consts::PI);
        assert!((half.translation() - Vec3::new(0.0, 4.0, 0.0)).magnitude() < 1e-14);
    }
}
