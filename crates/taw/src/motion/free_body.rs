use cgmath::{ElementWise, Rotation as _};

use crate::frame::{Motor, Twist};
use crate::math::{Scalar, Vec3, cast_vector};

/// Integrates a free rigid body as one equation (Newton and Euler in the body's frame, `M' = M B /
/// 2` for the motor `M` and the twist `B`): rotation and translation at once.
///
/// Returns motor and twist after `dt` seconds, for a body with these principal moments of inertia
/// (kg m², all above zero) whose axes are the motor's. Order 4 in the twist (Kutta 1901) and 2 in
/// the motor, which stays a rigid motion however long the step.
///
/// The twist is computed in `f64` and rounded once. In `f32` that is not enough for a body that
/// rotates about its unstable axis: the time when it flips depends on its energy to a few parts in
/// a million, which the rounding of some thousand steps uses up. The box of the Dzhanibekov effect,
/// which flips every 5 s, is off by 1.7 s after 100 s of steps of 1/60 s.
/// [`FreeRotation`](super::FreeRotation) keeps its state in `f64` and is not.
#[must_use]
pub fn integrate_free_body<S: Scalar>(
    motor: Motor<S>,
    twist: Twist<S>,
    inertia: Vec3<S>,
    dt: S,
) -> (Motor<S>, Twist<S>) {
    let (start, exact_dt) = (exact(twist), dt.as_f64());
    let inertia: Vec3<f64> = cast_vector(inertia);
    // In the body's frame, constant velocity and angular momentum rotate against the body.
    let rate = |twist: Twist<f64>| {
        let angular_velocity = twist.angular_velocity.dual();
        let momentum = angular_velocity.mul_element_wise(inertia);
        Twist {
            angular_velocity: momentum.cross(angular_velocity).div_element_wise(inertia).into(),
            velocity: twist.velocity.cross(angular_velocity),
        }
    };
    let along = |rate: Twist<f64>, dt: f64| Twist {
        angular_velocity: start.angular_velocity + rate.angular_velocity * dt,
        velocity: start.velocity + rate.velocity * dt,
    };
    let k1 = rate(start);
    let k2 = rate(along(k1, 0.5 * exact_dt));
    let k3 = rate(along(k2, 0.5 * exact_dt));
    let k4 = rate(along(k3, exact_dt));
    let slope = Twist {
        angular_velocity: k1.angular_velocity
            + (k2.angular_velocity + k3.angular_velocity) * 2.0
            + k4.angular_velocity,
        velocity: k1.velocity + (k2.velocity + k3.velocity) * 2.0 + k4.velocity,
    };
    let next = rounded(along(slope, exact_dt / 6.0));
    // Screw motion of the midpoint twist.
    let middle = rounded(along(k2, 0.5 * exact_dt));
    ((motor * Motor::exp(middle, dt)).normalized(), next)
}

fn exact<S: Scalar>(twist: Twist<S>) -> Twist<f64> {
    let angular_velocity: Vec3<f64> = cast_vector(twist.angular_velocity.dual());
    Twist { angular_velocity: angular_velocity.into(), velocity: cast_vector(twist.velocity) }
}

fn rounded<S: Scalar>(twist: Twist<f64>) -> Twist<S> {
    let angular_velocity: Vec3<S> = cast_vector(twist.angular_velocity.dual());
    Twist { angular_velocity: angular_velocity.into(), velocity: cast_vector(twist.velocity) }
}

/// Velocity of the body's origin in world space, in m/s.
#[must_use]
pub fn world_velocity<S: Scalar>(motor: Motor<S>, twist: Twist<S>) -> Vec3<S> {
    motor.rotation().rotate_vector(twist.velocity)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Quat;
    use crate::motion::FreeRotation;
    use cgmath::InnerSpace as _;
    use cgmath::One;

    #[test]
    fn the_motor_equation_equals_rotation_and_translation_apart() {
        let inertia = Vec3::new(1.6, 4.16, 5.44_f64);
        let angular_velocity = Vec3::new(0.4, 3.0, -0.7);
        let velocity = Vec3::new(2.0, -1.0, 0.5);
        let seconds = 3.0;
        let apart = |steps: u32| {
            let dt = seconds / f64::from(steps);
            let start = FreeRotation::new(Quat::one(), angular_velocity.mul_element_wise(inertia));
            (0..steps).fold(start, |body, _| body.step(inertia, dt))
        };
        let reference = apart(100_000).attitude();
        let error = |steps: u32| {
            let dt = seconds / f64::from(steps);
            let start =
                (Motor::identity(), Twist { angular_velocity: angular_velocity.into(), velocity });
            let (motor, twist) =
                (0..steps).fold(start, |(m, t), _| integrate_free_body(m, t, inertia, dt));
            let rotation = motor.rotation();
            let turned = (rotation - reference).magnitude().min((rotation + reference).magnitude());
            let moved = (motor.translation() - velocity * seconds).magnitude();
            let kept = (world_velocity(motor, twist) - velocity).magnitude();
            [turned, moved, kept]
        };
        let (coarse, fine) = (error(3000), error(6000));
        for (coarse, fine) in coarse.into_iter().zip(fine) {
            // |ω|³ t dt² / 12 is 8e-6 here, and the motor has about that of each part.
            assert!(coarse < 3e-5, "{coarse}");
            // Order two, down to rounding.
            assert!(fine < coarse / 3.5 || fine < 1e-11, "{coarse}, then {fine}");
        }
    }

    /// When the box of the Dzhanibekov effect turns over for the twentieth time, in steps of
    /// 1/60 s.
    fn twentieth_flip<S: Scalar>() -> f64 {
        let inertia = Vec3::new(1.6, 4.16, 5.44).map(S::from_f64);
        let angular_velocity = Vec3::new(0.01, 5.0, 0.01).map(S::from_f64);
        let velocity = Vec3::new(0.0, 0.0, 0.0).map(S::from_f64);
        let mut state =
            (Motor::identity(), Twist { angular_velocity: angular_velocity.into(), velocity });
        let (mut flips, mut last) = (0, 1.0);
        for step in 1..=7200 {
            let (motor, twist) = state;
            state = integrate_free_body(motor, twist, inertia, S::from_f64(1.0 / 60.0));
            let now = state.1.angular_velocity.dual().y.as_f64();
            flips += u32::from(now * last < 0.0);
            last = now;
            if flips == 20 {
                return f64::from(step) / 60.0;
            }
        }
        f64::INFINITY
    }

    #[test]
    fn an_unstable_body_turns_over_in_time_as_far_as_its_scalar_can_tell() {
        // As for `FreeRotation`: by Runge–Kutta in f64 with tiny steps.
        let last = 2.84256 + 19.0 * 5.024_785;
        let (single, double) = (twentieth_flip::<f32>(), twentieth_flip::<f64>());
        // The truncation of order 4 is 3 ms here.
        assert!((double - last).abs() < 0.02, "{double}, not {last}");
        // As documented; 4.4 s where all is counted in f32.
        assert!((single - last).abs() < 1.8, "{single}, not {last}");
    }
}
