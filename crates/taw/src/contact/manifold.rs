use cgmath::InnerSpace;

use super::axes::{Axis, Of, widest_axis};
use super::closest::{Between, between, crossing};
use super::skeleton::{Convex, Skeleton};
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector};

/// Where two things touch: a point, the ends of a segment, or up to four corners of a
/// polygon.
#[derive(Clone, Debug, PartialEq)]
pub struct Manifold<S> {
    /// From the first to the second, a unit vector.
    pub normal: Vec3<S>,
    /// One to four, or none if they are farther apart than was asked for.
    pub points: Vec<ManifoldPoint<S>>,
}

/// One point of a [`Manifold`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ManifoldPoint<S> {
    /// On the surface of the first.
    pub on_a: Point3<S>,
    /// On the surface of the second.
    pub on_b: Point3<S>,
    /// How far they are apart here, in metres; negative where they overlap.
    pub distance: S,
    /// Names the corners, edges and faces that meet here: the same as long as these do.
    /// Among hulls of more than 511 corners, two points may have one name.
    pub feature: u32,
}

/// A point of contact of two skeletons, without their radii.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContactPoint {
    pub on_a: Vec3<f64>,
    pub on_b: Vec3<f64>,
    pub distance: f64,
    pub feature: u32,
}

/// What is nearly parallel to a face lies on it: the sine of a thousandth of a turn.
const FLAT: f64 = 6e-3;

/// Where two convex shapes touch, or are at most `margin` metres apart.
#[must_use]
pub fn manifold<S: Scalar>(
    a: &(impl Convex<S> + ?Sized),
    b: &(impl Convex<S> + ?Sized),
    margin: S,
) -> Manifold<S> {
    let origin = cast_point::<S, f64>(a.middle());
    let (x, y) = (a.skeleton(origin), b.skeleton(origin));
    let nearest = between(&x, &y);
    let Between { normal, distance, .. } = nearest;
    let (mut points, margin) = (Vec::new(), margin.as_f64());
    if distance <= margin {
        let core = distance + x.radius + y.radius;
        let axis = widest_axis(&x, &y).filter(|axis| {
            axis.normal.cross(normal).magnitude() < FLAT && axis.normal.dot(normal) > 0.0
        });
        let axis = Axis {
            normal,
            separation: core,
            of: axis.map_or_else(|| flat_face(&x, &y, normal), |axis| axis.of),
        };
        points = match axis.of {
            Of::Edges => side_by_side(&x, &y, normal),
            _ => contact_points(&x, &y, &axis),
        };
        for point in &mut points {
            point.on_a += normal * x.radius;
            point.on_b -= normal * y.radius;
            point.distance -= x.radius + y.radius;
        }
        points.retain(|point| point.distance <= margin);
        if points.is_empty() {
            let Between { on_a, on_b, .. } = nearest;
            points.push(ContactPoint { on_a, on_b, distance, feature: 0 });
        }
        reduce(&mut points, normal);
    }
    let point = |local: Vec3<f64>| cast_point(origin + local);
    let public = points.iter().map(|p| ManifoldPoint {
        on_a: point(p.on_a),
        on_b: point(p.on_b),
        distance: S::constant(p.distance),
        feature: p.feature,
    });
    Manifold { normal: cast_vector(normal), points: public.collect() }
}

/// The face of either that a direction is the normal of, or edges.
fn flat_face(a: &Skeleton, b: &Skeleton, normal: Vec3<f64>) -> Of {
    let face = |of: &Skeleton, normal: Vec3<f64>| {
        let along = |(face, _): &(Vec3<f64>, Vec<u32>)| {
            face.dot(normal) > 0.0 && face.cross(normal).magnitude() < FLAT
        };
        of.faces.iter().position(along)
    };
    face(a, normal).map(Of::FaceOfA).or(face(b, -normal).map(Of::FaceOfB)).unwrap_or(Of::Edges)
}

