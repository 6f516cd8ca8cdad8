//! Prediction of the next event of two balls.

use std::f64::consts::SQRT_2;

use cgmath::{InnerSpace, Zero};

use super::toi::time_of_impact_spheres;
use super::{EventKind, EventSettings, EventSolver, PRESS_SPEED, REST_SPEED};
use crate::math::{Vec3, is_finite, normalize_and_length};

/// Relative motion of two balls, of the second to the first.
struct RelativeMotion {
    center_offset: Vec3<f64>,
    velocity: Vec3<f64>,
    acceleration: Vec3<f64>,
    radius_sum: f64,
}

impl RelativeMotion {
    fn offset_after(&self, time: f64) -> Vec3<f64> {
        self.center_offset + (self.velocity + self.acceleration * (0.5 * time)) * time
    }

    fn time_of_impact(&self, range: [f64; 2]) -> Option<f64> {
        let Self { center_offset, velocity, acceleration, radius_sum } = *self;
        time_of_impact_spheres(center_offset, velocity, acceleration, radius_sum, range)
    }

    /// Next event of two balls in contact: impact or rest, and the seconds until it.
    fn contact_event(
        &self,
        normal: Vec3<f64>,
        press_speed: f64,
        remaining: f64,
        [impact, rest]: [EventKind; 2],
    ) -> Option<(f64, EventKind)> {
        let speed = self.velocity.dot(normal);
        let normal_acceleration = self.acceleration.dot(normal);
        if speed < -press_speed {
            return Some((0.0, impact));
        }
        if normal_acceleration >= 0.0 {
            return None;
        }
        // Balls that separate completely collide again; others press each other in the end.
        let apex = -speed / normal_acceleration;
        if speed > press_speed && self.offset_after(apex).magnitude() > self.radius_sum {
            return self.time_of_impact([apex, remaining]).map(|after| (after, impact));
        }
        Some(((-press_speed * 1.01 - speed) / normal_acceleration, rest))
    }
}

impl EventSolver {
    /// Next event of two balls, and the seconds until it.
    pub(super) fn predict_ball(
        &self,
        a: usize,
        b: usize,
        now: f64,
        settings: &EventSettings,
    ) -> Option<(f64, EventKind)> {
        let (first, second) = (&self.balls[a], &self.balls[b]);
        let remaining = settings.dt - now;
        let (from, to) = (first.position_at(now), second.position_at(now));
        let center_offset = self.period.minimum_image(to - from);
        let velocity = second.velocity_at(now) - first.velocity_at(now);
        let acceleration = second.trajectory.acceleration - first.trajectory.acceleration;
        if first.inverse_mass + second.inverse_mass <= 0.0
            || first.is_frozen()
            || second.is_frozen()
        {
            return None; // infinite masses or frozen: no impact
        }
        if !is_finite(center_offset) || !is_finite(velocity) || !is_finite(acceleration) {
            return None; // quarantined after the substep
        }
        let radius_sum = first.radius + second.radius;
        // Quick rejection without the exact distance.
        let displacement =
            (velocity.magnitude() + 0.5 * acceleration.magnitude() * remaining) * remaining;
        let max_distance = (radius_sum + displacement) * (1.0 + 1e-12);
        if center_offset.magnitude2() > max_distance * max_distance {
            return None;
        }
        settings.add_cost(if acceleration.is_zero() { 1 } else { super::QUARTIC_COST });
        let (normal, distance) =
            normalize_and_length(center_offset).unwrap_or((Vec3::unit_x(), 0.0));
        let separation = distance - radius_sum;
        let version = second.trajectory.version;
        let press_speed = self.pressing_speed(a, b, settings);
        let [impact, rest] = [EventKind::BallImpact(b, version), EventKind::RestOnBall(b, version)];
        let motion = RelativeMotion { center_offset, velocity, acceleration, radius_sum };
        let coordinates = [from.x, from.y, from.z, to.x, to.y, to.z].map(f64::abs);
        let size = coordinates.into_iter().fold(radius_sum, f64::max);
        if separation > f64::EPSILON * 8.0 * size {
            let after = motion.time_of_impact([0.0, remaining])?;
            let offset_at_impact = motion.offset_after(after);
            let normal = offset_at_impact / offset_at_impact.magnitude();
            let speed = (velocity + acceleration * after).dot(normal);
            let normal_acceleration = acceleration.dot(normal);
            return if speed < -press_speed {
                Some((after, impact))
            } else if normal_acceleration < 0.0 {
                // Impact so slow that they only start to press each other.
                Some((after + (-press_speed * 1.01 - speed) / normal_acceleration, rest))
            } else {
                None
            };
        }
        motion.contact_event(normal, press_speed, remaining, [impact, rest])
    }

    /// Speed that two balls pressed together regain before they collide again, in m/s.
    ///
    /// With inelastic collisions, chains of touching balls would need infinitely many to come to
    /// rest (inelastic collapse; `McNamara` and Young 1992), so for these it also counts as rest.
    pub(super) fn pressing_speed(&self, a: usize, b: usize, settings: &EventSettings) -> f64 {
        let (first, second) = (&self.balls[a], &self.balls[b]);
        let relative_acceleration =
            (second.trajectory.acceleration - first.trajectory.acceleration).magnitude();
        let max_acceleration =
            first.external_acceleration.magnitude().max(second.external_acceleration.magnitude());
        let loss = 1.0 - first.material.combined_with(second.material).restitution;
        // Collisions round the speeds of spinning surfaces, too.
        let speeds = first.max_surface_speed() + second.max_surface_speed();
        let freeze_count = first.trajectory.freeze_count.max(second.trajectory.freeze_count);
        let press_speed = PRESS_SPEED * SQRT_2.powi(freeze_count) * settings.dt;
        // Two that rest together approach each other by what the solver has left, no faster.
        let rests = first.trajectory.clustered && second.trajectory.clustered;
        let residual = if rests { REST_SPEED * max_acceleration * settings.dt } else { 0.0 };
        (press_speed * relative_acceleration.max(loss * max_acceleration))
            .max((1e-13 + 1e-6 * loss) * speeds)
            .max(residual)
    }
}
