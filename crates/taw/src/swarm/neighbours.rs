//! Candidate pairs. In the full tier: eight to a batch in which no ball is twice, so that each pair
//! is solved with the velocities that the ones before it left. In the lab's tier: for each ball
//! those that come after it, a half *neighbour list*, which is found faster and takes less room.

use std::ops::Range;

use super::batches::{Batch, BatchBuilder, MAX_COLOURS, builder};
use super::grid::{Level, SortedGrid};
use super::state::of;
use super::surfaces::SurfaceOf;
use crate::math::{Kernel, LANES, Row, Scalar, Simd};

/// Neighbour lists of all chunks, in the lab's tier, and a column to sort its rows into. Compared as
/// bits, since most are no numbers.
#[derive(Clone, Debug, Default)]
pub(super) struct NeighbourColumn<S>(pub Vec<Row<S>>);

impl<S: Scalar> PartialEq for NeighbourColumn<S> {
    fn eq(&self, other: &Self) -> bool {
        let bits = |column| bytemuck::cast_slice::<Row<S>, u32>(column);
        bits(&self.0) == bits(&other.0)
    }
}

/// More than any ball is away from another, and its square is finite.
const NOWHERE: f64 = 1e18;

/// Scratch of the search; one for each thread.
#[derive(Clone, Debug, Default)]
pub(super) struct NeighbourSearch<S> {
    columns: CandidateWindow<S>,
    /// Colours of a row: the open batches in which it is, as bits.
    colour_mask: Vec<u32>,
    open: [Batch; MAX_COLOURS],
}

/// See [`CandidateBlocks`].
#[derive(Clone, Debug, Default)]
struct CandidateWindow<S> {
    /// Of a chunk and the next one: center, and radius with remaining skin.
    window: [Vec<S>; 4],
    blocks: Vec<[u32; 2]>,
    found: Vec<u32>,
}

impl<S: Scalar> NeighbourSearch<S> {
    /// Puts pairs of about this number of balls into batches.
    pub fn builder<'a>(
        &'a mut self,
        balls: usize,
        batches: &'a mut Vec<Batch>,
    ) -> BatchBuilder<'a> {
        builder(&mut self.colour_mask, &mut self.open, balls, batches)
    }

    pub fn bytes(&self) -> usize {
        let CandidateWindow { window, blocks, found } = &self.columns;
        let columns = window.iter().map(of).sum::<usize>();
        columns + of(blocks) + of(found) + of(&self.colour_mask)
    }
}

/// Taker of the pairs that are found.
trait PairVisitor {
    /// A ball and some that come after it. Balls are named in order; those without any may be
    /// left out.
    fn neighbours_after(&mut self, ball: u32, near: &[u32]);
    /// A ball and some that come before or after it.
    fn neighbours_around(&mut self, ball: u32, near: &[u32]);
}

impl PairVisitor for BatchBuilder<'_> {
    #[inline(always)]
    fn neighbours_after(&mut self, ball: u32, near: &[u32]) {
        let count = self.spend(near.len());
        for other in &near[..count] {
            self.add(ball, *other);
        }
    }

    #[inline(always)]
    fn neighbours_around(&mut self, ball: u32, near: &[u32]) {
        let count = self.spend(near.len());
        for other in &near[..count] {
            self.add(ball.min(*other), ball.max(*other));
        }
    }
}

/// Numbers that the list of a row may take, on average over a chunk: as many as fit into a
/// row of a column that is not in use meanwhile.
pub(super) const NEIGHBOUR_ROOM: usize = size_of::<Row<f32>>() / size_of::<u16>();

/// For each row of a chunk, the length of its neighbour list, and how far after it each entry is.
#[derive(Clone, Copy, Debug)]
pub(super) struct NeighbourLists<'a> {
    /// The first row.
    pub first: u32,
    pub rows: u32,
    /// Only a part of it, at the beginning, means anything.
    pub list: &'a [u16],
}

impl<'a> NeighbourLists<'a> {
    /// The others of each row.
    pub fn of_rows(self) -> impl Iterator<Item = &'a [u16]> {
        let mut rest = self.list;
        (0..self.rows).map_while(move |_| {
            let (count, more) = rest.split_first()?;
            let (neighbours_after, more) = more.split_at_checked((*count).into())?;
            rest = more;
            Some(neighbours_after)
        })
    }
}

