use crate::math::{Scalar, Vec3};
use crate::shape::{Plane, Sphere};

/// Overlap test of a sphere and a half-space: the center is at most a radius in front of the
/// surface, or anywhere behind it (Ericson, *Real-Time Collision Detection*, 2005, §5.2.2, the
/// half-space case).
#[must_use]
#[inline]
pub fn touching_sphere_plane<S: Scalar>(sphere: &Sphere<S>, plane: &Plane<S>) -> bool {
    plane.signed_distance(sphere.center) <= sphere.radius
}

/// Minimum translation vector of the sphere out of the half-space, or `None` if they do not touch.
/// Always along the normal: a sphere whose center is behind the surface comes back out in front.
#[must_use]
#[inline]
pub fn mtv_sphere_plane<S: Scalar>(sphere: &Sphere<S>, plane: &Plane<S>) -> Option<Vec3<S>> {
    let distance = plane.signed_distance(sphere.center);
    (distance <= sphere.radius).then(|| plane.normal() * (sphere.radius - distance))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Point3;

    #[test]
    fn a_wall_is_solid_behind_its_surface() {
        let floor = Plane::new(Vec3::unit_y(), 1.0).unwrap();
        // Height of the center, and how far up the sphere must go.
        let cases = [
            (3.0, None),
            (1.5 + 1e-6, None),
            (1.5, Some(0.0)),
            (1.25, Some(0.25)),
            (1.0, Some(0.5)),
            (0.5, Some(1.0)),
            (-99.0, Some(100.5)),
        ];
        for (height, up) in cases {
            let sphere = Sphere::new(Point3::new(7.0, height, -3.0), 0.5).unwrap();
            assert_eq!(touching_sphere_plane(&sphere, &floor), up.is_some(), "at {height}");
            assert_eq!(
                mtv_sphere_plane(&sphere, &floor),
                up.map(|up| Vec3::new(0.0, up, 0.0)),
                "at {height}"
            );
        }
    }

    #[test]
    fn the_opposite_wall_is_solid_on_the_other_side() {
        let ceiling = Plane::new(-Vec3::unit_y(), -1.0).unwrap();
        for (height, down) in [(0.25, None), (0.5, Some(0.0)), (1.0, Some(-0.5)), (9.0, Some(-8.5))]
        {
            let sphere = Sphere::new(Point3::new(0.0, height, 0.0), 0.5).unwrap();
            assert_eq!(
                mtv_sphere_plane(&sphere, &ceiling),
                down.map(|down| Vec3::new(0.0, down, 0.0)),
                "at {height}"
            );
        }
    }
}
