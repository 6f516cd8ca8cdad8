//! Event-driven simulation, the method of [`Response::EventDriven`](super::Response::EventDriven):
//! the events of a substep are processed one after the other, each at its time (Alder and
//! Wainwright 1959; Lubachevsky, *How to simulate billiards and similar systems*, 1991).
//!
//! Between two events a ball moves on a parabola. Its next event is the earliest of: impact on a
//! wall or ball, crossing into another grid cell, or change of regime (sliding to rolling, end of a
//! support). Computed in `f64`, whatever the world's scalar.

mod active_set;
mod ball;
mod candidates;
mod cells;
mod cluster;
mod collide;
mod crowd;
mod curved_support;
mod flat_support;
mod ledger;
mod partners;
mod predict;
mod predict_ball;
mod predict_wall;
mod rest_at_start;
mod rest_on_wall;
mod resting_cluster;
mod segments;
mod simultaneous;
mod squeeze;
mod support_candidates;
mod toi;
mod wall;

use std::cell::Cell as Counter;
use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use cgmath::{InnerSpace, Zero};

use crate::broad::{CollisionFilter, IgnoredPairs, Period};
use crate::contact::Contacts;
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector, is_finite, is_finite_point};
use crate::response::EnergyLedger;
use crate::response::impulse::CachedImpulse;
use ball::CellSlot;
pub(crate) use ball::{EventBall, Trajectory};
use candidates::WallCandidates;
pub(crate) use candidates::WallSource;
use cells::Cells;
use cluster::Cluster;
use collide::SimultaneousImpacts;
use crowd::Crowds;
use partners::Partner;
pub(crate) use wall::{Solid, Wall, WallCollider};

/// Rest threshold over the speed that gravity adds in a substep. A slower ball rests on the wall:
/// its remaining bounces would have taken a few thousandths of a substep.
const REST_SPEED: f64 = 1e-3;
/// Same fraction for two balls pressed together: they collide again whenever they have regained
/// this speed, about ten times per substep, until the next substep treats them as resting.
const PRESS_SPEED: f64 = 0.1;
/// Maximum number of cells that a ball may cross in a substep; a faster one is tested against all
/// others.
const MAX_CELLS: f64 = 1000.0;
/// Guard against inelastic collapse. Each collision adds `1 − e` (or 1 if no time has passed since
/// the last one); a ball whose sum within one substep reaches this is put to rest with whatever it
/// touches.
const MAX_DISSIPATIONS: f64 = 64.0;
/// Cost of starting to rest on another ball, in such collisions, which take about as long.
const REST_COST: f64 = 8.0;
/// Maximum number of freezes. A ball frozen this often in one substep is squeezed by something
/// immovable: it stays where it is for the rest of the substep; the next one pushes it out.
const MAX_FREEZES: i32 = 10;
/// Largest time between simultaneous collisions, over the substep.
const SIMULTANEOUS: f64 = 1e-13;
/// Resolution of times, over the substep. An event that might come again and again at one moment, as
/// rounding says, comes again after this.
const TIME_RESOLUTION: f64 = 1e-12;
/// Seam tolerance: a ball at most this fraction of its radius away from another wall still touches
/// that wall; see `world::touch`.
const SEAM_TOLERANCE: f64 = 5e-6;
/// Allowed penetration over the radius: pushing it out would lift what rests on it, and create
/// energy.
const SLOP: f64 = 4e-3;
/// Support check on a curved or bounded wall: after rolling this fraction of its radius, at most
/// once per this fraction of a substep.
const SUPPORT_CHECK: f64 = 0.05;
/// Cost limit of a step, and per ball, in tests of one ball against one half-space or ball (some
/// fifty million per second). A ball that has not finished its share by then stays where
/// it is, and is reported.
const MAX_COST: u64 = 32_000_000;
const COST_PER_BALL: u64 = 20_000;
/// Maximum number of contacts of a ball in a cluster; equal balls have twelve at most. Contacts
/// between two balls that both have as many are dropped.
pub(crate) const MAX_CONTACTS: u32 = 64;
/// Cost of a test against a sub-shape that is no half-space.
const PART_COST: u64 = 8;
/// Cost of an event, which a ball may have by the million in a periodic world: it crosses cells as long as it
/// moves.
const EVENT_COST: u64 = 32;
/// Cost of a time of impact of two balls with different accelerations (a quartic).
const QUARTIC_COST: u64 = 16;

