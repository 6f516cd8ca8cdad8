//! Balls that left their skin: few, so pairs are searched for them alone, and one fast ball does
//! not cost a search for all. Those that go further in a step than skins reach are looked for along
//! their [paths](super::sweeps).
//!
//! Pairs that such a ball already has in its chunk stay there. One that it then has twice shares
//! its impulse between the two.

use super::batches::{Batch, BatchBuilder};
use super::bit_set::BitSet;
use super::grid::SortedGrid;
use super::kernels::{ContactImpulses, squared};
use super::neighbours::NeighbourSearch;
use super::surfaces::SurfaceOf;
use super::sweeps::BallPaths;
use crate::math::{Row, Scalar};

/// Fast movers at most: `BASE_COUNT`, and one of each `BALLS_PER_MOVER` balls.
const BALLS_PER_MOVER: usize = 500;
const BASE_COUNT: usize = 32;

/// See the module.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct FastMovers<S> {
    /// Their rows, in order, and a bit for each row.
    pub rows: Vec<u32>,
    bits: BitSet,
    /// Those of them whose pairs were found on their paths, and so hold for these paths only.
    by_path: BitSet,
    /// Their pairs, and how many more there was no room for.
    pub batches: Vec<Batch>,
    pub unlisted: usize,
    pub impulses: ContactImpulses<S>,
    /// Impulses of their pairs before the last search, in order.
    cached: Vec<SavedPair<S>>,
    /// The fast movers along the x axis.
    sorted: Vec<u32>,
    /// Set while more balls than there may be fast movers go further than skins reach; and pairs of
    /// those that meet there.
    pub crowded: bool,
    pub crossing: Vec<[u32; 2]>,
    /// Balls along the path of one. Scratch.
    beside: Vec<u32>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct SavedPair<S> {
    pair: [u32; 2],
    normal_impulse: S,
    tangent_impulse: [S; 3],
}

/// Largest number of fast movers among `balls` balls.
pub(super) fn max_count(balls: usize) -> usize {
    BASE_COUNT + balls / BALLS_PER_MOVER
}

/// Balls in the order of their cells.
pub(super) struct SortedBalls<'a, S> {
    pub grid: &'a SortedGrid<S>,
    /// Center and radius.
    pub at: &'a [Row<S>],
    /// Remaining skin, in metres.
    pub skin_left: &'a [S],
    pub surfaces: SurfaceOf<'a, S>,
    /// Paths of those that go further than skins reach; none in the lab's tier.
    pub sweep: Option<BallPaths<'a, S>>,
}

impl<S: Scalar> SortedBalls<'_, S> {
    /// Returns true if two balls that collide might touch before one of them leaves its skin.
    fn near(&self, a: u32, b: u32) -> bool {
        let (at, skin_left) = (self.at, self.skin_left);
        let widest = skin_left[a as usize].max(skin_left[b as usize]);
        if let Some(sweep) = self.sweep.as_ref().filter(|sweep| widest > sweep.reach) {
            return sweep.meet(a, b) && self.surfaces.may_collide(a, b);
        }
        let (a, b) = (a as usize, b as usize);
        let apart = [at[b][0] - at[a][0], at[b][1] - at[a][1], at[b][2] - at[a][2], S::zero()];
        let reach = at[a][3] + skin_left[a].max(S::zero()) + at[b][3] + skin_left[b].max(S::zero());
        squared(apart) < reach * reach && self.surfaces.may_collide(a as u32, b as u32)
    }
}

impl<S: Scalar> FastMovers<S> {
    /// Returns true if `more` further ones are too many.
    pub fn full(&self, more: usize, balls: usize) -> bool {
        more > self.remaining(balls)
    }

    /// Number that may still be added, among `balls` balls.
    pub fn remaining(&self, balls: usize) -> usize {
        max_count(balls).saturating_sub(self.rows.len())
    }

    /// Forgets all fast movers and their pairs.
    pub fn clear(&mut self) {
        self.rows.clear();
        self.crossing.clear();
        self.crowded = false;
        self.unlisted = 0;
        self.batches.clear();
        self.impulses.reset(0);
        self.bits.clear();
        self.by_path.clear();
    }

    /// Adds a ball; says whether its pairs are found on its path.
    pub fn add(&mut self, row: u32, by_path: bool) {
        if self.bits.insert(row) {
            self.rows.push(row);
        }
        if by_path {
            self.by_path.insert(row);
        } else {
            self.by_path.remove(row);
        }
    }

    /// Returns true if pairs of a ball hold for its path only.
    #[inline]
    pub fn is_by_path(&self, row: u32) -> bool {
        self.by_path.contains(row)
    }

    #[inline]
    pub fn has(&self, row: u32) -> bool {
        self.bits.contains(row)
    }

