//! Motion of a ball on a flat surface: resting, rolling or sliding, with an acceleration in closed
//! form until the regime changes.
//!
//! With `u` the velocity of the contact point, `p` the part of it by spin
//! (`radius · normal × spin`), `f` the friction and `N` the normal force, both per mass:
//! `v' = tangential_acceleration + f` and `p' = 5/2 (f − c N p/|p|)`, where `c` is the rolling
//! resistance. Sliding, `f = −µ N u/|u|`; rolling, `f` keeps `u` at zero.

use cgmath::{InnerSpace, Zero};

use super::TIME_RESOLUTION;
use crate::math::{Vec3, normalize_and_length};
use crate::motion::BALL_INVERSE_INERTIA;

/// Largest rotation of the surface in one step, in radians.
const MAX_TURN: f64 = 4e-3;
/// A curved slide shorter than this, over the substep, ends on a straight line.
const MIN_SLIDE: f64 = 1.0 / 256.0;

/// Flat surface below a ball, its material, and the forces.
#[derive(Clone, Copy, Debug)]
pub(super) struct FlatSupport {
    pub normal: Vec3<f64>,
    /// Surface velocity at the contact point, in m/s.
    pub surface_velocity: Vec3<f64>,
    /// Angular velocity of the surface, in rad/s.
    pub angular_velocity: Vec3<f64>,
    /// Tangential part of the external acceleration, in m/s².
    pub tangential_acceleration: Vec3<f64>,
    /// Normal force per mass, in m/s².
    pub normal_acceleration: f64,
    pub radius: f64,
    pub friction: f64,
    pub rolling_resistance: f64,
    pub spinning_resistance: f64,
    /// True if friction spins the ball.
    pub rotates: bool,
}

/// Segment of constant accelerations.
#[derive(Clone, Copy, Debug)]
pub(super) struct MotionSegment {
    /// Changes of velocity and spin by friction at the start, in m/s and rad/s: they remove a slip
    /// that would last for less than a millionth of a step.
    pub velocity_change: Vec3<f64>,
    pub spin_change: Vec3<f64>,
    /// Acceleration of the center, in m/s².
    pub acceleration: Vec3<f64>,
    /// Angular acceleration, in rad/s².
    pub spin_acceleration: Vec3<f64>,
    /// Duration, in seconds.
    pub duration: f64,
}

/// Tangential velocities of the center, and of the contact point by spin.
#[derive(Clone, Copy, Debug)]
struct TangentialState {
    v: Vec3<f64>,
    p: Vec3<f64>,
}

impl TangentialState {
    fn after(self, rate: Self, dt: f64) -> Self {
        Self { v: self.v + rate.v * dt, p: self.p + rate.p * dt }
    }
}

/// Contact regime of a ball on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Regime {
    Sliding,
    Rolling,
    Resting,
}

impl FlatSupport {
    /// Segment of the motion with this velocity and spin, for `dt` seconds at most.
    pub fn segment(&self, velocity: Vec3<f64>, spin: Vec3<f64>, dt: f64) -> MotionSegment {
        let n = self.normal;
        let tangential = |x: Vec3<f64>| x - n * x.dot(n);
        let mut now = TangentialState {
            v: tangential(velocity),
            p: if self.rotates { n.cross(spin) * self.radius } else { Vec3::zero() },
        };
        let before = now;
        let slip_rate = self.tangent_inverse_mass() * self.friction * self.normal_acceleration;
        let mut slip = self.slip(now);
        if slip.magnitude() <= 1e-6 * slip_rate * dt {
            now.v -= slip / self.tangent_inverse_mass();
            if self.rotates {
                now.p -= slip * (BALL_INVERSE_INERTIA / self.tangent_inverse_mass());
            }
            slip = Vec3::zero();
        }
        if now.p.magnitude()
            <= 1e-6 * BALL_INVERSE_INERTIA * self.rolling_resistance * self.normal_acceleration * dt
        {
            now.p = Vec3::zero();
        }
        let regime = self.regime(now, slip);
        let rate = self.rate(now, regime);
        let (rate, mut duration) =
            if self.is_steady(now, rate, regime) || self.is_last_slide(now, rate, regime, dt) {
                let duration = self.time_to_regime_change(now, rate, regime);
                (rate, duration.clamp(TIME_RESOLUTION * dt, dt))
            } else {
                let duration = self.max_step(now, regime, dt);
                (self.mean_rate(now, regime, duration), duration)
            };
        let mut spin_acceleration = Vec3::zero();
        if self.rotates {
            spin_acceleration = rate.p.cross(n) / self.radius;
            let torsional_spin = spin.dot(n);
            let torsional_rate =
                BALL_INVERSE_INERTIA * self.spinning_resistance * self.normal_acceleration
                    / self.radius;
            if torsional_rate > 0.0 && torsional_spin.abs() > torsional_rate * dt * 1e-12 {
                spin_acceleration -= n * (torsional_rate * torsional_spin.signum());
                duration = duration.min(torsional_spin.abs() / torsional_rate);
            }
        }
        let spin_change = (now.p - before.p).cross(n) / self.radius;
        let velocity_change = now.v - before.v;
        MotionSegment {
            velocity_change,
            spin_change,
            acceleration: rate.v,
            spin_acceleration,
            duration,
        }
    }

