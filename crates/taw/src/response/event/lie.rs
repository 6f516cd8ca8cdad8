//! A ball that lies on a wall: how it comes to lie there, how it goes on, and where that ends.

use std::cell::Cell;

use cgmath::{InnerSpace, Zero};

use super::bend::{Ground, State, shortest_step};
use super::support::Support;
use super::{Ball, EventDriven, FLUSH, Form, LOOK, REST, Settings};
use crate::math::Vec3;
use crate::response::{BallSpin, Push};
use crate::shape::PointProjection;

/// Number of halvings of a time to find where a face ends.
const HALVINGS: u32 = 24;

/// A wall that rises by less than this angle, in radians, goes on like the one before.
const IN_FRONT: f64 = 1e-6;

impl EventDriven {
    /// Lets a ball that touches a wall lie on it from now on.
    pub(super) fn settle(&mut self, row: usize, wall: usize, settings: &Settings) {
        let ball = &mut self.balls[row];
        let wall_ = &self.walls[wall];
        let now = ball.path.begin;
        let PointProjection { normal, distance, .. } = wall_.nearest(ball.position, now);
        ball.release();
        // The rounding of the place goes too, lest it add up. Overlap is not energy: it goes
        // without a change of velocity.
        let overlap = ball.radius - distance;
        let fall = ball.pull.magnitude() * settings.dt * settings.dt;
        if -overlap <= REST * fall + ball.rounding + wall_.rounding(ball.position) {
            ball.position += normal * overlap;
        }
        let way = wall_.way(ball.position, now);
        let change = normal * (way - ball.velocity).dot(normal);
        if let Some(work) = &mut self.work
            && ball.inverse_mass > 0.0
        {
            let mean = ball.velocity + change * 0.5 - way;
            let impulse = change / ball.inverse_mass;
            work.push(Push { impulse, normal, mean, fixed: [Some(way), None] });
        }
        ball.velocity += change;
        ball.path.support = Some(wall);
        self.stretch(row, settings);
    }

    /// A ball on a wall that is no half-space may have come to where another goes on, or
    /// none: then it flies.
    pub(super) fn look_what_it_lies_on(&mut self, row: usize, settings: &Settings) {
        let Some(support) = self.balls[row].path.support else { return };
        if self.balls[row].path.leaves {
            self.balls[row].come_off(support);
            return;
        }
        if self.is_even(support) {
            self.stretch(row, settings);
            return;
        }
        let near = self.may_lie_on(row, support);
        let ball = &self.balls[row];
        let (at, now) = (ball.position, ball.path.begin);
        let distance = |wall: usize| self.walls[wall].nearest(at, now).distance;
        let best = near.iter().map(|wall| (distance(*wall as usize), *wall as usize));
        let best = best.fold((f64::INFINITY, support), |x, y| if y < x { y } else { x });
        let fall = ball.pull.magnitude() * settings.dt * settings.dt;
        let rounding = ball.rounding + self.walls[best.1].rounding(at);
        let touching = best.0 - ball.radius <= REST * fall + rounding + FLUSH * ball.radius;
        if touching && self.pressure(row, best.1, now, ball.pull) > 0.0 {
            self.settle(row, best.1, settings);
        } else {
            self.balls[row].come_off(best.1);
        }
    }

    /// Tests if a wall is a half-space that turns about its normal at most.
    pub(super) fn is_even(&self, wall: usize) -> bool {
        let wall = &self.walls[wall];
        let Form::Plane { normal, .. } = wall.form else { return false };
        wall.going(0.0).is_none_or(|(motion, _)| {
            motion.angular_velocity.cross(normal).magnitude()
                <= 1e-12 * motion.angular_velocity.magnitude()
        })
    }

    /// With what force over its mass a wall keeps a ball on it that has this acceleration
    /// otherwise, at a time of its path, in m/s²; below zero, it comes off.
    pub(super) fn pressure(&self, row: usize, wall: usize, time: f64, pull: Vec3<f64>) -> f64 {
        let mut ball = self.balls[row];
        let near = [wall as u32];
        let ground = Ground { pull, ..ground(&self.walls, &near, &ball, 0.0) };
        ball.position = ball.position_at(time);
        ball.velocity = ball.velocity_at(time);
        ball.path.begin = time;
        ground.touch(&State::of(&ball)).map_or(0.0, |touch| touch.pressure)
    }

