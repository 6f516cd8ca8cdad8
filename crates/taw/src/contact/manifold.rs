use cgmath::{EuclideanSpace, InnerSpace};

use smallvec::SmallVec;

use super::brute_force::{Axis, AxisSource};
use super::closest::{ClosestPoints, LocalClosestPoints, closest_points, core_distance};
use super::core::{Convex, Core, CoreKind, IndexedVertex, PARALLEL_SIN, Polygon};
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector, normalize_and_length};
use crate::shape::Plane;

/// Contact manifold: a point, the ends of a segment, or up to four vertices of a polygon.
#[derive(Clone, Debug, PartialEq)]
pub struct Manifold<S> {
    /// Unit vector from the first to the second; approximate if there are no points.
    pub normal: Vec3<S>,
    /// One to four points; none if the shapes are farther apart than the margin.
    pub points: Points<S>,
}

/// The points of a [`Manifold`], without heap allocation.
pub type Points<S> = SmallVec<[ManifoldPoint<S>; 4]>;

/// One point of a [`Manifold`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ManifoldPoint<S> {
    /// Point on the surface of the first.
    pub on_a: Point3<S>,
    /// Point on the surface of the second.
    pub on_b: Point3<S>,
    /// Separation at this point, in metres; negative for a penetration.
    pub distance: S,
    /// Feature id: identifies the vertices, edges and faces that meet here, stable as long as they
    /// do. Among hulls of more than 511 vertices, two points may share an id.
    pub feature: u32,
}

/// A point of contact of two cores, without their radii.
#[derive(Clone, Copy, Debug)]
struct ContactPoint {
    on_a: Vec3<f64>,
    on_b: Vec3<f64>,
    distance: f64,
    feature: u32,
}

type ContactPoints = SmallVec<[ContactPoint; 8]>;

/// Depth relative to the sizes by which the deepest points must exceed all others to be added, and
/// the feature bit that marks them.
const EXTRA_POINT_DEPTH: f64 = 1e-3;
const DEEPEST_FEATURE: u32 = 1 << 30;

/// Contact manifold of two convex shapes at most `margin` metres apart.
#[must_use]
pub fn manifold<S: Scalar>(
    a: &(impl Convex<S> + ?Sized),
    b: &(impl Convex<S> + ?Sized),
    margin: S,
) -> Manifold<S> {
    if a.as_sphere().is_some() || b.as_sphere().is_some() {
        let ClosestPoints { distance, normal, on_a, on_b } = closest_points(a, b);
        let mut points = Points::new();
        if distance <= margin {
            points.push(ManifoldPoint { on_a, on_b, distance, feature: 0 });
        }
        return Manifold { normal, points };
    }
    let origin = cast_point::<S, f64>(a.center());
    let (x, y) = (a.core(origin), b.core(origin));
    let margin = margin.as_f64();
    let Some(nearest) = core_distance(&x, &y, margin) else {
        let normal = normalize_and_length(y.inside() - x.inside());
        let normal = cast_vector(normal.map_or_else(Vec3::unit_x, |(normal, _)| normal));
        return Manifold { normal, points: Points::new() };
    };
    let (normal, distance) = (nearest.normal(), nearest.distance());
    let face_of_b = || y.face_along(-normal).map(AxisSource::FaceOfB);
    let of = x
        .face_along(normal)
        .map(AxisSource::FaceOfA)
        .or_else(face_of_b)
        .unwrap_or(AxisSource::Edges);
    let mut points = contact_points(&x, &y, &Axis { normal, separation: distance, source: of });
    points.retain(|point| point.distance - x.radius - y.radius <= margin);
    // If the face is slightly oblique to the normal, the deepest point may lie beyond its edge.
    let bottom = points.iter().map(|point| point.distance).fold(f64::INFINITY, f64::min);
    if bottom - distance > EXTRA_POINT_DEPTH * (x.size() + y.size()) {
        let LocalClosestPoints { on_a, on_b, .. } = nearest.local_closest_points(&x, &y);
        let feature = DEEPEST_FEATURE | x.support(normal).1 << 10 | y.support(-normal).1;
        points.push(ContactPoint { on_a, on_b, distance, feature });
    }
    reduce(&mut points, normal);
    let points = public_points(&points, normal, [x.radius, y.radius], origin);
    Manifold { normal: cast_vector(normal), points }
}

