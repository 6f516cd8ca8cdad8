use cgmath::EuclideanSpace;

use super::{Aabb, Aabb3, BoundedShape, Bvh, Triangle};
use crate::Error;
use crate::error::{finite_point, positive, within};
use crate::math::{Point3, Scalar, Vec3, is_finite_point, length};

/// A triangle surface, such as a landscape or a track. It has no volume.
pub trait Surface<S: Scalar> {
    /// A triangle by its index.
    #[must_use]
    fn triangle(&self, number: u32) -> Option<Triangle<S>>;

    /// Visits all triangles that may overlap a box, and some more.
    fn for_each_in_box(&self, bounds: &Aabb3<S>, visit: impl FnMut(u32));

    /// Visits all triangles that may be within `reach` metres of a point, and some more, roughly
    /// nearest first. `visit` returns the reach from then on.
    fn for_each_near(&self, point: Point3<S>, reach: S, visit: impl FnMut(u32) -> S);

    /// Bounding box.
    #[must_use]
    fn bounds(&self) -> Aabb3<S>;

    /// Visits all triangles that may cross the segment from a point along a motion, and some more.
    fn for_each_on_segment(&self, from: Point3<S>, motion: Vec3<S>, visit: impl FnMut(u32));
}

/// Indexed triangle mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh<S> {
    points: Vec<Point3<S>>,
    triangles: Vec<[u32; 3]>,
    tree: Bvh<S>,
}

impl<S: Scalar> Mesh<S> {
    /// Validates a mesh. Triangles may be slivers, or have no area.
    ///
    /// # Errors
    /// [`Error::NotFinite`] for a point, [`Error::OutOfRange`] for no triangles, or for a vertex
    /// index out of range.
    pub fn new(points: Vec<Point3<S>>, triangles: Vec<[u32; 3]>) -> Result<Self, Error> {
        for point in &points {
            finite_point(["points.x", "points.y", "points.z"], *point)?;
        }
        let count = |length: usize| f64::from(u32::try_from(length).unwrap_or(u32::MAX));
        within("triangles.len()", count(triangles.len()), 1.0, f64::from(u32::MAX - 1))?;
        for corner in triangles.iter().flatten() {
            within("triangles", f64::from(*corner), 0.0, count(points.len()) - 1.0)?;
        }
        let mut mesh = Self { points, triangles, tree: Bvh::default() };
        let boxes: Vec<_> = (0..mesh.triangles.len() as u32)
            .filter_map(|number| mesh.triangle(number))
            .map(|triangle| triangle.bounding_box())
            .collect();
        mesh.tree = Bvh::new(&boxes);
        Ok(mesh)
    }

    /// Vertices, in metres.
    #[must_use]
    pub fn points(&self) -> &[Point3<S>] {
        &self.points
    }

    /// Three vertex indices each.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }
}

impl<S: Scalar> Surface<S> for Mesh<S> {
    fn triangle(&self, number: u32) -> Option<Triangle<S>> {
        let corners = self.triangles.get(number as usize)?;
        Some(Triangle { corners: corners.map(|corner| self.points[corner as usize]) })
    }

    fn for_each_in_box(&self, bounds: &Aabb3<S>, visit: impl FnMut(u32)) {
        self.tree.for_each_in_box(bounds, visit);
    }

    fn for_each_near(&self, point: Point3<S>, reach: S, visit: impl FnMut(u32) -> S) {
        self.tree.for_each_near(point, reach, visit);
    }

    fn bounds(&self) -> Aabb3<S> {
        self.tree.bounds().unwrap_or(Aabb { min: Point3::origin(), max: Point3::origin() })
    }

    fn for_each_on_segment(&self, from: Point3<S>, motion: Vec3<S>, visit: impl FnMut(u32)) {
        self.tree.for_each_on_segment(from, motion, visit);
    }
}

/// Height field over a grid in the x–z plane, with two triangles per cell: the top of a solid that
/// has vertical sides, two triangles per edge of the border, and a flat bottom, two more. It is
/// below the lowest point by the diagonal of the field's bounding box.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightField<S> {
    corner: Point3<S>,
    cell: [S; 2],
    columns: u32,
    rows: u32,
    heights: Vec<S>,
    bottom: S,
    highest: S,
}

/// Vertical side of the solid below a height field.
struct Side<S> {
    /// Axis that it is perpendicular to, and the one that it runs along.
    axes: [usize; 2],
    /// Coordinate along the former, in metres.
    at: S,
    /// Index of its first triangle.
    first: u32,
}

