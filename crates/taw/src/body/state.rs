//! State of a body in the solver.

use cgmath::{EuclideanSpace, InnerSpace, Matrix, SquareMatrix, Zero};

use crate::frame::Pose;
use crate::handle::NO_ROW;
use crate::math::{Mat3, Point3, Quat, Scalar, Vec3, cast_vector, is_finite};
use crate::motion::{FreeRotation, WallMotion, integrate_rotation};
use crate::shape::MassProperties;

/// Body as the solver sees it: a rigid body, a ball of the swarm, or a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SolverBody {
    /// Slot of a ball; [`NO_ROW`] of what is none.
    pub slot: u32,
    /// Inverse mass in 1/kg; zero for what no contact moves.
    pub inverse_mass: f64,
    /// Inverse inertia tensor in the world, in 1/(kg m²).
    pub inverse_inertia: Mat3<f64>,
    /// Center of mass, and rotation of the principal axes.
    pub pose: Pose<f64>,
    /// Velocity in m/s, and angular velocity in rad/s.
    pub velocity: Vec3<f64>,
    pub spin: Vec3<f64>,
    /// Principal moments of inertia in kg m²; zero of a ball and of infinite mass.
    pub moments: Vec3<f64>,
    /// Angular momentum along the principal axes, in kg m²/s, while no contact has changed it.
    pub momentum: Option<Vec3<f64>>,
    /// Velocity by gravity and forces in a second; damping in 1/s.
    pub acceleration: Vec3<f64>,
    pub damping: [f64; 2],
    /// True for what moves by its velocity: no surface that only drags what lies on it.
    pub moves: bool,
}

impl SolverBody {
    /// Body of these properties, whose principal axes are those of its pose.
    pub fn rigid(properties: Option<&MassProperties<f64>>, pose: Pose<f64>) -> Self {
        let (inverse_mass, moments) =
            properties.map_or((0.0, Vec3::zero()), |of| (1.0 / of.mass, of.inertia));
        let mut body = Self {
            slot: NO_ROW,
            inverse_mass,
            inverse_inertia: Mat3::zero(),
            pose,
            velocity: Vec3::zero(),
            spin: Vec3::zero(),
            moments,
            momentum: None,
            acceleration: Vec3::zero(),
            damping: [0.0; 2],
            moves: true,
        };
        body.turn_inertia();
        body
    }

    /// Wall `time` seconds before the end of its way.
    pub fn wall(motion: Option<WallMotion<f64>>, moves: bool, time: f64) -> Self {
        let mut body = Self::rigid(None, Pose::identity());
        if let Some(motion) = motion {
            let pivot = motion.pivot.to_vec();
            let before = if moves { time } else { 0.0 };
            body.pose.translation = pivot - motion.velocity * before;
            (body.velocity, body.spin) = (motion.velocity, motion.angular_velocity);
        }
        body.moves = moves;
        body
    }

    /// This body as one that nothing moves.
    pub fn at_rest(&self) -> Self {
        Self { moves: false, ..Self::rigid(None, self.pose) }
    }

    /// Takes its speed away.
    pub fn stop(&mut self) {
        (self.velocity, self.spin, self.momentum) = (Vec3::zero(), Vec3::zero(), None);
    }

    /// Ball of the swarm.
    pub fn ball(slot: u32) -> Self {
        Self { slot, moves: false, ..Self::rigid(None, Pose::identity()) }
    }

    /// Places it.
    pub fn set_pose(&mut self, pose: Pose<f64>) {
        self.pose = pose;
        self.momentum = None;
        self.turn_inertia();
    }

    /// Turns the inertia tensor with the body.
    fn turn_inertia(&mut self) {
        if self.moments.is_zero() {
            return;
        }
        let axes = Mat3::from(self.pose.rotation);
        let inverse = self.moments.map(|moment| 1.0 / moment);
        self.inverse_inertia = axes * Mat3::from_diagonal(inverse) * axes.transpose();
    }

    /// Velocity of its material at a point at this arm from the center.
    #[inline]
    pub fn velocity_at(&self, arm: Vec3<f64>) -> Vec3<f64> {
        self.velocity + self.spin.cross(arm)
    }

    /// Applies an impulse in N s at an arm from the center.
    #[inline]
    pub fn apply(&mut self, impulse: Vec3<f64>, arm: Vec3<f64>) {
        self.velocity += impulse * self.inverse_mass;
        self.turn(arm.cross(impulse));
    }

    /// Applies an angular impulse in N m s.
    #[inline]
    pub fn turn(&mut self, impulse: Vec3<f64>) {
        self.spin += self.inverse_inertia * impulse;
        if !impulse.is_zero() {
            self.momentum = None;
        }
    }

