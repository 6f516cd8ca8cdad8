//! Ball with its trajectory between two events.

use cgmath::{InnerSpace, Zero};

use super::cells::Cell;
use super::curved_support::BallState;
use super::{EventSettings, MAX_FREEZES, SIMULTANEOUS};
use crate::broad::CollisionLayers;
use crate::contact::ContactMaterial;
use crate::math::{Point3, Vec3};
use crate::response::{BallRotation, Material};

/// Ball: state from the world, and its present trajectory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EventBall {
    /// Center at the start of the trajectory, in metres.
    pub position: Point3<f64>,
    /// Velocity at the start of the trajectory, in m/s.
    pub velocity: Vec3<f64>,
    /// Angular velocity at the start of the trajectory, in rad/s.
    pub spin: Vec3<f64>,
    /// Acceleration by all external forces, in m/s².
    pub external_acceleration: Vec3<f64>,
    /// Radius, in metres.
    pub radius: f64,
    /// Inverse mass, in 1/kg.
    pub inverse_mass: f64,
    pub material: Material<f64>,
    pub layers: CollisionLayers,
    /// Rotation lock: tells if friction spins it.
    pub rotation: BallRotation,
    /// Position error by rounding, in metres.
    pub position_error: f64,
    /// Rotation so far in this substep, as an axial vector in radians.
    pub rotation_increment: Vec3<f64>,
    pub trajectory: Trajectory,
}

/// Motion of a ball since its last event.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trajectory {
    /// Start time, in seconds from the start of the substep.
    pub(super) start: f64,
    pub(super) acceleration: Vec3<f64>,
    pub(super) spin_acceleration: Vec3<f64>,
    /// Wall that supports it.
    pub(super) support: Option<usize>,
    /// State at the end, where that is known more precisely than by the acceleration.
    pub(super) end_state: Option<BallState>,
    /// True if the support ends there, or curves away from under it.
    pub(super) leaves_support: bool,
    /// Wall that it has just left.
    pub(super) left_wall: Option<usize>,
    /// True if it rests in a cluster, with the acceleration of that.
    pub(super) clustered: bool,
    /// True if there are other balls in that cluster.
    pub(super) touches_balls: bool,
    /// Power supplied by walls there, in watts, for the energy audit.
    pub(super) wall_power: f64,
    /// Dissipation count: sum of the relative losses of approach speed in this substep; a whole one
    /// for a collision without time since the one before.
    pub(super) dissipation_count: f64,
    /// Time of the last collision.
    pub(super) last_collision: f64,
    /// Number of times that it was put to rest for too many collisions. Each time doubles the
    /// energy that wakes it.
    pub(super) freeze_count: i32,
    /// Number of times that it came to rest in a cluster within this substep.
    pub(super) rest_count: u32,
    /// Number of steps in this substep on curved or bounded walls.
    pub(super) support_steps: u32,
    /// Time of the next change of regime.
    pub(super) regime_end: f64,
    /// Version, incremented with each new trajectory: events predicted for another version are
    /// void.
    pub(super) version: u32,
    pub(super) cell_slot: CellSlot,
}

/// Place of a ball in the broad phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum CellSlot {
    Cell(Cell),
    Unbounded,
}

impl Default for Trajectory {
    fn default() -> Self {
        Self {
            start: 0.0,
            acceleration: Vec3::zero(),
            spin_acceleration: Vec3::zero(),
            support: None,
            end_state: None,
            leaves_support: false,
            left_wall: None,
            clustered: false,
            touches_balls: false,
            wall_power: 0.0,
            dissipation_count: 0.0,
            last_collision: f64::NEG_INFINITY,
            freeze_count: 0,
            rest_count: 0,
            support_steps: 0,
            regime_end: f64::INFINITY,
            version: 0,
            cell_slot: CellSlot::Unbounded,
        }
    }
}

impl EventBall {
    pub(super) fn position_at(&self, time: f64) -> Point3<f64> {
        let t = time - self.trajectory.start;
        self.position + (self.velocity + self.trajectory.acceleration * (0.5 * t)) * t
    }

    pub(super) fn velocity_at(&self, time: f64) -> Vec3<f64> {
        self.velocity + self.trajectory.acceleration * (time - self.trajectory.start)
    }

