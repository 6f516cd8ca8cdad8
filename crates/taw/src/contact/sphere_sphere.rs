use cgmath::InnerSpace;

use crate::math::{Scalar, Vec3, length, normalize_and_length};
use crate::shape::Sphere;

/// Overlap test of two spheres: the distance of their centers is at most the sum of their radii
/// (Ericson, *Real-Time Collision Detection*, 2005, §4.3.1, there squared on both sides, which
/// overflows sooner).
#[must_use]
#[inline]
pub fn touching_sphere_sphere<S: Scalar>(a: &Sphere<S>, b: &Sphere<S>) -> bool {
    length(b.center - a.center) <= a.radius + b.radius
}

/// Minimum translation vector of `b` out of `a`, or `None` if they do not touch.
///
/// Direction from the center of `a` to that of `b`. For coincident centers every direction is
/// equally short; then it is **+x**.
#[must_use]
#[inline]
pub fn mtv_sphere_sphere<S: Scalar>(a: &Sphere<S>, b: &Sphere<S>) -> Option<Vec3<S>> {
    let reach = a.radius + b.radius;
    match normalize_and_length(b.center - a.center) {
        Some((direction, distance)) if distance <= reach => Some(direction * (reach - distance)),
        None if touching_sphere_sphere(a, b) => Some(Vec3::unit_x() * reach),
        _ => None,
    }
}

/// Time of impact of two spheres that translate along straight lines, as a fraction of their motion
/// in `[0, 1]`. None if they do not meet, or touch at the start already.
#[must_use]
pub fn time_of_impact_sphere_sphere<S: Scalar>(
    a: &Sphere<S>,
    a_translation: Vec3<S>,
    b: &Sphere<S>,
    b_translation: Vec3<S>,
) -> Option<S> {
    let (apart, motion) = (b.center - a.center, b_translation - a_translation);
    let reach = a.radius + b.radius;
    let distance = length(apart);
    if distance > (reach + length(motion)) * S::from_f64(1.001) {
        return None; // out of reach, whatever rounding says
    }
    // In units of the sum of radii, so that no square vanishes or overflows.
    let (d, m) = (apart / reach, motion / reach);
    let open = (distance / reach - S::one()) * (distance / reach + S::one());
    let (slope, squared) = (d.dot(m), m.magnitude2());
    let discriminant = slope * slope - squared * open;
    let meets = open > S::zero() && slope < S::zero() && discriminant >= S::zero();
    // Smaller root of the quadratic, in the form without cancellation.
    let time = open / (discriminant.sqrt() - slope);
    (meets && time <= S::one()).then_some(time)
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
    fn spheres_that_cross_meet_where_they_first_touch() {
        for scale in [1e-30_f32, 1e-3, 1.0, 1e30] {
            let a = sphere(-4.0 * scale, 0.0, 0.0, 0.5 * scale);
            let b = sphere(0.0, 0.6 * scale, 0.0, 0.5 * scale);
            let still = Vec3::new(0.0, 0.0, 0.0);
            let through = Vec3::new(100.0 * scale, 0.0, 0.0);
            let time = time_of_impact_sphere_sphere(&a, through, &b, still).unwrap();
            // They touch where the first has 0.8 to go to the second's height: 3.2 of 100.
            assert!((time - 0.032).abs() < 1e-8, "{scale}: {time}");
            // The same, seen by somebody who moves along.
            let along = time_of_impact_sphere_sphere(&a, still, &b, -through).unwrap();
            assert!((along - 0.032).abs() < 1e-8, "{scale}: {along}");
            assert_eq!(time_of_impact_sphere_sphere(&a, -through, &b, still), None);
            let short = Vec3::new(3.1 * scale, 0.0, 0.0);
            assert_eq!(time_of_impact_sphere_sphere(&a, short, &b, still), None);
            let past = Vec3::new(100.0 * scale, 100.0 * scale, 0.0);
            assert_eq!(time_of_impact_sphere_sphere(&a, past, &b, still), None);
            assert_eq!(time_of_impact_sphere_sphere(&b, through, &b, still), None, "inside");
        }
        let nan = sphere(f32::NAN, 0.0, 0.0, 1.0);
        let b = sphere(5.0, 0.0, 0.0, 1.0);
        let v = Vec3::new(9.0, 0.0, 0.0);
        assert_eq!(time_of_impact_sphere_sphere(&nan, v, &b, v), None);
    }

    #[test]
    fn nan_touches_nothing() {
        let (a, b) = (sphere(f32::NAN, 0.0, 0.0, 1.0), sphere(0.0, 0.0, 0.0, 1.0));
        assert!(!touching_sphere_sphere(&a, &b));
        assert_eq!(mtv_sphere_sphere(&a, &b), None);
    }
}
