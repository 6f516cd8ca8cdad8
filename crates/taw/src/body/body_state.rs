//! State of a body of a world.

use std::sync::Arc;

use cgmath::{EuclideanSpace, InnerSpace, Zero};

use super::Body;
use super::state::SolverBody;
use crate::Error;
use crate::contact::{Convex, as_convex};
use crate::frame::Pose;
use crate::math::{Point3, Scalar, Vec3, cast_rotation, cast_vector};
use crate::motion::rest;
use crate::shape::{Aabb3, BoundedShape, Shape};

/// State of a body.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BodyState<S> {
    /// As it was set.
    pub body: Body<S>,
    /// Its principal axes in its frame.
    pub principal: Pose<f64>,
    /// Its convex parts along its principal axes, about its center of mass.
    pub parts: Arc<[Shape<f64>]>,
    pub solver: SolverBody,
    /// Distance of its surface from its center of mass, at most, in metres.
    pub reach: f64,
    /// Force in N and torque in N m in the next step.
    pub force: [Vec3<f64>; 2],
    /// Time of rest in seconds, or another of the values of [`rest::time_of_rest`].
    pub rest: f64,
    /// Pose and speed in m/s with which it began to rest.
    pub rest_pose: Pose<f64>,
    pub rest_speed: f64,
    pub asleep: bool,
    /// Box about it while it sleeps.
    asleep_in: Option<Aabb3<f64>>,
}

impl<S: Scalar> BodyState<S> {
    pub fn new(body: Body<S>) -> Result<Self, Error> {
        let properties = body.mass_properties()?.map(|properties| properties.cast::<f64>());
        let shape = body.shape.cast::<f64>();
        let principal = properties.map_or_else(
            || Pose { translation: center_of(&shape), ..Pose::identity() },
            |of| Pose { rotation: of.axes, translation: of.center.to_vec() },
        );
        let shape = shape.transformed(principal.inverse());
        let parts: Arc<[_]> = match shape {
            Shape::Compound(compound) => compound.parts().iter().cloned().collect(),
            simple => [simple].into_iter().collect(),
        };
        let solver = SolverBody::rigid(properties.as_ref(), Pose::identity());
        let reach = parts.iter().map(reach_of).fold(0.0, f64::max);
        let mut state = Self {
            principal,
            parts,
            solver,
            reach,
            force: [Vec3::zero(); 2],
            rest: rest::MOVES,
            rest_pose: Pose::identity(),
            rest_speed: 0.0,
            asleep: false,
            asleep_in: None,
            body,
        };
        state.set_pose(Pose {
            rotation: cast_rotation(state.body.rotation),
            translation: cast_vector(state.body.position.to_vec()),
        });
        state.solver.velocity = cast_vector(state.body.velocity);
        state.solver.spin = cast_vector(state.body.angular_velocity);
        Ok(state)
    }

    /// Places its frame.
    pub fn set_pose(&mut self, frame: Pose<f64>) {
        let frame = Pose { rotation: frame.rotation.normalize(), ..frame };
        self.solver.set_pose(frame * self.principal);
    }

    /// Pose of its frame.
    pub fn pose(&self) -> Pose<f64> {
        self.solver.pose * self.principal.inverse()
    }

    /// Its convex part in the world.
    pub fn part(&self, part: usize) -> Shape<f64> {
        self.parts[part].transformed(self.solver.pose)
    }

    /// Box about it in the world.
    pub fn bounds(&self) -> Aabb3<f64> {
        if let Some(bounds) = self.asleep_in {
            return bounds;
        }
        let boxes = (0..self.parts.len()).map(|part| self.part(part).bounding_box());
        let center = Aabb3 { min: self.solver.center(), max: self.solver.center() };
        boxes.reduce(|all, next| all.union(&next)).unwrap_or(center)
    }

    /// It in the solver: as an obstacle while it sleeps.
    pub fn in_solver(&self) -> SolverBody {
        if self.asleep { self.solver.at_rest() } else { self.solver }
    }

    /// True if contacts and gravity move it.
    pub fn is_dynamic(&self) -> bool {
        self.solver.inverse_mass > 0.0
    }

    /// True if it moves by nothing: it sleeps, or is a kinematic body without a velocity.
    pub fn is_still(&self) -> bool {
        self.asleep || !self.is_dynamic() && self.speed() == 0.0
    }

    /// Wakes it.
    pub fn wake(&mut self) {
        (self.rest, self.asleep, self.asleep_in) = (rest::MOVES, false, None);
    }

    /// Speed of its surface, at most, in m/s.
    pub fn speed(&self) -> f64 {
        self.solver.velocity.magnitude() + self.solver.spin.magnitude() * self.reach
    }

    /// Lets `dt` seconds of rest pass under this gravity, in m/s². `lies` says if it lies on something that is no
    /// drive: a box on a slow conveyor does not rest.
    pub fn pass_rest(&mut self, gravity: f64, lies: bool, dt: f64) {
        let turn = self.rest_pose.rotation.conjugate() * self.solver.pose.rotation;
        let way = (self.solver.pose.translation - self.rest_pose.translation).magnitude()
            + 2.0 * turn.v.magnitude() * self.reach;
        let (speed, pull) = (self.speed(), gravity * self.body.gravity_scale.as_f64().abs());
        let rests = lies && rest::is_slow(speed * speed, pull, self.reach);
        let mut place = [0.0, 0.0, 0.0, self.rest_speed];
        let at = [way, 0.0, 0.0, self.reach];
        self.rest = rest::time_of_rest((&mut place, self.rest), &at, speed * speed, rests, dt);
        if self.rest == rest::LEFT {
            self.rest_pose = self.solver.pose;
        }
        self.rest_speed = place[3];
    }

    /// Returns true if it has rested for long enough to sleep under this gravity, in m/s².
    pub fn may_sleep(&self, gravity: f64) -> bool {
        rest::lasts(self.rest, self.reach, gravity * self.body.gravity_scale.as_f64().abs())
    }

    /// Falls asleep.
    pub fn fall_asleep(&mut self) {
        (self.asleep, self.asleep_in) = (true, Some(self.bounds()));
        self.solver.stop();
    }

    /// Body as it is now.
    pub fn now(&self) -> Body<S> {
        let pose = self.pose();
        Body {
            position: Point3::from_vec(cast_vector(pose.translation)),
            rotation: cast_rotation(pose.rotation),
            velocity: cast_vector(self.solver.velocity),
            angular_velocity: cast_vector(self.solver.spin),
            ..self.body.clone()
        }
    }
}

/// Center of the bounding box of a shape.
fn center_of(shape: &Shape<f64>) -> Vec3<f64> {
    shape.bounding_box().center().to_vec()
}

/// Distance from the origin of a convex shape, at most.
fn reach_of(shape: &Shape<f64>) -> f64 {
    if let Some(ball) = as_convex(shape).and_then(Convex::as_sphere) {
        return ball.center.to_vec().magnitude() + ball.radius;
    }
    shape.bounding_box().farthest_distance(Point3::origin())
}