/// Puts neighbour lists one after another, and what fits into none of them into batches.
struct NeighbourListBuilder<'a> {
    /// The next row, and the one after the last.
    next: u32,
    end: u32,
    list: &'a mut [u16],
    filled: usize,
    builder: BatchBuilder<'a>,
}

impl NeighbourListBuilder<'_> {
    /// All rows before this one have no more neighbours.
    #[inline(always)]
    fn skip_to(&mut self, row: u32) {
        while self.next < row {
            self.list[self.filled] = 0;
            self.filled += 1;
            self.next += 1;
        }
    }
}

impl PairVisitor for NeighbourListBuilder<'_> {
    #[inline(always)]
    fn neighbours_after(&mut self, ball: u32, near: &[u32]) {
        debug_assert!(self.next <= ball);
        let near = &near[..self.builder.spend(near.len())];
        self.skip_to(ball);
        // The rows from this one on need a number each. The others come in order.
        let room = self.list.len() - self.filled - (self.end - ball) as usize;
        let mut count = near.len().min(room);
        while count > 0 && near[count - 1] - ball > u32::from(u16::MAX) {
            count -= 1;
        }
        let (near, rest) = near.split_at(count);
        let (number, others) = (self.filled, self.filled + 1..self.filled + 1 + count);
        (self.next, self.filled) = (ball + 1, others.end);
        self.list[number] = count as u16;
        for (after, other) in self.list[others].iter_mut().zip(near) {
            *after = (other - ball) as u16;
        }
        for other in rest {
            self.builder.add(ball, *other);
        }
    }

    #[inline(always)]
    fn neighbours_around(&mut self, ball: u32, near: &[u32]) {
        self.builder.neighbours_around(ball, near);
    }
}

/// Finds the pairs of a chunk: of its own balls, and of these with those of the next one.
pub(super) struct FindPairs<'a, S> {
    pub grid: &'a SortedGrid<S>,
    pub at: &'a [Row<S>],
    /// Remaining skin of each ball, in metres.
    pub skin_left: &'a [S],
    /// Balls with more than this are fast movers.
    pub skin: S,
    pub surfaces: SurfaceOf<'a, S>,
    /// The layers of level 0 in it.
    pub layers: [u32; 2],
    /// The first row, of it, of the next one and after that.
    pub rows: [u32; 3],
    pub search: &'a mut NeighbourSearch<S>,
    /// Number of pairs that there was no room for.
    pub unlisted: &'a mut usize,
    /// Output: pairs that are part of no neighbour list.
    pub batches: &'a mut Vec<Batch>,
    /// Output: neighbour lists, if there shall be any: [`NEIGHBOUR_ROOM`] for each row of the chunk.
    pub lists: Option<&'a mut [u16]>,
}

impl<S: Scalar> Kernel<S> for FindPairs<'_, S> {
    #[inline(always)]
    fn run<L: Simd<Scalar = S>>(self) {
        let Self { grid, at, skin_left, skin, surfaces, layers, rows, .. } = self;
        let Self { search, unlisted, batches, lists, .. } = self;
        let [first, next, end] = rows;
        let window = first as usize..end as usize;
        let NeighbourSearch { columns, colour_mask, open } = search;
        columns.window.fill_with(&at[window.clone()], &skin_left[window.clone()], skin);
        batches.clear();
        let mut builder = builder(colour_mask, open, window.len(), batches);
        let mut candidates = CandidateBlocks::new(columns, first..end, surfaces);
        if let Some(list) = lists {
            let mut lists =
                NeighbourListBuilder { next: first, end: next, list, filled: 0, builder };
            find::<L>(grid, at, layers, rows, &mut candidates, &mut lists);
            lists.skip_to(next);
            *unlisted = lists.builder.close_all();
        } else {
            find::<L>(grid, at, layers, rows, &mut candidates, &mut builder);
            *unlisted = builder.close_all();
        }
    }
}

