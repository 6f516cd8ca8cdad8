//! Prediction of a ball's next event with a wall.

use std::ops::ControlFlow;

use cgmath::InnerSpace;

use super::toi::{SeparationMotion, time_of_impact_plane};
use super::wall::distance_rounding;
use super::{
    EventKind, EventSettings, EventSolver, PRESS_SPEED, REST_SPEED, SEAM_TOLERANCE, SLOP,
    WallCollider,
};
use crate::math::Point3;
use crate::shape::PointProjection;

/// Maximum number of conservative advancement steps; only a grazing ball needs more, and is
/// predicted again from there.
const MAX_ADVANCES: u32 = 64;
/// Time until a ball that touches a wall, without pressing and without approach, is tested again,
/// over the substep.
const RECHECK_TIME: f64 = 1.0 / 64.0;
/// A normal acceleration below this fraction of the external one is rounding.
pub(super) const MIN_NORMAL_ACCELERATION: f64 = 1e-9;

impl EventSolver {
    /// Next event with a wall, and the seconds until it.
    pub(super) fn predict_wall(
        &self,
        row: usize,
        wall: usize,
        now: f64,
        settings: &EventSettings,
    ) -> Option<(f64, EventKind)> {
        let ball = &self.balls[row];
        if ball.inverse_mass <= 0.0 || ball.is_frozen() {
            return None; // infinite mass or frozen: walls do not stop it
        }
        let WallCollider::Plane { offset, .. } = self.walls[wall].collider else {
            return self.predict_wall_part(row, wall, now, settings);
        };
        if !self.has_fixed_normal(wall) {
            return self.predict_wall_part(row, wall, now, settings);
        }
        let (position, velocity) = (ball.position_at(now), ball.velocity_at(now));
        let PointProjection { normal, distance, .. } = self.walls[wall].nearest(position, now);
        let separation = SeparationMotion {
            distance: distance - ball.radius,
            speed: (velocity - self.walls[wall].velocity_at(position, now)).dot(normal),
            acceleration: ball.trajectory.acceleration.dot(normal),
        };
        let size = ball.radius + distance.abs() + offset.abs();
        let tolerance = f64::EPSILON * 16.0 * size;
        // What rests on a half-space bounces off another one, or rests on both, by its own threshold.
        let on_part = ball.trajectory.support.is_some_and(|it| !self.has_fixed_normal(it));
        let keeps_approach = ball.trajectory.clustered || on_part;
        let impact_threshold =
            self.impact_threshold(row, keeps_approach, settings).max(1e-14 * velocity.magnitude());
        // A resting cluster absorbs such a slow approach until the end of the substep.
        let end_speed = separation.speed + separation.acceleration * (settings.dt - now);
        let rest_threshold = self.impact_threshold(row, false, settings);
        if ball.trajectory.clustered
            && separation.speed >= -impact_threshold
            && separation.acceleration > 0.0
            && end_speed >= -rest_threshold
        {
            return None;
        }
        Self::wall_event(wall, separation, tolerance, keeps_approach, impact_threshold)
    }

    /// Approach speed below which a ball starts to rest on a wall, in m/s. One that keeps its approach
    /// keeps a faster one, but none that would let it deeply into the wall until the end of the substep,
    /// before a support may end or another one begin.
    fn impact_threshold(&self, row: usize, keeps_approach: bool, settings: &EventSettings) -> f64 {
        let rest_speed = REST_SPEED * self.fall_speed(row, settings);
        if !keeps_approach {
            return rest_speed;
        }
        let press_speed = PRESS_SPEED * self.fall_speed(row, settings);
        press_speed.min(SLOP * self.balls[row].radius / settings.dt).max(rest_speed)
    }

    /// Speed that external forces add in the substep, in m/s.
    fn fall_speed(&self, row: usize, settings: &EventSettings) -> f64 {
        self.balls[row].external_acceleration.magnitude() * settings.dt
    }

