use cgmath::{EuclideanSpace, InnerSpace};

use super::closest::{
    ClosestPoints, LocalClosestPoints, closest_points, local_closest_points_within,
};
use super::core::{Convex, Core, CoreKind};
use super::manifold::{Manifold, manifold};
use super::ray_cast::RayHit;
use super::shape_cast::{ShapeCastHit, shape_cast};
use crate::frame::Ray;
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector, normalize_and_length};
use crate::shape::{Aabb, Aabb3, Sphere, Surface, Triangle};

/// Result for one triangle of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleResult<T> {
    /// Index of the triangle.
    pub triangle: u32,
    /// Result of the query, with the triangle as the first shape.
    pub result: T,
}

/// Expands a box by a margin.
fn expanded<S: Scalar>(bounds: Aabb3<S>, margin: S) -> Aabb3<S> {
    let more = Vec3::new(margin, margin, margin);
    Aabb { min: bounds.min - more, max: bounds.max + more }
}

/// Closest points of a surface and a convex shape, if within `margin` metres.
#[must_use]
pub fn closest_points_of_surface<S: Scalar>(
    surface: &impl Surface<S>,
    shape: &(impl Convex<S> + ?Sized),
    margin: S,
) -> Option<TriangleResult<ClosestPoints<S>>> {
    if let Some(sphere) = shape.as_sphere() {
        return closest_of_sphere(surface, &sphere, margin);
    }
    let origin = cast_point::<S, f64>(shape.center());
    let core = shape.core(origin);
    // Rounding must not hide a tie.
    let rounding = 1e-9 * core.size();
    let mut best: Option<(f64, u32, LocalClosestPoints)> = None;
    surface.for_each_in_box(&expanded(shape.bounding_box(), margin), |number| {
        let Some(triangle) = surface.triangle(number) else { return };
        let limit = best.map_or(margin.as_f64(), |(distance, ..)| distance + rounding);
        let triangle = triangle.core(origin);
        if distance_lower_bound(&triangle, &core) > limit {
            return;
        }
        if let Some(found) = local_closest_points_within(&triangle, &core, limit)
            && best.is_none_or(|(distance, other, _)| (found.distance, number) < (distance, other))
        {
            best = Some((found.distance, number, found));
        }
    });
    best.map(|(_, triangle, found)| TriangleResult { triangle, result: found.about(origin) })
}

fn closest_of_sphere<S: Scalar>(
    surface: &impl Surface<S>,
    sphere: &Sphere<S>,
    margin: S,
) -> Option<TriangleResult<ClosestPoints<S>>> {
    let origin = cast_point::<S, f64>(sphere.center);
    let mut best: Option<(f64, u32)> = None;
    let mut reach = sphere.radius + margin;
    surface.for_each_near(sphere.center, reach, |number| {
        let Some(triangle) = surface.triangle(number) else { return reach };
        let corners = triangle.corners.map(|corner| cast_point::<S, f64>(corner) - origin);
        let limit = best.map_or(f64::MAX, |(squared, _)| squared);
        // The plane may be too far already; with a tolerance for rounding.
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let height = corners[0].dot(normal);
        if height * height <= limit * normal.magnitude2() * (1.0 + 1e-9) {
            let corners = corners.map(EuclideanSpace::from_vec);
            let squared = Triangle { corners }.project_origin().to_vec().magnitude2();
            if best.is_none_or(|best| (squared, number) < best) {
                best = Some((squared, number));
                reach = S::from_f64(squared.sqrt());
            }
        }
        reach
    });
    let (_, triangle) = best?;
    let result = closest_points(&surface.triangle(triangle)?, sphere);
    (result.distance <= margin).then_some(TriangleResult { triangle, result })
}

/// Lower bound of the distance of a triangle and a shape: separation along the triangle's normal.
fn distance_lower_bound(triangle: &Core<'_>, core: &Core<'_>) -> f64 {
    let CoreKind::Triangle([a, b, c]) = &triangle.kind else { return f64::NEG_INFINITY };
    let Some((normal, _)) = normalize_and_length((b - a).cross(c - a)) else {
        return f64::NEG_INFINITY;
    };
    let height = |of: Vec3<f64>| (of - a).dot(normal);
    let above = height(core.support(-normal).0);
    let below = -height(core.support(normal).0);
    above.max(below) - core.radius
}

