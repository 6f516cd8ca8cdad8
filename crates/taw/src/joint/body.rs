//! Bodies and rows while joints are solved.

use cgmath::{InnerSpace, Zero};

use super::rows::{RowGeometry, RowRule};
use crate::frame::Pose;
use crate::handle::NO_ROW;
use crate::math::Vec3;
use crate::motion::{LockedAxes, integrate_rotation};

/// Largest error that a substep removes, in units of the smaller radius, and in rad.
const MAX_CORRECTION: f64 = 1.0;

/// Body while joints are solved: a ball, or a place in the world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointBody {
    /// Slot of a ball; [`NO_ROW`] for a place in the world.
    pub slot: u32,
    /// Inverse mass in 1/kg, and inverse moment of inertia in 1/(kg m²); zero for what nothing moves or turns.
    pub inverse_mass: f64,
    pub inverse_inertia: f64,
    /// Axes of the world that it neither moves along nor turns about.
    pub locked_axes: LockedAxes,
    /// Center and rotation.
    pub pose: Pose<f64>,
    /// Velocity in m/s, and angular velocity in rad/s.
    pub velocity: Vec3<f64>,
    pub spin: Vec3<f64>,
    /// Displacement in the substep besides that by the velocity, in metres.
    pub fall: Vec3<f64>,
    /// Radius in metres; infinite for a place.
    pub radius: f64,
    /// Inverse mass and inverse moment of inertia by which this pass solves.
    pub inverse: [f64; 2],
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
            slot: NO_ROW,
            inverse_mass: 0.0,
            inverse_inertia: 0.0,
            locked_axes: LockedAxes::NONE,
            pose,
            velocity: Vec3::zero(),
            spin: Vec3::zero(),
            fall: Vec3::zero(),
            radius: f64::INFINITY,
            inverse: [0.0; 2],
        }
    }

    /// Pose at the end of a substep of `h` seconds.
    pub fn pose_after(&self, h: f64) -> Pose<f64> {
        Pose {
            translation: self.pose.translation + self.velocity * h + self.fall,
            rotation: integrate_rotation(self.pose.rotation, self.spin, h),
        }
    }

    /// Kinetic energy, in J.
    pub fn energy(&self) -> f64 {
        let of = |squared: f64, inverse: f64| if inverse > 0.0 { squared / inverse } else { 0.0 };
        let moving = of(self.velocity.magnitude2(), self.inverse_mass);
        (moving + of(self.spin.magnitude2(), self.inverse_inertia)) * 0.5
    }

    /// Displacement of its center in a substep of `h` seconds, and angle by which it turns.
    pub fn motion(&self, h: f64) -> [Vec3<f64>; 2] {
        [self.velocity * h + self.fall, self.spin * h]
    }

    pub fn apply(&mut self, linear: Vec3<f64>, angular: Vec3<f64>) {
        let [mass, inertia] = self.inverse;
        self.velocity += self.locked_axes.free_translation(linear * mass);
        self.spin += self.locked_axes.free_rotation(angular * inertia);
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
                sum += a.dot(c) * body.inverse[0] + b.dot(d) * body.inverse[1];
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
