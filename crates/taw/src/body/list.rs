//! Bodies of a world, by handles that stay valid.

use cgmath::{EuclideanSpace, Zero};

use super::body_state::BodyState;
use super::contact::{BodyContact, BodyPartner};
use super::{Body, BodyId};
use crate::Error;
use crate::error::{finite_point, finite_vector};
use crate::frame::Pose;
use crate::handle::{BallId, Handles};
use crate::math::{Point3, Quat, Scalar, Vec3, cast_point, cast_rotation, cast_vector};
use crate::shape::{Aabb3, MassProperties};

/// Place and motion of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyPlace<S> {
    /// Origin of its frame, in metres.
    pub position: Point3<S>,
    /// Rotation of its frame.
    pub rotation: Quat<S>,
    /// Velocity of its center of mass, in m/s.
    pub velocity: Vec3<S>,
    /// Angular velocity, in rad/s.
    pub angular_velocity: Vec3<S>,
    /// True if it sleeps.
    pub is_asleep: bool,
}

/// Rigid bodies of a world, which only [`SoftStep`](crate::response::Response::SoftStep) knows: other responses refuse
/// to step a world that has some.
///
/// Bodies collide with each other, with walls, with marbles and with the balls of the swarm. They are solved on one
/// thread. [Queries](crate::world::Queries) and [sensors](crate::world::Sensors) find them. Force fields, speed limits
/// and the energy audit leave them out. A body that is ten times as heavy as one below it sinks in by less than a
/// hundredth of its size, a hundred times as heavy by 7 %, and heavier ones go through.
///
/// ```
/// use taw::body::Body;
/// use taw::prelude::*;
///
/// # fn main() -> Result<(), taw::Error> {
/// let mut world = World::<f32>::default();
/// world.set_model(Model::GAME)?;
/// world.set_gravity(Vec3::new(0.0, -9.81, 0.0))?;
/// world.walls.insert(Plane::new(Vec3::unit_y(), 0.0)?)?;
/// let half = Vec3::new(0.2, 0.1, 0.3);
/// let crate_ = world.bodies.insert(Body::cuboid(half, Point3::new(0.0, 0.5, 0.0)))?;
/// for _ in 0..120 {
///     world.step(1.0 / 60.0)?;
/// }
/// let at = world.bodies.get(crate_)?.position;
/// assert!((at.y - 0.1).abs() < 1e-3, "it stands on the floor");
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bodies<S> {
    handles: Handles,
    pub(crate) states: Vec<BodyState<S>>,
    /// Contacts of the last step, in the order of their keys.
    pub(crate) contacts: Vec<BodyContact>,
    /// Bodies that the last step stopped, since their motion overflowed.
    pub(crate) stopped: Vec<BodyId>,
    /// Boxes about bodies that came, went or changed since the last step, before and after: what sleeps there wakes.
    pub(crate) changed_regions: Vec<Aabb3<f64>>,
}

impl<S: Scalar> Bodies<S> {
    /// Adds a body. What sleeps where it is wakes.
    ///
    /// # Errors
    /// [`Error::NotFinite`], [`Error::NotPositive`], [`Error::NotUnit`] or [`Error::OutOfRange`] for its numbers;
    /// [`Error::NotPositive`] for the `volume` of a flat shape of uniform density; [`Error::Full`] at 2³² − 1
    /// bodies.
    pub fn insert(&mut self, body: Body<S>) -> Result<BodyId, Error> {
        let state = BodyState::new(body.validated()?)?;
        let id = BodyId(self.handles.push()?);
        self.changed_regions.push(state.bounds());
        self.states.push(state);
        Ok(id)
    }

    /// Changes a body: its place, motion, shape, mass, kind. It wakes, and what sleeps beside it.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`], and those of [`Self::insert`].
    pub fn set(&mut self, id: BodyId, body: Body<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        let state = BodyState::new(body.validated()?)?;
        self.wake_beside(id);
        self.changed_regions.extend([self.states[row].bounds(), state.bounds()]);
        let before = &self.states[row].body;
        if (&before.shape, before.mass) != (&state.body.shape, state.body.mass) {
            self.contacts.retain(|contact| !contact.is_of(id)); // their impulses were for another one
        }
        self.states[row] = state;
        Ok(())
    }

    /// Takes a body out. What touched it wakes.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`].
    pub fn remove(&mut self, id: BodyId) -> Result<Body<S>, Error> {
        let row = self.row(id)?;
        let body = self.states[row].now();
        self.wake_beside(id);
        self.changed_regions.push(self.states[row].bounds());
        self.contacts.retain(|contact| !contact.is_of(id));
        self.handles.swap_remove(id.0);
        self.states.swap_remove(row);
        Ok(body)
    }

