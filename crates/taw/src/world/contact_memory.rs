//! Memory of contacts from substep to substep, which follows marbles and walls as they come and go.

use super::World;
use super::one_way::OneWayState;
use super::walls::WallId;
use crate::handle::MarbleId;
use crate::math::Scalar;
use crate::response::impulse::CachedImpulse;
use crate::response::{SpringHistory, follow_rows};

/// Impulses and springs of the last substep's contacts, by row.
#[derive(Clone, Debug, PartialEq, Default)]
pub(super) struct ContactMemory<S> {
    pub impulses: Vec<CachedImpulse<S>>,
    pub springs: Vec<SpringHistory<S>>,
    /// Those of marbles that sleep.
    pub sleeping_impulses: Vec<CachedImpulse<S>>,
    pub sleeping_springs: Vec<SpringHistory<S>>,
    /// Impulses of the clusters at rest of [`Response::EventDriven`](crate::response::Response).
    pub event_impulses: Vec<CachedImpulse<f64>>,
    /// Decisions of one-way walls, sorted by wall and marble.
    pub one_way: Vec<OneWayState>,
    /// Handles of the rows then: a removal moves another marble or wall into its row.
    marbles: Vec<MarbleId>,
    walls: Vec<WallId>,
    /// Number of removals of marbles and of walls until then.
    removals: [u64; 2],
}

impl<S: Scalar> World<S> {
    /// Forgets what contacts remember from substep to substep.
    pub(super) fn forget_contacts(&mut self) {
        self.memory.impulses.clear();
        self.memory.springs.clear();
        self.memory.sleeping_impulses.clear();
        self.memory.sleeping_springs.clear();
        self.memory.event_impulses.clear();
    }

    /// Brings the memory of contacts up to date with the rows of marbles and walls.
    pub(super) fn follow_contacts(&mut self) {
        let (marbles, walls, memory) = (&self.marbles, &self.walls, &mut self.memory);
        let removals = [marbles.removals(), walls.removals()];
        if memory.removals != removals {
            let ContactMemory {
                impulses,
                springs,
                sleeping_impulses,
                sleeping_springs,
                event_impulses,
                marbles: old,
                walls: old_walls,
                ..
            } = memory;
            let marble = |row: usize| old.get(row).and_then(|id| marbles.row(*id).ok());
            let wall = |row: usize| old_walls.get(row).and_then(|id| walls.row(*id).ok());
            follow_rows(impulses, marble, wall);
            follow_rows(springs, marble, wall);
            follow_rows(sleeping_impulses, marble, wall);
            follow_rows(sleeping_springs, marble, wall);
            if memory.removals[1] == removals[1] {
                follow_rows(event_impulses, marble, Some);
            } else {
                event_impulses.clear(); // they have rows of its own for walls
            }
        }
        if memory.removals != removals || memory.marbles.len() != marbles.len() {
            memory.marbles.clear();
            memory.marbles.extend((0..marbles.len()).filter_map(|row| marbles.id(row)));
        }
        if memory.removals != removals || memory.walls.len() != walls.len() {
            memory.walls.clear();
            memory.walls.extend((0..walls.len()).filter_map(|row| walls.id(row)));
        }
        memory.removals = removals;
    }
}
