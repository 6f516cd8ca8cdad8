use cgmath::{ElementWise, Rotation as _};

use crate::frame::{Bivector, Motor, Twist};
use crate::math::{Scalar, Vec3};

/// How a free body moves on, as one equation (Newton and Euler in the body's frame, `M' =
/// M B / 2` for the motor `M` and the twist `B`): rotation and translation at once.
///
/// Gives motor and twist after `dt` seconds, for a body with these principal moments of
/// inertia (kg m², all above zero) whose axes are the motor's. Of order 4 in the twist
/// (Kutta 1901) and 2 in the motor, which stays a rigid motion however long the step.
#[must_use]
pub fn move_free<S: Scalar>(
    motor: Motor<S>,
    twist: Twist<S>,
    inertia: Vec3<S>,
    dt: S,
) -> (Motor<S>, Twist<S>) {
    // In the body's frame a constant velocity turns against the body, and the angular
    // momentum does too.
    let rate = |twist: Twist<S>| {
        let turning = twist.turning.dual();
        let momentum = turning.mul_element_wise(inertia);
        Twist {
            turning: momentum.cross(turning).div_element_wise(inertia).into(),
            velocity: twist.velocity.cross(turning),
        }
    };
    let along = |twist: Twist<S>, rate: Twist<S>, dt: S| Twist {
        turning: twist.turning + rate.turning * dt,
        velocity: twist.velocity + rate.velocity * dt,
    };
    let two = S::one() + S::one();
    let half = dt / two;
    let k1 = rate(twist);
    let middle = along(twist, k1, half);
    let k2 = rate(middle);
    let k3 = rate(along(twist, k2, half));
    let k4 = rate(along(twist, k3, dt));
    let sixth = dt / (two + two + two);
    let sum = |k: [Bivector<S>; 4]| k[0] + (k[1] + k[2]) * two + k[3];
    let sum_v = |k: [Vec3<S>; 4]| k[0] + (k[1] + k[2]) * two + k[3];
    let next = Twist {
        turning: twist.turning + sum([k1.turning, k2.turning, k3.turning, k4.turning]) * sixth,
        velocity: twist.velocity
            + sum_v([k1.velocity, k2.velocity, k3.velocity, k4.velocity]) * sixth,
    };
    // The screw of the twist in the middle of the step.
    let middle = along(twist, k2, half);
    (motor.after(Motor::exp(middle, dt)).normalized(), next)
}

/// The velocity of the body's origin in world space, in m/s.
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
        let spin = Vec3::new(0.4, 3.0, -0.7);
        let velocity = Vec3::new(2.0, -1.0, 0.5);
        let seconds = 3.0;
        let apart = |steps: u32| {
            let dt = seconds / f64::from(steps);
            let start = FreeRotation::new(Quat::one(), spin.mul_element_wise(inertia));
            (0..steps).fold(start, |body, _| body.after(inertia, dt))
        };
        let reference = apart(100_000).attitude();
        let error = |steps: u32| {
            let dt = seconds / f64::from(steps);
            let start = (Motor::identity(), Twist { turning: spin.into(), velocity });
            let (motor, twist) = (0..steps).fold(start, |(m, t), _| move_free(m, t, inertia, dt));
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
}
