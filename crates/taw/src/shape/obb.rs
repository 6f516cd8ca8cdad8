use cgmath::{EuclideanSpace, InnerSpace, Matrix3, One};

use super::{Aabb, Aabb3, BoundedShape, PointProjection};
use crate::Error;
use crate::error::{finite_point, within};
use crate::frame::Pose;
use crate::math::{Point3, Quat, Scalar, Vec3, cast_vector, length, normalize_and_length};

/// Oriented bounding box. It may be flat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Obb<S> {
    /// Center, in metres.
    pub center: Point3<S>,
    /// Rotation, a unit quaternion.
    pub rotation: Quat<S>,
    /// Half extents along its own axes, in metres, none below zero.
    pub half_extents: Vec3<S>,
}

impl<S: Scalar> Obb<S> {
    /// Tolerance of the length of a rotation, as for the normal of a plane.
    const UNIT_TOLERANCE: f64 = 1e-5;

    /// Validates a box.
    ///
    /// # Errors
    /// [`Error::NotFinite`] for the center, [`Error::NotUnit`] for a rotation whose length is more
    /// than 1e-5 from one, [`Error::OutOfRange`] for a half extent below zero.
    pub fn new(center: Point3<S>, rotation: Quat<S>, half_extents: Vec3<S>) -> Result<Self, Error> {
        finite_point(["center.x", "center.y", "center.z"], center)?;
        let norm = rotation.s.as_f64().hypot(length(rotation.v).as_f64());
        if norm.is_nan() || (norm - 1.0).abs() > Self::UNIT_TOLERANCE {
            return Err(Error::NotUnit { field: "rotation", value: norm });
        }
        let fields = ["half_extents.x", "half_extents.y", "half_extents.z"];
        for (axis, field) in fields.into_iter().enumerate() {
            within(field, half_extents[axis], S::zero(), S::max_value())?;
        }
        Ok(Self { center, rotation, half_extents })
    }

    /// Converts an axis-aligned box.
    #[must_use]
    pub fn from_aabb(aabb: &Aabb3<S>) -> Self {
        let half_extents = (aabb.max - aabb.min) * S::from_f64(0.5);
        Self { center: aabb.min + half_extents, rotation: Quat::one(), half_extents }
    }

    /// Position and rotation.
    #[must_use]
    pub fn pose(&self) -> Pose<S> {
        Pose { rotation: self.rotation, translation: self.center.to_vec() }
    }

    /// Transforms the box by a pose.
    #[must_use]
    pub fn transformed(&self, pose: Pose<S>) -> Self {
        let (center, rotation) = (pose.transform_point(self.center), pose.rotation * self.rotation);
        Self { center, rotation, ..*self }
    }

    /// Local axes, as unit vectors of the world.
    #[must_use]
    pub fn axes(&self) -> [Vec3<S>; 3] {
        [Vec3::unit_x(), Vec3::unit_y(), Vec3::unit_z()].map(|axis| self.rotation * axis)
    }

    /// Local axes in `f64`, with the rotation normalized.
    pub(crate) fn axes_f64(&self) -> [Vec3<f64>; 3] {
        let (s, v) = (self.rotation.s.as_f64(), cast_vector(self.rotation.v));
        let rotation = Quat::from_sv(s, v).normalize();
        [Vec3::unit_x(), Vec3::unit_y(), Vec3::unit_z()].map(|axis| rotation * axis)
    }

    /// The eight corners: x changes first, then y, then z, from the negative side.
    #[must_use]
    pub fn corners(&self) -> [Point3<S>; 8] {
        let [x, y, z] = self.axes();
        let Vec3 { x: width, y: height, z: depth } = self.half_extents;
        std::array::from_fn(|i| {
            let side = |bit: usize| if i & bit == 0 { -S::one() } else { S::one() };
            let across = x * (width * side(1)) + y * (height * side(2)) + z * (depth * side(4));
            self.center + across
        })
    }
}

impl<S: Scalar> BoundedShape<S> for Obb<S> {
    fn support(&self, direction: Vec3<S>) -> Point3<S> {
        let mut local = self.half_extents;
        let along = self.rotation.conjugate() * direction;
        for axis in 0..3 {
            if along[axis] <= S::zero() {
                local[axis] = -local[axis];
            }
        }
        self.center + self.rotation * local
    }

    fn bounding_box(&self) -> Aabb3<S> {
        let [x, y, z] = self.axes();
        let size = self.half_extents;
        let reach = x.map(S::abs) * size.x + y.map(S::abs) * size.y + z.map(S::abs) * size.z;
        Aabb { min: self.center - reach, max: self.center + reach }
    }

