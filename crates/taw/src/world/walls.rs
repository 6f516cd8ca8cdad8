use cgmath::Zero;

use super::handles::{Handle, Handles};
use super::optional::Optional;
use super::wall_shape::WallShape;
use crate::Error;
use crate::contact::Closest;
use crate::error::{finite_point, finite_vector};
use crate::math::{Point3, Scalar, Vec3, is_finite_point};
use crate::motion::WallMotion;
use crate::response::{self, Material};
use crate::shape::{Box3, BoxTree, Capsule, Nearest, Plane};

/// Names a wall for as long as it is in the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct WallId(Handle);

/// A wall, and one of its parts: of a compound, or a triangle of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Part {
    pub wall: u32,
    pub part: u32,
}

/// What no contact can move: half-spaces and shapes, fixed or moved by the user.
#[derive(Clone, Debug)]
pub struct Walls<S> {
    handles: Handles,
    shapes: Vec<WallShape<S>>,
    /// The rows of half-spaces, in order: every step asks for them, among however many others.
    planes: Vec<u32>,
    /// Only of those that move.
    motion: Optional<WallMotion<S>>,
    /// Only of those that have one of their own.
    material: Optional<Material<S>>,
    /// Those that were set to another place since the last step.
    moved: Optional<()>,
    /// Where those end that are on their way through a step, and how they then move, by row.
    ends: Vec<(usize, WallShape<S>, WallMotion<S>)>,
    /// The boxes of those that are no half-spaces, and what is in them.
    boxes: Vec<Box3<S>>,
    parts: Vec<Part>,
    tree: BoxTree<S>,
    stale: Stale,
    /// How often a wall came, went, or changed.
    version: u64,
}

/// What changed since the tree was built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
enum Stale {
    #[default]
    Nothing,
    Places,
    All,
}

impl<S> Default for Walls<S> {
    fn default() -> Self {
        Self {
            handles: Handles::default(),
            shapes: Vec::new(),
            planes: Vec::new(),
            motion: Optional::default(),
            material: Optional::default(),
            moved: Optional::default(),
            ends: Vec::new(),
            boxes: Vec::new(),
            parts: Vec::new(),
            tree: BoxTree::default(),
            stale: Stale::Nothing,
            version: 0,
        }
    }
}

impl<S: Scalar> PartialEq for Walls<S> {
    fn eq(&self, other: &Self) -> bool {
        // The rest follows from the shapes.
        let Self { handles, shapes, motion, material, moved, .. } = self;
        *handles == other.handles
            && *shapes == other.shapes
            && *motion == other.motion
            && *material == other.material
            && *moved == other.moved
    }
}

impl<S: Scalar> Walls<S> {
    /// Adds a wall: a half-space, any shape, a mesh or a height field.
    ///
    /// # Errors
    /// [`Error::Full`] at 2³² walls; for a number that a wall cannot have, as the constructor of
    /// its shape, or [`Pose::checked`](crate::frame::Pose::checked).
    pub fn insert(&mut self, wall: impl Into<WallShape<S>>) -> Result<WallId, Error> {
        let shape = wall.into().checked()?;
        let handle = self.handles.push()?;
        self.change(&shape, Stale::All);
        if matches!(shape, WallShape::Plane(_)) {
            self.planes.push(self.shapes.len() as u32);
        }
        self.shapes.push(shape);
        let rows = self.shapes.len();
        self.motion.set(rows - 1, None, rows);
        self.material.set(rows - 1, None, rows);
        self.moved.set(rows - 1, None, rows);
        Ok(WallId(handle))
    }

    /// Takes a wall out and gives it back.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`].
    pub fn remove(&mut self, id: WallId) -> Result<WallShape<S>, Error> {
        let row = self.handles.swap_remove(id.0);
        let row = row.ok_or(Error::NoSuchWall(id))?;
        self.motion.swap_remove(row);
        self.material.swap_remove(row);
        self.moved.swap_remove(row);
        // Another wall has this row now.
        self.stale = Stale::All;
        self.version += 1;
        let shape = self.shapes.swap_remove(row);
        self.list_planes();
        Ok(shape)
    }

    /// The wall.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`].
    pub fn get(&self, id: WallId) -> Result<&WallShape<S>, Error> {
        self.row(id).map(|row| &self.shapes[row])
    }

    /// Moves a wall to a new place, or makes another one of it. Marbles that are then inside
    /// are pushed out by the next step.
    ///
    /// # Errors
    /// [`Error::NoSuchWall`]; for a shape as [`Walls::insert`].
    pub fn set(&mut self, id: WallId, wall: impl Into<WallShape<S>>) -> Result<(), Error> {
        let row = self.row(id)?;
        let shape = wall.into().checked()?;
        let parts = |shape: &WallShape<S>| {
            let mut count = 0;
            shape.boxes(|_, _| count += 1);
            count
        };
        let same = parts(&shape) == parts(&self.shapes[row]);
        if !shape.is_where(&self.shapes[row]) {
            self.moved.set(row, Some(()), self.shapes.len());
        }
        self.change(&shape, if same { Stale::Places } else { Stale::All });
        let is_plane = |shape: &WallShape<S>| matches!(shape, WallShape::Plane(_));
        let turns = is_plane(&shape) != is_plane(&self.shapes[row]);
        self.shapes[row] = shape;
        if turns {
            self.list_planes();
        }
        Ok(())
    }

    fn list_planes(&mut self) {
        self.planes.clear();
        let rows = (0..).zip(&self.shapes);
        let planes = rows.filter(|(_, shape)| matches!(shape, WallShape::Plane(_)));
        self.planes.extend(planes.map(|(row, _)| row));
    }

