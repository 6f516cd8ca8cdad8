use cgmath::{EuclideanSpace, InnerSpace, One, Rotation as _, Zero};

use crate::frame::Bivector;
use crate::math::{Point3, Quat, Scalar, Vec3};

/// A rigid motion as one number: a rotor and, beside it, the part that moves. Motors
/// multiply as the motions follow each other, and a screw is one motor, not a rotation
/// and a translation.
///
/// In the words of projective geometric algebra it is an even multivector; in those of
/// Clifford (1873), a dual quaternion `real + ε dual`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor<S> {
    /// The rotation.
    pub real: Quat<S>,
    /// Half of the translation times the rotation.
    pub dual: Quat<S>,
}

/// How a rigid thing moves at a moment, in its own frame: the velocity of its origin and
/// the angular velocity, as one line bivector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist<S> {
    /// In rad/s, along the body's own axes.
    pub turning: Bivector<S>,
    /// In m/s, along the body's own axes.
    pub velocity: Vec3<S>,
}

/// A line in space, in both directions at once as Plücker (1865) has it; in projective
/// geometric algebra, a bivector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line<S> {
    /// Along it.
    pub direction: Vec3<S>,
    /// The moment of that about the origin: any point of the line × the direction.
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
    /// That which turns first and moves then.
    #[must_use]
    pub fn new(rotation: Quat<S>, translation: Vec3<S>) -> Self {
        let half = S::constant(0.5);
        Self { real: rotation, dual: Quat::from_sv(S::zero(), translation * half) * rotation }
    }

    /// That which leaves everything where it is.
    #[must_use]
    pub fn identity() -> Self {
        Self::new(Quat::one(), Vec3::zero())
    }

    /// How it turns.
    #[must_use]
    pub fn rotation(self) -> Quat<S> {
        self.real
    }

    /// Where it takes the origin, from there.
    #[must_use]
    pub fn translation(self) -> Vec3<S> {
        (self.dual * self.real.conjugate()).v * S::constant(2.0)
    }

    /// This motion after another one.
    #[must_use]
    pub fn after(self, first: Self) -> Self {
        Self { real: self.real * first.real, dual: self.real * first.dual + self.dual * first.real }
    }

    /// The motion back: the reverse, in the algebra.
    #[must_use]
    pub fn inverse(self) -> Self {
        Self { real: self.real.conjugate(), dual: self.dual.conjugate() }
    }

    /// Where it takes a point.
    #[must_use]
    pub fn point(self, point: Point3<S>) -> Point3<S> {
        self.real.rotate_point(point) + self.translation()
    }

    /// Where it takes the plane `normal · x = offset`: its normal and offset.
    #[must_use]
    pub fn plane(self, normal: Vec3<S>, offset: S) -> (Vec3<S>, S) {
        let normal = self.real * normal;
        (normal, offset + normal.dot(self.translation()))
    }

    /// Where it takes a line.
    #[must_use]
    pub fn line(self, line: Line<S>) -> Line<S> {
        let direction = self.real * line.direction;
        let moment = self.real * line.moment + self.translation().cross(direction);
        Line { direction, moment }
    }

    /// The twist that makes this motion in one second, the short way round: the logarithm,
    /// of which [`Motor::exp`] is the inverse.
    #[must_use]
    pub fn log(self) -> Twist<S> {
        let Self { real, dual } = if self.real.s < S::zero() {
            Self { real: -self.real, dual: -self.dual }
        } else {
            self
        };
        let (half, two) = (S::constant(0.5), S::constant(2.0));
        let sin = real.v.magnitude();
        let angle = sin.atan2_portable(real.s);
        let Screw { sinc, slope, .. } = Screw::of(angle * two, angle, half);
        let turning = real.v / sinc;
        let along = -dual.s * two / sinc;
        let velocity = (dual.v - turning * (along * slope)) / sinc;
        Twist { turning: turning.into(), velocity }
    }

    /// The screw that a steady twist makes in `seconds`: the exponential. Exact for any
    /// length of time.
    #[must_use]
    pub fn exp(twist: Twist<S>, seconds: S) -> Self {
        let turning = twist.turning.dual();
        let (rate, time) = (turning.magnitude(), seconds * S::constant(0.5));
        let Screw { cos, sinc, slope } = Screw::of(rate, rate * time, time);
        let along = turning.dot(twist.velocity);
        Self {
            real: Quat::from_sv(cos, turning * sinc),
            dual: Quat::from_sv(
                -along * time * sinc,
                twist.velocity * sinc + turning * (along * slope),
            ),
        }
    }

    /// As near to a rigid motion as rounding lets it be: drift of the length, and of what
    /// a motor of length one has between its parts, is taken out.
    #[must_use]
    pub fn normalized(self) -> Self {
        let length = self.real.magnitude();
        let real = self.real / length;
        let dual = self.dual / length;
        Self { real, dual: dual - real * real.dot(dual) }
    }
}

