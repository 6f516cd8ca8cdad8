use crate::math::{Point3, Scalar, Vec3};

/// How velocities become positions and accelerations velocities.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Integrator {
    /// Position by the old velocity, then velocity. First order. Under constant
    /// acceleration it lags by `a t dt / 2`, and it feeds oscillations.
    ExplicitEuler,
    /// Velocity, then position by the new velocity. First order. Under constant
    /// acceleration it leads by `a t dt / 2`; its oscillations stay bounded.
    #[default]
    SemiImplicitEuler,
}

/// Position and velocity after `dt` by [`Integrator::ExplicitEuler`].
#[must_use]
#[inline]
pub fn explicit_euler<S: Scalar>(
    position: Point3<S>,
    velocity: Vec3<S>,
    acceleration: Vec3<S>,
    dt: S,
) -> (Point3<S>, Vec3<S>) {
    (position + velocity * dt, velocity + acceleration * dt)
}

/// Position and velocity after `dt` by [`Integrator::SemiImplicitEuler`].
#[must_use]
#[inline]
pub fn semi_implicit_euler<S: Scalar>(
    position: Point3<S>,
    velocity: Vec3<S>,
    acceleration: Vec3<S>,
    dt: S,
) -> (Point3<S>, Vec3<S>) {
    let velocity = velocity + acceleration * dt;
    (position + velocity * dt, velocity)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The lecture's table: from rest, acceleration 30, thirty steps of 1/30.
    fn lecture<S: Scalar>(
        step: fn(Point3<S>, Vec3<S>, Vec3<S>, S) -> (Point3<S>, Vec3<S>),
    ) -> (f64, f64) {
        let acceleration = Vec3::unit_x() * S::constant(30.0);
        let dt = S::one() / S::constant(30.0);
        let mut state = (Point3::new(S::zero(), S::zero(), S::zero()), Vec3::unit_x() * S::zero());
        for _ in 0..30 {
            state = step(state.0, state.1, acceleration, dt);
        }
        (state.0.x.as_f64(), state.1.x.as_f64())
    }

    #[test]
    fn the_eulers_miss_the_exact_15_by_a_half_to_either_side() {
        // Thirty additions round by at most half an epsilon of the sum each.
        let (f32_tolerance, f64_tolerance) = (30.0 * 15.5 * 6e-8, 30.0 * 15.5 * 1.2e-16);
        let close = |(x, v): (f64, f64), exact: f64, tolerance: f64| {
            assert!((x - exact).abs() <= tolerance, "{x} is not {exact}");
            assert!((v - 30.0).abs() <= 2.0 * tolerance, "{v} is not 30");
        };
        close(lecture::<f32>(explicit_euler), 14.5, f32_tolerance);
        close(lecture::<f32>(semi_implicit_euler), 15.5, f32_tolerance);
        close(lecture::<f64>(explicit_euler), 14.5, f64_tolerance);
        close(lecture::<f64>(semi_implicit_euler), 15.5, f64_tolerance);
    }
}
