//! Marbles that meet each other on their way.

use std::cmp::{Ordering, Reverse};

use cgmath::{InnerSpace, SquareMatrix, Zero};

use super::walls::{Bend, Stop, felt};
use super::{By, FAST, INTO, MOST_BENDS, Stopped, Sweep, outer};
use crate::broad::Period;
use crate::contact::time_of_impact_sphere_sphere;
use crate::math::{Mat3, Scalar, Vec3, direction_and_length, length};
use crate::response::Response;
use crate::shape::Sphere;
use crate::world::World;

/// Whose way past each other is shorter than this part of the smaller radius cannot graze each
/// other by more than a hundredth of that, which is not worth a look.
const SLOW: f64 = 0.02;

/// Two marbles that will meet, unless the way of one of them bends before; or, for one with itself,
/// where its way bends at a wall.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit<S> {
    /// As a part of the substep.
    time: S,
    pair: (u32, u32),
    /// Bends of the way of each when this was foreseen.
    bends: (u32, u32),
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

/// A marble on its way through a substep, since its way last bent.
#[derive(Clone, Copy, Debug)]
pub(super) struct Way<S> {
    sphere: Sphere<S>,
    /// Time of that, as a part of the substep.
    since: S,
    /// In metres per substep, and by how much forces change the velocity, in m/s per substep.
    motion: Vec3<S>,
    change: Vec3<S>,
    /// Number of bends so far, and whether a wall or another marble made one.
    bends: u32,
    held: bool,
    met: bool,
    /// Index of the next bend at a wall.
    next: Option<u32>,
}

impl<S: Scalar> World<S> {
    /// Goes the ways of a substep again if something was fast in it: stops what would pass into
    /// walls or through each other where it touches, the earliest first, and lets slide what only
    /// lies there.
    pub(in crate::world) fn sweep_ways(&mut self, dt: S) {
        if self.sweep.start.len() != self.marbles.len() {
            return; // this model does not sweep
        }
        self.bend_at_walls(dt);
        let marbles = &self.marbles;
        let Sweep { start, velocity, near, hits, ways, bends, .. } = &mut self.sweep;
        let displaces = self.model.response == Response::Displacement;
        // The displacement changes by itself with the way, and has no normals to get right.
        let slow = S::constant(if displaces { FAST } else { SLOW });
        let smallest = marbles.radius.iter().fold(S::infinity(), |least, r| least.min(*r));
        let moved = |row: usize| marbles.position[row] - start[row];
        let fast = |row: usize| length(moved(row)) > smallest * slow * S::constant(0.5);
        near.clear();
        if !(0..start.len()).any(fast) {
            return;
        }
        let into = S::one() - S::constant(INTO);
        ways.clear();
        ways.extend((0..start.len()).map(|row| Way {
            sphere: Sphere { center: start[row], radius: marbles.radius[row] * into },
            since: S::zero(),
            motion: moved(row),
            change: marbles.velocity[row] - velocity[row],
            bends: 0,
            held: false,
            met: false,
            next: None,
        }));
        hits.clear();
        for (index, bend) in bends.iter().enumerate().rev() {
            ways[bend.stop.row as usize].next = Some(index as u32);
        }
        hits.extend((0..start.len() as u32).filter_map(|row| Hit::at_wall(row, ways, bends)));
        if !self.model.response.needs_penetration() {
            self.find_who_may_meet(slow);
        }
        self.bend_in_order(self.slow(dt));
        if !displaces {
            self.sweep.name_grazes(self.marbles.period);
        }
        for row in 0..self.sweep.ways.len() {
            self.arrive(row);
        }
    }

    /// Finds who may meet whom, and when first; `slow` is the part of the smallest radius that a way
    /// must be longer than twice.
    fn find_who_may_meet(&mut self, slow: S) {
        let Sweep { middle, reach, near, hits, ways, .. } = &mut self.sweep;
        let half = S::constant(0.5);
        let smallest = self.marbles.radius.iter().fold(S::infinity(), |least, r| least.min(*r));
        let fast = |row: u32| length(ways[row as usize].motion) > smallest * slow * half;
        middle.clear();
        middle.extend(ways.iter().map(|way| way.sphere.center + way.motion * half));
        reach.clear();
        let reaches = ways.iter().zip(&self.marbles.radius);
        reach.extend(reaches.map(|(way, radius)| *radius + length(way.motion) * half));
        let spheres = (&middle[..], &reach[..]);
        self.images.pairs(&mut self.grid, spheres, S::zero(), self.marbles.period, |a, b| {
            if fast(a) || fast(b) {
                near.extend([(a, b), (b, a)]);
            }
        });
        near.sort_unstable();
        let ahead = near.iter().filter(|(a, b)| a < b);
        let period = self.marbles.period;
        hits.extend(ahead.filter_map(|pair| Hit::foresee(*pair, ways, S::zero(), period)));
    }

