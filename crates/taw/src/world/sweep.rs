//! Swept detection: what would pass through each other within a substep is stopped
//! where it first touches, with the velocity that it has there. Slower ones, which only graze
//! each other on the way, are named as contacts.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use cgmath::{InnerSpace, Zero};

use super::marbles::Marbles;
use super::walls::{Part, Walls};
use super::{Detection, World};
use crate::contact::time_of_impact_sphere_sphere;
use crate::math::{Point3, Scalar, Vec3, direction_and_length, length};
use crate::response::Response;
use crate::shape::{Aabb, Nearest, Sphere};

/// How far into each other marbles are put that meet, over the sum of their radii: what
/// only just touches would not be held by a response that looks at overlap.
const INTO: f64 = 1e-5;

/// Steps enough for a marble to come to any wall but one that it only grazes.
const MOST_STEPS: u32 = 32;

/// Whose way past each other is longer than this part of the smaller radius may pass through
/// each other, or be turned back by the wrong side: the end of a step no longer tells where they
/// met. So they are stopped.
const FAST: f64 = 0.5;

/// Whose way past each other is shorter than this part of the smaller radius cannot graze each
/// other by more than a hundredth of that, which is not worth a look.
const SLOW: f64 = 0.02;

/// What a sweep remembers, and scribbles on.
#[derive(Clone, Debug, Default)]
pub(super) struct Sweep<S> {
    /// Where marbles were before they moved, and how fast, in m/s.
    pub start: Vec<Point3<S>>,
    pub velocity: Vec<Vec3<S>>,
    /// Who was stopped in this substep; and for every row, if one was, whether it was.
    stops: Vec<Stopped<S>>,
    pub stands: Vec<bool>,
    /// Which marbles meet on the way, though neither was stopped.
    pub grazes: Vec<(u32, u32)>,
    middle: Vec<Point3<S>>,
    reach: Vec<S>,
    /// Who may meet whom, both ways round, in order.
    near: Vec<(u32, u32)>,
    hits: BinaryHeap<Reverse<Hit<S>>>,
    /// At which part of its way each marble was stopped, if at all.
    stopped: Vec<Option<S>>,
}

/// Two marbles that will meet, unless one of them is stopped before.
#[derive(Clone, Copy, Debug)]
struct Hit<S> {
    /// As a part of the substep.
    time: S,
    pair: (u32, u32),
    /// Whether each of them had been stopped when this was foreseen.
    stopped: (bool, bool),
}

impl<S: Scalar> Ord for Hit<S> {
    fn cmp(&self, other: &Self) -> Ordering {
        let time = self.time.partial_cmp(&other.time).unwrap_or(Ordering::Equal);
        time.then(self.pair.cmp(&other.pair))
    }
}

impl<S: Scalar> PartialOrd for Hit<S> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<S: Scalar> PartialEq for Hit<S> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl<S: Scalar> Eq for Hit<S> {}

/// A marble on its way through a substep.
#[derive(Clone, Copy)]
struct Way<S> {
    sphere: Sphere<S>,
    /// What it moves from here to the end.
    motion: Vec3<S>,
    stopped: bool,
}

/// What a marble meets on its way.
pub(super) struct Stop<S> {
    /// As a part of the way.
    pub time: S,
    wall: u32,
}

/// A marble that was stopped.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stopped<S> {
    pub row: u32,
    /// By what: the row of a wall or of a marble.
    by: By,
    /// How far it would still have gone, in metres, and by how much its velocity would still
    /// have changed, in m/s.
    way: Vec3<S>,
    change: Vec3<S>,
}

#[derive(Clone, Copy, Debug)]
enum By {
    Wall(u32),
    Marble(u32),
}

impl<S: Scalar> World<S> {
    /// Remembers where marbles are before they move, if this model sweeps.
    pub(super) fn begin_sweep(&mut self) {
        self.sweep.clear();
        if self.model.detection == Detection::Swept {
            self.sweep.start.extend_from_slice(&self.marbles.position);
            self.sweep.velocity.extend_from_slice(&self.marbles.velocity);
        }
    }

    /// Puts marbles that would pass into walls by more than half of their radius to where
    /// they touch them, or by [`Response::Penalty`], whose forces need an overlap, to where
    /// half of the radius does. Walls count as they are now, and half-spaces need none of this.
    pub(super) fn stop_at_walls(&mut self) {
        self.walls.prepare();
        if self.sweep.start.len() != self.marbles.len() || self.walls.are_planes() {
            return;
        }
        for row in 0..self.marbles.len() {
            let sphere = Sphere { center: self.sweep.start[row], ..self.marbles.sphere(row) };
            let motion = self.marbles.position[row] - sphere.center;
            if length(motion) <= sphere.radius * S::constant(FAST) {
                continue;
            }
            let Some(Stop { time, wall }) = self.first_wall(&sphere, motion) else { continue };
            self.marbles.stop_on_the_way(&mut self.sweep, row, By::Wall(wall), time);
        }
    }

