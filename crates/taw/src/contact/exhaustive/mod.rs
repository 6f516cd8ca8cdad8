//! The readable version of [`between`](super::closest::between): all corners are compared
//! with all faces, and all edges with each other. Exact but for rounding, and without
//! iterations. The fast versions are tested against it, and where one of them cannot show
//! that its answer is right, this one is asked.

mod axes;
mod skeleton;

pub use skeleton::Skeleton;

use cgmath::{EuclideanSpace, InnerSpace};

use super::closest::Between;
use super::core::Core;
use super::manifold::deepest;
use crate::math::{Point3, Vec3, direction_and_length};
use crate::shape::across;
use crate::shape::polygon::{closest_of_polygon, closest_of_segment};
use axes::widest_axis;
pub(super) use axes::{Axis, Of, PARALLEL, at_right_angles};

/// Where two cores, without their radii, are nearest or deepest.
///
/// Of those that overlap, the directions of faces and of pairs of edges say where the way
/// out is shortest (separating axes; Gottschalk, Lin and Manocha 1996).
pub(super) fn between(x: &Core<'_>, y: &Core<'_>) -> Between {
    let (a, b) = (&Skeleton::of(x), &Skeleton::of(y));
    // What is nearer than this is told by the axis, not by a difference that is rounding.
    let near = 1e-12 * (x.size() + y.size());
    let axis = widest_axis(a, b);
    match axis {
        Some(axis) if axis.separation <= near => {
            let (on_a, on_b) = match axis.of {
                Of::Edges => crossing_edges(a, b, &axis),
                _ => deepest(x, y, &axis),
            };
            Between { distance: axis.separation, normal: axis.normal, on_a, on_b }
        }
        axis => {
            let (on_a, on_b) = nearest_features(a, b);
            let out = direction_and_length(on_b - on_a).filter(|(_, far)| *far > near);
            let (normal, distance) =
                out.unwrap_or_else(|| (axis.map_or_else(|| beside(a, b), |axis| axis.normal), 0.0));
            Between { distance, normal, on_a, on_b }
        }
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
            if is_line(&corners) {
                continue; // its edges say all
            }
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

/// Whether a face of something flat has no area of its own.
fn is_line(corners: &[Point3<f64>]) -> bool {
    let ends = corners.iter().skip(1).chain(corners.first());
    let shortest = corners.iter().zip(ends).map(|(a, b)| (b - a).magnitude2());
    shortest.fold(f64::INFINITY, f64::min) <= 0.0
}

/// Where two segments are nearest to each other if that is at no end of either; else, near
/// there. None if they are parallel (Ericson, *Real-Time Collision Detection*, 2005, §5.1.9).
pub(in crate::contact) fn crossing(
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

/// Where those edges are nearest to each other that are deepest along an axis.
fn crossing_edges(a: &Skeleton, b: &Skeleton, axis: &Axis) -> (Vec3<f64>, Vec3<f64>) {
    let far = |of: &Skeleton, edge: &[u32; 2], normal: Vec3<f64>| {
        (of.points[edge[0] as usize] + of.points[edge[1] as usize]).dot(normal)
    };
    // Those that are farthest out, and of those that are as far the two that cross: nearly
    // parallel edges of others may be farther out by a little, and elsewhere.
    let ends = |of: &Skeleton, edge: &[u32; 2]| edge.map(|i| of.points[i as usize]);
    let near = 1e-9 * (a.size() + b.size());
    let mut best: Option<(f64, f64, (Vec3<f64>, Vec3<f64>))> = None;
    for first in &a.edges {
        for second in &b.edges {
            let Some((on_a, on_b)) = crossing(ends(a, first), ends(b, second)) else { continue };
            let out = far(a, first, axis.normal) - far(b, second, axis.normal);
            let between = on_b - on_a;
            let aside = (between - axis.normal * between.dot(axis.normal)).magnitude2();
            let better = best.is_none_or(|(farthest, least, _)| {
                out > farthest + near || (out >= farthest - near && aside < least)
            });
            if better {
                best = Some((out, aside, (on_a, on_b)));
            }
        }
    }
    let on_b = best.map_or(b.points[0], |(_, _, (_, on_b))| on_b);
    (on_b - axis.normal * axis.separation, on_b)
}
