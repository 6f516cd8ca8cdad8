//! Brute-force separating axis test: the readable reference for
//! [`local_closest_points`](super::closest::local_closest_points). Compares all vertices with all
//! faces and all edges with each other; exact except for rounding, without iterations. The fast
//! versions are tested against it and fall back to it where they do not converge.

mod axes;
mod features;

pub use features::Features;

use cgmath::{EuclideanSpace, InnerSpace};

use super::closest::LocalClosestPoints;
use super::core::Core;
use super::manifold::deepest;
use crate::math::{Point3, Vec3, normalize_and_length};
use crate::shape::any_perpendicular;
use crate::shape::polygon::{project_on_polygon, project_on_segment};
use axes::axis_of_max_separation;
pub(super) use axes::{Axis, AxisSource, PARALLEL, at_right_angles};

/// Closest or deepest points of two cores without their radii.
///
/// Overlapping cores use the separating axis test (Gottschalk, Lin and Manocha 1996).
pub(super) fn local_closest_points(x: &Core<'_>, y: &Core<'_>) -> LocalClosestPoints {
    let (a, b) = (&Features::of(x), &Features::of(y));
    // Below this distance the axis gives the normal, since the difference of the points is rounding
    // noise.
    let tolerance = 1e-12 * (x.size() + y.size());
    let axis = axis_of_max_separation(a, b);
    match axis {
        Some(axis) if axis.separation <= tolerance => {
            let (on_a, on_b) = match axis.source {
                AxisSource::Edges => crossing_edges(a, b, &axis),
                _ => deepest(x, y, &axis),
            };
            LocalClosestPoints { distance: axis.separation, normal: axis.normal, on_a, on_b }
        }
        axis => {
            let (on_a, on_b) = nearest_features(a, b);
            let out = normalize_and_length(on_b - on_a).filter(|(_, far)| *far > tolerance);
            let (normal, distance) = out.unwrap_or_else(|| {
                (axis.map_or_else(|| normal_between_touching_lines(a, b), |axis| axis.normal), 0.0)
            });
            LocalClosestPoints { distance, normal, on_a, on_b }
        }
    }
}

/// Normal between two crossing or collinear segments: any direction perpendicular to both gives the
/// same penetration.
fn normal_between_touching_lines(a: &Features, b: &Features) -> Vec3<f64> {
    let [first, second] = [a, b].map(|x| x.directions.first().copied());
    let both = first.zip(second).map(|(first, second)| first.cross(second));
    both.filter(|both| both.magnitude() > PARALLEL).and_then(normalize_and_length).map_or_else(
        || any_perpendicular(first.or(second).unwrap_or_else(Vec3::unit_x)),
        |(unit, _)| unit,
    )
}

/// Closest points by comparing all vertices with all faces, and all edges with all edges.
fn nearest_features(a: &Features, b: &Features) -> (Vec3<f64>, Vec3<f64>) {
    // Distances vary little around the closest points, so many pairs tie to within rounding. Among
    // those, the pair whose plane separates the shapes most is right.
    let mut least = f64::INFINITY;
    let mut ties: Vec<(f64, (Vec3<f64>, Vec3<f64>))> = Vec::new();
    let mut offer = |pair: (Vec3<f64>, Vec3<f64>)| {
        let squared = (pair.1 - pair.0).magnitude2();
        least = least.min(squared);
        if squared <= least * (1.0 + 1e-12) {
            ties.push((squared, pair));
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
                let there = project_on_polygon(&corners, *normal, point).to_vec();
                offer(if swap { (point.to_vec(), there) } else { (there, point.to_vec()) });
            }
        }
        for (point, segment) in
            one.points.iter().flat_map(|p| other.edges.iter().map(move |e| (p, e)))
        {
            let [from, to] = segment.map(|i| Point3::from_vec(other.points[i as usize]));
            let there = project_on_segment(from, to, Point3::from_vec(*point)).to_vec();
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
    ties.retain(|(squared, _)| *squared <= least * (1.0 + 1e-12));
    let separation = |(on_a, on_b): (Vec3<f64>, Vec3<f64>)| {
        let out = normalize_and_length(on_b - on_a);
        out.map_or(f64::NEG_INFINITY, |(normal, _)| -b.reach(-normal) - a.reach(normal))
    };
    let first = (f64::NEG_INFINITY, (a.points[0], b.points[0]));
    let best = ties.into_iter().enumerate().fold(first, |best, (i, (_, pair))| {
        let apart = separation(pair);
        if i == 0 || apart > best.0 { (apart, pair) } else { best }
    });
    best.1
}

/// Returns true for a degenerate face without area.
fn is_line(corners: &[Point3<f64>]) -> bool {
    let ends = corners.iter().skip(1).chain(corners.first());
    let shortest = corners.iter().zip(ends).map(|(a, b)| (b - a).magnitude2());
    shortest.fold(f64::INFINITY, f64::min) <= 0.0
}

/// Closest points of two segments if they are interior to both; else approximate. None if parallel
/// (Ericson, *Real-Time Collision Detection*, 2005, §5.1.9).
pub(in crate::contact) fn crossing(
    [p, q]: [Vec3<f64>; 2],
    [r, s]: [Vec3<f64>; 2],
) -> Option<(Vec3<f64>, Vec3<f64>)> {
    let (along_a, long_a) = normalize_and_length(q - p)?;
    let (along_b, long_b) = normalize_and_length(s - r)?;
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

/// Closest points of the two support edges along an axis.
fn crossing_edges(a: &Features, b: &Features, axis: &Axis) -> (Vec3<f64>, Vec3<f64>) {
    let far = |of: &Features, edge: &[u32; 2], normal: Vec3<f64>| {
        (of.points[edge[0] as usize] + of.points[edge[1] as usize]).dot(normal)
    };
    // The support edges, and among ties the two that cross: nearly parallel edges elsewhere may
    // reach slightly farther.
    let ends = |of: &Features, edge: &[u32; 2]| edge.map(|i| of.points[i as usize]);
    let tolerance = 1e-9 * (a.size() + b.size());
    let mut best: Option<(f64, f64, (Vec3<f64>, Vec3<f64>))> = None;
    for first in &a.edges {
        for second in &b.edges {
            let Some((on_a, on_b)) = crossing(ends(a, first), ends(b, second)) else { continue };
            let out = far(a, first, axis.normal) - far(b, second, axis.normal);
            let between = on_b - on_a;
            let aside = (between - axis.normal * between.dot(axis.normal)).magnitude2();
            let better = best.is_none_or(|(farthest, least, _)| {
                out > farthest + tolerance || (out >= farthest - tolerance && aside < least)
            });
            if better {
                best = Some((out, aside, (on_a, on_b)));
            }
        }
    }
    let on_b = best.map_or(b.points[0], |(_, _, (_, on_b))| on_b);
    (on_b - axis.normal * axis.separation, on_b)
}
