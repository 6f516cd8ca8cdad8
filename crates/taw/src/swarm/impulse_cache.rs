//! Cache of contact impulses for warm starts, while rows change places and pairs are searched
//! again.

use super::batches::Batch;
use super::chunk::Chunk;
use super::fast_movers::FastMovers;
use super::kernels::ContactImpulses;
use super::wall_contact::WallContact;
use super::walls::{find, shapes_of};
use crate::math::Scalar;
use crate::workers::{DisjointSlice, parallel_for};

/// Impulses of a pair; stored with its first ball.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct CachedPair<S> {
    /// The row of the second ball.
    other: u32,
    normal_impulse: S,
    tangent_impulse: [S; 3],
}

/// See the module.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ImpulseCache<S> {
    /// Beginning of each row's pairs, and after the last row, one place further.
    start: Vec<u32>,
    kept: Vec<CachedPair<S>>,
    wall_contacts: Vec<WallContact<S>>,
}

impl<S: Scalar> ImpulseCache<S> {
    /// Stores the impulses of all pairs and contacts with walls. The rows are as they were.
    pub fn keep(
        &mut self,
        chunks: &[Chunk<S>],
        fast_movers: &FastMovers<S>,
        rows: usize,
        threads: usize,
    ) {
        self.wall_contacts.clear();
        self.wall_contacts.extend(chunks.iter().flat_map(|chunk| &chunk.wall_contacts));
        self.start.clear();
        self.start.resize(rows + 2, 0);
        {
            let counts = DisjointSlice::new(&mut self.start);
            // SAFETY: the first ball of a pair is in the chunk, so only one thread counts it; and
            // the fast movers come alone.
            let count = |[row, _]: [u32; 2], _: CachedPair<S>| unsafe {
                *counts.row(row as usize + 2) += 1;
            };
            parallel_for(threads, chunks.len(), |_, chunk| {
                for_each_loaded(&chunks[chunk].batches, &chunks[chunk].impulses, count);
            });
            for_each_loaded(&fast_movers.batches, &fast_movers.impulses, count);
        }
        let mut sum = 0;
        for start in &mut self.start {
            sum += *start;
            *start = sum;
        }
        self.kept.clear();
        reserve_slack(&mut self.kept, sum as usize);
        self.kept.resize(sum as usize, CachedPair::default());
        // As pairs are placed, each start grows to the one after it.
        let (start, places) =
            (DisjointSlice::new(&mut self.start), DisjointSlice::new(&mut self.kept));
        // SAFETY: as above, and each place is given out once.
        let place = |[row, _]: [u32; 2], kept: CachedPair<S>| unsafe {
            let place = start.row(row as usize + 1);
            *places.row(*place as usize) = kept;
            *place += 1;
        };
        parallel_for(threads, chunks.len(), |_, chunk| {
            for_each_loaded(&chunks[chunk].batches, &chunks[chunk].impulses, place);
        });
        for_each_loaded(&fast_movers.batches, &fast_movers.impulses, place);
    }

    /// Gives room back.
    pub fn shrink_slack(&mut self) {
        self.wall_contacts = Vec::new();
        shrink_slack(&mut self.kept);
    }

    /// Empties the cache.
    pub fn clear(&mut self) {
        self.wall_contacts.clear();
        self.kept.clear();
        self.start.clear();
    }

    /// Caches that none of `rows` rows bears anything.
    pub fn forget(&mut self, rows: usize) {
        self.clear();
        self.start.resize(rows + 2, 0);
    }

    pub fn bytes(&self) -> usize {
        self.start.capacity() * size_of::<u32>()
            + self.kept.capacity() * size_of::<CachedPair<S>>()
            + self.wall_contacts.capacity() * size_of::<WallContact<S>>()
    }

