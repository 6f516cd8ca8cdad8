//! Prediction of a ball's next event.

use std::cmp::Reverse;
use std::f64::consts::SQRT_2;
use std::ops::ControlFlow;

use cgmath::{InnerSpace, Zero};

use super::toi::{SeparationMotion, time_of_impact_plane, time_of_impact_spheres};
use super::{
    Ball, CellSlot, Event, EventDriven, EventKind, EventSettings, PRESS_SPEED, REST_SPEED,
    SEAM_TOLERANCE, SLOP, WallCollider,
};
use crate::math::{Point3, Vec3, direction_and_length, is_finite};
use crate::shape::Nearest;

/// Maximum number of conservative advancement steps; only a grazing ball needs more, and is
/// predicted again from there.
const MAX_ADVANCES: u32 = 64;
/// Time until a ball that touches a wall, without pressing and without approach, is tested again,
/// over the substep.
const RECHECK_TIME: f64 = 1.0 / 64.0;
/// A normal acceleration below this fraction of the external one is rounding.
const MIN_NORMAL_ACCELERATION: f64 = 1e-9;

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
}

impl EventDriven {
    /// Predicts the next event of a ball and queues it.
    pub(super) fn predict(&mut self, row: usize, now: f64, settings: &EventSettings) {
        self.update_cell(row, now, settings.dt);
        let refresh = self.candidates_expiry(row, now, settings);
        let walls = self.half_spaces().len() + self.parts_of(row).len();
        settings.add_cost(1 + walls as u64);
        let ball = &self.balls[row];
        let remaining = settings.dt - now;
        let mut next = (ball.trajectory.regime_end.max(now), EventKind::RegimeChange);
        let mut simultaneous = false;
        let mut consider = |after: Option<f64>, kind: EventKind| {
            // An event in the past by rounding happens now.
            let Some(after) = after.filter(|after| !after.is_nan()) else { return };
            let time = now + after.max(0.0);
            match (next.1, kind) {
                (EventKind::BallImpact(a, _), EventKind::BallImpact(b, _))
                    if a != b && time == next.0 =>
                {
                    simultaneous = true;
                }
                _ if time < next.0 => (next, simultaneous) = ((time, kind), false),
                _ => {}
            }
        };
        consider(refresh, EventKind::RefreshCandidates);
        // Walls at rest beyond this distance cannot matter in the rest of the substep.
        let at = ball.position_at(now);
        let speed = ball.velocity_at(now).magnitude();
        let acceleration = ball.trajectory.acceleration.magnitude();
        let max_distance =
            ball.radius + ball.position_error + (speed + acceleration * remaining) * remaining;
        let max_distance = max_distance * (1.0 + 1e-9);
        self.for_each_wall(row, |wall| {
            let near = self.walls[wall].motion_at(now).is_some()
                || self.walls[wall].distance_lower_bound(at, now) <= max_distance;
            if near
                && ball.trajectory.support != Some(wall)
                && let Some((after, kind)) = self.predict_wall(row, wall, now, settings)
            {
                consider(Some(after), kind);
            }
        });
        let mut other = |other: usize| {
            settings.add_cost(1);
            if other != row
                && let Some((after, kind)) = self.predict_ball(row, other, now, settings)
            {
                consider(Some(after), kind);
            }
        };
        self.for_each_near(row, &mut other);
        self.for_each_crossing(ball, now, consider);
        let (time, kind) = next;
        if time <= now + remaining && time.is_finite() {
            let version = ball.trajectory.version;
            self.queue.push(Reverse(Event { time, row, version, kind, simultaneous }));
        }
    }

    /// Visits the crossings of the borders of a ball's cell, with the seconds until them.
    fn for_each_crossing(
        &self,
        ball: &Ball,
        now: f64,
        mut visit: impl FnMut(Option<f64>, EventKind),
    ) {
        let CellSlot::Cell(cell) = ball.trajectory.cell_slot else { return };
        let (position, velocity) = (ball.position_at(now), ball.velocity_at(now));
        for (axis, width) in self.cells.width().into_iter().enumerate() {
            let border = cell[axis] as f64 * width;
            let (x, v, a) = (position[axis], velocity[axis], ball.trajectory.acceleration[axis]);
            let above =
                SeparationMotion { distance: border + width - x, speed: -v, acceleration: -a };
            let below = SeparationMotion { distance: x - border, speed: v, acceleration: a };
            for (separation, step) in [(above, 1), (below, -1)] {
                let to = cell[axis] + step;
                visit(crossing_time(separation), EventKind::CellCrossing { axis, to });
            }
        }
    }

