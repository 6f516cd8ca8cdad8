//! The second verb: who touches whom, and which of these touches are no more than seams.

use cgmath::Zero;

use super::walls::{Part, Walls};
use super::{WallShape, World};
use crate::contact::{Contact, mtv_sphere_plane, mtv_sphere_sphere};
use crate::math::{Scalar, Vec3, length};
use crate::shape::{Aabb, Nearest, Sphere};

/// A point that lies this part of a radius outside of another wall is still on it: so much
/// would turn a normal by less than 1e-5 rad, and no more are walls apart or askew that were
/// meant to be flush.
const FLUSH: f64 = 5e-6;

/// A part of a wall that is near a marble.
#[derive(Clone, Copy, Debug)]
pub(super) struct Near<S> {
    pub part: Part,
    pub nearest: Nearest<S>,
}

impl<S: Scalar> World<S> {
    /// Finds which walls touch which marbles, or are at most `reach` metres apart.
    pub(super) fn touch_walls(&mut self, reach: S) {
        let nothing = Vec3::zero();
        for (a, plane) in self.walls.planes() {
            for b in 0..self.marbles.len() {
                let sphere = self.marbles.sphere(b);
                let gap = || plane.signed_distance(sphere.center) - sphere.radius;
                let near = || reach > S::zero() && gap() <= reach;
                let mtv = mtv_sphere_plane(&sphere, plane);
                if let Some(mtv) = mtv.or_else(|| near().then_some(nothing)) {
                    self.contacts.wm.push(Contact { a, b: b as u32, part: 0, mtv });
                }
            }
        }
        self.walls.prepare();
        if self.walls.are_planes() {
            return;
        }
        let mut near = std::mem::take(&mut self.near_walls);
        for b in 0..self.marbles.len() {
            let sphere = self.marbles.sphere(b);
            near.clear();
            parts_near(&self.walls, &sphere, reach, &mut near);
            if near.len() > 1 {
                drop_seams(&self.walls, &sphere, &mut near);
            }
            for Near { part: Part { wall, part }, nearest } in &near {
                let depth = (sphere.radius - nearest.distance).max(S::zero());
                let mtv = nearest.normal * depth;
                self.contacts.wm.push(Contact { a: *wall, b: b as u32, part: *part, mtv });
            }
        }
        self.near_walls = near;
    }

    /// Finds which marbles touch each other, or are at most `reach` metres apart.
    pub(super) fn touch_marbles(&mut self, reach: S) {
        let center = self.marbles.position();
        self.grid.rebuild(center, self.marbles.radius(), reach);
        self.grid.pairs(center, |a, b| {
            let (first, second) = (a as usize, b as usize);
            let (first, second) = (self.marbles.sphere(first), self.marbles.sphere(second));
            let near = || {
                let gap = length(second.center - first.center) - first.radius - second.radius;
                reach > S::zero() && gap <= reach
            };
            let mtv = mtv_sphere_sphere(&first, &second);
            if let Some(mtv) = mtv.or_else(|| near().then_some(Vec3::zero())) {
                self.contacts.mm.push(Contact { a, b, part: 0, mtv });
            }
        });
    }
}

/// Names the parts of walls, but for half-spaces, that a sphere is at most `reach` metres
/// from, in order.
pub(super) fn parts_near<S: Scalar>(
    walls: &Walls<S>,
    sphere: &Sphere<S>,
    reach: S,
    near: &mut Vec<Near<S>>,
) {
    let far = sphere.radius + reach;
    let more = Vec3::new(far, far, far);
    let bounds = Aabb { min: sphere.center - more, max: sphere.center + more };
    walls.near(&bounds, |part| {
        let nearest = walls.nearest(part, sphere.center);
        if nearest.distance <= far {
            near.push(Near { part, nearest });
        }
    });
    near.sort_unstable_by_key(|near| near.part);
    near.dedup_by_key(|near| near.part);
    // Of a landscape that a sphere is under, only the nearest piece says how far.
    let under = |it: &Near<S>| {
        let landscape = matches!(walls.shapes()[it.part.wall as usize], WallShape::HeightField(..));
        landscape && it.nearest.distance < S::zero()
    };
    if near.iter().any(under) {
        let all = near.clone();
        near.retain(|it| {
            let nearer = |other: &Near<S>| {
                other.part.wall == it.part.wall
                    && (-other.nearest.distance, other.part) < (-it.nearest.distance, it.part)
            };
            !(under(it) && all.iter().any(nearer))
        });
    }
}

/// Leaves those touches that a sphere would feel if all walls were one piece.
///
/// A touch whose nearest point lies in or on another wall is none: the other one is nearer,
/// and covers it. That is so of every inner edge of flush boxes, of the triangles of a
/// surface, of walls that run into each other, whichever wall or body they belong to. Two
/// that cover each other have the same nearest point, and one is enough.
pub(super) fn drop_seams<S: Scalar>(walls: &Walls<S>, sphere: &Sphere<S>, near: &mut Vec<Near<S>>) {
    let largest = [sphere.center.x, sphere.center.y, sphere.center.z]
        .iter()
        .fold(sphere.radius, |most, x| most.max(x.abs()));
    let rounding = S::epsilon() * S::constant(4.0) * largest;
    let flush = (sphere.radius * S::constant(FLUSH)).max(rounding);
    let on = |point: &Near<S>, other: &Near<S>| {
        walls.nearest(other.part, point.nearest.point).distance <= flush
    };
    let before =
        |x: &Near<S>, y: &Near<S>| (x.nearest.distance, x.part) < (y.nearest.distance, y.part);
    let seam = |it: &Near<S>| {
        let others = near.iter().filter(|other| other.part != it.part);
        let on_planes =
            || walls.planes().any(|(_, plane)| plane.signed_distance(it.nearest.point) <= flush);
        let covers = |other: &Near<S>| on(it, other) && (before(other, it) || !on(other, it));
        others.into_iter().any(covers) || on_planes()
    };
    let seams: Vec<bool> = near.iter().map(seam).collect();
    let mut row = 0;
    near.retain(|_| {
        row += 1;
        !seams[row - 1]
    });
}