/// What the exponential and the logarithm share.
struct Screw<S> {
    /// Of the angle.
    cos: S,
    /// sin(angle) / rate.
    sinc: S,
    /// The derivative of that, over the rate.
    slope: S,
}

impl<S: Scalar> Screw<S> {
    /// That of an angle, which is the rate times the time.
    fn of(rate: S, angle: S, time: S) -> Self {
        let (sin, cos) = angle.sin_cos_portable();
        let squared = angle * angle;
        // Where both would be differences of nearly equal numbers, how their series begin.
        if angle.abs() < S::constant(1e-2) {
            let one = S::one();
            let [six, ten, twenty, twenty_eight] = [6.0, 10.0, 20.0, 28.0].map(S::constant);
            return Self {
                cos,
                sinc: time * (one - squared / six * (one - squared / twenty)),
                slope: -time * time * time / S::constant(3.0)
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
        let moved = motor.point(Point3::new(1.0, 0.0, 0.0));
        assert!((moved - Point3::new(1.0, 3.0, 3.0)).magnitude() < 1e-15);
        let back = motor.inverse().point(moved);
        assert!((back - Point3::new(1.0, 0.0, 0.0)).magnitude() < 1e-15);
        let twice = motor.after(motor).point(Point3::new(1.0, 0.0, 0.0));
        assert!((twice - motor.point(moved)).magnitude() < 1e-15);
    }

    #[test]
    fn a_steady_twist_is_a_screw_however_long() {
        for turning in [Vec3::new(0.3, -2.0, 0.7_f64), Vec3::zero(), Vec3::new(0.0, 1e-9, 0.0)] {
            let twist = Twist { turning: turning.into(), velocity: Vec3::new(1.0, 0.5, -2.0) };
            let once = Motor::exp(twist, 3.0);
            let step = Motor::exp(twist, 0.003);
            let many = (0..1000).fold(Motor::identity(), |motor, _| motor.after(step));
            let origin = Point3::origin();
            assert!((once.point(origin) - many.point(origin)).magnitude() < 1e-12, "{turning:?}");
            assert!((once.real - many.real).magnitude() < 1e-12);
            let Motor { real, dual } = many.normalized();
            assert!(real.dot(dual).abs() < 1e-15);
        }
    }

    #[test]
    fn the_logarithm_undoes_the_exponential() {
        for rate in [0.0, 1e-12, 1e-5, 0.01, 0.021, 0.5, 2.0, 3.1] {
            let turning = Vec3::new(0.48, -0.64, 0.6_f64) * rate;
            let twist = Twist { turning: turning.into(), velocity: Vec3::new(1.0, 0.5, -2.0) };
            let motor = Motor::exp(twist, 1.0);
            for motor in [motor, Motor { real: -motor.real, dual: -motor.dual }] {
                let Twist { turning, velocity } = motor.log();
                assert!((turning - twist.turning).dual().magnitude() < 1e-14, "{rate}");
                assert!((velocity - twist.velocity).magnitude() < 1e-12, "{rate}: {velocity:?}");
            }
        }
    }

    #[test]
    fn turning_on_a_circle_comes_round() {
        // 2 m/s forward and 1 rad/s to the left: a circle of 2 m radius.
        let twist = Twist {
            turning: Bivector::wedge(Vec3::unit_x(), Vec3::unit_y()),
            velocity: Vec3::new(2.0_f64, 0.0, 0.0),
        };
        let half = Motor::exp(twist, std::f64::consts::PI);
        assert!((half.translation() - Vec3::new(0.0, 4.0, 0.0)).magnitude() < 1e-14);
    }
}
