//! Narrow phase: distance, penetration, contact manifolds, ray casts and shape casts between two
//! shapes, the lists of contacts of a step, and the materials of what touches. Candidate pairs come
//! from [`broad`](crate::broad).
//!
//! # Which function computes what
//!
//! | pair | overlap test | distance and penetration | contact points | time of impact |
//! |---|---|---|---|---|
//! | two spheres | [`touching_sphere_sphere`] | [`mtv_sphere_sphere`], [`closest_points`] | [`manifold`] | [`time_of_impact_sphere_sphere`] |
//! | sphere and half-space | [`touching_sphere_plane`] | [`mtv_sphere_plane`], [`closest_points_of_plane`] | | |
//! | any bounded shape and half-space | [`ClosestPoints::touching`] | [`closest_points_of_plane`] | [`manifold_of_plane`] | |
//! | any two of sphere, box, capsule and hull | [`ClosestPoints::touching`] | [`closest_points`] | [`manifold`] | [`shape_cast`] |
//! | two of these, rotating as they move | | | | [`time_of_impact`] |
//! | any two shapes, compounds included | [`ClosestPoints::touching`] | [`closest_points_of_shapes`] | [`manifolds_of_shapes`] | [`shape_cast_of_shapes`] |
//! | mesh or height field and any of these | [`ClosestPoints::touching`] | [`closest_points_of_surface`] | [`manifolds_of_surface`] | [`shape_cast_on_surface`] |
//! | ray and any shape | [`RayCast::cast_ray`], [`ray_cast_on_surface`] | | | |
//!
//! Methods and accuracy of the distance:
//!
//! | pair | method | accurate to |
//! |---|---|---|
//! | sphere and anything | point projection in closed form | 4 epsilons of the scalar, of the largest coordinate |
//! | half-space and anything | support point | 4 epsilons of the scalar, of the largest coordinate |
//! | two capsules | closest points of two segments, in closed form | 4e-12 of their size |
//! | two boxes | separating axis test (15 axes) if they overlap, else GJK | 4e-12 |
//! | all others | GJK and EPA, until a lower and an upper bound agree | 4e-12 |
//! | shape casts along lines | conservative advancement | 1e-10 of their size, never late |
//! | shape casts with rotation | conservative advancement with bent paths | 1e-6 of their size, never late |
//!
//! Except for the first two, all are computed in `f64` relative to the center of one of the two
//! shapes, and rounded once to the scalar. Where edges or faces are parallel to within 1e-7 rad,
//! the distance is accurate to that angle. `tests/geometry/degenerate.rs` lists degenerate cases that break
//! such code elsewhere.
//!
//! # Minimum translation vector
//! Every penetration is given as the *minimum translation vector* (`mtv`): the shortest
//! displacement of the second shape that takes it out of the first. Touching without overlap is a
//! contact with a displacement of zero.

mod advance;
mod box_box;
mod brute_force;
mod closest;
mod compound;
mod contacts;
mod core;
mod epa;
mod gjk;
mod manifold;
mod material;
mod ray_cast;
mod shape_cast;
mod sphere_plane;
mod sphere_sphere;
mod surface;
mod time_of_impact;

