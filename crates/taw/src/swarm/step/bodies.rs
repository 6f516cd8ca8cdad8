//! Rigid bodies within a substep: solved before contacts of balls, which then rest on what bodies leave.

use cgmath::{SquareMatrix, Zero};

use crate::body::BodySystem;
use crate::broad::CollisionLayers;
use crate::constraint::ContactSoftness;
use crate::handle::{BallId, NO_ROW};
use crate::math::{Mat3, Point3, Row, Scalar, Vec3, cast_vector, length};
use crate::motion::BALL_INVERSE_INERTIA;
use crate::response::Material;
use crate::swarm::Swarm;
use crate::swarm::kernels::{GROUNDED, SolverParams};
use crate::swarm::surfaces::SurfaceOf;
use crate::swarm::wall_contact::xyz;

/// Ball that a rigid body may touch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BallView<S> {
    pub id: BallId,
    pub slot: u32,
    pub row: usize,
    /// Center and radius, in metres.
    pub at: Row<S>,
    pub velocity: Vec3<S>,
    /// Inverse mass in 1/kg, also of one that sleeps.
    pub inverse_mass: f64,
    pub is_asleep: bool,
    pub material: Material<S>,
    /// None of a kinematic marble, which passes through bodies.
    pub layers: CollisionLayers,
}

impl<S: Scalar> BallView<S> {
    pub fn center(&self) -> Point3<f64> {
        Point3::new(self.at[0].as_f64(), self.at[1].as_f64(), self.at[2].as_f64())
    }

    pub fn radius(&self) -> f64 {
        self.at[3].as_f64()
    }
}

impl<S: Scalar> Swarm<S> {
    /// All balls.
    pub(crate) fn ball_views(&self) -> impl Iterator<Item = BallView<S>> + '_ {
        (0..self.at.len()).filter_map(|row| self.ball_of_row(row))
    }

    /// Ball in a row.
    pub(crate) fn ball_of_row(&self, row: usize) -> Option<BallView<S>> {
        let slots = self.ids.slots();
        let surfaces = SurfaceOf { model: self.model.material, surfaces: &self.surfaces, slots };
        let velocity = self.velocity.get(row)?;
        Some(BallView {
            id: self.id(row)?,
            slot: slots[row],
            row,
            at: self.at[row],
            velocity: xyz(velocity),
            inverse_mass: velocity[3].abs().as_f64(),
            is_asleep: velocity[3].is_sign_negative(),
            material: surfaces.row(row as u32).material,
            layers: surfaces.filter(row as u32).layers,
        })
    }

    /// Wakes a ball that a body may touch.
    pub(crate) fn wake_row(&mut self, row: usize) {
        self.wake(row);
    }

    /// Keeps these balls awake in the next step, and no others.
    pub(crate) fn hold_awake(&mut self, balls: impl Iterator<Item = BallId>) {
        self.sleep.held.clear();
        for ball in balls {
            let Ok(row) = self.row(ball) else { continue };
            self.sleep.held.insert(self.ids.slots()[row]);
            if self.velocity[row][3].is_sign_negative() {
                self.wake(row);
            }
        }
    }

    /// Returns true if a ball sleeps, or has rested for long enough and may.
    pub(crate) fn rests(&self, ball: BallId) -> bool {
        let Ok(row) = self.row(ball) else { return false };
        let gravity = length(self.gravity.unwrap_or_else(Vec3::zero));
        let rest = &self.sleep.rest;
        self.velocity[row][3].is_sign_negative()
            || !self.sleep.sleepless.contains(self.ids.slots()[row])
                && rest.is_at_rest(row)
                && rest.lasts(row, self.at[row][3], gravity)
    }

    /// Sets the rigid bodies of the next step.
    pub(crate) fn set_rigid_bodies(&mut self, bodies: BodySystem) {
        self.scratch.bodies = bodies;
    }

    /// Takes the rigid bodies back after the step.
    pub(crate) fn take_rigid_bodies(&mut self) -> BodySystem {
        std::mem::take(&mut self.scratch.bodies)
    }

    /// Returns true if there are rigid bodies.
    pub(in crate::swarm) fn has_bodies(&self) -> bool {
        !self.scratch.bodies.is_empty()
    }

    /// Begins a substep of the bodies.
    pub(super) fn begin_bodies(&mut self, params: &SolverParams<S>) {
        let number = S::as_f64;
        let ContactSoftness { bias_rate, max_push_speed, mass_scale, impulse_scale } =
            params.softness;
        let softness = ContactSoftness {
            bias_rate: number(bias_rate),
            max_push_speed: number(max_push_speed),
            mass_scale: number(mass_scale),
            impulse_scale: number(impulse_scale),
        };
        let (h, threshold) = (number(params.time), number(params.restitution_threshold));
        self.with_bodies(|bodies| bodies.begin_substep(h, threshold, softness));
    }

    /// Reads places and velocities of the balls that bodies may touch, does something with the bodies, and
    /// writes velocities back.
    pub(super) fn with_bodies(&mut self, action: impl FnOnce(&mut BodySystem)) {
        if !self.has_bodies() {
            return;
        }
        let mut bodies = std::mem::take(&mut self.scratch.bodies);
        let gravity = cast_vector::<S, f64>(self.gravity.unwrap_or_else(Vec3::zero));
        let rows = self.ids.rows();
        for ball in bodies.bodies.iter_mut().filter(|ball| ball.slot != NO_ROW) {
            let row = rows[ball.slot as usize] as usize;
            let at = self.at[row];
            ball.pose.translation = cast_vector(xyz(&at));
            let inverse_mass = self.velocity[row][3].as_f64();
            ball.inverse_mass = inverse_mass.max(0.0); // what sleeps stays
            let locked =
                self.surfaces.get(ball.slot).is_some_and(|surface| surface.rotation_locked);
            let radius = at[3].as_f64();
            let turns = if locked { 0.0 } else { BALL_INVERSE_INERTIA / (radius * radius) };
            ball.inverse_inertia = Mat3::from_value(ball.inverse_mass * turns);
            ball.velocity = cast_vector(xyz(&self.velocity[row]));
            ball.spin = cast_vector::<S, f64>(xyz(&self.spin[row])) / radius;
            ball.acceleration = if inverse_mass > 0.0 { gravity } else { Vec3::zero() };
            // Nor has it any speed.
            if inverse_mass < 0.0 {
                (ball.velocity, ball.spin) = (Vec3::zero(), Vec3::zero());
            }
        }
        action(&mut bodies);
        for ball in bodies.bodies.iter().filter(|ball| ball.inverse_mass > 0.0) {
            if ball.slot == NO_ROW {
                continue;
            }
            let row = rows[ball.slot as usize] as usize;
            let radius = self.at[row][3].as_f64();
            set(&mut self.velocity[row], cast_vector(ball.velocity));
            set(&mut self.spin[row], cast_vector(ball.spin * radius));
        }
        for slot in bodies.borne_balls() {
            self.spin[rows[slot as usize] as usize][3] = S::from_f64(GROUNDED);
        }
        self.scratch.bodies = bodies;
        self.hold_rows();
    }
}

/// Sets the vector of a row.
fn set<S: Scalar>(row: &mut Row<S>, Vec3 { x, y, z }: Vec3<S>) {
    *row = [x, y, z, row[3]];
}
