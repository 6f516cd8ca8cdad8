//! Graph colouring of pairs: batches in which no ball is twice.

use super::impulse_cache::reserve_slack;
use crate::math::LANES;

/// Wide constraint: eight pairs, none of which has a ball in common with another. As rows after a
/// first one, so that two bytes suffice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Batch {
    pub first: [u32; 2],
    pub a: [u16; LANES],
    pub b: [u16; LANES],
    /// Number of pairs; the rest repeat the first of them.
    pub count: u16,
    /// Set if all of these balls sleep.
    pub is_idle: bool,
}

impl Batch {
    /// The rows of a pair.
    pub fn pair(&self, lane: usize) -> [u32; 2] {
        [self.first[0] + u32::from(self.a[lane]), self.first[1] + u32::from(self.b[lane])]
    }

    /// All its pairs.
    pub fn pairs(&self) -> impl Iterator<Item = [u32; 2]> + '_ {
        (0..self.count as usize).map(|lane| self.pair(lane))
    }
}

/// Takes some pairs out of batches.
pub(super) fn take_out(batches: &mut Vec<Batch>, which: impl Fn([u32; 2]) -> bool) {
    for batch in &mut *batches {
        let before = *batch;
        let mut kept = (0..before.count as usize).filter(|lane| !which(before.pair(*lane)));
        batch.count = 0;
        if let Some(first) = kept.next() {
            (batch.a, batch.b) = ([before.a[first]; LANES], [before.b[first]; LANES]);
            batch.count = 1;
            for lane in kept {
                let to = batch.count as usize;
                (batch.a[to], batch.b[to]) = (before.a[lane], before.b[lane]);
                batch.count += 1;
            }
        }
    }
    batches.retain(|batch| batch.count > 0);
}

/// Number of pairs.
pub(super) fn pairs_in(batches: &[Batch]) -> usize {
    batches.iter().map(|batch| batch.count as usize).sum()
}

/// Number of colours: batches that are filled at a time.
pub(super) const MAX_COLOURS: usize = 32;
/// Rows by which a later pair may lie before the first one of a batch.
const BEFORE: u32 = 1 << 14;
/// Number of pairs listed at most: for each ball on average, and in addition. A ball has six pairs
/// with those of its size that touch it, and some more within the margin. Only balls inside of each
/// other have more, and they part as well if each is pushed by this number of the others at a time.
const PAIRS: usize = 64;
const MORE_PAIRS: usize = 4096;

/// Greedy colouring: each pair goes into the first open batch in which neither ball is.
pub(super) struct BatchBuilder<'a> {
    /// A power of two of them. Balls whose rows end in the same bits share one, which costs at
    /// most a place in a batch.
    colour_mask: &'a mut [u32],
    open: &'a mut [Batch; MAX_COLOURS],
    batches: &'a mut Vec<Batch>,
    /// Number of pairs that may still be listed, and of those that were not.
    left: usize,
    unlisted: usize,
}

pub(super) fn builder<'a>(
    colour_mask: &'a mut Vec<u32>,
    open: &'a mut [Batch; MAX_COLOURS],
    balls: usize,
    batches: &'a mut Vec<Batch>,
) -> BatchBuilder<'a> {
    colour_mask.clear();
    colour_mask.resize(balls.next_power_of_two(), 0);
    BatchBuilder { colour_mask, open, batches, left: MORE_PAIRS, unlisted: 0 }
}

impl BatchBuilder<'_> {
    /// Makes room for the pairs of a ball; returns how many of them there is room for.
    #[inline(always)]
    pub fn spend(&mut self, pairs: usize) -> usize {
        self.allow(1);
        self.spend_only(pairs)
    }

    /// Makes room for the pairs of this number of balls.
    pub fn allow(&mut self, balls: usize) {
        self.left += PAIRS * balls;
    }

    /// Takes room for these pairs as far as there is any, and counts the rest as unlisted. Returns the
    /// number of pairs that got room.
    #[inline(always)]
    pub fn spend_only(&mut self, pairs: usize) -> usize {
        let count = pairs.min(self.left);
        self.left -= count;
        self.unlisted += pairs - count;
        count
    }

    #[inline(always)]
    pub fn add(&mut self, a: u32, b: u32) {
        let colour_mask = *self.colour_mask(a) | *self.colour_mask(b);
        let mut slot = colour_mask.trailing_ones() as usize;
        if slot == MAX_COLOURS {
            // A large ball among many small ones.
            slot = self.fullest();
            self.close(slot);
        }
        let batch = &mut self.open[slot];
        let mut place = [a.wrapping_sub(batch.first[0]), b.wrapping_sub(batch.first[1])];
        if batch.count == 0 || (place[0] | place[1]) > u32::from(u16::MAX) {
            self.close(slot);
            let batch = &mut self.open[slot];
            batch.first = [a.saturating_sub(BEFORE), b.saturating_sub(BEFORE)];
            place = [a - batch.first[0], b - batch.first[1]];
            (batch.a, batch.b) = ([place[0] as u16; LANES], [place[1] as u16; LANES]);
        }
        let batch = &mut self.open[slot];
        let lane = batch.count as usize % LANES;
        (batch.a[lane], batch.b[lane]) = (place[0] as u16, place[1] as u16);
        batch.count += 1;
        *self.colour_mask(a) |= 1 << slot;
        *self.colour_mask(b) |= 1 << slot;
        if self.open[slot].count as usize == LANES {
            self.close(slot);
        }
    }

    /// The open batches in which a row is.
    #[inline(always)]
    fn colour_mask(&mut self, row: u32) -> &mut u32 {
        let at = row as usize & (self.colour_mask.len() - 1);
        // SAFETY: the length is a power of two.
        unsafe { self.colour_mask.get_unchecked_mut(at) }
    }

    #[cold]
    fn fullest(&self) -> usize {
        let counts = self.open.iter().map(|batch| batch.count);
        counts
            .enumerate()
            .max_by_key(|(slot, count)| (*count, MAX_COLOURS - slot))
            .map_or(0, |(slot, _)| slot)
    }

    /// Takes an open batch as it is, and begins another one.
    #[inline(always)]
    fn close(&mut self, slot: usize) {
        let batch = self.open[slot];
        if batch.count > 0 {
            for lane in 0..batch.count as usize {
                for row in batch.pair(lane) {
                    *self.colour_mask(row) &= !(1 << slot);
                }
            }
            push(self.batches, batch);
            self.open[slot].count = 0;
        }
    }

    /// Takes the open batches as they are. Says how many pairs there was no room for.
    pub fn close_all(&mut self) -> usize {
        (0..MAX_COLOURS).for_each(|slot| self.close(slot));
        self.unlisted
    }
}

#[inline(always)]
fn push(batches: &mut Vec<Batch>, batch: Batch) {
    reserve_slack(batches, batches.len() + 1);
    batches.push(batch);
}
