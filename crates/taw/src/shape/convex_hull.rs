//! Exact convex hull of points with integer coordinates: nothing is rounded, so coplanar, collinear
//! and coincident points are no special case.

use std::collections::BTreeSet;

use crate::math::Vec3;

/// A point with coordinates below 2³⁹, so that volumes fit in 128 bits.
type Point = Vec3<i128>;

/// Outward-facing triangles of the convex hull; none if the points are coplanar. Points in a face
/// or an edge may or may not be vertices.
///
/// Incremental beneath-beyond method (Preparata and Shamos, *Computational Geometry*, 1985,
/// §3.4.2): an outside point replaces the triangles that it sees by those from it to their horizon.
/// A coplanar triangle is not seen, so none of the new ones is degenerate.
pub(super) fn convex_hull(points: &[Point]) -> Option<Vec<[u32; 3]>> {
    let at = |corner: u32| points[corner as usize];
    let is_outside = |[a, b, c]: [u32; 3], point: u32| volume([a, b, c, point].map(at)) > 0;
    let others = || 1..points.len() as u32;
    // Extreme points, so that the first tetrahedron is large.
    let far = |b: u32| approximate_length(at(b) - at(0));
    let b = others().filter(|b| at(*b) != at(0)).max_by(|s, t| far(*s).total_cmp(&far(*t)))?;
    let wide = |c: u32| (at(b) - at(0)).cross(at(c) - at(0));
    let c = others()
        .filter(|c| wide(*c) != Vec3::new(0, 0, 0))
        .max_by(|s, t| approximate_length(wide(*s)).total_cmp(&approximate_length(wide(*t))))?;
    let deep = |d: u32| volume([0, b, c, d].map(at)).abs();
    let d = others().filter(|d| deep(*d) != 0).max_by_key(|d| deep(*d))?;
    let [b, c] = if is_outside([0, b, c], d) { [c, b] } else { [b, c] };
    let mut triangles = vec![[0, b, c], [0, c, d], [c, b, d], [b, 0, d]];
    let mut sides = BTreeSet::new();
    for point in others() {
        sides.clear();
        triangles.retain(|[a, b, c]| {
            let seen = is_outside([*a, *b, *c], point);
            if seen {
                sides.extend([(*a, *b), (*b, *c), (*c, *a)]);
            }
            !seen
        });
        let outline = sides.iter().filter(|(a, b)| !sides.contains(&(*b, *a)));
        triangles.extend(outline.map(|(a, b)| [*a, *b, point]));
    }
    Some(triangles)
}

/// Six times the signed volume of a tetrahedron; positive if the fourth vertex is in front of the
/// other three.
fn volume([a, b, c, d]: [Point; 4]) -> i128 {
    let (normal, out) = ((b - a).cross(c - a), d - a);
    normal.x * out.x + normal.y * out.y + normal.z * out.z
}

/// Approximate length.
fn approximate_length(v: Point) -> f64 {
    let v = v.map(|x| x as f64);
    v.x.hypot(v.y).hypot(v.z)
}
