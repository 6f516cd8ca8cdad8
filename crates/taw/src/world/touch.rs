//! The second verb: who touches whom, and which of these touches are no more than seams.

use std::collections::HashSet;

use cgmath::{InnerSpace, Zero};
use smallvec::SmallVec;

use super::walls::{Part, Walls};
use super::{WallShape, World};
use crate::contact::{Contact, mtv_sphere_plane, mtv_sphere_sphere};
use crate::math::{Scalar, Vec3, direction_and_length, length};
use crate::response::Response;
use crate::shape::{Aabb, BoundedShape, Plane, PointProjection, Shape, Sphere};

/// A point that lies this part of a radius outside of another wall is still on it: so much
/// would turn a normal by less than 1e-5 rad, and no more are walls apart or askew that were
/// meant to be flush.
const FLUSH: f64 = 5e-6;

/// A part of a wall that is near a marble.
#[derive(Clone, Copy, Debug)]
pub(super) struct Near<S> {
    pub part: Part,
    pub nearest: PointProjection<S>,
}

impl<S: Scalar> World<S> {
    /// Finds which walls touch which marbles, or are at most `reach` metres apart.
    pub(super) fn touch_walls(&mut self, reach: S) {
        if self.marbles.has_capsules() {
            self.touch_half_spaces_at_beads(reach);
        } else {
            self.touch_half_spaces(reach);
        }
        self.walls.prepare();
        if self.walls.are_planes() {
            return;
        }
        let mut near = std::mem::take(&mut self.near_walls);
        for b in 0..self.marbles.len() {
            let sphere = self.marbles.sphere(b);
            if self.marbles.half_length(b) == S::zero() {
                self.touch_parts(b, &sphere, S::zero(), reach, &mut near);
                continue;
            }
            for along in self.beads(b, reach) {
                let center = sphere.center + self.marbles.axis(b) * along;
                self.touch_parts(b, &Sphere { center, ..sphere }, along, reach, &mut near);
            }
        }
        self.near_walls = near;
    }

    fn touch_half_spaces(&mut self, reach: S) {
        for (a, plane) in self.walls.planes() {
            for b in 0..self.marbles.len() {
                if let Some(mtv) = out_of_half_space(plane, &self.marbles.sphere(b), reach) {
                    let along = [S::zero(); 2];
                    self.contacts.wm.push(Contact { a, b: b as u32, part: 0, along, mtv });
                }
            }
        }
    }

    /// Finds contacts with half-spaces where some marbles are capsules, which touch with their ends.
    fn touch_half_spaces_at_beads(&mut self, reach: S) {
        for (a, plane) in self.walls.planes() {
            for b in 0..self.marbles.len() {
                let (sphere, half) = (self.marbles.sphere(b), self.marbles.half_length(b));
                let ends = [-half, half].into_iter().take(if half > S::zero() { 2 } else { 1 });
                for along in ends {
                    let center = sphere.center + self.marbles.axis(b) * along;
                    let mtv = out_of_half_space(plane, &Sphere { center, ..sphere }, reach);
                    if let Some(mtv) = mtv {
                        let along = [S::zero(), along];
                        self.contacts.wm.push(Contact { a, b: b as u32, part: 0, along, mtv });
                    }
                }
            }
        }
    }

    /// Finds the parts of walls that a marble touches, or the part of a capsule that is this
    /// far along its axis.
    fn touch_parts(
        &mut self,
        b: usize,
        sphere: &Sphere<S>,
        along: S,
        reach: S,
        near: &mut Vec<Near<S>>,
    ) {
        near.clear();
        parts_near(&self.walls, sphere, reach, near);
        if near.len() > 1 {
            drop_seams(&self.walls, sphere, near);
        }
        for Near { part: Part { wall, part }, nearest } in near.iter() {
            let depth = (sphere.radius - nearest.distance).max(S::zero());
            let (mtv, along) = (nearest.normal * depth, [S::zero(), along]);
            self.contacts.wm.push(Contact { a: *wall, b: b as u32, part: *part, along, mtv });
        }
    }

