use cgmath::{EuclideanSpace, InnerSpace, One, Zero};

use super::handles::{Handle, Handles};
use super::optional::Optional;
use crate::Error;
use crate::broad::Period;
use crate::error::{finite, finite_point, finite_vector, positive, within};
use crate::frame::Bivector;
use crate::math::{Point3, Quat, Scalar, Vec3, cast_vector, is_finite, is_finite_point};
use crate::motion::{Integrator, Mass, Motion, Rotation};
use crate::response::{CapsuleInertia, Material, SolverBodies};
use crate::shape::{Capsule, Shape, Sphere};

/// Names a marble for as long as it is in the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MarbleId(Handle);

/// One marble as a value: what goes into the columns, and what comes out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Marble<S> {
    /// The center, in metres.
    pub position: Point3<S>,
    /// In metres, above zero.
    pub radius: S,
    /// Above zero, it is a capsule: all points within the radius of a line along its own y
    /// axis, which goes this far both ways from the center, in metres.
    pub half_length: S,
    /// In metres per second.
    pub velocity: Vec3<S>,
    /// How heavy it is.
    pub mass: Mass<S>,
    /// How many times the world's gravity it feels: 0 floats, −1 rises.
    pub gravity_scale: S,
    /// What slows it wherever it is.
    pub damping: Damping<S>,
    /// How it is turned. Kept only by a model with rotation.
    pub rotation: Quat<S>,
    /// Its angular velocity in rad/s, an axial vector in world space. Kept only by a
    /// model with rotation.
    pub spin: Vec3<S>,
    /// This marble's own integrator instead of the model's.
    pub integrator: Option<Integrator>,
    /// This marble's own rotation model, where the world's models no less: a marble may
    /// roll for show, or not turn at all, among others that have angular momentum.
    pub rotation_model: Option<Rotation>,
    /// This marble's own material instead of the default one.
    pub material: Option<Material<S>>,
}

impl<S: Scalar> Marble<S> {
    /// A marble of glass, at rest.
    #[must_use]
    pub fn new(position: Point3<S>, radius: S) -> Self {
        Self {
            position,
            radius,
            half_length: S::zero(),
            velocity: Vec3::zero(),
            rotation: Quat::one(),
            spin: Vec3::zero(),
            mass: Mass::default(),
            gravity_scale: S::one(),
            damping: Damping::default(),
            integrator: None,
            rotation_model: None,
            material: None,
        }
    }
}

/// What takes a part of a marble's speed in every second, wherever it is: `1 − e^−rate`.
/// A convenience of games; what a medium does is [`Force::Drag`](crate::motion::Force).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damping<S> {
    /// Of the velocity, in 1/s, at least zero.
    pub linear: S,
    /// Of the spin, in 1/s, at least zero. Counts if the model's rotation is dynamic.
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

/// What the scalar cuts off a row's numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rest<S> {
    pub position: Vec3<S>,
    pub velocity: Vec3<S>,
    pub spin: Vec3<S>,
}

impl<S: Scalar> Default for Rest<S> {
    fn default() -> Self {
        Self { position: Vec3::zero(), velocity: Vec3::zero(), spin: Vec3::zero() }
    }
}

/// Dynamic spheres, in columns: row *i* of each belongs to the same marble.
///
/// Rows move when marbles are removed; a [`MarbleId`] finds its row again.
#[derive(Clone, Debug, PartialEq)]
pub struct Marbles<S> {
    handles: Handles,
    /// Whether there are columns for rotation, and for what the scalar cuts off.
    turn: bool,
    pub(super) compensated: bool,
    pub(super) period: Period<S>,
    pub(super) position: Vec<Point3<S>>,
    pub(super) radius: Vec<S>,
    /// Only of capsules.
    pub(super) half_length: Optional<S>,
    pub(super) velocity: Vec<Vec3<S>>,
    /// Empty in a model without rotation, as is `spin`.
    pub(super) rotation: Vec<Quat<S>>,
    pub(super) spin: Vec<Vec3<S>>,
    /// Empty in a model of plain precision.
    pub(super) rest: Vec<Rest<S>>,
    /// Only what is not the default.
    pub(super) mass: Optional<Mass<S>>,
    /// Only what is not one.
    pub(super) gravity_scale: Optional<S>,
    /// Only what is not none.
    pub(super) damping: Optional<Damping<S>>,
    /// Only of this step.
    pub(super) force: Optional<Vec3<S>>,
    /// Only of this step.
    pub(super) torque: Optional<Bivector<S>>,
    pub(super) integrator: Optional<Integrator>,
    pub(super) rotation_model: Optional<Rotation>,
    pub(super) material: Optional<Material<S>>,
}

