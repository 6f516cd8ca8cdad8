//! Distance of two cores by GJK (Gilbert, Johnson and Keerthi 1988; Voronoi regions as in Ericson,
//! *Real-Time Collision Detection*, 2005, §9.5).

use cgmath::InnerSpace;

use super::closest::{LocalClosestPoints, TOLERANCE};
use super::core::Core;
use crate::math::Vec3;

/// A vertex of the Minkowski difference `B − A`, with its witness point on A.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    pub difference: Vec3<f64>,
    pub on_a: Vec3<f64>,
}

/// Support point of the Minkowski difference along a direction.
#[inline]
pub(super) fn vertex(a: &Core<'_>, b: &Core<'_>, direction: Vec3<f64>) -> Vertex {
    let (on_a, on_b) = (a.support(-direction).0, b.support(direction).0);
    Vertex { difference: on_b - on_a, on_a }
}

/// Result of GJK.
pub(super) enum Gjk {
    Separated(LocalClosestPoints),
    /// Farther apart than the limit.
    OutOfRange,
    /// A tetrahedron of the Minkowski difference around the origin.
    Overlapping([Vertex; 4]),
    NotConverged,
}

/// Simplex of the Minkowski difference with the barycentric weights of its point nearest to the
/// origin.
#[derive(Clone, Copy)]
struct Simplex {
    vertices: [Vertex; 4],
    weights: [f64; 4],
    count: usize,
}

impl Simplex {
    fn of<const N: usize>(vertices: [Vertex; N], weights: [f64; N]) -> Self {
        let zero = Vec3::new(0.0, 0.0, 0.0);
        let unused = Vertex { difference: zero, on_a: zero };
        let mut simplex = Self { vertices: [unused; 4], weights: [0.0; 4], count: N };
        simplex.vertices[..N].copy_from_slice(&vertices);
        simplex.weights[..N].copy_from_slice(&weights);
        simplex
    }

    fn sum(&self, of: impl Fn(&Vertex) -> Vec3<f64>) -> Vec3<f64> {
        let parts = self.vertices.iter().zip(&self.weights).take(self.count);
        parts.fold(Vec3::new(0.0, 0.0, 0.0), |sum, (vertex, weight)| sum + of(vertex) * *weight)
    }
}

/// Enough for any pair of hulls; more is a sign of rounding.
const MAX_ITERATIONS: usize = 100;

/// Runs GJK from a start direction. Ends early beyond the `limit`; `size` is the extent of both.
pub(super) fn gjk(a: &Core<'_>, b: &Core<'_>, start: Vec3<f64>, size: f64, limit: f64) -> Gjk {
    let mut simplex = Simplex::of([vertex(a, b, start)], [1.0]);
    let mut least = f64::INFINITY;
    for _ in 0..MAX_ITERATIONS {
        let nearest = simplex.sum(|vertex| vertex.difference);
        let squared = nearest.magnitude2();
        let distance = squared.sqrt();
        if distance.is_nan() || distance <= TOLERANCE * size {
            return Gjk::NotConverged; // they touch
        }
        let next = vertex(a, b, -nearest);
        // Lower bound: no point of the difference is nearer than the plane through this vertex.
        let gap_to_bound = (squared - next.difference.dot(nearest)) / distance;
        if distance - gap_to_bound > limit {
            return Gjk::OutOfRange;
        }
        if gap_to_bound <= 0.1 * TOLERANCE * size {
            let on_a = simplex.sum(|vertex| vertex.on_a);
            let normal = nearest / distance;
            return Gjk::Separated(LocalClosestPoints {
                distance,
                normal,
                on_a,
                on_b: on_a + nearest,
            });
        }
        if squared >= least {
            return Gjk::NotConverged; // no better than before
        }
        least = squared;
        let [p, q, r, _] = simplex.vertices;
        simplex = match simplex.count {
            1 => closest_on_segment([p, next]),
            2 => closest_on_triangle([p, q, next]),
            _ => match closest_on_tetrahedron(&[p, q, r, next]) {
                Some(simplex) => simplex,
                None => return Gjk::Overlapping([p, q, r, next]),
            },
        };
    }
    Gjk::NotConverged
}

#[inline]
fn closest_on_segment([p, q]: [Vertex; 2]) -> Simplex {
    let along = q.difference - p.difference;
    let fraction = -p.difference.dot(along) / along.magnitude2();
    if fraction > 0.0 && fraction < 1.0 {
        Simplex::of([p, q], [1.0 - fraction, fraction])
    } else {
        Simplex::of([if fraction >= 1.0 { q } else { p }], [1.0])
    }
}

/// Classifies the origin by Voronoi region.
#[inline]
fn closest_on_triangle([p, q, r]: [Vertex; 3]) -> Simplex {
    let (a, b, c) = (p.difference, q.difference, r.difference);
    let (ab, ac) = (b - a, c - a);
    let (d1, d2) = (-ab.dot(a), -ac.dot(a));
    if d1 <= 0.0 && d2 <= 0.0 {
        return Simplex::of([p], [1.0]);
    }
    let (d3, d4) = (-ab.dot(b), -ac.dot(b));
    if d3 >= 0.0 && d4 <= d3 {
        return Simplex::of([q], [1.0]);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return closest_on_segment([p, q]);
    }
    let (d5, d6) = (-ab.dot(c), -ac.dot(c));
    if d6 >= 0.0 && d5 <= d6 {
        return Simplex::of([r], [1.0]);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return closest_on_segment([p, r]);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return closest_on_segment([q, r]);
    }
    let all = va + vb + vc;
    Simplex::of([p, q, r], [va / all, vb / all, vc / all])
}

/// Returns none if the origin is inside.
fn closest_on_tetrahedron(vertices: &[Vertex; 4]) -> Option<Simplex> {
    let mut best: Option<(f64, Simplex)> = None;
    for [i, j, k, l] in [[0, 1, 2, 3], [0, 2, 3, 1], [0, 3, 1, 2], [1, 3, 2, 0]] {
        let [x, y, z, other] = [i, j, k, l].map(|i: usize| &vertices[i]);
        let normal = (y.difference - x.difference).cross(z.difference - x.difference);
        let inner = (other.difference - x.difference).dot(normal);
        let origin = -x.difference.dot(normal);
        // Beyond the face, seen from the fourth vertex, or degenerate.
        if origin * inner > 0.0 {
            continue;
        }
        let simplex = closest_on_triangle([*x, *y, *z]);
        let squared = simplex.sum(|vertex| vertex.difference).magnitude2();
        if best.as_ref().is_none_or(|(least, _)| squared < *least) {
            best = Some((squared, simplex));
        }
    }
    best.map(|(_, simplex)| simplex)
}
