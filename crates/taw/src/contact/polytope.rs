//! The way out of two cores that overlap, by a polytope that grows in their difference
//! until the face of it that is nearest to the origin is one of the difference itself (van
//! den Bergen, *Proximity queries and penetration depth computation*, 2001).

use cgmath::InnerSpace;

use super::closest::{Between, CERTAIN};
use super::core::Core;
use super::gjk::{Vertex, vertex};
use crate::math::{Vec3, direction_and_length};

/// A face of the polytope.
#[derive(Clone, Copy)]
struct Triangle {
    corners: [usize; 3],
    /// Out of the polytope, a unit vector.
    normal: Vec3<f64>,
    /// Of its plane, from the origin.
    height: f64,
}

/// Steps enough for any pair of hulls of a few hundred corners.
const STEPS: usize = 1_000;

/// Where two cores are deepest in each other, from four corners of their difference
/// around the origin on; none where rounding forbids to say so.
pub(super) fn way_out(
    a: &Core<'_>,
    b: &Core<'_>,
    start: [Vertex; 4],
    size: f64,
) -> Option<Between> {
    let mut vertices = Vec::with_capacity(32);
    vertices.extend(start);
    let mut faces = Vec::with_capacity(64);
    let [p, q, r, s] = start.map(|vertex| vertex.difference);
    let turned = (q - p).cross(r - p).dot(s - p) > 0.0;
    for [i, j, k] in [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]] {
        faces.push(face(&vertices, if turned { [i, k, j] } else { [i, j, k] })?);
    }
    let mut rim: Vec<[usize; 2]> = Vec::with_capacity(32);
    for _ in 0..STEPS {
        let nearest = *faces.iter().reduce(|x, y| if y.height < x.height { y } else { x })?;
        let next = vertex(a, b, nearest.normal);
        let reach = next.difference.dot(nearest.normal);
        if reach - nearest.height <= CERTAIN * size {
            return Some(answer(&vertices, &faces, &nearest, reach, size));
        }
        // What sees the new corner goes; the rim of it is joined to the corner.
        rim.clear();
        let above = 1e-14 * size;
        faces.retain(|face: &Triangle| {
            let seen = next.difference.dot(face.normal) - face.height > above;
            if seen {
                let [i, j, k] = face.corners;
                for edge in [[i, j], [j, k], [k, i]] {
                    let back = rim.iter().position(|[from, to]| [*to, *from] == edge);
                    match back {
                        Some(place) => {
                            rim.swap_remove(place);
                        }
                        None => rim.push(edge),
                    }
                }
            }
            !seen
        });
        let new = vertices.len();
        vertices.push(next);
        for [from, to] in &rim {
            faces.push(face(&vertices, [*from, *to, new])?);
        }
    }
    None
}

/// A face, if it is no line and the origin is behind it.
fn face(vertices: &[Vertex], corners: [usize; 3]) -> Option<Triangle> {
    let [p, q, r] = corners.map(|i| vertices[i].difference);
    let (normal, twice) = direction_and_length((q - p).cross(r - p))?;
    let longest = (q - p).magnitude2().max((r - q).magnitude2()).max((p - r).magnitude2());
    let height = (p + q + r).dot(normal) / 3.0;
    (twice > 1e-10 * longest && height > -1e-13 * longest.sqrt()).then_some(Triangle {
        corners,
        normal,
        height,
    })
}

/// What the nearest face says: of those in its plane, the one that the origin is below.
fn answer(
    vertices: &[Vertex],
    faces: &[Triangle],
    nearest: &Triangle,
    reach: f64,
    size: f64,
) -> Between {
    let weights = |face: &Triangle| {
        let [p, q, r] = face.corners.map(|i| vertices[i].difference);
        let below = face.normal * face.height;
        let part = |x: Vec3<f64>, y: Vec3<f64>| (x - below).cross(y - below).dot(face.normal);
        let parts = [part(q, r), part(r, p), part(p, q)];
        let all: f64 = parts.iter().sum();
        parts.map(|part| part / all)
    };
    let least = |face: &Triangle| weights(face).into_iter().fold(f64::INFINITY, f64::min);
    let mut best = (least(nearest), nearest);
    for face in faces {
        let same = face.height <= nearest.height + 4.0 * CERTAIN * size;
        if best.0 < 0.0 && same && least(face) > best.0 {
            best = (least(face), face);
        }
    }
    let weights = weights(best.1).map(|weight| weight.max(0.0));
    let all: f64 = weights.iter().sum();
    let corners = best.1.corners.iter().zip(weights);
    let on_a = corners.fold(Vec3::new(0.0, 0.0, 0.0), |sum, (i, weight)| {
        sum + vertices[*i].on_a * (weight / all)
    });
    // The difference is `b - a`, so `b` has to go the other way.
    let (normal, distance) = (-best.1.normal, -reach);
    Between { distance, normal, on_a, on_b: on_a + normal * distance }
}