impl<S: Scalar> HeightField<S> {
    /// Heights in metres above `corner`: `columns` of them along x, `cell[0]` metres apart,
    /// then the next row, `cell[1]` metres further along z.
    ///
    /// # Errors
    /// [`Error::NotFinite`] for the corner or a height, [`Error::NotPositive`] for a cell,
    /// [`Error::OutOfRange`] for fewer than two columns, or heights that are not two or
    /// more full rows.
    pub fn new(
        corner: Point3<S>,
        cell: [S; 2],
        columns: u32,
        heights: Vec<S>,
    ) -> Result<Self, Error> {
        finite_point(["corner.x", "corner.y", "corner.z"], corner)?;
        positive("cell[0]", cell[0])?;
        positive("cell[1]", cell[1])?;
        within("columns", f64::from(columns), 2.0, f64::from(u32::MAX))?;
        let count = u32::try_from(heights.len()).unwrap_or(u32::MAX);
        let rows = count / columns;
        // Two triangles per cell, and per edge of the border, are indexed with 32 bits.
        let whole = f64::from(rows.max(2)) * f64::from(columns);
        within("heights.len()", f64::from(count), whole, whole.min(f64::from(u32::MAX / 4)))?;
        for height in &heights {
            crate::error::finite("heights", *height)?;
        }
        let lowest = heights.iter().fold(S::infinity(), |low, height| low.min(*height));
        let highest = heights.iter().fold(S::neg_infinity(), |high, height| high.max(*height));
        let bottom = corner.y + lowest;
        let mut field = Self { corner, cell, columns, rows, heights, bottom, highest };
        let top = field.bounds();
        field.bottom -= length(top.max - top.min);
        // Individually valid numbers may overflow together.
        let Aabb { min, max } = field.bounds();
        finite_point(["corner.x", "corner.y", "corner.z"], min)?;
        finite_point(["columns * cell[0]", "heights", "rows * cell[1]"], max)?;
        Ok(field)
    }

    fn point(&self, column: u32, row: u32) -> Point3<S> {
        let along = |cells: u32, width: S| S::from_f64(f64::from(cells)) * width;
        let (x, z) = (along(column, self.cell[0]), along(row, self.cell[1]));
        Point3::new(self.corner.x + x, self.height(column, row), self.corner.z + z)
    }

    /// Signed height of the surface above a point, in metres along y; none outside the field.
    #[must_use]
    pub fn signed_height(&self, point: Point3<S>) -> Option<S> {
        let place = |x: S, start: S, width: S, cells: u32| {
            let place = (x - start) / width;
            let cell = place.as_f64().floor().clamp(0.0, f64::from(cells - 1));
            let part = place - S::from_f64(cell);
            let inside = place >= S::zero() && place <= S::from_f64(f64::from(cells));
            inside.then_some((cell as u32, part))
        };
        let (column, x) = place(point.x, self.corner.x, self.cell[0], self.columns - 1)?;
        let (row, z) = place(point.z, self.corner.z, self.cell[1], self.rows - 1)?;
        let near = self.height(column, row);
        let far = self.height(column + 1, row + 1);
        // The two triangles of a cell meet along the diagonal from near to far.
        let surface = if x >= z {
            let right = self.height(column + 1, row);
            near + (right - near) * x + (far - right) * z
        } else {
            let left = self.height(column, row + 1);
            near + (left - near) * z + (far - left) * x
        };
        Some(surface - point.y)
    }

    fn height(&self, column: u32, row: u32) -> S {
        self.corner.y + self.heights[row as usize * self.columns as usize + column as usize]
    }

    /// Tests if a point is in the solid.
    pub(crate) fn has_inside(&self, point: Point3<S>) -> bool {
        let below = self.signed_height(point).is_some_and(|height| height > S::zero());
        below && point.y > self.bottom
    }

    /// Number of the triangles of the top, which come before those of the sides.
    fn top_len(&self) -> u32 {
        2 * (self.columns - 1) * (self.rows - 1)
    }

    /// Tests if the triangle with this index is one of the top.
    pub(crate) fn is_top(&self, number: u32) -> bool {
        number < self.top_len()
    }

    /// Sides: the first row, the last, the first column, the last.
    fn sides(&self) -> [Side<S>; 4] {
        let Aabb { min, max } = self.bounds();
        let (along_x, along_z) = (2 * (self.columns - 1), 2 * (self.rows - 1));
        let first = self.top_len();
        let side = |axes, at, first| Side { axes, at, first };
        [
            side([2, 0], min.z, first),
            side([2, 0], max.z, first + along_x),
            side([0, 2], min.x, first + 2 * along_x),
            side([0, 2], max.x, first + 2 * along_x + along_z),
        ]
    }

