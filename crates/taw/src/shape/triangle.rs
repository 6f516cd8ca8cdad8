use cgmath::{EuclideanSpace, InnerSpace};

use super::polygon::project_on_segment;
use super::{Aabb, Aabb3, BoundedShape, PointProjection};
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector, normalize_and_length};

/// A triangle: two-sided and without volume. It may be a sliver, a segment or a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle<S> {
    /// Vertices in metres, counterclockwise as seen from where the normal points.
    pub corners: [Point3<S>; 3],
}

impl<S: Scalar> Triangle<S> {
    /// The unit normal, unless the vertices are collinear.
    #[must_use]
    pub fn normal(&self) -> Option<Vec3<S>> {
        let [a, b, c] = self.corners;
        let longest = [b - a, c - b, a - c].map(InnerSpace::magnitude2).into_iter();
        let longest = longest.fold(S::zero(), S::max);
        let (normal, twice) = normalize_and_length((b - a).cross(c - a))?;
        // Thinner than this, rounding would choose the normal.
        (twice > longest * S::epsilon()).then_some(normal)
    }

    /// Projects a point onto the triangle as a part of the surface of a solid: a point of that
    /// straight behind the triangle, by no more than its width, is inside.
    pub(crate) fn project_point_one_sided(
        &self,
        point: Point3<S>,
        is_in_solid: impl FnOnce(Point3<S>) -> bool,
    ) -> PointProjection<S> {
        let [a, b, c] = self.corners;
        let deepest = (b - a).magnitude().min((c - a).magnitude());
        let near = self.project_point(point);
        match self.normal() {
            // Straight behind, to within rounding.
            Some(up)
                if near.distance > S::zero()
                    && near.distance <= deepest
                    && (near.normal + up).magnitude() < S::from_f64(1e-3)
                    && is_in_solid(point) =>
            {
                near.flipped()
            }
            _ => near,
        }
    }

    /// The point nearest to the origin, on an edge or in the interior.
    pub(crate) fn project_origin(&self) -> Point3<S> {
        let [a, b, c] = self.corners.map(EuclideanSpace::to_vec);
        let (ab, ac) = (b - a, c - a);
        let normal = ab.cross(ac);
        let squared = normal.magnitude2();
        let longest = ab.magnitude2().max(ac.magnitude2());
        // Thinner than this, rounding would choose the normal.
        if squared > longest * longest * S::epsilon() {
            let beside = |p: Vec3<S>, along: Vec3<S>| along.cross(normal).dot(p) < S::zero();
            let beside = [beside(a, ab), beside(b, c - b), beside(a, -ac)];
            if beside == [false; 3] {
                return Point3::from_vec(normal * (a.dot(normal) / squared));
            }
            // The nearest edge is one that the point is beside.
            return self.project_on_edges(Point3::origin(), beside);
        }
        self.project_on_edges(Point3::origin(), [true; 3])
    }

    /// Projects a point onto the nearest of some edges, of which there is one at least.
    fn project_on_edges(&self, point: Point3<S>, chosen: [bool; 3]) -> Point3<S> {
        let [a, b, c] = self.corners;
        let edges = [[a, b], [b, c], [c, a]].into_iter().zip(chosen);
        let edges = edges.filter(|(_, is_chosen)| *is_chosen);
        let nearest = edges.map(|([p, q], _)| project_on_segment(p, q, point));
        let far = |p: Point3<S>| (p - point).magnitude2();
        nearest.fold(a, |best, next| if far(next) < far(best) { next } else { best })
    }
}

impl<S: Scalar> BoundedShape<S> for Triangle<S> {
    fn support(&self, direction: Vec3<S>) -> Point3<S> {
        let [a, b, c] = self.corners;
        let farther = |best: Point3<S>, next: Point3<S>| {
            if (next - best).dot(direction) > S::zero() { next } else { best }
        };
        farther(farther(a, b), c)
    }

    fn bounding_box(&self) -> Aabb3<S> {
        let [a, b, c] = self.corners.map(|corner| Aabb { min: corner, max: corner });
        a.union(&b).union(&c)
    }

    fn volume(&self) -> S {
        S::zero()
    }

    /// Never inside: the distance is zero on the triangle and positive elsewhere.
    fn project_point(&self, point: Point3<S>) -> PointProjection<S> {
        // In f64 relative to the point, or rounding would choose between the sides.
        let origin = cast_point::<S, f64>(point);
        let local = |corner| Point3::from_vec(cast_point::<S, f64>(corner) - origin);
        let exact = Triangle { corners: self.corners.map(local) };
        let there = exact.project_origin();
        let out = normalize_and_length(-there.to_vec());
        let (normal, distance) =
            out.unwrap_or_else(|| (exact.normal().unwrap_or_else(Vec3::unit_y), 0.0));
        PointProjection {
            point: cast_point(origin + there.to_vec()),
            normal: cast_vector(normal),
            distance: S::from_f64(distance),
        }
    }
}
