//! State of sleep: how long balls have rested, and who fell asleep with whom.

use super::bit_set::BitSet;
use super::rest::RestColumns;
use super::state::of;
use crate::math::Scalar;

/// All that is known of sleep, besides who is asleep.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SleepState<S> {
    pub rest: RestColumns<S>,
    pub groups: SleepGroups,
    /// Slots of balls that never sleep, nor do their islands.
    pub sleepless: BitSet,
    /// Slots of balls that touch an awake rigid body: neither they nor their islands fall asleep.
    pub held: BitSet,
    /// Slots of balls that were changed from outside since the last step.
    pub stirred: BitSet,
    /// Number of balls that sleep.
    pub sleepers: usize,
    /// Steps in which balls rested since islands were searched, below eight.
    pub clock: u32,
}

impl<S: Scalar> SleepState<S> {
    pub fn bytes(&self) -> usize {
        let Self { rest, groups, sleepless, held, stirred, sleepers: _, clock: _ } = self;
        let sets = sleepless.bytes() + held.bytes() + stirred.bytes();
        rest.bytes() + groups.bytes() + sets
    }

    /// Returns true for a slot whose ball may not fall asleep.
    pub fn is_sleepless(&self, slot: u32) -> bool {
        self.sleepless.contains(slot) || self.held.contains(slot)
    }
}

/// Groups of balls that fell asleep together, and wake together: a ring of slots each.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SleepGroups {
    /// Next slot of the ring; the slot itself for a ball that is in none.
    next: Vec<u32>,
}

impl SleepGroups {
    /// Joins slots that are in no group.
    pub fn join(&mut self, slots: impl Iterator<Item = u32> + Clone) {
        let Some(first) = slots.clone().next() else { return };
        let nexts = slots.clone().skip(1).chain([first]);
        for (slot, next) in slots.zip(nexts) {
            self.next.extend(self.next.len() as u32..=slot); // each alone
            self.next[slot as usize] = next;
        }
    }

    /// Visits the slots of the group of a slot, that one first, if they are no more than `most`. Returns
    /// false and visits some of them if they are.
    pub fn visit(&self, slot: u32, most: usize, mut visit: impl FnMut(u32)) -> bool {
        let mut at = slot;
        for _ in 0..most {
            visit(at);
            at = self.next.get(at as usize).copied().unwrap_or(at);
            if at == slot {
                return true;
            }
        }
        false
    }

    /// Dissolves the group of a slot, and visits its slots.
    pub fn dissolve(&mut self, slot: u32, mut visit: impl FnMut(u32)) {
        let mut at = slot;
        loop {
            let Some(next) = self.next.get_mut(at as usize) else { return visit(at) };
            let next = std::mem::replace(next, at);
            visit(at);
            if next == slot {
                return;
            }
            at = next;
        }
    }

    /// Dissolves all.
    pub fn clear(&mut self) {
        self.next.clear();
    }

    pub fn bytes(&self) -> usize {
        of(&self.next)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_is_dissolved_as_a_whole_and_no_other_one() {
        let mut groups = SleepGroups::default();
        let of = |groups: &SleepGroups, slot| {
            let mut slots = Vec::new();
            groups.clone().dissolve(slot, |slot| slots.push(slot));
            slots.sort_unstable();
            slots
        };
        assert_eq!(of(&groups, 7), [7]);
        groups.join([9, 2, 4].into_iter());
        groups.join([3].into_iter());
        groups.join(std::iter::empty());
        for slot in [2, 4, 9] {
            assert_eq!(of(&groups, slot), [2, 4, 9]);
            let mut slots = Vec::new();
            assert!(groups.visit(slot, 3, |slot| slots.push(slot)));
            slots.sort_unstable();
            assert_eq!(slots, [2, 4, 9]);
            assert!(!groups.visit(slot, 2, |_| ()));
        }
        for slot in [0, 3, 8, 20] {
            assert_eq!(of(&groups, slot), [slot]);
        }
        groups.dissolve(4, |_| ());
        assert_eq!(of(&groups, 9), [9]);
        groups.join([9, 3].into_iter());
        assert_eq!(of(&groups, 3), [3, 9]);
    }
}
