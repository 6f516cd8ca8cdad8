//! Broad phase for moving balls: each center is in one cell of a uniform grid until an event moves
//! it. Cells are as wide as the largest ball, so balls in contact are in neighbouring cells.

use crate::broad::Period;
use crate::math::Point3;

/// Coordinates of a cell.
pub(super) type Cell = [i64; 3];

/// End of a chain.
const EMPTY: u32 = u32::MAX;

/// Minimum number of buckets: of fewer, the neighbours of a cell would share many.
const MIN_BUCKETS: usize = 1024;

/// Spatial hash: rows per cell, as doubly linked chains of buckets.
#[derive(Clone, Debug, Default)]
pub(super) struct Cells {
    /// Cell width along each axis, in metres.
    width: [f64; 3],
    /// Number of cells per period along each axis; zero for an axis without a period.
    count: Cell,
    head: Vec<u32>,
    next: Vec<u32>,
    previous: Vec<u32>,
    bucket: Vec<u32>,
    cell: Vec<Cell>,
}

impl Cells {
    /// Empties the grid and sets the number of rows and the cell width in metres, widened so that a
    /// period has a whole number of cells.
    pub fn reset(&mut self, rows: usize, width: f64, period: Period<f64>) {
        for (axis, length) in period.lengths.iter().enumerate() {
            let count = length.map_or(0.0, |length| (length / width).floor());
            self.count[axis] = count as i64;
            self.width[axis] = length.map_or(width, |length| length / count);
        }
        self.head.clear();
        self.head.resize((2 * rows).next_power_of_two().max(MIN_BUCKETS), EMPTY);
        self.cell.clear();
        self.cell.resize(rows, [0; 3]);
        for list in [&mut self.next, &mut self.previous, &mut self.bucket] {
            list.clear();
            list.resize(rows, EMPTY);
        }
    }

    /// Cell width along each axis, in metres.
    pub fn width(&self) -> [f64; 3] {
        self.width
    }

    /// Smallest cell width, in metres.
    pub fn min_width(&self) -> f64 {
        self.width.into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Cell of a point.
    pub fn cell(&self, point: Point3<f64>) -> Cell {
        [0, 1, 2].map(|axis| (point[axis] / self.width[axis]).floor() as i64)
    }

    /// Periodic image of a cell.
    fn image(&self, cell: Cell) -> Cell {
        let wrap = |x: i64, count: i64| if count > 0 { x.rem_euclid(count) } else { x };
        [0, 1, 2].map(|axis| wrap(cell[axis], self.count[axis]))
    }

    /// Inserts a row that is in no cell.
    pub fn insert(&mut self, row: u32, cell: Cell) {
        let cell = self.image(cell);
        let bucket = self.bucket_of(cell);
        let first = std::mem::replace(&mut self.head[bucket], row);
        let index = row as usize;
        (self.next[index], self.previous[index]) = (first, EMPTY);
        (self.bucket[index], self.cell[index]) = (bucket as u32, cell);
        if first != EMPTY {
            self.previous[first as usize] = row;
        }
    }

    /// Removes a row from its cell.
    pub fn remove(&mut self, row: u32) {
        let index = row as usize;
        let (next, previous) = (self.next[index], self.previous[index]);
        if previous == EMPTY {
            self.head[self.bucket[index] as usize] = next;
        } else {
            self.next[previous as usize] = next;
        }
        if next != EMPTY {
            self.previous[next as usize] = previous;
        }
    }

    /// Visits the rows in a cell and the 26 around it.
    pub fn for_each_near(&self, [x, y, z]: Cell, mut visit: impl FnMut(usize)) {
        for dz in -1..=1 {
            for dy in -1..=1 {
                for dx in -1..=1 {
                    let cell = self.image([x + dx, y + dy, z + dz]);
                    let mut row = self.head[self.bucket_of(cell)];
                    while row != EMPTY {
                        if self.cell[row as usize] == cell {
                            visit(row as usize);
                        }
                        row = self.next[row as usize];
                    }
                }
            }
        }
    }

    /// Hash of a cell (Teschner et al., *Optimized spatial hashing*, 2003).
    fn bucket_of(&self, [x, y, z]: Cell) -> usize {
        let hash =
            x.wrapping_mul(73_856_093) ^ y.wrapping_mul(19_349_663) ^ z.wrapping_mul(83_492_791);
        (hash as usize) & (self.head.len() - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_row_around_is_named_once_and_no_other() {
        let mut cells = Cells::default();
        // Few rows, whose cells around outnumber the rows by far, and many.
        for rows in [2_u32, 50, 3000] {
            cells.reset(rows as usize, 1.0, Period::default());
            let cell = |row: u32| [row % 7, row / 7 % 7, row / 49].map(i64::from);
            (0..rows).for_each(|row| cells.insert(row, cell(row)));
            for at in (0..rows).map(cell) {
                let mut named = Vec::new();
                cells.for_each_near(at, |row| named.push(row as u32));
                named.sort_unstable();
                let for_each_near = |row: &u32| (0..3).all(|i| (cell(*row)[i] - at[i]).abs() <= 1);
                assert_eq!(named, (0..rows).filter(for_each_near).collect::<Vec<_>>());
            }
        }
    }
}
