//! Stable handles of rows that move: an index and a generation.

use crate::Error;

/// Stable handle of a marble.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MarbleId(pub(crate) Handle);

/// Generational handle of an index that may move. The generation distinguishes it from earlier
/// handles of the same slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Handle {
    pub slot: u32,
    pub generation: u32,
}

/// Bidirectional map of handles and indices (a generational arena).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Handles {
    slots: Vec<Slot>,
    /// Slot of each index.
    rows: Vec<u32>,
    /// Free slots, the last freed first.
    free: Vec<u32>,
    /// Number of removals, each of which moves another index.
    removals: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Slot {
    /// Generation of the current or next handle.
    generation: u32,
    row: Option<u32>,
}

impl Handles {
    /// Number of removals so far.
    pub fn removals(&self) -> u64 {
        self.removals
    }

    /// Creates a handle for a new last index.
    pub fn push(&mut self) -> Result<Handle, Error> {
        let full = |_| Error::Full(self.rows.len());
        let row = u32::try_from(self.rows.len()).map_err(full)?;
        let slot = if let Some(slot) = self.free.pop() {
            slot
        } else {
            let slot = u32::try_from(self.slots.len()).map_err(full)?;
            self.slots.push(Slot { generation: 0, row: None });
            slot
        };
        self.rows.push(slot);
        let entry = &mut self.slots[slot as usize];
        entry.row = Some(row);
        Ok(Handle { slot, generation: entry.generation })
    }

    /// Removes a handle. The last index is swapped into its place, which is returned.
    pub fn swap_remove(&mut self, handle: Handle) -> Option<usize> {
        let row = self.row(handle)?;
        self.rows.swap_remove(row);
        self.removals += 1;
        if let Some(moved) = self.rows.get(row) {
            self.slots[*moved as usize].row = Some(row as u32);
        }
        let slot = &mut self.slots[handle.slot as usize];
        slot.row = None;
        // A slot with exhausted generations is never reused.
        if let Some(next) = slot.generation.checked_add(1) {
            slot.generation = next;
            self.free.push(handle.slot);
        }
        Some(row)
    }

    /// Current index of a handle.
    pub fn row(&self, handle: Handle) -> Option<usize> {
        let slot = self.slots.get(handle.slot as usize)?;
        let row = slot.row? as usize;
        (slot.generation == handle.generation).then_some(row)
    }

    /// Handle of an index.
    pub fn handle(&self, row: usize) -> Option<Handle> {
        let slot = *self.rows.get(row)?;
        Some(Handle { slot, generation: self.slots[slot as usize].generation })
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
                assert_eq!(handles.rows.len(), expected.len());
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
        handles.slots[0].generation = u32::MAX;
        handle.generation = u32::MAX;
        assert_eq!(handles.swap_remove(handle), Some(0));
        assert_eq!(handles.push().unwrap().slot, 1);
        assert_eq!(handles.row(handle), None);
    }
}
