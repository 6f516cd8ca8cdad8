//! Simultaneous collisions of balls that share others.

use cgmath::{InnerSpace, Zero};

use super::EventSolver;
use super::collide::Collision;
use crate::constraint::{ContactImpulse, FrictionCone};
use crate::contact::ContactMaterial;
use crate::math::Vec3;
use crate::response::BallRotation;
use crate::shape::BALL_INERTIA;

/// Maximum number of iterations.
const MAX_ROUNDS: u32 = 1000;
/// Relative rounding of energies, many times that of their sums.
const ROUNDING: f64 = 1e-12;

/// Velocity in m/s and spin in rad/s.
type VelocityAndSpin = [Vec3<f64>; 2];

impl EventSolver {
    /// Solves simultaneous collisions with shared balls: each keeps its own restitution and
    /// friction while all others act (Newton's law), or as much of its restitution as energy allows.
    pub(super) fn solve_simultaneous(&mut self, collisions: &mut [Collision], rows: &[usize]) {
        let initial_velocity: Vec<_> =
            collisions.iter().map(|c| self.relative_velocity(c)).collect();
        let count_shared =
            |row: usize| collisions.iter().filter(|c| c.a == row || c.b == row).count();
        let shares: Vec<_> = collisions
            .iter()
            .map(|c| 1.0 / count_shared(c.a).max(count_shared(c.b)) as f64)
            .collect();
        collisions.iter_mut().zip(shares).for_each(|(c, relaxation)| c.relaxation = relaxation);
        let before = self.motions(rows);
        self.iterate_simultaneous(collisions, rows, &initial_velocity);
        self.limit_restitution(collisions, rows, &initial_velocity, &before);
        for (c, initial_velocity) in collisions.iter().zip(initial_velocity) {
            self.record_impact(c, c.impulse.along(c.impact.normal), initial_velocity);
        }
    }

    /// Takes back as much restitution as has gained energy: with friction, where one collision turns
    /// the slip of another one around, Newton's law may (Kane and Levinson, *Dynamics: theory and
    /// applications*, 1985). Without restitution, no impulse does positive work on the velocities
    /// after it, and energy only falls. In between, no pair approaches either, and friction stays in
    /// its cone, since both conditions are convex.
    fn limit_restitution(
        &mut self,
        collisions: &mut [Collision],
        rows: &[usize],
        initial_velocity: &[Vec3<f64>],
        before: &[VelocityAndSpin],
    ) {
        let is_driven = |row: &usize| {
            let ball = &self.balls[*row];
            ball.inverse_mass == 0.0 && (!ball.velocity.is_zero() || !ball.spin.is_zero())
        };
        let elastic = self.motions(rows);
        let max_energy = self.energy_product(rows, before, before);
        let energy = self.energy_product(rows, &elastic, &elastic);
        if energy <= max_energy * (1.0 + ROUNDING) || rows.iter().any(is_driven) {
            return; // or a ball of infinite mass may have supplied it
        }
        self.set_motions(rows, before);
        let elastic_impulses: Vec<_> = collisions.iter().map(|c| c.impulse).collect();
        for c in collisions.iter_mut() {
            c.impulse = ContactImpulse::zero();
            (c.material.restitution, c.material.tangential_restitution) = (0.0, 0.0);
        }
        self.iterate_simultaneous(collisions, rows, initial_velocity);
        let inelastic = self.motions(rows);
        let combine = |first: &[VelocityAndSpin],
                       second: &[VelocityAndSpin],
                       fraction: f64|
         -> Vec<VelocityAndSpin> {
            let combine = |(a, b): (&VelocityAndSpin, &VelocityAndSpin)| {
                [a[0] + b[0] * fraction, a[1] + b[1] * fraction]
            };
            first.iter().zip(second).map(combine).collect()
        };
        // Largest fraction of the difference with which the energy is that before.
        let difference = combine(&elastic, &inelastic, -1.0);
        let square = self.energy_product(rows, &difference, &difference);
        let product = self.energy_product(rows, &inelastic, &difference);
        let lost = (max_energy - self.energy_product(rows, &inelastic, &inelastic)).max(0.0);
        let fraction = lost / (product + (product * product + square * lost).sqrt());
        let fraction = if fraction.is_finite() { fraction.clamp(0.0, 1.0) } else { 0.0 };
        self.set_motions(rows, &combine(&inelastic, &difference, fraction));
        for (c, elastic) in collisions.iter_mut().zip(elastic_impulses) {
            c.impulse.normal += (elastic.normal - c.impulse.normal) * fraction;
            c.impulse.tangent += (elastic.tangent - c.impulse.tangent) * fraction;
        }
    }