    /// Advances the start of its trajectory to a later time.
    pub(super) fn advance(&mut self, time: f64) {
        let t = time - self.trajectory.start;
        let start = self.position;
        self.position = self.position_at(time);
        let Some(end) = self.trajectory.end_state else {
            self.advance_free(time);
            return;
        };
        let duration = end.time - self.trajectory.start;
        let fraction = if duration > 0.0 && time < end.time { t / duration } else { 1.0 };
        // Velocity that is exact at both ends and integrates to the displacement.
        let mean = if duration > 0.0 { (end.position - start) / duration } else { end.velocity };
        let correction =
            (mean - (self.velocity + end.velocity) * 0.5) * (6.0 * fraction * (1.0 - fraction));
        let (velocity, spin) = (end.velocity - self.velocity, end.spin - self.spin);
        self.rotation_increment += (self.spin + spin * (0.5 * fraction)) * t;
        self.velocity += velocity * fraction + correction;
        self.spin += spin * fraction;
        if fraction >= 1.0 {
            (self.position, self.velocity, self.spin) = (end.position, end.velocity, end.spin);
            self.trajectory.end_state = None;
            if time > end.time {
                self.trajectory.start = end.time;
                self.position = self.position_at(time);
                self.advance_free(time);
            }
        } else if let Some(end_state) = &mut self.trajectory.end_state {
            // Remainder of the same trajectory.
            *end_state = end;
        }
        self.trajectory.start = time;
    }

    fn advance_free(&mut self, time: f64) {
        let t = time - self.trajectory.start;
        self.velocity = self.velocity_at(time);
        self.rotation_increment += (self.spin + self.trajectory.spin_acceleration * (0.5 * t)) * t;
        self.spin += self.trajectory.spin_acceleration * t;
        self.trajectory.start = time;
    }

    /// Freezes it for the rest of the substep.
    pub(super) fn freeze(&mut self) {
        self.fly_free();
        self.velocity = Vec3::zero();
        self.trajectory.acceleration = Vec3::zero();
        self.trajectory.freeze_count = self.trajectory.freeze_count.max(MAX_FREEZES);
    }

    /// True if it is frozen for the rest of the substep.
    pub(super) fn is_frozen(&self) -> bool {
        self.trajectory.freeze_count >= MAX_FREEZES
    }

    /// Starts free flight: leaves supports and clusters.
    pub(super) fn fly_free(&mut self) {
        self.trajectory = Trajectory {
            start: self.trajectory.start,
            acceleration: self.external_acceleration,
            version: self.trajectory.version + 1,
            dissipation_count: self.trajectory.dissipation_count,
            last_collision: self.trajectory.last_collision,
            freeze_count: self.trajectory.freeze_count,
            rest_count: self.trajectory.rest_count,
            support_steps: self.trajectory.support_steps,
            cell_slot: self.trajectory.cell_slot,
            ..Trajectory::default()
        };
    }

    /// Records a collision at the present time.
    pub(super) fn collide(&mut self, material: ContactMaterial<f64>, settings: &EventSettings) {
        let is_simultaneous =
            self.trajectory.start - self.trajectory.last_collision <= SIMULTANEOUS * settings.dt;
        self.trajectory.dissipation_count +=
            if is_simultaneous { 1.0 } else { 1.0 - material.restitution };
        self.trajectory.last_collision = self.trajectory.start;
    }

    /// Applies an impulse at the contact point; `normal` points from there to the center.
    pub(super) fn apply_impulse(&mut self, impulse: Vec3<f64>, normal: Vec3<f64>) {
        self.velocity += impulse * self.inverse_mass;
        let factor: f64 = self.rotation.inverse_inertia_factor();
        self.spin -= normal.cross(impulse) * (factor * self.inverse_mass / self.radius);
    }

    /// Upper bound of the speed of its surface, in m/s.
    pub(super) fn max_surface_speed(&self) -> f64 {
        let arm = if self.rotation == BallRotation::Free { self.radius } else { 0.0 };
        self.velocity.magnitude() + self.spin.magnitude() * arm
    }

    /// Velocity of the contact point by spin alone; `normal` points from there to the center.
    pub(super) fn spin_velocity(&self, normal: Vec3<f64>) -> Vec3<f64> {
        match self.rotation {
            BallRotation::Free => normal.cross(self.spin) * self.radius,
            BallRotation::Locked => Vec3::zero(),
        }
    }
}
