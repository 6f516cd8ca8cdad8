//! The triangles around points with whole coordinates, exactly: nothing is rounded, so
//! points in one plane, on one line or in one spot are no special case.

use std::collections::BTreeSet;

use crate::math::Vec3;

/// A point. Its coordinates are below 2³⁹, so that volumes fit in 128 bits.
type Point = Vec3<i128>;

/// The triangles around all points, outward by the right hand; none if the points lie in a
/// plane. Points in a face or an edge may be corners of triangles, or not.
///
/// Point by point: one that is outside replaces the triangles that it sees by those from
/// it to their outline (the beneath-beyond method; Preparata and Shamos, *Computational
/// Geometry*, 1985, §3.4.2). A triangle that it lies in the plane of is not seen, so
/// none of the new ones is flat.
pub(super) fn wrap(points: &[Point]) -> Option<Vec<[u32; 3]>> {
    let at = |corner: u32| points[corner as usize];
    let sees = |[a, b, c]: [u32; 3], point: u32| volume([a, b, c, point].map(at)) > 0;
    let others = || 1..points.len() as u32;
    // The farthest of each, so that the first tetrahedron is a large one.
    let far = |b: u32| rough(at(b) - at(0));
    let b = others().filter(|b| at(*b) != at(0)).max_by(|s, t| far(*s).total_cmp(&far(*t)))?;
    let wide = |c: u32| (at(b) - at(0)).cross(at(c) - at(0));
    let c = others()
        .filter(|c| wide(*c) != Vec3::new(0, 0, 0))
        .max_by(|s, t| rough(wide(*s)).total_cmp(&rough(wide(*t))))?;
    let deep = |d: u32| volume([0, b, c, d].map(at)).abs();
    let d = others().filter(|d| deep(*d) != 0).max_by_key(|d| deep(*d))?;
    let [b, c] = if sees([0, b, c], d) { [c, b] } else { [b, c] };
    let mut triangles = vec![[0, b, c], [0, c, d], [c, b, d], [b, 0, d]];
    let mut sides = BTreeSet::new();
    for point in others() {
        sides.clear();
        triangles.retain(|[a, b, c]| {
            let seen = sees([*a, *b, *c], point);
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

/// Six times the volume of a tetrahedron; above zero if the fourth is where the normal of
/// the other three points.
fn volume([a, b, c, d]: [Point; 4]) -> i128 {
    let (normal, out) = ((b - a).cross(c - a), d - a);
    normal.x * out.x + normal.y * out.y + normal.z * out.z
}

/// A length, roughly.
fn rough(v: Point) -> f64 {
    let v = v.map(|x| x as f64);
    v.x.hypot(v.y).hypot(v.z)
}