/// Collision that a step processed, of the rows that bodies have at its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impact<S> {
    /// Row of the first body: a marble, or a wall if `on_wall`.
    pub a: u32,
    /// True if the first body is a wall.
    pub on_wall: bool,
    /// Row of the second body, a marble.
    pub b: u32,
    /// Sub-shape of the wall: part of a compound or triangle of a surface; zero for simple shapes, and
    /// between marbles.
    pub part: u32,
    /// Unit normal from the first to the second.
    pub normal: Vec3<S>,
    /// Contact point at that time, in metres.
    pub point: Point3<S>,
    /// Approach speed along the normal, in m/s.
    pub approach_speed: S,
    /// Slip: velocity of the second surface over the first, across the normal, in m/s.
    pub slip: Vec3<S>,
    /// Impulse on the second body, in N s; on the first it is the opposite. By
    /// [`SoftStep`](super::Response::SoftStep), for an impact that does not bounce, the one that stops the
    /// approach of the two alone, without friction.
    pub impulse: Vec3<S>,
}

impl<S: Scalar> Impact<S> {
    /// Impact with the two bodies swapped.
    pub(crate) fn reversed(self) -> Self {
        let (normal, slip, impulse) = (-self.normal, -self.slip, -self.impulse);
        Self { a: self.b, b: self.a, normal, slip, impulse, ..self }
    }
}

impl<T: Scalar> Impact<T> {
    /// Conversion to another scalar.
    pub(crate) fn cast<S: Scalar>(self) -> Impact<S> {
        Impact {
            a: self.a,
            on_wall: self.on_wall,
            b: self.b,
            part: self.part,
            normal: cast_vector(self.normal),
            point: cast_point(self.point),
            approach_speed: S::from_f64(self.approach_speed.as_f64()),
            slip: cast_vector(self.slip),
            impulse: cast_vector(self.impulse),
        }
    }
}

/// Kinds of events of a ball.
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

/// Predicted event; void once the trajectory has another version.
#[derive(Clone, Copy, Debug)]
struct Event {
    time: f64,
    row: usize,
    version: u32,
    kind: EventKind,
    /// True if the ball collides with another one at the very same time.
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

/// Settings of a substep, besides balls and walls.
pub(crate) struct EventSettings<'a> {
    /// Substep, in seconds.
    pub dt: f64,
    /// Iterations for clusters of resting balls.
    pub iterations: u32,
    /// Number of threads that solve the islands of clusters.
    pub threads: usize,
    /// Gravity, in m/s².
    pub gravity: Vec3<f64>,
    /// Walls of the world.
    pub source: &'a dyn WallSource,
    /// Fraction of the step's remaining budget that this substep may spend.
    pub budget_fraction: f64,
    /// Cost of the substep so far, in tests.
    pub cost: Counter<u64>,
}

impl EventSettings<'_> {
    /// Adds to the cost of the substep.
    fn add_cost(&self, cost: u64) {
        self.cost.set(self.cost.get() + cost);
    }
}

