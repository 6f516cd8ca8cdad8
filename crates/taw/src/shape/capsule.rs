use cgmath::InnerSpace;

use super::{Aabb, Aabb3, BoundedShape, PointProjection, Sphere};
use crate::Error;
use crate::error::{finite_point, positive};
use crate::frame::Pose;
use crate::math::{Point3, Scalar, Vec3, length, normalize_and_length};

/// A capsule: all points within `radius` of the segment from `a` to `b`. With coincident ends it is
/// a sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule<S> {
    /// First end of the segment, in metres.
    pub a: Point3<S>,
    /// Second end of the segment, in metres.
    pub b: Point3<S>,
    /// Radius in metres, finite and above zero.
    pub radius: S,
}

impl<S: Scalar> Capsule<S> {
    /// Validates a capsule.
    ///
    /// # Errors
    /// [`Error::NotFinite`] for an end, [`Error::NotPositive`] for the radius.
    pub fn new(a: Point3<S>, b: Point3<S>, radius: S) -> Result<Self, Error> {
        Ok(Self {
            a: finite_point(["a.x", "a.y", "a.z"], a)?,
            b: finite_point(["b.x", "b.y", "b.z"], b)?,
            radius: positive("radius", radius)?,
        })
    }

    /// Transforms the capsule by a pose.
    #[must_use]
    pub fn transformed(&self, pose: Pose<S>) -> Self {
        Self { a: pose.transform_point(self.a), b: pose.transform_point(self.b), ..*self }
    }

    /// The point of the segment that is nearest to a given point (Ericson, *Real-Time Collision
    /// Detection*, 2005, §5.1.2).
    #[must_use]
    pub fn project_on_segment(&self, point: Point3<S>) -> Point3<S> {
        let Some((along, long)) = normalize_and_length(self.b - self.a) else { return self.a };
        let part = (point - self.a).dot(along);
        if part <= S::zero() {
            self.a
        } else if part >= long {
            self.b
        } else {
            self.a + along * part
        }
    }
}

impl<S: Scalar> BoundedShape<S> for Capsule<S> {
    fn support(&self, direction: Vec3<S>) -> Point3<S> {
        let center = if (self.b - self.a).dot(direction) > S::zero() { self.b } else { self.a };
        Sphere { center, radius: self.radius }.support(direction)
    }

    fn bounding_box(&self) -> Aabb3<S> {
        let ends = Aabb { min: self.a, max: self.a }.union(&Aabb { min: self.b, max: self.b });
        let reach = Vec3::new(self.radius, self.radius, self.radius);
        Aabb { min: ends.min - reach, max: ends.max + reach }
    }

    fn volume(&self) -> S {
        let disc = S::from_f64(std::f64::consts::PI) * self.radius * self.radius;
        disc * (length(self.b - self.a) + S::from_f64(4.0 / 3.0) * self.radius)
    }

    fn project_point(&self, point: Point3<S>) -> PointProjection<S> {
        let center = self.project_on_segment(point);
        let out = point - center;
        // On the segment, to within rounding, every perpendicular is equally short.
        let largest = [self.a, self.b, point]
            .iter()
            .flat_map(|p| [p.x.abs(), p.y.abs(), p.z.abs()])
            .fold(S::zero(), S::max);
        let (normal, far) = normalize_and_length(out)
            .filter(|(_, far)| *far > largest * S::epsilon() * S::from_f64(4.0))
            .unwrap_or_else(|| (any_perpendicular(self.b - self.a), S::zero()));
        let distance = far - self.radius;
        PointProjection { point: center + normal * self.radius, normal, distance }
    }
}

/// Any unit vector perpendicular to a direction; +x for zero.
pub(crate) fn any_perpendicular<S: Scalar>(direction: Vec3<S>) -> Vec3<S> {
    let Some((unit, _)) = normalize_and_length(direction) else { return Vec3::unit_x() };
    // From the axis that it is least aligned with.
    let [x, y, z] = [unit.x.abs(), unit.y.abs(), unit.z.abs()];
    let axis = if x <= y && x <= z {
        Vec3::unit_x()
    } else if y <= z {
        Vec3::unit_y()
    } else {
        Vec3::unit_z()
    };
    let beside = axis - unit * axis.dot(unit);
    beside.normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_input_is_refused_by_name() {
        let origin = Point3::new(0.0_f32, 0.0, 0.0);
        let nan = Point3::new(0.0, 0.0, f32::NAN);
        assert_eq!(
            Capsule::new(origin, nan, 1.0).unwrap_err().to_string(),
            "b.z must be finite, but is NaN"
        );
        assert!(Capsule::new(origin, origin, 0.0).is_err());
    }

    #[test]
    fn a_capsule_of_no_length_is_a_sphere() {
        let at = Point3::new(1.0_f64, 2.0, 3.0);
        let capsule = Capsule::new(at, at, 0.5).unwrap();
        let sphere = Sphere::new(at, 0.5).unwrap();
        for point in [at, Point3::new(4.0, 2.0, 3.0), Point3::new(1.1, 2.1, 3.1)] {
            assert_eq!(capsule.project_point(point), sphere.project_point(point));
        }
        assert_eq!(capsule.bounding_box(), sphere.bounding_box());
        assert!((capsule.volume() - sphere.volume()).abs() < 1e-15);
        assert_eq!(capsule.support(Vec3::unit_y()), sphere.support(Vec3::unit_y()));
    }

    #[test]
    fn on_its_line_the_way_out_is_any_perpendicular() {
        let capsule =
            Capsule::new(Point3::new(0.0, -1.0, 0.0), Point3::new(0.0, 1.0, 0.0), 0.5).unwrap();
        let nearest = capsule.project_point(Point3::new(0.0_f64, 0.3, 0.0));
        assert_eq!((nearest.distance, nearest.normal.y), (-0.5, 0.0));
        let above = capsule.project_point(Point3::new(0.0, 2.0, 0.0));
        assert_eq!((above.distance, above.point), (0.5, Point3::new(0.0, 1.5, 0.0)));
    }
}