    /// Sets velocities that a joint wants; none of infinite mass.
    pub fn set_velocities(&mut self, velocity: Vec3<f64>, spin: Vec3<f64>) {
        if self.inverse_mass > 0.0 {
            self.velocity = velocity;
            if spin != self.spin {
                (self.spin, self.momentum) = (spin, None);
            }
        }
    }

    /// Displacement in `h` seconds besides that by the velocity at their end: free flight is a parabola.
    pub fn fall(&self, h: f64, is_borne: bool) -> Vec3<f64> {
        if is_borne { Vec3::zero() } else { self.acceleration * (-0.5 * h * h) }
    }

    /// Changes velocities by gravity, forces and damping in `h` seconds.
    pub fn accelerate(&mut self, h: f64) {
        if self.inverse_mass == 0.0 || self.slot != NO_ROW {
            return;
        }
        self.velocity = (self.velocity + self.acceleration * h) / (1.0 + self.damping[0] * h);
        if self.damping[1] > 0.0 {
            let kept = 1.0 / (1.0 + self.damping[1] * h);
            self.spin *= kept;
            self.momentum = self.momentum.map(|momentum| momentum * kept);
        }
    }

    /// Angular momentum along its principal axes.
    pub fn body_momentum(&self) -> Vec3<f64> {
        self.momentum.unwrap_or_else(|| {
            let local = self.pose.inverse_transform_vector(self.spin);
            Vec3::new(local.x * self.moments.x, local.y * self.moments.y, local.z * self.moments.z)
        })
    }

    /// Sets its angular momentum along its principal axes, and the spin by it.
    pub fn set_body_momentum(&mut self, momentum: Vec3<f64>) {
        self.momentum = Some(momentum);
        let local =
            momentum.zip(self.moments, |l, moment| if moment > 0.0 { l / moment } else { 0.0 });
        self.spin = self.pose.transform_vector(local);
    }

    /// Moves and turns on by `h` seconds: by the mean velocity where only `acceleration` acts in
    /// free flight, which `fall` makes up for.
    pub fn advance(&mut self, h: f64, fall: Vec3<f64>) {
        if !self.moves {
            return;
        }
        self.pose.translation += self.velocity * h + fall;
        if self.moments.is_zero() {
            self.pose.rotation = integrate_rotation(self.pose.rotation, self.spin, h);
            return;
        }
        let free = FreeRotation::<f64>::new(self.pose.rotation, self.body_momentum());
        let turned = free.step(self.moments, h);
        self.pose.rotation = turned.attitude().normalize();
        self.turn_inertia();
        self.set_body_momentum(turned.momentum());
    }

    /// It some seconds later, if nothing changes its velocities.
    pub fn later(mut self, time: f64) -> Self {
        if self.moves {
            self.pose.translation += self.velocity * time;
            self.pose.rotation = integrate_rotation(self.pose.rotation, self.spin, time);
        }
        self
    }

    /// Center of mass.
    pub fn center(&self) -> Point3<f64> {
        Point3::from_vec(self.pose.translation)
    }

    /// Place of a point fixed to the body.
    pub fn place(&self, local: Vec3<f64>) -> Vec3<f64> {
        self.pose.transform_point(Point3::from_vec(local)).to_vec()
    }

    /// Kinetic energy of translation and of rotation, in J; zero of infinite mass.
    pub fn energies(&self) -> [f64; 2] {
        if self.inverse_mass == 0.0 {
            return [0.0; 2];
        }
        let local = self.pose.inverse_transform_vector(self.spin);
        [
            0.5 * self.velocity.magnitude2() / self.inverse_mass,
            0.5 * self.body_momentum().dot(local),
        ]
    }

    /// Returns true if all its numbers are finite in a scalar.
    pub fn is_finite_in<S: Scalar>(&self) -> bool {
        let Pose { rotation, translation } = self.pose;
        let are_finite = |v: Vec3<f64>| is_finite(cast_vector::<f64, S>(v));
        [translation, rotation.v, self.velocity, self.spin].into_iter().all(are_finite)
            && rotation.s.is_finite()
    }
}

/// Rotation of the principal axes `h` seconds later, of a body with these moments of inertia that turns freely.
pub(crate) fn turned_freely(
    rotation: Quat<f64>,
    spin: Vec3<f64>,
    moments: Vec3<f64>,
    h: f64,
) -> Quat<f64> {
    let local = rotation.conjugate() * spin;
    let momentum = local.zip(moments, |spin, moment| spin * moment);
    FreeRotation::<f64>::new(rotation, momentum).step(moments, h).attitude().normalize()
}
