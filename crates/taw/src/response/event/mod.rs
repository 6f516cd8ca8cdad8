//! [`Response::EventDriven`](super::Response::EventDriven): what happens within a
//! substep happens one after the other, each at its time (Alder and Wainwright 1959;
//! Lubachevsky, *How to simulate billiards and similar systems*, 1991).
//!
//! Between two events a ball moves on a parabola. Its next event is the first of: it
//! meets a wall or a ball, it leaves its cell of the grid, or what it lies on makes it
//! roll instead of slide. All of it is counted in `f64`, whatever the world counts in.

mod active_set;
mod ball;
mod candidates;
mod cells;
mod cluster;
mod collide;
mod curved_support;
mod flat_support;
mod ledger;
mod predict;
mod rest_at_start;
mod rest_on_wall;
mod resting_cluster;
mod toi;
mod wall;

use std::cell::Cell as Counter;
use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use cgmath::{InnerSpace, Zero};

use crate::broad::Period;
use crate::contact::Contacts;
use crate::math::{Scalar, Vec3, cast_vector, is_finite, is_finite_point};
use crate::response::EnergyLedger;
use crate::response::impulse::CachedImpulse;
use ball::CellSlot;
pub(crate) use ball::{Ball, Trajectory};
use candidates::WallCandidates;
pub(crate) use candidates::WallSource;
use cells::Cells;
use cluster::Cluster;
use collide::SimultaneousImpacts;
pub(crate) use wall::{Wall, WallCollider};

/// A wall is left or met again only faster than this part of what gravity does to a
/// speed in a substep. Slower, a ball rests on it: the bounces that it still had ahead
/// would have taken a few thousandths of a substep.
const REST_SPEED: f64 = 1e-3;
/// That part for balls that press each other, which touch anew each time that they have
/// gained so much. Ten times a substep, until the next one knows that they rest.
const PRESS_SPEED: f64 = 0.1;
/// Balls that cross more cells than this in a substep are looked for everywhere.
const MAX_CELLS: f64 = 1000.0;
/// After collisions in one substep that took the whole of an approach so many times over (two
/// of restitution a half count as one, and so does one that took no time), a ball is at
/// rest among those that it touches: what is left would take endlessly many.
const MAX_DISSIPATIONS: f64 = 64.0;
/// Number of collisions that it counts for that a ball begins to rest on another, which takes
/// about as long.
const REST_COST: f64 = 8.0;
/// After so many times at rest and out of it again, something presses a ball that nothing
/// can stop. For the rest of the substep it stays where it is; the next one pushes it out.
const MAX_FREEZES: i32 = 10;
/// A shorter time between two collisions is none, over the substep.
const SIMULTANEOUS: f64 = 1e-13;
/// A ball that is this part of a radius outside of another wall is still on it; see `world::touch`.
const SEAM_TOLERANCE: f64 = 5e-6;
/// Overlap that may stay, over the radius: pushing it out would lift what lies on it, and
/// create energy.
const SLOP: f64 = 4e-3;
/// A ball on a wall that is no half-space looks where it is after this part of its
/// radius, though not more often than after this part of a substep.
const SUPPORT_CHECK: f64 = 0.05;
/// Cost that a substep may have, and for each ball besides, in looks at one half-space or one
/// other ball, of which a processor does some fifty million in a second. Whatever is not at its
/// end then stays where it is, and is named.
const MAX_COST: u64 = 32_000_000;
const COST_PER_BALL: u64 = 20_000;
/// So many touches are enough to hold a ball, of which one of its size has twelve at most. Of
/// those between two that both have as many already, no more are taken.
pub(crate) const MAX_CONTACTS: u32 = 64;
/// A look at a part of a wall that is no half-space counts as so many.
const PART_COST: u64 = 8;
/// The time at which two balls meet that are not equally accelerated counts as so many looks.
const QUARTIC_COST: u64 = 16;

/// A collision that a substep went through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impact<S> {
    /// The row of the first: a marble, or of a wall if `on_wall`.
    pub a: u32,
    /// True if the first is a wall.
    pub on_wall: bool,
    /// The row of the second, a marble.
    pub b: u32,
    /// The unit vector from the first to the second.
    pub normal: Vec3<S>,
    /// Speed at which they came together along it, in m/s.
    pub approach_speed: S,
}

impl Impact<f64> {
    /// Conversion to another scalar.
    pub(crate) fn cast<S: Scalar>(self) -> Impact<S> {
        Impact {
            a: self.a,
            on_wall: self.on_wall,
            b: self.b,
            normal: cast_vector(self.normal),
            approach_speed: S::constant(self.approach_speed),
        }
    }
}