    /// Bends ways at walls and where marbles meet, the earliest first.
    fn bend_in_order(&mut self, slow: S) {
        while let Some(Reverse(hit)) = self.sweep.hits.pop() {
            let Hit { time, pair, bends } = hit;
            let bent = |row: u32| self.sweep.ways[row as usize].bends;
            if bends != (bent(pair.0), bent(pair.1)) {
                continue; // it was foreseen anew
            }
            if pair.0 == pair.1 {
                self.bend_at_wall(pair.0 as usize);
            } else {
                self.meet(pair, time, slow);
            }
            let Sweep { near, hits, ways, bends, .. } = &mut self.sweep;
            let period = self.marbles.period;
            for row in [pair.0, pair.1] {
                hits.extend(Hit::at_wall(row, ways, bends));
                // Who was to meet it elsewhere, or not at all, may meet it here.
                let first = near.partition_point(|pair| pair.0 < row);
                let others = near[first..].iter().take_while(|pair| pair.0 == row);
                hits.extend(others.filter_map(|(_, other)| {
                    Hit::foresee((row.min(*other), row.max(*other)), ways, time, period)
                }));
            }
        }
    }

    /// Bends the way of a marble at the wall that it comes to next.
    fn bend_at_wall(&mut self, row: usize) {
        let Sweep { ways, bends, .. } = &mut self.sweep;
        let way = &mut ways[row];
        let Some(index) = way.next else { return };
        let bend = bends[index as usize];
        let per_substep = if bend.left > S::zero() { bend.left.recip() } else { S::zero() };
        *way = Way {
            sphere: Sphere { center: bend.center, ..way.sphere },
            since: S::one() - bend.left,
            motion: bend.way * per_substep,
            change: bend.change * per_substep,
            bends: way.bends + 1,
            held: true,
            next: Some(index + 1).filter(|next| {
                bends.get(*next as usize).is_some_and(|it| it.stop.row == bend.stop.row)
            }),
            ..*way
        };
        self.marbles.velocity[row] -= bend.stop.change;
        self.sweep.stop(bend.stop, bend.along);
    }

    /// Bends the ways of two marbles where they meet. Those that come together faster than `slow`,
    /// in metres per substep, stop, so that they bounce along the normal that they have there; those
    /// that lie on each other go on along the surface. Who is held by a wall gives way to nobody.
    fn meet(&mut self, pair: (u32, u32), time: S, slow: S) {
        let rows = [pair.0 as usize, pair.1 as usize];
        let old = rows.map(|row| self.sweep.ways[row]);
        let [x, y] = old.map(|way| way.at(time));
        let normal = normal_of(&x, &y.beside(&x, self.marbles.period)).0;
        let yields = [0, 1].map(|side| {
            let mass = self.marbles.mass(rows[side]);
            if old[side].held { S::zero() } else { mass.recip() }
        });
        let total = yields[0] + yields[1];
        let closing = (y.motion - x.motion).dot(normal);
        let again = x.bends.max(y.bends) + 1 < MOST_BENDS;
        let stopped = [x, y].iter().any(|way| way.met && way.motion == Vec3::zero());
        let slides = -closing <= slow && again && !stopped && total > S::zero();
        // What each loses of what both change: the part along the normal, or all.
        let lost = |of: [Vec3<S>; 2]| {
            let both = normal * (of[1] - of[0]).dot(normal);
            if slides { [both * (-yields[0] / total), both * (yields[1] / total)] } else { of }
        };
        let (motion, change) = (lost([x.motion, y.motion]), lost([x.change, y.change]));
        let rest = S::one() - time;
        let end = (self.marbles.velocity[rows[1]] - self.marbles.velocity[rows[0]]).dot(normal);
        let part = felt((change[1] - change[0]).dot(normal) * rest, end);
        let plane = Mat3::from_value(S::one()) - outer(normal);
        for (side, way) in [x, y].into_iter().enumerate() {
            if motion[side] == Vec3::zero() && change[side] == Vec3::zero() {
                continue;
            }
            let stop = Stopped {
                row: rows[side] as u32,
                by: By::Marble(rows[1 - side] as u32),
                way: motion[side] * rest,
                change: if slides { Vec3::zero() } else { change[side] * (rest * part) },
            };
            let left = S::one() - old[side].since;
            let along =
                if slides && left > S::zero() { plane * (rest / left) } else { Mat3::zero() };
            self.marbles.velocity[rows[side]] -= stop.change;
            self.sweep.stop(stop, along);
            self.sweep.ways[rows[side]] = Way {
                motion: way.motion - motion[side],
                change: way.change - change[side],
                bends: way.bends + 1,
                held: way.held || !slides,
                met: true,
                next: None,
                ..way
            };
        }
        // Rounding may leave a gap.
        self.sweep.grazes.push(pair);
    }