    /// Next event of a ball and a plane, and the seconds until it. If it keeps its approach, a slow
    /// one is an impact as soon as it exceeds the threshold.
    fn wall_event(
        wall: usize,
        separation: SeparationMotion,
        tolerance: f64,
        keeps_approach: bool,
        impact_threshold: f64,
    ) -> Option<(f64, EventKind)> {
        let pressed = separation.acceleration < 0.0;
        if separation.distance > tolerance {
            let after = time_of_impact_plane(separation)?;
            let speed = separation.speed + separation.acceleration * after;
            return Some(if speed < -impact_threshold || !pressed {
                (after, EventKind::WallImpact(wall))
            } else if keeps_approach {
                (
                    after + (-impact_threshold * 1.01 - speed) / separation.acceleration,
                    EventKind::WallImpact(wall),
                )
            } else {
                (after, EventKind::RestOnWall(wall))
            });
        }
        if separation.speed < -impact_threshold {
            Some((0.0, EventKind::WallImpact(wall)))
        } else if !pressed {
            None
        } else if separation.speed > impact_threshold {
            Some((-2.0 * separation.speed / separation.acceleration, EventKind::WallImpact(wall)))
        } else if keeps_approach {
            Some((
                (-impact_threshold * 1.01 - separation.speed) / separation.acceleration,
                EventKind::WallImpact(wall),
            ))
        } else {
            Some((0.0, EventKind::RestOnWall(wall)))
        }
    }

    /// Next event with a rotating wall or a sub-shape that is no half-space, by conservative
    /// advancement (Mirtich 1996): while the plane at the nearest point separates them, there is no
    /// impact; then the plane is updated.
    fn predict_wall_part(
        &self,
        row: usize,
        wall: usize,
        now: f64,
        settings: &EventSettings,
    ) -> Option<(f64, EventKind)> {
        let (ball, number, wall) = (&self.balls[row], wall, &self.walls[wall]);
        let (mut time, mut step) = (now, 0);
        let is_resting = ball.trajectory.support.is_some() || ball.trajectory.clustered;
        let rest_threshold = self.impact_threshold(row, false, settings);
        let impact_threshold = if ball.trajectory.touches_balls {
            // Others press it again, into a wall that may move.
            PRESS_SPEED * self.fall_speed(row, settings)
        } else {
            self.impact_threshold(row, is_resting, settings)
        };
        loop {
            if step == MAX_ADVANCES {
                return Some((time - now, EventKind::RefreshCandidates));
            }
            settings.add_cost(super::PART_COST);
            let (position, velocity) = (ball.position_at(time), ball.velocity_at(time));
            let PointProjection { normal, distance, .. } = wall.nearest(position, time);
            let relative_velocity = velocity - wall.velocity_at(position, time);
            let separation = SeparationMotion {
                distance: distance - ball.radius,
                speed: relative_velocity.dot(normal),
                acceleration: ball.trajectory.acceleration.dot(normal)
                    - self.max_rotation_acceleration(row, number, time, settings),
            };
            // Separations that close sooner are below the resolution of time.
            let time_rounding = f64::EPSILON * time * separation.speed.abs();
            let tolerance = f64::EPSILON * 16.0 * (ball.radius + distance.abs())
                + ball.position_error
                + time_rounding;
            let [rest_threshold, impact_threshold] = [rest_threshold, impact_threshold]
                .map(|threshold| threshold.max(1e-14 * velocity.magnitude()));
            let after = if separation.distance > tolerance {
                time_of_impact_plane(separation)?
            } else {
                let just_left = step == 0 && ball.trajectory.left_wall == Some(number);
                let thresholds = [rest_threshold, impact_threshold];
                let pair = (row, number);
                match self.predict_contact(pair, time, separation, thresholds, just_left, settings)
                {
                    ControlFlow::Continue(after) => after,
                    ControlFlow::Break(event) => {
                        return event.map(|(after, kind)| (time - now + after, kind));
                    }
                }
            };
            step += 1;
            time += after;
            if !time.is_finite() || time > settings.dt {
                return None;
            }
        }
    }

