//! Narrow phase: contact generation, and the removal of ghost collisions at internal edges.

use std::collections::HashSet;

use cgmath::{InnerSpace, Zero};
use smallvec::SmallVec;

use super::marble_shapes::{END, SIDE_BY_SIDE};
use super::marbles::Marbles;
use super::walls::{SubShape, Walls};
use super::{WallShape, World};
use crate::broad::CollisionFilter;
use crate::contact::{Contact, ContactMaterial};
use crate::math::{Scalar, Vec3, normal_and_distance};
use crate::shape::{Aabb, Aabb3, BoundedShape, PointProjection, Shape, Sphere};

/// Tolerance of internal edges, as a fraction of the radius: a point this far outside of another
/// wall still counts as on it. It would tilt a normal by less than 1e-5 rad, and flush walls are no
/// farther apart or askew.
const INTERNAL_EDGE_TOLERANCE: f64 = 5e-6;

/// Candidate sub-shape of a wall near a marble, with the projected center.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate<S> {
    pub part: SubShape,
    pub nearest: PointProjection<S>,
}

impl<S: Scalar> World<S> {
    /// Collides walls with marbles, up to a contact distance of `contact_distance` metres.
    pub(super) fn collide_walls(&mut self, contact_distance: S) {
        self.collide_half_spaces(contact_distance);
        self.walls.update_tree();
        if self.walls.are_half_spaces() {
            return;
        }
        let mut candidates = std::mem::take(&mut self.scratch.near_walls);
        for b in 0..self.marbles.len() {
            if self.marbles.sleep.is_asleep(b) {
                continue;
            }
            let sphere = self.marbles.sphere(b);
            if self.marbles.half_length(b) == S::zero() {
                self.collide_sub_shapes(b, &sphere, S::zero(), contact_distance, &mut candidates);
                continue;
            }
            for along in self.sample_points(b, contact_distance) {
                let center = sphere.center + self.marbles.axis(b) * along;
                self.collide_sub_shapes(
                    b,
                    &Sphere { center, ..sphere },
                    along,
                    contact_distance,
                    &mut candidates,
                );
            }
        }
        self.scratch.near_walls = candidates;
    }

    /// Collides half-spaces with marbles and capsules, which touch with their ends.
    fn collide_half_spaces(&mut self, contact_distance: S) {
        for (wall, plane) in self.walls.planes() {
            for b in 0..self.marbles.len() {
                if self.marbles.sleep.is_asleep(b)
                    || !self.walls.collides(wall, self.marbles.filter_of_row(b))
                {
                    continue;
                }
                let half = self.marbles.half_length(b);
                let ends = [-half, half].into_iter().take(if half > S::zero() { 2 } else { 1 });
                for along in ends {
                    let center = self.marbles.position()[b] + self.anchor(b, along);
                    let distance = plane.signed_distance(center);
                    if distance - self.marbles.radius()[b] <= contact_distance {
                        let (part, place) =
                            (SubShape { wall, index: 0 }, (plane.normal(), distance));
                        self.contacts.wm.push(self.wall_contact(part, b, along, place));
                    }
                }
            }
        }
    }

    /// Point on a capsule's axis at this distance from the center, relative to the center.
    fn anchor(&self, row: usize, along: S) -> Vec3<S> {
        if along == S::zero() { Vec3::zero() } else { self.marbles.axis(row) * along }
    }

    /// Contact of a wall and a marble, or a capsule's sphere at `along` on its axis, by the normal
    /// of the wall and the distance of the sphere's center.
    pub(super) fn wall_contact(
        &self,
        SubShape { wall, index }: SubShape,
        b: usize,
        along: S,
        place: (Vec3<S>, S),
    ) -> Contact<S> {
        let (radii, anchors) =
            ([S::zero(), self.marbles.radius()[b]], [Vec3::zero(), self.anchor(b, along)]);
        let feature = self.marbles.feature_at(b, along);
        let along = [S::zero(), along];
        let material = self.wall_contact_material(wall, b);
        let contact = Contact::with_wall(wall, index, b as u32);
        Contact { feature, along, material, ..contact }.placed(place, radii, anchors)
    }

    /// Material of the contact of a wall and a marble.
    pub(super) fn wall_contact_material(&self, wall: u32, b: usize) -> ContactMaterial<S> {
        let of_marble = self.marbles.own.material.get(b).unwrap_or_default();
        of_marble.on_wall(self.walls.material_of_row(wall as usize))
    }

