//! Who might touch whom: pairs of balls, eight to a batch in which no ball is twice.

use std::ops::Range;

use super::grid::{Grid, Level};
use super::lanes::{Kernel, LANES, Lanes, Row};

/// Eight pairs, none of which has a ball in common with another. As rows after a first one, so
/// that two bytes suffice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Batch {
    pub first: [u32; 2],
    pub a: [u16; LANES],
    pub b: [u16; LANES],
    /// How many there are; the rest repeat the first of them.
    pub count: u32,
}

impl Batch {
    /// The rows of a pair.
    pub fn pair(&self, lane: usize) -> [u32; 2] {
        [self.first[0] + u32::from(self.a[lane]), self.first[1] + u32::from(self.b[lane])]
    }
}

/// How many batches are being filled at a time.
const OPEN: usize = 32;
/// How far before the first pair of a batch a later one may lie.
const BEFORE: u32 = 1 << 14;
/// More than any ball is away from another, and its square is finite.
const FAR: f32 = 1e18;

/// What the search scribbles on; one for each thread.
#[derive(Clone, Debug, Default)]
pub(super) struct Search {
    columns: Columns,
    /// In which of the open batches a row has been, as bits.
    busy: Vec<u32>,
    open: [Batch; OPEN],
}

/// See [`Around`].
#[derive(Clone, Debug, Default)]
struct Columns {
    /// Of a slab and the next one: center, and radius with budget.
    window: [Vec<f32>; 4],
    eights: Vec<[u32; 2]>,
    found: Vec<u32>,
}

impl Search {
    /// Puts pairs of so many rows into batches.
    pub fn filler<'a>(&'a mut self, rows: usize, batches: &'a mut Vec<Batch>) -> Filler<'a> {
        self.busy.clear();
        self.busy.resize(rows, 0);
        Filler { first: 0, busy: &mut self.busy, open: &mut self.open, batches }
    }

    pub fn bytes(&self) -> usize {
        let Columns { window, eights, found } = &self.columns;
        let columns = window.iter().map(Vec::capacity).sum::<usize>();
        (columns + eights.capacity() * 2 + found.capacity() + self.busy.capacity()) * 4
    }
}

/// Puts pairs into batches: each pair into the first one in whose line neither ball was yet.
pub(super) struct Filler<'a> {
    first: u32,
    busy: &'a mut [u32],
    open: &'a mut [Batch; OPEN],
    batches: &'a mut Vec<Batch>,
}

impl Filler<'_> {
    #[inline(always)]
    pub fn add(&mut self, a: u32, b: u32) {
        let busy = *self.busy(a) | *self.busy(b);
        let slot = busy.trailing_ones() as usize;
        if slot == OPEN {
            // A large ball among many small ones.
            self.close();
            return self.add_in(0, a, b);
        }
        self.add_in(slot, a, b);
    }

    #[inline(always)]
    fn add_in(&mut self, slot: usize, a: u32, b: u32) {
        let batch = &mut self.open[slot % OPEN];
        let mut place = [a.wrapping_sub(batch.first[0]), b.wrapping_sub(batch.first[1])];
        if batch.count == 0 || (place[0] | place[1]) > u32::from(u16::MAX) {
            if batch.count > 0 {
                self.batches.push(*batch);
            }
            batch.first = [a.saturating_sub(BEFORE), b.saturating_sub(BEFORE)];
            batch.count = 0;
            place = [a - batch.first[0], b - batch.first[1]];
            (batch.a, batch.b) = ([place[0] as u16; LANES], [place[1] as u16; LANES]);
        }
        let lane = batch.count as usize % LANES;
        (batch.a[lane], batch.b[lane]) = (place[0] as u16, place[1] as u16);
        batch.count += 1;
        if batch.count as usize == LANES {
            self.batches.push(*batch);
            batch.count = 0;
        }
        *self.busy(a) |= 1 << slot;
        *self.busy(b) |= 1 << slot;
    }

    /// In which open batches a row of the window has been.
    #[inline(always)]
    fn busy(&mut self, row: u32) -> &mut u32 {
        let local = (row - self.first) as usize;
        debug_assert!(local < self.busy.len());
        // SAFETY: rows come from the window.
        unsafe { self.busy.get_unchecked_mut(local) }
    }

    /// Takes the open batches as they are, and begins anew.
    pub fn close(&mut self) {
        for batch in self.open.iter_mut().filter(|batch| batch.count > 0) {
            self.batches.push(*batch);
            batch.count = 0;
        }
        self.busy.fill(0);
    }
}

