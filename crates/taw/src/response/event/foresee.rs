//! Prediction of a ball's next event.

use std::cmp::Reverse;
use std::f64::consts::SQRT_2;

use cgmath::{InnerSpace, Zero};

use super::time::{Gap, closing_time, meeting_time};
use super::{Event, EventDriven, FLUSH, Form, Home, PRESS, REST, SLOP, Settings, What};
use crate::math::{Point3, Vec3, direction_and_length, is_finite};
use crate::shape::PointProjection;

/// Steps enough for a ball to come to any wall but one that it only grazes; then it looks
/// again.
const MOST_STEPS: u32 = 64;
/// The part of a substep after which a ball that touches a wall, and is neither pressed there
/// nor comes nearer, looks again.
const AGAIN: f64 = 1.0 / 64.0;
/// A pressure below this part of the pull is none but for rounding.
const NO_PRESSURE: f64 = 1e-9;

impl EventDriven {
    /// Finds the next event of a ball and puts it in the queue.
    pub(super) fn foresee(&mut self, row: usize, now: f64, settings: &Settings) {
        self.go_home(row, now, settings.dt);
        let ends = self.end_of_reach(row, now, settings);
        let walls = self.half_spaces().len() + self.parts_of(row).len();
        settings.count(1 + walls as u64);
        let ball = &self.balls[row];
        let left = settings.dt - now;
        let mut first = (ball.path.change.max(now), What::Changes);
        let mut tied = false;
        let mut offer = |after: Option<f64>, what: What| {
            // What lies behind by rounding is now.
            let Some(after) = after.filter(|after| !after.is_nan()) else { return };
            let time = now + after.max(0.0);
            match (first.1, what) {
                (What::Meets(a, _), What::Meets(b, _)) if a != b && time == first.0 => tied = true,
                _ if time < first.0 => (first, tied) = ((time, what), false),
                _ => {}
            }
        };
        offer(ends, What::Looks);
        // Beyond that, no wall that stays can matter in the rest of the substep.
        let at = ball.position_at(now);
        let speed = ball.velocity_at(now).magnitude();
        let acceleration = ball.path.acceleration.magnitude();
        let far = ball.radius + ball.rounding + (speed + acceleration * left) * left;
        let far = far * (1.0 + 1e-9);
        self.name_walls(row, |wall| {
            let near =
                self.walls[wall].going(now).is_some() || self.walls[wall].at_least(at, now) <= far;
            if near
                && ball.path.support != Some(wall)
                && let Some((after, what)) = self.foresee_wall(row, wall, now, settings)
            {
                offer(Some(after), what);
            }
        });
        let mut other = |other: usize| {
            settings.count(1);
            if other != row
                && let Some((after, what)) = self.foresee_meeting(row, other, now, settings)
            {
                offer(Some(after), what);
            }
        };
        self.name_near(row, &mut other);
        match ball.path.home {
            Home::Cell(cell) => {
                let (position, velocity) = (ball.position_at(now), ball.velocity_at(now));
                for (axis, width) in self.cells.width().into_iter().enumerate() {
                    let low = cell[axis] as f64 * width;
                    let (x, v, a) = (position[axis], velocity[axis], ball.path.acceleration[axis]);
                    let above = Gap { now: low + width - x, speed: -v, acceleration: -a };
                    let below = Gap { now: x - low, speed: v, acceleration: a };
                    for (gap, step) in [(above, 1), (below, -1)] {
                        let to = cell[axis] + step;
                        offer(crossing_time(gap), What::LeavesCell { axis, to });
                    }
                }
            }
            Home::Anywhere => {}
        }
        let (time, what) = first;
        if time <= now + left && time.is_finite() {
            let stamp = ball.path.stamp;
            self.queue.push(Reverse(Event { time, row, stamp, what, tied }));
        }
    }

    /// Names those that a ball may touch soon, itself among them.
    pub(super) fn name_near(&self, row: usize, mut name: impl FnMut(usize)) {
        match self.balls[row].path.home {
            Home::Cell(cell) => {
                self.cells.near(cell, &mut name);
                self.anywhere.iter().copied().for_each(name);
            }
            Home::Anywhere => (0..self.balls.len()).for_each(name),
        }
    }

