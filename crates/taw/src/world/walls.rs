use cgmath::Zero;

use super::sparse_column::SparseColumn;
use super::wall_changes::WallChanges;
use super::wall_shape::WallShape;
use crate::Error;
use crate::broad::CollisionLayers;
use crate::contact::ClosestPoints;
use crate::handle::Handles;
pub use crate::handle::WallId;
use crate::math::{Point3, Scalar, Vec3, is_finite_point};
use crate::motion::WallMotion;
use crate::response::{self, Material};
use crate::shape::{Aabb3, Bvh, Capsule, Plane, PointProjection};
use crate::uncompared::Uncompared;

/// Sub-shape of a wall: part of a compound, or triangle of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct SubShape {
    pub wall: u32,
    pub index: u32,
}

/// Walls: static and kinematic colliders, which no contact moves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Walls<S> {
    handles: Handles,
    shapes: Vec<WallShape<S>>,
    /// Indices of half-spaces, in order: every step visits them, among however many others.
    planes: Uncompared<Vec<u32>>,
    /// Motion of moving walls.
    motion: SparseColumn<WallMotion<S>>,
    /// Materials of walls that have their own.
    material: SparseColumn<Material<S>>,
    /// Layers other than all.
    pub(super) layers: SparseColumn<CollisionLayers>,
    /// Unit vectors along which marbles pass through.
    pub(super) one_way: SparseColumn<Vec3<S>>,
    /// Walls that were set to another pose since the last step.
    moved: SparseColumn<()>,
    /// Final shapes and motions of walls on their way through a step.
    ends: Uncompared<Vec<(WallId, WallShape<S>, WallMotion<S>)>>,
    /// Bounding boxes of all walls except half-spaces, and their sub-shapes.
    boxes: Uncompared<Vec<Aabb3<S>>>,
    sub_shapes: Uncompared<Vec<SubShape>>,
    tree: Uncompared<Bvh<S>>,
    dirty: Uncompared<Dirty>,
    /// Number of insertions, removals and changes.
    version: Uncompared<u64>,
    changes: WallChanges<S>,
}

/// Changes since the tree was built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
enum Dirty {
    #[default]
    Nothing,
    Poses,
    All,
}

impl<S: Scalar> Walls<S> {
    /// Adds a wall: a half-space, any shape, a mesh or a height field.
    ///
    /// # Errors
    /// [`Error::Full`] at 2³² − 1 walls; for a number that a wall cannot have, as the constructor of
    /// its shape, or [`Pose::validated`](crate::frame::Pose::validated).
    pub fn insert(&mut self, wall: impl Into<WallShape<S>>) -> Result<WallId, Error> {
        let shape = wall.into().validated()?;
        let handle = self.handles.push()?;
        self.change(&shape, Dirty::All);
        self.log_change(shape.bounding_box());
        if matches!(shape, WallShape::Plane(_)) {
            self.planes.push(self.shapes.len() as u32);
        }
        self.shapes.push(shape);
        let rows = self.shapes.len();
        self.motion.set(rows - 1, None, rows);
        self.material.set(rows - 1, None, rows);
        self.layers.set(rows - 1, None, rows);
        self.one_way.set(rows - 1, None, rows);
        self.moved.set(rows - 1, None, rows);
        Ok(WallId(handle))
    }

    /// Removes a wall and returns it.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`].
    pub fn remove(&mut self, id: WallId) -> Result<WallShape<S>, Error> {
        let row = self.handles.swap_remove(id.0);
        let row = row.ok_or(Error::NoSuchWall(id))?;
        self.motion.swap_remove(row);
        self.material.swap_remove(row);
        self.layers.swap_remove(row);
        self.one_way.swap_remove(row);
        self.moved.swap_remove(row);
        // Another wall has this index now.
        *self.dirty = Dirty::All;
        *self.version += 1;
        let last = self.shapes.len() - 1;
        let shape = self.shapes.swap_remove(row);
        self.changes.add(shape.bounding_box(), Some([row as u32, last as u32]));
        self.collect_planes();
        Ok(shape)
    }

