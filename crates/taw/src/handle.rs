//! Stable handles of rows that move: a slot and a generation.

use crate::Error;

/// Stable handle of a marble.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MarbleId(pub(crate) Handle);

/// Stable handle of a wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct WallId(pub(crate) Handle);

/// Stable handle of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SensorId(pub(crate) Handle);

/// Stable handle of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct JointId(pub(crate) Handle);

/// Stable handle of a rigid body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BodyId(pub(crate) Handle);

/// Stable handle of a ball of a swarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BallId(pub(crate) Handle);

impl BallId {
    /// Bits of the handle, for a file or a message: [`BallId::from_bits`] makes the handle of them again.
    #[must_use]
    pub fn to_bits(self) -> u64 {
        u64::from(self.0.generation) << 32 | u64::from(self.0.slot)
    }

    /// Handle with these bits. Bits that no ball has are those of a ball that is gone.
    #[must_use]
    pub fn from_bits(bits: u64) -> Self {
        Self(Handle { slot: bits as u32, generation: (bits >> 32) as u32 })
    }
}

/// Generational handle of a row that may move. The generation distinguishes it from earlier
/// handles of the same slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Handle {
    pub slot: u32,
    pub generation: u32,
}

/// Row of a slot that is free, and of whatever has none.
pub(crate) const NO_ROW: u32 = u32::MAX;

/// Bidirectional map of handles and rows (a generational arena).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Handles {
    /// Slot of each row.
    slots: Vec<u32>,
    /// Row of each slot, or [`NO_ROW`].
    rows: Vec<u32>,
    /// Generation of the current or next handle of each slot; zero for those beyond the end, of
    /// which no handle was removed.
    generations: Vec<u32>,
    /// Free slots, the last freed last.
    free: Vec<u32>,
    /// Number of removals, each of which may move other rows.
    removals: u64,
}

impl Handles {
    /// Number of removals so far.
    pub fn removals(&self) -> u64 {
        self.removals
    }

    /// Slot of each row.
    pub fn slots(&self) -> &[u32] {
        &self.slots
    }

    /// Row of each slot; [`NO_ROW`] for a free one.
    pub fn rows(&self) -> &[u32] {
        &self.rows
    }

    /// Slots by row and rows by slot, for a caller that reorders rows.
    pub fn columns(&mut self) -> (&mut Vec<u32>, &mut [u32]) {
        (&mut self.slots, &mut self.rows)
    }

    /// Creates a handle for a new last row.
    ///
    /// # Errors
    /// [`Error::Full`] at 2³² − 1 slots.
    pub fn push(&mut self) -> Result<Handle, Error> {
        self.push_many(1)?;
        Ok(self.of_slot(self.slots[self.slots.len() - 1]))
    }

    /// Creates handles for `count` new rows at the end, all or none. Returns the first of them.
    ///
    /// # Errors
    /// [`Error::Full`] at 2³² − 1 slots.
    pub fn push_many(&mut self, count: usize) -> Result<usize, Error> {
        let first = self.slots.len();
        let reused = count.min(self.free.len());
        let slots = self.rows.len().checked_add(count - reused);
        let Some(slots) = slots.filter(|slots| *slots <= NO_ROW as usize) else {
            return Err(Error::Full(first));
        };
        let new = self.rows.len() as u32..slots as u32;
        self.slots.extend(self.free.drain(self.free.len() - reused..).chain(new));
        self.rows.resize(slots, NO_ROW);
        self.index_rows(first);
        Ok(first)
    }

    /// Removes a handle. The last row is swapped into its place, which is returned.
    pub fn swap_remove(&mut self, handle: Handle) -> Option<usize> {
        let row = self.row(handle)?;
        self.retire(handle);
        self.slots.swap_remove(row);
        if let Some(moved) = self.slots.get(row) {
            self.rows[*moved as usize] = row as u32;
        }
        Some(row)
    }

    /// Removes handles that exist, each listed once; the rows that are left move up. Returns by row if
    /// it is left.
    pub fn remove_many(&mut self, handles: impl Iterator<Item = Handle>) -> Vec<bool> {
        let mut kept = vec![true; self.slots.len()];
        for handle in handles {
            if let Some(row) = self.row(handle) {
                kept[row] = false;
                self.retire(handle);
            }
        }
        let mut row = 0;
        self.slots.retain(|_| {
            row += 1;
            kept[row - 1]
        });
        self.index_rows(0);
        kept
    }

    /// Notes where the slots of rows from `first` on are.
    fn index_rows(&mut self, first: usize) {
        for (row, slot) in (first as u32..).zip(&self.slots[first..]) {
            self.rows[*slot as usize] = row;
        }
    }