impl<S> Default for Marbles<S> {
    fn default() -> Self {
        Self {
            handles: Handles::default(),
            turn: false,
            compensated: false,
            period: Period::default(),
            position: Vec::new(),
            radius: Vec::new(),
            half_length: Optional::default(),
            velocity: Vec::new(),
            rotation: Vec::new(),
            spin: Vec::new(),
            rest: Vec::new(),
            mass: Optional::default(),
            gravity_scale: Optional::default(),
            damping: Optional::default(),
            force: Optional::default(),
            torque: Optional::default(),
            integrator: Optional::default(),
            rotation_model: Optional::default(),
            material: Optional::default(),
        }
    }
}

const POSITION: [&str; 3] = ["position.x", "position.y", "position.z"];
pub(super) const SPIN: [&str; 3] = ["spin.x", "spin.y", "spin.z"];
pub(super) const VELOCITY: [&str; 3] = ["velocity.x", "velocity.y", "velocity.z"];

impl<S: Scalar> Marbles<S> {
    /// Adds a marble.
    ///
    /// # Errors
    /// [`Error::NotFinite`], [`Error::NotPositive`], [`Error::NotUnit`] or [`Error::OutOfRange`]
    /// for its fields, also where size and density together make a mass that the scalar has no
    /// number for; [`Error::Full`] at 2³² marbles.
    pub fn insert(&mut self, marble: Marble<S>) -> Result<MarbleId, Error> {
        let position = finite_point(POSITION, marble.position)?;
        let radius = positive("radius", marble.radius)?;
        let half_length = checked_half_length(marble.half_length)?;
        let velocity = finite_vector(VELOCITY, marble.velocity)?;
        let rotation = checked_rotation(marble.rotation)?;
        let spin = finite_vector(SPIN, marble.spin)?;
        let mass = marble.mass.checked()?;
        mass.of_size(radius, marble.half_length)?;
        let gravity_scale = finite("gravity_scale", marble.gravity_scale)?;
        let damping = marble.damping.checked()?;
        let material = marble.material.map(Material::checked).transpose()?;
        let handle = self.handles.push()?;
        if half_length.is_some() {
            self.set_turn(true); // which way it points counts in any model
        }
        self.position.push(position);
        self.radius.push(radius);
        self.velocity.push(velocity);
        if self.turn {
            self.rotation.push(rotation);
            let turns = marble.rotation_model != Some(Rotation::None);
            self.spin.push(if turns { spin } else { Vec3::zero() });
        }
        if self.compensated {
            self.rest.push(Rest::default());
        }
        let rows = self.position.len();
        self.half_length.set(rows - 1, half_length, rows);
        self.mass.set(rows - 1, but(mass, Mass::default()), rows);
        self.gravity_scale.set(rows - 1, but(gravity_scale, S::one()), rows);
        self.damping.set(rows - 1, but(damping, Damping::default()), rows);
        self.force.set(rows - 1, None, rows);
        self.torque.set(rows - 1, None, rows);
        self.integrator.set(rows - 1, marble.integrator, rows);
        self.rotation_model.set(rows - 1, marble.rotation_model, rows);
        self.material.set(rows - 1, material, rows);
        Ok(MarbleId(handle))
    }