    /// Triangle of the sides or of the bottom, by its index after those of the top.
    fn side_triangle(&self, number: u32) -> Option<Triangle<S>> {
        let (columns, rows) = (self.columns - 1, self.rows - 1);
        let below = |point: Point3<S>| Point3::new(point.x, self.bottom, point.z);
        let edge = number / 2;
        // Points of the edge, from left to right as seen from outside with up as up.
        let [p, q] = match edge {
            _ if edge < columns => [(edge + 1, 0), (edge, 0)],
            _ if edge < 2 * columns => [(edge - columns, rows), (edge - columns + 1, rows)],
            _ if edge < 2 * columns + rows => {
                [(0, edge - 2 * columns), (0, edge - 2 * columns + 1)]
            }
            _ if edge < 2 * (columns + rows) => {
                let row = edge - 2 * columns - rows;
                [(columns, row + 1), (columns, row)]
            }
            _ if edge == 2 * (columns + rows) => {
                let far = below(self.point(columns, rows));
                let near = below(self.point(0, 0));
                let [right, left] = [(columns, 0), (0, rows)].map(|(x, z)| below(self.point(x, z)));
                let is_first = number.is_multiple_of(2);
                let corners = if is_first { [near, right, far] } else { [near, far, left] };
                return Some(Triangle { corners });
            }
            _ => return None,
        };
        let [p, q] = [p, q].map(|(column, row)| self.point(column, row));
        let corners =
            if number.is_multiple_of(2) { [p, below(q), q] } else { [p, below(p), below(q)] };
        Some(Triangle { corners })
    }

    /// Visits the triangles of the sides and of the bottom that may overlap a box, and some more.
    fn for_each_side_in_box(&self, bounds: &Aabb3<S>, mut visit: impl FnMut(u32)) {
        let whole = self.bounds();
        if !whole.overlaps(bounds) {
            return;
        }
        for Side { axes: [across, along], at, first } in self.sides() {
            if at >= bounds.min[across] && at <= bounds.max[across] {
                let edges = self.edges(along, [bounds.min[along], bounds.max[along]]);
                (2 * edges.start..2 * edges.end).for_each(|number| visit(first + number));
            }
        }
        if bounds.min.y <= self.bottom {
            let first = self.top_len() + 4 * (self.columns - 1 + self.rows - 1);
            visit(first);
            visit(first + 1);
        }
    }

    /// Edges of the border between two coordinates along an axis.
    fn edges(&self, axis: usize, interval: [S; 2]) -> std::ops::Range<u32> {
        if axis == 0 { self.columns(interval) } else { self.rows(interval) }
    }

    /// Range of the cells, of `count` points spaced by `width` from `start`, that overlap an
    /// interval, including those within rounding.
    fn range([from, to]: [S; 2], start: S, width: S, count: u32) -> std::ops::Range<u32> {
        let cells = f64::from(count - 1);
        let largest = from.abs().max(to.abs()).max(start.abs()) / width;
        let rounding = 8.0 * (S::epsilon() * largest).as_f64();
        let place = |x: S| ((x - start) / width).as_f64();
        let first = (place(from) - rounding).floor().clamp(0.0, cells);
        let end = ((place(to) + rounding).floor() + 1.0).clamp(0.0, cells);
        first as u32..end as u32
    }

    /// Row and column of the cell of a triangle.
    fn place(&self, number: u32) -> (u32, u32) {
        let cell = number / 2;
        (cell / (self.columns - 1), cell % (self.columns - 1))
    }

    /// Visits the triangles of the cells in these columns that overlap a box in x–z.
    fn cells(&self, columns: std::ops::Range<u32>, bounds: &Aabb3<S>, mut visit: impl FnMut(u32)) {
        for row in self.rows([bounds.min.z, bounds.max.z]) {
            for column in columns.clone() {
                let cell = row * (self.columns - 1) + column;
                visit(2 * cell);
                visit(2 * cell + 1);
            }
        }
    }

    /// Rows between two coordinates along z.
    fn rows(&self, [from, to]: [S; 2]) -> std::ops::Range<u32> {
        Self::range([from, to], self.corner.z, self.cell[1], self.rows)
    }

    /// Columns between two coordinates along x.
    fn columns(&self, [from, to]: [S; 2]) -> std::ops::Range<u32> {
        Self::range([from, to], self.corner.x, self.cell[0], self.columns)
    }
}

impl<S: Scalar> Surface<S> for HeightField<S> {
    fn triangle(&self, number: u32) -> Option<Triangle<S>> {
        if let Some(side) = number.checked_sub(self.top_len()) {
            return self.side_triangle(side);
        }
        let (row, column) = self.place(number);
        let near = self.point(column, row);
        let far = self.point(column + 1, row + 1);
        // Counterclockwise as seen from above.
        let corners = if number.is_multiple_of(2) {
            [near, far, self.point(column + 1, row)]
        } else {
            [near, self.point(column, row + 1), far]
        };
        Some(Triangle { corners })
    }

