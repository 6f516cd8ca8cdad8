//! Crowds: balls that overlap more others than they could touch, as thousands inserted at one point
//! do. No order of collisions parts these, since each one leads to the next at the same time. So
//! within a crowd there are none: it is one cluster, solved once per substep, which ends the
//! approach of its balls, and pushes them apart without a change of velocity.

use std::collections::BTreeMap;

use super::cells::{Cell, Cells};
use super::{CellSlot, EventSolver};
use crate::contact::Contact;
use crate::math::UnionFind;

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
    /// Cells of the balls in the largest crowd, which pass over each other: whoever is in it looks at
    /// the others only.
    cells: Cells,
    largest: Option<u32>,
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

    /// Tests if a ball is in the largest crowd.
    fn is_in_largest(&self, row: usize) -> bool {
        self.largest.is_some() && self.of(row) == self.largest
    }

    /// The crowd with the most balls.
    fn find_largest(&self) -> Option<u32> {
        let mut counts = BTreeMap::new();
        self.of_row.iter().flatten().for_each(|crowd| *counts.entry(*crowd).or_insert(0_u32) += 1);
        counts.into_iter().max_by_key(|(_, count)| *count).map(|(crowd, _)| crowd)
    }
}

impl EventSolver {
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
        self.crowds.largest = None;
        if !rows.clone().any(is_crowded) {
            return;
        }
        let pairs = deep.iter().map(|c| (c.a as usize, c.b as usize));
        let pairs = pairs.filter(|(a, b)| is_crowded(*a) && is_crowded(*b));
        let mut sets = UnionFind::default();
        sets.build(pairs.map(|(a, b)| (Some(a), b)), rows.len());
        let crowd = |row: usize| is_crowded(row).then(|| sets.set_of(row));
        self.crowds.of_row.extend(rows.map(crowd));
        self.crowds.largest = self.crowds.find_largest();
        self.part_cells();
    }

    /// Moves the balls of the largest crowd to cells of their own.
    fn part_cells(&mut self) {
        self.crowds.cells.reset(self.balls.len(), self.cell_width(), self.period);
        for (row, ball) in self.balls.iter().enumerate() {
            if let CellSlot::Cell(cell) = ball.trajectory.cell_slot
                && self.crowds.is_in_largest(row)
            {
                self.cells.remove(row as u32);
                self.crowds.cells.insert(row as u32, cell);
            }
        }
    }

    /// Cells that a ball is listed in.
    pub(super) fn cells_of(&mut self, row: usize) -> &mut Cells {
        if self.crowds.is_in_largest(row) { &mut self.crowds.cells } else { &mut self.cells }
    }

    /// Visits the rows in a cell and around it, except those that are in the largest crowd as the row is.
    pub(super) fn for_each_around(&self, row: usize, cell: Cell, mut visit: impl FnMut(usize)) {
        self.cells.for_each_near(cell, &mut visit);
        if self.crowds.largest.is_some() && !self.crowds.is_in_largest(row) {
            self.crowds.cells.for_each_near(cell, visit);
        }
    }

    /// Cost of passing over this many pairs of one crowd.
    pub(super) fn crowd_cost(pairs: u64) -> u64 {
        pairs.div_ceil(PAIRS_PER_COST)
    }
}
