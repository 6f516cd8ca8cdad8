use cgmath::{EuclideanSpace, InnerSpace};

use super::polygon::closest_of_segment;
use super::{Aabb, Box3, Nearest, Solid};
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector, direction_and_length};

/// A flat piece of a surface. It has no inside, and both of its sides are alike. It may be
/// a sliver, or no more than a line or a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle<S> {
    /// In metres; counterclockwise as seen from where the normal points.
    pub corners: [Point3<S>; 3],
}

impl<S: Scalar> Triangle<S> {
    /// The unit normal, unless the corners lie on a line.
    #[must_use]
    pub fn normal(&self) -> Option<Vec3<S>> {
        let [a, b, c] = self.corners;
        let longest = [b - a, c - b, a - c].map(InnerSpace::magnitude2).into_iter();
        let longest = longest.fold(S::zero(), S::max);
        let (normal, twice) = direction_and_length((b - a).cross(c - a))?;
        // Thinner than this, rounding would choose the normal.
        (twice > longest * S::epsilon()).then_some(normal)
    }

    /// Where it is nearest to a point, if what is below it, against y, is solid: a point
    /// straight behind it, by no more than it is wide, is inside.
    pub(crate) fn nearest_if_solid_below(&self, point: Point3<S>) -> Nearest<S> {
        let [a, b, c] = self.corners;
        let deepest = (b - a).magnitude().min((c - a).magnitude());
        let near = self.nearest(point);
        let up = self.normal().map(|n| if n.y < S::zero() { -n } else { n });
        match up {
            // But for rounding.
            Some(up)
                if near.distance > S::zero()
                    && near.distance <= deepest
                    && (near.normal + up).magnitude() < S::constant(1e-3) =>
            {
                near.inside_out()
            }
            _ => near,
        }
    }

    /// Its point that is nearest to the origin: on a side that the origin is beside, or below
    /// or above it.
    pub(crate) fn closest_to_origin(&self) -> Point3<S> {
        let [a, b, c] = self.corners.map(EuclideanSpace::to_vec);
        let (ab, ac) = (b - a, c - a);
        let normal = ab.cross(ac);
        let squared = normal.magnitude2();
        let longest = ab.magnitude2().max(ac.magnitude2());
        // Thinner than this, rounding would choose the normal.
        if squared > longest * longest * S::epsilon() {
            let beside = |p: Vec3<S>, along: Vec3<S>| along.cross(normal).dot(p) < S::zero();
            if !beside(a, ab) && !beside(b, c - b) && !beside(a, -ac) {
                return Point3::from_vec(normal * (a.dot(normal) / squared));
            }
        }
        self.closest_of_sides(Point3::origin())
    }

    fn closest_of_sides(&self, point: Point3<S>) -> Point3<S> {
        let [a, b, c] = self.corners;
        let nearest = [[a, b], [b, c], [c, a]].map(|[p, q]| closest_of_segment(p, q, point));
        let far = |p: Point3<S>| (p - point).magnitude2();
        nearest.into_iter().fold(a, |best, next| if far(next) < far(best) { next } else { best })
    }
}

impl<S: Scalar> Solid<S> for Triangle<S> {
    fn support(&self, direction: Vec3<S>) -> Point3<S> {
        let [a, b, c] = self.corners;
        let farther = |best: Point3<S>, next: Point3<S>| {
            if (next - best).dot(direction) > S::zero() { next } else { best }
        };
        farther(farther(a, b), c)
    }

    fn bounding_box(&self) -> Box3<S> {
        let [a, b, c] = self.corners.map(|corner| Aabb { min: corner, max: corner });
        a.union(&b).union(&c)
    }

    fn volume(&self) -> S {
        S::zero()
    }

    /// Never inside: the distance is zero on it, and above zero elsewhere.
    fn nearest(&self, point: Point3<S>) -> Nearest<S> {
        // In f64 about the point, or rounding would choose between its sides.
        let origin = cast_point::<S, f64>(point);
        let local = |corner| Point3::from_vec(cast_point::<S, f64>(corner) - origin);
        let exact = Triangle { corners: self.corners.map(local) };
        let there = exact.closest_to_origin();
        let out = direction_and_length(-there.to_vec());
        let (normal, distance) =
            out.unwrap_or_else(|| (exact.normal().unwrap_or_else(Vec3::unit_y), 0.0));
        Nearest {
            point: cast_point(origin + there.to_vec()),
            normal: cast_vector(normal),
            distance: S::constant(distance),
        }
    }
}