    fn for_each_in_box(&self, bounds: &Aabb3<S>, mut visit: impl FnMut(u32)) {
        if !is_finite_point(bounds.min) || !is_finite_point(bounds.max) {
            return;
        }
        self.cells(self.columns([bounds.min.x, bounds.max.x]), bounds, |number| {
            let (row, column) = self.place(number);
            let height = |right: u32, down: u32| self.height(column + right, row + down);
            let one = if number.is_multiple_of(2) { height(1, 0) } else { height(0, 1) };
            let (near, far) = (height(0, 0), height(1, 1));
            let (lowest, highest) = (near.min(far).min(one), near.max(far).max(one));
            if lowest <= bounds.max.y && highest >= bounds.min.y {
                visit(number);
            }
        });
        self.for_each_side_in_box(bounds, visit);
    }

    fn for_each_near(&self, point: Point3<S>, mut reach: S, mut visit: impl FnMut(u32) -> S) {
        let here = self.columns([point.x, point.x]).zip(self.rows([point.z, point.z])).next();
        let mut cell = |column: u32, row: u32, reach: S| {
            let number = 2 * (row * (self.columns - 1) + column);
            let reach = visit(number).min(reach);
            visit(number + 1).min(reach)
        };
        if let Some((column, row)) = here {
            reach = cell(column, row, reach);
        }
        // Distance of a cell from the point along one axis, at least.
        let gap = |cell: u32, start: S, width: S, at: S| {
            let left = start + S::from_f64(f64::from(cell)) * width;
            (left - at).max(at - (left + width)).max(S::zero())
        };
        let columns = self.columns([point.x - reach, point.x + reach]);
        let more = S::one() + S::epsilon() * S::from_f64(64.0);
        for row in self.rows([point.z - reach, point.z + reach]) {
            let across = gap(row, self.corner.z, self.cell[1], point.z);
            for column in columns.clone() {
                let along = gap(column, self.corner.x, self.cell[0], point.x);
                let corners = [[0, 0], [1, 0], [0, 1], [1, 1]]
                    .map(|[right, down]| self.height(column + right, row + down));
                let [low, high] = [S::min, S::max].map(|f| corners.into_iter().fold(corners[0], f));
                let up = (low - point.y).max(point.y - high).max(S::zero());
                let squared = along * along + across * across + up * up;
                if squared <= reach * reach * more && here != Some((column, row)) {
                    reach = cell(column, row, reach);
                }
            }
        }
        let far = Vec3::new(reach, reach, reach) * more;
        let bounds = Aabb { min: point - far, max: point + far };
        self.for_each_side_in_box(&bounds, |number| {
            visit(number);
        });
    }

    fn bounds(&self) -> Aabb3<S> {
        let far = self.point(self.columns - 1, self.rows - 1);
        let low = Vec3::new(self.corner.x, self.bottom, self.corner.z);
        let high = Vec3::new(far.x, self.corner.y + self.highest, far.z);
        Aabb { min: Point3::from_vec(low), max: Point3::from_vec(high) }
    }

    fn for_each_on_segment(&self, from: Point3<S>, motion: Vec3<S>, mut visit: impl FnMut(u32)) {
        let to = from + motion;
        if !is_finite_point(from) || !is_finite_point(to) {
            return;
        }
        // Box of the part of the segment between two coordinates along an axis.
        let between = |axis: usize, interval: [S; 2]| {
            let part = |x: S, straight: S| {
                let (start, motion) = (from[axis], motion[axis]);
                let part = if motion == S::zero() { straight } else { (x - start) / motion };
                part.max(S::zero()).min(S::one())
            };
            let ends = [part(interval[0], S::zero()), part(interval[1], S::one())];
            let [p, q] = ends.map(|part| from + motion * part);
            Aabb { min: p, max: p }.union(&Aabb { min: q, max: q })
        };
        // Column by column, the rows that the segment crosses meanwhile.
        for column in self.columns([from.x.min(to.x), from.x.max(to.x)]) {
            let left = self.corner.x + S::from_f64(f64::from(column)) * self.cell[0];
            let meanwhile = between(0, [left, left + self.cell[0]]);
            self.cells(column..column + 1, &meanwhile, &mut visit);
        }
        for Side { axes: [across, along], at, first } in self.sides() {
            let [start, end] = [from[across].min(to[across]), from[across].max(to[across])];
            let rounding = S::epsilon() * S::from_f64(8.0) * start.abs().max(end.abs());
            if at >= start - rounding && at <= end + rounding {
                let meanwhile = between(across, [at - rounding, at + rounding]);
                let edges = self.edges(along, [meanwhile.min[along], meanwhile.max[along]]);
                (2 * edges.start..2 * edges.end).for_each(|number| visit(first + number));
            }
        }
        let bottom = self.top_len() + 4 * (self.columns - 1 + self.rows - 1);
        if from.y.min(to.y) <= self.bottom {
            visit(bottom);
            visit(bottom + 1);
        }
    }
}