pub(crate) use advance::time_to_close;
pub use brute_force::Features;
pub use closest::{
    ClosestPoints, closest_points, closest_points_brute_force, closest_points_of_plane,
};
pub(crate) use compound::as_convex;
pub use compound::{
    SubShapeResult, closest_points_of_shapes, manifolds_of_shapes, shape_cast_of_shapes, sub_shapes,
};
pub use contacts::{Contact, Contacts, touch_goes_on};
pub use core::{Convex, Core};
pub use manifold::{Manifold, ManifoldPoint, Points, manifold, manifold_of_plane};
pub use material::{Combine, Compliance, ContactMaterial, Elasticity, Material};
pub use ray_cast::{RayCast, RayHit};
pub use shape_cast::{ShapeCastHit, shape_cast};
pub use sphere_plane::{mtv_sphere_plane, touching_sphere_plane};
pub use sphere_sphere::{mtv_sphere_sphere, time_of_impact_sphere_sphere, touching_sphere_sphere};
pub use surface::{
    TriangleResult, closest_points_of_surface, manifolds_of_surface, ray_cast_on_surface,
    shape_cast_on_surface,
};
pub use time_of_impact::{Sweep, time_of_impact};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Point3, Scalar, Vec3, length};
    use crate::shape::{Plane, Sphere};
    use cgmath::InnerSpace;
    use proptest::prelude::*;

    /// A sphere near the origin of a scene of this size.
    fn sphere<S: Scalar>(scale: f64, center: [f64; 3], radius: f64) -> Sphere<S> {
        let [x, y, z] = center.map(|x| S::from_f64(x * scale));
        Sphere::new(Point3::new(x, y, z), S::from_f64(radius * scale)).unwrap()
    }

    fn moved<S: Scalar>(sphere: &Sphere<S>, by: Vec3<S>) -> Sphere<S> {
        Sphere { center: sphere.center + by, ..*sphere }
    }

    /// Directions all over the sphere (a Fibonacci lattice, González 2010).
    fn directions<S: Scalar>(count: u32) -> impl Iterator<Item = Vec3<S>> {
        (0..count).map(move |i| {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count);
            let around = f64::from(i) * std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
            let r = (1.0 - z * z).sqrt();
            Vec3::new(r * around.cos(), r * around.sin(), z).map(S::from_f64)
        })
    }

    /// Asserts that `mtv` takes the sphere out, and that nothing shorter by 0.1 % does.
    /// `separation` is the distance of the two, negative for an overlap.
    fn assert_separates_and_is_minimal<S: Scalar>(
        b: &Sphere<S>,
        mtv: Vec3<S>,
        size: S,
        separation: impl Fn(&Sphere<S>) -> S,
    ) {
        // What rounding a handful of operations on numbers of this size can do.
        let tolerance = S::epsilon() * size * S::from_f64(8.0);
        let left = separation(&moved(b, mtv));
        assert!(left.abs() <= tolerance, "{left:?} left of {tolerance:?} allowed");
        let shorter = length(mtv) * S::from_f64(0.999);
        if shorter * S::from_f64(0.001) > tolerance {
            for direction in directions(1000) {
                let left = separation(&moved(b, direction * shorter));
                assert!(left < S::zero(), "{direction:?} is shorter");
            }
        }
    }

    fn check_pair<S: Scalar>(scale: f64, at: [f64; 3], to: [f64; 3], radii: [f64; 2]) {
        let (a, b) = (sphere::<S>(scale, at, radii[0]), sphere::<S>(scale, to, radii[1]));
        let mtv = mtv_sphere_sphere(&a, &b);
        assert_eq!(mtv.is_some(), touching_sphere_sphere(&a, &b));
        let back = mtv_sphere_sphere(&b, &a);
        assert_eq!(back, mtv.map(|mtv| -mtv), "swapping the two negates it to the bit");
        if let Some(mtv) = mtv {
            assert_separates_and_is_minimal(&b, mtv, S::from_f64(10.0 * scale), |b| {
                length(b.center - a.center) - (a.radius + b.radius)
            });
        }
    }

    fn check_wall<S: Scalar>(scale: f64, at: [f64; 3], radius: f64, normal: [f64; 3], offset: f64) {
        let b = sphere::<S>(scale, at, radius);
        let normal = Vec3::from(normal).normalize().map(S::from_f64);
        let wall = Plane::new(normal.normalize(), S::from_f64(offset * scale)).unwrap();
        let mtv = mtv_sphere_plane(&b, &wall);
        assert_eq!(mtv.is_some(), touching_sphere_plane(&b, &wall));
        if let Some(mtv) = mtv {
            assert_separates_and_is_minimal(&b, mtv, S::from_f64(10.0 * scale), |b| {
                wall.signed_distance(b.center) - b.radius
            });
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(500))]

        #[test]
        fn the_displacement_separates_spheres_and_is_minimal(
            at in [-1.0..1.0, -1.0..1.0, -1.0..1.0],
            to in [-1.0..1.0, -1.0..1.0, -1.0..1.0],
            radii in [0.01..1.0, 0.01..1.0],
            scale in prop::sample::select(vec![1e-30, 1e-3, 1.0, 1e3, 1e30]),
        ) {
            check_pair::<f32>(scale, at, to, radii);
            check_pair::<f64>(scale, at, to, radii);
        }

        #[test]
        fn the_displacement_separates_from_a_wall_and_is_minimal(
            at in [-1.0..1.0, -1.0..1.0, -1.0..1.0],
            radius in 0.01..1.0,
            normal in [-1.0..1.0, -1.0..1.0, 0.1..1.0],
            offset in -1.0..1.0,
            scale in prop::sample::select(vec![1e-30, 1e-3, 1.0, 1e3, 1e30]),
        ) {
            check_wall::<f32>(scale, at, radius, normal, offset);
            check_wall::<f64>(scale, at, radius, normal, offset);
        }
    }
}
