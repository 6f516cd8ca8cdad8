//! The order of the rows: cell by cell, layer by layer.
//!
//! Cells of level 0 are as wide as the largest ball and the skin; each further level quarters them.
//! A ball is in the finest level whose cells are as wide as itself and the skin. The layers of
//! level 0 are cut across the longest side of the scene; each of them holds, level by level, the
//! cells that lie in it, row by row along the second side, each row along the third. So three
//! neighbouring cells of a row are one run of balls, and all partners of a ball are in its own
//! layer and the two beside it.

use std::ops::Range;

use bytemuck::{Pod, cast_slice_mut};

use super::impulse_cache::shrink_slack;
use super::state::of;
use crate::math::{Row, Scalar};
use crate::workers::{DisjointSlice, ROWS, parallel_for, parallel_for_rows};

/// Number of cells: for each ball, and in addition.
const CELLS_PER_BALL: f64 = 2.0;
const CELLS: f64 = 4096.0;
/// The most cells along a side on level 0, so that rounding stays far below the margin.
const SIDE: f64 = 4096.0;
/// Cells are wider than they need be by this part, which is more than rounding takes.
const MARGIN: f64 = 1.005;
/// Halvings of cells at most, and from one level to the next: with a level for
/// each halving, most time goes into looking up empty cells.
const HALVINGS: usize = 6;
const HALVINGS_PER_LEVEL: usize = 2;
/// Number of balls that are asked where the scene is.
const SAMPLE: usize = 1024;

/// One level of cells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Level<S> {
    /// Cells per metre.
    per_metre: S,
    /// The widest ball that belongs here, in metres.
    widest: S,
    /// Number of layers, and of cells in them in rows and along a row, without empty ones around.
    pub layers: u32,
    rows: u32,
    cells: u32,
    /// The first cell of this level in a layer of level 0.
    base: u32,
    /// Number of times that cells were halved.
    pub number: u32,
    /// Cells in a row and in a layer, with the empty ones around.
    pub row_stride: u32,
    pub layer_stride: u32,
}

/// See the module.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SortedGrid<S> {
    /// The sides of the scene, the longest first.
    axes: [usize; 3],
    low: [S; 3],
    pub levels: Vec<Level<S>>,
    /// Number of cells of all levels in a layer of level 0.
    per_layer: u32,
    /// The first row of each cell, one place further, and of the one after the last.
    start: Vec<u32>,
    parts: Vec<GridPart>,
    sample: Vec<S>,
}

/// Some rows that follow each other, before they are in order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct GridPart {
    first: u32,
    /// The first cell that one of them is in, and the last one.
    cells: [u32; 2],
}

impl<S: Scalar> Level<S> {
    /// The cell of these coordinates; empty cells lie at both ends of the rows and columns.
    #[inline(always)]
    pub fn cell(&self, grid: &SortedGrid<S>, layer: u32, row: u32, cell: u32) -> u32 {
        let inner = layer & ((1 << self.number) - 1);
        (layer >> self.number) * grid.per_layer
            + self.base
            + inner * self.layer_stride
            + row * self.row_stride
            + cell
    }

    /// Width of a cell, in metres.
    pub fn width(&self) -> S {
        S::one() / self.per_metre
    }

    /// Number of rows, and of cells in a row, with the empty ones around.
    pub fn size(&self) -> [u32; 2] {
        [self.rows + 2, self.cells + 2]
    }
}

impl<S: Scalar> SortedGrid<S> {
    pub fn bytes(&self) -> usize {
        of(&self.levels) + of(&self.start) + of(&self.sample) + of(&self.parts)
    }

    /// Number of layers of level 0.
    pub fn layers(&self) -> u32 {
        self.levels.first().map_or(0, |level| level.layers)
    }

    /// The first row of a layer of level 0.
    pub fn first_of_layer(&self, layer: u32) -> u32 {
        self.first(layer * self.per_layer)
    }

    /// The first row of a cell, or of the one after the last.
    #[inline(always)]
    pub fn first(&self, cell: u32) -> u32 {
        self.start[cell as usize + 1]
    }

    /// First row of each cell in a line, and of the one after them.
    pub fn starts(&self, cell: u32, count: u32) -> &[u32] {
        &self.start[cell as usize + 1..(cell + count) as usize + 2]
    }

    /// The level of a ball with this radius.
    #[inline(always)]
    pub fn level_of(&self, radius: S) -> usize {
        let fits = |level: &Level<S>| S::from_f64(2.0) * radius <= level.widest;
        self.levels.iter().skip(1).take_while(|level| fits(level)).count()
    }

    /// Layer, row and cell of a place on a level.
    #[inline(always)]
    pub fn coordinates(&self, level: &Level<S>, at: &Row<S>) -> [u32; 3] {
        let axis = |i: usize, count: u32| {
            let axis = self.axes[i];
            let cell = (at[axis] - self.low[axis]) * level.per_metre;
            // What is beyond is in the last cell: neighbours stay neighbours.
            cell.max(S::zero()).floor_to_u32().min(count - 1)
        };
        [axis(0, level.layers), axis(1, level.rows) + 1, axis(2, level.cells) + 1]
    }