/// Contact manifolds of a convex shape on a surface, one per triangle at most `margin` metres away,
/// in the order of triangle indices.
#[must_use]
pub fn manifolds_of_surface<S: Scalar>(
    surface: &impl Surface<S>,
    shape: &(impl Convex<S> + ?Sized),
    margin: S,
) -> Vec<TriangleResult<Manifold<S>>> {
    let mut numbers = Vec::new();
    surface.for_each_in_box(&expanded(shape.bounding_box(), margin), |number| numbers.push(number));
    numbers.sort_unstable();
    numbers.dedup();
    let touches = numbers.into_iter().filter_map(|number| {
        let result = manifold(&surface.triangle(number)?, shape, margin);
        (!result.points.is_empty()).then_some(TriangleResult { triangle: number, result })
    });
    touches.collect()
}

/// First contact of a convex shape that translates along a line with a surface, if any; as
/// [`shape_cast`] of each of its triangles.
#[must_use]
pub fn shape_cast_on_surface<S: Scalar>(
    surface: &impl Surface<S>,
    shape: &(impl Convex<S> + ?Sized),
    translation: Vec3<S>,
) -> Option<TriangleResult<ShapeCastHit<S>>> {
    let (mut best, start): (Option<TriangleResult<ShapeCastHit<S>>>, _) =
        (None, shape.bounding_box());
    let end = Aabb { min: start.min + translation, max: start.max + translation };
    let still = Vec3::new(S::zero(), S::zero(), S::zero());
    surface.for_each_in_box(&start.union(&end), |number| {
        let triangle = surface.triangle(number);
        if let Some(result) = triangle.and_then(|it| shape_cast(&it, still, shape, translation)) {
            let key = |of: &TriangleResult<ShapeCastHit<S>>| (of.result.time, of.triangle);
            let next = TriangleResult { triangle: number, result };
            if best.as_ref().is_none_or(|best| key(&next) < key(best)) {
                best = Some(next);
            }
        }
    });
    best
}

/// First hit of a ray on a surface, from either side, within a distance.
///
/// Watertight: no ray slips between two triangles that share an edge, since both test the edge
/// alike (Woop, Benthin and Wald, *Watertight ray/triangle intersection*, 2013).
#[must_use]
pub fn ray_cast_on_surface<S: Scalar>(
    surface: &impl Surface<S>,
    ray: &Ray<S>,
    max_distance: S,
) -> Option<TriangleResult<RayHit<S>>> {
    // The ray ends beyond the bounds.
    let bounds = surface.bounds();
    let far = bounds.max - bounds.min;
    let reach = (bounds.center() - ray.origin).magnitude() + far.magnitude();
    let motion = ray.direction * reach.min(max_distance);
    let mut best: Option<TriangleResult<RayHit<S>>> = None;
    surface.for_each_on_segment(ray.origin, motion, |number| {
        let Some(triangle) = surface.triangle(number) else { return };
        if let Some(result) = intersect_triangle(triangle.corners, ray, max_distance) {
            let key = |of: &TriangleResult<RayHit<S>>| (of.result.distance, of.triangle);
            let next = TriangleResult { triangle: number, result };
            if best.as_ref().is_none_or(|best| key(&next) < key(best)) {
                best = Some(next);
            }
        }
    });
    best
}

fn intersect_triangle<S: Scalar>(
    corners: [Point3<S>; 3],
    ray: &Ray<S>,
    max_distance: S,
) -> Option<RayHit<S>> {
    let origin = cast_point::<S, f64>(ray.origin);
    let (along, _) = normalize_and_length(cast_vector::<S, f64>(ray.direction))?;
    let [a, b, c] = corners.map(|corner| cast_point::<S, f64>(corner) - origin);
    // Sheared so that the ray runs along its dominant axis.
    let z = (1..3).fold(0, |most, i| if along[i].abs() > along[most].abs() { i } else { most });
    let (x, y) = ((z + 1) % 3, (z + 2) % 3);
    let flat =
        |p: Vec3<f64>| (p[x] - p[z] * (along[x] / along[z]), p[y] - p[z] * (along[y] / along[z]));
    let [(ax, ay), (bx, by), (cx, cy)] = [a, b, c].map(flat);
    let weights = [cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax];
    let outside = weights.iter().any(|w| *w < 0.0) && weights.iter().any(|w| *w > 0.0);
    let sum: f64 = weights.iter().sum();
    if outside || sum == 0.0 || sum.is_nan() {
        return None;
    }
    let at = (a * weights[0] + b * weights[1] + c * weights[2]) / sum;
    let distance = at.dot(along);
    let (normal, _) = normalize_and_length((b - a).cross(c - a))?;
    (distance >= 0.0 && distance <= max_distance.as_f64()).then(|| RayHit {
        distance: S::from_f64(distance),
        point: cast_point(origin + along * distance),
        normal: cast_vector(if normal.dot(along) > 0.0 { -normal } else { normal }),
    })
}