    /// Visits balls that a ball may touch soon, itself among them.
    pub(super) fn for_each_near(&self, row: usize, mut visit: impl FnMut(usize)) {
        match self.balls[row].trajectory.cell_slot {
            CellSlot::Cell(cell) => {
                self.cells.for_each_near(cell, &mut visit);
                self.unbounded.iter().copied().for_each(visit);
            }
            CellSlot::Unbounded => (0..self.balls.len()).for_each(visit),
        }
    }

    /// Next event with a wall, and the seconds until it.
    fn predict_wall(
        &self,
        row: usize,
        wall: usize,
        now: f64,
        settings: &EventSettings,
    ) -> Option<(f64, EventKind)> {
        let ball = &self.balls[row];
        if ball.inverse_mass <= 0.0 || ball.is_frozen() {
            return None; // no wall holds it
        }
        let WallCollider::Plane { offset, .. } = self.walls[wall].collider else {
            return self.predict_wall_part(row, wall, now, settings);
        };
        if !self.has_fixed_normal(wall) {
            return self.predict_wall_part(row, wall, now, settings);
        }
        let (position, velocity) = (ball.position_at(now), ball.velocity_at(now));
        let Nearest { normal, distance, .. } = self.walls[wall].nearest(position, now);
        let separation = SeparationMotion {
            distance: distance - ball.radius,
            speed: (velocity - self.walls[wall].velocity_at(position, now)).dot(normal),
            acceleration: ball.trajectory.acceleration.dot(normal),
        };
        let size = ball.radius + distance.abs() + offset.abs();
        let tolerance = f64::EPSILON * 16.0 * size;
        let is_resting = ball.trajectory.support.is_some() || ball.trajectory.clustered;
        let impact_threshold =
            self.impact_threshold(row, is_resting, settings).max(1e-14 * velocity.magnitude());
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
        Self::wall_event(wall, separation, tolerance, is_resting, impact_threshold)
    }

    /// Approach speed below which a ball starts to rest on a wall, in m/s.
    fn impact_threshold(&self, row: usize, is_resting: bool, settings: &EventSettings) -> f64 {
        let fall_speed = self.balls[row].external_acceleration.magnitude() * settings.dt;
        if is_resting { PRESS_SPEED * fall_speed } else { REST_SPEED * fall_speed }
    }

