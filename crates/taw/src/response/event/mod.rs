//! [`Response::EventDriven`](super::Response::EventDriven): what happens within a
//! substep happens one after the other, each at its time (Alder and Wainwright 1959;
//! Lubachevsky, *How to simulate billiards and similar systems*, 1991).
//!
//! Between two events a ball moves on a parabola. Its next event is the first of: it
//! meets a wall or a ball, it leaves its cell of the grid, or what it lies on makes it
//! roll instead of slide. All of it is counted in `f64`, whatever the world counts in.

mod ball;
mod bend;
mod cells;
mod collide;
mod count;
mod foresee;
mod heap;
mod hold;
mod knot;
mod lie;
mod reach;
mod rest;
mod support;
mod time;
mod wall;

use std::cell::Cell as Counter;
use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use cgmath::{InnerSpace, Zero};

use crate::broad::Period;
use crate::contact::Contacts;
use crate::math::{Scalar, Vec3, cast_vector, is_finite, is_finite_point};
use crate::response::Work;
use crate::response::impulse::Warm;
use ball::Home;
pub(crate) use ball::{Ball, Path};
use cells::Cells;
use collide::Moment;
use heap::Heap;
use reach::Reach;
pub(crate) use reach::Source;
pub(crate) use wall::{Form, Wall};

/// A wall is left or met again only faster than this part of what gravity does to a
/// speed in a substep. Slower, a ball rests on it: the bounces that it still had ahead
/// would have taken a few thousandths of a substep.
const REST: f64 = 1e-3;
/// That part for balls that press each other, which touch anew each time that they have
/// gained so much. Ten times a substep, until the next one knows that they rest.
const PRESS: f64 = 0.1;
/// Balls that cross more cells than this in a substep are looked for everywhere.
const FAR: f64 = 1000.0;
/// After collisions in one substep that took the whole of an approach so many times over (two
/// of restitution a half count as one, and so does one that took no time), a ball is at
/// rest among those that it touches: what is left would take endlessly many.
const MOST_LOSSES: f64 = 64.0;
/// Number of collisions that it counts for that a ball begins to rest on another, which takes
/// about as long.
const LEAN: f64 = 8.0;
/// After so many times at rest and out of it again, something presses a ball that nothing
/// can stop. For the rest of the substep it stays where it is; the next one pushes it out.
const MOST_SURRENDERS: i32 = 10;
/// A shorter time between two collisions is none, over the substep.
const NO_TIME: f64 = 1e-13;
/// A ball that is this part of a radius outside of another wall is still on it; see `world::touch`.
const FLUSH: f64 = 5e-6;
/// Overlap that may stay, over the radius: pushing it out would lift what lies on it, and
/// create energy.
const SLOP: f64 = 4e-3;
/// A ball on a wall that is no half-space looks where it is after this part of its
/// radius, though not more often than after this part of a substep.
const LOOK: f64 = 0.05;
/// Cost that a substep may have, and for each ball besides, in looks at one half-space or one
/// other ball, of which a processor does some fifty million in a second. Whatever is not at its
/// end then stays where it is, and is named.
const MOST_LOOKS: u64 = 32_000_000;
const LOOKS_A_BALL: u64 = 20_000;
/// So many touches are enough to hold a ball, of which one of its size has twelve at most. Of
/// those between two that both have as many already, no more are taken.
pub(crate) const MOST_TOUCHES: u32 = 64;
/// A look at a part of a wall that is no half-space counts as so many.
const PART_LOOKS: u64 = 8;
/// The time at which two balls meet that are not equally accelerated counts as so many looks.
const QUARTIC_LOOKS: u64 = 16;

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
enum What {
    Hits(usize),
    SettlesOn(usize),
    Meets(usize, u32),
    /// It begins to rest on another, whose path has that stamp.
    Leans(usize, u32),
    LeavesCell {
        axis: usize,
        to: i64,
    },
    Changes,
    /// It comes to where walls may be that it does not know yet, or that it looked at as
    /// often as it may.
    Looks,
}

/// Something that will happen, unless something else happens first.
#[derive(Clone, Copy, Debug)]
struct Event {
    time: f64,
    row: usize,
    stamp: u32,
    what: What,
    /// True if it meets another one at the very same time.
    tied: bool,
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
pub(crate) struct Settings<'a> {
    /// The length of the substep, in seconds.
    pub dt: f64,
    /// For what rests in heaps.
    pub iterations: u32,
    /// The walls.
    pub source: &'a dyn Source,
    /// Cost of the substep so far, in looks.
    pub looks: Counter<u64>,
}

impl Settings<'_> {
    /// Adds to the cost of the substep.
    fn count(&self, looks: u64) {
        self.looks.set(self.looks.get() + looks);
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
    pub warm: Vec<Warm<f64>>,
    /// Work done on the balls, if somebody asks.
    pub work: Option<Work>,
    reach: Reach,
    cells: Cells,
    anywhere: Vec<usize>,
    queue: BinaryHeap<Reverse<Event>>,
    moment: Moment,
    heap: Heap,
}