    /// Lets marbles go on that were stopped by what the user took out of the contacts.
    pub(super) fn release_what_touches_nothing(&mut self) {
        for stop in std::mem::take(&mut self.sweep.stops) {
            let touches = match stop.by {
                By::Wall(wall) => self.contacts.wm.iter().any(|c| (c.a, c.b) == (wall, stop.row)),
                By::Marble(other) => {
                    let pair = (stop.row.min(other), stop.row.max(other));
                    self.contacts.mm.iter().any(|c| (c.a, c.b) == pair)
                }
            };
            if touches {
                self.sweep.stops.push(stop);
            } else {
                self.marbles.position[stop.row as usize] += stop.way;
                self.marbles.velocity[stop.row as usize] += stop.change;
                self.sweep.stands[stop.row as usize] = false;
            }
        }
    }

    /// Where a sphere first touches a wall that it would pass into.
    fn first_wall(&self, sphere: &Sphere<S>, motion: Vec3<S>) -> Option<Stop<S>> {
        let (half, into) = (S::constant(0.5), S::one() - S::constant(INTO));
        let (start, more) = (sphere.center, sphere.radius);
        let more = Vec3::new(more, more, more);
        let way = Aabb { min: start, max: start }
            .union(&Aabb { min: start + motion, max: start + motion });
        let bounds = Aabb { min: way.min - more, max: way.max + more };
        let mut best: Option<Stop<S>> = None;
        self.walls.near(&bounds, |part| {
            // Its core says whether it passes into the wall, its surface when it is there.
            let core = Sphere { radius: sphere.radius * half, ..*sphere };
            if self.walls.meets(part, &core, motion).is_none() {
                return;
            }
            let part_of_it = if self.model.response.needs_overlap() { half } else { into };
            let all = Sphere { radius: sphere.radius * part_of_it, ..*sphere };
            let Some(stop) = self.walls.meets(part, &all, motion) else { return };
            if best.as_ref().is_none_or(|best| stop.time < best.time) {
                best = Some(stop);
            }
        });
        best
    }

    /// Puts marbles that meet on their way to where they touch, the earliest first. What
    /// is left of their way is lost.
    pub(super) fn stop_where_they_meet(&mut self) {
        if self.sweep.start.len() != self.marbles.len() || self.model.response.needs_overlap() {
            return; // this model does not sweep
        }
        let marbles = &mut self.marbles;
        let Sweep { start, middle, reach, near, hits, stopped, grazes, .. } = &mut self.sweep;
        let half = S::constant(0.5);
        let displaces = self.model.response == Response::Displacement;
        // The displacement changes by itself with the way, and has no normals to get right.
        let slow = S::constant(if displaces { FAST } else { SLOW });
        let moved = |row: usize| marbles.position[row] - start[row];
        let smallest = marbles.radius.iter().fold(S::infinity(), |least, r| least.min(*r));
        let fast = |row: usize| length(moved(row)) > smallest * slow * half;
        if !(0..start.len()).any(fast) {
            return;
        }
        middle.clear();
        middle.extend((0..start.len()).map(|row| start[row] + moved(row) * half));
        reach.clear();
        reach.extend((0..start.len()).map(|row| marbles.radius[row] + length(moved(row)) * half));
        self.grid.rebuild(middle, reach, S::zero());
        near.clear();
        self.grid.pairs(middle, |a, b| {
            if fast(a as usize) || fast(b as usize) {
                near.extend([(a, b), (b, a)]);
            }
        });
        near.sort_unstable();
        stopped.clear();
        stopped.resize(start.len(), None);
        let mut by = Vec::new();
        hits.clear();
        let ahead = near.iter().filter(|(a, b)| a < b);
        let way = |row: u32, now: S, stopped: &[Option<S>]| {
            let index = row as usize;
            let (from, motion) = (start[index], marbles.position[index] - start[index]);
            let into = S::one() - S::constant(INTO);
            let stop = stopped[index];
            let center = from + motion * stop.unwrap_or(now);
            let motion = if stop.is_some() { Vec3::zero() } else { motion * (S::one() - now) };
            let sphere = Sphere { center, radius: marbles.radius[index] * into };
            Way { sphere, motion, stopped: stop.is_some() }
        };
        hits.extend(ahead.filter_map(|pair| {
            let ways = (way(pair.0, S::zero(), stopped), way(pair.1, S::zero(), stopped));
            Hit::foresee(*pair, ways, S::zero()).map(Reverse)
        }));
        while let Some(Reverse(Hit { time, pair, stopped: before })) = hits.pop() {
            let (a, b) = (way(pair.0, time, stopped), way(pair.1, time, stopped));
            if before != (a.stopped, b.stopped) {
                continue; // it was foreseen anew
            }
            let now = [(pair.0, a), (pair.1, b)].into_iter().filter(|(_, way)| !way.stopped);
            now.clone().for_each(|(row, _)| {
                stopped[row as usize] = Some(time);
                by.push((row, if row == pair.0 { pair.1 } else { pair.0 }));
            });
            for (row, _) in now {
                // Who was to meet it elsewhere, or not at all, may meet it here.
                let first = near.partition_point(|pair| pair.0 < row);
                let others = near[first..].iter().take_while(|pair| pair.0 == row);
                hits.extend(others.filter_map(|(_, other)| {
                    let pair = (row.min(*other), row.max(*other));
                    let ways = (way(pair.0, time, stopped), way(pair.1, time, stopped));
                    Hit::foresee(pair, ways, time).map(Reverse)
                }));
            }
        }
        if !displaces {
            grazes.extend(near.iter().filter(|(a, b)| a < b).filter(|pair| {
                let (a, b) = (way(pair.0, S::zero(), stopped), way(pair.1, S::zero(), stopped));
                let free = stopped[pair.0 as usize].is_none() && stopped[pair.1 as usize].is_none();
                free && time_of_impact_sphere_sphere(&a.sphere, a.motion, &b.sphere, b.motion)
                    .is_some()
            }));
        }
        for (row, other) in by {
            let row = row as usize;
            let time = self.sweep.stopped[row].unwrap_or(S::one());
            self.marbles.stop_on_the_way(&mut self.sweep, row, By::Marble(other), time);
            // Rounding may leave a gap.
            self.sweep.grazes.push(((row as u32).min(other), (row as u32).max(other)));
        }
    }
}