/// Possible events of a ball.
#[derive(Clone, Copy, Debug)]
enum EventKind {
    /// Collision with a wall, by index.
    WallImpact(usize),
    /// Start of rest on a wall.
    RestOnWall(usize),
    /// Collision with a ball whose trajectory has that version.
    BallImpact(usize, u32),
    /// Start of rest on a ball whose trajectory has that version.
    RestOnBall(usize, u32),
    CellCrossing {
        axis: usize,
        to: i64,
    },
    /// End of the current trajectory: sliding turns into rolling, or the support ends.
    RegimeChange,
    /// End of the range for which the candidate walls are known, or of the steps of a prediction.
    RefreshCandidates,
}

/// Something that will happen, unless something else happens first.
#[derive(Clone, Copy, Debug)]
struct Event {
    time: f64,
    row: usize,
    version: u32,
    kind: EventKind,
    /// True if it meets another one at the very same time.
    simultaneous: bool,
}

impl Ord for Event {
    fn cmp(&self, other: &Self) -> Ordering {
        self.time.total_cmp(&other.time).then(self.row.cmp(&other.row))
    }
}

impl PartialOrd for Event {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Event {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Event {}

/// Input of the method, besides balls and walls.
pub(crate) struct EventSettings<'a> {
    /// The length of the substep, in seconds.
    pub dt: f64,
    /// For what rests in heaps.
    pub iterations: u32,
    /// The walls.
    pub source: &'a dyn WallSource,
    /// Cost of the substep so far, in looks.
    pub cost: Counter<u64>,
}

impl EventSettings<'_> {
    /// Adds to the cost of the substep.
    fn add_cost(&self, cost: u64) {
        self.cost.set(self.cost.get() + cost);
    }
}

/// The method, with what it scribbles on.
#[derive(Clone, Debug, Default)]
pub(crate) struct EventDriven {
    /// To be filled by the caller, who finds them there afterwards.
    pub balls: Vec<Ball>,
    /// Of the world.
    pub period: Period<f64>,
    /// Those that balls may come to.
    walls: Vec<Wall>,
    /// Pairs of balls that may touch at the start.
    pub near: Contacts<f64>,
    /// Impulses that the heaps' contacts bore in the last substep.
    pub impulse_cache: Vec<CachedImpulse<f64>>,
    /// Work done on the balls, if somebody asks.
    pub work: Option<EnergyLedger>,
    candidates: WallCandidates,
    cells: Cells,
    unbounded: Vec<usize>,
    queue: BinaryHeap<Reverse<Event>>,
    simultaneous_impacts: SimultaneousImpacts,
    cluster: Cluster,
}

impl EventDriven {
    /// Goes through a substep. Adds to `impacts` in the order of time, and gives the
    /// rows that became infinite or NaN, which are as they were.
    pub fn run(&mut self, settings: &EventSettings, impacts: &mut Vec<Impact<f64>>) -> Vec<u32> {
        let dt = settings.dt;
        let initial_positions: Vec<_> = self.balls.iter().map(|b| b.position).collect();
        for ball in &mut self.balls {
            ball.trajectory =
                Trajectory { acceleration: ball.external_acceleration, ..Trajectory::default() };
            ball.rotation_increment = Vec3::zero();
        }
        self.assign_cells(dt);
        self.find_candidates(settings);
        self.find_resting(settings);
        self.queue.clear();
        for row in 0..self.balls.len() {
            self.predict(row, 0.0, settings);
        }
        let max_cost = MAX_COST + COST_PER_BALL * self.balls.len() as u64;
        while settings.cost.get() < max_cost {
            let Some(Reverse(event)) = self.queue.pop() else { break };
            if self.balls[event.row].trajectory.version == event.version {
                self.process(event, settings, impacts);
            }
        }
        let mut stopped = self.stop_unfinished();
        (0..self.balls.len()).for_each(|row| self.advance(row, dt));
        for (row, (ball, initial_positions)) in
            self.balls.iter_mut().zip(initial_positions).enumerate()
        {
            if !is_finite_point(ball.position) || !is_finite(ball.velocity) || !is_finite(ball.spin)
            {
                ball.position = initial_positions;
                (ball.velocity, ball.spin, ball.rotation_increment) =
                    (Vec3::zero(), Vec3::zero(), Vec3::zero());
                stopped.push(row as u32);
            }
        }
        stopped.sort_unstable();
        stopped.dedup();
        stopped
    }

    /// Lets every ball that still has something ahead of it stay where it is, if nothing
    /// else will happen in this substep. Gives their rows.
    fn stop_unfinished(&mut self) -> Vec<u32> {
        let mut stopped = Vec::new();
        let first = self.queue.peek().map_or(0.0, |Reverse(event)| event.time);
        for Reverse(Event { row, version, .. }) in std::mem::take(&mut self.queue) {
            if self.balls[row].trajectory.version == version {
                self.advance(row, first.max(self.balls[row].trajectory.start));
                self.balls[row].freeze();
                self.balls[row].spin = Vec3::zero();
                stopped.push(row as u32);
            }
        }
        stopped
    }