    /// Notes that a wall is new or elsewhere.
    fn change(&mut self, shape: &WallShape<S>, stale: Stale) {
        self.version += 1;
        if stale == Stale::All || !matches!(shape, WallShape::Plane(_)) {
            self.stale = self.stale.max(stale);
        }
    }

    /// Brings the tree up to date. Walls that only moved are refitted.
    pub(super) fn prepare(&mut self) {
        if self.stale == Stale::Nothing {
            return;
        }
        self.boxes.clear();
        self.parts.clear();
        for (wall, shape) in (0..).zip(&self.shapes) {
            shape.boxes(|part, bounds| {
                self.parts.push(Part { wall, part });
                self.boxes.push(bounds);
            });
        }
        if self.stale == Stale::Places {
            self.tree.refit(&self.boxes);
        } else {
            self.tree = BoxTree::new(&self.boxes);
        }
        self.stale = Stale::Nothing;
    }

    /// Whether all walls are half-spaces.
    pub(super) fn are_planes(&self) -> bool {
        self.parts.is_empty()
    }

    /// Names the parts of walls, but for half-spaces, that may have a point in common with a
    /// box.
    pub(super) fn near(&self, bounds: &Box3<S>, mut name: impl FnMut(Part)) {
        self.tree.near(bounds, |item| {
            let Part { wall, part } = self.parts[item as usize];
            self.shapes[wall as usize].near(part, bounds, |part| name(Part { wall, part }));
        });
    }

    /// Names the parts of walls, but for half-spaces, that may be within `reach` metres of a
    /// point.
    pub(super) fn around(&self, point: Point3<S>, reach: S, mut name: impl FnMut(Part)) {
        self.tree.around(point, reach, |item| {
            let Part { wall, part } = self.parts[item as usize];
            self.shapes[wall as usize].around(part, point, reach, |part| name(Part { wall, part }));
            reach
        });
    }

    /// Where a part is nearest to a point.
    pub(super) fn nearest(&self, Part { wall, part }: Part, point: Point3<S>) -> Nearest<S> {
        self.shapes[wall as usize].nearest_of(part, point)
    }

    /// Where a part is nearest to a capsule, unless it is a half-space.
    pub(super) fn closest(
        &self,
        Part { wall, part }: Part,
        capsule: &Capsule<S>,
    ) -> Option<Closest<S>> {
        self.shapes[wall as usize].closest(part, capsule)
    }

    /// All half-spaces, with their rows.
    pub(super) fn planes(&self) -> impl Iterator<Item = (u32, &Plane<S>)> {
        self.planes.iter().filter_map(|row| match &self.shapes[*row as usize] {
            WallShape::Plane(plane) => Some((*row, plane)),
            _ => None,
        })
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
        self.version += u64::from(self.motion.get(row) != motion);
        self.motion.set(row, motion, self.shapes.len());
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
        self.version += u64::from(self.material.get(row) != material);
        self.material.set(row, material, self.shapes.len());
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
    pub fn shapes(&self) -> &[WallShape<S>] {
        &self.shapes
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

    /// Whether the wall in a row was set to another place since the last step.
    pub(super) fn has_moved(&self, row: usize) -> bool {
        self.moved.get(row).is_some()
    }

    /// Puts walls that were set to another place since the last step, and have a motion, to where
    /// that led them `left` seconds before the end of the step.
    pub(super) fn go_to(&mut self, left: S) {
        if self.ends.is_empty() && left > S::zero() {
            let rows = (0..self.shapes.len()).filter(|row| self.moved.get(*row).is_some());
            let ends =
                rows.filter_map(|row| Some((row, self.shapes[row].clone(), self.motion.get(row)?)));
            self.ends = ends.collect();
        }
        for (row, end, motion) in &self.ends {
            // A place that it cannot have is none that it comes by.
            let on_its_way = || end.moved(motion.undone(left)).and_then(WallShape::checked).ok();
            let shape = if left > S::zero() { on_its_way() } else { None };
            self.shapes[*row] = shape.unwrap_or_else(|| end.clone());
            let pivot = Some(motion.pivot - motion.velocity * left).filter(|p| is_finite_point(*p));
            let pivot = pivot.unwrap_or(motion.pivot);
            self.motion.set(*row, Some(WallMotion { pivot, ..*motion }), self.shapes.len());
            self.stale = self.stale.max(Stale::Places);
        }
    }

    /// Notes that a step is over: all walls are where they are to stay.
    pub(super) fn arrive(&mut self) {
        self.go_to(S::zero());
        self.ends.clear();
        self.moved.clear();
    }

    /// The own material of the wall in a row.
    pub(super) fn material_of_row(&self, row: usize) -> Option<Material<S>> {
        self.material.get(row)
    }

    /// Count of all insertions, removals and changes so far: as long as it is the same, so are
    /// the walls.
    #[must_use]
    pub fn version(&self) -> u64 {
        self.version
    }

    /// How many walls were taken out so far.
    pub(super) fn removals(&self) -> u64 {
        self.handles.removals()
    }

    /// The number of walls.
    #[must_use]
    pub fn len(&self) -> usize {
        self.shapes.len()
    }

    /// Whether there are no walls.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.shapes.is_empty()
    }
}

impl<S: Scalar> response::Colliders<S> for Walls<S> {
    fn normal_and_distance(&self, wall: usize, part: u32, point: Point3<S>) -> (Vec3<S>, S) {
        let Nearest { normal, distance, .. } = self.shapes[wall].nearest_of(part, point);
        (normal, distance)
    }

    fn surface_velocity(&self, wall: usize, point: Point3<S>) -> Vec3<S> {
        self.motion.get(wall).map_or_else(Vec3::zero, |motion| motion.velocity_at(point))
    }

    fn material(&self, wall: usize) -> Option<Material<S>> {
        self.material.get(wall)
    }
}