    /// Shape of a wall.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`].
    pub fn get(&self, id: WallId) -> Result<&WallShape<S>, Error> {
        self.row(id).map(|row| &self.shapes[row])
    }

    /// Moves a wall or replaces its shape. Marbles inside it are pushed out by the next step.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`]; for a shape as [`Walls::insert`].
    pub fn set(&mut self, id: WallId, wall: impl Into<WallShape<S>>) -> Result<(), Error> {
        let row = self.row(id)?;
        let shape = wall.into().validated()?;
        let parts = |shape: &WallShape<S>| {
            let mut count = 0;
            shape.for_each_box(|_, _| count += 1);
            count
        };
        let same = parts(&shape) == parts(&self.shapes[row]);
        self.leave_way(id);
        if shape.is_same(&self.shapes[row]) {
            return Ok(());
        }
        self.moved.set(row, Some(()), self.shapes.len());
        self.change(&shape, if same { Dirty::Poses } else { Dirty::All });
        let [old, new] = [&self.shapes[row], &shape].map(WallShape::bounding_box);
        self.log_change(old.zip(new).map(|(old, new)| old.union(&new)));
        let is_plane = |shape: &WallShape<S>| matches!(shape, WallShape::Plane(_));
        let turns = is_plane(&shape) != is_plane(&self.shapes[row]);
        self.shapes[row] = shape;
        if turns {
            self.collect_planes();
        }
        Ok(())
    }

    fn collect_planes(&mut self) {
        self.planes.clear();
        let rows = (0..).zip(&self.shapes);
        let planes = rows.filter(|(_, shape)| matches!(shape, WallShape::Plane(_)));
        self.planes.extend(planes.map(|(row, _)| row));
    }

    /// Records that a wall is new or elsewhere.
    fn change(&mut self, shape: &WallShape<S>, dirty: Dirty) {
        *self.version += 1;
        if dirty == Dirty::All || !matches!(shape, WallShape::Plane(_)) {
            *self.dirty = self.dirty.max(dirty);
        }
    }

    /// Records a change of a wall that stays in place.
    pub(super) fn mark_changed(&mut self, row: usize) {
        *self.version += 1;
        self.log_change(self.shapes[row].bounding_box());
    }

    /// Logs the region of a change.
    fn log_change(&mut self, region: Option<Aabb3<S>>) {
        self.changes.add(region, None);
    }

    /// Identity of the walls as they are: that of their clones until one of them changes, and of no
    /// others.
    pub(super) fn identity(&self) -> u64 {
        self.changes.identity()
    }

    /// Notes that a solver knows of all changes.
    pub(super) fn mark_seen(&mut self) {
        self.changes.mark_seen();
    }

    /// Changes of walls, by region.
    pub(super) fn changes(&self) -> &WallChanges<S> {
        &self.changes
    }

    /// Updates the tree. Moved walls are refitted.
    pub(super) fn update_tree(&mut self) {
        if *self.dirty == Dirty::Nothing {
            return;
        }
        self.boxes.clear();
        self.sub_shapes.clear();
        for (wall, shape) in (0..).zip(&self.shapes) {
            shape.for_each_box(|part, bounds| {
                self.sub_shapes.push(SubShape { wall, index: part });
                self.boxes.push(bounds);
            });
        }
        if *self.dirty == Dirty::Poses {
            self.tree.refit(&self.boxes);
        } else {
            *self.tree = Bvh::new(&self.boxes);
        }
        *self.dirty = Dirty::Nothing;
    }

    /// Returns true if all walls are half-spaces.
    pub(super) fn are_half_spaces(&self) -> bool {
        self.sub_shapes.is_empty()
    }

    /// Visits the sub-shapes of walls, except half-spaces, that may overlap a box.
    pub(super) fn for_each_in_box(&self, bounds: &Aabb3<S>, mut visit: impl FnMut(SubShape)) {
        self.tree.for_each_in_box(bounds, |item| {
            let SubShape { wall, index: part } = self.sub_shapes[item as usize];
            self.shapes[wall as usize]
                .for_each_in_box(part, bounds, |part| visit(SubShape { wall, index: part }));
        });
    }

