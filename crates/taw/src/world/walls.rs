use super::handles::{Handle, Handles};
use crate::Error;
use crate::math::Scalar;
use crate::shape::Plane;

/// Names a wall for as long as it is in the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct WallId(Handle);

/// What no contact can move: half-spaces, fixed or moved by the user.
#[derive(Clone, Debug, PartialEq)]
pub struct Walls<S> {
    handles: Handles,
    planes: Vec<Plane<S>>,
}

impl<S> Default for Walls<S> {
    fn default() -> Self {
        Self { handles: Handles::default(), planes: Vec::new() }
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
        Ok(WallId(handle))
    }

    /// Takes a wall out and gives it back.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`].
    pub fn remove(&mut self, id: WallId) -> Result<Plane<S>, Error> {
        let row = self.handles.swap_remove(id.0);
        row.map(|row| self.planes.swap_remove(row)).ok_or(Error::NoSuchWall(id))
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
