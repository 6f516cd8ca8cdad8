//! Marbles that come to walls on their way.

use cgmath::{InnerSpace, SquareMatrix};
use smallvec::SmallVec;

use super::{By, FAST, INTO, MOST_BENDS, Stopped, outer};
use crate::math::{Mat3, Point3, Scalar, Vec3, length};
use crate::response::Walls as _;
use crate::shape::{Aabb, Nearest, Sphere};
use crate::world::World;
use crate::world::walls::{Part, Walls};

/// Steps enough for a marble to come to any wall but one that it only grazes.
const MOST_STEPS: u32 = 32;

/// What a marble meets on its way.
pub(in crate::world) struct Stop<S> {
    /// As a part of the way.
    pub time: S,
    pub wall: u32,
    pub normal: Vec3<S>,
}

/// A bend of a way at a wall.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bend<S> {
    pub stop: Stopped<S>,
    pub center: Point3<S>,
    /// Which part of the substep is left then, how far the marble still goes in it, in metres, and by
    /// how much forces still change its velocity, in m/s.
    pub left: S,
    pub way: Vec3<S>,
    pub change: Vec3<S>,
    /// What is left to its place to follow its velocity.
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
    /// detection and response*, 2003). Where it comes faster than `slow`, in metres per substep, and
    /// would slide off, it keeps nothing: off the wall it could not bounce.
    fn slide_along_walls(&mut self, row: usize, slow: S) {
        let mut sphere = Sphere { center: self.sweep.start[row], ..self.marbles.sphere(row) };
        let mut way = self.marbles.position[row] - sphere.center;
        let mut velocity = self.marbles.velocity[row];
        let mut change = velocity - self.sweep.velocity[row];
        let mut left = S::one();
        let mut surfaces: SmallVec<[Vec3<S>; MOST_BENDS as usize]> = SmallVec::new();
        while length(way) > sphere.radius * S::constant(FAST)
            && let Some(Stop { time, wall, normal }) = self.first_wall(&sphere, way)
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
            let lost = felt((change - kept).dot(normal), closing);
            let stop = Stopped {
                row: row as u32,
                by: By::Wall(wall),
                way: way - slid,
                change: (change - kept) * lost,
            };
            velocity -= stop.change;
            (way, change) = (slid, kept);
            let center = sphere.center;
            self.sweep.bends.push(Bend { stop, center, left, way, change, along: along * rest });
        }
    }

    /// Where a sphere first touches a wall that it would pass into.
    pub(super) fn first_wall(&self, sphere: &Sphere<S>, motion: Vec3<S>) -> Option<Stop<S>> {
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
}

impl<S: Scalar> Walls<S> {
    /// When a sphere on its way touches a part of a wall: for as long as the plane across the
    /// nearest point keeps them apart, it does not (conservative advancement; Mirtich 1996).
    pub(in crate::world) fn meets(
        &self,
        part: Part,
        sphere: &Sphere<S>,
        motion: Vec3<S>,
    ) -> Option<Stop<S>> {
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
                return Some(Stop { time, wall: part.wall, normal });
            }
            time += gap / closing;
            if time > S::one() {
                return None;
            }
        }
        None // it grazes
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
