use crate::math::{Point3, Scalar, Vec3};

/// Time integration method.
///
/// The order says how the error over a given time span falls with the step: halving the step
/// divides it by 2 to the power of the order, until the rounding of the scalar dominates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Integrator {
    /// Position by the old velocity, then velocity. Order 1. Under constant acceleration it lags by
    /// `a t dt / 2`, and it adds energy to oscillations.
    ExplicitEuler,
    /// Velocity, then position by the new velocity. Order 1. Under constant
    /// acceleration it leads by `a t dt / 2`; its oscillations stay bounded.
    #[default]
    SemiImplicitEuler,
    /// Position by velocity and half of the acceleration's square, then velocity by
    /// the mean of old and new acceleration (Swope et al. 1982). Order 2, exact
    /// under constant acceleration; oscillations stay bounded.
    VelocityVerlet,
    /// Half a step by the old velocity, the acceleration there, the other half by the new velocity.
    /// Order 2, exact under constant acceleration; oscillations stay bounded. One evaluation of the
    /// acceleration per step, where Verlet takes two.
    Leapfrog,
    /// Weighted mean of four slopes (Kutta 1901). Order 4, exact under constant acceleration. Four
    /// evaluations of the acceleration per step; slowly loses energy.
    Rk4,
}

impl Integrator {
    /// Position weight of a velocity change: by which fraction of change times step a velocity
    /// change within the step has moved the position at its end. A force known only after the step
    /// must still move the body by that much.
    #[must_use]
    pub(crate) fn position_weight<S: Scalar>(self) -> S {
        match self {
            Self::ExplicitEuler => S::zero(),
            Self::SemiImplicitEuler => S::one(),
            Self::VelocityVerlet | Self::Leapfrog | Self::Rk4 => S::from_f64(0.5),
        }
    }

    /// All integrators, from the crudest to the finest.
    pub const ALL: [Self; 5] = [
        Self::ExplicitEuler,
        Self::SemiImplicitEuler,
        Self::VelocityVerlet,
        Self::Leapfrog,
        Self::Rk4,
    ];
}

/// Position and velocity of a point mass. Its methods are the integrators.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion<S> {
    /// Position, in metres.
    pub position: Point3<S>,
    /// Velocity, in m/s.
    pub velocity: Vec3<S>,
}

impl<S: Scalar> Motion<S> {
    /// Explicit step along a slope: `velocity` for the position, `acceleration` for the velocity,
    /// for `dt` seconds.
    fn advance(self, velocity: Vec3<S>, acceleration: Vec3<S>, dt: S) -> Self {
        Self {
            position: self.position + velocity * dt,
            velocity: self.velocity + acceleration * dt,
        }
    }

    /// Steps by `dt` seconds with the given integrator. `acceleration` returns m/s² for a position
    /// and velocity.
    #[must_use]
    #[inline]
    pub fn step(
        self,
        integrator: Integrator,
        dt: S,
        acceleration: impl Fn(Self) -> Vec3<S>,
    ) -> Self {
        match integrator {
            Integrator::ExplicitEuler => self.explicit_euler(dt, acceleration),
            Integrator::SemiImplicitEuler => self.semi_implicit_euler(dt, acceleration),
            Integrator::VelocityVerlet => self.velocity_verlet(dt, acceleration),
            Integrator::Leapfrog => self.leapfrog(dt, acceleration),
            Integrator::Rk4 => self.rk4(dt, acceleration),
        }
    }

    /// Steps by `dt` seconds with [`Integrator::ExplicitEuler`].
    #[must_use]
    #[inline]
    pub fn explicit_euler(self, dt: S, acceleration: impl Fn(Self) -> Vec3<S>) -> Self {
        self.advance(self.velocity, acceleration(self), dt)
    }

    /// Steps by `dt` seconds with [`Integrator::SemiImplicitEuler`].
    #[must_use]
    #[inline]
    pub fn semi_implicit_euler(self, dt: S, acceleration: impl Fn(Self) -> Vec3<S>) -> Self {
        let velocity = self.velocity + acceleration(self) * dt;
        Self { position: self.position + velocity * dt, velocity }
    }

    /// Steps by `dt` seconds with [`Integrator::VelocityVerlet`]. Where the acceleration depends on
    /// the velocity, the new one is estimated by the old acceleration.
    #[must_use]
    #[inline]
    pub fn velocity_verlet(self, dt: S, acceleration: impl Fn(Self) -> Vec3<S>) -> Self {
        let half = dt / (S::one() + S::one());
        let before = acceleration(self);
        let position = self.position + (self.velocity + before * half) * dt;
        let after = acceleration(Self { position, velocity: self.velocity + before * dt });
        Self { position, velocity: self.velocity + (before + after) * half }
    }

    /// Steps by `dt` seconds with [`Integrator::Leapfrog`]. Where the acceleration depends on the
    /// velocity, that at the midpoint is estimated by the acceleration there.
    #[must_use]
    #[inline]
    pub fn leapfrog(self, dt: S, acceleration: impl Fn(Self) -> Vec3<S>) -> Self {
        let half = dt / (S::one() + S::one());
        let middle = self.position + self.velocity * half;
        let guess = acceleration(Self { position: middle, velocity: self.velocity });
        let velocity_there = self.velocity + guess * half;
        let there = acceleration(Self { position: middle, velocity: velocity_there });
        let velocity = self.velocity + there * dt;
        Self { position: middle + velocity * half, velocity }
    }