    /// Where along its axis a capsule may touch walls: at both ends, and where it is nearest
    /// to an edge or a corner between them.
    fn beads(&self, b: usize, reach: S) -> SmallVec<[S; 4]> {
        let half = self.marbles.half_length(b);
        let mut beads = SmallVec::from_slice(&[-half, half]);
        let shape = self.marbles.shape_of_row(b);
        let Shape::Capsule(capsule) = &shape else { return beads };
        let more = Vec3::new(reach, reach, reach);
        let Aabb { min, max } = capsule.bounding_box();
        let (center, axis) = (self.marbles.sphere(b).center, self.marbles.axis(b));
        self.walls.near(&Aabb { min: min - more, max: max + more }, |part| {
            let Some(touch) = self.walls.closest_points(part, capsule) else { return };
            let along = (touch.on_b - center).dot(axis);
            let inside = along.abs() < half * S::constant(0.999);
            let new = |other: &S| (along - *other).abs() > capsule.radius * S::constant(0.01);
            if inside && touch.distance <= reach && beads.iter().all(new) {
                beads.push(along);
            }
        });
        beads
    }

    /// Unit vector from the wall to the marble of a contact of `contacts.wm`, if they touch: with a
    /// gap of up to 5e-6 radii, which rounding may leave under what rests. None beyond that, and for
    /// rows that do not exist.
    #[must_use]
    pub fn normal_of_wall_touch(&self, contact: &Contact<S>) -> Option<Vec3<S>> {
        let Contact { a, b, part, along: [_, along], mtv } = *contact;
        let near = || {
            let Sphere { center, radius } = self.bead(b, along)?;
            let wall = self.walls.shapes().get(a as usize)?;
            let PointProjection { normal, distance, .. } = wall.project_point_on(part, center);
            (distance - radius <= radius * S::constant(FLUSH)).then_some(normal)
        };
        direction_and_length(mtv).map(|(normal, _)| normal).or_else(near)
    }

    /// Unit vector from the first marble to the second of a contact of `contacts.mm`, if they touch:
    /// with a gap of up to 5e-6 of the smaller radius. None beyond that, and for rows that do not
    /// exist.
    #[must_use]
    pub fn normal_of_marble_touch(&self, contact: &Contact<S>) -> Option<Vec3<S>> {
        let Contact { a, b, along, mtv, .. } = *contact;
        let near = || {
            let (first, second) = (self.bead(a, along[0])?, self.bead(b, along[1])?);
            let apart = self.marbles.period.nearest(second.center - first.center);
            let (normal, distance) = direction_and_length(apart)?;
            let flush = first.radius.min(second.radius) * S::constant(FLUSH);
            (distance - first.radius - second.radius <= flush).then_some(normal)
        };
        direction_and_length(mtv).map(|(normal, _)| normal).or_else(near)
    }

    /// The sphere of a marble that is this far along its axis from the center, in metres.
    fn bead(&self, row: u32, along: S) -> Option<Sphere<S>> {
        let row = row as usize;
        let center = *self.marbles.position().get(row)? + self.marbles.axis(row) * along;
        Some(Sphere { center, radius: self.marbles.radius()[row] })
    }

    /// Finds which marbles touch each other, or are at most `reach` metres apart.
    pub(super) fn touch_marbles(&mut self, reach: S) {
        let center = self.marbles.position();
        self.crowd.begin(center.len());
        if !self.marbles.has_capsules() {
            let (spheres, period) = ((center, self.marbles.radius()), self.marbles.period);
            self.images.pairs(&mut self.grid, spheres, reach, period, |a, b| {
                let (first, second) = (a as usize, b as usize);
                let (first, mut second) = (self.marbles.sphere(first), self.marbles.sphere(second));
                second.center = period.image(second.center, first.center);
                if let Some(mtv) = out_of_sphere(&first, &second, reach) {
                    let along = [S::zero(); 2];
                    let contact = Contact { a, b, part: 0, along, mtv };
                    self.crowd.add(&mut self.contacts.mm, &self.marbles, contact);
                }
            });
            self.crowd.thin(&mut self.contacts.mm, &self.marbles);
            return;
        }
        self.reaches.clear();
        let far = |row: usize| self.marbles.radius()[row] + self.marbles.half_length(row);
        self.reaches.extend((0..self.marbles.len()).map(far));
        self.grid.rebuild(center, &self.reaches, reach);
        self.grid.pairs(center, |a, b| {
            let line = |row: u32| {
                let row = row as usize;
                (self.marbles.sphere(row), self.marbles.axis(row), self.marbles.half_length(row))
            };
            let (first, second) = (line(a), line(b));
            for along in beads_of_lines(first, second) {
                let bead = |(sphere, axis, _): (Sphere<S>, Vec3<S>, S), along: S| Sphere {
                    center: sphere.center + axis * along,
                    ..sphere
                };
                let (x, y) = (bead(first, along[0]), bead(second, along[1]));
                if let Some(mtv) = out_of_sphere(&x, &y, reach) {
                    let contact = Contact { a, b, part: 0, along, mtv };
                    self.crowd.add(&mut self.contacts.mm, &self.marbles, contact);
                }
            }
        });
        self.crowd.thin(&mut self.contacts.mm, &self.marbles);
    }
}