#[inline(always)]
fn find<L: Simd>(
    grid: &SortedGrid<L::Scalar>,
    at: &[Row<L::Scalar>],
    layers: [u32; 2],
    rows: [u32; 3],
    candidates: &mut CandidateBlocks<L::Scalar>,
    visitor: &mut impl PairVisitor,
) {
    // In the order of the rows.
    for coarse in layers[0]..layers[1] {
        for level in &grid.levels {
            let fine = coarse << level.number..(coarse + 1) << level.number;
            for layer in fine {
                pairs_in_layer::<L>(grid, level, layer, candidates, visitor);
            }
        }
    }
    if grid.levels.len() > 1 {
        cross_level_pairs::<L>(grid, at, layers, rows, candidates, visitor);
    }
}

/// The pairs of the balls of one layer with those of the same level.
#[inline(always)]
fn pairs_in_layer<L: Simd>(
    grid: &SortedGrid<L::Scalar>,
    level: &Level<L::Scalar>,
    layer: u32,
    candidates: &mut CandidateBlocks<L::Scalar>,
    visitor: &mut impl PairVisitor,
) {
    let [row_count, cell_count] = level.size();
    for row in 1..row_count - 1 {
        let line = level.cell(grid, layer, row, 0);
        if grid.first(line) == grid.first(line + cell_count) {
            continue;
        }
        let starts = grid.starts(line, cell_count);
        let lines_ahead = lines_ahead(grid, level, layer, row);
        for (cell, four) in starts.windows(4).enumerate() {
            let [_, from, to, end] = *four else { continue };
            if from == to {
                continue;
            }
            candidates.blocks.clear();
            candidates.add(from, end);
            for starts in &lines_ahead {
                if let Some(&[from, _, _, to]) = starts.get(cell..cell + 4) {
                    candidates.add(from, to);
                }
            }
            for ball in from..to {
                // Each with those that come after it.
                visitor.neighbours_after(ball, candidates.near::<L>(ball, ball + 1));
            }
        }
    }
}

trait Fill<S> {
    /// Takes rows in; fast movers, with more than the common skin, are nowhere.
    fn fill_with(&mut self, at: &[Row<S>], skin_left: &[S], skin: S);
}

impl<S: Scalar> Fill<S> for [Vec<S>; 4] {
    fn fill_with(&mut self, at: &[Row<S>], skin_left: &[S], skin: S) {
        let [x, y, z, reach] = self;
        for column in [&mut *x, y, z, reach] {
            column.clear();
            column.resize(at.len() + LANES, S::from_f64(NOWHERE));
        }
        let columns = x.iter_mut().zip(y).zip(z).zip(reach);
        for ((at, skin_left), (((x, y), z), reach)) in at.iter().zip(skin_left).zip(columns) {
            [*x, *y, *z, *reach] = [at[0], at[1], at[2], at[3] + *skin_left];
            if *skin_left > skin {
                *x = S::nan(); // near to nothing, also not to another one
            }
        }
    }
}

/// The lines of cells that come later and are beside one: where the rows of their cells begin.
fn lines_ahead<'a, S: Scalar>(
    grid: &'a SortedGrid<S>,
    level: &Level<S>,
    layer: u32,
    row: u32,
) -> [&'a [u32]; 4] {
    let cells = level.size()[1];
    let line = |layer, row| grid.starts(level.cell(grid, layer, row, 0), cells);
    let here = line(layer, row + 1);
    if layer + 1 == level.layers {
        return [here, &[], &[], &[]];
    }
    [here, line(layer + 1, row - 1), line(layer + 1, row), line(layer + 1, row + 1)]
}

/// Pairs of a ball with one of a coarser level: there, all 27 cells around it.
#[inline(always)]
fn cross_level_pairs<L: Simd>(
    grid: &SortedGrid<L::Scalar>,
    at: &[Row<L::Scalar>],
    layers: [u32; 2],
    [first, next, end]: [u32; 3],
    candidates: &mut CandidateBlocks<L::Scalar>,
    visitor: &mut impl PairVisitor,
) {
    // Also of the next chunk's balls, with those of this one.
    for small in first..end {
        let place = &at[small as usize];
        let own = grid.level_of(place[3]);
        for level in &grid.levels[..own] {
            let [layer, row, cell] = grid.coordinates(level, place);
            if small >= next && layer > layers[1] << level.number {
                continue;
            }
            candidates.blocks.clear();
            let last = if small < next { end } else { next };
            for layer in layer.saturating_sub(1)..(layer + 2).min(level.layers) {
                for row in row - 1..row + 2 {
                    let line = level.cell(grid, layer, row, 0);
                    let [from, to] = [grid.first(line + cell - 1), grid.first(line + cell + 2)];
                    candidates.add(from.max(first), to.min(last));
                }
            }
            visitor.neighbours_around(small, candidates.near::<L>(small, 0));
        }
    }
}