/// Contact manifold of a half-space and a convex shape at most `margin` metres apart.
#[must_use]
pub fn manifold_of_plane<S: Scalar>(
    plane: &Plane<S>,
    shape: &(impl Convex<S> + ?Sized),
    margin: S,
) -> Manifold<S> {
    let origin = cast_point::<S, f64>(shape.center());
    let (core, normal) = (shape.core(origin), cast_vector::<S, f64>(plane.normal()));
    let offset = plane.offset().as_f64() - normal.dot(origin.to_vec());
    let height = |vertex: Vec3<f64>| normal.dot(vertex) - offset;
    let mut points: ContactPoints = core
        .facing(-normal)
        .into_iter()
        .map(|(on_b, feature)| {
            let distance = height(on_b);
            ContactPoint { on_a: on_b - normal * distance, on_b, distance, feature }
        })
        .filter(|point| point.distance - core.radius <= margin.as_f64())
        .collect();
    reduce(&mut points, normal);
    let points = public_points(&points, normal, [0.0, core.radius], origin);
    Manifold { normal: plane.normal(), points }
}

/// Points on surfaces, from those on cores with these radii.
fn public_points<S: Scalar>(
    points: &ContactPoints,
    normal: Vec3<f64>,
    radii: [f64; 2],
    origin: Point3<f64>,
) -> Points<S> {
    let place = |local: Vec3<f64>| cast_point(origin + local);
    let public = points.iter().map(|p| ManifoldPoint {
        on_a: place(p.on_a + normal * radii[0]),
        on_b: place(p.on_b - normal * radii[1]),
        distance: S::from_f64(p.distance - radii[0] - radii[1]),
        feature: p.feature,
    });
    public.collect()
}

/// Mean of the deepest contact points of two cores, without their radii, along the normal of a
/// face.
pub(super) fn deepest(a: &Core<'_>, b: &Core<'_>, axis: &Axis) -> (Vec3<f64>, Vec3<f64>) {
    let points = contact_points(a, b, axis);
    let bottom = points.iter().map(|p| p.distance).fold(f64::INFINITY, f64::min);
    let near = 1e-14 * (a.size() + b.size());
    let (mut sum, mut count) = (Vec3::new(0.0, 0.0, 0.0), 0.0);
    for point in points.iter().filter(|point| point.distance <= bottom + near) {
        sum += point.on_b;
        count += 1.0;
    }
    // If rounding clipped everything, the support point.
    let on_b = if count > 0.0 { sum / count } else { b.support(-axis.normal).0 };
    (on_b - axis.normal * axis.separation, on_b)
}

/// Contact points of two cores, without their radii, along an axis: one face clipped against the
/// other, or the overlap of two parallel segments.
fn contact_points(a: &Core<'_>, b: &Core<'_>, axis: &Axis) -> ContactPoints {
    match axis.source {
        AxisSource::FaceOfA(face) => clip_to_face(a, face, b, axis.normal),
        AxisSource::FaceOfB(face) => {
            let mut points = clip_to_face(b, face, a, -axis.normal);
            for point in &mut points {
                (point.on_a, point.on_b) = (point.on_b, point.on_a);
                point.feature |= 1 << 31;
            }
            points
        }
        AxisSource::Edges => match (&a.kind, &b.kind) {
            (CoreKind::Segment(a), CoreKind::Segment(b)) => {
                contact_points_of_parallel_segments(*a, *b, axis.normal)
            }
            _ => ContactPoints::new(),
        },
    }
}

/// Clips the face of `other` that faces a face of `one` against its side planes (Sutherland and
/// Hodgman 1974).
fn clip_to_face(one: &Core<'_>, face: usize, other: &Core<'_>, normal: Vec3<f64>) -> ContactPoints {
    let (plane, corners) = (one.normal(face), one.face(face));
    let mut outline = other.facing(-normal);
    for side in 0..corners.len() {
        let (from, to) = (corners[side].0, corners[(side + 1) % corners.len()].0);
        let out = (to - from).cross(plane);
        let height = |point: Vec3<f64>| (point - from).dot(out);
        if outline.iter().all(|(point, _)| height(*point) <= 0.0) {
            continue;
        }
        outline = match outline[..] {
            [here, next] => clip_segment([here, next], side as u32, height),
            _ => clip_polygon(&outline, side as u32, height),
        };
    }
    let from = corners[0].0;
    let count = outline.len();
    let named = outline.iter().enumerate().map(|(i, (point, name))| match count {
        1 | 2 => (*point, *name),
        // Where two edges meet.
        _ => (*point, outline[(i + count - 1) % count].1 << 10 | name),
    });
    named
        .map(|(point, feature)| {
            let distance = (point - from).dot(plane);
            let feature = (face as u32) << 20 | feature;
            ContactPoint { on_a: point - plane * distance, on_b: point, distance, feature }
        })
        .collect()
}

