//! Continuous collision of marbles with each other.

use std::cmp::{Ordering, Reverse};

use cgmath::{InnerSpace, SquareMatrix, Zero};

use super::swept_marble::Turn;
use super::walls::{Bend, MarbleMotion, WallImpact, lost_fraction};
use super::{Continuous, MAX_BENDS, MAX_FREE_MOTION, OVERLAP, Obstacle, StoppedMarble, outer};
use crate::broad::Period;
use crate::contact::time_of_impact_sphere_sphere;
use crate::math::{Mat3, Scalar, Vec3, length, normalize_and_length};
use crate::shape::Sphere;
use crate::world::World;

/// Relative motion below this fraction of the smaller radius cannot graze deeper than a hundredth
/// of that, which is negligible.
const MIN_GRAZING_MOTION: f64 = 0.02;

/// Predicted meeting of two marbles, valid until one of their paths bends; or, for a marble paired
/// with itself, its bend at a wall.
#[derive(Clone, Copy, Debug)]
pub(super) struct Meeting<S> {
    /// Fraction of the substep.
    time: S,
    pair: (u32, u32),
    /// Bend counts of both paths at the time of prediction.
    bends: (u32, u32),
}

impl<S: Scalar> Ord for Meeting<S> {
    fn cmp(&self, other: &Self) -> Ordering {
        let time = self.time.partial_cmp(&other.time).unwrap_or(Ordering::Equal);
        time.then(self.pair.cmp(&other.pair))
    }
}

impl<S: Scalar> PartialOrd for Meeting<S> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<S: Scalar> PartialEq for Meeting<S> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl<S: Scalar> Eq for Meeting<S> {}

/// Path of a marble through a substep since its last bend.
#[derive(Clone, Copy, Debug)]
pub(super) struct Path<S> {
    sphere: Sphere<S>,
    /// Time of the last bend, as a fraction of the substep.
    since: S,
    /// Motion in metres per substep, and velocity change by forces in m/s per substep.
    motion: Vec3<S>,
    change: Vec3<S>,
    /// Number of bends so far, and whether a wall or another marble caused one.
    bends: u32,
    held_by_wall: bool,
    /// Motion of the wall that holds it, in metres per substep.
    carried: Vec3<S>,
    met_marble: bool,
    /// Index of the next bend at a wall.
    next: Option<u32>,
}

impl<S: Scalar> World<S> {
    /// Retraces the paths of a substep if any marble was fast: stops those that would pass into
    /// walls or through each other at the time of impact, in the order of time, and lets resting
    /// ones slide.
    pub(in crate::world) fn solve_continuous(&mut self, dt: S) {
        if self.scratch.continuous.start.len() != self.marbles.len() {
            return; // this model does not sweep
        }
        self.bend_at_walls(dt);
        let marbles = &self.marbles;
        let Continuous { start, velocity, candidates, meetings, paths, bends, .. } =
            &mut self.scratch.continuous;
        let displaces = !self.settings.model.response.knows_masses();
        // Displacement changes along the path by itself, and has no normals to get right.
        let min_motion = S::from_f64(if displaces { MAX_FREE_MOTION } else { MIN_GRAZING_MOTION });
        let smallest = marbles.radius.iter().fold(S::infinity(), |least, r| least.min(*r));
        let moved = |row: usize| marbles.position[row] - start[row];
        let fast = |row: usize| length(moved(row)) > smallest * min_motion * S::from_f64(0.5);
        candidates.clear();
        if bends.is_empty() && !(0..start.len()).any(fast) {
            return;
        }
        let shrink = S::one() - S::from_f64(OVERLAP);
        paths.clear();
        paths.extend((0..start.len()).map(|row| Path {
            sphere: Sphere { center: start[row], radius: marbles.radius[row] * shrink },
            since: S::zero(),
            motion: moved(row),
            change: marbles.velocity[row] - velocity[row],
            bends: 0,
            held_by_wall: false,
            carried: Vec3::zero(),
            met_marble: false,
            next: None,
        }));
        meetings.clear();
        for (index, bend) in bends.iter().enumerate().rev() {
            paths[bend.stop.row as usize].next = Some(index as u32);
        }
        meetings
            .extend((0..start.len() as u32).filter_map(|row| Meeting::at_wall(row, paths, bends)));
        if !self.settings.model.response.needs_penetration() {
            self.predict_meetings(min_motion);
        }
        self.bend_in_order(self.resting_approach(dt));
        if !displaces {
            self.scratch.continuous.collect_grazes(self.marbles.period);
        }
        for row in 0..self.scratch.continuous.paths.len() {
            self.arrive(row, dt);
        }
    }