    /// Body as it is now.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`].
    pub fn get(&self, id: BodyId) -> Result<Body<S>, Error> {
        Ok(self.states[self.row(id)?].now())
    }

    /// Pose of its frame in the world.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`].
    pub fn pose(&self, id: BodyId) -> Result<Pose<S>, Error> {
        let pose = self.states[self.row(id)?].pose();
        let rotation = cast_rotation(pose.rotation);
        Ok(Pose { rotation, translation: cast_vector(pose.translation) })
    }

    /// Places it elsewhere, without a speed from that. It wakes.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`], [`Error::NotFinite`] or [`Error::NotUnit`].
    pub fn set_pose(&mut self, id: BodyId, pose: Pose<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        let Pose { rotation, translation } = pose.validated()?;
        super::place(Point3::from_vec(translation))?;
        self.wake_beside(id);
        let state = &mut self.states[row];
        let before = state.bounds();
        state.wake();
        state.set_pose(Pose {
            rotation: cast_rotation(rotation),
            translation: cast_vector(translation),
        });
        self.changed_regions.extend([before, state.bounds()]);
        Ok(())
    }

    /// Sets the velocity of its center of mass, in m/s, and its angular velocity, in rad/s. It wakes.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`], [`Error::NotFinite`].
    pub fn set_velocity(
        &mut self,
        id: BodyId,
        velocity: Vec3<S>,
        angular_velocity: Vec3<S>,
    ) -> Result<(), Error> {
        let row = self.row(id)?;
        super::motion(velocity, angular_velocity)?;
        let spin = angular_velocity;
        let state = &mut self.states[row];
        state.wake();
        (state.solver.velocity, state.solver.momentum) = (cast_vector(velocity), None);
        state.solver.spin = cast_vector(spin);
        Ok(())
    }

    /// Applies a force in N at a point of the world in the next step. It wakes.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`], [`Error::NotFinite`].
    pub fn apply_force(
        &mut self,
        id: BodyId,
        force: Vec3<S>,
        point: Point3<S>,
    ) -> Result<(), Error> {
        let row = self.row(id)?;
        let force = cast_vector(finite_vector(["force.x", "force.y", "force.z"], force)?);
        let arm = self.arm(row, point)?;
        let state = &mut self.states[row];
        state.wake();
        state.force[0] += force;
        state.force[1] += arm.cross(force);
        Ok(())
    }

    /// Applies an impulse in N s at a point of the world, at once. It wakes.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`], [`Error::NotFinite`].
    pub fn apply_impulse(
        &mut self,
        id: BodyId,
        impulse: Vec3<S>,
        point: Point3<S>,
    ) -> Result<(), Error> {
        let row = self.row(id)?;
        let names = ["impulse.x", "impulse.y", "impulse.z"];
        let impulse = cast_vector(finite_vector(names, impulse)?);
        let arm = self.arm(row, point)?;
        let state = &mut self.states[row];
        state.wake();
        state.solver.apply(impulse, arm);
        Ok(())
    }

    /// Applies a force in N at its center of mass, and a torque in N m, in the next step. It wakes unless both are
    /// zero.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`], [`Error::NotFinite`].
    pub fn apply_central_force(
        &mut self,
        id: BodyId,
        force: Vec3<S>,
        torque: Vec3<S>,
    ) -> Result<(), Error> {
        let row = self.row(id)?;
        let force = cast_vector(finite_vector(["force.x", "force.y", "force.z"], force)?);
        let torque = cast_vector(finite_vector(["torque.x", "torque.y", "torque.z"], torque)?);
        let state = &mut self.states[row];
        if force != Vec3::zero() || torque != Vec3::zero() {
            state.wake();
            state.force[0] += force;
            state.force[1] += torque;
        }
        Ok(())
    }

    /// Applies an impulse in N s at its center of mass, and an angular impulse in N m s, at once. It wakes.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`], [`Error::NotFinite`].
    pub fn apply_central_impulse(
        &mut self,
        id: BodyId,
        impulse: Vec3<S>,
        angular: Vec3<S>,
    ) -> Result<(), Error> {
        let row = self.row(id)?;
        let names = ["impulse.x", "impulse.y", "impulse.z"];
        let impulse = cast_vector(finite_vector(names, impulse)?);
        let names = ["angular.x", "angular.y", "angular.z"];
        let angular = cast_vector(finite_vector(names, angular)?);
        let state = &mut self.states[row];
        state.wake();
        state.solver.apply(impulse, Vec3::zero());
        state.solver.turn(angular);
        Ok(())
    }

