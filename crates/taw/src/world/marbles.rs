use super::handles::{Handle, Handles};
use super::optional::Optional;
use crate::Error;
use crate::error::{finite_point, finite_vector, positive, within};
use crate::math::{Point3, Scalar, Vec3, is_finite, is_finite_point};
use crate::motion::{Integrator, explicit_euler, semi_implicit_euler};
use crate::shape::Sphere;

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
    /// In metres per second.
    pub velocity: Vec3<S>,
    /// This marble's own integrator instead of the model's.
    pub integrator: Option<Integrator>,
    /// This marble's own material instead of the default one.
    pub material: Option<Material<S>>,
}

impl<S: Scalar> Marble<S> {
    /// A marble at rest.
    #[must_use]
    pub fn new(position: Point3<S>, radius: S) -> Self {
        Self {
            position,
            radius,
            velocity: Vec3::new(S::zero(), S::zero(), S::zero()),
            integrator: None,
            material: None,
        }
    }
}

/// What a marble is made of, as far as its contacts can tell.
///
/// It is stored with the marble. [`Response::Displacement`] knows neither bounce
/// nor friction and does not read it.
///
/// [`Response::Displacement`]: crate::response::Response::Displacement
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Material<S> {
    /// The part of the approach speed that a bounce gives back, in `[0, 1]`.
    pub restitution: S,
    /// The largest friction force over the normal force (Coulomb), at least zero.
    pub friction: S,
}

impl<S: Scalar> Material<S> {
    fn check(self) -> Result<Self, Error> {
        within("restitution", self.restitution, S::zero(), S::one())?;
        within("friction", self.friction, S::zero(), S::max_value())?;
        Ok(self)
    }
}

/// Dynamic spheres, in columns: row *i* of each belongs to the same marble.
///
/// Rows move when marbles are removed; a [`MarbleId`] finds its row again.
#[derive(Clone, Debug, PartialEq)]
pub struct Marbles<S> {
    handles: Handles,
    position: Vec<Point3<S>>,
    radius: Vec<S>,
    velocity: Vec<Vec3<S>>,
    integrator: Optional<Integrator>,
    material: Optional<Material<S>>,
}

impl<S> Default for Marbles<S> {
    fn default() -> Self {
        Self {
            handles: Handles::default(),
            position: Vec::new(),
            radius: Vec::new(),
            velocity: Vec::new(),
            integrator: Optional::default(),
            material: Optional::default(),
        }
    }
}

const POSITION: [&str; 3] = ["position.x", "position.y", "position.z"];
const VELOCITY: [&str; 3] = ["velocity.x", "velocity.y", "velocity.z"];

impl<S: Scalar> Marbles<S> {
    /// Adds a marble.
    ///
    /// # Errors
    /// [`Error::NotFinite`], [`Error::NotPositive`] or [`Error::OutOfRange`] for
    /// its fields; [`Error::Full`] at 2³² marbles.
    pub fn insert(&mut self, marble: Marble<S>) -> Result<MarbleId, Error> {
        let position = finite_point(POSITION, marble.position)?;
        let radius = positive("radius", marble.radius)?;
        let velocity = finite_vector(VELOCITY, marble.velocity)?;
        let material = marble.material.map(Material::check).transpose()?;
        let handle = self.handles.push()?;
        self.position.push(position);
        self.radius.push(radius);
        self.velocity.push(velocity);
        let rows = self.position.len();
        self.integrator.set(rows - 1, marble.integrator, rows);
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
            self.integrator.swap_remove(row);
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
            velocity: self.velocity[row],
            integrator: self.integrator.get(row),
            material: self.material.get(row),
        })
    }

    /// Moves a marble to a new place at once.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NotFinite`].
    pub fn set_position(&mut self, id: MarbleId, position: Point3<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        self.position[row] = finite_point(POSITION, position)?;
        Ok(())
    }

    /// Gives a marble a new velocity, in metres per second.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NotFinite`].
    pub fn set_velocity(&mut self, id: MarbleId, velocity: Vec3<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        self.velocity[row] = finite_vector(VELOCITY, velocity)?;
        Ok(())
    }

    /// Gives a marble a new radius, in metres, about the same center.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`], [`Error::NotPositive`].
    pub fn set_radius(&mut self, id: MarbleId, radius: S) -> Result<(), Error> {
        let row = self.row(id)?;
        self.radius[row] = positive("radius", radius)?;
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
        let material = material.map(Material::check).transpose()?;
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

    /// The shape in a row that exists.
    pub(super) fn sphere(&self, row: usize) -> Sphere<S> {
        Sphere { center: self.position[row], radius: self.radius[row] }
    }

    /// What a response works on: positions, velocities, radii.
    pub(super) fn columns(&mut self) -> (&mut [Point3<S>], &mut [Vec3<S>], &[S]) {
        (&mut self.position, &mut self.velocity, &self.radius)
    }

    /// Moves every row on by `dt`. A row that would become infinite or NaN keeps
    /// its place, loses its velocity, and is added to `stopped`.
    pub(super) fn integrate(
        &mut self,
        integrator: Integrator,
        acceleration: Vec3<S>,
        dt: S,
        stopped: &mut Vec<u32>,
    ) {
        // The kernel is chosen once for all rows, unless rows have their own.
        if !self.integrator.is_empty() {
            for row in 0..self.position.len() {
                match self.integrator.get(row).unwrap_or(integrator) {
                    Integrator::ExplicitEuler => {
                        self.integrate_rows(
                            row..row + 1,
                            explicit_euler,
                            acceleration,
                            dt,
                            stopped,
                        );
                    }
                    Integrator::SemiImplicitEuler => self.integrate_rows(
                        row..row + 1,
                        semi_implicit_euler,
                        acceleration,
                        dt,
                        stopped,
                    ),
                }
            }
            return;
        }
        let all = 0..self.position.len();
        match integrator {
            Integrator::ExplicitEuler => {
                self.integrate_rows(all, explicit_euler, acceleration, dt, stopped);
            }
            Integrator::SemiImplicitEuler => {
                self.integrate_rows(all, semi_implicit_euler, acceleration, dt, stopped);
            }
        }
    }

    #[inline]
    fn integrate_rows(
        &mut self,
        rows: std::ops::Range<usize>,
        kernel: impl Fn(Point3<S>, Vec3<S>, Vec3<S>, S) -> (Point3<S>, Vec3<S>),
        acceleration: Vec3<S>,
        dt: S,
        stopped: &mut Vec<u32>,
    ) {
        let positions = self.position[rows.clone()].iter_mut();
        let velocities = self.velocity[rows.clone()].iter_mut();
        for ((row, position), velocity) in rows.zip(positions).zip(velocities) {
            let next = kernel(*position, *velocity, acceleration, dt);
            if is_finite_point(next.0) && is_finite(next.1) {
                (*position, *velocity) = next;
            } else {
                *velocity = Vec3::new(S::zero(), S::zero(), S::zero());
                stopped.push(row as u32);
            }
        }
    }
}
