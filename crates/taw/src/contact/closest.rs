use cgmath::{EuclideanSpace, InnerSpace};

use super::boxes::{BoxAxis, boxes};
use super::core::{Convex, Core, Kind};
use super::exhaustive;
use super::gjk::{Gjk, gjk};
use super::polytope::way_out;
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector, direction_and_length};
use crate::shape::{Plane, Solid, Triangle};

/// Where two things are nearest to each other, or deepest in each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest<S> {
    /// How far they are apart, in metres; negative if they overlap: then it is how far the
    /// second must move along the normal to only touch.
    pub distance: S,
    /// From the first toward the second, a unit vector.
    pub normal: Vec3<S>,
    /// On the surface of the first.
    pub on_a: Point3<S>,
    /// On the surface of the second: `on_a + normal * distance`.
    pub on_b: Point3<S>,
}

impl<S: Scalar> Closest<S> {
    /// The same, with the second one first.
    #[must_use]
    pub fn swapped(self) -> Self {
        Self { normal: -self.normal, on_a: self.on_b, on_b: self.on_a, ..self }
    }

    /// Whether the two have a point in common.
    #[must_use]
    pub fn touching(&self) -> bool {
        self.distance <= S::zero()
    }

    /// The shortest displacement that takes the second out of the first, if they touch.
    #[must_use]
    pub fn mtv(&self) -> Option<Vec3<S>> {
        self.touching().then(|| self.normal * -self.distance)
    }
}

/// Where two convex shapes are nearest to each other, or deepest in each other. Swapping
/// them swaps the answer, to the bit, unless both have the very same middle and bounds.
///
/// A sphere is asked for the nearest point of the other shape, and two capsules for the
/// nearest points of two lines. Of boxes that overlap, fifteen directions say where the way
/// out is shortest (separating axes; Gottschalk, Lin and Manocha 1996). All others go by the
/// corners that are farthest in some directions: the distance by Gilbert, Johnson and
/// Keerthi (1988), the way out by an expanding polytope (van den Bergen 2001). Both give a
/// bound from below and one from above, and end when these agree; where they do not, all
/// corners, edges and faces are compared with each other.
#[must_use]
pub fn closest<S: Scalar>(
    a: &(impl Convex<S> + ?Sized),
    b: &(impl Convex<S> + ?Sized),
) -> Closest<S> {
    if let (Some(a), Some(b)) = (a.as_sphere(), b.as_sphere()) {
        let apart = direction_and_length(b.center - a.center);
        let some = if b.radius < a.radius { -Vec3::unit_x() } else { Vec3::unit_x() };
        let (normal, far) = apart.unwrap_or((some, S::zero()));
        let (on_a, on_b) = (a.center + normal * a.radius, b.center - normal * b.radius);
        return Closest { distance: far - (a.radius + b.radius), normal, on_a, on_b };
    }
    if let Some(sphere) = b.as_sphere() {
        let near = a.nearest(sphere.center);
        let on_b = sphere.center - near.normal * sphere.radius;
        let distance = near.distance - sphere.radius;
        return Closest { distance, normal: near.normal, on_a: near.point, on_b };
    }
    if a.as_sphere().is_some() {
        return closest(b, a).swapped();
    }
    if swaps(a, b) { closest_in_order(b, a).swapped() } else { closest_in_order(a, b) }
}

/// Whether two shapes are asked about the other way round, so that where several answers are
/// as good it is always the same one.
pub(super) fn swaps<S: Scalar>(
    a: &(impl Convex<S> + ?Sized),
    b: &(impl Convex<S> + ?Sized),
) -> bool {
    let list = |p: Point3<S>| [p.x, p.y, p.z];
    let (first, second) = (list(a.middle()), list(b.middle()));
    if first != second {
        return second < first;
    }
    let (first, second) = (a.bounding_box(), b.bounding_box());
    [list(second.min), list(second.max)] < [list(first.min), list(first.max)]
}

fn closest_in_order<S: Scalar>(
    a: &(impl Convex<S> + ?Sized),
    b: &(impl Convex<S> + ?Sized),
) -> Closest<S> {
    let origin = cast_point::<S, f64>(a.middle());
    between(&a.core(origin), &b.core(origin)).about(origin)
}

/// What [`closest`] would say without its short cuts: the readable version, for comparison.
#[must_use]
pub fn closest_exhaustive<S: Scalar>(
    a: &(impl Convex<S> + ?Sized),
    b: &(impl Convex<S> + ?Sized),
) -> Closest<S> {
    let origin = cast_point::<S, f64>(a.middle());
    let (a, b) = (a.core(origin), b.core(origin));
    exhaustive::between(&a, &b).with_radii(a.radius, b.radius).about(origin)
}

/// Where a half-space and a bounded shape are nearest to each other, or deepest in each
/// other.
#[must_use]
pub fn closest_plane<S: Scalar>(plane: &Plane<S>, shape: &impl Solid<S>) -> Closest<S> {
    let normal = plane.normal();
    let on_b = shape.support(-normal);
    let distance = plane.signed_distance(on_b);
    Closest { distance, normal, on_a: on_b - normal * distance, on_b }
}

/// [`Closest`] about an origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Between {
    pub distance: f64,
    pub normal: Vec3<f64>,
    pub on_a: Vec3<f64>,
    pub on_b: Vec3<f64>,
}