/// Looks which balls are near one, among some runs of rows.
struct CandidateBlocks<'a, S> {
    /// The first row of the window.
    first: u32,
    /// The columns of the window, with [`LANES`] places more.
    columns: [&'a [S]; 4],
    /// The runs by eights: where each begins in the window, and a bit for each row of the run.
    blocks: &'a mut Vec<[u32; 2]>,
    /// Those that are near.
    found: &'a mut Vec<u32>,
    surfaces: SurfaceOf<'a, S>,
}

impl<'a, S: Scalar> CandidateBlocks<'a, S> {
    fn new(
        search: &'a mut CandidateWindow<S>,
        window: Range<u32>,
        surfaces: SurfaceOf<'a, S>,
    ) -> Self {
        let size = window.len();
        let CandidateWindow { window: columns, blocks, found } = search;
        let columns = columns.each_ref().map(|column| &column[..size + LANES]);
        Self { first: window.start, columns, blocks, found, surfaces }
    }

    /// Adds a run of rows of the window.
    #[inline(always)]
    fn add(&mut self, from: u32, to: u32) {
        let mut at = from;
        while at < to {
            let bits = if to - at < LANES as u32 { (1 << (to - at)) - 1 } else { 0xff };
            self.blocks.push([at - self.first, bits]);
            at += LANES as u32;
        }
    }

    /// The rows near a ball of the window that it collides with. Of the first eights, as many rows are left out as come
    /// before `after`.
    #[inline(always)]
    fn near<L: Simd<Scalar = S>>(&mut self, ball: u32, after: u32) -> &[u32] {
        let local = (ball - self.first) as usize;
        let [x, y, z, reach] = self.columns;
        let (ax, ay) = (L::splat(x[local]), L::splat(y[local]));
        let (az, a_reach) = (L::splat(z[local]), L::splat(reach[local]));
        let room = (self.blocks.len() + 1) * LANES;
        if self.found.len() < room {
            self.found.resize(2 * room, 0);
        }
        let mut count = 0;
        for [at, bits] in &*self.blocks {
            let row = *at as usize;
            // SAFETY: an eight begins in the window, which eight places follow; and there is
            // room for eight of each.
            unsafe {
                let dx = get::<L>(x, row) - ax;
                let dy = get::<L>(y, row) - ay;
                let dz = get::<L>(z, row) - az;
                let near = get::<L>(reach, row) + a_reach;
                let hits = (near * near).gt_mask(dx * dx + dy * dy + dz * dz) & bits;
                L::compress(hits, self.first + at, &mut *self.found.as_mut_ptr().add(count).cast());
                count += hits.count_ones() as usize;
            }
        }
        if self.surfaces.have_filters() {
            count = self.retain_colliding(ball, count);
        }
        let found = &self.found[..count];
        // They come in order, those of the ball's own line first.
        let before = found.iter().take_while(|row| **row < after).count();
        &found[before..]
    }

    /// Keeps those of the first `count` rows that were found that a ball collides with.
    /// Returns their number.
    #[cold]
    fn retain_colliding(&mut self, ball: u32, count: usize) -> usize {
        let mut kept = 0;
        for i in 0..count {
            let other = self.found[i];
            self.found[kept] = other;
            kept += usize::from(self.surfaces.may_collide(ball, other));
        }
        kept
    }
}

/// # Safety
/// There are eight from there on.
#[inline(always)]
unsafe fn get<L: Simd>(column: &[L::Scalar], at: usize) -> L {
    debug_assert!(at + LANES <= column.len());
    // SAFETY: as the caller promises.
    L::load(unsafe { &*column.as_ptr().add(at).cast() })
}
