//! What happens to a ball next.

use std::cmp::Reverse;
use std::f64::consts::SQRT_2;

use cgmath::{InnerSpace, Zero};

use super::time::{Gap, closing_time, meeting_time};
use super::{Ball, Event, EventDriven, Form, Home, MOST_SURRENDERS, PRESS, REST, Settings, What};
use crate::math::{Vec3, direction_and_length, is_finite};
use crate::response::Walls as _;

/// Steps enough for a ball to come to any wall but one that it only grazes.
const MOST_STEPS: u32 = 64;

impl EventDriven {
    /// Finds the next event of a ball and puts it in the queue.
    pub(super) fn foresee(&mut self, row: usize, now: f64, settings: &Settings) {
        self.go_home(row, now, settings.dt);
        let ball = &self.balls[row];
        let left = settings.dt - now;
        let mut first = (ball.path.change.max(now), What::Changes);
        let mut tied = false;
        let mut offer = |after: Option<f64>, what: What| {
            // What lies behind by rounding is now.
            let Some(after) = after else { return };
            let time = now + after.max(0.0);
            match (first.1, what) {
                // Some are named twice.
                (What::Meets(a, _), What::Meets(b, _)) if a != b && time == first.0 => tied = true,
                _ if time < first.0 => (first, tied) = ((time, what), false),
                _ => {}
            }
        };
        self.name_walls(row, |wall| {
            if ball.path.support != Some(wall)
                && let Some((after, what)) = self.foresee_wall(row, wall, now, settings)
            {
                offer(Some(after), what);
            }
        });
        let mut other = |other: usize| {
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
                for axis in 0..3 {
                    let low = cell[axis] as f64 * self.cells.width();
                    let (x, v, a) = (position[axis], velocity[axis], ball.path.acceleration[axis]);
                    let above =
                        Gap { now: low + self.cells.width() - x, speed: -v, acceleration: -a };
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

    /// Names those that a ball may touch soon, itself among them, some of them twice.
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
        if ball.inverse_mass <= 0.0 || ball.path.surrenders >= MOST_SURRENDERS {
            return None; // no wall holds it
        }
        let Form::Plane { offset, .. } = self.walls[wall].form else {
            return self.foresee_part(row, wall, now, settings);
        };
        let (position, velocity) = (ball.position_at(now), ball.velocity_at(now));
        let (normal, distance) = self.walls.normal_and_distance(wall, 0, position);
        let moving = self.walls[wall].motion.is_some();
        let touch = position - normal * ball.radius;
        let surface = if moving { self.walls.surface_velocity(wall, touch) } else { Vec3::zero() };
        let gap = Gap {
            now: distance - ball.radius,
            speed: (velocity + ball.path.carry - surface).dot(normal),
            acceleration: ball.path.acceleration.dot(normal),
        };
        let size = ball.radius + distance.abs() + offset.abs();
        let fall = ball.pull.magnitude() * settings.dt;
        let least = f64::EPSILON * 16.0 * size;
        let held = ball.path.support.is_some() || ball.path.heaped;
        let press = gap.acceleration < 0.0;
        let slow = if held { PRESS * fall } else { REST * fall };
        let slow = slow.max(1e-14 * velocity.magnitude());
        if gap.now > least {
            // A wall counts as where it will be, so one that comes nearer is there.
            let seen = Gap { speed: velocity.dot(normal), ..gap };
            let after = closing_time(seen)?;
            let speed = seen.speed + seen.acceleration * after;
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

    /// The same of a wall that is no half-space: for as long as the plane across the nearest
    /// point keeps them apart, they do not meet; then there is another one (conservative
    /// advancement; Mirtich 1996).
    fn foresee_part(
        &self,
        row: usize,
        wall: usize,
        now: f64,
        settings: &Settings,
    ) -> Option<(f64, What)> {
        let ball = &self.balls[row];
        let (mut time, mut step) = (now, 0);
        let acceleration = ball.path.acceleration;
        let moving = self.walls[wall].motion.is_some();
        let fall = ball.pull.magnitude() * settings.dt;
        let held = ball.path.support.is_some() || ball.path.heaped;
        let (normal, gap, seen) = loop {
            let (position, velocity) = (ball.position_at(time), ball.velocity_at(time));
            let (normal, distance) = self.walls.normal_and_distance(wall, 0, position);
            let touch = position - normal * ball.radius;
            let surface =
                if moving { self.walls.surface_velocity(wall, touch) } else { Vec3::zero() };
            let gap = Gap {
                now: distance - ball.radius,
                speed: (velocity + ball.path.carry - surface).dot(normal),
                acceleration: acceleration.dot(normal),
            };
            let seen = Gap { speed: velocity.dot(normal), ..gap };
            let least = f64::EPSILON * 16.0 * (ball.radius + distance.abs()) + ball.rounding;
            let leaves = step == 0 && gap.speed > 0.0 && gap.now <= least;
            let after = if leaves {
                // It comes back to this plane, or never.
                (gap.acceleration < 0.0).then(|| -2.0 * gap.speed / gap.acceleration)?
            } else if gap.now <= least || step == MOST_STEPS {
                break (normal, gap, seen);
            } else {
                closing_time(seen)?
            };
            step += 1;
            time += after;
            if !time.is_finite() || time > settings.dt {
                return None;
            }
        };
        let slow = if held { PRESS * fall } else { REST * fall };
        let slow = slow.max(1e-14 * ball.velocity_at(time).magnitude());
        let press = ball.path.acceleration.dot(normal) < 0.0;
        // What met it on the way is there; what touched it at once goes by what it sees.
        let speed = if step > 0 { seen.speed } else { gap.speed };
        if speed >= -slow && (!press || speed > slow || held) {
            return None;
        }
        if self.is_seam(row, wall, ball.position_at(time)) {
            return None;
        }
        let what = if speed < -slow { What::Hits(wall) } else { What::SettlesOn(wall) };
        Some((time - now, what))
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
        let velocity = second.velocity_at(now) - first.velocity_at(now);
        let acceleration = second.path.acceleration - first.path.acceleration;
        let passes = |ball: &Ball| ball.path.surrenders >= MOST_SURRENDERS;
        if first.inverse_mass + second.inverse_mass <= 0.0 || passes(first) || passes(second) {
            return None; // nothing could come of it
        }
        if !is_finite(to - from) || !is_finite(velocity) || !is_finite(acceleration) {
            return None; // what is nowhere is nobody's concern
        }
        let reach = first.radius + second.radius;
        // Most are too far away, which needs no exact distance.
        let way = (velocity.magnitude() + 0.5 * acceleration.magnitude() * left) * left;
        let farthest = (reach + way) * (1.0 + 1e-12);
        if (to - from).magnitude2() > farthest * farthest {
            return None;
        }
        let (normal, distance) = direction_and_length(to - from).unwrap_or((Vec3::unit_x(), 0.0));
        let gap = distance - reach;
        let stamp = second.path.stamp;
        let press = self.press_speed(a, b, settings);
        let meets = |after: f64| (after, What::Meets(b, stamp));
        let largest = [from.x, from.y, from.z, to.x, to.y, to.z].map(f64::abs);
        let size = largest.into_iter().fold(reach, f64::max);
        if gap > f64::EPSILON * 8.0 * size {
            let after = meeting_time(to - from, velocity, acceleration, reach, [0.0, left])?;
            let there = to - from + (velocity + acceleration * (0.5 * after)) * after;
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
        let there = to - from + (velocity + acceleration * (0.5 * apex)) * apex;
        if speed > press && there.magnitude() > reach {
            return meeting_time(to - from, velocity, acceleration, reach, [apex, left]).map(meets);
        }
        Some(((-press * 1.01 - speed) / pull, What::Leans(b, stamp)))
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

/// When something passes a border between cells outward, which it may lie on.
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
