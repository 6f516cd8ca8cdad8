use cgmath::{EuclideanSpace, InnerSpace};

use super::closest::{Between, Closest, between_within, closest};
use super::core::{Convex, Core, Kind};
use super::manifold::{Manifold, manifold};
use super::ray::RayHit;
use super::sweep::{Touch, sweep};
use crate::frame::Ray;
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector, direction_and_length};
use crate::shape::{Aabb, Box3, Sphere, Surface, Triangle};

/// What one triangle of a surface says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OfTriangle<T> {
    /// Its number.
    pub triangle: u32,
    /// The answer, with the triangle as the first and the shape as the second.
    pub answer: T,
}

/// A box, and a margin around it.
fn around<S: Scalar>(bounds: Box3<S>, margin: S) -> Box3<S> {
    let more = Vec3::new(margin, margin, margin);
    Aabb { min: bounds.min - more, max: bounds.max + more }
}

/// Where a surface is nearest to a convex shape, or deepest in it, if that is within
/// `margin` metres.
#[must_use]
pub fn closest_of_surface<S: Scalar>(
    surface: &impl Surface<S>,
    shape: &(impl Convex<S> + ?Sized),
    margin: S,
) -> Option<OfTriangle<Closest<S>>> {
    if let Some(sphere) = shape.as_sphere() {
        return closest_of_sphere(surface, &sphere, margin);
    }
    let origin = cast_point::<S, f64>(shape.middle());
    let core = shape.core(origin);
    // Rounding must not hide who is as near.
    let rounding = 1e-9 * core.size();
    let mut best: Option<(f64, u32, Between)> = None;
    surface.near(&around(shape.bounding_box(), margin), |number| {
        let Some(triangle) = surface.triangle(number) else { return };
        let limit = best.map_or(margin.as_f64(), |(distance, ..)| distance + rounding);
        let triangle = triangle.core(origin);
        if at_least(&triangle, &core) > limit {
            return;
        }
        if let Some(found) = between_within(&triangle, &core, limit)
            && best.is_none_or(|(distance, other, _)| (found.distance, number) < (distance, other))
        {
            best = Some((found.distance, number, found));
        }
    });
    best.map(|(_, triangle, found)| OfTriangle { triangle, answer: found.about(origin) })
}

fn closest_of_sphere<S: Scalar>(
    surface: &impl Surface<S>,
    sphere: &Sphere<S>,
    margin: S,
) -> Option<OfTriangle<Closest<S>>> {
    let origin = cast_point::<S, f64>(sphere.center);
    let mut best: Option<(f64, u32)> = None;
    let mut reach = sphere.radius + margin;
    surface.around(sphere.center, reach, |number| {
        let Some(triangle) = surface.triangle(number) else { return reach };
        let corners = triangle.corners.map(|corner| cast_point::<S, f64>(corner) - origin);
        let limit = best.map_or(f64::MAX, |(squared, _)| squared);
        // Its plane may be too far already; with room for rounding.
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let height = corners[0].dot(normal);
        if height * height <= limit * normal.magnitude2() * (1.0 + 1e-9) {
            let corners = corners.map(EuclideanSpace::from_vec);
            let squared = Triangle { corners }.closest_to_origin().to_vec().magnitude2();
            if best.is_none_or(|best| (squared, number) < best) {
                best = Some((squared, number));
                reach = S::constant(squared.sqrt());
            }
        }
        reach
    });
    let (_, triangle) = best?;
    let answer = closest(&surface.triangle(triangle)?, sphere);
    (answer.distance <= margin).then_some(OfTriangle { triangle, answer })
}

/// How far a triangle and a shape are apart at least: along the normal of the triangle.
fn at_least(triangle: &Core<'_>, core: &Core<'_>) -> f64 {
    let Kind::Triangle([a, b, c]) = &triangle.kind else { return f64::NEG_INFINITY };
    let Some((normal, _)) = direction_and_length((b - a).cross(c - a)) else {
        return f64::NEG_INFINITY;
    };
    let height = |of: Vec3<f64>| (of - a).dot(normal);
    let above = height(core.support(-normal).0);
    let below = -height(core.support(normal).0);
    above.max(below) - core.radius
}

