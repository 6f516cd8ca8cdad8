//! Scratch memory of a swarm: neither state nor compared.

use super::bit_set::BitSet;
use super::bodies::KinematicPath;
use super::neighbours::NeighbourSearch;
use super::outside_work::OutsideWork;
use super::recorded_impulses::RecordedImpulses;
use super::state::of;
use super::step::{LockedRows, SavedPlace, WayToWall};
use super::sweeps::Crowd;
use crate::body::BodySystem;
use crate::joint::JointSystem;
use crate::math::{Row, Scalar, UnionFind};
use crate::response::Impact;

/// Memory that a step writes before it reads it, and marks of what has changed since the last one. Two are
/// always equal.
#[derive(Clone, Debug, Default)]
pub(super) struct SwarmScratch<S> {
    /// Number of threads that work on this step.
    pub threads: usize,
    /// Set while other pairs pass through each other than when pairs were found, until the step begins.
    pub filters_changed: bool,
    /// Set while surfaces or filters are others than when contacts with walls were found, likewise.
    pub contacts_forgotten: bool,
    /// Column to sort rows into, in the full tier.
    pub column: Vec<Row<S>>,
    /// See [`SolverColumns::backing`](super::kernels::SolverColumns::backing).
    pub backing: Vec<Row<S>>,
    /// See [`SolverColumns::backing_speed`](super::kernels::SolverColumns::backing_speed).
    pub backing_speed: Vec<S>,
    /// Rows that would leave their skin in this step.
    pub leaving: Vec<u32>,
    /// Displacements of the fast balls, while pairs are searched.
    pub displacements: Vec<S>,
    /// Version of sleep up to which batches are marked as idle.
    pub idle_marked_at: Option<u64>,
    /// Rows that wake, by chunk.
    pub waking: Vec<Vec<u32>>,
    /// Islands of balls that touch; which of them has a ball that does not rest; each other ball, with its
    /// island; and rows asleep that join these, with one that each touches.
    pub islands: UnionFind,
    pub restless: Vec<bool>,
    pub resting: Vec<[u32; 2]>,
    pub sleepers: Vec<[u32; 2]>,
    /// Rows of an island.
    pub rows: Vec<u32>,
    /// Rows of proxies, in order, and which proxy each is.
    pub proxy_rows: Vec<(u32, u32)>,
    /// Positions and velocities of these rows before they are integrated.
    pub saved_proxies: Vec<[Row<S>; 2]>,
    /// Rows that each thread found.
    pub lists: Vec<Vec<u32>>,
    /// Progress of each chunk, while they are worked on.
    pub chunk_states: Vec<u32>,
    pub searches: Vec<NeighbourSearch<S>>,
    pub crowd: Crowd<S>,
    pub path_changes: Vec<Row<S>>,
    /// By slot: centers of balls near shapes at the begin of a substep.
    pub places: Vec<SavedPlace<S>>,
    /// Paths of kinematic bodies in the step.
    pub kinematic_paths: Vec<KinematicPath<S>>,
    /// Bodies with locked axes.
    pub locks: LockedRows<S>,
    /// Number of the substep.
    pub substep: u32,
    /// Ways of balls that would bounce off a wall: of each chunk, and of all.
    pub ways_of_chunks: Vec<Vec<WayToWall<S>>>,
    pub ways_to_walls: Vec<WayToWall<S>>,
    /// Rows of these balls, and of those among them that another one hinders.
    pub with_ways: BitSet,
    pub held: BitSet,
    /// Impacts of the step, if they are noted: of slots.
    pub impacts: Vec<Impact<S>>,
    /// Impulse and work on each ball in the step, if they are recorded: by slot.
    pub outside_work: Vec<OutsideWork>,
    /// Joints and rigid bodies of the step.
    pub joints: JointSystem,
    pub bodies: BodySystem,
    /// Impulses of contacts in the step, if they are recorded.
    pub recorded_impulses: Option<RecordedImpulses<S>>,
}

impl<S: Scalar> SwarmScratch<S> {
    /// Bytes that it has from the allocator.
    pub fn bytes(&self) -> usize {
        let Self {
            column,
            backing,
            backing_speed,
            leaving,
            displacements,
            proxy_rows,
            saved_proxies,
            lists,
            chunk_states,
            searches,
            idle_marked_at: _,
            waking,
            islands,
            restless,
            resting,
            sleepers,
            rows,
            crowd,
            path_changes,
            places,
            kinematic_paths,
            locks,
            ways_to_walls,
            ways_of_chunks,
            with_ways,
            held,
            impacts,
            outside_work,
            recorded_impulses,
            joints: _, // lent for a step
            bodies: _, // likewise
            threads: _,
            filters_changed: _,
            contacts_forgotten: _,
            substep: _,
        } = self;
        ([column, backing].map(of).iter().sum::<usize>()
            + (of(backing_speed) + of(leaving))
            + (of(displacements) + of(proxy_rows) + of(saved_proxies)))
            + (of(lists) + lists.iter().chain(waking).map(of).sum::<usize>() + of(waking))
            + (of(chunk_states)
                + islands.bytes()
                + of(restless)
                + of(resting)
                + of(sleepers)
                + of(rows))
            + (of(searches) + searches.iter().map(NeighbourSearch::bytes).sum::<usize>())
            + (crowd.bytes()
                + of(path_changes)
                + of(places)
                + of(kinematic_paths)
                + locks.bytes()
                + of(ways_to_walls)
                + of(ways_of_chunks)
                + with_ways.bytes()
                + ways_of_chunks.iter().map(of).sum::<usize>()
                + (held.bytes() + of(impacts) + of(outside_work))
                + recorded_impulses.as_ref().map_or(0, RecordedImpulses::bytes))
    }
}

impl<S> PartialEq for SwarmScratch<S> {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}
