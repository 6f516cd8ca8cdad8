//! Who might touch whom: pairs of balls, eight to a batch in which no ball is twice.

use super::grid::{Grid, Level};
use super::kernels::squared;
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

    /// Where a pair would be, if it is near enough to the first rows.
    fn place(&self, a: u32, b: u32) -> Option<[u16; 2]> {
        let near = |row: u32, first: u32| u16::try_from(row.checked_sub(first)?).ok();
        Some([near(a, self.first[0])?, near(b, self.first[1])?])
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
    /// The rows of a slab and of the next one, as columns: center, and radius with budget.
    columns: [Vec<f32>; 4],
    /// Which of the open batches a row is in, as bits.
    busy: Vec<u32>,
    open: [Option<Batch>; OPEN],
}

impl Search {
    pub fn bytes(&self) -> usize {
        let columns = self.columns.iter().map(Vec::capacity).sum::<usize>();
        (columns + self.busy.capacity()) * 4
    }
}

/// Puts pairs into batches.
struct Filler<'a> {
    first: u32,
    busy: &'a mut [u32],
    open: &'a mut [Option<Batch>; OPEN],
    batches: &'a mut Vec<Batch>,
}

impl Filler<'_> {
    #[inline]
    fn add(&mut self, a: u32, b: u32) {
        let (local_a, local_b) = ((a - self.first) as usize, (b - self.first) as usize);
        let busy = self.busy[local_a] | self.busy[local_b];
        let mut slot = (!busy).trailing_zeros() as usize;
        if slot == OPEN {
            slot = self.fullest();
            self.close(slot);
        }
        if let Some(batch) = &mut self.open[slot]
            && let Some([a, b]) = batch.place(a, b)
        {
            let lane = batch.count as usize;
            (batch.a[lane], batch.b[lane]) = (a, b);
            batch.count += 1;
        } else {
            self.close(slot);
            let first = [a.saturating_sub(BEFORE), b.saturating_sub(BEFORE)];
            let place = [(a - first[0]) as u16, (b - first[1]) as u16];
            self.open[slot] =
                Some(Batch { first, a: [place[0]; LANES], b: [place[1]; LANES], count: 1 });
        }
        self.busy[local_a] |= 1 << slot;
        self.busy[local_b] |= 1 << slot;
        if self.open[slot].is_some_and(|batch| batch.count as usize == LANES) {
            self.close(slot);
        }
    }

    fn fullest(&self) -> usize {
        let count = |slot: &usize| self.open[*slot].map_or(0, |batch| batch.count);
        (0..OPEN).rev().max_by_key(count).unwrap_or(0)
    }

    /// Takes a batch as it is.
    fn close(&mut self, slot: usize) {
        let Some(batch) = self.open[slot].take() else { return };
        for lane in 0..batch.count as usize {
            for row in batch.pair(lane) {
                self.busy[(row - self.first) as usize] &= !(1 << slot);
            }
        }
        self.batches.push(batch);
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
        let Search { columns, busy, open } = search;
        let [first, _, end] = rows;
        let window = &at[first as usize..end as usize];
        let budget = &budget[first as usize..end as usize];
        let [x, y, z, reach] = columns;
        for (axis, column) in [&mut *x, y, z].into_iter().enumerate() {
            column.clear();
            column.extend(window.iter().map(|row| row[axis]));
            column.extend([FAR; LANES]);
        }
        reach.clear();
        reach.extend(window.iter().zip(budget).map(|(row, budget)| row[3] + budget));
        reach.extend([FAR; LANES]);
        for (x, budget) in x.iter_mut().zip(budget) {
            if *budget > cap {
                *x = -FAR;
            }
        }
        busy.clear();
        busy.resize(window.len(), 0);
        batches.clear();
        let mut filler = Filler { first, busy, open, batches };
        let near = Near { columns, first };
        for level in &grid.levels {
            let [row_count, cell_count] = level.size();
            let fine = layers.map(|layer| layer << level.level);
            for layer in fine[0]..fine[1] {
                for row in 1..row_count - 1 {
                    let begin = level.cell(grid, layer, row, 0);
                    if grid.first(begin) == grid.first(begin + cell_count) {
                        continue;
                    }
                    let ahead = ahead(grid, level, layer, row);
                    for cell in 1..cell_count - 1 {
                        let (from, to) = (grid.first(begin + cell), grid.first(begin + cell + 1));
                        if from == to {
                            continue;
                        }
                        let own_end = grid.first(begin + cell + 2);
                        let run = |line: u32| {
                            [grid.first(line + cell - 1), grid.first(line + cell + 2)]
                        };
                        let runs = ahead.map(|line| line.map_or([0, 0], run));
                        for a in from..to {
                            let ball = near.ball::<L>(a);
                            near.each(&ball, [a + 1, own_end], |b| filler.add(a, b));
                            for run in runs {
                                near.each(&ball, run, |b| filler.add(a, b));
                            }
                        }
                    }
                }
            }
        }
        if grid.levels.len() > 1 {
            across::<L>(grid, at, layers, rows, &near, &mut filler);
        }
        for slot in 0..OPEN {
            filler.close(slot);
        }
    }
}