    /// Visits the sub-shapes of walls, except half-spaces, that may be within `reach` metres of a
    /// point.
    pub(super) fn for_each_near(
        &self,
        point: Point3<S>,
        reach: S,
        mut visit: impl FnMut(SubShape),
    ) {
        self.tree.for_each_near(point, reach, |item| {
            let SubShape { wall, index: part } = self.sub_shapes[item as usize];
            self.shapes[wall as usize]
                .for_each_near(part, point, reach, |part| visit(SubShape { wall, index: part }));
            reach
        });
    }

    /// Projects a point onto a sub-shape.
    pub(super) fn project_point(
        &self,
        SubShape { wall, index: part }: SubShape,
        point: Point3<S>,
    ) -> PointProjection<S> {
        self.shapes[wall as usize].project_point_on(part, point)
    }

    /// Closest points of a sub-shape and a capsule, except for half-spaces.
    pub(super) fn closest_points(
        &self,
        SubShape { wall, index: part }: SubShape,
        capsule: &Capsule<S>,
    ) -> Option<ClosestPoints<S>> {
        self.shapes[wall as usize].closest_points(part, capsule)
    }

    /// All half-spaces with their indices.
    pub(super) fn planes(&self) -> impl Iterator<Item = (u32, &Plane<S>)> {
        self.planes.iter().filter_map(|row| match &self.shapes[*row as usize] {
            WallShape::Plane(plane) => Some((*row, plane)),
            _ => None,
        })
    }

    /// Sets the motion of a wall, or with `None` puts it at rest. The caller moves it accordingly,
    /// with [`Walls::set`].
    ///
    /// # Errors
    /// [`Error::NoSuchWall`], [`Error::NotFinite`].
    pub fn set_motion(&mut self, id: WallId, motion: Option<WallMotion<S>>) -> Result<(), Error> {
        let row = self.row(id)?;
        let motion = motion.map(WallMotion::validated).transpose()?;
        if self.motion.get(row) != motion {
            self.mark_changed(row);
        }
        if let Some(way) = self.ends.iter().position(|(other, ..)| *other == id) {
            if let Some(motion) = motion {
                self.ends[way].2 = motion;
            } else {
                self.shapes[row] = self.ends.remove(way).1;
                *self.dirty = self.dirty.max(Dirty::Poses);
            }
        }
        self.motion.set(row, motion, self.shapes.len());
        Ok(())
    }

    /// Motion of a wall, or `None` if it is at rest.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`].
    pub fn motion(&self, id: WallId) -> Result<Option<WallMotion<S>>, Error> {
        self.row(id).map(|row| self.motion.get(row))
    }

    /// Sets the wall's own material, which is combined with the marble's; with `None` the marble's
    /// counts alone.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`], [`Error::OutOfRange`].
    pub fn set_material(&mut self, id: WallId, material: Option<Material<S>>) -> Result<(), Error> {
        let row = self.row(id)?;
        let material = material.map(Material::validated).transpose()?;
        if self.material.get(row) != material {
            self.mark_changed(row);
        }
        self.material.set(row, material, self.shapes.len());
        Ok(())
    }

    /// The wall's own material, if any.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`].
    pub fn material(&self, id: WallId) -> Result<Option<Material<S>>, Error> {
        self.row(id).map(|row| self.material.get(row))
    }

    /// Shapes of all walls, by index.
    #[must_use]
    pub fn shapes(&self) -> &[WallShape<S>] {
        &self.shapes
    }

    /// Index of a wall, valid until the next removal.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`].
    pub fn row(&self, id: WallId) -> Result<usize, Error> {
        self.handles.row(id.0).ok_or(Error::NoSuchWall(id))
    }

    /// Handle of the wall at an index.
    #[must_use]
    pub fn id(&self, row: usize) -> Option<WallId> {
        self.handles.handle(row).map(WallId)
    }

    /// Motion of the wall at an index.
    pub(super) fn motion_of_row(&self, row: usize) -> Option<WallMotion<S>> {
        self.motion.get(row)
    }