    /// Steps by `dt` seconds with [`Integrator::Rk4`].
    #[must_use]
    #[inline]
    pub fn rk4(self, dt: S, acceleration: impl Fn(Self) -> Vec3<S>) -> Self {
        let two = S::one() + S::one();
        let (half, sixth) = (dt / two, dt / (two + two + two));
        let (v1, a1) = (self.velocity, acceleration(self));
        let second = self.advance(v1, a1, half);
        let (v2, a2) = (second.velocity, acceleration(second));
        let third = self.advance(v2, a2, half);
        let (v3, a3) = (third.velocity, acceleration(third));
        let fourth = self.advance(v3, a3, dt);
        let (v4, a4) = (fourth.velocity, acceleration(fourth));
        self.advance(v1 + (v2 + v3) * two + v4, a1 + (a2 + a3) * two + a4, sixth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cgmath::{EuclideanSpace, InnerSpace, Zero};

    fn start<S: Scalar>(x: f64, v: f64) -> Motion<S> {
        let (position, velocity) = (Point3::origin(), Vec3::zero());
        let at = |x: f64| Vec3::unit_x() * S::from_f64(x);
        Motion { position: position + at(x), velocity: velocity + at(v) }
    }

    /// The lecture's table: from rest, acceleration 30, thirty steps of 1/30 s.
    fn lecture<S: Scalar>(integrator: Integrator) -> (f64, f64) {
        let dt = S::one() / S::from_f64(30.0);
        let mut motion = start::<S>(0.0, 0.0);
        for _ in 0..30 {
            motion = motion.step(integrator, dt, |_| Vec3::unit_x() * S::from_f64(30.0));
        }
        (motion.position.x.as_f64(), motion.velocity.x.as_f64())
    }

    #[test]
    fn under_constant_acceleration_the_eulers_miss_by_a_half_and_the_others_by_nothing() {
        use Integrator::*;
        for (integrator, x) in [
            (ExplicitEuler, 14.5),
            (SemiImplicitEuler, 15.5),
            (VelocityVerlet, 15.0),
            (Leapfrog, 15.0),
            (Rk4, 15.0),
        ] {
            let close = |(reached, speed): (f64, f64), epsilon: f64| {
                // Thirty steps round a handful of times each.
                let tolerance = 30.0 * 4.0 * 16.0 * epsilon / 2.0;
                assert!((reached - x).abs() <= tolerance, "{integrator:?}: {reached}, not {x}");
                assert!((speed - 30.0).abs() <= 2.0 * tolerance, "{integrator:?}: {speed}");
            };
            close(lecture::<f32>(integrator), f64::from(f32::EPSILON));
            close(lecture::<f64>(integrator), f64::EPSILON);
        }
    }

    /// Unit mass on a unit spring, from x = 1 at rest: the error of position and
    /// velocity after `time`, in `steps` steps.
    fn oscillator_error(integrator: Integrator, time: f64, steps: u32) -> f64 {
        let dt = time / f64::from(steps);
        let mut motion = start::<f64>(1.0, 0.0);
        for _ in 0..steps {
            motion = motion.step(integrator, dt, |at| -at.position.to_vec());
        }
        (motion.position.x - time.cos()).hypot(motion.velocity.x + time.sin())
    }

    #[test]
    fn the_observed_orders_are_1_1_2_2_4() {
        for (integrator, order) in Integrator::ALL.into_iter().zip([1.0, 1.0, 2.0, 2.0, 4.0]) {
            // Not a whole number of periods, where some errors cancel.
            let errors = [200, 400, 800].map(|steps| oscillator_error(integrator, 5.0, steps));
            for pair in errors.windows(2) {
                let observed = (pair[0] / pair[1]).log2();
                assert!((observed - order).abs() < 0.05, "{integrator:?}: order {observed}");
            }
        }
    }

    /// The largest deviation of the energy from its start, relative to it, over
    /// 10,000 periods of the oscillator in 100 steps each.
    fn energy_error(integrator: Integrator) -> f64 {
        let dt = std::f64::consts::TAU / 100.0;
        let mut motion = start::<f64>(1.0, 0.0);
        let mut worst: f64 = 0.0;
        for _ in 0..1_000_000 {
            motion = motion.step(integrator, dt, |at| -at.position.to_vec());
            let twice = motion.position.to_vec().magnitude2() + motion.velocity.magnitude2();
            worst = worst.max((twice - 1.0).abs());
            if !worst.is_finite() {
                break;
            }
        }
        worst
    }

    #[test]
    fn energy_over_10_000_periods() {
        // Explicit Euler multiplies it by 1 + dt² each step, out of all bounds. The
        // symplectic ones keep it within their order: dt / 2 and dt² / 4 (Hairer,
        // Lubich and Wanner, Geometric Numerical Integration, 2006, §I.2). RK4
        // multiplies it by about 1 − dt⁶ / 72.
        let dt = std::f64::consts::TAU / 100.0;
        assert!(!energy_error(Integrator::ExplicitEuler).is_finite());
        let euler = energy_error(Integrator::SemiImplicitEuler);
        assert!(euler > 0.9 * dt / 2.0 && euler < 1.1 * dt / 2.0 * 2.0, "{euler}");
        for integrator in [Integrator::VelocityVerlet, Integrator::Leapfrog] {
            let error = energy_error(integrator);
            assert!(error < 1.1 * dt * dt / 4.0, "{integrator:?}: {error}");
        }
        let rk4 = energy_error(Integrator::Rk4);
        let expected = 1.0 - (-1e6 * dt.powi(6) / 72.0).exp();
        assert!((rk4 / expected - 1.0).abs() < 0.02, "{rk4}, not {expected}");
    }
}
