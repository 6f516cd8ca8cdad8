use crate::math::{Scalar, Vec3, direction_and_length, length};
use crate::shape::Sphere;

/// Whether two spheres touch: the distance of their centers is at most the sum of
/// their radii (Ericson, *Real-Time Collision Detection*, 2005, §4.3.1, there
/// squared on both sides, which overflows sooner).
#[must_use]
#[inline]
pub fn touching_sphere_sphere<S: Scalar>(a: &Sphere<S>, b: &Sphere<S>) -> bool {
    length(b.center - a.center) <= a.radius + b.radius
}

/// The shortest displacement of `b` that parts it from `a`, or `None` if they do
/// not touch.
///
/// It points from the center of `a` to that of `b`. Where the centers coincide
/// every direction is equally short; then it is **+x**.
#[must_use]
#[inline]
pub fn mtv_sphere_sphere<S: Scalar>(a: &Sphere<S>, b: &Sphere<S>) -> Option<Vec3<S>> {
    let reach = a.radius + b.radius;
    match direction_and_length(b.center - a.center) {
        Some((direction, distance)) if distance <= reach => Some(direction * (reach - distance)),
        None if touching_sphere_sphere(a, b) => Some(Vec3::unit_x() * reach),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Point3;

    fn sphere(x: f32, y: f32, z: f32, radius: f32) -> Sphere<f32> {
        Sphere { center: Point3::new(x, y, z), radius }
    }

    #[test]
    fn touching_is_about_distance_wherever_the_pair_is() {
        for (x, touching) in [(0.0, true), (1.5, true), (2.0, true), (2.001, false)] {
            for at in [-1000.0, -1.0, 0.0, 1.0, 1000.0] {
                let (a, b) = (sphere(at, at, at, 1.0), sphere(at + x, at, at, 1.0));
                assert_eq!(touching_sphere_sphere(&a, &b), touching, "{x} apart at {at}");
                assert_eq!(mtv_sphere_sphere(&a, &b).is_some(), touching, "{x} apart at {at}");
            }
        }
    }

    #[test]
    fn the_displacement_points_from_a_to_b() {
        let mtv = mtv_sphere_sphere(&sphere(0.0, 0.0, 0.0, 1.0), &sphere(0.0, -1.5, 0.0, 1.0));
        assert_eq!(mtv, Some(Vec3::new(0.0, -0.5, 0.0)));
    }

    #[test]
    fn coincident_centers_part_along_x() {
        for center in [0.0, 1e-30, 5.0, 1e6] {
            let (a, b) = (sphere(center, 0.0, center, 0.25), sphere(center, 0.0, center, 0.5));
            assert_eq!(mtv_sphere_sphere(&a, &b), Some(Vec3::new(0.75, 0.0, 0.0)));
        }
    }

    #[test]
    fn nearly_coincident_centers_keep_their_direction() {
        let a = sphere(0.0, 0.0, 0.0, 0.5);
        for gap in [1e-45_f32, 1e-40, 1e-30, 1e-10] {
            let mtv = mtv_sphere_sphere(&a, &sphere(0.0, 0.0, gap, 0.5)).unwrap();
            assert_eq!(mtv, Vec3::new(0.0, 0.0, 1.0 - gap), "{gap} apart");
        }
    }

    #[test]
    fn touching_exactly_is_a_touch_of_zero_depth() {
        let mtv = mtv_sphere_sphere(&sphere(0.0, 0.0, 0.0, 0.5), &sphere(1.0, 0.0, 0.0, 0.5));
        assert_eq!(mtv, Some(Vec3::new(0.0, 0.0, 0.0)));
    }

    #[test]
    fn tiny_and_huge_spheres_are_tested_alike() {
        for scale in [1e-38_f32, 1e-30, 1e-20, 1.0, 1e20, 1e37] {
            let a = sphere(0.0, 0.0, 0.0, scale);
            let near = sphere(0.0, 1.5 * scale, 0.0, scale);
            let far = sphere(0.0, 2.5 * scale, 0.0, scale);
            assert!(touching_sphere_sphere(&a, &near) && !touching_sphere_sphere(&a, &far));
            let depth = mtv_sphere_sphere(&a, &near).unwrap().y / scale;
            assert!((depth - 0.5).abs() < 1e-6, "{scale}: {depth}");
            assert_eq!(mtv_sphere_sphere(&a, &far), None);
        }
    }

    #[test]
    fn nan_touches_nothing() {
        let (a, b) = (sphere(f32::NAN, 0.0, 0.0, 1.0), sphere(0.0, 0.0, 0.0, 1.0));
        assert!(!touching_sphere_sphere(&a, &b));
        assert_eq!(mtv_sphere_sphere(&a, &b), None);
    }
}