impl<S: Scalar> Walls<S> {
    /// When a sphere on its way touches a part of a wall: for as long as the plane across the
    /// nearest point keeps them apart, it does not (conservative advancement; Mirtich 1996).
    pub(super) fn meets(&self, part: Part, sphere: &Sphere<S>, motion: Vec3<S>) -> Option<Stop<S>> {
        let near = sphere.radius * S::constant(INTO);
        let mut time = S::zero();
        for _ in 0..MOST_STEPS {
            let Nearest { normal, distance, .. } =
                self.nearest(part, sphere.center + motion * time);
            let (gap, closing) = (distance - sphere.radius, -motion.dot(normal));
            if closing.is_nan() || closing <= S::zero() {
                return None;
            }
            if gap <= near {
                return Some(Stop { time, wall: part.wall });
            }
            time += gap / closing;
            if time > S::one() {
                return None;
            }
        }
        None // it grazes
    }
}

impl<S: Scalar> Sweep<S> {
    /// Forgets the last substep.
    fn clear(&mut self) {
        self.start.clear();
        self.velocity.clear();
        self.stops.clear();
        self.stands.clear();
        self.grazes.clear();
    }
}

impl<S: Scalar> Marbles<S> {
    /// Puts a marble back to a part of its way in this substep, to what its forces had made of
    /// its velocity by then.
    fn stop_on_the_way(&mut self, sweep: &mut Sweep<S>, row: usize, by: By, time: S) {
        let (start, end) = (sweep.start[row], self.position[row]);
        self.position[row] = start + (end - start) * time;
        let way = end - self.position[row];
        let change = (self.velocity[row] - sweep.velocity[row]) * (S::one() - time);
        self.velocity[row] -= change;
        sweep.stops.push(Stopped { row: row as u32, by, way, change });
        sweep.stands.resize(sweep.start.len(), false);
        sweep.stands[row] = true;
    }
}

impl<S: Scalar> Hit<S> {
    /// When two marbles meet, of which not both were stopped, from `now` on, if they are fast.
    fn foresee(pair: (u32, u32), (a, b): (Way<S>, Way<S>), now: S) -> Option<Self> {
        let (x, y) = (&a.sphere, &b.sphere);
        if length(a.motion - b.motion) <= x.radius.min(y.radius) * S::constant(FAST) {
            return None;
        }
        let apart = direction_and_length(y.center - x.center);
        let (normal, distance) = apart.unwrap_or((Vec3::unit_x(), S::zero()));
        let after = if distance > x.radius + y.radius {
            time_of_impact_sphere_sphere(x, a.motion, y, b.motion)
        } else {
            // They touch. Only what would pass right through is stopped there.
            let depth = (a.motion - b.motion).dot(normal);
            (depth > x.radius.min(y.radius)).then_some(S::zero())
        }?;
        let time = now + after * (S::one() - now);
        Some(Self { time, pair, stopped: (a.stopped, b.stopped) })
    }
}