    /// Finds all their pairs. `more` is the largest radius of all balls and the largest displacement
    /// of other balls since the rows were sorted. Proxies touch each other without the swarm.
    pub fn find(
        &mut self,
        balls: &SortedBalls<S>,
        more: S,
        search: &mut NeighbourSearch<S>,
        proxy: &dyn Fn(u32) -> bool,
        has_friction: bool,
    ) {
        if has_friction {
            self.save_impulses();
        }
        self.rows.sort_unstable();
        let mut batches = std::mem::take(&mut self.batches);
        batches.clear();
        self.unlisted = 0;
        if !self.rows.is_empty() || !self.crossing.is_empty() {
            let SortedBalls { at, skin_left, .. } = *balls;
            let count = 64 * self.rows.len() + 2 * self.crossing.len();
            let mut builder = search.builder(count, &mut batches);
            let widest = self.rows.iter().fold(S::zero(), |most, row| {
                most.max(at[*row as usize][3] + skin_left[*row as usize])
            });
            builder.allow(at.len());
            for [a, b] in &self.crossing {
                if builder.spend_only(1) == 1 {
                    builder.add(*a, *b);
                }
            }
            let mut beside = std::mem::take(&mut self.beside);
            for mover in &self.rows {
                match balls.sweep.filter(|sweep| sweep.is_swift(*mover)) {
                    Some(sweep) => {
                        sweep.visit_path(*mover, balls.grid, more, &mut beside);
                        self.add_pairs(*mover, beside.iter().copied(), balls, proxy, &mut builder);
                    }
                    None => self.find_pairs_of(*mover, balls, more, proxy, &mut builder),
                }
            }
            self.beside = beside;
            self.sorted.clear();
            self.sorted.extend(&self.rows);
            let x = |row: &u32| at[*row as usize][0];
            self.sorted.sort_unstable_by(|a, b| x(a).total_cmp(&x(b)).then(a.cmp(b)));
            for (i, a) in self.sorted.iter().enumerate() {
                let reach = at[*a as usize][3] + skin_left[*a as usize];
                let far = x(a) + reach + widest;
                for b in self.sorted[i + 1..].iter().take_while(|b| x(b) <= far) {
                    let both_proxies = proxy(*a) && proxy(*b);
                    if balls.near(*a, *b) && !both_proxies && builder.spend_only(1) == 1 {
                        builder.add(*a.min(b), *a.max(b));
                    }
                }
            }
            self.unlisted = builder.close_all();
        }
        self.batches = batches;
        if has_friction {
            self.impulses.reset(self.batches.len());
            self.restore();
        }
    }

    /// Adds the pairs of one with those of some balls that are none.
    fn add_pairs(
        &self,
        mover: u32,
        others: impl IntoIterator<Item = u32>,
        balls: &SortedBalls<S>,
        proxy: &dyn Fn(u32) -> bool,
        builder: &mut BatchBuilder,
    ) {
        let is_marble = proxy(mover);
        for other in others {
            let is_for_others = self.has(other) || is_marble && proxy(other);
            if !is_for_others && balls.near(mover, other) && builder.spend_only(1) == 1 {
                builder.add(mover.min(other), mover.max(other));
            }
        }
    }

    /// Finds the pairs of one with balls that are none.
    fn find_pairs_of(
        &self,
        mover: u32,
        balls: &SortedBalls<S>,
        more: S,
        proxy: &dyn Fn(u32) -> bool,
        builder: &mut BatchBuilder,
    ) {
        let SortedBalls { grid, at, skin_left, .. } = *balls;
        let at = &at[mover as usize];
        let far = at[3] + skin_left[mover as usize] + more;
        for level in &grid.levels {
            grid.for_each_run(level, at, far, |rows| {
                self.add_pairs(mover, rows, balls, proxy, builder);
            });
        }
    }

    /// Saves the impulses of their pairs.
    fn save_impulses(&mut self) {
        self.cached.clear();
        for (i, batch) in self.batches.iter().enumerate() {
            for lane in 0..batch.count as usize {
                let normal_impulse = self.impulses.normal_impulse[i][lane];
                if normal_impulse > S::zero() {
                    let tangent_impulse = self.impulses.tangent_impulse.get(i);
                    let tangent_impulse = tangent_impulse
                        .map_or([S::zero(); 3], |tangent_impulse| {
                            tangent_impulse.map(|axis| axis[lane])
                        });
                    self.cached.push(SavedPair {
                        pair: batch.pair(lane),
                        normal_impulse,
                        tangent_impulse,
                    });
                }
            }
        }
        self.cached.sort_unstable_by_key(|cached| cached.pair);
    }

    fn restore(&mut self) {
        for (i, batch) in self.batches.iter().enumerate() {
            for lane in 0..batch.count as usize {
                let pair = batch.pair(lane);
                let Ok(at) = self.cached.binary_search_by_key(&pair, |cached| cached.pair) else {
                    continue;
                };
                let SavedPair { normal_impulse, tangent_impulse, .. } = self.cached[at];
                self.impulses.normal_impulse[i][lane] = normal_impulse;
                if let Some(to) = self.impulses.tangent_impulse.get_mut(i) {
                    for (axis, tangent_impulse) in to.iter_mut().zip(tangent_impulse) {
                        axis[lane] = tangent_impulse;
                    }
                }
            }
        }
    }

    pub fn bytes(&self) -> usize {
        (self.rows.capacity() + self.sorted.capacity() + self.beside.capacity()) * size_of::<u32>()
            + self.crossing.capacity() * size_of::<[u32; 2]>()
            + self.bits.bytes()
            + self.by_path.bytes()
            + self.batches.capacity() * size_of::<Batch>()
            + self.impulses.bytes()
            + self.cached.capacity() * size_of::<SavedPair<S>>()
    }
}