    /// Collides a marble, or a sample sphere of a capsule at `along` on its axis, with sub-shapes
    /// of walls.
    fn collide_sub_shapes(
        &mut self,
        b: usize,
        sphere: &Sphere<S>,
        along: S,
        contact_distance: S,
        candidates: &mut Vec<Candidate<S>>,
    ) {
        candidates.clear();
        let filter = self.marbles.filter_of_row(b);
        candidate_sub_shapes(&self.walls, (sphere, filter), contact_distance, candidates);
        if candidates.len() > 1 {
            remove_ghost_collisions(&self.walls, (sphere, filter), candidates);
        }
        for Candidate { part, nearest } in candidates.iter() {
            let place = (nearest.normal, nearest.distance);
            let contact = self.wall_contact(*part, b, along, place);
            self.contacts.wm.push(contact);
        }
    }

    /// Contact sample points of a capsule on its axis: both ends, and where it is nearest to an
    /// edge or a corner between them.
    fn sample_points(&self, b: usize, contact_distance: S) -> SmallVec<[S; 4]> {
        let half = self.marbles.half_length(b);
        let mut samples = SmallVec::from_slice(&[-half, half]);
        let shape = self.marbles.shape_of_row(b);
        let Shape::Capsule(capsule) = &shape else { return samples };
        let margin = Vec3::new(contact_distance, contact_distance, contact_distance);
        let Aabb { min, max } = capsule.bounding_box();
        let (center, axis) = (self.marbles.sphere(b).center, self.marbles.axis(b));
        let bounds = Aabb { min: min - margin, max: max + margin };
        self.walls.for_each_colliding(&bounds, self.marbles.filter_of_row(b), |part| {
            let Some(touch) = self.walls.closest_points(part, capsule) else { return };
            let along = (touch.on_b - center).dot(axis);
            let inside = along.abs() < half * S::from_f64(END);
            let new = |other: &S| (along - *other).abs() > capsule.radius * S::from_f64(0.01);
            if inside && touch.distance <= contact_distance && samples.iter().all(new) {
                samples.push(along);
            }
        });
        samples
    }

    /// Collides marbles with each other, up to a contact distance of `contact_distance` metres.
    pub(super) fn collide_marbles(&mut self, contact_distance: S) {
        let center = self.marbles.position();
        self.scratch.contact_limit.begin(center.len());
        if !self.marbles.has_capsules() {
            let (spheres, period) = ((center, self.marbles.radius()), self.marbles.period);
            self.scratch.images.pairs(
                &mut self.scratch.grid,
                spheres,
                contact_distance,
                period,
                |a, b| {
                    if self.marbles.sleep.are_asleep([a, b]) {
                        return false;
                    }
                    if self.scratch.contact_limit.drops(&self.marbles, [a, b]) {
                        return true; // it overlaps deeper ones
                    }
                    let zero = S::zero();
                    let contact =
                        marble_contact(&self.marbles, [a, b], [zero; 2], contact_distance);
                    let Some(contact) = contact else { return false };
                    self.scratch.contact_limit.add(&mut self.contacts.mm, &self.marbles, contact);
                    contact.separation < zero
                },
            );
            self.scratch.contact_limit.drop_excess(&mut self.contacts.mm, &self.marbles);
            return;
        }
        self.scratch.reaches.clear();
        self.scratch.reaches.extend((0..center.len()).map(|row| self.marbles.reach_of_row(row)));
        self.scratch.grid.rebuild(center, &self.scratch.reaches, contact_distance);
        self.scratch.grid.pairs(center, |a, b| {
            if self.marbles.sleep.are_asleep([a, b]) {
                return;
            }
            let line = |row: u32| {
                let row = row as usize;
                (self.marbles.sphere(row), self.marbles.axis(row), self.marbles.half_length(row))
            };
            let (points, are_parallel) = closest_points_of_segments(line(a), line(b));
            for (end, along) in (0_u32..).zip(points) {
                let contact = marble_contact(&self.marbles, [a, b], along, contact_distance);
                if let Some(mut contact) = contact {
                    if are_parallel {
                        contact.feature = (SIDE_BY_SIDE + end) << 16 | (SIDE_BY_SIDE + end);
                    }
                    self.scratch.contact_limit.add(&mut self.contacts.mm, &self.marbles, contact);
                }
            }
        });
        self.scratch.contact_limit.drop_excess(&mut self.contacts.mm, &self.marbles);
    }
}

impl<S: Scalar> World<S> {
    /// Adds pairs that met within the substep, though they are apart at its end.
    pub(super) fn add_grazing_contacts(&mut self) {
        let looks = self.settings.model.response.lists_grazes();
        if self.scratch.continuous.grazes.is_empty() || !looks {
            return;
        }
        let grazes = &mut self.scratch.continuous.grazes;
        grazes.sort_unstable();
        grazes.dedup();
        let listed = self.contacts.mm.iter().map(|c| (c.a, c.b));
        let listed: HashSet<_> = listed.filter(|pair| grazes.binary_search(pair).is_ok()).collect();
        for (a, b) in grazes.iter().copied().filter(|pair| !listed.contains(pair)) {
            let center = [S::zero(); 2];
            let contact = marble_contact(&self.marbles, [a, b], center, S::max_value());
            self.contacts.mm.extend(contact);
        }
    }
}