/// Where two skeletons touch along an axis: the part of the one's face that is over the
/// other's, where there is one.
pub(super) fn contact_points(a: &Skeleton, b: &Skeleton, axis: &Axis) -> Vec<ContactPoint> {
    match axis.of {
        Of::FaceOfA(face) => over_face(a, face, b, axis.normal),
        Of::FaceOfB(face) => {
            let mut points = over_face(b, face, a, -axis.normal);
            for point in &mut points {
                (point.on_a, point.on_b) = (point.on_b, point.on_a);
                point.feature |= 1 << 31;
            }
            points
        }
        Of::Edges => along_edges(a, b, axis),
    }
}

/// The points of what of `other` faces a face of `one`, cut to its outline (Sutherland and
/// Hodgman 1974).
fn over_face(
    one: &Skeleton,
    face: usize,
    other: &Skeleton,
    normal: Vec3<f64>,
) -> Vec<ContactPoint> {
    let (plane, corners) = &one.faces[face];
    let corner = |i: usize| one.points[corners[i % corners.len()] as usize];
    let mut outline = facing(other, -normal);
    for side in 0..corners.len() {
        let (from, to) = (corner(side), corner(side + 1));
        let out = (to - from).cross(*plane);
        let height = |point: Vec3<f64>| (point - from).dot(out);
        outline = match outline[..] {
            [here, next] => cut_segment([here, next], side as u32, height),
            _ => cut(&outline, side as u32, height),
        };
    }
    let from = corner(0);
    let names: Vec<_> = match outline[..] {
        [_, _] | [_] => outline.iter().map(|(_, name)| *name).collect(),
        // Where two edges meet.
        _ => {
            let before = outline.iter().cycle().skip(outline.len().saturating_sub(1));
            before.zip(&outline).map(|((_, s), (_, t))| s << 10 | t).collect()
        }
    };
    let points = outline.into_iter().zip(names);
    points
        .map(|((point, _), feature)| {
            let distance = (point - from).dot(*plane);
            let feature = (face as u32) << 20 | feature;
            ContactPoint { on_a: point - plane * distance, on_b: point, distance, feature }
        })
        .collect()
}

/// Names the sides that an outline is cut along, beside the edges that it had.
const CUT: u32 = 512;

/// What of a polygon is not above a side. Each corner has the name of the edge after it.
fn cut(
    outline: &[(Vec3<f64>, u32)],
    side: u32,
    height: impl Fn(Vec3<f64>) -> f64,
) -> Vec<(Vec3<f64>, u32)> {
    let mut left = Vec::with_capacity(outline.len() + 1);
    for (i, here) in outline.iter().enumerate() {
        let next = outline[(i + 1) % outline.len()];
        let (h, k) = (height(here.0), height(next.0));
        if h <= 0.0 {
            left.push(*here);
        }
        let crossing = here.0 + (next.0 - here.0) * (h / (h - k));
        if h < 0.0 && k > 0.0 {
            left.push((crossing, CUT + side));
        } else if h > 0.0 && k < 0.0 {
            left.push((crossing, here.1));
        }
    }
    left
}

/// What of a segment is not above a side. Each end has its own name.
fn cut_segment(
    [here, next]: [(Vec3<f64>, u32); 2],
    side: u32,
    height: impl Fn(Vec3<f64>) -> f64,
) -> Vec<(Vec3<f64>, u32)> {
    let (h, k) = (height(here.0), height(next.0));
    let crossing = (here.0 + (next.0 - here.0) * (h / (h - k)), CUT + side);
    match (h <= 0.0, k <= 0.0) {
        (true, true) => vec![here, next],
        (true, false) => vec![here, crossing],
        (false, true) => vec![crossing, next],
        (false, false) => Vec::new(),
    }
}