impl Between {
    fn with_radii(self, a: f64, b: f64) -> Self {
        Self {
            distance: self.distance - a - b,
            on_a: self.on_a + self.normal * a,
            on_b: self.on_b - self.normal * b,
            ..self
        }
    }

    pub fn about<S: Scalar>(self, origin: Point3<f64>) -> Closest<S> {
        Closest {
            distance: S::constant(self.distance),
            normal: cast_vector(self.normal),
            on_a: cast_point(origin + self.on_a),
            on_b: cast_point(origin + self.on_b),
        }
    }
}

/// So far from each other, as a part of their size, may the bounds of a distance be.
pub(super) const CERTAIN: f64 = 1e-12;

/// Where two cores, with their radii, are nearest or deepest.
pub(super) fn between(a: &Core<'_>, b: &Core<'_>) -> Between {
    between_within(a, b, f64::INFINITY)
        .unwrap_or_else(|| exhaustive::between(a, b).with_radii(a.radius, b.radius))
}

/// The same, unless they are farther apart than a limit.
pub(super) fn between_within(a: &Core<'_>, b: &Core<'_>, limit: f64) -> Option<Between> {
    let found = within(a, b, limit)?.between(a, b);
    Some(found.with_radii(a.radius, b.radius))
}

/// Where two cores, without their radii, are nearest or deepest, unless they, with their
/// radii, are farther apart than a limit.
pub(super) fn within(a: &Core<'_>, b: &Core<'_>, limit: f64) -> Option<Found> {
    let (size, limit) = (a.size() + b.size(), limit + a.radius + b.radius);
    let found = match (&a.kind, &b.kind) {
        (Kind::Segment(a), Kind::Segment(b)) => segments(*a, *b, size, limit),
        (Kind::Triangle(corners), Kind::Point(point)) => over_triangle(*corners, *point),
        (Kind::Cuboid(x), Kind::Cuboid(y)) => {
            let axis = boxes(x, y, size);
            if axis.distance > limit {
                return None;
            }
            if axis.distance <= CERTAIN * size {
                return Some(Found::Overlap(axis));
            }
            gjk(a, b, -axis.normal, size, limit)
        }
        _ => gjk(a, b, a.inside() - b.inside(), size, limit),
    };
    let between = match found {
        Gjk::Beyond => return None,
        Gjk::Apart(between) => Some(between),
        Gjk::Together(simplex) => way_out(a, b, simplex, size),
        Gjk::Unsure => None,
    };
    let between = between.unwrap_or_else(|| exhaustive::between(a, b));
    (between.distance <= limit).then_some(Found::Between(between))
}

/// Where two cores are nearest or deepest; of boxes that overlap, without the points.
pub(super) enum Found {
    Between(Between),
    Overlap(BoxAxis),
}

impl Found {
    pub fn normal(&self) -> Vec3<f64> {
        match self {
            Self::Between(between) => between.normal,
            Self::Overlap(axis) => axis.normal,
        }
    }

    pub fn distance(&self) -> f64 {
        match self {
            Self::Between(between) => between.distance,
            Self::Overlap(axis) => axis.distance,
        }
    }

    pub fn between(&self, a: &Core<'_>, b: &Core<'_>) -> Between {
        match self {
            Self::Between(between) => *between,
            Self::Overlap(axis) => axis.with_points(a, b),
        }
    }
}

fn over_triangle(corners: [Vec3<f64>; 3], point: Vec3<f64>) -> Gjk {
    let near = Triangle { corners: corners.map(Point3::from_vec) }.nearest(Point3::from_vec(point));
    let (normal, on_a) = (near.normal, near.point.to_vec());
    Gjk::Apart(Between { distance: near.distance, normal, on_a, on_b: point })
}

/// Where two segments are nearest, unless they cross (Ericson, *Real-Time Collision
/// Detection*, 2005, §5.1.9).
fn segments([p, q]: [Vec3<f64>; 2], [r, s]: [Vec3<f64>; 2], size: f64, limit: f64) -> Gjk {
    let (first, second, apart) = (q - p, s - r, p - r);
    let (long_a, long_b) = (first.magnitude2(), second.magnitude2());
    let part = |x: f64, of: f64| if of > 0.0 { (x / of).clamp(0.0, 1.0) } else { 0.0 };
    let (c, f, both) = (first.dot(apart), second.dot(apart), first.dot(second));
    let mut on_first = part(both * f - c * long_b, long_a * long_b - both * both);
    let wanted = both * on_first + f;
    let on_second = part(wanted, long_b);
    if wanted < 0.0 || wanted > long_b {
        on_first = part(both * on_second - c, long_a);
    }
    let (on_a, on_b) = (p + first * on_first, r + second * on_second);
    if (on_b - on_a).magnitude2() > limit * limit * (1.0 + 1e-12) {
        return Gjk::Beyond;
    }
    let Some((normal, distance)) = direction_and_length(on_b - on_a) else { return Gjk::Unsure };
    // What a plane across says is a bound from below.
    let below = r.dot(normal).min(s.dot(normal)) - p.dot(normal).max(q.dot(normal));
    let certain = distance - below <= CERTAIN * size && distance > 1e-6 * size;
    if certain { Gjk::Apart(Between { distance, normal, on_a, on_b }) } else { Gjk::Unsure }
}
