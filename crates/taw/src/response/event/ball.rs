//! A ball on its path between two events.

use cgmath::Zero;

use super::bend::State;
use super::cells::Cell;
use super::{MOST_SURRENDERS, NO_TIME, Settings};
use crate::math::{Point3, Vec3};
use crate::response::{BallSpin, Material};

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
    pub pull: Vec3<f64>,
    /// In metres.
    pub radius: f64,
    /// In 1/kg.
    pub inverse_mass: f64,
    pub material: Material<f64>,
    /// Tells if friction sets it spinning.
    pub spins: BallSpin,
    /// Part of a gap that may be due to the rounding of the position, in metres.
    pub rounding: f64,
    /// Turn so far in this substep, as an axial vector in radians.
    pub turned: Vec3<f64>,
    pub path: Path,
}

/// Motion of a ball from its last event on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Path {
    /// When it began, in seconds from the start of the substep.
    pub(super) begin: f64,
    pub(super) acceleration: Vec3<f64>,
    pub(super) spin_acceleration: Vec3<f64>,
    /// The wall that it lies on.
    pub(super) support: Option<usize>,
    /// Where it is when its path changes by itself, if that is known better than by the
    /// acceleration.
    pub(super) arrival: Option<State>,
    /// True if what it lies on ends there, or bends away from under it.
    pub(super) leaves: bool,
    /// The wall that it has just come off.
    pub(super) off: Option<usize>,
    /// True if its acceleration holds it in a heap.
    pub(super) heaped: bool,
    /// True if other balls are in that heap.
    pub(super) among: bool,
    /// Power that walls bring in there, in watts, for those who ask.
    pub(super) power: f64,
    /// Loss by the collisions of this substep, in parts of their approach; all of
    /// it where no time went by since the one before.
    pub(super) losses: f64,
    /// When the last one was.
    pub(super) collided: f64,
    /// Number of times that it was brought to rest because it had too many. Each time it takes twice
    /// the energy to wake it.
    pub(super) surrenders: i32,
    /// Number of steps in this substep over what is no half-space.
    pub(super) steps: u32,
    /// When its acceleration changes by itself.
    pub(super) change: f64,
    /// Counts its paths, so that what was foreseen of an old one is known to be void.
    pub(super) stamp: u32,
    pub(super) home: Home,
}

/// Where others find a ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Home {
    Cell(Cell),
    Anywhere,
}

impl Default for Path {
    fn default() -> Self {
        Self {
            begin: 0.0,
            acceleration: Vec3::zero(),
            spin_acceleration: Vec3::zero(),
            support: None,
            arrival: None,
            leaves: false,
            off: None,
            heaped: false,
            among: false,
            power: 0.0,
            losses: 0.0,
            collided: f64::NEG_INFINITY,
            surrenders: 0,
            steps: 0,
            change: f64::INFINITY,
            stamp: 0,
            home: Home::Anywhere,
        }
    }
}

impl Ball {
    pub(super) fn position_at(&self, time: f64) -> Point3<f64> {
        let t = time - self.path.begin;
        self.position + (self.velocity + self.path.acceleration * (0.5 * t)) * t
    }

    pub(super) fn velocity_at(&self, time: f64) -> Vec3<f64> {
        self.velocity + self.path.acceleration * (time - self.path.begin)
    }

    /// Lets its path begin at a later time.
    pub(super) fn advance(&mut self, time: f64) {
        let t = time - self.path.begin;
        let begin = self.position;
        self.position = self.position_at(time);
        let Some(end) = self.path.arrival else {
            self.go_on(time);
            return;
        };
        let whole = end.time - self.path.begin;
        let part = if whole > 0.0 && time < end.time { t / whole } else { 1.0 };
        // A velocity that is right at both ends and leads from place to place.
        let mean = if whole > 0.0 { (end.position - begin) / whole } else { end.velocity };
        let bow = (mean - (self.velocity + end.velocity) * 0.5) * (6.0 * part * (1.0 - part));
        let (velocity, spin) = (end.velocity - self.velocity, end.spin - self.spin);
        self.turned += (self.spin + spin * (0.5 * part)) * t;
        self.velocity += velocity * part + bow;
        self.spin += spin * part;
        if part >= 1.0 {
            (self.position, self.velocity, self.spin) = (end.position, end.velocity, end.spin);
            self.path.arrival = None;
            if time > end.time {
                self.path.begin = end.time;
                self.position = self.position_at(time);
                self.go_on(time);
            }
        } else if let Some(left) = &mut self.path.arrival {
            // The rest of the same path.
            *left = end;
        }
        self.path.begin = time;
    }

    fn go_on(&mut self, time: f64) {
        let t = time - self.path.begin;
        self.velocity = self.velocity_at(time);
        self.turned += (self.spin + self.path.spin_acceleration * (0.5 * t)) * t;
        self.spin += self.path.spin_acceleration * t;
        self.path.begin = time;
    }

    /// Lets it stay where it is for the rest of the substep.
    pub(super) fn freeze(&mut self) {
        self.release();
        self.velocity = Vec3::zero();
        self.path.acceleration = Vec3::zero();
        self.path.surrenders = self.path.surrenders.max(MOST_SURRENDERS);
    }

    /// True if it stays where it is for the rest of the substep.
    pub(super) fn is_frozen(&self) -> bool {
        self.path.surrenders >= MOST_SURRENDERS
    }

    /// Lets go of whatever held it.
    pub(super) fn release(&mut self) {
        self.path = Path {
            begin: self.path.begin,
            acceleration: self.pull,
            stamp: self.path.stamp + 1,
            losses: self.path.losses,
            collided: self.path.collided,
            surrenders: self.path.surrenders,
            steps: self.path.steps,
            home: self.path.home,
            ..Path::default()
        };
    }

    /// Notes a collision, now.
    pub(super) fn collide(&mut self, material: Material<f64>, settings: &Settings) {
        let at_once = self.path.begin - self.path.collided <= NO_TIME * settings.dt;
        self.path.losses += if at_once { 1.0 } else { 1.0 - material.restitution };
        self.path.collided = self.path.begin;
    }

    /// Applies an impulse at the point where `normal` comes from to the center.
    pub(super) fn hit(&mut self, impulse: Vec3<f64>, normal: Vec3<f64>) {
        self.velocity += impulse * self.inverse_mass;
        let whirl: f64 = self.spins.of_solid_ball();
        self.spin -= normal.cross(impulse) * (whirl * self.inverse_mass / self.radius);
    }

    /// The velocity of its point toward `-normal` by its spin alone.
    pub(super) fn rim(&self, normal: Vec3<f64>) -> Vec3<f64> {
        match self.spins {
            BallSpin::Free => normal.cross(self.spin) * self.radius,
            BallSpin::Ignored => Vec3::zero(),
        }
    }
}