    /// Finds candidate pairs and predicts their first meetings; `min_motion` is the fraction of the
    /// smallest radius that twice a motion must exceed.
    fn predict_meetings(&mut self, min_motion: S) {
        let Continuous { middle, reach, fast, candidates, meetings, paths, bends, .. } =
            &mut self.scratch.continuous;
        let half = S::from_f64(0.5);
        let knows_masses = self.settings.model.response.knows_masses();
        let smallest = self.marbles.radius.iter().fold(S::infinity(), |least, r| least.min(*r));
        fast.clear();
        fast.extend(paths.iter().map(|path| {
            length(path.motion) > smallest * min_motion * half
                || path.carried_bends(bends).next().is_some()
        }));
        middle.clear();
        middle.extend(
            paths
                .iter()
                .map(|displacement| displacement.sphere.center + displacement.motion * half),
        );
        reach.clear();
        let reaches = paths.iter().zip(&self.marbles.radius);
        reach.extend(reaches.zip(&*middle).map(|((path, radius), middle)| {
            // A wall may carry it farther.
            let far = |bend: &Bend<S>| length(bend.center + bend.displacement - *middle);
            *radius + path.carried_bends(bends).map(far).fold(length(path.motion) * half, S::max)
        }));
        let spheres = (&middle[..], &reach[..]);
        self.scratch.images.pairs(
            &mut self.scratch.grid,
            spheres,
            S::zero(),
            self.marbles.period,
            |a, b| {
                let (first, second) = (a as usize, b as usize);
                if !(fast[first] || fast[second])
                    || !self.marbles.may_collide(a, b)
                    || knows_masses
                        && [first, second].iter().all(|row| self.marbles.mass(*row).is_infinite())
                {
                    return false;
                }
                candidates.push((a, b));
                let touching = paths[first].sphere.radius + paths[second].sphere.radius;
                let offset = paths[second].sphere.center - paths[first].sphere.center;
                offset.magnitude2() < touching * touching
            },
        );
        let (pairs, period) = (candidates.iter(), self.marbles.period);
        meetings.extend(pairs.filter_map(|pair| Meeting::predict(*pair, paths, S::zero(), period)));
    }

    /// Processes bends at walls and meetings of marbles in the order of time.
    fn bend_in_order(&mut self, resting_approach: S) {
        if self.scratch.continuous.meetings.is_empty() {
            return;
        }
        let Continuous { partners, candidates, start, .. } = &mut self.scratch.continuous;
        partners.build(candidates, start.len());
        while let Some(Reverse(hit)) = self.scratch.continuous.meetings.pop() {
            let Meeting { time, pair, bends } = hit;
            if bends != self.scratch.continuous.bends_of(pair) {
                continue; // superseded by a newer prediction
            }
            if pair.0 == pair.1 {
                self.bend_at_wall(pair.0 as usize);
            } else {
                self.meet(pair, time, resting_approach);
            }
            if bends == self.scratch.continuous.bends_of(pair) {
                continue; // it bent neither path, so that all predictions stand
            }
            let Continuous { partners, meetings, paths, bends, .. } = &mut self.scratch.continuous;
            let period = self.marbles.period;
            for row in [pair.0, pair.1] {
                meetings.extend(Meeting::at_wall(row, paths, bends));
                // Meetings with this marble change.
                meetings.extend(partners.of(row).iter().filter_map(|other| {
                    Meeting::predict((row.min(*other), row.max(*other)), paths, time, period)
                }));
            }
        }
    }

