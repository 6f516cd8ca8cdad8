use super::closest::{Closest, closest};
use super::core::Convex;
use super::manifold::{Manifold, manifold};
use super::sweep::{Touch, sweep};
use crate::math::{Scalar, Vec3};
use crate::shape::Shape;

/// What two parts of shapes say of each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OfParts<T> {
    /// The convex parts, by their places among all of their shape's, in order; zero for a
    /// shape that has only one.
    pub parts: [u32; 2],
    /// The answer.
    pub answer: T,
}

/// All convex parts of a shape, those of compounds in compounds, too.
#[must_use]
pub fn parts_of<S: Scalar>(shape: &Shape<S>) -> Vec<&dyn Convex<S>> {
    match shape {
        Shape::Sphere(sphere) => vec![sphere],
        Shape::Aabb(aabb) => vec![aabb],
        Shape::Obb(obb) => vec![obb],
        Shape::Capsule(capsule) => vec![capsule],
        Shape::Hull(hull) => vec![hull],
        Shape::Compound(compound) => compound.parts().iter().flat_map(parts_of).collect(),
    }
}

/// Asks each part of one about each part of the other.
fn each<S: Scalar, T>(
    a: &Shape<S>,
    b: &Shape<S>,
    ask: impl Fn(&dyn Convex<S>, &dyn Convex<S>) -> Option<T>,
) -> Vec<OfParts<T>> {
    let (first, second) = (parts_of(a), parts_of(b));
    let mut answers = Vec::new();
    for (i, x) in (0..).zip(&first) {
        for (j, y) in (0..).zip(&second) {
            answers.extend(ask(*x, *y).map(|answer| OfParts { parts: [i, j], answer }));
        }
    }
    answers
}

/// The answer with the least of something; of several, the first.
fn least<S: Scalar, T>(answers: Vec<OfParts<T>>, of: impl Fn(&T) -> S) -> Option<OfParts<T>> {
    let less = |s: &OfParts<T>, t: &OfParts<T>| of(&t.answer) < of(&s.answer);
    answers.into_iter().reduce(|best, next| if less(&best, &next) { next } else { best })
}

/// Where two shapes are nearest to each other, or where two of their parts are deepest in
/// each other. None for a compound without parts, which cannot be made.
#[must_use]
pub fn closest_shapes<S: Scalar>(a: &Shape<S>, b: &Shape<S>) -> Option<OfParts<Closest<S>>> {
    least(each(a, b, |x, y| Some(closest(x, y))), |answer| answer.distance)
}

/// Where two shapes touch, or are at most `margin` metres apart: part by part.
#[must_use]
pub fn manifolds_of_shapes<S: Scalar>(
    a: &Shape<S>,
    b: &Shape<S>,
    margin: S,
) -> Vec<OfParts<Manifold<S>>> {
    each(a, b, |x, y| Some(manifold(x, y, margin)).filter(|found| !found.points.is_empty()))
}

/// When two shapes that move along straight lines, without turning, first touch, if they do;
/// as [`sweep`] of each two of their parts.
#[must_use]
pub fn sweep_shapes<S: Scalar>(
    a: &Shape<S>,
    a_moves: Vec3<S>,
    b: &Shape<S>,
    b_moves: Vec3<S>,
) -> Option<OfParts<Touch<S>>> {
    least(each(a, b, |x, y| sweep(x, a_moves, y, b_moves)), |answer| answer.time)
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
        let near = closest_shapes(&corner(), &ball(4.0, 1.5)).unwrap();
        assert_eq!((near.parts, near.answer.distance), ([0, 0], 0.5));
        let near = closest_shapes(&ball(1.25, 4.0), &corner()).unwrap();
        assert_eq!((near.parts, near.answer.normal), ([0, 1], -Vec3::unit_x()));
    }

    #[test]
    fn a_ball_in_a_corner_touches_both_parts() {
        let touches = manifolds_of_shapes(&corner(), &ball(1.0, 1.0), 1e-9);
        let seen: Vec<_> = touches.iter().map(|t| (t.parts, t.answer.normal)).collect();
        assert_eq!(seen, [([0, 0], Vec3::unit_y()), ([1, 0], Vec3::unit_x())]);
        assert_eq!(manifolds_of_shapes(&corner(), &ball(3.0, 3.0), 0.1), []);
    }

    #[test]
    fn the_part_that_is_met_first_stops_it() {
        let moves = Vec3::new(-4.0, -2.0, 0.0);
        let touch = sweep_shapes(&corner(), Vec3::new(0.0, 0.0, 0.0), &ball(3.0, 2.5), moves);
        let touch = touch.unwrap();
        assert_eq!(touch.parts, [1, 0], "the wall");
        assert!((touch.answer.time - 0.5).abs() < 1e-9);
        let away = Vec3::new(4.0, 2.0, 0.0);
        let still = Vec3::new(0.0, 0.0, 0.0);
        assert_eq!(sweep_shapes(&corner(), still, &ball(3.0, 2.5), away), None);
    }
}