    /// Place and motion.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`].
    pub fn motion(&self, id: BodyId) -> Result<BodyPlace<S>, Error> {
        let state = &self.states[self.row(id)?];
        let pose = state.pose();
        Ok(BodyPlace {
            position: Point3::from_vec(cast_vector(pose.translation)),
            rotation: cast_rotation(pose.rotation),
            velocity: cast_vector(state.solver.velocity),
            angular_velocity: cast_vector(state.solver.spin),
            is_asleep: state.asleep,
        })
    }

    /// Velocity of its material at a point of the world, in m/s.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`], [`Error::NotFinite`].
    pub fn velocity_at(&self, id: BodyId, point: Point3<S>) -> Result<Vec3<S>, Error> {
        let row = self.row(id)?;
        let arm = self.arm(row, point)?;
        Ok(cast_vector(self.states[row].solver.velocity_at(arm)))
    }

    /// Distance of its surface from its center of mass, at most, in metres.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`].
    pub fn reach(&self, id: BodyId) -> Result<S, Error> {
        Ok(S::from_f64(self.states[self.row(id)?].reach))
    }

    /// Mass properties along the axes of its frame; none of infinite mass.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`].
    pub fn mass_properties(&self, id: BodyId) -> Result<Option<MassProperties<S>>, Error> {
        self.states[self.row(id)?].body.mass_properties()
    }

    /// Kinetic energy in J; zero of infinite mass.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`].
    pub fn kinetic_energy(&self, id: BodyId) -> Result<S, Error> {
        let [kinetic, rotational] = self.states[self.row(id)?].solver.energies();
        Ok(S::from_f64(kinetic + rotational))
    }

    /// Returns true if it sleeps.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`].
    pub fn is_asleep(&self, id: BodyId) -> Result<bool, Error> {
        Ok(self.states[self.row(id)?].asleep)
    }

    /// Wakes it.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`].
    pub fn wake(&mut self, id: BodyId) -> Result<(), Error> {
        let row = self.row(id)?;
        self.states[row].wake();
        Ok(())
    }

    /// Handles of all bodies.
    pub fn ids(&self) -> impl Iterator<Item = BodyId> + '_ {
        (0..self.states.len()).filter_map(|row| self.id(row))
    }

    /// Bodies that the last step stopped at their last place, since their motion overflowed.
    #[must_use]
    pub fn stopped(&self) -> &[BodyId] {
        &self.stopped
    }

    /// Number of bodies.
    #[must_use]
    pub fn len(&self) -> usize {
        self.states.len()
    }

    /// Returns true if there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    /// Number of removals so far.
    pub(crate) fn removals(&self) -> u64 {
        self.handles.removals()
    }

    pub(crate) fn id(&self, row: usize) -> Option<BodyId> {
        self.handles.handle(row).map(BodyId)
    }

    pub(crate) fn row(&self, id: BodyId) -> Result<usize, Error> {
        self.handles.row(id.0).ok_or(Error::NoSuchBody(id))
    }

    /// Way from the center of mass to a point.
    fn arm(&self, row: usize, point: Point3<S>) -> Result<Vec3<f64>, Error> {
        let point = finite_point(["point.x", "point.y", "point.z"], point)?;
        Ok(cast_point::<S, f64>(point).to_vec() - self.states[row].solver.pose.translation)
    }

    /// Balls that touched a body in the last step, and the body's row.
    pub(crate) fn touching_balls(&self) -> impl Iterator<Item = (BallId, usize)> + '_ {
        self.contacts.iter().filter(|contact| contact.touches).filter_map(|contact| {
            let BodyPartner::Ball(ball) = contact.key.partner else { return None };
            Some((ball, self.row(contact.key.body).ok()?))
        })
    }

    /// Wakes a sleeper, and all that sleep with it.
    pub(crate) fn wake_island(&mut self, row: usize) {
        let mut next = vec![row];
        while let Some(row) = next.pop() {
            if !self.states[row].asleep {
                continue;
            }
            self.states[row].wake();
            let Some(id) = self.id(row) else { continue };
            let beside = self.contacts.iter().filter_map(|contact| contact.other(id));
            next.extend(beside.filter_map(|id| self.row(id).ok()));
        }
    }

    /// Wakes the bodies that touch one.
    fn wake_beside(&mut self, id: BodyId) {
        let beside = self.contacts.iter().filter_map(|contact| contact.other(id));
        let rows: Vec<_> = beside.filter_map(|id| self.row(id).ok()).collect();
        for row in rows {
            self.wake_island(row);
        }
    }
}
