//! Bodies and rows while joints are solved.

use cgmath::{InnerSpace, Matrix, SquareMatrix, Zero};

use super::rows::{RowGeometry, RowRule};
use crate::body::turned_freely;
use crate::frame::Pose;
use crate::math::{Mat3, Vec3};
use crate::motion::{LockedAxes, integrate_rotation};

/// Largest error that a substep removes, in units of the smaller radius, and in rad.
const MAX_CORRECTION: f64 = 1.0;

/// Owner of an end of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum JointOwner {
    /// Place in the world.
    Place,
    /// Ball, by its slot.
    Ball(u32),
    /// Rigid body, by its index in the solver.
    Rigid(u32),
}

/// Body while joints are solved.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointBody {
    pub owner: JointOwner,
    /// Inverse mass in 1/kg, and inverse principal moments of inertia in 1/(kg m²); zero for what nothing moves or
    /// turns.
    pub inverse_mass: f64,
    pub inverse_moments: Vec3<f64>,
    /// Axes of the world that it neither moves along nor turns about.
    pub locked_axes: LockedAxes,
    /// Center of mass, and rotation of the principal axes.
    pub pose: Pose<f64>,
    /// Velocity in m/s, and angular velocity in rad/s.
    pub velocity: Vec3<f64>,
    pub spin: Vec3<f64>,
    /// Displacement in the substep besides that by the velocity, in metres.
    pub fall: Vec3<f64>,
    /// Radius in metres; infinite for a place.
    pub radius: f64,
    /// Inverse inertia by which this pass solves.
    pub inverse: InverseInertia,
}

/// Inverse mass, inverse principal moments of inertia, and their tensor in the world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InverseInertia {
    pub mass: f64,
    pub moments: Vec3<f64>,
    pub tensor: Mat3<f64>,
}

impl InverseInertia {
    /// Largest inverse moment.
    pub fn largest_moment(&self) -> f64 {
        largest(self.moments)
    }
}

/// Largest component of a vector.
fn largest(v: Vec3<f64>) -> f64 {
    v.x.max(v.y).max(v.z)
}

/// Row while it is solved.
#[derive(Clone, Copy, Debug)]
pub(super) struct JointRow {
    pub bodies: [u32; 2],
    pub geometry: RowGeometry,
    /// Impulses accumulated in the substep: by positions, and by velocities at its end.
    pub impulse: f64,
    pub relaxation: f64,
    /// True while it is an equation, false while its impulse stays.
    pub active: bool,
}

impl JointBody {
    /// Place in the world that does not move.
    pub fn place(pose: Pose<f64>) -> Self {
        Self {
            owner: JointOwner::Place,
            inverse_mass: 0.0,
            inverse_moments: Vec3::zero(),
            locked_axes: LockedAxes::NONE,
            pose,
            velocity: Vec3::zero(),
            spin: Vec3::zero(),
            fall: Vec3::zero(),
            radius: f64::INFINITY,
            inverse: InverseInertia { mass: 0.0, moments: Vec3::zero(), tensor: Mat3::zero() },
        }
    }

    /// Returns true for a place in the world.
    pub fn is_place(&self) -> bool {
        self.owner == JointOwner::Place
    }

    /// Returns true if all its moments are one, as a ball's.
    fn is_round(&self) -> bool {
        let Vec3 { x, y, z } = self.inverse_moments;
        x == y && y == z
    }

    /// Largest inverse moment of inertia; zero for what does not turn.
    pub fn largest_moment(&self) -> f64 {
        largest(self.inverse_moments)
    }

    /// Sets the inertia by which a pass solves: at least this mass in kg and this moment in kg m².
    pub fn set_inertia(&mut self, [mass, inertia]: [f64; 2]) {
        let moments = self.inverse_moments.map(|inverse| inverse.min(1.0 / inertia));
        let tensor = if self.is_round() {
            Mat3::from_value(moments.x)
        } else {
            let axes = Mat3::from(self.pose.rotation);
            axes * Mat3::from_diagonal(moments) * axes.transpose()
        };
        let mass = self.inverse_mass.min(1.0 / mass);
        self.inverse = InverseInertia { mass, moments, tensor };
    }

    /// Part of its inertia that only forces need; NaN for what does not turn.
    pub fn excess_inertia(&self) -> f64 {
        let excess = self.inverse.moments.zip(self.inverse_moments, |now, own| 1.0 - now / own);
        excess.x.max(excess.y).max(excess.z)
    }

    /// Pose at the end of a substep of `h` seconds.
    pub fn pose_after(&self, h: f64) -> Pose<f64> {
        let translation = self.pose.translation + self.velocity * h + self.fall;
        let rotation = if self.is_round() {
            integrate_rotation(self.pose.rotation, self.spin, h)
        } else {
            let moments = self.inverse_moments.map(|inverse| 1.0 / inverse);
            turned_freely(self.pose.rotation, self.spin, moments, h)
        };
        Pose { rotation, translation }
    }

