//! Marbles that come to walls on their way.

use cgmath::{InnerSpace, SquareMatrix, Zero};
use smallvec::SmallVec;

use super::{By, FAST, INTO, MOST_BENDS, Stopped, outer};
use crate::math::{Mat3, Point3, Scalar, Vec3, length};
use crate::response::Colliders as _;
use crate::shape::{Aabb, Nearest, Sphere};
use crate::world::World;
use crate::world::walls::{Part, Walls};

/// Steps enough for a marble to come to any wall but one that it only grazes.
const MOST_STEPS: u32 = 32;

/// Hit of a marble on a wall on its way.
pub(in crate::world) struct Stop<S> {
    /// As a part of the way.
    pub time: S,
    pub wall: u32,
    pub normal: Vec3<S>,
    /// Separation from the wall there, in metres.
    gap: S,
}

/// A bend of a way at a wall.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bend<S> {
    pub stop: Stopped<S>,
    pub center: Point3<S>,
    /// Part of the substep that is left then, way of the marble in it, in metres, and change of its
    /// velocity by forces in it, in m/s.
    pub left: S,
    pub way: Vec3<S>,
    pub change: Vec3<S>,
    /// Projection by which its position still follows its velocity.
    pub along: Mat3<S>,
}

impl<S: Scalar> World<S> {
    /// Finds where ways of marbles bend that would pass into walls by more than half of their
    /// radius. Walls count as they are now, and half-spaces need none of this.
    pub(super) fn bend_at_walls(&mut self, dt: S) {
        self.walls.prepare();
        if self.walls.are_planes() {
            return;
        }
        let slow = self.slow(dt);
        for row in 0..self.marbles.len() {
            let motion = self.marbles.position[row] - self.sweep.start[row];
            if length(motion) > self.marbles.radius[row] * S::constant(FAST) {
                self.slide_along_walls(row, slow);
            }
        }
    }

    /// Follows a way from wall to wall: a marble stops where it touches one, or by
    /// [`Response::Penalty`](crate::response::Response::Penalty), whose forces need an overlap, where
    /// half of its radius does. What is left of its way, and of what forces change of its velocity,
    /// it keeps along the surface, as games' "collide and slide" does (Fauerby, *Improved collision
    /// detection and response*, 2003). What comes faster than `slow`, in metres per substep, has the
    /// velocity of that moment, with which it bounces; and if it would slide off, it stays, since off
    /// the wall it could not. What lies keeps its velocity: its weight is what friction needs.
    fn slide_along_walls(&mut self, row: usize, slow: S) {
        let mut sphere = Sphere { center: self.sweep.start[row], ..self.marbles.sphere(row) };
        let mut way = self.marbles.position[row] - sphere.center;
        let mut velocity = self.marbles.velocity[row];
        let mut change = velocity - self.sweep.velocity[row];
        let mut left = S::one();
        let mut surfaces: SmallVec<[Vec3<S>; MOST_BENDS as usize]> = SmallVec::new();
        while length(way) > sphere.radius * S::constant(FAST)
            && let Some(Stop { time, wall, normal, .. }) = self.first_wall(&sphere, way)
        {
            sphere.center += way * time;
            let rest = S::one() - time;
            (way, change, left) = (way * rest, change * rest, left * rest);
            let mut along = along_surfaces(way, normal, &surfaces);
            surfaces.push(normal);
            let there = sphere.center + along * way;
            let slides_off = || {
                let wall = &self.walls.shapes()[wall as usize];
                wall.nearest(there).distance > sphere.radius
            };
            let fast = -way.dot(normal) > slow * left;
            if surfaces.len() == MOST_BENDS as usize || (fast && slides_off()) {
                along = Mat3::from_value(S::zero());
            }
            let (slid, kept) = (along * way, along * change);
            let surface = self.walls.surface_velocity(wall as usize, sphere.center);
            let closing = (velocity - surface).dot(normal);
            let part = felt((change - kept).dot(normal), closing);
            let stop = Stopped {
                row: row as u32,
                by: By::Wall(wall),
                way: way - slid,
                change: if fast { (change - kept) * part } else { Vec3::zero() },
            };
            velocity -= stop.change;
            (way, change) = (slid, kept);
            let center = sphere.center;
            self.sweep.bends.push(Bend { stop, center, left, way, change, along: along * rest });
        }
    }