    /// Frees the slot of a handle.
    fn retire(&mut self, Handle { slot, generation }: Handle) {
        self.removals += 1;
        self.rows[slot as usize] = NO_ROW;
        if self.generations.len() <= slot as usize {
            self.generations.resize(self.rows.len(), 0);
        }
        // A slot with exhausted generations is never reused.
        if let Some(next) = generation.checked_add(1) {
            self.generations[slot as usize] = next;
            self.free.push(slot);
        }
    }

    /// Current row of a handle.
    pub fn row(&self, handle: Handle) -> Option<usize> {
        let row = *self.rows.get(handle.slot as usize)?;
        (row != NO_ROW && self.of_slot(handle.slot) == handle).then_some(row as usize)
    }

    /// Handle of a row.
    pub fn handle(&self, row: usize) -> Option<Handle> {
        self.slots.get(row).map(|slot| self.of_slot(*slot))
    }

    /// Current or next handle of a slot.
    fn of_slot(&self, slot: u32) -> Handle {
        let generation = self.generations.get(slot as usize).copied().unwrap_or(0);
        Handle { slot, generation }
    }

    /// Bytes that it has from the allocator.
    pub fn bytes(&self) -> usize {
        let all = [&self.slots, &self.rows, &self.generations, &self.free];
        all.iter().map(|column| column.capacity() * size_of::<u32>()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::test_runner::{RngAlgorithm, TestRng};
    use std::collections::HashMap;

    #[test]
    fn handles_survive_10_000_random_inserts_and_removes() {
        use proptest::prelude::Rng;
        let mut rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
        let mut handles = Handles::default();
        let mut values: Vec<u64> = Vec::new(); // a column beside the handles
        let mut expected: HashMap<Handle, u64> = HashMap::new();
        let mut removed: Vec<Handle> = Vec::new();
        for i in 0..10_000_u64 {
            // Grows for a while, then shrinks to nothing, ten times over.
            let growing = (i / 500) % 2 == 0;
            if rng.next_u32() % 4 < if growing { 3 } else { 1 } || expected.is_empty() {
                let handle = handles.push().unwrap();
                values.push(i);
                assert_eq!(expected.insert(handle, i), None, "a handle given out twice");
            } else {
                let row = rng.next_u32() as usize % values.len();
                let handle = handles.handle(row).unwrap();
                let value = expected.remove(&handle).unwrap();
                assert_eq!(handles.swap_remove(handle), Some(row));
                assert_eq!(values.swap_remove(row), value);
                removed.push(handle);
            }
            if i % 97 == 0 {
                assert_eq!(handles.slots().len(), expected.len());
                for (handle, value) in &expected {
                    let row = handles.row(*handle).unwrap();
                    assert_eq!(values[row], *value);
                    assert_eq!(handles.handle(row), Some(*handle));
                }
                for handle in &removed {
                    assert_eq!(handles.row(*handle), None, "a removed handle names a row");
                }
            }
        }
    }

    #[test]
    fn a_handle_is_removed_once() {
        let mut handles = Handles::default();
        let handle = handles.push().unwrap();
        assert_eq!(handles.swap_remove(handle), Some(0));
        assert_eq!(handles.swap_remove(handle), None);
        assert_ne!(handles.push().unwrap(), handle);
    }

    #[test]
    fn a_slot_whose_generations_are_used_up_retires() {
        let mut handles = Handles::default();
        let mut handle = handles.push().unwrap();
        handles.generations = vec![u32::MAX];
        handle.generation = u32::MAX;
        assert_eq!(handles.swap_remove(handle), Some(0));
        assert_eq!(handles.push().unwrap().slot, 1);
        assert_eq!(handles.row(handle), None);
    }

    #[test]
    fn rows_move_up_where_many_are_removed_at_once() {
        let mut handles = Handles::default();
        assert_eq!(handles.push_many(5).unwrap(), 0);
        let all: Vec<_> = (0..5).map(|row| handles.handle(row).unwrap()).collect();
        let kept = handles.remove_many([all[3], all[0]].into_iter());
        assert_eq!(kept, [false, true, true, false, true]);
        let rows: Vec<_> = all.iter().map(|handle| handles.row(*handle)).collect();
        assert_eq!(rows, [None, Some(0), Some(1), None, Some(2)]);
        assert_eq!(handles.removals(), 2);
        // Their slots are used again, with the next generation, and a new one after them.
        assert_eq!(handles.push_many(3).unwrap(), 3);
        let new = [3, 4, 5].map(|row| handles.handle(row).unwrap());
        assert_eq!(new.map(|handle| (handle.slot, handle.generation)), [(3, 1), (0, 1), (5, 0)]);
    }
}
