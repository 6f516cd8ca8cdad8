//! Layers of walls, and which walls a marble collides with.

use super::marble::non_default;
use super::walls::{SubShape, WallId, Walls};
use crate::Error;
use crate::broad::{CollisionFilter, CollisionLayers};
use crate::math::Scalar;
use crate::shape::{Aabb3, Plane};

impl<S: Scalar> Walls<S> {
    /// Changes the layers of a wall: which marbles and balls collide with it. Sleeping ones near it
    /// wake.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`].
    pub fn set_layers(&mut self, id: WallId, layers: CollisionLayers) -> Result<(), Error> {
        let row = self.row(id)?;
        if self.layers_of_row(row as u32) != layers {
            self.mark_changed(row);
        }
        self.layers.set(row, non_default(layers, CollisionLayers::ALL), self.len());
        Ok(())
    }

    /// Layers of a wall.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`].
    pub fn layers(&self, id: WallId) -> Result<CollisionLayers, Error> {
        self.row(id).map(|row| self.layers_of_row(row as u32))
    }

    /// Layers of the wall at an index.
    #[inline]
    pub(super) fn layers_of_row(&self, row: u32) -> CollisionLayers {
        self.layers.get(row as usize).unwrap_or_default()
    }

    /// Visits the sub-shapes that may overlap a box, of walls that a filter lets collide, except
    /// half-spaces.
    pub(super) fn for_each_colliding(
        &self,
        bounds: &Aabb3<S>,
        filter: CollisionFilter,
        mut visit: impl FnMut(SubShape),
    ) {
        self.for_each_in_box(bounds, |part| {
            if self.collides(part.wall, filter) {
                visit(part);
            }
        });
    }

    /// Half-spaces that a filter lets collide, with their rows.
    pub(super) fn colliding_planes<'a>(
        &'a self,
        filter: CollisionFilter<'a>,
    ) -> impl Iterator<Item = (u32, &'a Plane<S>)> {
        self.planes().filter(move |(wall, _)| self.collides(*wall, filter))
    }

    /// Returns true if a filter lets the wall in a row collide.
    #[inline]
    pub(super) fn collides(&self, row: u32, filter: CollisionFilter) -> bool {
        filter.meets_wall(row, self.layers_of_row(row))
    }
}