    /// Next event of a ball and a plane, and the seconds until it.
    fn wall_event(
        wall: usize,
        separation: SeparationMotion,
        tolerance: f64,
        is_resting: bool,
        impact_threshold: f64,
    ) -> Option<(f64, EventKind)> {
        let pressed = separation.acceleration < 0.0;
        if separation.distance > tolerance {
            let after = time_of_impact_plane(separation)?;
            let speed = separation.speed + separation.acceleration * after;
            return Some(if speed < -impact_threshold || !pressed {
                (after, EventKind::WallImpact(wall))
            } else if is_resting {
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
        } else if is_resting {
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
        // The supporting face may end before the substep does; the ball must not penetrate the next
        // one deeply.
        let impact_threshold = self.impact_threshold(row, is_resting, settings);
        let impact_threshold = if ball.trajectory.touches_balls {
            impact_threshold
        } else {
            impact_threshold.min(SLOP * ball.radius / settings.dt).max(rest_threshold)
        };
        loop {
            if step == MAX_ADVANCES {
                return Some((time - now, EventKind::RefreshCandidates));
            }
            settings.add_cost(super::PART_COST);
            let (position, velocity) = (ball.position_at(time), ball.velocity_at(time));
            let Nearest { normal, distance, .. } = wall.nearest(position, time);
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
                match self
                    .predict_contact(row, number, time, separation, thresholds, just_left, settings)
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
        row: usize,
        wall: usize,
        time: f64,
        separation: SeparationMotion,
        [rest_threshold, impact_threshold]: [f64; 2],
        just_left: bool,
        settings: &EventSettings,
    ) -> ControlFlow<Option<(f64, EventKind)>, f64> {
        let ball = &self.balls[row];
        let is_seam = || self.is_seam(row, wall, ball.position_at(time), time, settings);
        let impact = |is_seam: bool| (!is_seam).then_some((0.0, EventKind::WallImpact(wall)));
        if separation.speed < -impact_threshold {
            return ControlFlow::Break(impact(is_seam()));
        }
        let normal_acceleration =
            self.normal_acceleration(row, wall, time, ball.trajectory.acceleration);
        // A wall that the ball has just left does not press it, whatever rounding says.
        let is_pressed = !just_left
            && normal_acceleration
                > MIN_NORMAL_ACCELERATION * ball.external_acceleration.magnitude();
        if is_pressed && separation.speed <= impact_threshold {
            if is_seam() {
                return ControlFlow::Break(None);
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
            return ControlFlow::Break(impact(is_seam()));
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
        let angular_speed = motion.spin.magnitude();
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
        let center_offset = self.period.nearest(to - from);
        let velocity = second.velocity_at(now) - first.velocity_at(now);
        let acceleration = second.trajectory.acceleration - first.trajectory.acceleration;
        if first.inverse_mass + second.inverse_mass <= 0.0
            || first.is_frozen()
            || second.is_frozen()
        {
            return None; // nothing could come of it
        }
        if !is_finite(center_offset) || !is_finite(velocity) || !is_finite(acceleration) {
            return None; // what is nowhere is nobody's concern
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
            direction_and_length(center_offset).unwrap_or((Vec3::unit_x(), 0.0));
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
        let speed = velocity.dot(normal);
        let normal_acceleration = acceleration.dot(normal);
        if speed < -press_speed {
            return Some((0.0, impact));
        }
        if normal_acceleration >= 0.0 {
            return None;
        }
        // Balls that separate completely collide again; others press each other in the end.
        let apex = -speed / normal_acceleration;
        if speed > press_speed && motion.offset_after(apex).magnitude() > radius_sum {
            return motion.time_of_impact([apex, remaining]).map(|after| (after, impact));
        }
        Some(((-press_speed * 1.01 - speed) / normal_acceleration, rest))
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
        settings.add_cost(self.wall_cost(row));
        let ball = &self.balls[row];
        let tolerance = (SEAM_TOLERANCE * ball.radius).max(ball.position_error);
        let nearest = |wall: usize, point: Point3<f64>| self.walls[wall].nearest(point, time);
        let nearest_here = nearest(wall, at);
        let mut covered = false;
        self.for_each_wall(row, |other| {
            if !covered
                && other != wall
                && self.walls[other].distance_lower_bound(nearest_here.point, time) <= tolerance
                && nearest(other, nearest_here.point).distance <= tolerance
            {
                let nearest_other = nearest(other, at);
                let before = (nearest_other.distance, other) < (nearest_here.distance, wall);
                covered = before || nearest(wall, nearest_other.point).distance > tolerance;
            }
        });
        covered
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
        let speeds = first.velocity.magnitude() + second.velocity.magnitude();
        let freeze_count = first.trajectory.freeze_count.max(second.trajectory.freeze_count);
        let press_speed = PRESS_SPEED * SQRT_2.powi(freeze_count) * settings.dt;
        (press_speed * relative_acceleration.max(loss * max_acceleration))
            .max((1e-13 + 1e-6 * loss) * speeds)
    }
}

/// Time until a center leaves its cell through a border, on which it may lie, in seconds.
fn crossing_time(separation: SeparationMotion) -> Option<f64> {
    if separation.distance > 0.0 {
        time_of_impact_plane(separation)
    } else if separation.speed < 0.0 || (separation.speed == 0.0 && separation.acceleration < 0.0) {
        Some(0.0)
    } else if separation.acceleration < 0.0 {
        Some(-2.0 * separation.speed / separation.acceleration)
    } else {
        None
    }
}