/// Feature ids of clip planes start here, after those of edges.
const CLIP_FEATURE: u32 = 512;

/// Clips a polygon against a side plane. Each vertex has the id of the edge after it.
fn clip_polygon(
    outline: &[IndexedVertex],
    side: u32,
    height: impl Fn(Vec3<f64>) -> f64,
) -> Polygon {
    let mut left = Polygon::new();
    for (i, here) in outline.iter().enumerate() {
        let next = outline[(i + 1) % outline.len()];
        let (h, k) = (height(here.0), height(next.0));
        if h <= 0.0 {
            left.push(*here);
        }
        let crossing = here.0 + (next.0 - here.0) * (h / (h - k));
        if h < 0.0 && k > 0.0 {
            left.push((crossing, CLIP_FEATURE + side));
        } else if h > 0.0 && k < 0.0 {
            left.push((crossing, here.1));
        }
    }
    left
}

/// Clips a segment against a side plane. Each end has its own id.
fn clip_segment(
    [here, next]: [IndexedVertex; 2],
    side: u32,
    height: impl Fn(Vec3<f64>) -> f64,
) -> Polygon {
    let (h, k) = (height(here.0), height(next.0));
    let crossing = (here.0 + (next.0 - here.0) * (h / (h - k)), CLIP_FEATURE + side);
    match (h <= 0.0, k <= 0.0) {
        (true, true) => [here, next].into_iter().collect(),
        (true, false) => [here, crossing].into_iter().collect(),
        (false, true) => [crossing, next].into_iter().collect(),
        (false, false) => Polygon::new(),
    }
}

/// End points of the overlap of two nearly parallel segments, if any.
fn contact_points_of_parallel_segments(
    [p, q]: [Vec3<f64>; 2],
    other: [Vec3<f64>; 2],
    normal: Vec3<f64>,
) -> ContactPoints {
    let mut points = ContactPoints::new();
    let (along, across) = (normalize_and_length(q - p), normalize_and_length(other[1] - other[0]));
    let (Some((along, long)), Some((across, _))) = (along, across) else { return points };
    if along.cross(across).magnitude2() > PARALLEL_SIN * PARALLEL_SIN {
        return points;
    }
    let parts = other.map(|end| (end - p).dot(along));
    let held = parts.map(|part| part.clamp(0.0, long));
    if held[0] == held[1] {
        return points; // One lies beyond an end of the other.
    }
    for (number, held) in (0..).zip(held) {
        let share = (held - parts[0]) / (parts[1] - parts[0]);
        let (on_a, on_b) = (p + along * held, other[0] + (other[1] - other[0]) * share);
        let distance = (on_b - on_a).dot(normal);
        points.push(ContactPoint { on_a, on_b, distance, feature: number });
    }
    points
}

/// Reduces the manifold to four points: the deepest, the farthest from it, and on both sides of the
/// line between them the one that spans the largest triangle.
fn reduce(points: &mut ContactPoints, normal: Vec3<f64>) {
    if points.len() <= 4 {
        return;
    }
    let best = |score: &dyn Fn(&ContactPoint) -> f64| {
        let first = (points[0], score(&points[0]));
        points.iter().fold(first, |best, point| {
            let next = score(point);
            if next > best.1 { (*point, next) } else { best }
        })
    };
    let (deepest, _) = best(&|p| -p.distance);
    let (farthest, _) = best(&|p| (p.on_a - deepest.on_a).magnitude2());
    let side =
        |p: &ContactPoint| (farthest.on_a - deepest.on_a).cross(p.on_a - deepest.on_a).dot(normal);
    let (left, high) = best(&side);
    let (right, low) = best(&|p| -side(p));
    let mut kept: ContactPoints = [deepest, farthest].into_iter().collect();
    kept.extend((high > 0.0).then_some(left));
    kept.extend((low > 0.0).then_some(right));
    *points = kept;
}