    /// Kinetic energy, in J.
    pub fn energy(&self) -> f64 {
        let of = |squared: f64, inverse: f64| if inverse > 0.0 { squared / inverse } else { 0.0 };
        let moving = of(self.velocity.magnitude2(), self.inverse_mass);
        if self.is_round() {
            return (moving + of(self.spin.magnitude2(), self.inverse_moments.x)) * 0.5;
        }
        let spin = self.pose.inverse_transform_vector(self.spin);
        let turning = (0..3).map(|axis| of(spin[axis] * spin[axis], self.inverse_moments[axis]));
        (moving + turning.sum::<f64>()) * 0.5
    }

    /// Displacement of its center in a substep of `h` seconds, and angle by which it turns.
    pub fn motion(&self, h: f64) -> [Vec3<f64>; 2] {
        [self.velocity * h + self.fall, self.spin * h]
    }

    pub fn apply(&mut self, linear: Vec3<f64>, angular: Vec3<f64>) {
        let turn = self.inverse.tensor * angular;
        self.velocity += self.locked_axes.free_translation(linear * self.inverse.mass);
        self.spin += self.locked_axes.free_rotation(turn);
    }
}

impl JointRow {
    /// Jacobian of an end: of its velocity, and of its angular velocity.
    pub fn jacobian(&self, end: usize) -> [Vec3<f64>; 2] {
        let RowGeometry { linear, angular, .. } = self.geometry;
        [if end == 0 { -linear } else { linear }, angular[end]]
    }

    /// Rate of its error, in m/s or rad/s.
    pub fn speed(&self, bodies: &[JointBody]) -> f64 {
        self.change(bodies, |body| [body.velocity, body.spin])
    }

    /// Change of its error to first order, given that of a body's center and the angle by which it turns.
    pub fn change(&self, bodies: &[JointBody], of: impl Fn(&JointBody) -> [Vec3<f64>; 2]) -> f64 {
        let of_end = |end: usize| {
            let [linear, angular] = self.jacobian(end);
            let [motion, turn] = of(&bodies[self.bodies[end] as usize]);
            linear.dot(motion) + angular.dot(turn)
        };
        of_end(0) + of_end(1)
    }

    /// Error that a substep removes; of a plain one, only a gap counts, which stays.
    pub fn correction(&self, bodies: &[JointBody], is_plain: bool) -> f64 {
        let of_ends = self.bodies.map(|body| bodies[body as usize].radius);
        let unit = if self.geometry.is_angle() { 1.0 } else { of_ends[0].min(of_ends[1]) };
        let most = if is_plain { 0.0 } else { unit * MAX_CORRECTION };
        match self.geometry.rule {
            RowRule::AtLeastZero => self.geometry.error.max(-most), // a gap stays
            _ => self.geometry.error.clamp(-most, most),
        }
    }

    pub fn apply(&self, impulse: f64, bodies: &mut [JointBody]) {
        for end in 0..2 {
            let [linear, angular] = self.jacobian(end);
            bodies[self.bodies[end] as usize].apply(linear * impulse, angular * impulse);
        }
    }

    /// Speed of this row per impulse of another one.
    pub fn response(&self, other: &Self, bodies: &[JointBody]) -> f64 {
        let mut sum = 0.0;
        for end in 0..2 {
            for its in (0..2).filter(|its| other.bodies[*its] == self.bodies[end]) {
                let body = &bodies[self.bodies[end] as usize];
                let ([a, b], [c, d]) = (self.jacobian(end), other.jacobian(its));
                let (c, d) =
                    (body.locked_axes.free_translation(c), body.locked_axes.free_rotation(d));
                sum += a.dot(c) * body.inverse.mass + b.dot(body.inverse.tensor * d);
            }
        }
        sum
    }

    /// Least and largest impulse in `h` seconds.
    pub fn bounds(&self, h: f64) -> [f64; 2] {
        match self.geometry.rule {
            RowRule::Zero | RowRule::Gear => [f64::NEG_INFINITY, f64::INFINITY],
            RowRule::AtLeastZero => [0.0, f64::INFINITY],
            RowRule::Speed { max, .. } | RowRule::Spring { max, .. } => [-max * h, max * h],
        }
    }

    /// Bounds of the impulse before positions move on.
    pub fn first_bounds(&self, h: f64) -> [f64; 2] {
        match self.geometry.rule {
            RowRule::Spring { spring, .. } => {
                let share = spring.step(h).share;
                self.bounds(h).map(|bound| bound * share)
            }
            _ => self.bounds(h),
        }
    }

    /// Decides if it is an equation, by its residual: not where the impulse is at a bound and would go beyond.
    pub fn update_active(&mut self, residual: f64, impulse: f64, [least, most]: [f64; 2]) -> bool {
        let stays = residual.is_nan()
            || (impulse <= least && residual >= 0.0)
            || (impulse >= most && residual <= 0.0);
        std::mem::replace(&mut self.active, !stays) == stays
    }
}
