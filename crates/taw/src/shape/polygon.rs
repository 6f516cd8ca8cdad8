//! Planar convex polygons: the faces of hulls.

use cgmath::{EuclideanSpace, InnerSpace};

use crate::math::{Point3, Scalar, Vec3, normalize_and_length};

/// The unit normal of a counterclockwise polygon (Newell; Sutherland, Sproull and Schumacker 1974),
/// also with many collinear vertices.
pub(crate) fn normal_of_polygon<S: Scalar>(corners: &[Point3<S>]) -> Vec3<S> {
    let first = corners.first().copied().unwrap_or_else(Point3::origin);
    let ends = corners.iter().skip(1).chain(corners.first());
    let twice =
        corners.iter().zip(ends).fold(Vec3::new(S::zero(), S::zero(), S::zero()), |n, (a, b)| {
            n + (*a - first).cross(*b - first)
        });
    normalize_and_length(twice).map_or_else(Vec3::unit_x, |(normal, _)| normal)
}

/// The point of a polygon that is nearest to a given point.
pub(crate) fn project_on_polygon<S: Scalar>(
    corners: &[Point3<S>],
    normal: Vec3<S>,
    point: Point3<S>,
) -> Point3<S> {
    let ends = || corners.iter().skip(1).chain(corners.first());
    let outside =
        |(a, b): (&Point3<S>, &Point3<S>)| (*b - *a).cross(normal).dot(point - *a) > S::zero();
    if let Some(first) = corners.first()
        && !corners.iter().zip(ends()).any(outside)
    {
        return point - normal * (point - *first).dot(normal);
    }
    let mut best = (S::infinity(), point);
    for (a, b) in corners.iter().zip(ends()) {
        let there = project_on_segment(*a, *b, point);
        let squared = (there - point).magnitude2();
        if squared < best.0 {
            best = (squared, there);
        }
    }
    best.1
}

/// The point of a segment that is nearest to a given point.
pub(crate) fn project_on_segment<S: Scalar>(
    a: Point3<S>,
    b: Point3<S>,
    point: Point3<S>,
) -> Point3<S> {
    let along = b - a;
    let squared = along.magnitude2();
    if squared <= S::zero() {
        return a;
    }
    let part = (point - a).dot(along) / squared;
    if part <= S::zero() {
        a
    } else if part >= S::one() {
        b
    } else {
        a + along * part
    }
}