    /// Scales the impulses of some balls by factors, given their rows then.
    pub fn scale(&mut self, balls: impl Iterator<Item = (u32, S)>) {
        let Self { start, kept, wall_contacts } = self;
        let mut factors = vec![S::one(); start.len()];
        for (row, factor) in balls {
            if let Some(of_row) = factors.get_mut(row as usize) {
                *of_row = factor; // not new
            }
        }
        for (range, factor) in start.windows(2).zip(&factors) {
            for cached in &mut kept[range[0] as usize..range[1] as usize] {
                let factor = factor.min(factors[cached.other as usize]);
                cached.normal_impulse *= factor;
                cached.tangent_impulse = cached.tangent_impulse.map(|x| x * factor);
            }
        }
        for contact in wall_contacts {
            contact.scale(factors[contact.row as usize]);
        }
    }

    /// Gives the pairs of a batch their cached impulses. `before` is the earlier row of each row.
    pub fn restore(&self, batches: &[Batch], old_rows: &[u32], impulses: &mut ContactImpulses<S>) {
        for (i, batch) in batches.iter().enumerate() {
            for lane in 0..batch.count as usize {
                let [a, b] = batch.pair(lane).map(|row| old_rows[row as usize]);
                let (first, other) = (a.min(b), a.max(b));
                if other == u32::MAX {
                    continue; // one of them is new
                }
                let kept = self.start[first as usize]..self.start[first as usize + 1];
                let kept = &self.kept[kept.start as usize..kept.end as usize];
                // A fast mover may have had a pair twice.
                for kept in kept.iter().filter(|kept| kept.other == other) {
                    impulses.normal_impulse[i][lane] += kept.normal_impulse;
                    if let Some(tangent_impulse) = impulses.tangent_impulse.get_mut(i) {
                        // The impulse is what the second of the two gets.
                        let sign = if first == a { S::one() } else { -S::one() };
                        for (axis, tangent_impulse) in
                            tangent_impulse.iter_mut().zip(kept.tangent_impulse)
                        {
                            axis[lane] += tangent_impulse * sign;
                        }
                    }
                }
            }
        }
    }

    /// Contacts with walls, in order, for walls that changed places.
    pub fn wall_contacts_mut(&mut self) -> &mut Vec<WallContact<S>> {
        &mut self.wall_contacts
    }

    /// Contacts that a ball had with shapes other than half-spaces, in order.
    pub fn shapes_of(&self, old_rows: &[u32], row: u32) -> impl Iterator<Item = WallContact<S>> {
        let then = old_rows[row as usize];
        shapes_of(&self.wall_contacts, then).map(move |contact| WallContact { row, ..*contact })
    }

    /// Contact that a ball had with a wall before, with its impulses.
    pub fn cached_contact(
        &self,
        old_rows: &[u32],
        contact: &WallContact<S>,
    ) -> Option<WallContact<S>> {
        let then = WallContact { row: old_rows[contact.row as usize], ..*contact };
        find(&self.wall_contacts, &then).copied()
    }
}

/// Reserves room for `count` entries, and a few more. (A list that doubles is half empty for a long time.)
#[inline(always)]
pub(super) fn reserve_slack<T>(list: &mut Vec<T>, count: usize) {
    if list.capacity() < count {
        list.reserve_exact(count + count / 16 + 8 - list.len());
    }
}

/// Gives room back that is no longer needed.
pub(super) fn shrink_slack<T>(list: &mut Vec<T>) {
    let count = list.len() + list.len() / 16 + 8;
    if list.capacity() > count + count / 4 {
        list.shrink_to(count);
    }
}

/// Visits the pairs that carry a normal impulse.
fn for_each_loaded<S: Scalar>(
    batches: &[Batch],
    impulses: &ContactImpulses<S>,
    visit: impl Fn([u32; 2], CachedPair<S>),
) {
    for (i, batch) in batches.iter().enumerate() {
        for lane in 0..batch.count as usize {
            let normal_impulse = impulses.normal_impulse[i][lane];
            if normal_impulse > S::zero() {
                let tangent_impulse = impulses.tangent_impulse.get(i);
                let tangent_impulse = tangent_impulse.map_or([S::zero(); 3], |tangent_impulse| {
                    tangent_impulse.map(|axis| axis[lane])
                });
                let rows = batch.pair(lane);
                visit(rows, CachedPair { other: rows[1], normal_impulse, tangent_impulse });
            }
        }
    }
}