    /// Puts a marble whose way has bent to the end of it, or to the wall that another one pushed it
    /// to.
    fn arrive(&mut self, row: usize) {
        let Way { sphere, bends, met, .. } = self.sweep.ways[row].at(S::one());
        if bends == 0 {
            return;
        }
        self.marbles.position[row] = sphere.center;
        let start = Sphere { center: self.sweep.start[row], ..self.marbles.sphere(row) };
        let way = sphere.center - start.center;
        let looks = met && !self.walls.are_planes();
        let stop = if looks { self.first_wall(&start, way) } else { None };
        let Some(Stop { time, wall, .. }) = stop else { return };
        self.marbles.position[row] = start.center + way * time;
        let by = By::Wall(wall);
        let (way, change) = (way * (S::one() - time), Vec3::zero());
        self.sweep.stop(Stopped { row: row as u32, by, way, change }, Mat3::zero());
    }
}

impl<S: Scalar> Sweep<S> {
    /// Names those that graze each other on the way, though neither was stopped.
    fn name_grazes(&mut self, period: Period<S>) {
        let Self { near, ways, grazes, .. } = self;
        grazes.extend(near.iter().filter(|(a, b)| {
            let [x, y] = [*a, *b].map(|row| &ways[row as usize]);
            let straight = x.bends == 0 && y.bends == 0;
            a < b && straight && x.time_of_impact(&y.beside(x, period)).is_some()
        }));
    }
}

impl<S: Scalar> Way<S> {
    /// The way from where the marble is at a time.
    fn at(&self, time: S) -> Self {
        let center = self.sphere.center + self.motion * (time - self.since);
        Self { sphere: Sphere { center, ..self.sphere }, since: time, ..*self }
    }

    /// Its image that is nearest to another way.
    fn beside(&self, other: &Self, period: Period<S>) -> Self {
        let center = period.image(self.sphere.center, other.sphere.center);
        Self { sphere: Sphere { center, ..self.sphere }, ..*self }
    }

    /// Way to the end of the substep, in metres.
    fn rest(&self) -> Vec3<S> {
        self.motion * (S::one() - self.since)
    }

    /// Time of impact with another from the same moment on, as a part of the rest.
    fn time_of_impact(&self, other: &Self) -> Option<S> {
        time_of_impact_sphere_sphere(&self.sphere, self.rest(), &other.sphere, other.rest())
    }
}

/// The unit vector from one marble to another, and how far their centers are apart, in metres.
fn normal_of<S: Scalar>(x: &Way<S>, y: &Way<S>) -> (Vec3<S>, S) {
    let apart = direction_and_length(y.sphere.center - x.sphere.center);
    apart.unwrap_or((Vec3::unit_x(), S::zero()))
}

impl<S: Scalar> Hit<S> {
    /// Next bend of a row at a wall.
    fn at_wall(row: u32, ways: &[Way<S>], bends: &[Bend<S>]) -> Option<Reverse<Self>> {
        let way = &ways[row as usize];
        let time = S::one() - bends[way.next? as usize].left;
        Some(Reverse(Self { time, pair: (row, row), bends: (way.bends, way.bends) }))
    }

    /// Next meeting of two marbles from `now` on, if they are fast.
    fn foresee(
        pair: (u32, u32),
        ways: &[Way<S>],
        now: S,
        period: Period<S>,
    ) -> Option<Reverse<Self>> {
        let [x, y] = [pair.0, pair.1].map(|row| ways[row as usize].at(now));
        let y = y.beside(&x, period);
        let radius = x.sphere.radius.min(y.sphere.radius);
        let closing = x.rest() - y.rest();
        if length(closing) <= radius * S::constant(FAST) {
            return None;
        }
        let (normal, distance) = normal_of(&x, &y);
        let after = if distance > x.sphere.radius + y.sphere.radius {
            x.time_of_impact(&y)?
        } else {
            // They touch. Only what would pass right through is stopped there.
            (closing.dot(normal) > radius).then_some(S::zero())?
        };
        let time = now + after * (S::one() - now);
        Some(Reverse(Self { time, pair, bends: (x.bends, y.bends) }))
    }
}