/// Contact of two marbles, or of two spheres at `along` on the axes of capsules; none if they are
/// farther apart than `contact_distance` metres, or one that passes through the other.
#[inline]
pub(super) fn marble_contact<S: Scalar>(
    marbles: &Marbles<S>,
    [a, b]: [u32; 2],
    along: [S; 2],
    contact_distance: S,
) -> Option<Contact<S>> {
    if !marbles.may_collide(a, b) {
        return None;
    }
    let (first, second) = (a as usize, b as usize);
    let anchor = |row: usize, along: S| {
        if along == S::zero() { Vec3::zero() } else { marbles.axis(row) * along }
    };
    let anchors = [anchor(first, along[0]), anchor(second, along[1])];
    let core_offset = marbles.apart(first, second) + anchors[1] - anchors[0];
    let radii = [marbles.radius()[first], marbles.radius()[second]];
    let contact = Contact { along, ..Contact::between_marbles(a, b) }.placed(
        normal_and_distance(core_offset, [a, b]),
        radii,
        anchors,
    );
    (contact.separation <= contact_distance).then(|| Contact {
        feature: marbles.feature_at(first, along[0]) << 16 | marbles.feature_at(second, along[1]),
        material: marbles.contact_material(first, second),
        ..contact
    })
}

/// Closest points of two segments, as positions along their axes; for parallel ones, both ends of
/// their overlap, in the order of the ends of the second one, and true.
fn closest_points_of_segments<S: Scalar>(
    (first, x, half_x): (Sphere<S>, Vec3<S>, S),
    (second, y, half_y): (Sphere<S>, Vec3<S>, S),
) -> (SmallVec<[[S; 2]; 2]>, bool) {
    let apart = second.center - first.center;
    let clamp = |along: S, half: S| along.max(-half).min(half);
    let (cos, on_x, on_y) = (x.dot(y), apart.dot(x), apart.dot(y));
    let squared_sin = x.cross(y).magnitude2();
    // Nearly parallel segments have no stable closest point. They are not parallel if their ends
    // deviate by a good fraction of their radii.
    let slim = ((first.radius + second.radius) / half_x.min(half_y)).min(S::one());
    let parallel = squared_sin < slim * slim * S::from_f64(1e-3);
    if half_x > S::zero() && half_y > S::zero() && parallel {
        let ends = [-half_y, half_y].map(|end| clamp(on_x + cos * end, half_x));
        let samples = ends.map(|along| [along, clamp(cos * along - on_y, half_y)]);
        let mut both = SmallVec::from_slice(&samples[..1]);
        if samples[1] != samples[0] {
            both.push(samples[1]);
        }
        return (both, true);
    }
    let start = if squared_sin > S::zero() { (on_x - cos * on_y) / squared_sin } else { S::zero() };
    let on_second = clamp(cos * clamp(start, half_x) - on_y, half_y);
    let on_first = clamp(on_x + cos * on_second, half_x);
    (SmallVec::from_slice(&[[on_first, on_second]]), false)
}

/// Collects the sub-shapes of walls, except half-spaces, within `contact_distance` metres of a
/// sphere that its filter lets collide, in order.
pub(super) fn candidate_sub_shapes<S: Scalar>(
    walls: &Walls<S>,
    (sphere, filter): (&Sphere<S>, CollisionFilter),
    contact_distance: S,
    candidates: &mut Vec<Candidate<S>>,
) {
    let far = sphere.radius + contact_distance;
    let margin = Vec3::new(far, far, far);
    let bounds = Aabb { min: sphere.center - margin, max: sphere.center + margin };
    walls.for_each_colliding(&bounds, filter, |part| {
        let nearest = walls.project_point(part, sphere.center);
        let shape = &walls.shapes()[part.wall as usize];
        if nearest.distance <= far && !shape.is_behind_solid(part.index, &nearest) {
            candidates.push(Candidate { part, nearest });
        }
    });
    candidates.sort_unstable_by_key(|near| near.part);
    candidates.dedup_by_key(|near| near.part);
    // In the solid of a height field, only its nearest triangle gives the depth, however far it is.
    let under = |it: &&Candidate<S>| {
        let landscape = matches!(walls.shapes()[it.part.wall as usize], WallShape::HeightField(..));
        landscape && it.nearest.distance < S::zero()
    };
    let mut fields: SmallVec<[u32; 2]> =
        candidates.iter().filter(under).map(|it| it.part.wall).collect();
    fields.dedup();
    for wall in fields {
        let (index, nearest) = walls.shapes()[wall as usize].nearest_triangle(sphere.center);
        candidates.retain(|it| it.part.wall != wall);
        candidates.push(Candidate { part: SubShape { wall, index }, nearest });
        candidates.sort_unstable_by_key(|near| near.part);
    }
}