    /// Tangential inverse effective mass per inverse mass: slip rate per friction.
    fn tangent_inverse_mass(&self) -> f64 {
        if self.rotates { 3.5 } else { 1.0 }
    }

    fn slip(&self, at: TangentialState) -> Vec3<f64> {
        let surface = self.surface_velocity - self.normal * self.surface_velocity.dot(self.normal);
        let slip = at.v + at.p - surface;
        // A difference of speeds has the rounding of the speeds.
        let rounding = 1e-15 * (at.v.magnitude() + at.p.magnitude() + surface.magnitude());
        if slip.magnitude() <= rounding { Vec3::zero() } else { slip }
    }

    /// Rate of change of the surface velocity below the moving ball, in m/s².
    fn surface_rate(&self, at: TangentialState) -> Vec3<f64> {
        let rate = self.angular_velocity.cross(at.v);
        rate - self.normal * rate.dot(self.normal)
    }

    fn regime(&self, now: TangentialState, slip: Vec3<f64>) -> Regime {
        if !slip.is_zero() {
            return Regime::Sliding;
        }
        let needed = self.surface_rate(now) - self.tangential_acceleration;
        let max_static = self.rolling_resistance.min(self.friction) * self.normal_acceleration;
        if (now.p.is_zero() && needed.magnitude() <= max_static) || !self.rotates {
            return if needed.magnitude() <= self.friction * self.normal_acceleration {
                Regime::Resting
            } else {
                Regime::Sliding
            };
        }
        let friction = self.static_friction(now).magnitude();
        if friction <= self.friction * self.normal_acceleration {
            Regime::Rolling
        } else {
            Regime::Sliding
        }
    }

    /// Rolling resistance, as a rate of `p`.
    fn rolling_resistance_rate(&self, at: TangentialState) -> Vec3<f64> {
        // A ball that starts to move will roll along the tangential acceleration, against `p`.
        let direction = normalize_and_length(at.p)
            .or_else(|| normalize_and_length(self.surface_rate(at) - self.tangential_acceleration))
            .map_or_else(Vec3::zero, |(direction, _)| direction);
        direction * (-BALL_INVERSE_INERTIA * self.rolling_resistance * self.normal_acceleration)
    }

    /// Friction per mass that keeps the contact point at rest while the ball rolls.
    fn static_friction(&self, at: TangentialState) -> Vec3<f64> {
        let rolling_resistance_rate =
            if self.rotates { self.rolling_resistance_rate(at) } else { Vec3::zero() };
        (self.surface_rate(at) - self.tangential_acceleration - rolling_resistance_rate)
            / self.tangent_inverse_mass()
    }

