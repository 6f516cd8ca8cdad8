//! A hierarchical uniform grid.
//!
//! A sphere lies in the cell of its center, on the level whose cells are just wide enough for it:
//! level 0 has cells as wide as the largest sphere, and each further level halves them. Two spheres
//! that touch are therefore in equal or neighbouring cells of the coarser one's level. With one
//! size there is one level, which is the plain uniform grid; a pebble among boulders costs no more
//! than among pebbles.
//!
//! There are no buckets and no hashing: the cells are one sorted list of (key, index). Three
//! neighbouring cells along x are one run of keys, and as the list is walked in order, the runs
//! beside it are walked in order too.

use std::ops::Range;

use cgmath::num_traits::Float;

use crate::math::{Point3, Scalar};

/// Bits of a cell's coordinate along one axis.
const AXIS_BITS: u32 = 20;
/// The coordinate of the cell at the origin, in the middle of the axis.
const AXIS_MIDDLE: f64 = (1_u64 << (AXIS_BITS - 1)) as f64;
/// The last coordinate. Neither it nor 0 is assigned, so that the neighbour of a cell is never in
/// the next row of cells.
const AXIS_MAX: f64 = ((1_u64 << AXIS_BITS) - 1) as f64;
/// The remaining bits of 64 give 16 levels: radii of 1 : 65,536 before the smallest share the last
/// level with somewhat larger cells than they need.
const LEVELS: u32 = 16;
/// Cells are wider than the spheres by this factor, which is more than rounding takes from a
/// distance in `f32`.
const CELL_MARGIN: f64 = 1.0 + 1e-6;
/// Number of others that a sphere overlaps in three cells side by side, from which on it looks at no more
/// there: as many as contacts are kept of it. Twelve of its size can touch it without overlap.
const MOST: usize = 32;
/// A prime, larger than the number of spheres, near 2^32 over the golden ratio (Knuth, *The Art of Computer
/// Programming*, vol. 3, §6.4).
const STRIDE: u64 = 2_654_435_761;
/// Smallest cell width in metres: below it the reciprocal overflows.
const LEAST_CELL: f64 = 1e-300;

/// Broad phase for spheres. The module's source explains the method.
///
/// Rebuild it with [`Grid::rebuild`] whenever spheres have moved; it keeps its memory. The
/// candidate pairs do not depend on where the scene lies, and a sphere far out costs the others
/// nothing.
#[derive(Clone, Debug, Default)]
pub struct Grid {
    /// Sorted by key, then by index.
    cells: Vec<CellEntry>,
    /// Center of the scene, at the middle of the coordinate range, in metres.
    origin: [f64; 3],
    /// Width of a cell on level 0, in metres.
    width: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct CellEntry {
    key: u64,
    row: u32,
}

impl Grid {
    /// Sorts the spheres into cells. Spheres up to `reach` metres apart count as touching.
    pub fn rebuild<S: Scalar>(&mut self, center: &[Point3<S>], radius: &[S], reach: S) {
        // Zero for a negative or NaN margin.
        let half_reach = if reach > S::zero() { reach * S::from_f64(0.5) } else { S::zero() };
        let largest = radius.iter().fold(S::zero(), |max, r| Float::max(max, *r)) + half_reach;
        self.width = (2.0 * largest.as_f64() * CELL_MARGIN).max(LEAST_CELL);
        self.origin = middle(center);
        self.cells.clear();
        for (row, (center, radius)) in center.iter().zip(radius).enumerate() {
            let level = level_of(*radius + half_reach, largest);
            self.cells.push(CellEntry { key: self.key(*center, level), row: row as u32 });
        }
        self.cells.sort_unstable();
    }

    /// Visits every pair of spheres in equal or neighbouring cells once, the lower index first.
    /// `center` must be that of the last rebuild.
    pub fn pairs<S: Scalar>(&self, center: &[Point3<S>], mut pair: impl FnMut(u32, u32)) {
        self.pairs_up_to_crowds(center, |a, b| {
            pair(a, b);
            false
        });
    }

