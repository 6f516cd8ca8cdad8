use cgmath::{EuclideanSpace, InnerSpace, One, Zero};

use super::handles::{Handle, Handles};
use super::sparse_column::SparseColumn;
use crate::Error;
use crate::broad::Period;
use crate::error::{finite, finite_point, finite_vector, positive, within};
use crate::frame::Bivector;
use crate::math::{Point3, Quat, Scalar, Vec3, cast_vector, is_finite, is_finite_point};
use crate::motion::{Integrator, Mass, Motion, Rotation};
use crate::response::{CapsuleInertia, Material, SolverBodies};
use crate::shape::{Capsule, Shape, Sphere};
use crate::swarm::BodyColumns;

/// Stable handle of a marble.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MarbleId(Handle);

/// Description of a marble (a rigid sphere or capsule) as a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Marble<S> {
    /// Center, in metres.
    pub position: Point3<S>,
    /// Radius in metres, above zero.
    pub radius: S,
    /// Half length of a capsule's segment along its own y axis, in metres; zero for a ball.
    pub half_length: S,
    /// Velocity, in m/s.
    pub velocity: Vec3<S>,
    /// Mass.
    pub mass: Mass<S>,
    /// Gravity scale: 0 floats, −1 rises.
    pub gravity_scale: S,
    /// Damping of velocity and angular velocity.
    pub damping: Damping<S>,
    /// Rotation. Stored only by a model with rotation.
    pub rotation: Quat<S>,
    /// Angular velocity in rad/s, an axial vector in world space. Stored only by a model with
    /// rotation.
    pub angular_velocity: Vec3<S>,
    /// Own integrator instead of the model's.
    pub integrator: Option<Integrator>,
    /// Own rotation model, limited by the world's: a marble may roll visually, or not rotate at
    /// all, among others with angular momentum.
    pub rotation_model: Option<Rotation>,
    /// Own material instead of the default one.
    pub material: Option<Material<S>>,
}

impl<S: Scalar> Marble<S> {
    /// Creates a marble of glass, at rest.
    #[must_use]
    pub fn new(position: Point3<S>, radius: S) -> Self {
        Self {
            position,
            radius,
            half_length: S::zero(),
            velocity: Vec3::zero(),
            rotation: Quat::one(),
            angular_velocity: Vec3::zero(),
            mass: Mass::default(),
            gravity_scale: S::one(),
            damping: Damping::default(),
            integrator: None,
            rotation_model: None,
            material: None,
        }
    }
}

/// Exponential damping: removes the fraction `1 − e^−rate` of the velocity per second. A
/// convenience for games; for the drag of a medium see
/// [`ForceField::Drag`](crate::motion::ForceField).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damping<S> {
    /// Rate for the velocity in 1/s, at least zero.
    pub linear: S,
    /// Rate for the angular velocity in 1/s, at least zero. Used with dynamic rotation only.
    pub angular: S,
}

impl<S: Scalar> Default for Damping<S> {
    /// None.
    fn default() -> Self {
        Self { linear: S::zero(), angular: S::zero() }
    }
}

impl<S: Scalar> Damping<S> {
    fn cast<T: Scalar>(self) -> Damping<T> {
        let number = |x: S| T::constant(x.as_f64());
        Damping { linear: number(self.linear), angular: number(self.angular) }
    }

    fn checked(self) -> Result<Self, Error> {
        within("damping.linear", self.linear, S::zero(), S::max_value())?;
        within("damping.angular", self.angular, S::zero(), S::max_value())?;
        Ok(self)
    }
}

/// Compensation: the low parts of a marble's double-single numbers, which the scalar cuts off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Compensation<S> {
    pub position: Vec3<S>,
    pub velocity: Vec3<S>,
    pub angular_velocity: Vec3<S>,
}

impl<S: Scalar> Default for Compensation<S> {
    fn default() -> Self {
        Self { position: Vec3::zero(), velocity: Vec3::zero(), angular_velocity: Vec3::zero() }
    }
}