/// Finds the pairs of a slab: of its own balls, and of these with those of the next one.
pub(super) struct FindPairs<'a> {
    pub grid: &'a Grid,
    pub at: &'a [Row],
    /// How far each ball may go until pairs are sought again, in metres.
    pub budget: &'a [f32],
    /// Balls with more than this are sought for alone.
    pub cap: f32,
    /// The layers of level 0 in it.
    pub layers: [u32; 2],
    /// The first row, of it and of the next one and after that.
    pub rows: [u32; 3],
    pub search: &'a mut Search,
    pub batches: &'a mut Vec<Batch>,
}

impl Kernel for FindPairs<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { grid, at, budget, cap, layers, rows, search, batches } = self;
        let [first, _, end] = rows;
        let window = first as usize..end as usize;
        let Search { columns, busy, open } = search;
        columns.window.fill_with(&at[window.clone()], &budget[window.clone()], cap);
        busy.clear();
        busy.resize(window.len(), 0);
        batches.clear();
        let mut filler = Filler { first, busy, open, batches };
        let mut around = Around::new(columns, first..end);
        for level in &grid.levels {
            let [row_count, cell_count] = level.size();
            let fine = layers.map(|layer| layer << level.number);
            for layer in fine[0]..fine[1] {
                for row in 1..row_count - 1 {
                    let line = level.cell(grid, layer, row, 0);
                    if grid.first(line) == grid.first(line + cell_count) {
                        continue;
                    }
                    let starts = grid.starts(line, cell_count);
                    let ahead = ahead(grid, level, layer, row);
                    for (cell, four) in starts.windows(4).enumerate() {
                        let [_, from, to, end] = *four else { continue };
                        if from == to {
                            continue;
                        }
                        around.eights.clear();
                        around.add(from, end);
                        for starts in &ahead {
                            if let Some(&[from, _, _, to]) = starts.get(cell..cell + 4) {
                                around.add(from, to);
                            }
                        }
                        for a in from..to {
                            // Each with those that come after it.
                            for b in around.near::<L>(a, a + 1) {
                                filler.add(a, *b);
                            }
                        }
                    }
                }
            }
        }
        if grid.levels.len() > 1 {
            across::<L>(grid, at, layers, rows, &mut around, &mut filler);
        }
        filler.close();
    }
}

trait Fill {
    /// Takes rows in; those with a budget above the cap are nowhere.
    fn fill_with(&mut self, at: &[Row], budget: &[f32], cap: f32);
}

impl Fill for [Vec<f32>; 4] {
    fn fill_with(&mut self, at: &[Row], budget: &[f32], cap: f32) {
        let [x, y, z, reach] = self;
        for column in [&mut *x, y, z, reach] {
            column.clear();
            column.resize(at.len() + LANES, FAR);
        }
        let columns = x.iter_mut().zip(y).zip(z).zip(reach);
        for ((at, budget), (((x, y), z), reach)) in at.iter().zip(budget).zip(columns) {
            [*x, *y, *z, *reach] = [at[0], at[1], at[2], at[3] + budget];
            if *budget > cap {
                *x = f32::NAN; // near to nothing, also not to another one
            }
        }
    }
}