    /// When and how a ball meets a wall next, in seconds from now.
    fn foresee_wall(
        &self,
        row: usize,
        wall: usize,
        now: f64,
        settings: &Settings,
    ) -> Option<(f64, What)> {
        let ball = &self.balls[row];
        if ball.inverse_mass <= 0.0 || ball.is_frozen() {
            return None; // no wall holds it
        }
        let Form::Plane { offset, .. } = self.walls[wall].form else {
            return self.foresee_part(row, wall, now, settings);
        };
        if !self.is_even(wall) {
            return self.foresee_part(row, wall, now, settings);
        }
        let (position, velocity) = (ball.position_at(now), ball.velocity_at(now));
        let PointProjection { normal, distance, .. } = self.walls[wall].nearest(position, now);
        let gap = Gap {
            now: distance - ball.radius,
            speed: (velocity - self.walls[wall].way(position, now)).dot(normal),
            acceleration: ball.path.acceleration.dot(normal),
        };
        let size = ball.radius + distance.abs() + offset.abs();
        let least = f64::EPSILON * 16.0 * size;
        let held = ball.path.support.is_some() || ball.path.heaped;
        let slow = self.slow(row, held, settings).max(1e-14 * velocity.magnitude());
        // A heap that is held takes an approach as slow as that until the end of the substep.
        let at_last = gap.speed + gap.acceleration * (settings.dt - now);
        let rest = self.slow(row, false, settings);
        if ball.path.heaped && gap.speed >= -slow && gap.acceleration > 0.0 && at_last >= -rest {
            return None;
        }
        Self::wall_event(wall, gap, least, held, slow)
    }

    /// Slower than this, a ball that meets a wall begins to rest on it, or to be pressed.
    fn slow(&self, row: usize, held: bool, settings: &Settings) -> f64 {
        let fall = self.balls[row].pull.magnitude() * settings.dt;
        if held { PRESS * fall } else { REST * fall }
    }

    /// Next event of a ball and a plane by their gap, and the seconds until it.
    fn wall_event(wall: usize, gap: Gap, least: f64, held: bool, slow: f64) -> Option<(f64, What)> {
        let press = gap.acceleration < 0.0;
        if gap.now > least {
            let after = closing_time(gap)?;
            let speed = gap.speed + gap.acceleration * after;
            return Some(if speed < -slow || !press {
                (after, What::Hits(wall))
            } else if held {
                (after + (-slow * 1.01 - speed) / gap.acceleration, What::Hits(wall))
            } else {
                (after, What::SettlesOn(wall))
            });
        }
        if gap.speed < -slow {
            Some((0.0, What::Hits(wall)))
        } else if !press {
            None
        } else if gap.speed > slow {
            Some((-2.0 * gap.speed / gap.acceleration, What::Hits(wall)))
        } else if held {
            Some(((-slow * 1.01 - gap.speed) / gap.acceleration, What::Hits(wall)))
        } else {
            Some((0.0, What::SettlesOn(wall)))
        }
    }