/// Event-driven solver, with its scratch buffers.
#[derive(Clone, Debug, Default)]
pub(crate) struct EventSolver {
    /// Balls, filled in and read back by the caller.
    pub balls: Vec<EventBall>,
    /// Period of the world.
    pub period: Period<f64>,
    /// Balls that pass through each other, and through walls, by their rows in the world.
    pub ignored: IgnoredPairs,
    /// Candidate walls.
    walls: Vec<Wall>,
    /// Pairs of balls that may be in contact at the start.
    pub near: Contacts<f64>,
    /// Cost of the step's substeps so far, in tests; the caller resets it.
    pub spent: u64,
    /// Impulses of the clusters' contacts in the last substep, for the warm start.
    pub impulse_cache: Vec<CachedImpulse<f64>>,
    /// Energy bookkeeping, for the energy audit only.
    pub work: Option<EnergyLedger>,
    /// Rows that still had events at the end of the last substep's budget, in any order.
    pub unfinished: Vec<u32>,
    candidates: WallCandidates,
    cells: Cells,
    unbounded: Vec<usize>,
    crowds: Crowds,
    queue: BinaryHeap<Reverse<Event>>,
    simultaneous_impacts: SimultaneousImpacts,
    cluster: Cluster,
    /// Partners of each ball in its cluster.
    partners: Vec<Vec<Partner>>,
}

impl EventSolver {
    /// Simulates a substep. Appends to `impacts` in the order of time, and returns the rows that
    /// became infinite or NaN or did not finish; the former keep their initial positions.
    pub fn run(&mut self, settings: &EventSettings, impacts: &mut Vec<Impact<f64>>) -> Vec<u32> {
        let dt = settings.dt;
        let initial_positions: Vec<_> = self.balls.iter().map(|b| b.position).collect();
        for ball in &mut self.balls {
            ball.trajectory =
                Trajectory { acceleration: ball.external_acceleration, ..Trajectory::default() };
            ball.rotation_increment = Vec3::zero();
        }
        self.partners.iter_mut().for_each(Vec::clear);
        self.assign_cells(dt);
        self.find_candidates(settings);
        self.find_resting(settings);
        self.queue.clear();
        for row in 0..self.balls.len() {
            self.predict(row, 0.0, settings);
        }
        // However little is left, each ball may have an event after what was done up to here.
        let max_cost = self.max_cost(settings).max(settings.cost.get() + COST_PER_BALL);
        while settings.cost.get() < max_cost {
            let Some(Reverse(event)) = self.queue.pop() else { break };
            if self.balls[event.row].trajectory.version == event.version {
                self.process(event, settings, impacts);
            }
        }
        self.spent += settings.cost.get();
        self.stop_unfinished();
        let mut stopped = self.unfinished.clone();
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

    /// Collision filter of a ball.
    fn filter(&self, row: usize) -> CollisionFilter<'_> {
        let ignored = self.ignored.walls_of(row as u32);
        CollisionFilter { layers: self.balls[row].layers, ignored }
    }

    /// Cost limit of a substep: its share of what the ones before have left, in the ratio of times.
    fn max_cost(&self, settings: &EventSettings) -> u64 {
        let budget = MAX_COST + COST_PER_BALL * self.balls.len() as u64;
        (budget.saturating_sub(self.spent) as f64 * settings.budget_fraction) as u64
    }

