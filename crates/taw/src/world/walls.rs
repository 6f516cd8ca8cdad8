use cgmath::Zero;

use super::handles::{Handle, Handles};
use super::optional::Optional;
use crate::Error;
use crate::error::{finite_point, finite_vector};
use crate::math::{Point3, Scalar, Vec3};
use crate::motion::WallMotion;
use crate::response::{self, Material};
use crate::shape::Plane;

/// Names a wall for as long as it is in the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct WallId(Handle);

/// What no contact can move: half-spaces, fixed or moved by the user.
#[derive(Clone, Debug, PartialEq)]
pub struct Walls<S> {
    handles: Handles,
    planes: Vec<Plane<S>>,
    /// Only of those that move.
    motion: Optional<WallMotion<S>>,
    /// Only of those that have one of their own.
    material: Optional<Material<S>>,
}

impl<S> Default for Walls<S> {
    fn default() -> Self {
        Self {
            handles: Handles::default(),
            planes: Vec::new(),
            motion: Optional::default(),
            material: Optional::default(),
        }
    }
}

impl<S: Scalar> Walls<S> {
    /// Adds a wall.
    ///
    /// # Errors
    /// [`Error::Full`] at 2³² walls.
    pub fn insert(&mut self, plane: Plane<S>) -> Result<WallId, Error> {
        let handle = self.handles.push()?;
        self.planes.push(plane);
        let rows = self.planes.len();
        self.motion.set(rows - 1, None, rows);
        self.material.set(rows - 1, None, rows);
        Ok(WallId(handle))
    }

    /// Takes a wall out and gives it back.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`].
    pub fn remove(&mut self, id: WallId) -> Result<Plane<S>, Error> {
        let row = self.handles.swap_remove(id.0);
        let row = row.ok_or(Error::NoSuchWall(id))?;
        self.motion.swap_remove(row);
        self.material.swap_remove(row);
        Ok(self.planes.swap_remove(row))
    }

    /// The wall.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`].
    pub fn get(&self, id: WallId) -> Result<Plane<S>, Error> {
        self.row(id).map(|row| self.planes[row])
    }

    /// Moves a wall to a new place. Marbles that are then inside are pushed out by
    /// the next step.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`].
    pub fn set(&mut self, id: WallId, plane: Plane<S>) -> Result<(), Error> {
        self.row(id).map(|row| self.planes[row] = plane)
    }

    /// Says how a wall moves, or with `None` that it is at rest. It is up to the
    /// caller to move it accordingly, with [`Walls::set`].
    ///
    /// # Errors
    /// [`Error::NoSuchWall`], [`Error::NotFinite`].
    pub fn set_motion(&mut self, id: WallId, motion: Option<WallMotion<S>>) -> Result<(), Error> {
        let row = self.row(id)?;
        if let Some(motion) = motion {
            finite_vector(["velocity.x", "velocity.y", "velocity.z"], motion.velocity)?;
            finite_vector(["spin.x", "spin.y", "spin.z"], motion.spin)?;
            finite_point(["pivot.x", "pivot.y", "pivot.z"], motion.pivot)?;
        }
        self.motion.set(row, motion, self.planes.len());
        Ok(())
    }

    /// How a wall moves, or `None` if it is at rest.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`].
    pub fn motion(&self, id: WallId) -> Result<Option<WallMotion<S>>, Error> {
        self.row(id).map(|row| self.motion.get(row))
    }

    /// Gives a wall a material of its own, which counts together with the marble's, or
    /// with `None` leaves it to the marble's alone.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`], [`Error::OutOfRange`].
    pub fn set_material(&mut self, id: WallId, material: Option<Material<S>>) -> Result<(), Error> {
        let row = self.row(id)?;
        let material = material.map(Material::checked).transpose()?;
        self.material.set(row, material, self.planes.len());
        Ok(())
    }

    /// The material of a wall, if it has one of its own.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`].
    pub fn material(&self, id: WallId) -> Result<Option<Material<S>>, Error> {
        self.row(id).map(|row| self.material.get(row))
    }

    /// All walls, by row.
    #[must_use]
    pub fn planes(&self) -> &[Plane<S>] {
        &self.planes
    }

    /// The row of a wall, until the next removal.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`].
    pub fn row(&self, id: WallId) -> Result<usize, Error> {
        self.handles.row(id.0).ok_or(Error::NoSuchWall(id))
    }

    /// The wall in a row.
    #[must_use]
    pub fn id(&self, row: usize) -> Option<WallId> {
        self.handles.handle(row).map(WallId)
    }

    /// How the wall in a row moves.
    pub(super) fn motion_of_row(&self, row: usize) -> Option<WallMotion<S>> {
        self.motion.get(row)
    }

    /// The own material of the wall in a row.
    pub(super) fn material_of_row(&self, row: usize) -> Option<Material<S>> {
        self.material.get(row)
    }

    /// How many walls were taken out so far.
    pub(super) fn removals(&self) -> u64 {
        self.handles.removals()
    }

    /// The number of walls.
    #[must_use]
    pub fn len(&self) -> usize {
        self.planes.len()
    }

    /// Whether there are no walls.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.planes.is_empty()
    }
}

impl<S: Scalar> response::Walls<S> for Walls<S> {
    fn normal_and_distance(&self, wall: usize, point: Point3<S>) -> (Vec3<S>, S) {
        let plane = &self.planes[wall];
        (plane.normal(), plane.signed_distance(point))
    }

    fn surface_velocity(&self, wall: usize, point: Point3<S>) -> Vec3<S> {
        self.motion.get(wall).map_or_else(Vec3::zero, |motion| motion.velocity_at(point))
    }

    fn material(&self, wall: usize) -> Option<Material<S>> {
        self.material.get(wall)
    }
}