    /// Stops marbles that a bounce would carry on into another wall where they touch that, half-spaces
    /// too: they have their velocity, and bounce there in the next substep.
    pub(in crate::world) fn stop_bounces_at_walls(&mut self) {
        for row in 0..self.sweep.bounced_from.len().min(self.marbles.len()) {
            let sphere =
                Sphere { center: self.sweep.bounced_from[row], ..self.marbles.sphere(row) };
            let way = self.marbles.position[row] - sphere.center;
            if length(way) <= sphere.radius * S::constant(FAST) {
                continue;
            }
            let planes = self.walls.planes().filter_map(|(_, plane)| {
                let (gap, closing) = (
                    plane.signed_distance(sphere.center) - sphere.radius,
                    -way.dot(plane.normal()),
                );
                let passes =
                    closing > S::zero() && closing > gap + sphere.radius * S::constant(FAST);
                passes.then(|| (gap / closing).max(S::zero()))
            });
            let other = self.first_wall(&sphere, way).map(|stop| stop.time);
            let first = planes.chain(other).fold(S::one(), S::min);
            if first < S::one() {
                self.marbles.position[row] = sphere.center + way * first;
            }
        }
    }

    /// First touch of a sphere with a wall, if it would pass into one.
    pub(super) fn first_wall(&self, sphere: &Sphere<S>, motion: Vec3<S>) -> Option<Stop<S>> {
        let (half, into) = (S::constant(0.5), S::one() - S::constant(INTO));
        let (start, more) = (sphere.center, sphere.radius);
        let more = Vec3::new(more, more, more);
        let way = Aabb { min: start, max: start }
            .union(&Aabb { min: start + motion, max: start + motion });
        let bounds = Aabb { min: way.min - more, max: way.max + more };
        // Its core says whether it passes into a wall, its surface when it is there: first, wherever
        // it touches, so that at the seam of two flush parts the one below it counts.
        let core = Sphere { radius: sphere.radius * half, ..*sphere };
        let mut passes = false;
        self.walls.near(&bounds, |part| {
            passes = passes || self.walls.meets(part, &core, motion).is_some();
        });
        if !passes {
            return None;
        }
        let part_of_it = if self.model.response.needs_penetration() { half } else { into };
        let all = Sphere { radius: sphere.radius * part_of_it, ..*sphere };
        let mut best: Option<Stop<S>> = None;
        self.walls.near(&bounds, |part| {
            let Some(stop) = self.walls.meets(part, &all, motion) else { return };
            let order = |stop: &Stop<S>| (stop.time, stop.gap);
            if best.as_ref().is_none_or(|best| order(&stop) < order(best)) {
                best = Some(stop);
            }
        });
        best
    }
}

impl<S: Scalar> Walls<S> {
    /// Time at which a sphere on its way touches a part of a wall: for as long as the plane across the
    /// nearest point keeps them apart, it does not (conservative advancement; Mirtich 1996).
    pub(in crate::world) fn meets(
        &self,
        part: Part,
        sphere: &Sphere<S>,
        motion: Vec3<S>,
    ) -> Option<Stop<S>> {
        let near = sphere.radius * S::constant(INTO);
        let mut time = S::zero();
        let mut last = None;
        for _ in 0..MOST_STEPS {
            let Nearest { normal, distance, .. } =
                self.nearest(part, sphere.center + motion * time);
            let (gap, closing) = (distance - sphere.radius, -motion.dot(normal));
            if closing.is_nan() || closing <= S::zero() {
                return None;
            }
            if gap <= near {
                return Some(Stop { time, wall: part.wall, normal, gap });
            }
            last = Some(Stop { time, wall: part.wall, normal, gap });
            time += gap / closing;
            if time > S::one() {
                return None;
            }
        }
        // It grazes, or is so near that rounding cannot tell.
        last.filter(|last| last.gap <= sphere.radius)
    }
}

/// Which part of a change of speed along a normal a marble loses that stops: all of it, but never so
/// much that it would part by forces that it has not felt yet. `end` is its speed with all of it.
pub(super) fn felt<S: Scalar>(change: S, end: S) -> S {
    if end < S::zero() && end > change { end / change } else { S::one() }
}

/// What keeps of a way the part along a surface that it comes to: along the plane of it, along the
/// edge with another surface that the marble touches already where that would be in the way, and
/// nothing in a corner.
fn along_surfaces<S: Scalar>(way: Vec3<S>, normal: Vec3<S>, others: &[Vec3<S>]) -> Mat3<S> {
    let plane = Mat3::from_value(S::one()) - outer(normal);
    let slid = plane * way;
    let blocks = |other: &&Vec3<S>, way: Vec3<S>| way.dot(**other) < S::zero();
    let Some(other) = others.iter().find(|other| blocks(other, slid)) else { return plane };
    let edge = normal.cross(*other);
    // Rounding tells nothing of the edge between two that are as good as one.
    if edge.magnitude2() <= S::epsilon() {
        return plane;
    }
    let along = outer(edge.normalize());
    if others.iter().any(|it| it != other && blocks(&it, along * way)) {
        return Mat3::from_value(S::zero());
    }
    along
}