    fn process(&mut self, event: Event, settings: &EventSettings, impacts: &mut Vec<Impact<f64>>) {
        let Event { time, row, kind, .. } = event;
        match kind {
            EventKind::BallImpact(other, version) | EventKind::RestOnBall(other, version)
                if self.balls[other].trajectory.version != version =>
            {
                self.predict(row, time, settings);
            }
            EventKind::BallImpact(other, _)
                if self.is_collapsing(row) && self.is_collapsing(other) =>
            {
                self.stop_collapse([row, other], time, settings);
            }
            EventKind::BallImpact(other, _) => self.collide_balls(event, other, settings, impacts),
            EventKind::RestOnBall(other, _) => {
                for row in [row, other] {
                    self.balls[row].trajectory.dissipation_count += REST_COST;
                }
                for row in self.rest_cluster([row, other], 0.0, time, settings).rows {
                    self.predict(row, time, settings);
                }
            }
            EventKind::WallImpact(_) if self.is_collapsing(row) => {
                self.stop_collapse([row, row], time, settings);
            }
            EventKind::WallImpact(wall) => {
                self.advance(row, time);
                impacts.push(self.collide_with_wall(row, wall, settings));
                self.predict(row, time, settings);
            }
            EventKind::RestOnWall(wall) => {
                self.advance(row, time);
                let trajectory = &mut self.balls[row].trajectory;
                // One that lies on another one may go to and fro between them.
                trajectory.dissipation_count +=
                    if trajectory.support.is_some() { REST_COST } else { 0.0 };
                if self.is_collapsing(row) {
                    self.stop_collapse([row, row], time, settings);
                } else {
                    self.start_resting(row, wall, settings);
                    self.predict(row, time, settings);
                }
            }
            EventKind::RegimeChange => {
                self.advance(row, time);
                self.recheck_support(row, settings);
                self.predict(row, time, settings);
            }
            EventKind::RefreshCandidates => self.predict(row, time, settings),
            EventKind::CellCrossing { axis, to } => {
                if let CellSlot::Cell(mut cell) = self.balls[row].trajectory.cell_slot {
                    self.cells.remove(row as u32);
                    cell[axis] = to;
                    self.cells.insert(row as u32, cell);
                    self.balls[row].trajectory.cell_slot = CellSlot::Cell(cell);
                }
                self.predict(row, time, settings);
            }
        }
    }

    /// The way from one ball to another, in metres.
    fn center_offset(&self, first: &Ball, second: &Ball) -> Vec3<f64> {
        self.period.nearest(second.position - first.position)
    }

    /// Puts every ball where others find it.
    fn assign_cells(&mut self, dt: f64) {
        let largest = self.balls.iter().fold(0.0_f64, |max, ball| max.max(ball.radius));
        // Rounding must not take a ball that touches out of the neighbouring cell.
        self.cells.reset(self.balls.len(), 2.001 * largest, self.period);
        self.unbounded.clear();
        for row in 0..self.balls.len() {
            if self.exceeds_cell_limit(row, dt) {
                self.unbounded.push(row);
            } else {
                let cell = self.cells.cell(self.balls[row].position);
                self.cells.insert(row as u32, cell);
                self.balls[row].trajectory.cell_slot = CellSlot::Cell(cell);
            }
        }
    }

    fn exceeds_cell_limit(&self, row: usize, remaining: f64) -> bool {
        let Ball { velocity, trajectory, .. } = &self.balls[row];
        let max_speed = velocity.magnitude() + trajectory.acceleration.magnitude() * remaining;
        // Also what has no finite cell at all.
        let cells = max_speed * remaining / self.cells.min_width();
        let coordinate = self.balls[row].position;
        let coordinate = [coordinate.x, coordinate.y, coordinate.z]
            .iter()
            .fold(0.0_f64, |max, x| max.max(x.abs()));
        // In a period, only who is in its cell knows which image of another one is the next.
        let cells = if cells.is_finite() && !self.period.is_open() { 0.0 } else { cells };
        !(cells <= MAX_CELLS && coordinate / self.cells.min_width() < 1e15)
    }

    /// Has a ball that became too fast looked for everywhere.
    fn update_cell(&mut self, row: usize, now: f64, dt: f64) {
        if self.balls[row].trajectory.cell_slot != CellSlot::Unbounded
            && self.exceeds_cell_limit(row, dt - now)
        {
            self.cells.remove(row as u32);
            self.unbounded.push(row);
            self.balls[row].trajectory.cell_slot = CellSlot::Unbounded;
        }
    }
}
