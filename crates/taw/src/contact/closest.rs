use cgmath::{EuclideanSpace, InnerSpace};

use super::box_box::{BoxAxis, boxes};
use super::brute_force;
use super::core::{Convex, Core, CoreKind};
use super::epa::penetration;
use super::gjk::{Gjk, gjk};
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector, normalize_and_length};
use crate::shape::{BoundedShape, Plane, Triangle};

/// Closest points of two shapes, or their deepest points if they overlap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoints<S> {
    /// Distance in metres; negative if they overlap: then it is the penetration depth, by which the
    /// second must move along the normal to only touch.
    pub distance: S,
    /// Unit vector from the first to the second.
    pub normal: Vec3<S>,
    /// Closest point on the first.
    pub on_a: Point3<S>,
    /// Closest point on the second: `on_a + normal * distance`.
    pub on_b: Point3<S>,
}

impl<S: Scalar> ClosestPoints<S> {
    /// Swaps the two shapes.
    #[must_use]
    pub fn swapped(self) -> Self {
        Self { normal: -self.normal, on_a: self.on_b, on_b: self.on_a, ..self }
    }

    /// Returns true if the two shapes have a point in common.
    #[must_use]
    pub fn touching(&self) -> bool {
        self.distance <= S::zero()
    }

    /// Minimum translation vector of the second shape, if they touch.
    #[must_use]
    pub fn mtv(&self) -> Option<Vec3<S>> {
        self.touching().then(|| self.normal * -self.distance)
    }
}

/// Closest points of two convex shapes, or deepest points if they overlap. Swapping the arguments
/// swaps the result to the bit, unless both have equal centers and bounds.
///
/// A sphere uses the point projection onto the other shape, two capsules the closest points of two
/// segments. Overlapping boxes use the separating axis test (Gottschalk, Lin and Manocha 1996). All
/// others use GJK for the distance (Gilbert, Johnson and Keerthi 1988) and EPA for the penetration
/// (van den Bergen 2001). Both keep a lower and an upper bound and end when these agree; where they
/// do not, brute force compares all vertices, edges and faces.
#[must_use]
pub fn closest_points<S: Scalar>(
    a: &(impl Convex<S> + ?Sized),
    b: &(impl Convex<S> + ?Sized),
) -> ClosestPoints<S> {
    if let (Some(a), Some(b)) = (a.as_sphere(), b.as_sphere()) {
        let apart = normalize_and_length(b.center - a.center);
        let some = if b.radius < a.radius { -Vec3::unit_x() } else { Vec3::unit_x() };
        let (normal, far) = apart.unwrap_or((some, S::zero()));
        let (on_a, on_b) = (a.center + normal * a.radius, b.center - normal * b.radius);
        return ClosestPoints { distance: far - (a.radius + b.radius), normal, on_a, on_b };
    }
    if let Some(sphere) = b.as_sphere() {
        let near = a.project_point(sphere.center);
        let on_b = sphere.center - near.normal * sphere.radius;
        let distance = near.distance - sphere.radius;
        return ClosestPoints { distance, normal: near.normal, on_a: near.point, on_b };
    }
    if a.as_sphere().is_some() {
        return closest_points(b, a).swapped();
    }
    if should_swap(a, b) {
        closest_points_in_order(b, a).swapped()
    } else {
        closest_points_in_order(a, b)
    }
}

/// Returns true if the arguments are to be swapped, so that among equally good results the same one
/// is chosen in either order.
pub(super) fn should_swap<S: Scalar>(
    a: &(impl Convex<S> + ?Sized),
    b: &(impl Convex<S> + ?Sized),
) -> bool {
    let list = |p: Point3<S>| [p.x, p.y, p.z];
    let (first, second) = (list(a.center()), list(b.center()));
    if first != second {
        return second < first;
    }
    let (first, second) = (a.bounding_box(), b.bounding_box());
    [list(second.min), list(second.max)] < [list(first.min), list(first.max)]
}

fn closest_points_in_order<S: Scalar>(
    a: &(impl Convex<S> + ?Sized),
    b: &(impl Convex<S> + ?Sized),
) -> ClosestPoints<S> {
    let origin = cast_point::<S, f64>(a.center());
    local_closest_points(&a.core(origin), &b.core(origin)).about(origin)
}

/// Closest points without shortcuts: the readable reference for [`closest_points`].
#[must_use]
pub fn closest_points_brute_force<S: Scalar>(
    a: &(impl Convex<S> + ?Sized),
    b: &(impl Convex<S> + ?Sized),
) -> ClosestPoints<S> {
    let origin = cast_point::<S, f64>(a.center());
    let (a, b) = (a.core(origin), b.core(origin));
    brute_force::local_closest_points(&a, &b).with_radii(a.radius, b.radius).about(origin)
}

/// Closest points of a half-space and a bounded shape, or deepest points if they overlap.
#[must_use]
pub fn closest_points_of_plane<S: Scalar>(
    plane: &Plane<S>,
    shape: &impl BoundedShape<S>,
) -> ClosestPoints<S> {
    let normal = plane.normal();
    let on_b = shape.support(-normal);
    let distance = plane.signed_distance(on_b);
    ClosestPoints { distance, normal, on_a: on_b - normal * distance, on_b }
}

/// [`ClosestPoints`] relative to an origin, in `f64`.
#[derive(Clone, Copy, Debug)]
pub(super) struct LocalClosestPoints {
    pub distance: f64,
    pub normal: Vec3<f64>,
    pub on_a: Vec3<f64>,
    pub on_b: Vec3<f64>,
}

impl LocalClosestPoints {
    fn with_radii(self, a: f64, b: f64) -> Self {
        Self {
            distance: self.distance - a - b,
            on_a: self.on_a + self.normal * a,
            on_b: self.on_b - self.normal * b,
            ..self
        }
    }