/// Where a convex shape touches a surface, or is at most `margin` metres from it: triangle
/// by triangle, in the order of their numbers.
#[must_use]
pub fn manifolds_of_surface<S: Scalar>(
    surface: &impl Surface<S>,
    shape: &(impl Convex<S> + ?Sized),
    margin: S,
) -> Vec<OfTriangle<Manifold<S>>> {
    let mut numbers = Vec::new();
    surface.near(&around(shape.bounding_box(), margin), |number| numbers.push(number));
    numbers.sort_unstable();
    numbers.dedup();
    let touches = numbers.into_iter().filter_map(|number| {
        let answer = manifold(&surface.triangle(number)?, shape, margin);
        (!answer.points.is_empty()).then_some(OfTriangle { triangle: number, answer })
    });
    touches.collect()
}

/// When a convex shape that moves along a line, without turning, first touches a surface, if
/// it does; as [`sweep`] of each of its triangles.
#[must_use]
pub fn sweep_against_surface<S: Scalar>(
    surface: &impl Surface<S>,
    shape: &(impl Convex<S> + ?Sized),
    moves: Vec3<S>,
) -> Option<OfTriangle<Touch<S>>> {
    let (mut best, start): (Option<OfTriangle<Touch<S>>>, _) = (None, shape.bounding_box());
    let end = Aabb { min: start.min + moves, max: start.max + moves };
    let still = Vec3::new(S::zero(), S::zero(), S::zero());
    surface.near(&start.union(&end), |number| {
        let triangle = surface.triangle(number);
        if let Some(answer) = triangle.and_then(|it| sweep(&it, still, shape, moves)) {
            let key = |of: &OfTriangle<Touch<S>>| (of.answer.time, of.triangle);
            let next = OfTriangle { triangle: number, answer };
            if best.as_ref().is_none_or(|best| key(&next) < key(best)) {
                best = Some(next);
            }
        }
    });
    best
}

/// Where a ray first meets a surface, from whichever side, within a distance.
///
/// No ray slips between two triangles that share an edge: both count the edge alike (Woop,
/// Benthin and Wald, *Watertight ray/triangle intersection*, 2013).
#[must_use]
pub fn cast_on_surface<S: Scalar>(
    surface: &impl Surface<S>,
    ray: &Ray<S>,
    longest: S,
) -> Option<OfTriangle<RayHit<S>>> {
    // Beyond the surface there is none of it.
    let bounds = surface.bounds();
    let far = bounds.max - bounds.min;
    let reach = (bounds.center() - ray.origin).magnitude() + far.magnitude();
    let motion = ray.direction * reach.min(longest);
    let mut best: Option<OfTriangle<RayHit<S>>> = None;
    surface.along(ray.origin, motion, |number| {
        let Some(triangle) = surface.triangle(number) else { return };
        if let Some(answer) = meet(triangle.corners, ray, longest) {
            let key = |of: &OfTriangle<RayHit<S>>| (of.answer.distance, of.triangle);
            let next = OfTriangle { triangle: number, answer };
            if best.as_ref().is_none_or(|best| key(&next) < key(best)) {
                best = Some(next);
            }
        }
    });
    best
}

fn meet<S: Scalar>(corners: [Point3<S>; 3], ray: &Ray<S>, longest: S) -> Option<RayHit<S>> {
    let origin = cast_point::<S, f64>(ray.origin);
    let (along, _) = direction_and_length(cast_vector::<S, f64>(ray.direction))?;
    let [a, b, c] = corners.map(|corner| cast_point::<S, f64>(corner) - origin);
    // Sheared so that the ray runs along its greatest axis.
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
    let (normal, _) = direction_and_length((b - a).cross(c - a))?;
    (distance >= 0.0 && distance <= longest.as_f64()).then(|| RayHit {
        distance: S::constant(distance),
        point: cast_point(origin + along * distance),
        normal: cast_vector(if normal.dot(along) > 0.0 { -normal } else { normal }),
    })
}