/// Marbles (dynamic spheres and capsules) as columns: index *i* of each belongs to one marble.
///
/// Indices change when marbles are removed; a [`MarbleId`] stays valid.
#[derive(Clone, Debug, PartialEq)]
pub struct Marbles<S> {
    handles: Handles,
    /// Flags: columns for rotation and for compensation exist.
    has_rotation: bool,
    pub(super) compensated: bool,
    pub(super) period: Period<S>,
    pub(super) position: Vec<Point3<S>>,
    pub(super) radius: Vec<S>,
    /// Capsules only.
    pub(super) half_length: SparseColumn<S>,
    pub(super) velocity: Vec<Vec3<S>>,
    /// Empty in a model without rotation, as is `angular_velocity`.
    pub(super) rotation: Vec<Quat<S>>,
    pub(super) angular_velocity: Vec<Vec3<S>>,
    /// Empty in a model of plain precision.
    pub(super) compensation: Vec<Compensation<S>>,
    /// Non-default masses.
    pub(super) mass: SparseColumn<Mass<S>>,
    /// Gravity scales other than one.
    pub(super) gravity_scale: SparseColumn<S>,
    /// Non-zero damping.
    pub(super) damping: SparseColumn<Damping<S>>,
    /// Applied force of this step.
    pub(super) force: SparseColumn<Vec3<S>>,
    /// Applied torque of this step.
    pub(super) torque: SparseColumn<Bivector<S>>,
    pub(super) integrator: SparseColumn<Integrator>,
    pub(super) rotation_model: SparseColumn<Rotation>,
    pub(super) material: SparseColumn<Material<S>>,
}

impl<S> Default for Marbles<S> {
    fn default() -> Self {
        Self {
            handles: Handles::default(),
            has_rotation: false,
            compensated: false,
            period: Period::default(),
            position: Vec::new(),
            radius: Vec::new(),
            half_length: SparseColumn::default(),
            velocity: Vec::new(),
            rotation: Vec::new(),
            angular_velocity: Vec::new(),
            compensation: Vec::new(),
            mass: SparseColumn::default(),
            gravity_scale: SparseColumn::default(),
            damping: SparseColumn::default(),
            force: SparseColumn::default(),
            torque: SparseColumn::default(),
            integrator: SparseColumn::default(),
            rotation_model: SparseColumn::default(),
            material: SparseColumn::default(),
        }
    }
}

const POSITION: [&str; 3] = ["position.x", "position.y", "position.z"];
pub(super) const ANGULAR_VELOCITY: [&str; 3] =
    ["angular_velocity.x", "angular_velocity.y", "angular_velocity.z"];
pub(super) const VELOCITY: [&str; 3] = ["velocity.x", "velocity.y", "velocity.z"];

impl<S: Scalar> Marbles<S> {
    /// Adds a marble.
    ///
    /// # Errors
    /// [`Error::NotFinite`], [`Error::NotPositive`], [`Error::NotUnit`] or [`Error::OutOfRange`]
    /// for its fields, also if size and density together make a mass that the scalar cannot
    /// represent; [`Error::Full`] at 2³² marbles.
    pub fn insert(&mut self, marble: Marble<S>) -> Result<MarbleId, Error> {
        let position = finite_point(POSITION, marble.position)?;
        let radius = positive("radius", marble.radius)?;
        let half_length = checked_half_length(marble.half_length)?;
        let velocity = finite_vector(VELOCITY, marble.velocity)?;
        let rotation = checked_rotation(marble.rotation)?;
        let angular_velocity = finite_vector(ANGULAR_VELOCITY, marble.angular_velocity)?;
        let mass = marble.mass.checked()?;
        mass.of_size(radius, marble.half_length)?;
        let gravity_scale = finite("gravity_scale", marble.gravity_scale)?;
        let damping = marble.damping.checked()?;
        let material = marble.material.map(Material::checked).transpose()?;
        let handle = self.handles.push()?;
        if half_length.is_some() {
            self.enable_rotation(true); // which way it points counts in any model
        }
        self.position.push(position);
        self.radius.push(radius);
        self.velocity.push(velocity);
        if self.has_rotation {
            self.rotation.push(rotation);
            let turns = marble.rotation_model != Some(Rotation::None);
            self.angular_velocity.push(if turns { angular_velocity } else { Vec3::zero() });
        }
        if self.compensated {
            self.compensation.push(Compensation::default());
        }
        let rows = self.position.len();
        self.half_length.set(rows - 1, half_length, rows);
        self.mass.set(rows - 1, non_default(mass, Mass::default()), rows);
        self.gravity_scale.set(rows - 1, non_default(gravity_scale, S::one()), rows);
        self.damping.set(rows - 1, non_default(damping, Damping::default()), rows);
        self.force.set(rows - 1, None, rows);
        self.torque.set(rows - 1, None, rows);
        self.integrator.set(rows - 1, marble.integrator, rows);
        self.rotation_model.set(rows - 1, marble.rotation_model, rows);
        self.material.set(rows - 1, material, rows);
        Ok(MarbleId(handle))
    }

