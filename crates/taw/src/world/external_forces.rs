//! External forces, impulses and momentum of single marbles.

use cgmath::{InnerSpace, Zero};

use super::MarbleId;
use super::marbles::{ANGULAR_VELOCITY, Marbles, VELOCITY};
use crate::Error;
use crate::error::{finite_point, finite_vector};
use crate::frame::Bivector;
use crate::math::{Point3, Scalar, Vec3, cast_vector};
use crate::shape::{BALL_INERTIA, capsule_unit_inertia};

const ACCELERATION: [&str; 3] = ["acceleration.x", "acceleration.y", "acceleration.z"];
const FORCE: [&str; 3] = ["force.x", "force.y", "force.z"];
const IMPULSE: [&str; 3] = ["impulse.x", "impulse.y", "impulse.z"];
const POINT: [&str; 3] = ["point.x", "point.y", "point.z"];
const TORQUE: [&str; 3] = ["torque.yz", "torque.zx", "torque.xy"];

/// Forces and torques act for one [`World::step`](super::World::step), in all of its substeps, and
/// add up. Torques count only in a model with dynamic rotation. Impulses change velocities
/// immediately.
impl<S: Scalar> Marbles<S> {
    /// Applies a force at the center of a marble, in newtons.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`]; [`Error::NotFinite`] for the force, or for the accumulated sum.
    pub fn apply_force(&mut self, id: MarbleId, force: Vec3<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        let sum = self.force_with(row, force)?;
        self.own.force.set(row, Some(sum), self.len());
        Ok(())
    }

    /// Accelerates a marble in m/s² throughout the next step: a force of that times its mass, at its
    /// center. What is infinitely heavy is not accelerated.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`]; [`Error::NotFinite`] for the acceleration, or for the accumulated sum
    /// of forces.
    pub fn apply_acceleration(&mut self, id: MarbleId, acceleration: Vec3<S>) -> Result<(), Error> {
        let mass = self.mass(self.row(id)?);
        finite_vector(ACCELERATION, acceleration)?;
        if mass.is_finite() { self.apply_force(id, acceleration * mass) } else { Ok(()) }
    }

    /// Accumulated force of a marble plus another one.
    fn force_with(&self, row: usize, force: Vec3<S>) -> Result<Vec3<S>, Error> {
        finite_vector(FORCE, force)?;
        finite_vector(FORCE, self.own.force.get(row).unwrap_or_else(Vec3::zero) + force)
    }

    /// Accumulated torque of a marble plus another one.
    fn torque_with(&self, row: usize, torque: Vec3<S>) -> Result<Bivector<S>, Error> {
        finite_vector(TORQUE, torque)?;
        let sum = self.own.torque.get(row).unwrap_or_else(Bivector::zero).dual() + torque;
        finite_vector(TORQUE, sum).map(Bivector::from)
    }

    /// Applies a force at a point in world space, on the surface or not, which also causes a
    /// torque.
    ///
    /// # Errors
    /// As [`Marbles::apply_force`] and [`Marbles::apply_torque`], and [`Error::NotFinite`] for
    /// the point; then nothing has changed.
    pub fn apply_force_at(
        &mut self,
        id: MarbleId,
        force: Vec3<S>,
        point: Point3<S>,
    ) -> Result<(), Error> {
        let row = self.row(id)?;
        let lever = finite_point(POINT, point)? - self.position[row];
        let sum = self.force_with(row, force)?;
        let torque = self.torque_with(row, Bivector::wedge(lever, force).dual())?;
        self.own.force.set(row, Some(sum), self.len());
        self.own.torque.set(row, Some(torque), self.len());
        Ok(())
    }

    /// Applies a torque in N m: a [`Bivector`], or its dual axial vector.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`]; [`Error::NotFinite`] for the torque, or for the accumulated sum.
    pub fn apply_torque(
        &mut self,
        id: MarbleId,
        torque: impl Into<Bivector<S>>,
    ) -> Result<(), Error> {
        let row = self.row(id)?;
        let sum = self.torque_with(row, torque.into().dual())?;
        self.own.torque.set(row, Some(sum), self.len());
        Ok(())
    }

    /// Clears all applied forces and torques. A step ends with this.
    pub fn clear_forces(&mut self) {
        self.own.force.clear();
        self.own.torque.clear();
    }

    /// Applies an impulse (in N s) at the center of a marble: changes its velocity by the impulse
    /// over its mass.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`]; [`Error::NotFinite`] if the impulse or the velocity
    /// after it is not finite.
    pub fn apply_impulse(&mut self, id: MarbleId, impulse: Vec3<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        finite_vector(IMPULSE, impulse)?;
        let velocity = self.velocity[row] + impulse / self.mass(row);
        self.velocity[row] = finite_vector(VELOCITY, velocity)?;
        self.mark_changed(row);
        Ok(())
    }