    /// Freezes balls that still have events at the end of the budget, at the time of the first of
    /// these.
    fn stop_unfinished(&mut self) {
        self.unfinished.clear();
        let first = self.queue.peek().map_or(0.0, |Reverse(event)| event.time);
        for Reverse(Event { row, version, .. }) in std::mem::take(&mut self.queue) {
            if self.balls[row].trajectory.version == version {
                self.advance(row, first.max(self.balls[row].trajectory.start));
                self.balls[row].freeze();
                self.balls[row].spin = Vec3::zero();
                self.unfinished.push(row as u32);
            }
        }
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
                self.rest_again([row, other], time, settings);
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
                // A ball might alternate between two supports.
                trajectory.dissipation_count +=
                    if trajectory.support.is_some() { REST_COST } else { 0.0 };
                if self.is_collapsing(row) {
                    self.stop_collapse([row, row], time, settings);
                } else {
                    self.rest_on_wall(row, wall, time, settings);
                }
            }
            EventKind::RegimeChange if self.balls[row].trajectory.clustered => {
                self.rest_again([row, row], time, settings);
            }
            EventKind::RegimeChange => {
                self.advance(row, time);
                self.recheck_support(row, settings);
                self.predict(row, time, settings);
            }
            EventKind::RefreshCandidates => self.predict(row, time, settings),
            EventKind::CellCrossing { axis, to } => {
                if !self.period.is_open() {
                    settings.add_cost(EVENT_COST);
                }
                if let CellSlot::Cell(mut cell) = self.balls[row].trajectory.cell_slot {
                    self.cells_of(row).remove(row as u32);
                    cell[axis] = to;
                    self.cells_of(row).insert(row as u32, cell);
                    self.balls[row].trajectory.cell_slot = CellSlot::Cell(cell);
                }
                self.predict(row, time, settings);
            }
        }
    }

    /// Puts a ball to rest on a wall, or on all that it touches if it is pressed into another one, and
    /// predicts its next event.
    fn rest_on_wall(&mut self, row: usize, wall: usize, time: f64, settings: &EventSettings) {
        self.start_resting(row, wall, settings);
        if self.is_pressed_into_another(row, wall, settings) {
            self.rest_again([row, row], time, settings);
        } else {
            self.predict(row, time, settings);
        }
    }

    /// Puts balls to rest with all that touch them, and predicts their next events.
    fn rest_again(&mut self, seeds: [usize; 2], time: f64, settings: &EventSettings) {
        for row in self.rest_cluster(seeds, 0.0, time, settings).rows {
            self.predict(row, time, settings);
        }
    }

    /// Vector between the centers of two balls, in metres.
    fn center_offset(&self, first: &EventBall, second: &EventBall) -> Vec3<f64> {
        self.period.minimum_image(second.position - first.position)
    }

    /// Assigns balls to cells of the grid.
    fn assign_cells(&mut self, dt: f64) {
        self.cells.reset(self.balls.len(), self.cell_width(), self.period);
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

    /// Width of cells, in metres: rounding must not move a touching ball out of the neighbouring one.
    fn cell_width(&self) -> f64 {
        2.001 * self.balls.iter().fold(0.0_f64, |max, ball| max.max(ball.radius))
    }

    fn exceeds_cell_limit(&self, row: usize, remaining: f64) -> bool {
        let EventBall { velocity, trajectory, .. } = &self.balls[row];
        let max_speed = velocity.magnitude() + trajectory.acceleration.magnitude() * remaining;
        // Non-finite cells fail the test, too.
        let cells = max_speed * remaining / self.cells.min_width();
        let coordinate = self.balls[row].position;
        let coordinate = [coordinate.x, coordinate.y, coordinate.z]
            .iter()
            .fold(0.0_f64, |max, x| max.max(x.abs()));
        // In a period, only cells tell which image of another ball is the nearest.
        let cells = if cells.is_finite() && !self.period.is_open() { 0.0 } else { cells };
        !(cells <= MAX_CELLS && coordinate / self.cells.min_width() < 1e15)
    }

    /// Moves a ball that became too fast out of the grid, and one that was pushed out of a wall over
    /// several cells into its new one. (Next to its cell it may be by rounding.)
    fn update_cell(&mut self, row: usize, now: f64, dt: f64) {
        let CellSlot::Cell(cell) = self.balls[row].trajectory.cell_slot else { return };
        if self.exceeds_cell_limit(row, dt - now) {
            self.cells_of(row).remove(row as u32);
            self.unbounded.push(row);
            self.balls[row].trajectory.cell_slot = CellSlot::Unbounded;
            return;
        }
        let there = self.cells.cell(self.balls[row].position_at(now));
        if (0..3).any(|axis| there[axis].abs_diff(cell[axis]) > 1) {
            self.cells_of(row).remove(row as u32);
            self.cells_of(row).insert(row as u32, there);
            self.balls[row].trajectory.cell_slot = CellSlot::Cell(there);
        }
    }
}
