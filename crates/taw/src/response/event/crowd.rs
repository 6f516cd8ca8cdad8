//! Crowds: balls that overlap more others than they could touch, as thousands inserted at one point
//! do. No order of collisions parts these, since each one leads to the next at the same time. So
//! within a crowd there are none: it is one cluster, solved once per substep, which ends the
//! approach of its balls, and pushes them apart without a change of velocity.

use super::EventDriven;
use crate::contact::Contact;
use crate::response::impulse::UnionFind;

/// Largest number of balls of its own size or larger that a ball can touch without overlap (Schütte
/// and van der Waerden, *Das Problem der dreizehn Kugeln*, 1953). Thirteen overlap by 4 % of their
/// distance at least, ten times the slop.
const KISSING_NUMBER: u32 = 12;
/// Pairs of one crowd that are passed over per unit of cost: two nanoseconds each, of twenty.
const PAIRS_PER_COST: u64 = 8;

/// Crowds of a substep.
#[derive(Clone, Debug, Default)]
pub(super) struct Crowds {
    /// Crowd of each ball; empty if no ball is in one.
    of_row: Vec<Option<u32>>,
}

impl Crowds {
    /// Crowd of a ball.
    pub fn of(&self, row: usize) -> Option<u32> {
        self.of_row.get(row).copied().flatten()
    }

    /// Tests if two balls are in one crowd.
    pub fn are_together(&self, a: usize, b: usize) -> bool {
        self.of(a).is_some_and(|crowd| self.of(b) == Some(crowd))
    }
}

impl EventDriven {
    /// Finds the crowds among the contacts at the start of a substep.
    pub(super) fn find_crowds(&mut self, contacts: &[Contact<f64>]) {
        let deep: Vec<_> = contacts.iter().filter(|c| self.is_deep_in_ball(c)).collect();
        let mut counts = vec![0; self.balls.len()];
        for (a, b) in deep.iter().map(|c| (c.a as usize, c.b as usize)) {
            let [first, second] = [a, b].map(|row| self.balls[row].radius);
            counts[a] += u32::from(second >= first);
            counts[b] += u32::from(first >= second);
        }
        let is_crowded = |row: usize| counts[row] > KISSING_NUMBER;
        let rows = 0..self.balls.len();
        self.crowds.of_row.clear();
        if !rows.clone().any(is_crowded) {
            return;
        }
        let pairs = deep.iter().map(|c| (c.a as usize, c.b as usize));
        let pairs = pairs.filter(|(a, b)| is_crowded(*a) && is_crowded(*b));
        let mut sets = UnionFind::default();
        sets.build(pairs.map(|(a, b)| (Some(a), b)), rows.len());
        let crowd = |row: usize| is_crowded(row).then(|| sets.set_of(row));
        self.crowds.of_row.extend(rows.map(crowd));
    }

    /// Cost of passing over this many pairs of one crowd.
    pub(super) fn crowd_cost(pairs: u64) -> u64 {
        pairs.div_ceil(PAIRS_PER_COST)
    }
}