    /// Visits the balls of a level in the cells that are within `far` metres of a place along each
    /// axis, as runs of rows.
    #[inline]
    pub fn for_each_run(
        &self,
        level: &Level<S>,
        &[x, y, z, _]: &Row<S>,
        far: S,
        mut visit: impl FnMut(Range<u32>),
    ) {
        let low = self.coordinates(level, &[x - far, y - far, z - far, S::zero()]);
        let high = self.coordinates(level, &[x + far, y + far, z + far, S::zero()]);
        for layer in low[0]..=high[0] {
            for row in low[1]..=high[1] {
                let line = level.cell(self, layer, row, 0);
                visit(self.first(line + low[2])..self.first(line + high[2] + 1));
            }
        }
    }

    /// The sides of the scene, as axes, the longest first.
    pub fn axes(&self) -> [usize; 3] {
        self.axes
    }

    #[inline(always)]
    fn key(&self, at: &Row<S>) -> u32 {
        let level = if self.levels.len() == 1 { 0 } else { self.level_of(at[3]) };
        let level = &self.levels[level];
        let [layer, row, cell] = self.coordinates(level, at);
        level.cell(self, layer, row, cell)
    }

    /// Corners of a box around the bulk of the balls, of which the largest has this radius: a few
    /// fast movers far out cost no cells.
    fn bounds_of_bulk(&mut self, at: &[Row<S>], largest: S) -> [[S; 3]; 2] {
        let (mut low, mut high) = ([S::zero(); 3], [S::zero(); 3]);
        let every = at.len().div_ceil(SAMPLE).max(1);
        for axis in 0..3 {
            self.sample.clear();
            self.sample.extend(at.iter().step_by(every).map(|row| row[axis]));
            self.sample.sort_unstable_by(S::total_cmp);
            let count = self.sample.len();
            if count == 0 {
                continue;
            }
            let (a, b) = (self.sample[count / 64], self.sample[count - 1 - count / 64]);
            let (first, last) = (self.sample[0], self.sample[count - 1]);
            let room = (b - a) * S::from_f64(0.1) + S::from_f64(4.0) * largest;
            (low[axis], high[axis]) =
                ((a - room).max(first - largest), (b + room).min(last + largest));
        }
        [low, high]
    }

    /// Chooses origin, size and number of the cells.
    fn choose_cells(&mut self, at: &[Row<S>], skin: S) {
        let (mut least, mut largest) = (S::max_value(), S::min_positive_value());
        for row in at {
            largest = largest.max(row[3]);
            least = least.min(row[3]);
        }
        let [low, high] = self.bounds_of_bulk(at, largest);
        self.low = low;
        let mut width = (S::from_f64(2.0) * largest + skin) * S::from_f64(MARGIN);
        let budget = at.len() as f64 * CELLS_PER_BALL + CELLS;
        let sides = |width: S| {
            [0, 1, 2].map(|axis| ((high[axis] - low[axis]) / width).ceil().max(S::one()))
        };
        let cells = |sides: [S; 3]| sides.iter().map(|n| n.as_f64() + 2.0).product::<f64>();
        while cells(sides(width)) > budget || sides(width).iter().any(|n| n.as_f64() > SIDE) {
            width *= S::from_f64(1.25);
        }
        let sides = sides(width);
        let mut axes = [0, 1, 2];
        axes.sort_by(|a, b| sides[*b].total_cmp(&sides[*a]));
        self.axes = axes;
        self.levels.clear();
        self.per_layer = 0;
        let mut total = 0.0;
        for level in (0..=HALVINGS as u32).step_by(HALVINGS_PER_LEVEL) {
            let fine = S::from_f64(f64::from(1_u32 << level));
            let widest = width / fine / S::from_f64(MARGIN) - skin;
            let count = cells(sides.map(|n| n * fine));
            total += count;
            if level > 0 && (S::from_f64(2.0) * least > widest || total > 2.0 * budget) {
                break;
            }
            let [layers, rows, cells] = axes.map(|axis| (sides[axis] * fine).floor_to_u32());
            let row_stride = cells + 2;
            let layer_stride = row_stride * (rows + 2);
            self.levels.push(Level {
                per_metre: fine / width,
                widest,
                layers,
                rows,
                cells,
                base: self.per_layer,
                number: level,
                row_stride,
                layer_stride,
            });
            self.per_layer += layer_stride << level;
        }
    }