    fn volume(&self) -> S {
        let Vec3 { x, y, z } = self.half_extents;
        S::from_f64(8.0) * x * y * z
    }

    fn project_point(&self, point: Point3<S>) -> PointProjection<S> {
        let turn = Matrix3::from(self.rotation);
        let away = point - self.center;
        let local = Vec3::new(turn.x.dot(away), turn.y.dot(away), turn.z.dot(away));
        let half = self.half_extents;
        let inside = Vec3::new(
            clamp_symmetric(local.x, half.x),
            clamp_symmetric(local.y, half.y),
            clamp_symmetric(local.z, half.z),
        );
        let there = |v: Vec3<S>| turn.x * v.x + turn.y * v.y + turn.z * v.z;
        if let Some((normal, distance)) = normalize_and_length(there(local - inside)) {
            return PointProjection { point: self.center + there(inside), normal, distance };
        }
        // Inside: the nearest face. Among equally near faces, the first axis, and the side of the
        // point, or the positive one.
        let gap = |axis: usize| self.half_extents[axis] - local[axis].abs();
        let axis = (1..3).fold(0, |best, i| if gap(i) < gap(best) { i } else { best });
        let side = if local[axis] < S::zero() { -S::one() } else { S::one() };
        let mut normal = Vec3::new(S::zero(), S::zero(), S::zero());
        normal[axis] = side;
        let mut surface = local;
        surface[axis] = side * self.half_extents[axis];
        PointProjection {
            point: self.center + there(surface),
            normal: there(normal).normalize(),
            distance: -gap(axis),
        }
    }
}

#[inline]
fn clamp_symmetric<S: Scalar>(x: S, half: S) -> S {
    if x > half {
        half
    } else if x < -half {
        -half
    } else {
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::AxisAngle;
    use cgmath::MetricSpace;

    fn turned() -> Obb<f64> {
        let rotation = AxisAngle::new(Vec3::unit_z(), std::f64::consts::FRAC_PI_4).unwrap();
        Obb::new(Point3::new(1.0, 2.0, 3.0), rotation.into(), Vec3::new(2.0, 1.0, 0.5)).unwrap()
    }

    #[test]
    fn bad_input_is_refused_by_name() {
        let origin = Point3::new(0.0, 0.0, 0.0);
        let sizes = Vec3::new(1.0, -1.0, 1.0);
        let error = Obb::new(origin, Quat::one(), sizes).unwrap_err();
        assert!(error.to_string().starts_with("half_extents.y must be finite and at least 0, "));
        let long = Quat::new(2.0, 0.0, 0.0, 0.0);
        let error = Obb::new(origin, long, Vec3::new(1.0, 1.0, 1.0)).unwrap_err();
        assert_eq!(error, Error::NotUnit { field: "rotation", value: 2.0 });
        let nan = Quat::new(f64::NAN, 0.0, 0.0, 0.0);
        assert!(Obb::new(origin, nan, Vec3::new(1.0, 1.0, 1.0)).is_err());
    }

    #[test]
    fn the_nearest_point_of_a_box_is_on_a_face_an_edge_or_a_corner() {
        let obb = turned();
        let cases = [
            ([5.0, 0.5, 0.1], [2.0, 0.5, 0.1], 3.0),
            ([0.3, 0.9, 0.1], [0.3, 1.0, 0.1], -0.1),
            ([3.0, 2.0, 0.0], [2.0, 1.0, 0.0], 2.0_f64.sqrt()),
            ([0.0, 0.0, 0.0], [0.0, 0.0, 0.5], -0.5),
        ];
        for (at, surface, distance) in cases {
            let nearest = obb.project_point(obb.pose().transform_point(Point3::from(at)));
            let expected = obb.pose().transform_point(Point3::from(surface));
            assert!(nearest.point.distance(expected) < 1e-15, "{at:?}: {nearest:?}");
            assert!((nearest.distance - distance).abs() < 1e-15, "{at:?}: {nearest:?}");
        }
    }

    #[test]
    fn corners_support_and_bounds_agree() {
        let obb = turned();
        let bounds = obb.bounding_box();
        for direction in [[1.0, 0.0, 0.0], [0.3, -1.0, 0.2], [-1.0, -1.0, -1.0]] {
            let direction = Vec3::from(direction);
            let along = |p: Point3<f64>| p.to_vec().dot(direction);
            let farthest = obb.corners().map(along).into_iter().fold(f64::MIN, f64::max);
            assert!((along(obb.support(direction)) - farthest).abs() < 1e-14);
            assert!(obb.corners().iter().all(|corner| bounds.contains_point(*corner)));
        }
        assert_eq!(obb.volume(), 8.0);
    }
}