/// Distance from another wall, in metres, at which a point nearest to a sphere still counts as on it.
pub(super) fn flush_distance<S: Scalar>(sphere: &Sphere<S>) -> S {
    let largest = [sphere.center.x, sphere.center.y, sphere.center.z]
        .iter()
        .fold(sphere.radius, |most, x| most.max(x.abs()));
    let rounding = S::epsilon() * S::from_f64(4.0) * largest;
    (sphere.radius * S::from_f64(INTERNAL_EDGE_TOLERANCE)).max(rounding)
}

/// Removes ghost collisions at internal edges: keeps the contacts that a sphere would have if all
/// walls were one piece.
///
/// A contact whose nearest point lies in or on another wall is dropped: the other one is nearer,
/// and covers it. That holds for internal edges of flush boxes, of the triangles of a surface, and
/// of intersecting walls, whichever body they belong to. Two that cover each other have equal
/// nearest points, and one suffices.
pub(super) fn remove_ghost_collisions<S: Scalar>(
    walls: &Walls<S>,
    (sphere, filter): (&Sphere<S>, CollisionFilter),
    candidates: &mut Vec<Candidate<S>>,
) {
    let flush = flush_distance(sphere);
    let is_field = |it: &Candidate<S>| {
        matches!(walls.shapes()[it.part.wall as usize], WallShape::HeightField(..))
    };
    let distance = |point: &Candidate<S>, other: &Candidate<S>| {
        walls.project_point(other.part, point.nearest.point).distance
    };
    // In the solid of a height field a point is not in each of its triangles. Rounding may put one
    // there that is on the surface.
    let on = |point: &Candidate<S>, other: &Candidate<S>| {
        let distance = distance(point, other);
        if is_field(other) { distance.abs() <= flush } else { distance <= flush }
    };
    // Candidates are in the order of their walls.
    let is_buried = |it: &Candidate<S>| {
        let mut of_walls = candidates.chunk_by(|a, b| a.part.wall == b.part.wall);
        of_walls.any(|of_wall| {
            let is_other_field = of_wall[0].part.wall != it.part.wall && is_field(&of_wall[0]);
            is_other_field && of_wall.iter().all(|other| distance(it, other) < -flush)
        })
    };
    // Of thousands of triangles near a ball, few are near a point.
    let margin = Vec3::new(flush, flush, flush) * S::from_f64(4.0);
    let box_of = |it: &Candidate<S>| {
        let Aabb { min, max } =
            walls.shapes()[it.part.wall as usize].sub_shape_box(it.part.index)?;
        Some(Aabb { min: min - margin, max: max + margin })
    };
    let boxes: SmallVec<[Option<Aabb3<S>>; 8]> = candidates.iter().map(box_of).collect();
    let before = |x: &Candidate<S>, y: &Candidate<S>| {
        (x.nearest.distance, x.part) < (y.nearest.distance, y.part)
    };
    let is_hidden = |it: &Candidate<S>| {
        let mut planes = walls.colliding_planes(filter);
        is_buried(it) || planes.any(|(_, plane)| plane.signed_distance(it.nearest.point) <= flush)
    };
    let is_ghost = |it: &Candidate<S>| {
        let point = it.nearest.point;
        let is_near = |bounds: &Option<Aabb3<S>>| bounds.is_none_or(|it| it.contains_point(point));
        let near = candidates.iter().zip(&boxes).filter(|(_, bounds)| is_near(bounds));
        let mut others = near.map(|(other, _)| other).filter(|other| other.part != it.part);
        let covers = |other: &Candidate<S>| on(it, other) && (before(other, it) || !on(other, it));
        others.any(covers) || is_hidden(it)
    };
    let mut ghosts: SmallVec<[bool; 8]> = candidates.iter().map(is_ghost).collect();
    if ghosts.iter().all(|is_ghost| *is_ghost) {
        // Around a corner, each may lie on the next one, and none on all others: one of them touches.
        let open = (0..candidates.len()).filter(|i| !is_hidden(&candidates[*i]));
        let order = |i: &usize| (candidates[*i].nearest.distance, candidates[*i].part);
        if let Some(i) = open.reduce(|a, b| if order(&b) < order(&a) { b } else { a }) {
            ghosts[i] = false;
        }
    }
    let mut ghosts = ghosts.into_iter();
    candidates.retain(|_| ghosts.next() == Some(false));
}
