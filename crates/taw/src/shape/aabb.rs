use cgmath::{Array, Point2};

use super::{BoundedShape, Obb, PointProjection};
use crate::Error;
use crate::error::{coordinates, within};
use crate::math::{Point3, Scalar, Vec3, length};

/// Axis-aligned bounding box in two or three dimensions. It may be flat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb<P> {
    /// Lower corner, in metres.
    pub min: P,
    /// Upper corner, in metres; no coordinate below the lower one.
    pub max: P,
}

/// Axis-aligned box in three dimensions.
pub type Aabb3<S> = Aabb<Point3<S>>;

/// Axis-aligned box in two dimensions.
pub type Aabb2<S> = Aabb<Point2<S>>;

impl<P, S: Scalar> Aabb<P>
where
    P: Array<Element = S> + Copy,
{
    /// Validates a box.
    ///
    /// # Errors
    /// [`Error::NotFinite`] for a corner, [`Error::OutOfRange`] for a `max` below `min`.
    pub fn new(min: P, max: P) -> Result<Self, Error> {
        coordinates(["min.x", "min.y", "min.z"], min)?;
        coordinates(["max.x", "max.y", "max.z"], max)?;
        for (axis, field) in (0..P::len()).zip(["max.x", "max.y", "max.z"]) {
            within(field, max[axis], min[axis], S::max_value())?;
        }
        Ok(Self { min, max })
    }

    /// Returns true for a point inside or on the surface.
    #[must_use]
    pub fn contains_point(&self, point: P) -> bool {
        (0..P::len()).all(|i| self.min[i] <= point[i] && point[i] <= self.max[i])
    }

    /// Returns true if the two boxes have a point in common.
    #[must_use]
    pub fn overlaps(&self, other: &Self) -> bool {
        (0..P::len()).all(|i| self.min[i] <= other.max[i] && other.min[i] <= self.max[i])
    }

    /// The smallest box that contains both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        let (mut min, mut max) = (self.min, self.max);
        for i in 0..P::len() {
            min[i] = smaller(min[i], other.min[i]);
            max[i] = -smaller(-max[i], -other.max[i]);
        }
        Self { min, max }
    }

    /// The point of the box that is nearest to a given point.
    #[must_use]
    pub fn clamp(&self, point: P) -> P {
        let mut nearest = point;
        for i in 0..P::len() {
            nearest[i] = -smaller(-self.min[i], -smaller(nearest[i], self.max[i]));
        }
        nearest
    }
}

fn smaller<S: Scalar>(a: S, b: S) -> S {
    if b < a { b } else { a }
}

impl<S: Scalar> Aabb3<S> {
    /// Distance of its farthest corner from a point, in metres.
    pub(crate) fn farthest_distance(&self, point: Point3<S>) -> S {
        let [low, high] = [self.min, self.max].map(|corner| (corner - point).map(S::abs));
        length(low.zip(high, S::max))
    }

    /// Converts to an oriented box.
    #[must_use]
    pub fn obb(&self) -> Obb<S> {
        Obb::from_aabb(self)
    }

    /// Distance of a point from the box in metres; zero inside.
    #[must_use]
    pub fn distance_to_point(&self, point: Point3<S>) -> S {
        length(point - self.clamp(point))
    }

    /// Center of the box.
    #[must_use]
    pub fn center(&self) -> Point3<S> {
        self.min + (self.max - self.min) * S::from_f64(0.5)
    }
}

impl<S: Scalar> BoundedShape<S> for Aabb3<S> {
    fn support(&self, direction: Vec3<S>) -> Point3<S> {
        let mut point = self.min;
        for axis in 0..3 {
            if direction[axis] > S::zero() {
                point[axis] = self.max[axis];
            }
        }
        point
    }

    fn bounding_box(&self) -> Self {
        *self
    }

    fn volume(&self) -> S {
        let size = self.max - self.min;
        size.x * size.y * size.z
    }

    fn project_point(&self, point: Point3<S>) -> PointProjection<S> {
        self.obb().project_point(point)
    }

    fn contains(&self, point: Point3<S>) -> bool {
        self.contains_point(point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_input_is_refused_by_name() {
        let at = |x: f32| Point3::new(0.0, x, 0.0);
        let error = Aabb::new(at(1.0), at(0.5)).unwrap_err();
        assert!(error.to_string().starts_with("max.y must be finite and at least 1, "), "{error}");
        assert!(Aabb::new(at(0.0), at(f32::NAN)).is_err());
        assert!(Aabb::new(at(1.0), at(1.0)).is_ok(), "flat");
    }

    #[test]
    fn rectangles_are_boxes_too() {
        let new = |a: f64, b: f64| Aabb2::new(Point2::new(a, a), Point2::new(b, b)).unwrap();
        let (first, second) = (new(0.0, 2.0), new(2.0, 3.0));
        assert!(first.overlaps(&second), "they touch");
        assert!(!first.overlaps(&new(2.1, 3.0)));
        assert_eq!(first.union(&second), new(0.0, 3.0));
        assert_eq!(first.clamp(Point2::new(-1.0, 1.5)), Point2::new(0.0, 1.5));
        assert!(
            first.contains_point(Point2::new(2.0, 0.0))
                && !first.contains_point(Point2::new(2.0, -0.1))
        );
    }
}