    fn rate(&self, at: TangentialState, regime: Regime) -> TangentialState {
        let limit = self.friction * self.normal_acceleration;
        let friction = match regime {
            Regime::Resting => {
                return TangentialState { v: self.surface_rate(at), p: Vec3::zero() };
            }
            Regime::Rolling => self.static_friction(at),
            Regime::Sliding => {
                let slip = self.slip(at);
                // When slipping starts, opposite to the friction that would have prevented it.
                let direction =
                    if slip.magnitude2() > 0.0 { -slip } else { self.static_friction(at) };
                normalize_and_length(direction).map_or_else(Vec3::zero, |(d, _)| d * limit)
            }
        };
        let p = if self.rotates {
            friction * BALL_INVERSE_INERTIA + self.rolling_resistance_rate(at)
        } else {
            Vec3::zero()
        };
        TangentialState { v: self.tangential_acceleration + friction, p }
    }

    /// Tests if the rate is constant until the regime changes: no direction rotates.
    fn is_steady(&self, now: TangentialState, rate: TangentialState, regime: Regime) -> bool {
        // A difference of speeds has the rounding of the speeds.
        let rounding =
            1e-15 * (now.v.magnitude() + now.p.magnitude() + self.surface_velocity.magnitude());
        let is_straight = |x: Vec3<f64>, rate: Vec3<f64>| {
            let cross = x.cross(rate).magnitude();
            cross <= (1e-13 * x.magnitude() + rounding) * rate.magnitude()
        };
        self.angular_velocity.is_zero()
            && (regime != Regime::Sliding || is_straight(self.slip(now), rate.v + rate.p))
            && (self.rolling_resistance == 0.0 || is_straight(now.p, rate.p))
    }

    /// Tests if the rest of a slide is short enough for a straight line. The error remains as an
    /// even shorter slide.
    fn is_last_slide(
        &self,
        now: TangentialState,
        rate: TangentialState,
        regime: Regime,
        dt: f64,
    ) -> bool {
        let (slip, rate) = (self.slip(now), rate.v + rate.p);
        regime == Regime::Sliding
            && slip.magnitude() < MIN_SLIDE * dt * rate.magnitude()
            && slip.dot(rate) < -0.9 * slip.magnitude() * rate.magnitude()
    }

    /// Time until slip, or rolling with resistance, ends.
    fn time_to_regime_change(
        &self,
        now: TangentialState,
        rate: TangentialState,
        regime: Regime,
    ) -> f64 {
        let end = |x: Vec3<f64>, rate: Vec3<f64>| {
            if x.dot(rate) < 0.0 { x.magnitude() / rate.magnitude() } else { f64::INFINITY }
        };
        let slip = match regime {
            Regime::Sliding => end(self.slip(now), rate.v + rate.p),
            _ => f64::INFINITY,
        };
        let rolling_end =
            if self.rolling_resistance > 0.0 { end(now.p, rate.p) } else { f64::INFINITY };
        slip.min(rolling_end)
    }

    /// Largest step in which the directions of slip and spin change little.
    fn max_step(&self, now: TangentialState, regime: Regime, dt: f64) -> f64 {
        // The surface must not rotate by much in one step.
        let mut step = (MAX_TURN / self.angular_velocity.magnitude()).clamp(dt / 8.0, dt);
        if regime == Regime::Sliding {
            let rate = self.tangent_inverse_mass() * self.friction * self.normal_acceleration;
            step = step.min(self.slip(now).magnitude() / (4.0 * rate));
        }
        if self.rolling_resistance > 0.0 && !now.p.is_zero() {
            let rate = 10.0 * self.rolling_resistance * self.normal_acceleration;
            step = step.min(now.p.magnitude() / rate);
        }
        // At most about a thousand steps per substep.
        step.max(0.25 * MIN_SLIDE * dt)
    }

    /// Mean rate over a short step (Kutta 1901).
    fn mean_rate(&self, now: TangentialState, regime: Regime, dt: f64) -> TangentialState {
        let k1 = self.rate(now, regime);
        let k2 = self.rate(now.after(k1, 0.5 * dt), regime);
        let k3 = self.rate(now.after(k2, 0.5 * dt), regime);
        let k4 = self.rate(now.after(k3, dt), regime);
        let mean = |a: Vec3<f64>, b, c, d| (a + (b + c) * 2.0 + d) / 6.0;
        TangentialState { v: mean(k1.v, k2.v, k3.v, k4.v), p: mean(k1.p, k2.p, k3.p, k4.p) }
    }
}