    /// Applies an impulse at a point, as a cue does: changes velocity and, in a model with
    /// rotation, angular velocity.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`]; [`Error::NotFinite`] for impulse or point, or for the resulting
    /// velocities; then nothing has changed.
    pub fn apply_impulse_at(
        &mut self,
        id: MarbleId,
        impulse: Vec3<S>,
        point: Point3<S>,
    ) -> Result<(), Error> {
        let row = self.row(id)?;
        finite_vector(IMPULSE, impulse)?;
        let lever = finite_point(POINT, point)? - self.position[row];
        let before = self.angular_velocity.get(row).copied();
        self.apply_angular_impulse(id, Bivector::wedge(lever, impulse))?;
        self.apply_impulse(id, impulse).inspect_err(|_| {
            if let (Some(slot), Some(before)) = (self.angular_velocity.get_mut(row), before) {
                *slot = before;
            }
        })
    }

    /// Applies an angular impulse (in kg m²/s): changes the angular velocity by the impulse over
    /// the moment of inertia. Does nothing in a model without rotation.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`]; [`Error::NotFinite`] if the impulse or the resulting angular
    /// velocity is not finite.
    pub fn apply_angular_impulse(
        &mut self,
        id: MarbleId,
        impulse: impl Into<Bivector<S>>,
    ) -> Result<(), Error> {
        let row = self.row(id)?;
        let impulse =
            finite_vector(["impulse.yz", "impulse.zx", "impulse.xy"], impulse.into().dual())?;
        let change = self.apply_inverse_inertia(row, impulse);
        if let Some(angular_velocity) = self.angular_velocity.get_mut(row) {
            *angular_velocity = finite_vector(ANGULAR_VELOCITY, *angular_velocity + change)?;
        }
        self.mark_changed(row);
        Ok(())
    }

    /// Momentum in kg m/s; infinite for a moving marble of infinite mass.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn momentum(&self, id: MarbleId) -> Result<Vec3<S>, Error> {
        let row = self.row(id)?;
        let (velocity, mass) = (self.velocity[row], self.mass(row));
        Ok(if velocity.is_zero() { velocity } else { velocity * mass })
    }

    /// Sets the velocity from a momentum in kg m/s.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`]; [`Error::NotFinite`] for the momentum or the velocity.
    pub fn set_momentum(&mut self, id: MarbleId, momentum: Vec3<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        finite_vector(["momentum.x", "momentum.y", "momentum.z"], momentum)?;
        self.set_velocity(id, momentum / self.mass(row))
    }

    /// Angular momentum about the marble's center, in kg m²/s; zero in a model without rotation.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn angular_momentum(&self, id: MarbleId) -> Result<Bivector<S>, Error> {
        let row = self.row(id)?;
        let angular_velocity = self.angular_velocity.get(row).copied().unwrap_or_else(Vec3::zero);
        let mass = self.mass(row);
        Ok(if angular_velocity.is_zero() {
            angular_velocity
        } else {
            self.scale_by_moments(row, angular_velocity, |moment| moment * mass)
        }
        .into())
    }

    /// Twice the rotational kinetic energy over the mass, in m²/s².
    pub(super) fn rotational_energy(&self, row: usize) -> f64 {
        let (angular_velocity, radius) =
            (self.angular_velocity_f64(row), self.radius[row].as_f64());
        let half = self.half_length(row).as_f64();
        if half == 0.0 {
            return BALL_INERTIA * (angular_velocity * radius).magnitude2();
        }
        let [along, across] = capsule_unit_inertia(radius, half);
        let axis = cast_vector::<S, f64>(self.axis(row)).normalize();
        let about_axis = angular_velocity.dot(axis);
        about_axis * about_axis * along
            + (angular_velocity - axis * about_axis).magnitude2() * across
    }

    /// Applies the inverse inertia tensor to an angular impulse; zero for infinite mass.
    pub(super) fn apply_inverse_inertia(&self, row: usize, impulse: Vec3<S>) -> Vec3<S> {
        let mass = self.mass(row);
        self.scale_by_moments(row, impulse, |moment| S::one() / mass / moment)
    }

    /// Applies a function of the principal moments of inertia per mass to an axial vector: about
    /// the axis of a capsule, and across it. For a ball the moment is `2/5 r²`, in m².
    pub(super) fn scale_by_moments(&self, row: usize, v: Vec3<S>, of: impl Fn(S) -> S) -> Vec3<S> {
        let (radius, half) = (self.radius[row], self.half_length(row));
        if half == S::zero() {
            return v * of(S::from_f64(BALL_INERTIA) * radius * radius);
        }
        let [along, across] = capsule_unit_inertia(radius, half).map(of);
        let axis = self.axis(row);
        let part = axis * v.dot(axis);
        part * along + (v - part) * across
    }
}