    /// Visits pairs as [`Grid::pairs`] does, but fewer of crowds: `pair` says if the two overlap, and a
    /// sphere that overlaps [`MOST`] in three cells side by side looks at no more there. Which it looks
    /// at varies between spheres.
    pub(crate) fn pairs_up_to_crowds<S: Scalar>(
        &self,
        center: &[Point3<S>],
        mut pair: impl FnMut(u32, u32) -> bool,
    ) {
        let mut emit = |a: &CellEntry, b: &CellEntry| pair(a.row.min(b.row), a.row.max(b.row));
        for level in 0..LEVELS {
            let cells = &self.cells[self.level(level)];
            if cells.is_empty() {
                continue;
            }
            pairs_in_level(cells, &mut emit);
            for coarser in 0..level {
                self.pairs_across(cells, coarser, center, &mut emit);
            }
        }
    }

    /// Occupied cells of level 0, for drawing: the lower corner of each, and their common width, in
    /// metres.
    pub fn occupied_cells(&self) -> (impl Iterator<Item = [f64; 3]> + '_, f64) {
        let mut last = None;
        let cells = self.cells[self.level(0)].iter();
        let distinct = cells.filter(move |cell| last.replace(cell.key) != Some(cell.key));
        let corners = distinct.map(|cell| {
            let axis = |i: u32| (cell.key >> (i * AXIS_BITS)) & ((1 << AXIS_BITS) - 1);
            [0, 1, 2].map(|i| self.origin[i as usize] + (axis(i) as f64 - AXIS_MIDDLE) * self.width)
        });
        (corners, self.width)
    }

    /// Range of the cells of a level.
    fn level(&self, level: u32) -> Range<usize> {
        let start = |level: u32| {
            self.cells.partition_point(|cell| cell.key >> (3 * AXIS_BITS) < u64::from(level))
        };
        start(level)..start(level + 1)
    }

    /// Level, z, y, x, from the highest bits to the lowest.
    fn key<S: Scalar>(&self, center: Point3<S>, level: u32) -> u64 {
        let cells_per_metre = (1_u64 << level) as f64 / self.width;
        let axis = |x: S, origin: f64| {
            let cell = ((x.as_f64() - origin) * cells_per_metre).floor() + AXIS_MIDDLE;
            // Clamping keeps neighbours neighbours, so nothing is lost out there. NaN maps to the
            // middle.
            let cell = if cell.is_nan() { AXIS_MIDDLE } else { cell };
            cell.clamp(1.0, AXIS_MAX - 1.0) as u64
        };
        let x = axis(center.x, self.origin[0]);
        let y = axis(center.y, self.origin[1]);
        let z = axis(center.z, self.origin[2]);
        (((u64::from(level) << AXIS_BITS | z) << AXIS_BITS | y) << AXIS_BITS) | x
    }

