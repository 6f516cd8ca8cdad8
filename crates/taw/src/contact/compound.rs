use super::closest::{ClosestPoints, closest_points};
use super::core::Convex;
use super::manifold::{Manifold, manifold};
use super::shape_cast::{ShapeCastHit, shape_cast};
use crate::math::{Scalar, Vec3};
use crate::shape::Shape;

/// Result for a pair of convex sub-shapes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SubShapeResult<T> {
    /// Indices of the convex sub-shapes, in depth-first order; zero for a simple shape.
    pub sub_shapes: [u32; 2],
    /// Result of the query.
    pub result: T,
}

/// Lists all convex sub-shapes, including those of nested compounds.
#[must_use]
pub fn sub_shapes<S: Scalar>(shape: &Shape<S>) -> Vec<&dyn Convex<S>> {
    match shape {
        Shape::Compound(compound) => compound.parts().iter().flat_map(sub_shapes).collect(),
        simple => as_convex(simple).into_iter().collect(),
    }
}

/// Convex shape of a part; none of a compound.
pub(crate) fn as_convex<S: Scalar>(shape: &Shape<S>) -> Option<&dyn Convex<S>> {
    match shape {
        Shape::Sphere(sphere) => Some(sphere),
        Shape::Aabb(aabb) => Some(aabb),
        Shape::Obb(obb) => Some(obb),
        Shape::Capsule(capsule) => Some(capsule),
        Shape::Hull(hull) => Some(hull),
        Shape::Compound(_) => None,
    }
}

/// Runs a query for every pair of sub-shapes.
fn query_pairs<S: Scalar, T>(
    a: &Shape<S>,
    b: &Shape<S>,
    query: impl Fn(&dyn Convex<S>, &dyn Convex<S>) -> Option<T>,
) -> Vec<SubShapeResult<T>> {
    let (first, second) = (sub_shapes(a), sub_shapes(b));
    let mut results = Vec::new();
    for (i, x) in (0..).zip(&first) {
        for (j, y) in (0..).zip(&second) {
            results
                .extend(query(*x, *y).map(|result| SubShapeResult { sub_shapes: [i, j], result }));
        }
    }
    results
}

/// The result with the smallest key; among equals, the first.
fn min_by<S: Scalar, T>(
    results: Vec<SubShapeResult<T>>,
    of: impl Fn(&T) -> S,
) -> Option<SubShapeResult<T>> {
    let less = |s: &SubShapeResult<T>, t: &SubShapeResult<T>| of(&t.result) < of(&s.result);
    results.into_iter().reduce(|best, next| if less(&best, &next) { next } else { best })
}

/// Closest points of two shapes, or deepest points of two of their sub-shapes. None for an empty
/// compound, which cannot be constructed.
#[must_use]
pub fn closest_points_of_shapes<S: Scalar>(
    a: &Shape<S>,
    b: &Shape<S>,
) -> Option<SubShapeResult<ClosestPoints<S>>> {
    min_by(query_pairs(a, b, |x, y| Some(closest_points(x, y))), |result| result.distance)
}

/// Contact manifolds of two shapes, one per pair of sub-shapes at most `margin` metres apart.
#[must_use]
pub fn manifolds_of_shapes<S: Scalar>(
    a: &Shape<S>,
    b: &Shape<S>,
    margin: S,
) -> Vec<SubShapeResult<Manifold<S>>> {
    query_pairs(a, b, |x, y| Some(manifold(x, y, margin)).filter(|found| !found.points.is_empty()))
}

/// First contact of two shapes that translate along straight lines, if any; as [`shape_cast`] of
/// each pair of sub-shapes.
#[must_use]
pub fn shape_cast_of_shapes<S: Scalar>(
    a: &Shape<S>,
    a_translation: Vec3<S>,
    b: &Shape<S>,
    b_translation: Vec3<S>,
) -> Option<SubShapeResult<ShapeCastHit<S>>> {
    min_by(query_pairs(a, b, |x, y| shape_cast(x, a_translation, y, b_translation)), |result| {
        result.time
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Point3;
    use crate::shape::{Aabb, Compound, Sphere};

    /// A floor and a wall, in one.
    fn corner() -> Shape<f64> {
        let slab = |min: [f64; 3], max: [f64; 3]| {
            Shape::Aabb(Aabb::new(Point3::from(min), Point3::from(max)).unwrap())
        };
        let floor = slab([0.0, -1.0, -5.0], [9.0, 0.0, 5.0]);
        let wall = slab([-1.0, -1.0, -5.0], [0.0, 9.0, 5.0]);
        let inner = Shape::Compound(Compound::new(vec![wall]).unwrap());
        Shape::Compound(Compound::new(vec![floor, inner]).unwrap())
    }

    fn ball(x: f64, y: f64) -> Shape<f64> {
        Shape::Sphere(Sphere::new(Point3::new(x, y, 0.0), 1.0).unwrap())
    }

    #[test]
    fn the_nearest_part_answers() {
        let near = closest_points_of_shapes(&corner(), &ball(4.0, 1.5)).unwrap();
        assert_eq!((near.sub_shapes, near.result.distance), ([0, 0], 0.5));
        let near = closest_points_of_shapes(&ball(1.25, 4.0), &corner()).unwrap();
        assert_eq!((near.sub_shapes, near.result.normal), ([0, 1], -Vec3::unit_x()));
    }

    #[test]
    fn a_ball_in_a_corner_touches_both_parts() {
        let touches = manifolds_of_shapes(&corner(), &ball(1.0, 1.0), 1e-9);
        let seen: Vec<_> = touches.iter().map(|t| (t.sub_shapes, t.result.normal)).collect();
        assert_eq!(seen, [([0, 0], Vec3::unit_y()), ([1, 0], Vec3::unit_x())]);
        assert_eq!(manifolds_of_shapes(&corner(), &ball(3.0, 3.0), 0.1), []);
    }

    #[test]
    fn the_part_that_is_met_first_stops_it() {
        let moves = Vec3::new(-4.0, -2.0, 0.0);
        let touch =
            shape_cast_of_shapes(&corner(), Vec3::new(0.0, 0.0, 0.0), &ball(3.0, 2.5), moves);
        let touch = touch.unwrap();
        assert_eq!(touch.sub_shapes, [1, 0], "the wall");
        assert!((touch.result.time - 0.5).abs() < 1e-9);
        let away = Vec3::new(4.0, 2.0, 0.0);
        let still = Vec3::new(0.0, 0.0, 0.0);
        assert_eq!(shape_cast_of_shapes(&corner(), still, &ball(3.0, 2.5), away), None);
    }
}
