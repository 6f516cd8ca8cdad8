use cgmath::{Array, Point2};

use super::{Aabb, Aabb3, BoundedShape, PointProjection};
use crate::Error;
use crate::error::{coordinates, positive};
use crate::math::{Point3, Scalar, Vec3, normalize_and_length};

/// Ball: all points within `radius` of `center`, in two or three dimensions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NBall<P, S> {
    /// Center, in metres.
    pub center: P,
    /// Radius in metres, finite and above zero.
    pub radius: S,
}

/// A ball in three dimensions.
pub type Sphere<S> = NBall<Point3<S>, S>;

/// A ball in two dimensions.
pub type Circle<S> = NBall<Point2<S>, S>;

impl<P, S: Scalar> NBall<P, S>
where
    P: Array<Element = S> + Copy,
{
    /// Validates a ball.
    ///
    /// # Errors
    /// [`Error::NotFinite`] for the center, [`Error::NotPositive`] for the radius.
    pub fn new(center: P, radius: S) -> Result<Self, Error> {
        coordinates(["center.x", "center.y", "center.z"], center)?;
        Ok(Self { center, radius: positive("radius", radius)? })
    }

    /// Returns true for a point inside or on the surface.
    #[must_use]
    pub fn contains_point(&self, point: P) -> bool {
        let along = (0..P::len()).map(|axis| point[axis] - self.center[axis]);
        along.fold(S::zero(), S::hypot) <= self.radius
    }

    /// Bounding box.
    #[must_use]
    pub fn bounds(&self) -> Aabb<P> {
        let mut bounds = Aabb { min: self.center, max: self.center };
        for axis in 0..P::len() {
            bounds.min[axis] -= self.radius;
            bounds.max[axis] += self.radius;
        }
        bounds
    }
}

impl<S: Scalar> BoundedShape<S> for Sphere<S> {
    fn support(&self, direction: Vec3<S>) -> Point3<S> {
        let (unit, _) = normalize_and_length(direction).unwrap_or((Vec3::unit_x(), S::zero()));
        self.center + unit * self.radius
    }

    fn bounding_box(&self) -> Aabb3<S> {
        self.bounds()
    }

    fn volume(&self) -> S {
        let factor = S::from_f64(4.0 / 3.0 * std::f64::consts::PI);
        factor * self.radius * self.radius * self.radius
    }

    fn project_point(&self, point: Point3<S>) -> PointProjection<S> {
        let apart = normalize_and_length(point - self.center);
        let (normal, length) = apart.unwrap_or((Vec3::unit_x(), S::zero()));
        let distance = length - self.radius;
        PointProjection { point: self.center + normal * self.radius, normal, distance }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_input_is_refused_by_name() {
        let origin = Point3::new(0.0, 0.0, 0.0);
        for radius in [0.0, -1.0, f64::INFINITY] {
            let error = Sphere::new(origin, radius).unwrap_err();
            assert_eq!(error, Error::NotPositive { field: "radius", value: radius });
        }
        let error = Sphere::new(Point3::new(0.0, f64::NEG_INFINITY, 0.0), 1.0).unwrap_err();
        assert_eq!(error.to_string(), "center.y must be finite, but is -inf");
        assert!(Circle::new(Point2::new(f32::NAN, 0.0), 1.0).is_err());
    }

    #[test]
    fn circles_are_balls_too() {
        let circle = Circle::new(Point2::new(1.0, 2.0), 0.5).unwrap();
        assert!(
            circle.contains_point(Point2::new(1.5, 2.0))
                && !circle.contains_point(Point2::new(1.4, 2.4))
        );
        assert_eq!(circle.bounds().max, Point2::new(1.5, 2.5));
    }
}
