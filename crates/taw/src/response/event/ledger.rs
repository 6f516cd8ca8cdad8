//! Energy bookkeeping of balls between two events.

use cgmath::InnerSpace;

use super::{EventBall, EventSolver, Wall};
use crate::math::Vec3;
use crate::response::{BallRotation, EnergyLedger};
use crate::shape::BALL_INERTIA;

impl EventSolver {
    /// Advances a ball's trajectory, and books the energy of the motion.
    pub(super) fn advance(&mut self, row: usize, time: f64) {
        if let Some(mut work) = self.work.take() {
            self.record_motion(&self.balls[row], time, &mut work);
            self.work = Some(work);
        }
        self.balls[row].advance(time);
    }

    /// Books the work of forces and of the supporting wall up to a time.
    fn record_motion(&self, ball: &EventBall, time: f64, work: &mut EnergyLedger) {
        let dt = time - ball.trajectory.start;
        if dt <= 0.0 || ball.inverse_mass == 0.0 {
            return;
        }
        let mass = 1.0 / ball.inverse_mass;
        let mut later = *ball;
        later.advance(time);
        let is_curved = ball.trajectory.end_state.is_some();
        let displacement = if is_curved {
            later.position - ball.position
        } else {
            (ball.velocity + ball.trajectory.acceleration * (0.5 * dt)) * dt
        };
        work.forces += mass * ball.external_acceleration.dot(displacement);
        let impulse = ball.external_acceleration * (mass * dt);
        work.momentum += impulse;
        let velocity_change = if is_curved {
            later.velocity - ball.velocity
        } else {
            ball.trajectory.acceleration * dt
        };
        let constraint_impulse = velocity_change * mass - impulse;
        if ball.trajectory.clustered {
            // Pair forces cancel; the solver knows the dissipation.
            work.momentum += constraint_impulse;
            work.walls += ball.trajectory.wall_power * dt;
            return;
        }
        let Some(wall) = ball.trajectory.support else { return };
        work.momentum += constraint_impulse;
        let [(surface, slip), (later_surface, later_slip)] =
            [ball, &later].map(|ball| surface_and_slip(ball, &self.walls[wall]));
        let surface = (surface + later_surface) * 0.5;
        let friction = -0.5 * constraint_impulse.dot(slip + later_slip);
        let inertia = match ball.rotation {
            BallRotation::Free => BALL_INERTIA * mass * ball.radius * ball.radius,
            BallRotation::Locked => 0.0,
        };
        let rotation = later.rotation_increment - ball.rotation_increment;
        let ball_work = if is_curved {
            let energy = |ball: &EventBall| {
                0.5 * (mass * ball.velocity.magnitude2() + inertia * ball.spin.magnitude2())
            };
            energy(&later) - energy(ball) - mass * ball.external_acceleration.dot(displacement)
        } else {
            constraint_impulse.dot(displacement) / dt
                + inertia * ball.trajectory.spin_acceleration.dot(rotation)
        };
        let wall_work = constraint_impulse.dot(surface);
        work.friction += friction;
        work.walls += wall_work;
        work.resistance += wall_work - friction - ball_work;
    }
}

/// Velocity of the surface at the contact point, and slip over it.
fn surface_and_slip(ball: &EventBall, wall: &Wall) -> (Vec3<f64>, Vec3<f64>) {
    let normal = wall.nearest(ball.position, ball.trajectory.start).normal;
    let contact_point = ball.position - normal * ball.radius;
    let surface = wall.surface_velocity(normal, contact_point, ball.trajectory.start);
    (surface, ball.velocity + ball.spin_velocity(normal) - surface)
}