    /// Bends the path of a marble at its next wall.
    fn bend_at_wall(&mut self, row: usize) {
        let Continuous { paths, bends, .. } = &mut self.scratch.continuous;
        let displacement = &mut paths[row];
        let Some(index) = displacement.next else { return };
        let bend = bends[index as usize];
        let per_substep = if bend.left > S::zero() { bend.left.recip() } else { S::zero() };
        *displacement = Path {
            sphere: Sphere { center: bend.center, ..displacement.sphere },
            since: S::one() - bend.left,
            motion: bend.displacement * per_substep,
            change: bend.change * per_substep,
            bends: displacement.bends + 1,
            held_by_wall: true,
            carried: bend.carried * per_substep,
            next: Some(index + 1).filter(|next| {
                bends.get(*next as usize).is_some_and(|it| it.stop.row == bend.stop.row)
            }),
            ..*displacement
        };
        self.marbles.velocity[row] -= bend.stop.change;
        self.scratch.continuous.stop(bend.stop, bend.along);
    }

    /// Motion in a substep, in metres, of what carries each of two marbles on that meet: one of infinite mass
    /// carries itself, and the other one; else the faster of the walls that carry them carries both.
    fn carried_on(&self, rows: [usize; 2], [x, y]: [&Path<S>; 2]) -> [Vec3<S>; 2] {
        let faster = |a: Vec3<S>, b: Vec3<S>| if is_slower(a, b) { b } else { a };
        match rows.map(|row| self.is_kinematic(row)) {
            [true, _] => [x.motion, faster(x.motion, y.carried)],
            [_, true] => [faster(x.carried, y.motion), y.motion],
            _ => [faster(y.carried, x.carried); 2],
        }
    }

    /// Bends the paths of two marbles where they meet. Marbles that approach faster than
    /// `resting_approach`, in metres per substep, stop, so that they bounce along the normal of
    /// that moment; resting ones continue along the surface. A marble held by a wall yields to
    /// none.
    fn meet(&mut self, pair: (u32, u32), time: S, resting_approach: S) {
        let rows = [pair.0 as usize, pair.1 as usize];
        let old = rows.map(|row| self.scratch.continuous.paths[row]);
        let [x, y] = old.map(|displacement| displacement.at(time));
        let normal = normal_of(&x, &y.nearest_image(&x, self.marbles.period));
        let inverse_masses = [0, 1].map(|side| {
            let mass = self.marbles.mass(rows[side]);
            if old[side].held_by_wall { S::zero() } else { mass.recip() }
        });
        let total = inverse_masses[0] + inverse_masses[1];
        let closing = (y.motion - x.motion).dot(normal);
        let again = x.bends.max(y.bends) + 1 < MAX_BENDS;
        let stopped = [x, y].iter().any(|displacement| {
            displacement.met_marble && displacement.motion == displacement.carried
        });
        let slides = -closing <= resting_approach && again && !stopped && total > S::zero();
        let carried = self.carried_on(rows, [&x, &y]);
        // Loss of each: its share along the normal, or everything.
        let lost = |of: [Vec3<S>; 2], kept: [Vec3<S>; 2]| {
            let both = normal * (of[1] - of[0]).dot(normal);
            if slides {
                [both * (-inverse_masses[0] / total), both * (inverse_masses[1] / total)]
            } else {
                [of[0] - kept[0], of[1] - kept[1]]
            }
        };
        let motion = lost([x.motion, y.motion], carried);
        let change = lost([x.change, y.change], [Vec3::zero(); 2]);
        let rest = S::one() - time;
        let end = (self.marbles.velocity[rows[1]] - self.marbles.velocity[rows[0]]).dot(normal);
        let part = lost_fraction((change[1] - change[0]).dot(normal) * rest, end);
        let plane = Mat3::from_value(S::one()) - outer(normal);
        for (side, displacement) in [x, y].into_iter().enumerate() {
            if motion[side] == Vec3::zero() && change[side] == Vec3::zero() {
                continue;
            }
            let stop = StoppedMarble {
                row: rows[side] as u32,
                obstacle: Obstacle::Marble(rows[1 - side] as u32),
                displacement: motion[side] * rest,
                change: if slides { Vec3::zero() } else { change[side] * (rest * part) },
            };
            let left = S::one() - old[side].since;
            let along =
                if slides && left > S::zero() { plane * (rest / left) } else { Mat3::zero() };
            self.marbles.velocity[rows[side]] -= stop.change;
            self.scratch.continuous.stop(stop, along);
            self.scratch.continuous.paths[rows[side]] = Path {
                // To the bit: who is stopped is told by it.
                motion: if slides { displacement.motion - motion[side] } else { carried[side] },
                change: if slides { displacement.change - change[side] } else { Vec3::zero() },
                bends: displacement.bends + 1,
                held_by_wall: displacement.held_by_wall || !slides,
                carried: if slides { displacement.carried } else { carried[side] },
                met_marble: true,
                next: None,
                ..displacement
            };
        }
        // Rounding may leave a gap.
        self.scratch.continuous.grazes.push(pair);
    }

