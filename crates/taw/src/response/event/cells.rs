//! Who is near, while everything moves: each center is in one cell of a uniform grid,
//! and tells when it leaves it. Cells are as wide as the largest ball, so those that
//! touch are in neighbouring ones.

use crate::math::Point3;

/// The coordinates of a cell.
pub(super) type Cell = [i64; 3];

/// Not a row.
const NONE: u32 = u32::MAX;

/// Buckets there are at least: of fewer, the cells around a ball would share many.
const LEAST_BUCKETS: usize = 1024;

/// The rows in each cell, as chains through buckets that the cells are hashed to.
#[derive(Clone, Debug, Default)]
pub(super) struct Cells {
    width: f64,
    head: Vec<u32>,
    next: Vec<u32>,
    previous: Vec<u32>,
    bucket: Vec<u32>,
    cell: Vec<Cell>,
}

impl Cells {
    /// Empties the grid, for this many rows and cells of this width in metres.
    pub fn reset(&mut self, rows: usize, width: f64) {
        self.width = width;
        self.head.clear();
        self.head.resize((2 * rows).next_power_of_two().max(LEAST_BUCKETS), NONE);
        self.cell.clear();
        self.cell.resize(rows, [0; 3]);
        for list in [&mut self.next, &mut self.previous, &mut self.bucket] {
            list.clear();
            list.resize(rows, NONE);
        }
    }

    /// In metres.
    pub fn width(&self) -> f64 {
        self.width
    }

    /// The cell that a point is in.
    pub fn cell(&self, point: Point3<f64>) -> Cell {
        [point.x, point.y, point.z].map(|x| (x / self.width).floor() as i64)
    }

    /// Puts a row, which is in none, into a cell.
    pub fn insert(&mut self, row: u32, cell: Cell) {
        let bucket = self.bucket_of(cell);
        let first = std::mem::replace(&mut self.head[bucket], row);
        let index = row as usize;
        (self.next[index], self.previous[index]) = (first, NONE);
        (self.bucket[index], self.cell[index]) = (bucket as u32, cell);
        if first != NONE {
            self.previous[first as usize] = row;
        }
    }

    /// Takes a row out of its cell.
    pub fn remove(&mut self, row: u32) {
        let index = row as usize;
        let (next, previous) = (self.next[index], self.previous[index]);
        if previous == NONE {
            self.head[self.bucket[index] as usize] = next;
        } else {
            self.next[previous as usize] = next;
        }
        if next != NONE {
            self.previous[next as usize] = previous;
        }
    }

    /// Names the rows in a cell and the 26 around it.
    pub fn near(&self, [x, y, z]: Cell, mut name: impl FnMut(usize)) {
        for dz in -1..=1 {
            for dy in -1..=1 {
                for dx in -1..=1 {
                    let cell = [x + dx, y + dy, z + dz];
                    let mut row = self.head[self.bucket_of(cell)];
                    while row != NONE {
                        if self.cell[row as usize] == cell {
                            name(row as usize);
                        }
                        row = self.next[row as usize];
                    }
                }
            }
        }
    }

    /// Teschner et al., *Optimized spatial hashing*, 2003.
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
            cells.reset(rows as usize, 1.0);
            let cell = |row: u32| [row % 7, row / 7 % 7, row / 49].map(i64::from);
            (0..rows).for_each(|row| cells.insert(row, cell(row)));
            for at in (0..rows).map(cell) {
                let mut named = Vec::new();
                cells.near(at, |row| named.push(row as u32));
                named.sort_unstable();
                let near = |row: &u32| (0..3).all(|i| (cell(*row)[i] - at[i]).abs() <= 1);
                assert_eq!(named, (0..rows).filter(near).collect::<Vec<_>>());
            }
        }
    }
}