/// The lines of cells that come later and are beside one: where the rows of their cells begin.
fn ahead<'a>(grid: &'a Grid, level: &Level, layer: u32, row: u32) -> [&'a [u32]; 4] {
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
fn across<L: Lanes>(
    grid: &Grid,
    at: &[Row],
    layers: [u32; 2],
    [first, next, end]: [u32; 3],
    around: &mut Around,
    filler: &mut Filler,
) {
    // Also of the next slab's balls, with those of this one.
    for small in first..end {
        let place = &at[small as usize];
        let own = grid.level_of(place[3]);
        for level in &grid.levels[..own] {
            let [layer, row, cell] = grid.coordinates(level, place);
            if small >= next && layer > layers[1] << level.number {
                continue;
            }
            around.eights.clear();
            let last = if small < next { end } else { next };
            for layer in layer.saturating_sub(1)..(layer + 2).min(level.layers) {
                for row in row - 1..row + 2 {
                    let line = level.cell(grid, layer, row, 0);
                    let [from, to] = [grid.first(line + cell - 1), grid.first(line + cell + 2)];
                    around.add(from.max(first), to.min(last));
                }
            }
            for other in around.near::<L>(small, 0) {
                filler.add(small.min(*other), small.max(*other));
            }
        }
    }
}

/// Looks which balls are near one, among some runs of rows.
struct Around<'a> {
    /// The first row of the window.
    first: u32,
    /// The columns of the window, with [`LANES`] places more.
    columns: [&'a [f32]; 4],
    /// The runs by eights: where each begins in the window, and a bit for each row of the run.
    eights: &'a mut Vec<[u32; 2]>,
    /// Those that are near.
    found: &'a mut Vec<u32>,
}

impl<'a> Around<'a> {
    fn new(search: &'a mut Columns, window: Range<u32>) -> Self {
        let size = window.len();
        let Columns { window: columns, eights, found } = search;
        let columns = columns.each_ref().map(|column| &column[..size + LANES]);
        Self { first: window.start, columns, eights, found }
    }

    /// Adds a run of rows of the window.
    #[inline(always)]
    fn add(&mut self, from: u32, to: u32) {
        let mut at = from;
        while at < to {
            let bits = if to - at < LANES as u32 { (1 << (to - at)) - 1 } else { 0xff };
            self.eights.push([at - self.first, bits]);
            at += LANES as u32;
        }
    }

    /// The rows near a ball of the window. Of the first eights, as many rows are left out as come
    /// before `after`.
    #[inline(always)]
    fn near<L: Lanes>(&mut self, ball: u32, after: u32) -> &[u32] {
        let local = (ball - self.first) as usize;
        let [x, y, z, reach] = self.columns;
        let (ax, ay) = (L::splat(x[local]), L::splat(y[local]));
        let (az, a_reach) = (L::splat(z[local]), L::splat(reach[local]));
        let room = (self.eights.len() + 1) * LANES;
        if self.found.len() < room {
            self.found.resize(2 * room, 0);
        }
        let mut count = 0;
        for [at, bits] in &*self.eights {
            let row = *at as usize;
            // SAFETY: an eight begins in the window, which eight places follow; and there is
            // room for eight of each.
            unsafe {
                let dx = get::<L>(x, row) - ax;
                let dy = get::<L>(y, row) - ay;
                let dz = get::<L>(z, row) - az;
                let near = get::<L>(reach, row) + a_reach;
                let hits = (near * near).above(dx * dx + dy * dy + dz * dz) & bits;
                L::name(hits, self.first + at, &mut *self.found.as_mut_ptr().add(count).cast());
                count += hits.count_ones() as usize;
            }
        }
        let found = &self.found[..count];
        // They come in order, those of the ball's own line first.
        let before = found.iter().take_while(|row| **row < after).count();
        &found[before..]
    }
}

/// # Safety
/// There are eight from there on.
#[inline(always)]
unsafe fn get<L: Lanes>(column: &[f32], at: usize) -> L {
    debug_assert!(at + LANES <= column.len());
    // SAFETY: as the caller promises.
    L::load(unsafe { &*column.as_ptr().add(at).cast() })
}
