//! Setters of single marbles.

use cgmath::Zero;

use super::MarbleId;
use super::marble::{Damping, non_default, validated_half_length, validated_rotation};
use super::marbles::{ANGULAR_VELOCITY, Marbles, POSITION, VELOCITY};
use crate::Error;
use crate::broad::CollisionLayers;
use crate::error::{finite, finite_point, finite_vector, positive};
use crate::math::{Point3, Quat, Scalar, Vec3};
use crate::motion::{Integrator, LockedAxes, Mass, Rotation};
use crate::response::Material;

impl<S: Scalar> Marbles<S> {
    /// Teleports a marble.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NotFinite`].
    pub fn set_position(&mut self, id: MarbleId, position: Point3<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        self.position[row] = finite_point(POSITION, position)?;
        self.mark_changed(row);
        if let Some(low) = self.compensation.get_mut(row) {
            low.position = Vec3::zero();
        }
        Ok(())
    }

    /// Sets the velocity of a marble, in m/s.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NotFinite`].
    pub fn set_velocity(&mut self, id: MarbleId, velocity: Vec3<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        self.velocity[row] = finite_vector(VELOCITY, velocity)?;
        self.mark_changed(row);
        if let Some(low) = self.compensation.get_mut(row) {
            low.velocity = Vec3::zero();
        }
        Ok(())
    }

    /// Sets the radius of a marble about the same center, in metres.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NotPositive`]; [`Error::OutOfRange`] if the scalar cannot
    /// represent the resulting mass or inertia.
    pub fn set_radius(&mut self, id: MarbleId, radius: S) -> Result<(), Error> {
        let (row, radius) = (self.row(id)?, positive("radius", radius)?);
        self.own_mass(row).of_size(radius, self.half_length(row))?;
        self.radius[row] = radius;
        self.mark_changed(row);
        Ok(())
    }

    /// Sets the half length of a marble in metres: a capsule above zero, a ball at zero.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::OutOfRange`].
    pub fn set_half_length(&mut self, id: MarbleId, half_length: S) -> Result<(), Error> {
        let row = self.row(id)?;
        let given = half_length;
        let half_length = validated_half_length(half_length)?;
        self.own_mass(row).of_size(self.radius[row], given)?;
        if half_length.is_some() {
            self.enable_rotation(true);
        }
        self.own.half_length.set(row, half_length, self.len());
        self.mark_changed(row);
        Ok(())
    }

    /// Sets the rotation of a marble. Does nothing in a model without rotation, except to capsules.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`]; [`Error::NotUnit`] if the length of the quaternion is
    /// more than 1e-3 from one.
    pub fn set_rotation(&mut self, id: MarbleId, rotation: Quat<S>) -> Result<(), Error> {
        let (row, rotation) = (self.row(id)?, validated_rotation(rotation)?);
        if let Some(slot) = self.rotation.get_mut(row) {
            *slot = rotation;
        }
        self.disturb(row);
        Ok(())
    }

    /// Sets the angular velocity of a marble, in rad/s as an axial vector in world space. Does
    /// nothing in a model without rotation.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NotFinite`].
    pub fn set_angular_velocity(
        &mut self,
        id: MarbleId,
        angular_velocity: Vec3<S>,
    ) -> Result<(), Error> {
        let (row, angular_velocity) =
            (self.row(id)?, finite_vector(ANGULAR_VELOCITY, angular_velocity)?);
        if let Some(slot) = self.angular_velocity.get_mut(row) {
            *slot = angular_velocity;
        }
        self.mark_changed(row);
        if let Some(low) = self.compensation.get_mut(row) {
            low.angular_velocity = Vec3::zero();
        }
        Ok(())
    }

    /// Sets the mass of a marble.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NotPositive`]; [`Error::OutOfRange`] if the scalar cannot
    /// represent it or the inertia.
    pub fn set_mass(&mut self, id: MarbleId, mass: Mass<S>) -> Result<(), Error> {
        let (row, mass) = (self.row(id)?, mass.validated()?);
        mass.of_size(self.radius[row], self.half_length(row))?;
        self.own.mass.set(row, non_default(mass, Mass::default()), self.len());
        self.mark_changed(row);
        Ok(())
    }

    /// Sets the gravity scale of a marble.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NotFinite`].
    pub fn set_gravity_scale(&mut self, id: MarbleId, scale: S) -> Result<(), Error> {
        let row = self.row(id)?;
        let scale = non_default(finite("gravity_scale", scale)?, S::one());
        self.own.gravity_scale.set(row, scale, self.len());
        self.disturb(row);
        Ok(())
    }

    /// Sets the damping of a marble.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::OutOfRange`].
    pub fn set_damping(&mut self, id: MarbleId, damping: Damping<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        let damping = non_default(damping.validated()?, Damping::default());
        self.own.damping.set(row, damping, self.len());
        self.disturb(row);
        Ok(())
    }

    /// Locks axes that a marble neither moves along nor turns about, and frees all others. Its velocity
    /// along locked ones is set to zero in the next step.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn set_locked_axes(&mut self, id: MarbleId, axes: LockedAxes) -> Result<(), Error> {
        let row = self.row(id)?;
        self.own.locked_axes.set(row, non_default(axes, LockedAxes::NONE), self.len());
        self.mark_changed(row);
        Ok(())
    }

    /// Sets a marble's own integrator, or with `None` the model's.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn set_integrator(
        &mut self,
        id: MarbleId,
        integrator: Option<Integrator>,
    ) -> Result<(), Error> {
        let row = self.row(id)?;
        self.own.integrator.set(row, integrator, self.len());
        self.disturb(row);
        Ok(())
    }

    /// Sets a marble's own rotation model, or with `None` the world's. A marble set to no rotation
    /// loses its angular velocity.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn set_rotation_model(
        &mut self,
        id: MarbleId,
        model: Option<Rotation>,
    ) -> Result<(), Error> {
        let row = self.row(id)?;
        self.own.rotation_model.set(row, model, self.len());
        self.mark_changed(row);
        if model == Some(Rotation::None) {
            self.set_angular_velocity(id, Vec3::zero())?;
        }
        Ok(())
    }

    /// Sets a marble's own material, or with `None` the default one.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::OutOfRange`].
    pub fn set_material(
        &mut self,
        id: MarbleId,
        material: Option<Material<S>>,
    ) -> Result<(), Error> {
        let row = self.row(id)?;
        let material = material.map(Material::validated).transpose()?;
        self.own.material.set(row, material, self.len());
        self.mark_changed(row);
        Ok(())
    }

    /// Changes the layers of a marble.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn set_layers(&mut self, id: MarbleId, layers: CollisionLayers) -> Result<(), Error> {
        let row = self.row(id)?;
        self.own.layers.set(row, non_default(layers, CollisionLayers::ALL), self.len());
        self.mark_changed(row);
        Ok(())
    }

    /// Forbids a marble to sleep, and with it those that it touches; or allows it again.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn set_sleeping_disabled(&mut self, id: MarbleId, disabled: bool) -> Result<(), Error> {
        let row = self.row(id)?;
        self.own.sleeping_disabled.set(row, disabled.then_some(()), self.len());
        self.mark_changed(row);
        Ok(())
    }
}
