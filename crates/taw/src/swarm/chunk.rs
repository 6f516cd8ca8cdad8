use std::ops::Range;

use super::batches::Batch;
use super::kernels::ContactImpulses;
use super::neighbours::{NEIGHBOUR_ROOM, NeighbourLists};
use super::wall_contact::WallContact;
use crate::math::Scalar;

/// Some layers of the grid, as much as one thread works on at a time. Pairs of its balls, among
/// themselves and with those of the next chunk, are its own; so two chunks that are not neighbours
/// have no ball in common.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "they have nothing to do with each other")]
pub(super) struct Chunk<S> {
    /// The first layer, and the one after the last.
    pub layers: [u32; 2],
    /// The first row, of it, of the next one, and after that.
    pub rows: [u32; 3],
    pub batches: Vec<Batch>,
    /// Number of its pairs, in batches and neighbour lists.
    pub pairs: usize,
    /// Number of those that there was no room for.
    pub unlisted: usize,
    pub impulses: ContactImpulses<S>,
    /// By rows.
    pub wall_contacts: Vec<WallContact<S>>,
    pub old_wall_contacts: Vec<WallContact<S>>,
    /// The rows near half-spaces, and near other walls.
    pub near_planes: Vec<u32>,
    pub near_shapes: Vec<u32>,
    /// Set while contacts of some of the latter have still to be looked for.
    pub shapes_are_new: bool,
    /// Set if one near other walls is fast.
    pub has_fast: bool,
    /// Largest speed of a ball, in m/s.
    pub speed: S,
    /// Largest speed of a wall at one of its balls, in m/s.
    pub wall_speed: S,
    /// The least and the largest inverse mass, in 1/kg.
    pub inverse_masses: [S; 2],
    /// The least and the largest radius, in metres.
    pub radii: [S; 2],
    /// Set while all its balls sleep.
    pub asleep: bool,
    /// Number of its balls that sleep.
    pub sleepers: usize,
    /// Set if all that are awake have rested for long enough to sleep and may, and if one that is no proxy has.
    pub rests: bool,
    pub has_rested: bool,
    /// Set if bodies asleep in it have still to be read.
    pub unread: bool,
    /// Set if balls of it fell asleep or woke since batches were marked as idle, and if its batches have
    /// to be marked.
    pub sleep_changed: bool,
    pub marks_idle: bool,
    /// The speed in m/s of its fastest ball that is no proxy, if it has proxies.
    pub fastest_own: Option<S>,
    /// Set if a ball of it or of those beside it bounced just now, and in this substep.
    pub again: bool,
    pub struck: bool,
    /// Set if a ball of it was put back to a wall in this substep.
    pub caught: bool,
    /// Set if a ball of it went beyond its skin by more than the common skin.
    pub overrun: bool,
    /// Rows that would leave their skin in this step, and those that were stopped.
    pub leaving: Vec<u32>,
    pub stopped: Vec<u32>,
}

impl<S: Scalar> Chunk<S> {
    pub fn bytes(&self) -> usize {
        let Self {
            layers: _,
            rows: _,
            batches,
            pairs: _,
            unlisted: _,
            impulses,
            wall_contacts,
            old_wall_contacts,
            near_planes,
            near_shapes,
            shapes_are_new: _,
            has_fast: _,
            speed: _,
            wall_speed: _,
            inverse_masses: _,
            radii: _,
            asleep: _,
            sleepers: _,
            rests: _,
            has_rested: _,
            unread: _,
            sleep_changed: _,
            marks_idle: _,
            fastest_own: _,
            again: _,
            struck: _,
            caught: _,
            overrun: _,
            leaving,
            stopped,
        } = self;
        let names = [near_planes, near_shapes, leaving, stopped].map(Vec::capacity);
        batches.capacity() * size_of::<Batch>()
            + impulses.bytes()
            + (wall_contacts.capacity() + old_wall_contacts.capacity())
                * size_of::<WallContact<S>>()
            + names.iter().sum::<usize>() * size_of::<u32>()
    }

    /// Range of its neighbour lists in the list of all.
    pub fn neighbour_range(&self) -> Range<usize> {
        let rows = self.own_rows();
        rows.start * NEIGHBOUR_ROOM..rows.end * NEIGHBOUR_ROOM
    }

    /// Its neighbour lists, in the list of all.
    pub fn neighbours<'a>(&self, all: &'a [u16]) -> NeighbourLists<'a> {
        let [first, next, _] = self.rows;
        let list = all.get(self.neighbour_range().start..).unwrap_or_default();
        NeighbourLists { first, rows: next - first, list }
    }

    pub fn own_rows(&self) -> Range<usize> {
        self.rows[0] as usize..self.rows[1] as usize
    }
}