/// Of the faces with the most of the farthest corners along a direction, the one that looks
/// most that way; else the line or the point: corners, with numbers.
fn facing(of: &Skeleton, direction: Vec3<f64>) -> Vec<(Vec3<f64>, u32)> {
    let reach = of.reach(direction) - 1e-12 * of.size();
    let out = |corners: &Vec<u32>| {
        let there = corners.iter().filter(|i| of.points[**i as usize].dot(direction) >= reach);
        there.count()
    };
    let most = of.faces.iter().map(|(_, corners)| out(corners)).max();
    let along = |(normal, _): &&(Vec3<f64>, Vec<u32>)| normal.dot(direction);
    let there = of.faces.iter().filter(|(_, corners)| Some(out(corners)) == most);
    let face = there.max_by(|f, g| along(f).total_cmp(&along(g)));
    let named = |i: u32| (of.points[i as usize], i);
    match face {
        Some((_, corners)) => corners.iter().map(|i| named(*i)).collect(),
        None => (0..of.points.len() as u32).map(named).collect(),
    }
}

/// Where those edges are nearest to each other that are deepest along an axis.
fn along_edges(a: &Skeleton, b: &Skeleton, axis: &Axis) -> Vec<ContactPoint> {
    let point = |on_a: Vec3<f64>, on_b: Vec3<f64>, feature| ContactPoint {
        on_a,
        on_b,
        distance: (on_b - on_a).dot(axis.normal),
        feature,
    };
    let far = |of: &Skeleton, edge: &[u32; 2], normal: Vec3<f64>| {
        (of.points[edge[0] as usize] + of.points[edge[1] as usize]).dot(normal)
    };
    // Those that are farthest out, and of those that are as far the two that cross: nearly
    // parallel edges of others may be farther out by a little, and elsewhere.
    let ends = |of: &Skeleton, edge: &[u32; 2]| edge.map(|i| of.points[i as usize]);
    let near = 1e-9 * (a.size() + b.size());
    let mut best: Option<(f64, f64, ContactPoint)> = None;
    for (i, first) in a.edges.iter().enumerate() {
        for (j, second) in b.edges.iter().enumerate() {
            let Some((on_a, on_b)) = crossing(ends(a, first), ends(b, second)) else { continue };
            let out = far(a, first, axis.normal) - far(b, second, axis.normal);
            let between = on_b - on_a;
            let aside = (between - axis.normal * between.dot(axis.normal)).magnitude2();
            let better = best.is_none_or(|(farthest, least, _)| {
                out > farthest + near || (out >= farthest - near && aside < least)
            });
            if better {
                best = Some((out, aside, point(on_a, on_b, (i as u32) << 10 | j as u32)));
            }
        }
    }
    best.map(|(_, _, point)| point).into_iter().collect()
}

/// The ends of what two parallel lines share, else nothing.
fn side_by_side(a: &Skeleton, b: &Skeleton, normal: Vec3<f64>) -> Vec<ContactPoint> {
    let ([[p, q]], [along], [other]) = (&a.edges[..], &a.directions[..], &b.directions[..]) else {
        return Vec::new();
    };
    if along.cross(*other).magnitude() > FLAT {
        return Vec::new();
    }
    let [p, q] = [p, q].map(|i| a.points[*i as usize]);
    let (low, high) = (0.0, (q - p).dot(*along));
    let mut points: Vec<ContactPoint> = Vec::new();
    for (number, end) in b.points.iter().enumerate().take(2) {
        let part = (end - p).dot(*along);
        let held = part.clamp(low, high);
        let (on_a, on_b) = (p + along * held, end + along * (held - part));
        let distance = (on_b - on_a).dot(normal);
        let next = ContactPoint { on_a, on_b, distance, feature: number as u32 };
        if points.iter().all(|other| (other.on_a - next.on_a).magnitude2() > 0.0) {
            points.push(next);
        }
    }
    points
}

/// Leaves four of many points: the deepest, the farthest from it, and on both sides of the
/// line between them the one that makes the largest triangle.
fn reduce(points: &mut Vec<ContactPoint>, normal: Vec3<f64>) {
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
    let mut kept = vec![deepest, farthest];
    kept.extend((high > 0.0).then_some(left));
    kept.extend((low > 0.0).then_some(right));
    *points = kept;
}
