use cgmath::{EuclideanSpace, InnerSpace, PerspectiveFov, Point2, Rad};

use super::Pose;
use crate::Error;
use crate::error::{positive, within};
use crate::math::{Mat4, Point3, Scalar, Vec3};

/// A ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray<S> {
    /// Origin, in metres.
    pub origin: Point3<S>,
    /// Direction, a unit vector.
    pub direction: Vec3<S>,
}

impl<S: Scalar> Ray<S> {
    /// The point at this distance, in metres.
    #[must_use]
    pub fn at(self, distance: S) -> Point3<S> {
        self.origin + self.direction * distance
    }
}

/// A perspective camera. Screen coordinates run from −1 at the left and the bottom to 1 at the
/// right and the top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera<S> {
    /// Position and rotation; it looks along −z, and y is up.
    pub pose: Pose<S>,
    field_of_view: S,
    aspect: S,
    near: S,
    far: S,
}

impl<S: Scalar> Camera<S> {
    /// Creates a camera from the vertical field of view in radians, the aspect ratio (width over
    /// height), and the distances of the near and the far plane in metres.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a field of view outside of (0, π), or a far that is not
    /// above near; [`Error::NotPositive`] for the others; for the pose as [`Pose::validated`].
    pub fn new(
        pose: Pose<S>,
        field_of_view: S,
        aspect: S,
        [near, far]: [S; 2],
    ) -> Result<Self, Error> {
        let pose = pose.validated()?;
        let least = S::min_positive_value();
        let half_turn = S::from_f64(std::f64::consts::PI) * (S::one() - S::epsilon());
        within("field_of_view", field_of_view, least, half_turn)?;
        positive("aspect", aspect)?;
        positive("near", near)?;
        within("far", far, near * (S::one() + S::epsilon()), S::max_value())?;
        Ok(Self { pose, field_of_view, aspect, near, far })
    }

    /// View matrix: from the world to the camera's frame.
    #[must_use]
    pub fn view(&self) -> Mat4<S> {
        self.pose.inverse().matrix()
    }

    /// Projection matrix: from the camera's frame to the screen, with a depth from −1 at the near
    /// plane to 1 at the far one after the division by w.
    #[must_use]
    pub fn projection(&self) -> Mat4<S> {
        let Self { field_of_view, aspect, near, far, .. } = *self;
        PerspectiveFov { fovy: Rad(field_of_view), aspect, near, far }.to_perspective().into()
    }

    /// Projects a point to the screen, unless it is behind the camera. The result may be off the
    /// screen.
    #[must_use]
    pub fn project(&self, point: Point3<S>) -> Option<Point2<S>> {
        let local = self.pose.inverse_transform_point(point);
        let [half_width, half_height] = self.half_sizes();
        let ahead = -local.z;
        (ahead > S::zero())
            .then(|| Point2::new(local.x / (ahead * half_width), local.y / (ahead * half_height)))
    }

    /// Picking ray through a point of the screen.
    #[must_use]
    pub fn ray(&self, screen: Point2<S>) -> Ray<S> {
        let [half_width, half_height] = self.half_sizes();
        let local = Vec3::new(screen.x * half_width, screen.y * half_height, -S::one());
        let origin = Point3::from_vec(self.pose.translation);
        Ray { origin, direction: self.pose.transform_vector(local).normalize() }
    }

    /// Half width and half height of the view, one metre ahead.
    fn half_sizes(&self) -> [S; 2] {
        let (sin, cos) = (self.field_of_view * S::from_f64(0.5)).sin_cos_portable();
        [sin / cos * self.aspect, sin / cos]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::LookAt;
    use cgmath::{MetricSpace, Transform};

    fn camera() -> Camera<f64> {
        let look = LookAt::new(Vec3::new(1.0, -0.5, 2.0), Vec3::unit_y()).unwrap();
        let pose = Pose { rotation: look.into(), translation: Vec3::new(3.0, 4.0, 5.0) };
        Camera::new(pose, 1.0, 16.0 / 9.0, [0.1, 100.0]).unwrap()
    }

    #[test]
    fn what_a_ray_goes_through_is_where_it_came_from() {
        let camera = camera();
        for (x, y) in [(0.0, 0.0), (1.0, 1.0), (-1.0, 0.3), (0.2, -0.9)] {
            let ray = camera.ray(Point2::new(x, y));
            assert!((ray.direction.magnitude() - 1.0).abs() < 1e-15);
            for distance in [0.2, 7.0, 5000.0] {
                let point = ray.at(distance);
                let screen = camera.project(point).unwrap();
                assert!(screen.distance(Point2::new(x, y)) < 1e-11, "{screen:?}");
                let by_matrix = (camera.projection() * camera.view()).transform_point(point);
                assert!((by_matrix.x - x).abs() < 1e-11 && (by_matrix.y - y).abs() < 1e-11);
            }
        }
        assert_eq!(camera.project(camera.ray(Point2::new(0.1, 0.1)).at(-1.0)), None);
    }

    #[test]
    fn depth_goes_from_near_to_far() {
        let camera = camera();
        let ray = camera.ray(Point2::new(0.0, 0.0));
        let depth = |d: f64| (camera.projection() * camera.view()).transform_point(ray.at(d)).z;
        assert!((depth(0.1) + 1.0).abs() < 1e-12 && (depth(100.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn bad_input_is_refused_by_name() {
        let new = |fov, aspect, near, far| {
            let camera = Camera::new(Pose::identity(), fov, aspect, [near, far]);
            camera.unwrap_err().to_string()
        };
        assert!(new(0.0, 1.0, 0.1, 1.0).starts_with("field_of_view must be in"));
        assert!(new(4.0, 1.0, 0.1, 1.0).starts_with("field_of_view must be in"));
        assert!(new(f64::NAN, 1.0, 0.1, 1.0).starts_with("field_of_view must be in"));
        assert!(new(1.0, 0.0, 0.1, 1.0).starts_with("aspect must be"));
        assert!(new(1.0, 1.0, -0.1, 1.0).starts_with("near must be"));
        assert!(new(1.0, 1.0, 0.1, 0.1).starts_with("far must be"));
    }
}