    /// Finds out how a ball moves on that lies on a wall.
    pub(super) fn stretch(&mut self, row: usize, settings: &Settings) {
        let Some(support) = self.balls[row].path.support else { return };
        settings.count(self.looks_at_walls(row));
        let even = self.is_even(support);
        let near = if even { vec![support as u32] } else { self.may_lie_on(row, support) };
        let Self { balls, walls, .. } = self;
        let shortest = shortest_step(balls[row].path.steps, settings.dt);
        balls[row].path.steps += u32::from(!even);
        let ground = ground(walls, &near, &balls[row], shortest);
        let state = State::of(&balls[row]);
        balls[row].path.stamp += 1;
        if even || ground.is_flat(&state) {
            Self::go_straight(&ground, &mut balls[row], support, even, settings);
        } else if !Self::go_round(&ground, &mut balls[row], settings) {
            balls[row].come_off(support);
        }
        settings.count(ground.looks.get());
    }

    /// The walls that a ball may be on soon, besides the one that it is on: those that are
    /// near and not in front of it. (What is in front, it hits.)
    fn may_lie_on(&self, row: usize, support: usize) -> Vec<u32> {
        let ball = &self.balls[row];
        let (at, now) = (ball.position, ball.path.begin);
        let far = ball.radius * (1.0 + 2.0 * LOOK) + ball.rounding;
        let PointProjection { point, normal, .. } = self.walls[support].nearest(at, now);
        let mut near = vec![support as u32];
        self.name_walls(row, |wall| {
            if wall == support || self.walls[wall].at_least(at, now) > far {
                return;
            }
            let its = self.walls[wall].nearest(at, now);
            let apart = its.point - point;
            let in_front = apart.dot(normal) > IN_FRONT * apart.magnitude() + ball.rounding;
            if its.distance <= far && !in_front {
                near.push(wall as u32);
            }
        });
        near
    }

    /// On what is flat it is known in closed form.
    fn go_straight(
        ground: &Ground,
        ball: &mut Ball,
        support: usize,
        even: bool,
        settings: &Settings,
    ) {
        let (wall, now) = (&ground.walls[support], ball.path.begin);
        let normal = wall.nearest(ball.position, now).normal;
        let material = wall.against(ball.material);
        let pressure = -ball.pull.dot(normal);
        let touch = ball.position - normal * ball.radius;
        let along = Support {
            normal,
            surface: wall.surface_velocity(normal, touch, now),
            turning: wall.motion.map_or_else(Vec3::zero, |motion| motion.angular_velocity),
            pull: ball.pull + normal * pressure,
            pressure,
            radius: ball.radius,
            friction: material.friction,
            rolling_resistance: material.rolling_resistance,
            spinning_resistance: material.spinning_resistance,
            spins: ball.spins == BallSpin::Free,
        };
        let stretch = along.stretch(ball.velocity, ball.spin, settings.dt);
        ball.velocity += stretch.velocity_change;
        ball.spin += stretch.spin_change;
        ball.path.acceleration = stretch.acceleration;
        ball.path.spin_acceleration = stretch.spin_acceleration;
        let mut duration = stretch.duration;
        if !even {
            // Before it is far, it must be seen whether what it lies on goes on like this.
            let over = (ball.velocity - wall.way(ball.position, now)).magnitude();
            let far = LOOK * ball.radius;
            let look = (far / over).min((far / stretch.acceleration.magnitude()).sqrt());
            let shortest = ground.shortest.min(settings.dt - now);
            let look = look.max(LOOK * settings.dt).max(shortest).min(settings.dt - now);
            // A slide ends at its moment, however soon: a shortest step would turn it around, and
            // the next one back.
            let face = end_of_face(ground, ball, normal, duration.min(look));
            duration = duration.min(face.max(shortest));
        }
        let ends = now + duration;
        ball.path.change = if ends < settings.dt { ends } else { f64::INFINITY };
    }

