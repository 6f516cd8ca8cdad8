//! Memory of what contacts bore, while rows change places and pairs are sought anew.

use super::batches::Batch;
use super::kernels::Pushes;
use super::slab::Slab;
use super::strays::Strays;
use super::team::{Shared, each};
use super::touch::Touch;
use super::walls::{find, shapes_of};

/// Impulses of a pair; kept with its first ball.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Kept {
    /// The row of the second ball.
    other: u32,
    pressure: f32,
    grip: [f32; 3],
}

/// See the module.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Memory {
    /// Where each row's pairs begin, and after the last row, one place further.
    start: Vec<u32>,
    kept: Vec<Kept>,
    touches: Vec<Touch>,
}

impl Memory {
    /// Keeps what the pairs and touches of all slabs bore. The rows are as they were.
    pub fn keep(&mut self, slabs: &[Slab], strays: &Strays, rows: usize, threads: usize) {
        self.touches.clear();
        self.touches.extend(slabs.iter().flat_map(|slab| &slab.touches));
        self.start.clear();
        self.start.resize(rows + 2, 0);
        {
            let counts = Shared::new(&mut self.start);
            // SAFETY: the first ball of a pair is in the slab, so only one thread counts it; and
            // the strays come alone.
            let count = |[row, _]: [u32; 2], _: Kept| unsafe { *counts.row(row as usize + 2) += 1 };
            each(threads, slabs.len(), |_, slab| {
                bearing(&slabs[slab].batches, &slabs[slab].pushes, count);
            });
            bearing(&strays.batches, &strays.pushes, count);
        }
        let mut sum = 0;
        for start in &mut self.start {
            sum += *start;
            *start = sum;
        }
        self.kept.clear();
        make_room(&mut self.kept, sum as usize);
        self.kept.resize(sum as usize, Kept::default());
        // As pairs are placed, each start grows to the one after it.
        let (start, places) = (Shared::new(&mut self.start), Shared::new(&mut self.kept));
        // SAFETY: as above, and each place is given out once.
        let place = |[row, _]: [u32; 2], kept: Kept| unsafe {
            let place = start.row(row as usize + 1);
            *places.row(*place as usize) = kept;
            *place += 1;
        };
        each(threads, slabs.len(), |_, slab| {
            bearing(&slabs[slab].batches, &slabs[slab].pushes, place);
        });
        bearing(&strays.batches, &strays.pushes, place);
    }

    /// Gives room back.
    pub fn fit(&mut self) {
        self.touches = Vec::new();
        fit(&mut self.kept);
    }

    /// Remembers nothing of so many rows.
    pub fn forget(&mut self, rows: usize) {
        self.touches.clear();
        self.kept.clear();
        self.start.clear();
        self.start.resize(rows + 2, 0);
    }

    pub fn bytes(&self) -> usize {
        self.start.capacity() * size_of::<u32>()
            + self.kept.capacity() * size_of::<Kept>()
            + self.touches.capacity() * size_of::<Touch>()
    }

    /// Gives the pairs of a batch what they bore. `before` says which row each row was.
    pub fn recall(&self, batches: &[Batch], before: &[u32], pushes: &mut Pushes) {
        for (i, batch) in batches.iter().enumerate() {
            for lane in 0..batch.count as usize {
                let [a, b] = batch.pair(lane).map(|row| before[row as usize]);
                let (first, other) = (a.min(b), a.max(b));
                if other == u32::MAX {
                    continue; // one of them is new
                }
                let kept = self.start[first as usize]..self.start[first as usize + 1];
                let kept = &self.kept[kept.start as usize..kept.end as usize];
                // A stray may have had a pair twice.
                for kept in kept.iter().filter(|kept| kept.other == other) {
                    pushes.pressure[i][lane] += kept.pressure;
                    if let Some(grip) = pushes.grip.get_mut(i) {
                        // The impulse is what the second of the two gets.
                        let sign = if first == a { 1.0 } else { -1.0 };
                        for (axis, grip) in grip.iter_mut().zip(kept.grip) {
                            axis[lane] += grip * sign;
                        }
                    }
                }
            }
        }
    }

    /// Names the touches of shapes other than half-spaces that a ball had, in order.
    pub fn shapes_of(&self, before: &[u32], row: u32) -> impl Iterator<Item = Touch> {
        let then = before[row as usize];
        shapes_of(&self.touches, then).map(move |touch| Touch { row, ..*touch })
    }

    /// Touch that a ball had with a wall before, with what it bore.
    pub fn recall_touch(&self, before: &[u32], touch: &Touch) -> Option<Touch> {
        let then = Touch { row: before[touch.row as usize], ..*touch };
        find(&self.touches, &then).copied()
    }
}

/// Makes room for so many, and a few more. (A list that doubles is half empty for a long time.)
#[inline(always)]
pub(super) fn make_room<T>(list: &mut Vec<T>, count: usize) {
    if list.capacity() < count {
        list.reserve_exact(count + count / 16 + 8 - list.len());
    }
}

/// Gives room back that is no longer needed.
pub(super) fn fit<T>(list: &mut Vec<T>) {
    let count = list.len() + list.len() / 16 + 8;
    if list.capacity() > count + count / 4 {
        list.shrink_to(count);
    }
}

/// Names the pairs that bear something.
fn bearing(batches: &[Batch], pushes: &Pushes, name: impl Fn([u32; 2], Kept)) {
    for (i, batch) in batches.iter().enumerate() {
        for lane in 0..batch.count as usize {
            let pressure = pushes.pressure[i][lane];
            if pressure > 0.0 {
                let grip = pushes.grip.get(i);
                let grip = grip.map_or([0.0; 3], |grip| grip.map(|axis| axis[lane]));
                let rows = batch.pair(lane);
                name(rows, Kept { other: rows[1], pressure, grip });
            }
        }
    }
}