    fn motions(&self, rows: &[usize]) -> Vec<VelocityAndSpin> {
        rows.iter().map(|row| [self.balls[*row].velocity, self.balls[*row].spin]).collect()
    }

    fn set_motions(&mut self, rows: &[usize], motions: &[VelocityAndSpin]) {
        for (row, [velocity, spin]) in rows.iter().zip(motions) {
            (self.balls[*row].velocity, self.balls[*row].spin) = (*velocity, *spin);
        }
    }

    /// Product of two motions in the metric of kinetic energy, in joules: twice the energy, of one
    /// with itself.
    fn energy_product(
        &self,
        rows: &[usize],
        first: &[VelocityAndSpin],
        second: &[VelocityAndSpin],
    ) -> f64 {
        let of_ball = |(row, (a, b)): (&usize, (&VelocityAndSpin, &VelocityAndSpin))| {
            let ball = &self.balls[*row];
            let inertia = match ball.rotation {
                BallRotation::Free => BALL_INERTIA * ball.radius * ball.radius,
                BallRotation::Locked => 0.0,
            };
            let product = a[0].dot(b[0]) + inertia * a[1].dot(b[1]);
            if ball.inverse_mass > 0.0 { product / ball.inverse_mass } else { 0.0 }
        };
        rows.iter().zip(first.iter().zip(second)).map(of_ball).sum()
    }

    /// Changes velocities until each collision has its restitution and friction. Jacobi iterations,
    /// so that the result does not depend on the order.
    fn iterate_simultaneous(
        &mut self,
        collisions: &mut [Collision],
        rows: &[usize],
        initial_velocity: &[Vec3<f64>],
    ) {
        let max_speed = initial_velocity.iter().map(|v| v.magnitude()).fold(0.0, f64::max);
        for _ in 0..MAX_ROUNDS {
            let mut largest: f64 = 0.0;
            let mut changes = vec![[Vec3::zero(); 2]; rows.len()];
            let relative_velocity: Vec<_> =
                collisions.iter().map(|c| self.relative_velocity(c)).collect();
            for ((c, relative_velocity), initial_velocity) in
                collisions.iter_mut().zip(relative_velocity).zip(initial_velocity)
            {
                let normal = c.impact.normal;
                let ContactMaterial { restitution, friction, tangential_restitution, .. } =
                    c.material;
                let split = |velocity| ContactImpulse::split(velocity, normal);
                let (initial, now) = (split(*initial_velocity), split(relative_velocity));
                let target = ContactImpulse {
                    normal: restitution * (-initial.normal).max(0.0),
                    tangent: initial.tangent * -tangential_restitution,
                };
                let masses = c.inverse_effective_mass;
                let wanted = ContactImpulse {
                    normal: c.relaxation * (target.normal - now.normal) / masses.normal,
                    tangent: (target.tangent - now.tangent) * (c.relaxation / masses.tangent),
                };
                let change = c.impulse.solve(wanted, None, &FrictionCone::new(friction));
                let change = change.along(normal);
                largest = largest.max(change.magnitude() * c.inverse_effective_mass.normal);
                for (row, impulse, normal) in [(c.a, -change, -normal), (c.b, change, normal)] {
                    if let Ok(index) = rows.binary_search(&row) {
                        changes[index][0] += impulse;
                        changes[index][1] += normal.cross(impulse);
                    }
                }
            }
            for (row, [impulse, angular_impulse]) in rows.iter().zip(changes) {
                let ball = &mut self.balls[*row];
                ball.velocity += impulse * ball.inverse_mass;
                let factor: f64 = ball.rotation.inverse_inertia_factor();
                ball.spin -= angular_impulse * (factor * ball.inverse_mass / ball.radius);
            }
            if largest <= 1e-15 * max_speed {
                break;
            }
        }
    }
}