    /// Returns true if the wall at an index was set to another pose since the last step.
    pub(super) fn has_moved(&self, row: usize) -> bool {
        self.moved.get(row).is_some()
    }

    /// Boxes about all that walls sweep that turn on their way through this step.
    pub(super) fn turning_regions(&self) -> impl Iterator<Item = Aabb3<S>> + '_ {
        let rows = (0..self.shapes.len()).filter(|row| self.has_moved(*row));
        rows.filter_map(|row| {
            let motion = self.motion.get(row).filter(|it| !it.angular_velocity.is_zero())?;
            let bounds = self.shapes[row].bounding_box()?;
            let farthest = bounds.farthest_distance(motion.pivot);
            let reach = Vec3::new(farthest, farthest, farthest);
            Some(Aabb3 { min: motion.pivot - reach, max: motion.pivot + reach })
        })
    }

    /// Moves walls that were set to another pose since the last step, and have a motion, to their
    /// interpolated pose `left` seconds before the end of the step.
    pub(super) fn interpolate_to(&mut self, left: S) {
        if self.ends.is_empty() && left > S::zero() {
            let rows = (0..self.shapes.len()).filter(|row| self.moved.get(*row).is_some());
            let ends = rows.filter_map(|row| {
                Some((self.id(row)?, self.shapes[row].clone(), self.motion.get(row)?))
            });
            *self.ends = ends.collect();
        }
        for (id, end, motion) in self.ends.iter() {
            let Some(row) = self.handles.row(id.0) else { continue };
            // An invalid pose is skipped.
            let on_its_way =
                || end.transformed(motion.pose_before(left)).and_then(WallShape::validated).ok();
            let shape = if left > S::zero() { on_its_way() } else { None };
            self.shapes[row] = shape.unwrap_or_else(|| end.clone());
            let pivot = Some(motion.pivot - motion.velocity * left).filter(|p| is_finite_point(*p));
            let pivot = pivot.unwrap_or(motion.pivot);
            self.motion.set(row, Some(WallMotion { pivot, ..*motion }), self.shapes.len());
            *self.dirty = self.dirty.max(Dirty::Poses);
        }
    }

    /// Takes a wall that is set within a step off its way: it stays as it is set.
    fn leave_way(&mut self, id: WallId) {
        self.ends.retain(|(other, ..)| *other != id);
    }

    /// Moves walls back to their final poses, and forgets these.
    pub(super) fn end_interpolation(&mut self) {
        self.interpolate_to(S::zero());
        self.ends.clear();
    }

    /// Ends a step: all walls are at their final poses.
    pub(super) fn finish_step(&mut self) {
        self.end_interpolation();
        self.moved.clear();
    }

    /// The wall's own material, by index.
    pub(super) fn material_of_row(&self, row: usize) -> Option<Material<S>> {
        self.material.get(row)
    }

    /// Returns true if any wall has its own material.
    pub(super) fn have_materials(&self) -> bool {
        !self.material.is_empty()
    }

    /// Number of insertions, removals and changes so far: unchanged as long as the walls are.
    #[must_use]
    pub fn version(&self) -> u64 {
        *self.version
    }

    /// Number of removals so far.
    pub(super) fn removals(&self) -> u64 {
        self.handles.removals()
    }

    /// The number of walls.
    #[must_use]
    pub fn len(&self) -> usize {
        self.shapes.len()
    }

    /// Returns true without any wall.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.shapes.is_empty()
    }
}

impl<S: Scalar> response::Colliders<S> for Walls<S> {
    fn normal_and_distance(&self, wall: usize, part: u32, point: Point3<S>) -> (Vec3<S>, S) {
        let PointProjection { normal, distance, .. } =
            self.shapes[wall].project_point_on(part, point);
        (normal, distance)
    }

    fn surface_velocity(&self, wall: usize, point: Point3<S>, normal: Vec3<S>) -> Vec3<S> {
        self.surface_velocity_of_row(wall, point, normal)
    }
}