    /// Moves a marble whose path has bent to its end, or to the wall that another one pushed it to.
    fn arrive(&mut self, row: usize, dt: S) {
        let Path { sphere, bends, met_marble, .. } =
            self.scratch.continuous.paths[row].at(S::one());
        if bends == 0 {
            return;
        }
        self.marbles.position[row] = sphere.center;
        let start = self.swept_marble(row, self.scratch.continuous.start[row], dt);
        let displacement = sphere.center - start.sphere.center;
        let looks = met_marble
            && !(self.walls.are_half_spaces() && self.scratch.continuous.crowded.is_empty());
        let motion = MarbleMotion { displacement, time: dt, carrier: None };
        let stop = if looks { self.first_wall_impact(row, &start, motion) } else { None };
        if met_marble && !start.is_ball() {
            let turn = stop.as_ref().map_or_else(Turn::default, |stop| {
                let rest = (S::one() - stop.time) * dt;
                Turn::until(stop.time, self.turn_with_wall(row, stop.part.wall, rest))
            });
            self.scratch.continuous.set_turn(row, turn);
        }
        let Some(WallImpact { part, center, .. }) = stop else { return };
        self.marbles.position[row] = center;
        let obstacle = Obstacle::Wall(part.wall);
        let (displacement, change) = (sphere.center - center, Vec3::zero());
        self.scratch
            .continuous
            .stop(StoppedMarble { row: row as u32, obstacle, displacement, change }, Mat3::zero());
    }
}

/// Partners of each row among the candidate pairs, in one list.
#[derive(Clone, Debug, Default)]
pub(super) struct Partners {
    /// End of each row's partners in the list.
    end: Vec<u32>,
    rows: Vec<u32>,
}

impl Partners {
    /// Sorts the pairs by both rows (counting sort).
    fn build(&mut self, pairs: &[(u32, u32)], rows: usize) {
        self.end.clear();
        self.end.resize(rows + 1, 0);
        for (a, b) in pairs {
            self.end[*a as usize + 1] += 1;
            self.end[*b as usize + 1] += 1;
        }
        for row in 0..rows {
            self.end[row + 1] += self.end[row];
        }
        self.rows.clear();
        self.rows.resize(2 * pairs.len(), 0);
        for (a, b) in pairs {
            for (row, partner) in [(*a, *b), (*b, *a)] {
                let place = &mut self.end[row as usize];
                self.rows[*place as usize] = partner;
                *place += 1;
            }
        }
    }

    fn of(&self, row: u32) -> &[u32] {
        let row = row as usize;
        let start = row.checked_sub(1).map_or(0, |before| self.end[before]);
        &self.rows[start as usize..self.end[row] as usize]
    }
}

impl<S: Scalar> Continuous<S> {
    /// Bend counts of two paths.
    fn bends_of(&self, (a, b): (u32, u32)) -> (u32, u32) {
        (self.paths[a as usize].bends, self.paths[b as usize].bends)
    }