    /// Event of a ball in contact with a wall, and the seconds until it, or the seconds after which
    /// the contact is to be tested again.
    fn predict_contact(
        &self,
        (row, wall): (usize, usize),
        time: f64,
        separation: SeparationMotion,
        [rest_threshold, impact_threshold]: [f64; 2],
        just_left: bool,
        settings: &EventSettings,
    ) -> ControlFlow<Option<(f64, EventKind)>, f64> {
        let ball = &self.balls[row];
        let is_seam = || self.is_seam(row, wall, ball.position_at(time), time, settings);
        // The other wall of a seam may let the ball pass, and then this one is in its way.
        let recheck = (RECHECK_TIME * settings.dt, EventKind::RefreshCandidates);
        let impact = || if is_seam() { recheck } else { (0.0, EventKind::WallImpact(wall)) };
        if separation.speed < -impact_threshold {
            return ControlFlow::Break(Some(impact()));
        }
        let normal_acceleration =
            self.normal_acceleration(row, wall, time, ball.trajectory.acceleration);
        // A wall that the ball has just left does not press it, whatever rounding says.
        let is_pressed = !just_left
            && normal_acceleration
                > MIN_NORMAL_ACCELERATION * ball.external_acceleration.magnitude();
        if is_pressed && separation.speed <= impact_threshold {
            if is_seam() {
                let is_resting = ball.trajectory.support.is_some() || ball.trajectory.clustered;
                return ControlFlow::Break((!is_resting).then_some(recheck));
            }
            return ControlFlow::Break(Some(if ball.trajectory.clustered {
                let after = (impact_threshold * 1.01 + separation.speed) / normal_acceleration;
                (after, EventKind::WallImpact(wall))
            } else {
                (0.0, EventKind::RestOnWall(wall))
            }));
        }
        // Without a normal force any approach is an impact; but a resting cluster absorbs its own
        // until the end of the substep.
        let end_speed = separation.speed + separation.acceleration * (settings.dt - time);
        let is_held_to_end = ball.trajectory.touches_balls
            || ball.trajectory.clustered && end_speed >= -rest_threshold;
        if !is_pressed && separation.speed < -rest_threshold && !is_held_to_end {
            return ControlFlow::Break(Some(impact()));
        }
        ControlFlow::Continue(if separation.speed > 0.0 && separation.acceleration < 0.0 {
            // Earliest return to this plane.
            (-2.0 * separation.speed / separation.acceleration)
                .max(RECHECK_TIME * RECHECK_TIME * settings.dt)
        } else {
            RECHECK_TIME * settings.dt
        })
    }

    /// Upper bound of a ball's acceleration toward a wall by the wall's rotation, in m/s².
    fn max_rotation_acceleration(
        &self,
        row: usize,
        wall: usize,
        time: f64,
        settings: &EventSettings,
    ) -> f64 {
        let Some((motion, remaining)) = self.walls[wall].motion_at(time) else { return 0.0 };
        let angular_speed = motion.angular_velocity.magnitude();
        if angular_speed == 0.0 {
            return 0.0;
        }
        let ball = &self.balls[row];
        let time_left = settings.dt - time;
        let speed_gain = ball.trajectory.acceleration.magnitude() * time_left;
        let speed = (ball.velocity_at(time) - motion.velocity).magnitude() + speed_gain;
        let pivot = motion.pivot - motion.velocity * remaining;
        let arm = (ball.position_at(time) - pivot).magnitude() + speed * time_left;
        // Coriolis and centripetal acceleration of a rotating plane.
        angular_speed * (2.0 * speed + angular_speed * arm)
    }

    /// Tests for an internal edge (ghost collision): the nearest point of a wall lies on another
    /// wall that is at least as near, and takes precedence.
    pub(super) fn is_seam(
        &self,
        row: usize,
        wall: usize,
        at: Point3<f64>,
        time: f64,
        settings: &EventSettings,
    ) -> bool {
        let ball = &self.balls[row];
        let tolerance = (SEAM_TOLERANCE * ball.radius).max(ball.position_error);
        let nearest = |wall: usize, point: Point3<f64>| self.walls[wall].nearest(point, time);
        let nearest_here = nearest(wall, at);
        let rounding = distance_rounding(at, nearest_here.distance);
        let mut covered = false;
        let range = (at, nearest_here.distance.abs() + tolerance + rounding);
        let cost = self.for_each_wall_within(row, range, |other| {
            if !covered
                && other != wall
                && self.walls[other].distance_lower_bound(nearest_here.point, time) <= tolerance
                && nearest(other, nearest_here.point).distance <= tolerance
            {
                let nearest_other = nearest(other, at);
                // Faces that share an edge are equally near, whatever rounding says at the time of
                // impact of either one; else each might be covered by the other.
                let difference = nearest_other.distance - nearest_here.distance;
                let is_tie = difference.abs() <= rounding;
                let before = if is_tie { other < wall } else { difference < 0.0 };
                covered = before || nearest(wall, nearest_other.point).distance > tolerance;
            }
        });
        settings.add_cost(cost);
        covered
    }
}
