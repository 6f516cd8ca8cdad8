use cgmath::Zero;

use super::handles::{Handle, Handles};
use super::optional::Optional;
use crate::Error;
use crate::error::{finite_point, finite_vector};
use crate::math::{Point3, Scalar, Vec3};
use crate::response;
use crate::shape::Plane;

/// Names a wall for as long as it is in the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct WallId(Handle);

/// How a wall moves, as one rigid thing: a velocity, and a spin about a pivot.
///
/// It says how fast the wall's surface carries along what lies on it, and nothing
/// about where the wall is. So a conveyor is a wall that stays where it is and has one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallMotion<S> {
    /// Of the pivot, in m/s.
    pub velocity: Vec3<S>,
    /// In rad/s, an axial vector in world space.
    pub spin: Vec3<S>,
    /// A point that the spin is about.
    pub pivot: Point3<S>,
}

impl<S: Scalar> WallMotion<S> {
    /// The velocity of a point that moves along, in m/s.
    #[must_use]
    pub fn velocity_at(&self, point: Point3<S>) -> Vec3<S> {
        self.velocity + self.spin.cross(point - self.pivot)
    }
}

/// What no contact can move: half-spaces, fixed or moved by the user.
#[derive(Clone, Debug, PartialEq)]
pub struct Walls<S> {
    handles: Handles,
    planes: Vec<Plane<S>>,
    /// Only of those that move.
    motion: Optional<WallMotion<S>>,
}

impl<S> Default for Walls<S> {
    fn default() -> Self {
        Self { handles: Handles::default(), planes: Vec::new(), motion: Optional::default() }
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
        self.motion.set(self.planes.len() - 1, None, self.planes.len());
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
}