    /// Takes a marble out and gives it back.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn remove(&mut self, id: MarbleId) -> Result<Marble<S>, Error> {
        let marble = self.get(id)?;
        if let Some(row) = self.handles.swap_remove(id.0) {
            self.position.swap_remove(row);
            self.radius.swap_remove(row);
            self.velocity.swap_remove(row);
            if self.turn {
                self.rotation.swap_remove(row);
                self.spin.swap_remove(row);
            }
            if self.compensated {
                self.rest.swap_remove(row);
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

    /// The marble as it is now.
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
            spin: self.spin.get(row).copied().unwrap_or_else(Vec3::zero),
            mass: self.mass.get(row).unwrap_or_default(),
            gravity_scale: self.gravity_scale.get(row).unwrap_or(S::one()),
            damping: self.damping.get(row).unwrap_or_default(),
            integrator: self.integrator.get(row),
            rotation_model: self.rotation_model.get(row),
            material: self.material.get(row),
        })
    }

    /// The marble as it is now, in `f64`, with what [`Precision::Compensated`] remembers
    /// beyond the world's scalar.
    ///
    /// [`Precision::Compensated`]: super::Precision::Compensated
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn get_exact(&self, id: MarbleId) -> Result<Marble<f64>, Error> {
        let (row, marble) = (self.row(id)?, self.get(id)?);
        let Motion { position, velocity } = self.exact(row);
        let rotation = marble.rotation;
        Ok(Marble {
            position,
            velocity,
            spin: self.exact_spin(row),
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

    /// Moves a marble to a new place at once.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NotFinite`].
    pub fn set_position(&mut self, id: MarbleId, position: Point3<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        self.position[row] = finite_point(POSITION, position)?;
        if let Some(rest) = self.rest.get_mut(row) {
            rest.position = Vec3::zero();
        }
        Ok(())
    }

    /// Gives a marble a new velocity, in metres per second.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NotFinite`].
    pub fn set_velocity(&mut self, id: MarbleId, velocity: Vec3<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        self.velocity[row] = finite_vector(VELOCITY, velocity)?;
        if let Some(rest) = self.rest.get_mut(row) {
            rest.velocity = Vec3::zero();
        }
        Ok(())
    }

    /// Gives a marble a new radius, in metres, about the same center.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NotPositive`]; [`Error::OutOfRange`] if it would then be
    /// so light or so heavy that the scalar has no number for it.
    pub fn set_radius(&mut self, id: MarbleId, radius: S) -> Result<(), Error> {
        let (row, radius) = (self.row(id)?, positive("radius", radius)?);
        self.own_mass(row).of_size(radius, self.half_length(row))?;
        self.radius[row] = radius;
        Ok(())
    }

    /// Makes a capsule of a marble, of this half length in metres, or with zero a ball.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::OutOfRange`].
    pub fn set_half_length(&mut self, id: MarbleId, half_length: S) -> Result<(), Error> {
        let row = self.row(id)?;
        let given = half_length;
        let half_length = checked_half_length(half_length)?;
        self.own_mass(row).of_size(self.radius[row], given)?;
        if half_length.is_some() {
            self.set_turn(true);
        }
        self.half_length.set(row, half_length, self.handles.len());
        Ok(())
    }

    /// Turns a marble at once. Does nothing in a model without rotation, but to capsules.
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

    /// Gives a marble a new spin, in rad/s as an axial vector in world space. Does
    /// nothing in a model without rotation.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NotFinite`].
    pub fn set_spin(&mut self, id: MarbleId, spin: Vec3<S>) -> Result<(), Error> {
        let (row, spin) = (self.row(id)?, finite_vector(SPIN, spin)?);
        if let Some(slot) = self.spin.get_mut(row) {
            *slot = spin;
        }
        if let Some(rest) = self.rest.get_mut(row) {
            rest.spin = Vec3::zero();
        }
        Ok(())
    }

    /// Gives a marble a new mass.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NotPositive`]; [`Error::OutOfRange`] if it is so light
    /// or so heavy, for the size of the marble, that the scalar has no number for it.
    pub fn set_mass(&mut self, id: MarbleId, mass: Mass<S>) -> Result<(), Error> {
        let (row, mass) = (self.row(id)?, mass.checked()?);
        mass.of_size(self.radius[row], self.half_length(row))?;
        self.mass.set(row, but(mass, Mass::default()), self.handles.len());
        Ok(())
    }

    /// Sets how many times the world's gravity a marble feels.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NotFinite`].
    pub fn set_gravity_scale(&mut self, id: MarbleId, scale: S) -> Result<(), Error> {
        let row = self.row(id)?;
        let scale = but(finite("gravity_scale", scale)?, S::one());
        self.gravity_scale.set(row, scale, self.handles.len());
        Ok(())
    }

    /// Says what slows a marble wherever it is.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::OutOfRange`].
    pub fn set_damping(&mut self, id: MarbleId, damping: Damping<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        let damping = but(damping.checked()?, Damping::default());
        self.damping.set(row, damping, self.handles.len());
        Ok(())
    }

    /// Gives a marble its own integrator, or with `None` the model's.
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

    /// Gives a marble its own rotation model, or with `None` the world's. One that does not
    /// spin as the world's model would begins at rest.
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
            self.set_spin(id, Vec3::zero())?;
        }
        Ok(())
    }

    /// How the marble in a row turns in a world of this model.
    pub(super) fn rotation_of(&self, row: usize, world: Rotation) -> Rotation {
        self.rotation_model.get(row).map_or(world, |own| own.min(world))
    }

    /// Whether contacts and torques cannot set the marble in a row spinning.
    pub(super) fn is_held(&self, row: usize) -> bool {
        self.rotation_of(row, Rotation::Dynamic) != Rotation::Dynamic
    }

    /// Whether anything but gravity moves some of them.
    pub(super) fn are_pushed(&self) -> bool {
        !(self.force.is_empty() && self.torque.is_empty() && self.damping.is_empty())
    }

    /// Whether there is one like that.
    pub(super) fn has_held(&self) -> bool {
        !self.rotation_model.is_empty()
    }

    /// Gives a marble its own material, or with `None` the default one.
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

    /// The centers, by row, in metres.
    #[must_use]
    pub fn position(&self) -> &[Point3<S>] {
        &self.position
    }

    /// The radii, by row, in metres.
    #[must_use]
    pub fn radius(&self) -> &[S] {
        &self.radius
    }

    /// The velocities, by row, in metres per second.
    #[must_use]
    pub fn velocity(&self) -> &[Vec3<S>] {
        &self.velocity
    }

    /// How each marble is turned, by row; empty in a model without rotation.
    #[must_use]
    pub fn rotation(&self) -> &[Quat<S>] {
        &self.rotation
    }

    /// The spins, by row, in rad/s; empty in a model without rotation.
    #[must_use]
    pub fn spin(&self) -> &[Vec3<S>] {
        &self.spin
    }

    /// The row of a marble, until the next removal.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn row(&self, id: MarbleId) -> Result<usize, Error> {
        self.handles.row(id.0).ok_or(Error::NoSuchMarble(id))
    }

    /// The marble in a row.
    #[must_use]
    pub fn id(&self, row: usize) -> Option<MarbleId> {
        self.handles.handle(row).map(MarbleId)
    }

    /// How many marbles were taken out so far.
    pub(super) fn removals(&self) -> u64 {
        self.handles.removals()
    }

    /// The number of marbles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// Whether there are no marbles.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }

    /// Zero for a ball.
    pub(super) fn half_length(&self, row: usize) -> S {
        self.half_length.get(row).unwrap_or_else(S::zero)
    }

    /// The first marble that is a capsule.
    pub(super) fn first_capsule(&self) -> Option<MarbleId> {
        let row = (0..self.len()).find(|row| self.half_length.get(*row).is_some())?;
        self.id(row)
    }

    /// Whether there are capsules.
    #[must_use]
    pub fn has_capsules(&self) -> bool {
        !self.half_length.is_empty()
    }

    /// What a marble is now: a sphere or a capsule.
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

    /// Which way a capsule points, as a unit vector of the world.
    pub(super) fn axis(&self, row: usize) -> Vec3<S> {
        self.rotation.get(row).map_or_else(Vec3::unit_y, |turn| turn * Vec3::unit_y())
    }

    /// What is long about every row, if any is a capsule. In a world of this model.
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

    /// The ball in the middle of a row that exists.
    pub(super) fn sphere(&self, row: usize) -> Sphere<S> {
        Sphere { center: self.position[row], radius: self.radius[row] }
    }

    /// The way from one row to another, in metres: the shortest one of a periodic world.
    #[inline]
    pub(super) fn apart(&self, a: usize, b: usize) -> Vec3<S> {
        self.period.nearest(self.position[b] - self.position[a])
    }

    /// Puts what left the periodic box back into it.
    pub(super) fn wrap(&mut self) {
        if !self.period.is_open() {
            let middle = Point3::origin();
            self.position.iter_mut().for_each(|at| *at = self.period.image(*at, middle));
        }
    }

    /// Adds or drops the columns for rotation. New ones begin unturned and at rest.
    pub(super) fn set_turn(&mut self, turn: bool) {
        if turn != self.turn {
            self.turn = turn;
            let rows = if turn { self.position.len() } else { 0 };
            self.rotation = vec![Quat::one(); rows];
            self.spin = vec![Vec3::zero(); rows];
        }
    }

    /// Makes a row spin as if it rolled over a surface at rest with this normal.
    pub(super) fn roll(&mut self, row: usize, normal: Vec3<S>) {
        let spin = normal.cross(self.velocity[row]) / self.radius[row];
        if self.half_length.get(row).is_some() {
            return; // it does not roll whichever way it goes
        }
        if let Some(slot) = self.spin.get_mut(row)
            && is_finite(spin)
        {
            *slot = spin;
        }
    }

    /// Moves a marble and changes its velocity and radius times its spin, where that is finite
    /// and it is there.
    pub(super) fn push(&mut self, id: MarbleId, way: Vec3<S>, faster: Vec3<S>, rim: Vec3<S>) {
        let Ok(row) = self.row(id) else { return };
        let (position, velocity) = (self.position[row] + way, self.velocity[row] + faster);
        if is_finite_point(position) && is_finite(velocity) {
            (self.position[row], self.velocity[row]) = (position, velocity);
        }
        let turned = rim / self.radius[row];
        if let Some(spin) = self.spin.get_mut(row)
            && is_finite(*spin + turned)
        {
            *spin += turned;
        }
    }

    /// What a response works on: the columns, and what single marbles have.
    pub(super) fn columns<'a>(
        &'a mut self,
        inverse_mass: &'a [S],
        held: &'a [bool],
        rods: &'a [CapsuleInertia<S>],
    ) -> (SolverBodies<'a, S>, &'a Optional<Material<S>>, &'a Optional<Integrator>) {
        let columns = SolverBodies {
            period: self.period,
            position: &mut self.position,
            velocity: &mut self.velocity,
            radius: &self.radius,
            inverse_mass,
            spin: &mut self.spin,
            rotation_locked: held,
            capsules: rods,
        };
        (columns, &self.material, &self.integrator)
    }

    /// In kilograms; infinite for what nothing accelerates.
    pub(super) fn mass(&self, row: usize) -> S {
        self.own_mass(row).of_capsule(self.radius[row], self.half_length(row))
    }

    fn own_mass(&self, row: usize) -> Mass<S> {
        self.mass.get(row).unwrap_or_default()
    }

    /// Whether all that moves of a row is a number.
    pub(super) fn is_sane(&self, row: usize) -> bool {
        let turns = |spin: &Vec3<S>| is_finite(*spin);
        let turned = |q: &Quat<S>| q.s.is_finite() && is_finite(q.v);
        is_finite_point(self.position[row])
            && is_finite(self.velocity[row])
            && self.spin.get(row).is_none_or(turns)
            && self.rotation.get(row).is_none_or(turned)
    }

    /// Takes velocity and spin of a row, and what the scalar cut off.
    pub(super) fn stop(&mut self, row: usize) {
        self.velocity[row] = Vec3::zero();
        if let Some(spin) = self.spin.get_mut(row) {
            *spin = Vec3::zero();
        }
        if let Some(rest) = self.rest.get_mut(row) {
            (rest.velocity, rest.spin) = (Vec3::zero(), Vec3::zero());
        }
    }
}

/// None for a ball.
fn checked_half_length<S: Scalar>(half_length: S) -> Result<Option<S>, Error> {
    let half_length = within("half_length", half_length, S::zero(), S::max_value())?;
    Ok(but(half_length, S::zero()))
}

/// The quaternion as a rotation, if its length is about one.
fn checked_rotation<S: Scalar>(rotation: Quat<S>) -> Result<Quat<S>, Error> {
    // What a few thousand products in f32 let it drift, and no more.
    let length = rotation.magnitude();
    if (length.as_f64() - 1.0).abs() <= 1e-3 {
        Ok(rotation.normalize())
    } else {
        Err(Error::NotUnit { field: "rotation", value: length.as_f64() })
    }
}

/// A value, but `None` for the one that goes without saying.
fn but<T: PartialEq>(value: T, usual: T) -> Option<T> {
    (value != usual).then_some(value)
}