    pub fn about<S: Scalar>(self, origin: Point3<f64>) -> ClosestPoints<S> {
        ClosestPoints {
            distance: S::from_f64(self.distance),
            normal: cast_vector(self.normal),
            on_a: cast_point(origin + self.on_a),
            on_b: cast_point(origin + self.on_b),
        }
    }
}

/// Largest difference of the lower and upper bound of a distance, relative to the size of both.
pub(super) const TOLERANCE: f64 = 1e-12;

/// Closest points of two cores with their radii.
pub(super) fn local_closest_points(a: &Core<'_>, b: &Core<'_>) -> LocalClosestPoints {
    local_closest_points_within(a, b, f64::INFINITY)
        .unwrap_or_else(|| brute_force::local_closest_points(a, b).with_radii(a.radius, b.radius))
}

/// Closest points of two cores with their radii; none beyond a distance limit.
pub(super) fn local_closest_points_within(
    a: &Core<'_>,
    b: &Core<'_>,
    limit: f64,
) -> Option<LocalClosestPoints> {
    let found = core_distance(a, b, limit)?.local_closest_points(a, b);
    Some(found.with_radii(a.radius, b.radius))
}

/// Closest points of two cores without their radii; none if the distance with radii is beyond a
/// limit.
pub(super) fn core_distance(a: &Core<'_>, b: &Core<'_>, limit: f64) -> Option<CoreDistance> {
    let (size, limit) = (a.size() + b.size(), limit + a.radius + b.radius);
    let found = match (&a.kind, &b.kind) {
        (CoreKind::Segment(a), CoreKind::Segment(b)) => {
            closest_points_of_segments(*a, *b, size, limit)
        }
        (CoreKind::Triangle(corners), CoreKind::Point(point)) => {
            closest_points_of_triangle_and_point(*corners, *point)
        }
        (CoreKind::Cuboid(x), CoreKind::Cuboid(y)) => {
            let axis = boxes(x, y, size);
            if axis.distance > limit {
                return None;
            }
            if axis.distance <= TOLERANCE * size {
                return Some(CoreDistance::Overlap(axis));
            }
            gjk(a, b, -axis.normal, size, limit)
        }
        _ => gjk(a, b, a.inside() - b.inside(), size, limit),
    };
    let between = match found {
        Gjk::OutOfRange => return None,
        Gjk::Separated(between) => Some(between),
        Gjk::Overlapping(simplex) => penetration(a, b, simplex, size),
        Gjk::NotConverged => None,
    };
    let between = between.unwrap_or_else(|| brute_force::local_closest_points(a, b));
    (between.distance <= limit).then_some(CoreDistance::LocalClosestPoints(between))
}

/// Distance of two cores; for overlapping boxes only the separating axis, without the points.
pub(super) enum CoreDistance {
    LocalClosestPoints(LocalClosestPoints),
    Overlap(BoxAxis),
}

impl CoreDistance {
    pub fn normal(&self) -> Vec3<f64> {
        match self {
            Self::LocalClosestPoints(between) => between.normal,
            Self::Overlap(axis) => axis.normal,
        }
    }

    pub fn distance(&self) -> f64 {
        match self {
            Self::LocalClosestPoints(between) => between.distance,
            Self::Overlap(axis) => axis.distance,
        }
    }

    pub fn local_closest_points(&self, a: &Core<'_>, b: &Core<'_>) -> LocalClosestPoints {
        match self {
            Self::LocalClosestPoints(between) => *between,
            Self::Overlap(axis) => axis.with_points(a, b),
        }
    }
}

fn closest_points_of_triangle_and_point(corners: [Vec3<f64>; 3], point: Vec3<f64>) -> Gjk {
    let near =
        Triangle { corners: corners.map(Point3::from_vec) }.project_point(Point3::from_vec(point));
    let (normal, on_a) = (near.normal, near.point.to_vec());
    Gjk::Separated(LocalClosestPoints { distance: near.distance, normal, on_a, on_b: point })
}

/// Closest points of two segments, unless they cross (Ericson, *Real-Time Collision Detection*,
/// 2005, §5.1.9).
fn closest_points_of_segments(
    [p, q]: [Vec3<f64>; 2],
    [r, s]: [Vec3<f64>; 2],
    size: f64,
    limit: f64,
) -> Gjk {
    let (first, second, apart) = (q - p, s - r, p - r);
    let (squared_a, squared_b) = (first.magnitude2(), second.magnitude2());
    let fraction = |x: f64, of: f64| if of > 0.0 { (x / of).clamp(0.0, 1.0) } else { 0.0 };
    let (c, f, both) = (first.dot(apart), second.dot(apart), first.dot(second));
    let mut on_first = fraction(both * f - c * squared_b, squared_a * squared_b - both * both);
    let wanted = both * on_first + f;
    let on_second = fraction(wanted, squared_b);
    if wanted < 0.0 || wanted > squared_b {
        on_first = fraction(both * on_second - c, squared_a);
    }
    let (on_a, on_b) = (p + first * on_first, r + second * on_second);
    if (on_b - on_a).magnitude2() > limit * limit * (1.0 + 1e-12) {
        return Gjk::OutOfRange;
    }
    let Some((normal, distance)) = normalize_and_length(on_b - on_a) else {
        return Gjk::NotConverged;
    };
    // The plane across the normal gives a lower bound.
    let lower_bound = r.dot(normal).min(s.dot(normal)) - p.dot(normal).max(q.dot(normal));
    let converged = distance - lower_bound <= TOLERANCE * size && distance > 1e-6 * size;
    if converged {
        Gjk::Separated(LocalClosestPoints { distance, normal, on_a, on_b })
    } else {
        Gjk::NotConverged
    }
}