impl EventDriven {
    /// Goes through a substep. Adds to `impacts` in the order of time, and gives the
    /// rows that became infinite or NaN, which are as they were.
    pub fn run(&mut self, settings: &Settings, impacts: &mut Vec<Impact<f64>>) -> Vec<u32> {
        let dt = settings.dt;
        let before: Vec<_> = self.balls.iter().map(|b| b.position).collect();
        for ball in &mut self.balls {
            ball.path = Path { acceleration: ball.pull, ..Path::default() };
            ball.turned = Vec3::zero();
        }
        self.find_homes(dt);
        self.find_walls(settings);
        self.begin_at_rest(settings);
        self.queue.clear();
        for row in 0..self.balls.len() {
            self.foresee(row, 0.0, settings);
        }
        let most = MOST_LOOKS + LOOKS_A_BALL * self.balls.len() as u64;
        while settings.looks.get() < most {
            let Some(Reverse(event)) = self.queue.pop() else { break };
            if self.balls[event.row].path.stamp == event.stamp {
                self.happen(event, settings, impacts);
            }
        }
        let mut stopped = self.stop_what_is_left();
        (0..self.balls.len()).for_each(|row| self.advance(row, dt));
        for (row, (ball, before)) in self.balls.iter_mut().zip(before).enumerate() {
            if !is_finite_point(ball.position) || !is_finite(ball.velocity) || !is_finite(ball.spin)
            {
                ball.position = before;
                (ball.velocity, ball.spin, ball.turned) =
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
    fn stop_what_is_left(&mut self) -> Vec<u32> {
        let mut stopped = Vec::new();
        let first = self.queue.peek().map_or(0.0, |Reverse(event)| event.time);
        for Reverse(Event { row, stamp, .. }) in std::mem::take(&mut self.queue) {
            if self.balls[row].path.stamp == stamp {
                self.advance(row, first.max(self.balls[row].path.begin));
                self.balls[row].freeze();
                self.balls[row].spin = Vec3::zero();
                stopped.push(row as u32);
            }
        }
        stopped
    }

    fn happen(&mut self, event: Event, settings: &Settings, impacts: &mut Vec<Impact<f64>>) {
        let Event { time, row, what, .. } = event;
        match what {
            What::Meets(other, stamp) | What::Leans(other, stamp)
                if self.balls[other].path.stamp != stamp =>
            {
                self.foresee(row, time, settings);
            }
            What::Meets(other, _) if self.loses(row) && self.loses(other) => {
                self.surrender([row, other], time, settings);
            }
            What::Meets(other, _) => self.meet(event, other, settings, impacts),
            What::Leans(other, _) => {
                for row in [row, other] {
                    self.balls[row].path.losses += LEAN;
                }
                for row in self.hold_from_now_on([row, other], 0.0, time, settings).rows {
                    self.foresee(row, time, settings);
                }
            }
            What::Hits(_) if self.loses(row) => {
                self.surrender([row, row], time, settings);
            }
            What::Hits(wall) => {
                self.advance(row, time);
                impacts.push(self.hit_wall(row, wall, settings));
                self.foresee(row, time, settings);
            }
            What::SettlesOn(wall) => {
                self.advance(row, time);
                let path = &mut self.balls[row].path;
                // One that lies on another one may go to and fro between them.
                path.losses += if path.support.is_some() { LEAN } else { 0.0 };
                if self.loses(row) {
                    self.surrender([row, row], time, settings);
                } else {
                    self.settle(row, wall, settings);
                    self.foresee(row, time, settings);
                }
            }
            What::Changes => {
                self.advance(row, time);
                self.look_what_it_lies_on(row, settings);
                self.foresee(row, time, settings);
            }
            What::Looks => self.foresee(row, time, settings),
            What::LeavesCell { axis, to } => {
                if let Home::Cell(mut cell) = self.balls[row].path.home {
                    self.cells.remove(row as u32);
                    cell[axis] = to;
                    self.cells.insert(row as u32, cell);
                    self.balls[row].path.home = Home::Cell(cell);
                }
                self.foresee(row, time, settings);
            }
        }
    }

    /// The way from one ball to another, in metres.
    fn apart(&self, first: &Ball, second: &Ball) -> Vec3<f64> {
        self.period.nearest(second.position - first.position)
    }

    /// Puts every ball where others find it.
    fn find_homes(&mut self, dt: f64) {
        let largest = self.balls.iter().fold(0.0_f64, |max, ball| max.max(ball.radius));
        // Rounding must not take a ball that touches out of the neighbouring cell.
        self.cells.reset(self.balls.len(), 2.001 * largest, self.period);
        self.anywhere.clear();
        for row in 0..self.balls.len() {
            if self.crosses_too_many(row, dt) {
                self.anywhere.push(row);
            } else {
                let cell = self.cells.cell(self.balls[row].position);
                self.cells.insert(row as u32, cell);
                self.balls[row].path.home = Home::Cell(cell);
            }
        }
    }

    fn crosses_too_many(&self, row: usize, left: f64) -> bool {
        let Ball { velocity, path, .. } = &self.balls[row];
        let fastest = velocity.magnitude() + path.acceleration.magnitude() * left;
        // Also what has no finite cell at all.
        let cells = fastest * left / self.cells.least_width();
        let far = self.balls[row].position;
        let far = [far.x, far.y, far.z].iter().fold(0.0_f64, |max, x| max.max(x.abs()));
        // In a period, only who is in its cell knows which image of another one is the next.
        let cells = if cells.is_finite() && !self.period.is_open() { 0.0 } else { cells };
        !(cells <= FAR && far / self.cells.least_width() < 1e15)
    }

    /// Has a ball that became too fast looked for everywhere.
    fn go_home(&mut self, row: usize, now: f64, dt: f64) {
        if self.balls[row].path.home != Home::Anywhere && self.crosses_too_many(row, dt - now) {
            self.cells.remove(row as u32);
            self.anywhere.push(row);
            self.balls[row].path.home = Home::Anywhere;
        }
    }
}
