//! The few balls that went further than their budget: pairs are sought for them alone, so that
//! one fast ball does not cost a search for all.
//!
//! Pairs that such a ball already has in its slab stay there. One that it then has twice shares
//! its impulse between the two.

use super::batches::{Batch, Filler};
use super::grid::Grid;
use super::kernels::{Pushes, squared};
use super::lanes::Row;
use super::pairs::Search;

/// One ball of so many may stray, and besides so many.
const PART: usize = 500;
const SOME: usize = 32;

/// See the module.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Strays {
    /// Their rows, in order, and a bit for each row.
    pub rows: Vec<u32>,
    bits: Vec<u64>,
    /// Their pairs, and how many more there was no room for.
    pub batches: Vec<Batch>,
    pub unlisted: usize,
    pub pushes: Pushes,
    /// Impulses that their pairs bore before, in order.
    bore: Vec<Bore>,
    /// The strays along the x axis.
    sorted: Vec<u32>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Bore {
    pair: [u32; 2],
    pressure: f32,
    grip: [f32; 3],
}

/// Largest number of strays among so many balls.
pub(super) fn room(balls: usize) -> usize {
    SOME + balls / PART
}

impl Strays {
    /// Says if so many more would be too many.
    pub fn full(&self, more: usize, balls: usize) -> bool {
        more > self.room(balls)
    }

    /// Number that may still be added, among so many balls.
    pub fn room(&self, balls: usize) -> usize {
        room(balls).saturating_sub(self.rows.len())
    }

    /// Forgets all, in a swarm of so many.
    pub fn clear(&mut self, balls: usize) {
        self.rows.clear();
        self.unlisted = 0;
        self.batches.clear();
        self.pushes.reset(0);
        self.bits.clear();
        self.bits.resize(balls.div_ceil(64), 0);
    }

    pub fn add(&mut self, row: u32) {
        if !self.has(row) {
            self.bits[row as usize / 64] |= 1 << (row % 64);
            self.rows.push(row);
        }
    }

    #[inline]
    pub fn has(&self, row: u32) -> bool {
        self.bits[row as usize / 64] >> (row % 64) & 1 == 1
    }

    /// Seeks all their pairs. `largest` is the largest radius, `cap` the most that other balls
    /// have gone since the rows were put in order. Guests touch each other without the swarm.
    pub fn find(
        &mut self,
        grid: &Grid,
        at: &[Row],
        budget: &[f32],
        [largest, cap]: [f32; 2],
        search: &mut Search,
        guest: &dyn Fn(u32) -> bool,
        rough: bool,
    ) {
        if rough {
            self.keep();
        }
        self.rows.sort_unstable();
        let mut batches = std::mem::take(&mut self.batches);
        batches.clear();
        self.unlisted = 0;
        if !self.rows.is_empty() {
            let mut filler = search.filler(64 * self.rows.len(), &mut batches);
            let widest = self
                .rows
                .iter()
                .fold(0.0_f32, |most, row| most.max(at[*row as usize][3] + budget[*row as usize]));
            filler.make_room(at.len());
            for stray in &self.rows {
                self.beside(*stray, grid, at, budget, largest + cap, guest, &mut filler);
            }
            self.sorted.clear();
            self.sorted.extend(&self.rows);
            let x = |row: &u32| at[*row as usize][0];
            self.sorted.sort_unstable_by(|a, b| x(a).total_cmp(&x(b)).then(a.cmp(b)));
            for (i, a) in self.sorted.iter().enumerate() {
                let reach = at[*a as usize][3] + budget[*a as usize];
                let far = x(a) + reach + widest;
                for b in self.sorted[i + 1..].iter().take_while(|b| x(b) <= far) {
                    let both_guests = guest(*a) && guest(*b);
                    if near(*a, *b, at, budget) && !both_guests && filler.spend_only(1) == 1 {
                        filler.add(*a.min(b), *a.max(b));
                    }
                }
            }
            self.unlisted = filler.close_all();
        }
        self.batches = batches;
        if rough {
            self.pushes.reset(self.batches.len());
            self.recall();
        }
    }

    /// The pairs of one with those that are none.
    fn beside(
        &self,
        stray: u32,
        grid: &Grid,
        at: &[Row],
        budget: &[f32],
        more: f32,
        guest: &dyn Fn(u32) -> bool,
        filler: &mut Filler,
    ) {
        let is_guest = guest(stray);
        let [x, y, z, radius] = at[stray as usize];
        let far = radius + budget[stray as usize] + more;
        for level in &grid.levels {
            let low = grid.coordinates(level, &[x - far, y - far, z - far, 0.0]);
            let high = grid.coordinates(level, &[x + far, y + far, z + far, 0.0]);
            for layer in low[0]..=high[0] {
                for row in low[1]..=high[1] {
                    let line = level.cell(grid, layer, row, 0);
                    for other in grid.first(line + low[2])..grid.first(line + high[2] + 1) {
                        let is_for_others = self.has(other) || is_guest && guest(other);
                        if !is_for_others
                            && near(stray, other, at, budget)
                            && filler.spend_only(1) == 1
                        {
                            filler.add(stray.min(other), stray.max(other));
                        }
                    }
                }
            }
        }
    }

    /// Keeps what their pairs bear.
    fn keep(&mut self) {
        self.bore.clear();
        for (i, batch) in self.batches.iter().enumerate() {
            for lane in 0..batch.count as usize {
                let pressure = self.pushes.pressure[i][lane];
                if pressure > 0.0 {
                    let grip = self.pushes.grip.get(i);
                    let grip = grip.map_or([0.0; 3], |grip| grip.map(|axis| axis[lane]));
                    self.bore.push(Bore { pair: batch.pair(lane), pressure, grip });
                }
            }
        }
        self.bore.sort_unstable_by_key(|bore| bore.pair);
    }

    fn recall(&mut self) {
        for (i, batch) in self.batches.iter().enumerate() {
            for lane in 0..batch.count as usize {
                let pair = batch.pair(lane);
                let Ok(at) = self.bore.binary_search_by_key(&pair, |bore| bore.pair) else {
                    continue;
                };
                let Bore { pressure, grip, .. } = self.bore[at];
                self.pushes.pressure[i][lane] = pressure;
                if let Some(to) = self.pushes.grip.get_mut(i) {
                    for (axis, grip) in to.iter_mut().zip(grip) {
                        axis[lane] = grip;
                    }
                }
            }
        }
    }

    pub fn bytes(&self) -> usize {
        (self.rows.capacity() + self.sorted.capacity()) * size_of::<u32>()
            + self.bits.capacity() * size_of::<u64>()
            + self.batches.capacity() * size_of::<Batch>()
            + self.pushes.bytes()
            + self.bore.capacity() * size_of::<Bore>()
    }
}

/// Says if two balls might touch before one of them leaves its budget.
fn near(a: u32, b: u32, at: &[Row], budget: &[f32]) -> bool {
    let (a, b) = (a as usize, b as usize);
    let apart = [at[b][0] - at[a][0], at[b][1] - at[a][1], at[b][2] - at[a][2], 0.0];
    let reach = at[a][3] + budget[a].max(0.0) + at[b][3] + budget[b].max(0.0);
    squared(apart) < reach * reach
}