    /// Lists pairs that graze each other within the substep though neither was stopped.
    fn collect_grazes(&mut self, period: Period<S>) {
        let Self { candidates, paths, grazes, .. } = self;
        grazes.extend(candidates.iter().filter(|(a, b)| {
            let [x, y] = [*a, *b].map(|row| &paths[row as usize]);
            let straight = x.bends == 0 && y.bends == 0;
            straight && x.time_of_impact(&y.nearest_image(x, period)).is_some()
        }));
    }
}

impl<S: Scalar> Path<S> {
    /// Advances the path to a time.
    fn at(&self, time: S) -> Self {
        let center = self.sphere.center + self.motion * (time - self.since);
        Self { sphere: Sphere { center, ..self.sphere }, since: time, ..*self }
    }

    /// Bends ahead at walls that carry the marble along.
    fn carried_bends<'a>(
        &self,
        bends: &'a [Bend<S>],
    ) -> impl Iterator<Item = &'a Bend<S>> + use<'a, S> {
        let ahead = self.next.and_then(|next| bends.get(next as usize..)).unwrap_or_default();
        let row = ahead.first().map(|bend| bend.stop.row);
        let its = ahead.iter().take_while(move |bend| Some(bend.stop.row) == row);
        its.filter(|bend| !bend.carried.is_zero())
    }

    /// Periodic image nearest to another path.
    fn nearest_image(&self, other: &Self, period: Period<S>) -> Self {
        let center = period.image(self.sphere.center, other.sphere.center);
        Self { sphere: Sphere { center, ..self.sphere }, ..*self }
    }

    /// Remaining displacement, in metres.
    fn rest(&self) -> Vec3<S> {
        self.motion * (S::one() - self.since)
    }

    /// Time of impact with another path from the current time on, as a fraction of the rest.
    fn time_of_impact(&self, other: &Self) -> Option<S> {
        time_of_impact_sphere_sphere(&self.sphere, self.rest(), &other.sphere, other.rest())
    }
}

/// Unit vector between two marbles.
/// Order of the motions of what carries two paths along, total, so that no two marbles stop each other again
/// and again.
fn is_slower<S: Scalar>(a: Vec3<S>, b: Vec3<S>) -> bool {
    let key = |carried: Vec3<S>| [carried.magnitude2(), carried.x, carried.y, carried.z];
    key(a) < key(b)
}

fn normal_of<S: Scalar>(x: &Path<S>, y: &Path<S>) -> Vec3<S> {
    let apart = normalize_and_length(y.sphere.center - x.sphere.center);
    apart.map_or(Vec3::unit_x(), |(normal, _)| normal)
}

impl<S: Scalar> Meeting<S> {
    /// Next bend of a marble at a wall.
    fn at_wall(row: u32, paths: &[Path<S>], bends: &[Bend<S>]) -> Option<Reverse<Self>> {
        let displacement = &paths[row as usize];
        let time = S::one() - bends[displacement.next? as usize].left;
        Some(Reverse(Self {
            time,
            pair: (row, row),
            bends: (displacement.bends, displacement.bends),
        }))
    }

    /// Predicts the next meeting of two marbles from `now` on, if they are fast.
    fn predict(
        pair: (u32, u32),
        paths: &[Path<S>],
        now: S,
        period: Period<S>,
    ) -> Option<Reverse<Self>> {
        let [x, y] = [pair.0, pair.1].map(|row| &paths[row as usize]);
        let radius = x.sphere.radius.min(y.sphere.radius);
        let closing = (x.motion - y.motion) * (S::one() - now);
        if length(closing) <= radius * S::from_f64(MAX_FREE_MOTION) {
            return None;
        }
        let (x, y) = (x.at(now), y.at(now));
        let y = y.nearest_image(&x, period);
        let distance = length(y.sphere.center - x.sphere.center);
        let after = if distance > x.sphere.radius + y.sphere.radius {
            x.time_of_impact(&y)?
        } else {
            // They touch: stop only if they would pass right through.
            (closing.dot(normal_of(&x, &y)) > radius).then_some(S::zero())?
        };
        let time = now + after * (S::one() - now);
        Some(Reverse(Self { time, pair, bends: (x.bends, y.bends) }))
    }
}