    /// Next event of a ball and a wall that is no half-space, or turns: for as long as the plane
    /// across the nearest point keeps them apart, they do not meet; then there is another one
    /// (conservative advancement; Mirtich 1996).
    fn foresee_part(
        &self,
        row: usize,
        wall: usize,
        now: f64,
        settings: &Settings,
    ) -> Option<(f64, What)> {
        let (ball, number, wall) = (&self.balls[row], wall, &self.walls[wall]);
        let (mut time, mut step) = (now, 0);
        let held = ball.path.support.is_some() || ball.path.heaped;
        let rest = self.slow(row, false, settings);
        // The face that holds it may end under it before the substep does; it must not go deep
        // into the next one.
        let slow = self.slow(row, held, settings);
        let slow = if ball.path.among {
            slow
        } else {
            slow.min(SLOP * ball.radius / settings.dt).max(rest)
        };
        loop {
            if step == MOST_STEPS {
                return Some((time - now, What::Looks));
            }
            settings.count(super::PART_LOOKS);
            let (position, velocity) = (ball.position_at(time), ball.velocity_at(time));
            let PointProjection { normal, distance, .. } = wall.nearest(position, time);
            let over = velocity - wall.way(position, time);
            let gap = Gap {
                now: distance - ball.radius,
                speed: over.dot(normal),
                acceleration: ball.path.acceleration.dot(normal)
                    - self.at_most_turned(row, number, time, settings),
            };
            // Time has no digits for a gap that closes sooner than that.
            let blink = f64::EPSILON * time * gap.speed.abs();
            let least =
                f64::EPSILON * 16.0 * (ball.radius + distance.abs()) + ball.rounding + blink;
            let [rest, slow] = [rest, slow].map(|slow| slow.max(1e-14 * velocity.magnitude()));
            let after = if gap.now > least {
                closing_time(gap)?
            } else if gap.speed < -slow {
                let seam = self.is_seam(row, number, position, time, settings);
                return (!seam).then_some((time - now, What::Hits(number)));
            } else {
                let pressure = self.pressure(row, number, time, ball.path.acceleration);
                // What came off just now has nothing that presses it, whatever rounding says.
                let off = step == 0 && ball.path.off == Some(number);
                let press = !off && pressure > NO_PRESSURE * ball.pull.magnitude();
                if press && gap.speed <= slow {
                    if self.is_seam(row, number, position, time, settings) {
                        return None;
                    }
                    return Some(if ball.path.heaped {
                        let after = (slow * 1.01 + gap.speed) / pressure;
                        (time - now + after, What::Hits(number))
                    } else {
                        (time - now, What::SettlesOn(number))
                    });
                }
                // What nothing presses is not at rest there until it has no approach; but what is
                // held takes its own until the end of the substep.
                let at_last = gap.speed + gap.acceleration * (settings.dt - time);
                let taken = ball.path.among || ball.path.heaped && at_last >= -rest;
                if !press && gap.speed < -rest && !taken {
                    let seam = self.is_seam(row, number, position, time, settings);
                    return (!seam).then_some((time - now, What::Hits(number)));
                }
                if gap.speed > 0.0 && gap.acceleration < 0.0 {
                    // It comes back to this plane, or later.
                    (-2.0 * gap.speed / gap.acceleration).max(AGAIN * AGAIN * settings.dt)
                } else {
                    AGAIN * settings.dt
                }
            };
            step += 1;
            time += after;
            if !time.is_finite() || time > settings.dt {
                return None;
            }
        }
    }

    /// Upper bound of a ball's acceleration toward a wall because that turns, in m/s².
    fn at_most_turned(&self, row: usize, wall: usize, time: f64, settings: &Settings) -> f64 {
        let Some((motion, left)) = self.walls[wall].going(time) else { return 0.0 };
        let turning = motion.angular_velocity.magnitude();
        if turning == 0.0 {
            return 0.0;
        }
        let ball = &self.balls[row];
        let rest = settings.dt - time;
        let pull = ball.path.acceleration.magnitude() * rest;
        let speed = (ball.velocity_at(time) - motion.velocity).magnitude() + pull;
        let pivot = motion.pivot - motion.velocity * left;
        let arm = (ball.position_at(time) - pivot).magnitude() + speed * rest;
        // Of a plane that turns: what Coriolis and the turn itself do.
        turning * (2.0 * speed + turning * arm)
    }