    /// Sorts the rows into cells: `order` is, for each row of the new order, the one that it was.
    /// `scratch` is a buffer.
    pub fn sort(
        &mut self,
        at: &[Row<S>],
        skin: S,
        threads: usize,
        order: &mut [u32],
        scratch: &mut Vec<Row<S>>,
    ) {
        self.choose_cells(at, skin);
        let cells = (self.layers() * self.per_layer) as usize;
        let mut start = std::mem::take(&mut self.start);
        start.resize(cells + 2, 0);
        shrink_slack(&mut start);
        scratch.resize(at.len(), [S::zero(); 4]);
        let keys = cast_slice_mut(scratch);
        self.find_keys(at, threads, keys);
        let parts = &self.parts;
        // By cells. A cell is counted one further, and again one further.
        let share = |share: usize| cells * share / threads..cells * (share + 1) / threads;
        let mut totals = vec![0; threads];
        let (all_start, totals) = (DisjointSlice::new(&mut start), DisjointSlice::new(&mut totals));
        // The rows of the parts that have any in these cells, which are few: most rows are still
        // about where they belong. Each is named with its cell, counted from the first one.
        let rows_in = |cells: &Range<usize>, visit: &mut dyn FnMut(u32, usize)| {
            let (low, count) = (cells.start as u32, cells.len() as u32);
            for GridPart { first, cells } in parts {
                if cells[0] < low + count && cells[1] >= low {
                    let rows = *first as usize..at.len().min(*first as usize + ROWS);
                    for (row, key) in (*first..).zip(&keys[rows]) {
                        let cell = key.wrapping_sub(low);
                        if cell < count {
                            visit(row, cell as usize);
                        }
                    }
                }
            }
        };
        parallel_for(threads, threads, |_, number| {
            let mine = share(number);
            // SAFETY: each job has its own cells and its own total.
            let start = unsafe { all_start.part(mine.start + 2..mine.end + 2) };
            start.fill(0);
            let mut total = 0;
            rows_in(&mine, &mut |_, cell| {
                start[cell] += 1;
                total += 1;
            });
            unsafe { *totals.row(number) = total };
        });
        let all_order = DisjointSlice::new(order);
        parallel_for(threads, threads, |_, number| {
            let mine = share(number);
            // SAFETY: as above, and the totals are written.
            let start = unsafe { all_start.part(mine.start + 2..mine.end + 2) };
            let mut sum: u32 = unsafe { totals.read(0..number) }.iter().sum();
            for cell in start.iter_mut() {
                let count = *cell;
                *cell = sum;
                sum += count;
            }
            // Each cell's count has become the first row of the cell, two further: as rows are
            // placed, it grows to the first of the next cell, one further.
            rows_in(&mine, &mut |row, cell| {
                let place = &mut start[cell];
                // SAFETY: each row comes to one place.
                unsafe { *all_order.row(*place as usize) = row };
                *place += 1;
            });
        });
        // start[cell + 2] is now the first row after the cell.
        start[..2].fill(0);
        self.start = start;
    }

    /// Cell of each row, and the cells of each part of the rows.
    fn find_keys(&mut self, at: &[Row<S>], threads: usize, keys: &mut [u32]) {
        let mut parts = std::mem::take(&mut self.parts);
        parts.resize(at.len().div_ceil(ROWS), GridPart::default());
        {
            let (keys, parts) = (DisjointSlice::new(keys), DisjointSlice::new(&mut parts));
            parallel_for_rows(threads, at.len(), |rows| {
                // SAFETY: each job has its own rows and its own part.
                let keys = unsafe { keys.part(rows.clone()) };
                let mut cells = [u32::MAX, 0];
                for (key, at) in keys.iter_mut().zip(&at[rows.clone()]) {
                    *key = self.key(at);
                    cells = [cells[0].min(*key), cells[1].max(*key)];
                }
                unsafe {
                    *parts.row(rows.start / ROWS) = GridPart { first: rows.start as u32, cells }
                };
            });
        }
        self.parts = parts;
    }
}

/// Puts a column of rows into the order.
pub(super) fn reorder_rows<S: Scalar>(
    column: &mut Vec<Row<S>>,
    scratch: &mut Vec<Row<S>>,
    order: &[u32],
    threads: usize,
) {
    scratch.resize(order.len(), [S::zero(); 4]);
    gather_in_order(column, DisjointSlice::new(scratch), order, threads);
    std::mem::swap(column, scratch);
}

/// Puts a column of numbers into the order.
pub(super) fn reorder<S: Scalar, T: Pod + Send + Sync>(
    column: &mut [T],
    scratch: &mut Vec<Row<S>>,
    order: &[u32],
    threads: usize,
) {
    scratch.resize(order.len(), [S::zero(); 4]);
    let scratch = DisjointSlice::new(cast_slice_mut(scratch));
    gather_in_order(column, scratch, order, threads);
    let column = DisjointSlice::new(column);
    parallel_for_rows(threads, order.len(), |rows| {
        // SAFETY: each job has its own rows.
        let (to, from) = unsafe { (column.part(rows.clone()), scratch.read(rows)) };
        to.copy_from_slice(from);
    });
}

fn gather_in_order<T: Copy + Send + Sync>(
    from: &[T],
    to: DisjointSlice<T>,
    order: &[u32],
    threads: usize,
) {
    parallel_for_rows(threads, order.len(), |rows| {
        // SAFETY: each job has its own rows.
        let to = unsafe { to.part(rows.clone()) };
        for (to, row) in to.iter_mut().zip(&order[rows]) {
            *to = from[*row as usize];
        }
    });
}