    /// Pairs of spheres of one level with those of a coarser one, in the 27 cells around each
    /// center.
    fn pairs_across<S: Scalar>(
        &self,
        cells: &[CellEntry],
        coarser: u32,
        center: &[Point3<S>],
        emit: &mut impl FnMut(&CellEntry, &CellEntry) -> bool,
    ) {
        let others = &self.cells[self.level(coarser)];
        if others.is_empty() {
            return;
        }
        for cell in cells {
            let Some(center) = center.get(cell.row as usize) else {
                continue;
            };
            let key = self.key(*center, coarser);
            for row in ROWS_AROUND {
                let middle = key.wrapping_add_signed(row);
                let start = others.partition_point(|other| other.key < middle - 1);
                let count = others[start..].partition_point(|other| other.key <= middle + 1);
                visit_run(cell, &others[start..start + count], emit);
            }
        }
    }
}

/// Key step to the next row of cells along y.
const ROW: i64 = 1 << AXIS_BITS;
/// Key step to the next layer of cells along z.
const LAYER: i64 = 1 << (2 * AXIS_BITS);
/// All rows of cells around one, itself included.
const ROWS_AROUND: [i64; 9] =
    [-LAYER - ROW, -LAYER, -LAYER + ROW, -ROW, 0, ROW, LAYER - ROW, LAYER, LAYER + ROW];
/// Rows of [`ROWS_AROUND`] that come later in the order of keys.
const ROWS_AHEAD: [i64; 4] = [ROW, LAYER - ROW, LAYER, LAYER + ROW];

/// Pairs within equal and neighbouring cells of one level. Only later neighbours are visited, so
/// that each pair is reported once.
fn pairs_in_level(cells: &[CellEntry], emit: &mut impl FnMut(&CellEntry, &CellEntry) -> bool) {
    let mut end = 0;
    for (i, cell) in cells.iter().enumerate() {
        while end < cells.len() && cells[end].key <= cell.key + 1 {
            end += 1;
        }
        visit_run(cell, &cells[i + 1..end], emit);
    }
    for row in ROWS_AHEAD {
        let (mut start, mut end) = (0, 0);
        for cell in cells {
            let middle = cell.key.wrapping_add_signed(row);
            while start < cells.len() && cells[start].key < middle - 1 {
                start += 1;
            }
            end = end.max(start);
            while end < cells.len() && cells[end].key <= middle + 1 {
                end += 1;
            }
            visit_run(cell, &cells[start..end], emit);
        }
    }
}

/// Visits the others in three cells side by side, until [`MOST`] of them overlap.
fn visit_run(
    cell: &CellEntry,
    others: &[CellEntry],
    emit: &mut impl FnMut(&CellEntry, &CellEntry) -> bool,
) {
    if others.len() <= MOST {
        for other in others {
            emit(cell, other);
        }
        return;
    }
    // Multiples of a number without a divisor in common with their count name each once, in an order
    // that is as good as random.
    let (count, stride) = (others.len() as u64, STRIDE % others.len() as u64);
    let mut at = u64::from(cell.row) * STRIDE % count;
    let mut overlapping = 0;
    for _ in 0..count {
        overlapping += usize::from(emit(cell, &others[at as usize]));
        if overlapping == MOST {
            break;
        }
        at = (at + stride) % count;
    }
}

/// The finest level whose cells are as wide as a sphere of this radius.
fn level_of<S: Scalar>(radius: S, largest: S) -> u32 {
    let half = S::from_f64(0.5);
    let mut level = 0;
    let mut fits = largest * half;
    while radius <= fits && level + 1 < LEVELS {
        level += 1;
        fits *= half;
    }
    level
}

/// Mean of the centers. A single outlier moves it by little, unlike the bounds.
fn middle<S: Scalar>(center: &[Point3<S>]) -> [f64; 3] {
    let count = center.len().max(1) as f64;
    let mean = |axis: fn(&Point3<S>) -> S| {
        let mean = center.iter().map(|c| axis(c).as_f64() / count).sum::<f64>();
        if mean.is_finite() { mean } else { 0.0 }
    };
    [mean(|c| c.x), mean(|c| c.y), mean(|c| c.z)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::broad::brute_force_pairs;
    use crate::contact::touching_sphere_sphere;
    use crate::shape::Sphere;
    use proptest::prelude::*;

    /// The touching pairs among those that a broad phase names, sorted.
    fn touching<S: Scalar>(
        center: &[Point3<S>],
        radius: &[S],
        broad: impl FnOnce(&mut dyn FnMut(u32, u32)),
    ) -> Vec<(u32, u32)> {
        let sphere =
            |row: u32| Sphere { center: center[row as usize], radius: radius[row as usize] };
        let mut found = Vec::new();
        broad(&mut |a, b| {
            assert!(a < b, "the lower row comes first");
            if touching_sphere_sphere(&sphere(a), &sphere(b)) {
                found.push((a, b));
            }
        });
        found.sort_unstable();
        found
    }

    fn assert_finds_all<S: Scalar>(center: &[Point3<S>], radius: &[S]) {
        let mut grid = Grid::default();
        grid.rebuild(center, radius, S::zero());
        let by_grid = touching(center, radius, |pair| grid.pairs(center, pair));
        let by_all = touching(center, radius, |pair| brute_force_pairs(center.len() as u32, pair));
        assert_eq!(by_grid, by_all);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]

        #[test]
        fn the_grid_finds_exactly_the_touching_pairs(
            spheres in proptest::collection::vec(
                ([-1.0..1.0_f32, -1.0..1.0_f32, -1.0..1.0_f32], 0.0..1.0_f32), 0..200),
            ratio in prop::sample::select(vec![1.0_f32, 2.0, 3.0, 10.0, 100.0]),
            spread in prop::sample::select(vec![0.1_f32, 1.0, 3.0, 10.0]),
            scale in prop::sample::select(vec![1e-30_f32, 1e-3, 1.0, 1e3, 1e30]),
            offset in prop::sample::select(vec![0.0_f32, 1.0, 1e3, 1e6]),
        ) {
            let center: Vec<_> = spheres
                .iter()
                .map(|(c, _)| c.map(|x| (x * spread + offset) * scale).into())
                .collect();
            let radius: Vec<_> = spheres.iter().map(|(_, t)| scale * ratio.powf(t - 1.0) / 2.0).collect();
            assert_finds_all(&center, &radius);
            let center: Vec<Point3<f64>> = center.iter().map(|c: &Point3<f32>| c.cast().unwrap()).collect();
            let radius: Vec<_> = radius.iter().map(|r| f64::from(*r)).collect();
            assert_finds_all(&center, &radius);
        }

        #[test]
        fn lattices_that_just_touch_are_found(
            side in 1..5_u32, ulps in -1..2_i32, offset in prop::sample::select(vec![0.0_f32, 0.3, 1e4])) {
            // Touching exactly, or one unit in the last place to either side of it.
            let pitch = f32::from_bits(1.0_f32.to_bits().wrapping_add_signed(ulps));
            let mut center = Vec::new();
            for i in 0..side.pow(3) {
                let at = |n: u32| offset + (n % side) as f32 * pitch;
                center.push(Point3::new(at(i), at(i / side), at(i / side / side)));
            }
            assert_finds_all(&center, &vec![0.5; center.len()]);
        }
    }

    proptest! {
        #[test]
        fn what_is_no_number_hides_nobody_else(
            strays in proptest::collection::vec(
                ([0..9_usize, 0..9_usize, 0..9_usize], 0..9_usize), 0..9),
            reach in 0..9_usize,
        ) {
            let odd = [f64::NAN, f64::INFINITY, -f64::INFINITY, 0.0, -1.0, 1e-320, 1e300, -1e300, 3.0];
            let mut center: Vec<_> = [0.0, 0.9, 2.5].map(|x| Point3::new(x, 0.0, 0.0)).to_vec();
            let mut radius = vec![0.5; 3];
            center.extend(strays.iter().map(|(at, _)| Point3::from(at.map(|i| odd[i]))));
            radius.extend(strays.iter().map(|(_, i)| odd[*i]));
            let mut grid = Grid::default();
            grid.rebuild(&center, &radius, odd[reach]);
            let mut named = Vec::new();
            grid.pairs(&center, |a, b| named.push((a, b)));
            prop_assert!(named.contains(&(0, 1)), "the two that touch, of {center:?}");
            prop_assert!(grid.occupied_cells().0.count() <= center.len());
        }
    }

    #[test]
    fn no_pair_is_named_twice() {
        let center: Vec<_> =
            (0..500_u32).map(|i| Point3::new(i % 7, i % 11, i % 13).map(f64::from) * 0.7).collect();
        let radius: Vec<_> = (0..500).map(|i| [0.05, 0.3, 0.6][i % 3]).collect();
        let mut grid = Grid::default();
        grid.rebuild(&center, &radius, 0.0);
        let mut pairs = Vec::new();
        grid.pairs(&center, |a, b| pairs.push((a, b)));
        let named = pairs.len();
        pairs.sort_unstable();
        pairs.dedup();
        assert_eq!(pairs.len(), named);
    }

    #[test]
    fn a_stray_far_out_costs_the_others_nothing() {
        let mut center: Vec<_> = (0..1000_u32)
            .map(|i| Point3::new((i % 10) as f32, (i / 10 % 10) as f32, (i / 100) as f32) * 1.1)
            .collect();
        let radius = vec![0.5_f32; 1001];
        let mut candidates = |stray: Point3<f32>| {
            center.truncate(1000);
            center.push(stray);
            let mut grid = Grid::default();
            grid.rebuild(&center, &radius, 0.0);
            let mut count = 0;
            grid.pairs(&center, |_, _| count += 1);
            count
        };
        let near = candidates(Point3::new(100.0, 0.0, 0.0));
        let far = candidates(Point3::new(0.0, -1e8, 0.0));
        // Only the phase of the cells differs, and thirteen neighbours a sphere
        // is what a grid of this width names.
        assert!(near < 14_000 && far < 14_000, "{near} and {far} candidates");
    }

    #[test]
    fn extremes_lose_no_pair() {
        for scale in [1e-45_f32, 1e-38, 1e-20, 1.0, 1e20, 1e38] {
            let center: Vec<_> = [0.0, 1.0, 2.5].map(|x| Point3::new(x * scale, 0.0, 0.0)).to_vec();
            assert_finds_all(&center, &[scale / 2.0; 3]);
        }
        for scale in [5e-324_f64, 1e-308, 1e-300, 1e300, 5e307] {
            let center: Vec<_> = [0.0, 1.0, 2.5].map(|x| Point3::new(x * scale, 0.0, 0.0)).to_vec();
            assert_finds_all(&center, &[scale / 2.0; 3]);
        }
        assert_finds_all::<f32>(&[], &[]);
    }
}
