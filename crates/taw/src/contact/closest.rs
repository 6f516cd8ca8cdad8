use cgmath::{EuclideanSpace, InnerSpace};

use super::axes::{Axis, PARALLEL, widest_axis};
use super::manifold::contact_points;
use super::skeleton::{Convex, Skeleton};
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector, direction_and_length};
use crate::shape::across;
use crate::shape::polygon::{closest_of_polygon, closest_of_segment};
use crate::shape::{Plane, Solid};

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
/// them swaps the answer, to the bit, unless both have the very same middle.
///
/// A sphere is asked for the nearest point of the other shape. Of others that are apart,
/// all corners are compared with all faces and all edges with each other; of those that
/// overlap, the directions of faces and of pairs of edges say where the way out is
/// shortest (separating axes; Gottschalk, Lin and Manocha 1996). This is the readable
/// version, exact but for rounding, without iterations.
#[must_use]
pub fn closest<S: Scalar>(
    a: &(impl Convex<S> + ?Sized),
    b: &(impl Convex<S> + ?Sized),
) -> Closest<S> {
    if let (Some(a), Some(b)) = (a.as_sphere(), b.as_sphere()) {
        let apart = direction_and_length(b.center - a.center);
        let (normal, far) = apart.unwrap_or((Vec3::unit_x(), S::zero()));
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
    let (first, second) = (a.middle(), b.middle());
    [second.x, second.y, second.z] < [first.x, first.y, first.z]
}

fn closest_in_order<S: Scalar>(
    a: &(impl Convex<S> + ?Sized),
    b: &(impl Convex<S> + ?Sized),
) -> Closest<S> {
    let origin = cast_point::<S, f64>(a.middle());
    let (x, y) = (a.skeleton(origin), b.skeleton(origin));
    let Between { distance, normal, on_a, on_b } = between(&x, &y);
    let point = |local: Vec3<f64>| cast_point(origin + local);
    Closest {
        distance: S::constant(distance),
        normal: cast_vector(normal),
        on_a: point(on_a),
        on_b: point(on_b),
    }
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

/// Where two skeletons, with their radii, are nearest or deepest.
pub(super) fn between(a: &Skeleton, b: &Skeleton) -> Between {
    // What is nearer than this is told by the axis, not by a difference that is rounding.
    let near = 1e-12 * (a.size() + b.size());
    let axis = widest_axis(a, b);
    let lines = match axis {
        Some(axis) if axis.separation <= near => {
            let (on_a, on_b) = deepest(a, b, axis);
            Between { distance: axis.separation, normal: axis.normal, on_a, on_b }
        }
        axis => {
            let (on_a, on_b) = nearest_features(a, b);
            let out = direction_and_length(on_b - on_a).filter(|(_, far)| *far > near);
            let (normal, distance) =
                out.unwrap_or_else(|| (axis.map_or_else(|| beside(a, b), |axis| axis.normal), 0.0));
            Between { distance, normal, on_a, on_b }
        }
    };
    Between {
        distance: lines.distance - a.radius - b.radius,
        on_a: lines.on_a + lines.normal * a.radius,
        on_b: lines.on_b - lines.normal * b.radius,
        ..lines
    }
}

/// A direction between two lines that cross or lie in each other: every one at right angles
/// to both is as short a way out.
fn beside(a: &Skeleton, b: &Skeleton) -> Vec3<f64> {
    let [first, second] = [a, b].map(|x| x.directions.first().copied());
    let both = first.zip(second).map(|(first, second)| first.cross(second));
    both.filter(|both| both.magnitude() > PARALLEL)
        .and_then(direction_and_length)
        .map_or_else(|| across(first.or(second).unwrap_or_else(Vec3::unit_x)), |(unit, _)| unit)
}

/// The points of two skeletons that are nearest to each other: of all corners with all
/// faces, and all edges with all edges.
fn nearest_features(a: &Skeleton, b: &Skeleton) -> (Vec3<f64>, Vec3<f64>) {
    // A distance changes so little about the nearest points that many are as near, but for
    // rounding. Of those, the pair across which most of the shapes is kept apart is right.
    let mut least = f64::INFINITY;
    let mut as_near: Vec<(f64, (Vec3<f64>, Vec3<f64>))> = Vec::new();
    let mut offer = |pair: (Vec3<f64>, Vec3<f64>)| {
        let squared = (pair.1 - pair.0).magnitude2();
        least = least.min(squared);
        if squared <= least * (1.0 + 1e-12) {
            as_near.push((squared, pair));
        }
    };
    let mut corners = Vec::new();
    for (one, other, swap) in [(a, b, false), (b, a, true)] {
        for (normal, face) in &one.faces {
            corners.clear();
            corners.extend(face.iter().map(|i| Point3::from_vec(one.points[*i as usize])));
            for point in &other.points {
                let point = Point3::from_vec(*point);
                let there = closest_of_polygon(&corners, *normal, point).to_vec();
                offer(if swap { (point.to_vec(), there) } else { (there, point.to_vec()) });
            }
        }
        for (point, segment) in
            one.points.iter().flat_map(|p| other.edges.iter().map(move |e| (p, e)))
        {
            let [from, to] = segment.map(|i| Point3::from_vec(other.points[i as usize]));
            let there = closest_of_segment(from, to, Point3::from_vec(*point)).to_vec();
            offer(if swap { (there, *point) } else { (*point, there) });
        }
    }
    for (first, second) in a.edges.iter().flat_map(|e| b.edges.iter().map(move |f| (e, f))) {
        let [p, q] = first.map(|i| a.points[i as usize]);
        let [r, s] = second.map(|i| b.points[i as usize]);
        if let Some(pair) = crossing([p, q], [r, s]) {
            offer(pair);
        }
    }
    as_near.retain(|(squared, _)| *squared <= least * (1.0 + 1e-12));
    let kept_apart = |(on_a, on_b): (Vec3<f64>, Vec3<f64>)| {
        let out = direction_and_length(on_b - on_a);
        out.map_or(f64::NEG_INFINITY, |(normal, _)| -b.reach(-normal) - a.reach(normal))
    };
    let first = (f64::NEG_INFINITY, (a.points[0], b.points[0]));
    let best = as_near.into_iter().enumerate().fold(first, |best, (i, (_, pair))| {
        let apart = kept_apart(pair);
        if i == 0 || apart > best.0 { (apart, pair) } else { best }
    });
    best.1
}

/// Where two segments are nearest to each other if that is at no end of either; else, near
/// there. None if they are parallel (Ericson, *Real-Time Collision Detection*, 2005, §5.1.9).
pub(super) fn crossing(
    [p, q]: [Vec3<f64>; 2],
    [r, s]: [Vec3<f64>; 2],
) -> Option<(Vec3<f64>, Vec3<f64>)> {
    let (along_a, long_a) = direction_and_length(q - p)?;
    let (along_b, long_b) = direction_and_length(s - r)?;
    let cos = along_a.dot(along_b);
    let sin = along_a.cross(along_b).magnitude();
    if sin < PARALLEL {
        return None;
    }
    let apart = r - p;
    let (on_a, on_b) = (apart.dot(along_a), apart.dot(along_b));
    let first = (on_a - cos * on_b) / (sin * sin);
    let second = (cos * on_a - on_b) / (sin * sin);
    Some((p + along_a * first.clamp(0.0, long_a), r + along_b * second.clamp(0.0, long_b)))
}

/// The middle of where two skeletons are deepest in each other along an axis.
fn deepest(a: &Skeleton, b: &Skeleton, axis: Axis) -> (Vec3<f64>, Vec3<f64>) {
    let points = contact_points(a, b, &axis);
    let bottom = points.iter().map(|p| p.distance).fold(f64::INFINITY, f64::min);
    let near = 1e-14 * (a.size() + b.size());
    let (mut sum, mut count) = (Vec3::new(0.0, 0.0, 0.0), 0.0);
    for point in points.iter().filter(|point| point.distance <= bottom + near) {
        sum += point.on_b;
        count += 1.0;
    }
    // What rounding cut away is at the farthest corner.
    let on_b = if count > 0.0 { sum / count } else { b.farthest(-axis.normal) };
    (on_b - axis.normal * axis.separation, on_b)
}