    /// On what bends it is integrated. False if nothing presses it there.
    fn go_round(ground: &Ground, ball: &mut Ball, settings: &Settings) -> bool {
        let (start, dt) = (State::of(ball), settings.dt);
        let Some(start) = ground.settled(start) else { return false };
        let left = dt - start.time;
        if left <= 0.0 {
            return true;
        }
        let Some(step) = ground.step(&start, left) else { return false };
        (ball.velocity, ball.spin) = (start.velocity, start.spin);
        let length = step.end.time - start.time;
        if length > 0.0 {
            let way = step.end.position - start.position;
            ball.path.acceleration = (way / length - start.velocity) * (2.0 / length);
            ball.path.arrival = Some(step.end);
        }
        ball.path.leaves = step.leaves;
        let ends_before = step.leaves || step.end.time < dt;
        ball.path.change = if ends_before { step.end.time } else { f64::INFINITY };
        true
    }
}

impl Ball {
    /// Lets go of a wall that does not press it any more.
    fn come_off(&mut self, wall: usize) {
        self.release();
        self.path.off = Some(wall);
    }
}

fn ground<'a>(walls: &'a [super::Wall], near: &'a [u32], ball: &Ball, shortest: f64) -> Ground<'a> {
    let Ball { pull, radius, spins, material, .. } = *ball;
    Ground { walls, near, pull, radius, spins, material, shortest, looks: Cell::new(0) }
}

/// After which part of a time a ball that goes straight comes to the end of the face that it
/// is on, or to another one: all of it, if the face goes on.
fn end_of_face(ground: &Ground, ball: &Ball, normal: Vec3<f64>, duration: f64) -> f64 {
    let now = ball.path.begin;
    let on = |t: f64| ground.has_normal(ball.position_at(now + t), now + t, normal);
    if on(duration) {
        return duration;
    }
    let (mut lo, mut hi) = (0.0, duration);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (lo + hi);
        if on(middle) { lo = middle } else { hi = middle }
    }
    hi
}

#[cfg(test)]
mod tests {
    use super::super::{Path, Source, Wall};
    use super::*;
    use crate::math::Point3;
    use crate::response::Material;
    use crate::shape::Triangle;

    /// A large triangle, of a mesh.
    struct Face;

    impl Source for Face {
        fn planes(&self, _: &mut dyn FnMut(u32)) {}

        fn has_parts(&self) -> bool {
            true
        }

        fn near(&self, _: Point3<f64>, _: f64, name: &mut dyn FnMut(u32, u32)) {
            name(0, 0);
        }

        fn wall(&self, row: u32, _: u32) -> Option<Wall> {
            let corners = [[-9.0, 0.0, -9.0], [0.0, 0.0, 9.0], [9.0, 0.0, -9.0]].map(Point3::from);
            let form = Form::Triangle(Triangle { corners });
            let bounds = form.bounds();
            let (motion, there, material) = (None, None, None);
            Some(Wall { form, bounds, row, motion, there, material, digit: 0.0 })
        }
    }

    #[test]
    fn a_slide_on_a_face_ends_at_its_moment_and_the_ball_rolls() {
        let dt = 1.0 / 64.0;
        let mut counts = Vec::new();
        for slip in [1e-6, 1e-5, 1e-4, 1e-3] {
            let ball = Ball {
                position: Point3::new(0.0, 0.2, 0.0),
                velocity: Vec3::new(1.0 + slip, 0.0, 0.0),
                spin: Vec3::new(0.0, 0.0, -1.0 / 0.2),
                pull: Vec3::new(0.0, -9.81, 0.0),
                radius: 0.2,
                inverse_mass: 1.0,
                material: Material { friction: 0.5, ..Material::default() },
                spins: BallSpin::Free,
                rounding: 1e-15,
                turned: Vec3::zero(),
                path: Path::default(),
            };
            let mut method = EventDriven { balls: vec![ball], ..EventDriven::default() };
            let settings = Settings { dt, iterations: 8, source: &Face, looks: 0.into() };
            assert!(method.run(&settings, &mut Vec::new()).is_empty());
            let ball = &method.balls[0];
            let rim = Vec3::unit_y().cross(ball.spin) * ball.radius;
            assert!((ball.velocity + rim).magnitude() < 1e-14, "{ball:?}");
            assert!((ball.velocity.x - (1.0 + slip * 5.0 / 7.0)).abs() < 1e-12, "{ball:?}");
            counts.push(ball.path.steps);
        }
        // It looks where it is each 0.01 m, and once where it begins to roll.
        assert!(counts.iter().all(|count| *count <= 5), "{counts:?}");
    }
}
