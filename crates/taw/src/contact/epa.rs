//! Penetration of two overlapping cores by EPA, the expanding polytope algorithm: a polytope grows
//! inside the Minkowski difference until its face nearest to the origin lies on the boundary (van
//! den Bergen, *Proximity queries and penetration depth computation*, 2001).

use cgmath::InnerSpace;

use super::closest::{LocalClosestPoints, TOLERANCE};
use super::core::Core;
use super::gjk::{Vertex, vertex};
use crate::math::{Vec3, normalize_and_length};

/// A face of the polytope.
#[derive(Clone, Copy)]
struct PolytopeFace {
    corners: [usize; 3],
    /// Outward unit normal.
    normal: Vec3<f64>,
    /// Distance of its plane from the origin.
    height: f64,
}

/// Enough for any pair of hulls of a few hundred vertices.
const MAX_ITERATIONS: usize = 1_000;

/// Deepest points of two overlapping cores, from a tetrahedron of the Minkowski difference around
/// the origin; none if rounding prevents convergence.
pub(super) fn penetration(
    a: &Core<'_>,
    b: &Core<'_>,
    start: [Vertex; 4],
    size: f64,
) -> Option<LocalClosestPoints> {
    let mut vertices = Vec::with_capacity(32);
    vertices.extend(start);
    let mut faces = Vec::with_capacity(64);
    let [p, q, r, s] = start.map(|vertex| vertex.difference);
    let flipped = (q - p).cross(r - p).dot(s - p) > 0.0;
    for [i, j, k] in [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]] {
        faces.push(face(&vertices, if flipped { [i, k, j] } else { [i, j, k] })?);
    }
    let mut horizon: Vec<[usize; 2]> = Vec::with_capacity(32);
    for _ in 0..MAX_ITERATIONS {
        let nearest = *faces.iter().reduce(|x, y| if y.height < x.height { y } else { x })?;
        let next = vertex(a, b, nearest.normal);
        let reach = next.difference.dot(nearest.normal);
        if reach - nearest.height <= TOLERANCE * size {
            return Some(closest_points_on(&vertices, &faces, &nearest, reach, size));
        }
        // Faces that see the new vertex are removed; their horizon is joined to the vertex.
        horizon.clear();
        let above = 1e-14 * size;
        faces.retain(|face: &PolytopeFace| {
            let seen = next.difference.dot(face.normal) - face.height > above;
            if seen {
                let [i, j, k] = face.corners;
                for edge in [[i, j], [j, k], [k, i]] {
                    let back = horizon.iter().position(|[from, to]| [*to, *from] == edge);
                    match back {
                        Some(place) => {
                            horizon.swap_remove(place);
                        }
                        None => horizon.push(edge),
                    }
                }
            }
            !seen
        });
        let new = vertices.len();
        vertices.push(next);
        for [from, to] in &horizon {
            faces.push(face(&vertices, [*from, *to, new])?);
        }
    }
    None
}

/// A face, unless it is degenerate or has the origin in front of it.
fn face(vertices: &[Vertex], corners: [usize; 3]) -> Option<PolytopeFace> {
    let [p, q, r] = corners.map(|i| vertices[i].difference);
    let (normal, twice) = normalize_and_length((q - p).cross(r - p))?;
    let longest = (q - p).magnitude2().max((r - q).magnitude2()).max((p - r).magnitude2());
    let height = (p + q + r).dot(normal) / 3.0;
    (twice > 1e-10 * longest && height > -1e-13 * longest.sqrt()).then_some(PolytopeFace {
        corners,
        normal,
        height,
    })
}

/// Witness points on the nearest face; among coplanar faces, on the one that contains the
/// projection of the origin.
fn closest_points_on(
    vertices: &[Vertex],
    faces: &[PolytopeFace],
    nearest: &PolytopeFace,
    reach: f64,
    size: f64,
) -> LocalClosestPoints {
    let weights = |face: &PolytopeFace| {
        let [p, q, r] = face.corners.map(|i| vertices[i].difference);
        let below = face.normal * face.height;
        let part = |x: Vec3<f64>, y: Vec3<f64>| (x - below).cross(y - below).dot(face.normal);
        let parts = [part(q, r), part(r, p), part(p, q)];
        let all: f64 = parts.iter().sum();
        parts.map(|part| part / all)
    };
    let least = |face: &PolytopeFace| weights(face).into_iter().fold(f64::INFINITY, f64::min);
    // As far from the origin is not enough: a face on the other side may be by chance.
    let coplanar = |face: &PolytopeFace| {
        face.corners.iter().all(|i| {
            let height = vertices[*i].difference.dot(nearest.normal);
            (height - nearest.height).abs() <= 4.0 * TOLERANCE * size
        })
    };
    let mut best = (least(nearest), nearest);
    for face in faces {
        if best.0 < 0.0 && coplanar(face) && least(face) > best.0 {
            best = (least(face), face);
        }
    }
    let weights = weights(best.1).map(|weight| weight.max(0.0));
    let all: f64 = weights.iter().sum();
    let corners = best.1.corners.iter().zip(weights);
    let on_a = corners.fold(Vec3::new(0.0, 0.0, 0.0), |sum, (i, weight)| {
        sum + vertices[*i].on_a * (weight / all)
    });
    // The difference is `B − A`, so `B` has to go the opposite way.
    let (normal, distance) = (-nearest.normal, -reach);
    LocalClosestPoints { distance, normal, on_a, on_b: on_a + normal * distance }
}
