//! What happens to balls between two events, for those who ask.

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
        let way = (ball.velocity + ball.path.acceleration * (0.5 * dt)) * dt;
        work.forces += mass * ball.pull.dot(way);
        let pull = ball.pull * (mass * dt);
        work.momentum += pull;
        let held = ball.path.acceleration * (mass * dt) - pull;
        if ball.path.heaped {
            // Pairs cancel; what it takes is the solver's.
            work.momentum += held;
            work.walls += ball.path.power * dt;
            return;
        }
        let Some(wall) = ball.path.support else { return };
        work.momentum += held;
        let (wall, begin) = (&self.walls[wall], ball.path.begin);
        let normal = wall.nearest(ball.position, begin).normal;
        let touch = ball.position - normal * ball.radius;
        let surface = wall.surface_velocity(normal, touch, begin);
        let mut later = *ball;
        later.advance(time);
        let slip = |ball: &Ball| ball.velocity + ball.rim(normal) - surface;
        let friction = -0.5 * held.dot(slip(ball) + slip(&later));
        let inertia = match ball.spins {
            BallSpin::Free => 0.4 * mass * ball.radius * ball.radius,
            BallSpin::Ignored => 0.0,
        };
        let turned = later.turned - ball.turned;
        let all = held.dot(way) / dt + inertia * ball.path.spin_acceleration.dot(turned);
        let brought = held.dot(surface);
        work.friction += friction;
        work.walls += brought;
        work.resistance += brought - friction - all;
    }
}
