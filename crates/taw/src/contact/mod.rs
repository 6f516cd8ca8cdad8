//! When things touch, and by how much: tests between two shapes, and the lists of
//! touches that a step works through. Who is tested against whom is decided in
//! [`broad`](crate::broad).
//!
//! # Which function answers what
//!
//! | of | whether | how far, and the way out | where, as points | when |
//! |---|---|---|---|---|
//! | two spheres | [`touching_sphere_sphere`] | [`mtv_sphere_sphere`], [`closest`] | [`manifold`] | [`time_of_impact_sphere_sphere`] |
//! | sphere and half-space | [`touching_sphere_plane`] | [`mtv_sphere_plane`], [`closest_plane`] | | |
//! | any bounded shape and half-space | [`Closest::touching`] | [`closest_plane`] | | |
//! | any two of sphere, box, capsule and hull | [`Closest::touching`] | [`closest`] | [`manifold`] | [`sweep`] |
//! | two of these that turn as they move | | | | [`sweep_turning`] |
//! | any two shapes, compounds too | [`Closest::touching`] | [`closest_shapes`] | [`manifolds_of_shapes`] | [`sweep_shapes`] |
//! | a mesh or height field and any of these | [`Closest::touching`] | [`closest_of_surface`] | [`manifolds_of_surface`] | [`sweep_against_surface`] |
//! | ray and any shape | [`Cast::cast`], [`cast_on_surface`] | | | |
//!
//! How right a distance is, and by which method it is found:
//!
//! | of | method | right to |
//! |---|---|---|
//! | sphere and anything | the nearest point, in closed form | 4 epsilons of the scalar, of the largest coordinate |
//! | half-space and anything | the farthest point behind it | the same |
//! | two capsules | the nearest points of two lines, in closed form | 4e-12 of their size |
//! | two boxes | fifteen axes if they overlap, else as all others | 4e-12 |
//! | all others | corners that are farthest in some directions, until a bound from below and one from above agree | 4e-12 |
//! | sweeps along lines | planes that keep them apart | 1e-10 of their size, never late |
//! | sweeps that turn | the same, with bent paths | 1e-6 of their size, never late |
//!
//! But for the first two, all is found in `f64` about the middle of one of the two, and rounded
//! once to the scalar. Where edges or faces are parallel but for less than 1e-7 rad, the
//! distance is right to that angle. `tests/degenerate.rs` is the table of what breaks such
//! code elsewhere.
//!
//! # The displacement
//! Every test gives the *minimum translation vector*: the shortest displacement
//! of the second thing that takes it out of the first. Touching without overlap
//! is a touch, with a displacement of zero.

mod boxes;
mod closest;
mod compound;
mod core;
mod exhaustive;
mod gjk;
mod list;
mod manifold;
mod polytope;
mod ray;
mod sphere_plane;
mod sphere_sphere;
mod surface;
mod sweep;
mod turning;

pub use closest::{Closest, closest, closest_exhaustive, closest_plane};
pub use compound::{OfParts, closest_shapes, manifolds_of_shapes, parts_of, sweep_shapes};
pub use core::{Convex, Core};
pub use exhaustive::Skeleton;
pub use list::{Contact, Contacts};
pub use manifold::{Manifold, ManifoldPoint, Points, manifold};
pub use ray::{Cast, RayHit};
pub use sphere_plane::{mtv_sphere_plane, touching_sphere_plane};
pub use sphere_sphere::{mtv_sphere_sphere, time_of_impact_sphere_sphere, touching_sphere_sphere};
pub use surface::{
    OfTriangle, cast_on_surface, closest_of_surface, manifolds_of_surface, sweep_against_surface,
};
pub use sweep::{Touch, sweep};
pub use turning::{Course, sweep_turning};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Point3, Scalar, Vec3, length};
    use crate::shape::{Plane, Sphere};
    use cgmath::InnerSpace;
    use proptest::prelude::*;

    /// A sphere near the origin of a scene of this size.
    fn sphere<S: Scalar>(scale: f64, center: [f64; 3], radius: f64) -> Sphere<S> {
        let [x, y, z] = center.map(|x| S::constant(x * scale));
        Sphere::new(Point3::new(x, y, z), S::constant(radius * scale)).unwrap()
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
            Vec3::new(r * around.cos(), r * around.sin(), z).map(S::constant)
        })
    }

    /// Asserts that `mtv` takes the sphere out, and that nothing shorter by 0.1 %
    /// does. `separation` is how far apart the two are, negative for an overlap.
    fn assert_separates_and_is_minimal<S: Scalar>(
        b: &Sphere<S>,
        mtv: Vec3<S>,
        size: S,
        separation: impl Fn(&Sphere<S>) -> S,
    ) {
        // What rounding a handful of operations on numbers of this size can do.
        let tolerance = S::epsilon() * size * S::constant(8.0);
        let left = separation(&moved(b, mtv));
        assert!(left.abs() <= tolerance, "{left:?} left of {tolerance:?} allowed");
        let shorter = length(mtv) * S::constant(0.999);
        if shorter * S::constant(0.001) > tolerance {
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
            assert_separates_and_is_minimal(&b, mtv, S::constant(10.0 * scale), |b| {
                length(b.center - a.center) - (a.radius + b.radius)
            });
        }
    }

    fn check_wall<S: Scalar>(scale: f64, at: [f64; 3], radius: f64, normal: [f64; 3], offset: f64) {
        let b = sphere::<S>(scale, at, radius);
        let normal = Vec3::from(normal).normalize().map(S::constant);
        let wall = Plane::new(normal.normalize(), S::constant(offset * scale)).unwrap();
        let mtv = mtv_sphere_plane(&b, &wall);
        assert_eq!(mtv.is_some(), touching_sphere_plane(&b, &wall));
        if let Some(mtv) = mtv {
            assert_separates_and_is_minimal(&b, mtv, S::constant(10.0 * scale), |b| {
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
