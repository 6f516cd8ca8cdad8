use cgmath::{Array, Point2};

use super::{Nearest, Obb, Solid};
use crate::Error;
use crate::error::{coordinates, within};
use crate::math::{Point3, Scalar, Vec3, length};

/// A box along the axes, in a space of two or three dimensions. It may be flat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb<P> {
    /// The corner with the least coordinates, in metres.
    pub min: P,
    /// The corner with the greatest, none of them below the least.
    pub max: P,
}

/// A box along the axes in three dimensions.
pub type Box3<S> = Aabb<Point3<S>>;

/// A box along the axes in two dimensions.
pub type Rectangle<S> = Aabb<Point2<S>>;

impl<P, S: Scalar> Aabb<P>
where
    P: Array<Element = S> + Copy,
{
    /// A box, checked.
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

    /// Whether a point is in it or on its surface.
    #[must_use]
    pub fn has(&self, point: P) -> bool {
        (0..P::len()).all(|i| self.min[i] <= point[i] && point[i] <= self.max[i])
    }

    /// Whether the two have a point in common.
    #[must_use]
    pub fn overlaps(&self, other: &Self) -> bool {
        (0..P::len()).all(|i| self.min[i] <= other.max[i] && other.min[i] <= self.max[i])
    }

    /// The smallest box that both are in.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        let (mut min, mut max) = (self.min, self.max);
        for i in 0..P::len() {
            min[i] = least(min[i], other.min[i]);
            max[i] = -least(-max[i], -other.max[i]);
        }
        Self { min, max }
    }

    /// The point of the box that is nearest to another one.
    #[must_use]
    pub fn clamp(&self, point: P) -> P {
        let mut nearest = point;
        for i in 0..P::len() {
            nearest[i] = -least(-self.min[i], -least(nearest[i], self.max[i]));
        }
        nearest
    }
}

fn least<S: Scalar>(a: S, b: S) -> S {
    if b < a { b } else { a }
}

impl<S: Scalar> Box3<S> {
    /// The same box as one that may turn.
    #[must_use]
    pub fn obb(&self) -> Obb<S> {
        Obb::along_axes(self)
    }

    /// How far a point is outside, in metres; zero inside.
    #[must_use]
    pub fn gap(&self, point: Point3<S>) -> S {
        length(point - self.clamp(point))
    }

    /// The middle.
    #[must_use]
    pub fn center(&self) -> Point3<S> {
        self.min + (self.max - self.min) * S::constant(0.5)
    }
}

impl<S: Scalar> Solid<S> for Box3<S> {
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

    fn nearest(&self, point: Point3<S>) -> Nearest<S> {
        self.obb().nearest(point)
    }

    fn contains(&self, point: Point3<S>) -> bool {
        self.has(point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_input_is_refused_by_name() {
        let at = |x: f32| Point3::new(0.0, x, 0.0);
        let error = Aabb::new(at(1.0), at(0.5)).unwrap_err();
        assert!(error.to_string().starts_with("max.y must be in [1, "), "{error}");
        assert!(Aabb::new(at(0.0), at(f32::NAN)).is_err());
        assert!(Aabb::new(at(1.0), at(1.0)).is_ok(), "flat");
    }

    #[test]
    fn rectangles_are_boxes_too() {
        let new = |a: f64, b: f64| Rectangle::new(Point2::new(a, a), Point2::new(b, b)).unwrap();
        let (first, second) = (new(0.0, 2.0), new(2.0, 3.0));
        assert!(first.overlaps(&second), "they touch");
        assert!(!first.overlaps(&new(2.1, 3.0)));
        assert_eq!(first.union(&second), new(0.0, 3.0));
        assert_eq!(first.clamp(Point2::new(-1.0, 1.5)), Point2::new(0.0, 1.5));
        assert!(first.has(Point2::new(2.0, 0.0)) && !first.has(Point2::new(2.0, -0.1)));
    }
}
