//! Account of what happens to balls between two events, for those who ask.

use cgmath::InnerSpace;

use super::{Ball, EventDriven};
use crate::response::{BallSpin, Work};

impl EventDriven {
    /// Lets a ball's path begin at a later time.
    pub(super) fn advance(&mut self, row: usize, time: f64) {
        if let Some(mut work) = self.work.take() {
            self.count_way(&self.balls[row], time, &mut work);
            self.work = Some(work);
        }
        self.balls[row].advance(time);
    }

    /// Counts what forces, and the wall that it lies on, do to a ball until then.
    fn count_way(&self, ball: &Ball, time: f64, work: &mut Work) {
        let dt = time - ball.path.begin;
        if dt <= 0.0 || ball.inverse_mass == 0.0 {
            return;
        }
        let mass = 1.0 / ball.inverse_mass;
        let mut later = *ball;
        later.advance(time);
        let bends = ball.path.arrival.is_some();
        let way = if bends {
            later.position - ball.position
        } else {
            (ball.velocity + ball.path.acceleration * (0.5 * dt)) * dt
        };
        work.forces += mass * ball.pull.dot(way);
        let pull = ball.pull * (mass * dt);
        work.momentum += pull;
        let change =
            if bends { later.velocity - ball.velocity } else { ball.path.acceleration * dt };
        let held = change * mass - pull;
        if ball.path.heaped {
            // Pairs cancel; what it takes is the solver's.
            work.momentum += held;
            work.walls += ball.path.power * dt;
            return;
        }
        let Some(wall) = ball.path.support else { return };
        work.momentum += held;
        let wall = &self.walls[wall];
        // The velocity of the surface below it, and its own over that.
        let over = |ball: &Ball| {
            let normal = wall.nearest(ball.position, ball.path.begin).normal;
            let touch = ball.position - normal * ball.radius;
            let surface = wall.surface_velocity(normal, touch, ball.path.begin);
            (surface, ball.velocity + ball.rim(normal) - surface)
        };
        let [(surface, slip), (its, later_slip)] = [over(ball), over(&later)];
        let surface = (surface + its) * 0.5;
        let friction = -0.5 * held.dot(slip + later_slip);
        let inertia = match ball.spins {
            BallSpin::Free => 0.4 * mass * ball.radius * ball.radius,
            BallSpin::Ignored => 0.0,
        };
        let turned = later.turned - ball.turned;
        let all = if bends {
            let energy = |ball: &Ball| {
                0.5 * (mass * ball.velocity.magnitude2() + inertia * ball.spin.magnitude2())
            };
            energy(&later) - energy(ball) - mass * ball.pull.dot(way)
        } else {
            held.dot(way) / dt + inertia * ball.path.spin_acceleration.dot(turned)
        };
        let brought = held.dot(surface);
        work.friction += friction;
        work.walls += brought;
        work.resistance += brought - friction - all;
    }
}