impl<S: Scalar> World<S> {
    /// Adds the marbles that met within the substep, though they are apart at its end.
    pub(super) fn touch_on_the_way(&mut self) {
        let looks = matches!(self.model.response, Response::Displacement | Response::Impulse);
        if self.sweep.grazes.is_empty() || !looks {
            return;
        }
        let mut listed: HashSet<_> = self.contacts.mm.iter().map(|c| (c.a, c.b)).collect();
        for (a, b) in self.sweep.grazes.iter().copied().filter(|pair| listed.insert(*pair)) {
            let (along, mtv) = ([S::zero(); 2], Vec3::zero());
            self.contacts.mm.push(Contact { a, b, part: 0, along, mtv });
        }
    }
}

/// Displacement that moves a sphere out of a half-space, in metres: zero if it is outside by at most
/// `reach` metres, none if farther.
#[inline]
fn out_of_half_space<S: Scalar>(plane: &Plane<S>, sphere: &Sphere<S>, reach: S) -> Option<Vec3<S>> {
    let gap = || plane.signed_distance(sphere.center) - sphere.radius;
    let near = || reach > S::zero() && gap() <= reach;
    mtv_sphere_plane(sphere, plane).or_else(|| near().then(Vec3::zero))
}

/// Displacement that moves the second sphere out of the first, in metres: zero if they are at most
/// `reach` metres apart, none if farther.
#[inline]
fn out_of_sphere<S: Scalar>(first: &Sphere<S>, second: &Sphere<S>, reach: S) -> Option<Vec3<S>> {
    let near = || {
        let gap = length(second.center - first.center) - first.radius - second.radius;
        reach > S::zero() && gap <= reach
    };
    mtv_sphere_sphere(first, second).or_else(|| near().then(Vec3::zero))
}

/// Where along their axes two lines are nearest; of two side by side, both ends of what they
/// share.
fn beads_of_lines<S: Scalar>(
    (first, x, half_x): (Sphere<S>, Vec3<S>, S),
    (second, y, half_y): (Sphere<S>, Vec3<S>, S),
) -> SmallVec<[[S; 2]; 2]> {
    let apart = second.center - first.center;
    let clamp = |along: S, half: S| along.max(-half).min(half);
    let (cos, on_x, on_y) = (x.dot(y), apart.dot(x), apart.dot(y));
    let squared_sin = x.cross(y).magnitude2();
    // Nearly parallel lines have no one nearest point that would stay where it is. They are not
    // parallel if their ends lie aside of each other by a good part of their radii.
    let slim = ((first.radius + second.radius) / half_x.min(half_y)).min(S::one());
    let parallel = squared_sin < slim * slim * S::constant(1e-3);
    if half_x > S::zero() && half_y > S::zero() && parallel {
        let ends = [-half_y, half_y].map(|end| clamp(on_x + cos * end, half_x));
        let beads = ends.map(|along| [along, clamp(cos * along - on_y, half_y)]);
        let mut both = SmallVec::from_slice(&beads[..1]);
        if beads[1] != beads[0] {
            both.push(beads[1]);
        }
        return both;
    }
    let start = if squared_sin > S::zero() { (on_x - cos * on_y) / squared_sin } else { S::zero() };
    let on_second = clamp(cos * clamp(start, half_x) - on_y, half_y);
    let on_first = clamp(on_x + cos * on_second, half_x);
    SmallVec::from_slice(&[[on_first, on_second]])
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
        let nearest = walls.project_point(part, sphere.center);
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
        walls.project_point(other.part, point.nearest.point).distance <= flush
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