/// Finds the pairs of those balls that have a budget above the cap.
pub(super) fn find_strays(
    grid: &Grid,
    at: &[Row],
    budget: &[f32],
    cap: f32,
    largest: f32,
    search: &mut Search,
    batches: &mut Vec<Batch>,
) {
    batches.clear();
    if !budget.iter().any(|budget| *budget > cap) {
        return;
    }
    search.busy.clear();
    search.busy.resize(at.len(), 0);
    let mut filler = Filler { first: 0, busy: &mut search.busy, open: &mut search.open, batches };
    for stray in (0..at.len()).filter(|row| budget[*row] > cap) {
        let [x, y, z, radius] = at[stray];
        let reach = radius + budget[stray];
        let far = reach + largest + cap;
        for level in &grid.levels {
            // Also in the empty cells around, where nothing is.
            let low = grid.coordinates(level, &[x - far, y - far, z - far, 0.0]);
            let high = grid.coordinates(level, &[x + far, y + far, z + far, 0.0]);
            for layer in low[0]..=high[0] {
                for row in low[1]..=high[1] {
                    let line = level.cell(grid, layer, row, 0);
                    for other in grid.first(line + low[2])..grid.first(line + high[2] + 1) {
                        let other = other as usize;
                        let [a, b, c, r] = at[other];
                        let apart = [a - x, b - y, c - z, 0.0];
                        let near = reach + r + budget[other];
                        // Of two strays, the first one finds the other.
                        let new = other != stray && (budget[other] <= cap || stray < other);
                        if new && squared(apart) < near * near {
                            filler.add(stray.min(other) as u32, stray.max(other) as u32);
                        }
                    }
                }
            }
        }
    }
    for slot in 0..OPEN {
        filler.close(slot);
    }
}

/// The lines of cells that come later and are beside one, by their first cells.
fn ahead(grid: &Grid, level: &Level, layer: u32, row: u32) -> [Option<u32>; 4] {
    let next = (layer + 1 < level.layers).then_some(layer + 1);
    let line = |layer: Option<u32>, row: u32| layer.map(|layer| level.cell(grid, layer, row, 0));
    [line(Some(layer), row + 1), line(next, row - 1), line(next, row), line(next, row + 1)]
}

/// Pairs of a ball with one of a coarser level: there, all 27 cells around it.
#[inline(always)]
fn across<L: Lanes>(
    grid: &Grid,
    at: &[Row],
    layers: [u32; 2],
    [first, next, end]: [u32; 3],
    near: &Near,
    filler: &mut Filler,
) {
    // Also of the next slab's balls, with those of this one.
    for small in first..end {
        let place = &at[small as usize];
        let own = grid.level_of(place[3]);
        for level in &grid.levels[..own] {
            let [layer, row, cell] = grid.coordinates(level, place);
            if small >= next && layer > layers[1] << level.level {
                continue;
            }
            let ball = near.ball::<L>(small);
            for layer in layer.saturating_sub(1)..(layer + 2).min(level.layers) {
                for row in row - 1..row + 2 {
                    let line = level.cell(grid, layer, row, 0);
                    let run = [grid.first(line + cell - 1), grid.first(line + cell + 2)];
                    let run = [run[0].max(first), run[1].min(if small < next { end } else { next })];
                    near.each(&ball, run, |other| filler.add(small.min(other), small.max(other)));
                }
            }
        }
    }
}

/// Looks which balls are near one.
struct Near<'a> {
    columns: &'a [Vec<f32>; 4],
    first: u32,
}

impl Near<'_> {
    /// Its center and its reach.
    #[inline(always)]
    fn ball<L: Lanes>(&self, row: u32) -> [L; 4] {
        let local = (row - self.first) as usize;
        let [x, y, z, reach] = self.columns;
        [L::splat(x[local]), L::splat(y[local]), L::splat(z[local]), L::splat(reach[local])]
    }

    #[inline(always)]
    fn each<L: Lanes>(&self, ball: &[L; 4], [from, to]: [u32; 2], mut found: impl FnMut(u32)) {
        let mut begin = from;
        while begin < to {
            let local = (begin - self.first) as usize;
            let x = eight::<L>(&self.columns[0], local) - ball[0];
            let y = eight::<L>(&self.columns[1], local) - ball[1];
            let z = eight::<L>(&self.columns[2], local) - ball[2];
            let reach = eight::<L>(&self.columns[3], local) + ball[3];
            let mut hits = (reach * reach).above(x * x + y * y + z * z);
            if to - begin < LANES as u32 {
                hits &= (1 << (to - begin)) - 1;
            }
            while hits != 0 {
                found(begin + hits.trailing_zeros());
                hits &= hits - 1;
            }
            begin += LANES as u32;
        }
    }
}

#[inline(always)]
fn eight<L: Lanes>(column: &[f32], from: usize) -> L {
    match column[from..].first_chunk() {
        Some(eight) => L::load(eight),
        None => L::splat(FAR),
    }
}