    /// When and how two balls meet next, in seconds from now.
    pub(super) fn foresee_meeting(
        &self,
        a: usize,
        b: usize,
        now: f64,
        settings: &Settings,
    ) -> Option<(f64, What)> {
        let (first, second) = (&self.balls[a], &self.balls[b]);
        let left = settings.dt - now;
        let (from, to) = (first.position_at(now), second.position_at(now));
        let apart = self.period.nearest(to - from);
        let velocity = second.velocity_at(now) - first.velocity_at(now);
        let acceleration = second.path.acceleration - first.path.acceleration;
        if first.inverse_mass + second.inverse_mass <= 0.0
            || first.is_frozen()
            || second.is_frozen()
        {
            return None; // nothing could come of it
        }
        if !is_finite(apart) || !is_finite(velocity) || !is_finite(acceleration) {
            return None; // what is nowhere is nobody's concern
        }
        let reach = first.radius + second.radius;
        // Most are too far away, which needs no exact distance.
        let way = (velocity.magnitude() + 0.5 * acceleration.magnitude() * left) * left;
        let farthest = (reach + way) * (1.0 + 1e-12);
        if apart.magnitude2() > farthest * farthest {
            return None;
        }
        settings.count(if acceleration.is_zero() { 1 } else { super::QUARTIC_LOOKS });
        let (normal, distance) = direction_and_length(apart).unwrap_or((Vec3::unit_x(), 0.0));
        let gap = distance - reach;
        let stamp = second.path.stamp;
        let press = self.press_speed(a, b, settings);
        let meets = |after: f64| (after, What::Meets(b, stamp));
        let largest = [from.x, from.y, from.z, to.x, to.y, to.z].map(f64::abs);
        let size = largest.into_iter().fold(reach, f64::max);
        if gap > f64::EPSILON * 8.0 * size {
            let after = meeting_time(apart, velocity, acceleration, reach, [0.0, left])?;
            let there = apart + (velocity + acceleration * (0.5 * after)) * after;
            let normal = there / there.magnitude();
            let speed = (velocity + acceleration * after).dot(normal);
            let pull = acceleration.dot(normal);
            return if speed < -press {
                Some(meets(after))
            } else if pull < 0.0 {
                // They touch so slowly that they only begin to press each other.
                Some((after + (-press * 1.01 - speed) / pull, What::Leans(b, stamp)))
            } else {
                None
            };
        }
        let speed = velocity.dot(normal);
        let pull = acceleration.dot(normal);
        if speed < -press {
            return Some(meets(0.0));
        }
        if pull >= 0.0 {
            return None;
        }
        // If they part and come free, they meet again; else they press in the end.
        let apex = -speed / pull;
        let there = apart + (velocity + acceleration * (0.5 * apex)) * apex;
        if speed > press && there.magnitude() > reach {
            return meeting_time(apart, velocity, acceleration, reach, [apex, left]).map(meets);
        }
        Some(((-press * 1.01 - speed) / pull, What::Leans(b, stamp)))
    }

    /// Tests if the point where a wall is nearest to a ball is on another wall that is as
    /// near, which is then the one that counts.
    pub(super) fn is_seam(
        &self,
        row: usize,
        wall: usize,
        at: Point3<f64>,
        time: f64,
        settings: &Settings,
    ) -> bool {
        settings.count(self.looks_at_walls(row));
        let ball = &self.balls[row];
        let flush = (FLUSH * ball.radius).max(ball.rounding);
        let nearest = |wall: usize, point: Point3<f64>| self.walls[wall].nearest(point, time);
        let its = nearest(wall, at);
        let mut covered = false;
        self.name_walls(row, |other| {
            if !covered
                && other != wall
                && self.walls[other].at_least(its.point, time) <= flush
                && nearest(other, its.point).distance <= flush
            {
                let theirs = nearest(other, at);
                let before = (theirs.distance, other) < (its.distance, wall);
                covered = before || nearest(wall, theirs.point).distance > flush;
            }
        });
        covered
    }

    /// The speed that two balls that press each other gain before they touch anew.
    ///
    /// Where collisions take energy, chains of touching balls would come to rest among
    /// themselves only after endlessly many (inelastic collapse; `McNamara` and Young
    /// 1992), so there it is also what counts as rest.
    pub(super) fn press_speed(&self, a: usize, b: usize, settings: &Settings) -> f64 {
        let (first, second) = (&self.balls[a], &self.balls[b]);
        let apart = (second.path.acceleration - first.path.acceleration).magnitude();
        let pull = first.pull.magnitude().max(second.pull.magnitude());
        let taken = 1.0 - first.material.against(second.material).restitution;
        let speeds = first.velocity.magnitude() + second.velocity.magnitude();
        let surrenders = first.path.surrenders.max(second.path.surrenders);
        let press = PRESS * SQRT_2.powi(surrenders) * settings.dt;
        (press * apart.max(taken * pull)).max((1e-13 + 1e-6 * taken) * speeds)
    }
}

/// Time until something leaves its cell through a border, which it may lie on, in seconds.
fn crossing_time(gap: Gap) -> Option<f64> {
    if gap.now > 0.0 {
        closing_time(gap)
    } else if gap.speed < 0.0 || (gap.speed == 0.0 && gap.acceleration < 0.0) {
        Some(0.0)
    } else if gap.acceleration < 0.0 {
        Some(-2.0 * gap.speed / gap.acceleration)
    } else {
        None
    }
}