    /// Removes a marble and returns it.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn remove(&mut self, id: MarbleId) -> Result<Marble<S>, Error> {
        let marble = self.get(id)?;
        if let Some(row) = self.handles.swap_remove(id.0) {
            self.position.swap_remove(row);
            self.radius.swap_remove(row);
            self.velocity.swap_remove(row);
            if self.has_rotation {
                self.rotation.swap_remove(row);
                self.angular_velocity.swap_remove(row);
            }
            if self.compensated {
                self.compensation.swap_remove(row);
            }
            self.half_length.swap_remove(row);
            self.mass.swap_remove(row);
            self.gravity_scale.swap_remove(row);
            self.damping.swap_remove(row);
            self.force.swap_remove(row);
            self.torque.swap_remove(row);
            self.integrator.swap_remove(row);
            self.rotation_model.swap_remove(row);
            self.material.swap_remove(row);
        }
        Ok(marble)
    }

    /// Current state of a marble.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn get(&self, id: MarbleId) -> Result<Marble<S>, Error> {
        let row = self.row(id)?;
        Ok(Marble {
            position: self.position[row],
            radius: self.radius[row],
            half_length: self.half_length(row),
            velocity: self.velocity[row],
            rotation: self.rotation.get(row).copied().unwrap_or_else(Quat::one),
            angular_velocity: self.angular_velocity.get(row).copied().unwrap_or_else(Vec3::zero),
            mass: self.mass.get(row).unwrap_or_default(),
            gravity_scale: self.gravity_scale.get(row).unwrap_or(S::one()),
            damping: self.damping.get(row).unwrap_or_default(),
            integrator: self.integrator.get(row),
            rotation_model: self.rotation_model.get(row),
            material: self.material.get(row),
        })
    }

    /// Current state of a marble in `f64`, including the compensation of
    /// [`Precision::Compensated`].
    ///
    /// [`Precision::Compensated`]: super::Precision::Compensated
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn get_high_precision(&self, id: MarbleId) -> Result<Marble<f64>, Error> {
        let (row, marble) = (self.row(id)?, self.get(id)?);
        let Motion { position, velocity } = self.motion_f64(row);
        let rotation = marble.rotation;
        Ok(Marble {
            position,
            velocity,
            angular_velocity: self.angular_velocity_f64(row),
            radius: marble.radius.as_f64(),
            half_length: marble.half_length.as_f64(),
            mass: marble.mass.cast(),
            gravity_scale: marble.gravity_scale.as_f64(),
            damping: marble.damping.cast(),
            rotation: Quat::from_sv(rotation.s.as_f64(), cast_vector(rotation.v)),
            integrator: marble.integrator,
            rotation_model: marble.rotation_model,
            material: marble.material.map(Material::cast),
        })
    }

    /// Teleports a marble.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NotFinite`].
    pub fn set_position(&mut self, id: MarbleId, position: Point3<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        self.position[row] = finite_point(POSITION, position)?;
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
        Ok(())
    }

    /// Sets the half length of a marble in metres: a capsule above zero, a ball at zero.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::OutOfRange`].
    pub fn set_half_length(&mut self, id: MarbleId, half_length: S) -> Result<(), Error> {
        let row = self.row(id)?;
        let given = half_length;
        let half_length = checked_half_length(half_length)?;
        self.own_mass(row).of_size(self.radius[row], given)?;
        if half_length.is_some() {
            self.enable_rotation(true);
        }
        self.half_length.set(row, half_length, self.handles.len());
        Ok(())
    }

    /// Sets the rotation of a marble. Does nothing in a model without rotation, except to capsules.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`]; [`Error::NotUnit`] if the length of the quaternion is
    /// more than 1e-3 from one.
    pub fn set_rotation(&mut self, id: MarbleId, rotation: Quat<S>) -> Result<(), Error> {
        let (row, rotation) = (self.row(id)?, checked_rotation(rotation)?);
        if let Some(slot) = self.rotation.get_mut(row) {
            *slot = rotation;
        }
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
        let (row, mass) = (self.row(id)?, mass.checked()?);
        mass.of_size(self.radius[row], self.half_length(row))?;
        self.mass.set(row, non_default(mass, Mass::default()), self.handles.len());
        Ok(())
    }

    /// Sets the gravity scale of a marble.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NotFinite`].
    pub fn set_gravity_scale(&mut self, id: MarbleId, scale: S) -> Result<(), Error> {
        let row = self.row(id)?;
        let scale = non_default(finite("gravity_scale", scale)?, S::one());
        self.gravity_scale.set(row, scale, self.handles.len());
        Ok(())
    }

    /// Sets the damping of a marble.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::OutOfRange`].
    pub fn set_damping(&mut self, id: MarbleId, damping: Damping<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        let damping = non_default(damping.checked()?, Damping::default());
        self.damping.set(row, damping, self.handles.len());
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
        self.integrator.set(row, integrator, self.handles.len());
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
        self.rotation_model.set(row, model, self.handles.len());
        if model == Some(Rotation::None) {
            self.set_angular_velocity(id, Vec3::zero())?;
        }
        Ok(())
    }

    /// Rotation model of a marble in a world of this model.
    pub(super) fn rotation_of(&self, row: usize, world: Rotation) -> Rotation {
        self.rotation_model.get(row).map_or(world, |own| own.min(world))
    }

    /// Returns true if contacts and torques do not affect the marble's rotation.
    pub(super) fn is_rotation_locked(&self, row: usize) -> bool {
        self.rotation_of(row, Rotation::Dynamic) != Rotation::Dynamic
    }

    /// Returns true if any marble has applied forces, torques or damping.
    pub(super) fn has_external_forces(&self) -> bool {
        !(self.force.is_empty() && self.torque.is_empty() && self.damping.is_empty())
    }

    /// Returns true if gravity does not accelerate all alike, or other forces act.
    pub(super) fn accelerate_differently(&self) -> bool {
        self.has_external_forces() || !(self.gravity_scale.is_empty() && self.mass.is_empty())
    }

    /// Returns true if all have the default mass and material and no own rotation model.
    pub(super) fn are_alike(&self) -> bool {
        self.mass.is_empty() && self.material.is_empty() && self.rotation_model.is_empty()
    }

    /// Returns true if any marble has its own rotation model.
    pub(super) fn has_rotation_locks(&self) -> bool {
        !self.rotation_model.is_empty()
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
        let material = material.map(Material::checked).transpose()?;
        self.material.set(row, material, self.handles.len());
        Ok(())
    }

    /// Centers by index, in metres.
    #[must_use]
    pub fn position(&self) -> &[Point3<S>] {
        &self.position
    }

    /// Radii by index, in metres.
    #[must_use]
    pub fn radius(&self) -> &[S] {
        &self.radius
    }

    /// Velocities by index, in m/s.
    #[must_use]
    pub fn velocity(&self) -> &[Vec3<S>] {
        &self.velocity
    }

    /// Rotations by index; empty in a model without rotation.
    #[must_use]
    pub fn rotation(&self) -> &[Quat<S>] {
        &self.rotation
    }

    /// Angular velocities by index, in rad/s; empty in a model without rotation.
    #[must_use]
    pub fn angular_velocity(&self) -> &[Vec3<S>] {
        &self.angular_velocity
    }

    /// Index of a marble, valid until the next removal.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn row(&self, id: MarbleId) -> Result<usize, Error> {
        self.handles.row(id.0).ok_or(Error::NoSuchMarble(id))
    }

    /// Handle of the marble at an index.
    #[must_use]
    pub fn id(&self, row: usize) -> Option<MarbleId> {
        self.handles.handle(row).map(MarbleId)
    }

    /// Number of removals so far.
    pub(super) fn removals(&self) -> u64 {
        self.handles.removals()
    }

    /// The number of marbles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// Returns true without any marble.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }

    /// Half length of a marble in metres; zero for a ball.
    pub(super) fn half_length(&self, row: usize) -> S {
        self.half_length.get(row).unwrap_or_else(S::zero)
    }

    /// First marble that is a capsule.
    pub(super) fn first_capsule(&self) -> Option<MarbleId> {
        let row = (0..self.len()).find(|row| self.half_length.get(*row).is_some())?;
        self.id(row)
    }

    /// Returns true if any marble is a capsule.
    #[must_use]
    pub fn has_capsules(&self) -> bool {
        !self.half_length.is_empty()
    }

    /// Current shape of a marble: a sphere or a capsule.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn shape(&self, id: MarbleId) -> Result<Shape<S>, Error> {
        self.row(id).map(|row| self.shape_of_row(row))
    }

    pub(super) fn shape_of_row(&self, row: usize) -> Shape<S> {
        let Sphere { center, radius } = self.sphere(row);
        let half = self.axis(row) * self.half_length(row);
        if self.half_length.get(row).is_some() {
            Shape::Capsule(Capsule { a: center - half, b: center + half, radius })
        } else {
            Shape::Sphere(Sphere { center, radius })
        }
    }

    /// Axis of a capsule, as a unit vector of the world.
    pub(super) fn axis(&self, row: usize) -> Vec3<S> {
        self.rotation.get(row).map_or_else(Vec3::unit_y, |turn| turn * Vec3::unit_y())
    }

    /// Capsule axes and inertia of all marbles, if any is a capsule, in a world of this model.
    pub(super) fn rods(&self, model: Rotation, rods: &mut Vec<CapsuleInertia<S>>) {
        rods.clear();
        if !self.has_capsules() {
            return;
        }
        rods.extend((0..self.len()).map(|row| {
            let (axis, half) = (self.axis(row), self.half_length(row));
            let turns = self.rotation_of(row, model) == Rotation::Dynamic;
            let moments = CapsuleInertia::unit_inertia(self.radius[row], half);
            let whirl = moments.map(|moment| if turns { moment.recip() } else { S::zero() });
            CapsuleInertia { axis, half_length: half, inverse_unit_inertia: whirl }
        }));
    }

    /// Sphere around the center of a marble.
    pub(super) fn sphere(&self, row: usize) -> Sphere<S> {
        Sphere { center: self.position[row], radius: self.radius[row] }
    }

    /// Displacement between two marbles in metres: the shortest one of a periodic world.
    #[inline]
    pub(super) fn apart(&self, a: usize, b: usize) -> Vec3<S> {
        self.period.nearest(self.position[b] - self.position[a])
    }

    /// Wraps positions into the periodic box.
    pub(super) fn wrap(&mut self) {
        if !self.period.is_open() {
            let middle = Point3::origin();
            self.position.iter_mut().for_each(|at| *at = self.period.image(*at, middle));
        }
    }

    /// Adds or drops the columns for rotation. New ones start with no rotation, at rest.
    pub(super) fn enable_rotation(&mut self, enable: bool) {
        if enable != self.has_rotation {
            self.has_rotation = enable;
            let rows = if enable { self.position.len() } else { 0 };
            self.rotation = vec![Quat::one(); rows];
            self.angular_velocity = vec![Vec3::zero(); rows];
        }
    }

    /// Sets the angular velocity of rolling without slip over a surface at rest with this normal.
    pub(super) fn roll_without_slip(&mut self, row: usize, normal: Vec3<S>) {
        let angular_velocity = normal.cross(self.velocity[row]) / self.radius[row];
        if self.half_length.get(row).is_some() {
            return; // it does not roll whichever way it goes
        }
        if let Some(slot) = self.angular_velocity.get_mut(row)
            && is_finite(angular_velocity)
        {
            *slot = angular_velocity;
        }
    }

    /// Adds a displacement, a velocity change, and a change of radius times angular velocity to a
    /// marble, where it exists and the result is finite.
    pub(super) fn apply_delta(
        &mut self,
        id: MarbleId,
        way: Vec3<S>,
        faster: Vec3<S>,
        rim: Vec3<S>,
    ) {
        let Ok(row) = self.row(id) else { return };
        let (position, velocity) = (self.position[row] + way, self.velocity[row] + faster);
        if is_finite_point(position) && is_finite(velocity) {
            (self.position[row], self.velocity[row]) = (position, velocity);
        }
        let turned = rim / self.radius[row];
        if let Some(angular_velocity) = self.angular_velocity.get_mut(row)
            && is_finite(*angular_velocity + turned)
        {
            *angular_velocity += turned;
        }
    }

    /// Columns for a response, with own materials and integrators.
    pub(super) fn columns<'a>(
        &'a mut self,
        inverse_mass: &'a [S],
        held: &'a [bool],
        rods: &'a [CapsuleInertia<S>],
    ) -> (SolverBodies<'a, S>, &'a SparseColumn<Material<S>>, &'a SparseColumn<Integrator>) {
        let columns = SolverBodies {
            period: self.period,
            position: &mut self.position,
            velocity: &mut self.velocity,
            radius: &self.radius,
            inverse_mass,
            spin: &mut self.angular_velocity,
            rotation_locked: held,
            capsules: rods,
        };
        (columns, &self.material, &self.integrator)
    }

    /// Columns that a solver of rows writes.
    pub(super) fn body_columns(&mut self, turns: bool) -> BodyColumns<'_, S> {
        let (angular_velocity, rotation) = if turns {
            (&mut self.angular_velocity[..], &mut self.rotation[..])
        } else {
            (&mut [][..], &mut [][..])
        };
        BodyColumns {
            position: &mut self.position,
            velocity: &mut self.velocity,
            angular_velocity,
            rotation,
            radius: &self.radius,
        }
    }

    /// Mass in kilograms; infinite for kinematic marbles.
    pub(super) fn mass(&self, row: usize) -> S {
        self.own_mass(row).of_capsule(self.radius[row], self.half_length(row))
    }

    pub(super) fn own_mass(&self, row: usize) -> Mass<S> {
        self.mass.get(row).unwrap_or_default()
    }

    /// Returns true if the state of a marble is finite.
    pub(super) fn is_finite_state(&self, row: usize) -> bool {
        let turns = |angular_velocity: &Vec3<S>| is_finite(*angular_velocity);
        let turned = |q: &Quat<S>| q.s.is_finite() && is_finite(q.v);
        is_finite_point(self.position[row])
            && is_finite(self.velocity[row])
            && self.angular_velocity.get(row).is_none_or(turns)
            && self.rotation.get(row).is_none_or(turned)
    }

    /// Stops a marble: clears velocity, angular velocity and their compensation.
    pub(super) fn stop(&mut self, row: usize) {
        self.velocity[row] = Vec3::zero();
        if let Some(angular_velocity) = self.angular_velocity.get_mut(row) {
            *angular_velocity = Vec3::zero();
        }
        if let Some(low) = self.compensation.get_mut(row) {
            (low.velocity, low.angular_velocity) = (Vec3::zero(), Vec3::zero());
        }
    }
}

/// Validates a half length; none for a ball.
fn checked_half_length<S: Scalar>(half_length: S) -> Result<Option<S>, Error> {
    let half_length = within("half_length", half_length, S::zero(), S::max_value())?;
    Ok(non_default(half_length, S::zero()))
}

/// Validates and normalizes a rotation.
fn checked_rotation<S: Scalar>(rotation: Quat<S>) -> Result<Quat<S>, Error> {
    // Drift of a few thousand products in f32, at most.
    let length = rotation.magnitude();
    if (length.as_f64() - 1.0).abs() <= 1e-3 {
        Ok(rotation.normalize())
    } else {
        Err(Error::NotUnit { field: "rotation", value: length.as_f64() })
    }
}

/// The value, or `None` for the default one.
fn non_default<T: PartialEq>(value: T, usual: T) -> Option<T> {
    (value != usual).then_some(value)
}
