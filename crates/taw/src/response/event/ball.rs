//! A ball on its path between two events.

use cgmath::Zero;

use super::cells::Cell;
use super::curved_support::BallState;
use super::{EventSettings, MAX_FREEZES, SIMULTANEOUS};
use crate::math::{Point3, Vec3};
use crate::response::{BallRotation, Material};

/// A ball: what the world tells of it, and how it moves just now.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ball {
    /// In metres, when its path began.
    pub position: Point3<f64>,
    /// In m/s, when its path began.
    pub velocity: Vec3<f64>,
    /// In rad/s, when its path began.
    pub spin: Vec3<f64>,
    /// The acceleration by all forces, in m/s².
    pub external_acceleration: Vec3<f64>,
    /// In metres.
    pub radius: f64,
    /// In 1/kg.
    pub inverse_mass: f64,
    pub material: Material<f64>,
    /// Tells if friction sets it spinning.
    pub rotation: BallRotation,
    /// Part of a gap that may be due to the rounding of the position, in metres.
    pub position_error: f64,
    /// Turn so far in this substep, as an axial vector in radians.
    pub rotation_increment: Vec3<f64>,
    pub trajectory: Trajectory,
}

/// Motion of a ball from its last event on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trajectory {
    /// When it began, in seconds from the start of the substep.
    pub(super) start: f64,
    pub(super) acceleration: Vec3<f64>,
    pub(super) spin_acceleration: Vec3<f64>,
    /// The wall that it lies on.
    pub(super) support: Option<usize>,
    /// Where it is when its path changes by itself, if that is known better than by the
    /// acceleration.
    pub(super) end_state: Option<BallState>,
    /// True if what it lies on ends there, or bends away from under it.
    pub(super) leaves_support: bool,
    /// The wall that it has just come off.
    pub(super) left_wall: Option<usize>,
    /// True if its acceleration holds it in a heap.
    pub(super) clustered: bool,
    /// True if other balls are in that heap.
    pub(super) touches_balls: bool,
    /// Power that walls bring in there, in watts, for those who ask.
    pub(super) wall_power: f64,
    /// Loss by the collisions of this substep, in parts of their approach; all of
    /// it where no time went by since the one before.
    pub(super) dissipation_count: f64,
    /// When the last one was.
    pub(super) last_collision: f64,
    /// Number of times that it was brought to rest because it had too many. Each time it takes twice
    /// the energy to wake it.
    pub(super) freeze_count: i32,
    /// Number of steps in this substep over what is no half-space.
    pub(super) support_steps: u32,
    /// When its acceleration changes by itself.
    pub(super) regime_end: f64,
    /// Counts its paths, so that what was foreseen of an old one is known to be void.
    pub(super) version: u32,
    pub(super) cell_slot: CellSlot,
}

/// Where others find a ball.
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
            support_steps: 0,
            regime_end: f64::INFINITY,
            version: 0,
            cell_slot: CellSlot::Unbounded,
        }
    }
}

impl Ball {
    pub(super) fn position_at(&self, time: f64) -> Point3<f64> {
        let t = time - self.trajectory.start;
        self.position + (self.velocity + self.trajectory.acceleration * (0.5 * t)) * t
    }

    pub(super) fn velocity_at(&self, time: f64) -> Vec3<f64> {
        self.velocity + self.trajectory.acceleration * (time - self.trajectory.start)
    }

    /// Lets its path begin at a later time.
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
        // A velocity that is right at both ends and leads from place to place.
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
            // The rest of the same path.
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

    /// Lets it stay where it is for the rest of the substep.
    pub(super) fn freeze(&mut self) {
        self.fly_free();
        self.velocity = Vec3::zero();
        self.trajectory.acceleration = Vec3::zero();
        self.trajectory.freeze_count = self.trajectory.freeze_count.max(MAX_FREEZES);
    }

    /// True if it stays where it is for the rest of the substep.
    pub(super) fn is_frozen(&self) -> bool {
        self.trajectory.freeze_count >= MAX_FREEZES
    }

    /// Lets go of whatever held it.
    pub(super) fn fly_free(&mut self) {
        self.trajectory = Trajectory {
            start: self.trajectory.start,
            acceleration: self.external_acceleration,
            version: self.trajectory.version + 1,
            dissipation_count: self.trajectory.dissipation_count,
            last_collision: self.trajectory.last_collision,
            freeze_count: self.trajectory.freeze_count,
            support_steps: self.trajectory.support_steps,
            cell_slot: self.trajectory.cell_slot,
            ..Trajectory::default()
        };
    }

    /// Notes a collision, now.
    pub(super) fn collide(&mut self, material: Material<f64>, settings: &EventSettings) {
        let is_simultaneous =
            self.trajectory.start - self.trajectory.last_collision <= SIMULTANEOUS * settings.dt;
        self.trajectory.dissipation_count +=
            if is_simultaneous { 1.0 } else { 1.0 - material.restitution };
        self.trajectory.last_collision = self.trajectory.start;
    }

    /// Applies an impulse at the point where `normal` comes from to the center.
    pub(super) fn apply_impulse(&mut self, impulse: Vec3<f64>, normal: Vec3<f64>) {
        self.velocity += impulse * self.inverse_mass;
        let factor: f64 = self.rotation.inverse_inertia_factor();
        self.spin -= normal.cross(impulse) * (factor * self.inverse_mass / self.radius);
    }

    /// The velocity of its point toward `-normal` by its spin alone.
    pub(super) fn spin_velocity(&self, normal: Vec3<f64>) -> Vec3<f64> {
        match self.rotation {
            BallRotation::Free => normal.cross(self.spin) * self.radius,
            BallRotation::Locked => Vec3::zero(),
        }
    }
}
