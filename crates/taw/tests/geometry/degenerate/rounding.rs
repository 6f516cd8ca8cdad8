//! Rotations that are none, and denormal numbers.

use std::fmt::Debug;

use cgmath::MetricSpace;
use taw::contact::{ClosestPoints, closest_points, shape_cast};
use taw::frame::{AxisAngle, Pose, Rotor};
use taw::math::{Quat, cast_vector};
use taw::motion::integrate_rotation;
use taw::prelude::*;
use taw::shape::Obb;

use super::cases::Def::{self, Ball, Block, Rod, Tri};
use super::cases::{Place, STRAIGHT, Tally};
fn bad_rotations<S: Scalar + Debug>(tally: &mut Tally) {
    let q = |s: f64, x: f64| Quat::new(S::from_f64(s), S::from_f64(x), S::zero(), S::zero());
    let origin = Point3::new(S::zero(), S::zero(), S::zero());
    let half = Vec3::new(S::one(), S::one(), S::one());
    for (s, x) in [
        (0.0, 0.0),
        (1e-20, 0.0),
        (1e20, 0.0),
        (f64::NAN, 0.0),
        (0.0, f64::INFINITY),
        (0.9, 0.0),
        (1.0, 1.0),
    ] {
        let refused = Obb::new(origin, q(s, x), half).is_err();
        tally.check(refused, || format!("({s}, {x}) is no rotation"));
    }
    for axis in [[0.0; 3], [f64::NAN, 0.0, 0.0], [f64::INFINITY, 0.0, 0.0]] {
        let axis = Vec3::from(axis.map(S::from_f64));
        tally.check(AxisAngle::new(axis, S::one()).is_err(), || format!("an axis of {axis:?}"));
    }
    for speed in [0.0, 1e-45, 1e-40, 1e-30, 1e-20, 1.0, 1e5] {
        let spin = Vec3::new(S::zero(), S::from_f64(speed), S::from_f64(speed * 1e-3));
        let mut rotation = q(1.0, 0.0);
        for _ in 0..100 {
            rotation = integrate_rotation(rotation, spin, S::from_f64(1.0 / 60.0));
        }
        let length = rotation.s.as_f64().hypot(cast_vector::<S, f64>(rotation.v).magnitude());
        tally.check((length - 1.0).abs() < 1e-5, || format!("{spin:?} makes {rotation:?}"));
        let rotor = Rotor::from(rotation);
        let back: Quat<S> = rotor.into();
        tally.check(back == rotation, || format!("{rotor:?} is not {rotation:?}"));
    }
    // Axes too short and too long to be squared.
    for length in [1e-38, 1e-20, 1e20, 1e38] {
        let axis = Vec3::new(S::from_f64(length), S::zero(), S::zero());
        let turn = AxisAngle::new(axis, S::one());
        let unit = turn.is_ok_and(|turn| (turn.axis().x.as_f64() - 1.0).abs() < 1e-6);
        tally.check(unit, || format!("an axis {length} long"));
    }
}

#[test]
fn rotations() {
    let mut tally = Tally::default();
    bad_rotations::<f32>(&mut tally);
    bad_rotations::<f64>(&mut tally);
    tally.end("9, rotations");
}

/// Runs with the flags "flush to zero" and "denormals are zero" set.
#[cfg(target_arch = "x86_64")]
fn flushed<T>(run: impl FnOnce() -> T) -> T {
    let (mut before, mut during) = (0_u32, 0_u32);
    // SAFETY: stores and loads the thread's own control word, at valid places.
    unsafe {
        std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut before);
    }
    during |= before | 0x8040;
    // SAFETY: as above. What runs meanwhile rounds denormal numbers, and no more.
    unsafe {
        std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const during);
    }
    let result = run();
    // SAFETY: as above.
    unsafe {
        std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const before);
    }
    result
}

/// Denormal numbers flushed to zero change an answer by no more than an ulp.
#[cfg(target_arch = "x86_64")]
#[test]
fn flushing_to_zero_changes_nothing() {
    let mut tally = Tally::default();
    let defs = [
        Ball([0.1, 0.2, 0.3], 0.7),
        Rod([-0.4, 0.1, 0.0], [0.9, 0.3, -0.2], 0.3),
        Block([0.5, -0.2, 0.4], [0.4, 0.6, 0.3], ([0.6, 0.0, 0.8], 0.9)),
        Def::Hull([0.3, 0.9, -0.4], [0.5, 0.2, 0.4]),
        Tri([[0.0, 0.1, 1.0], [1.0, -0.3, 0.2], [-0.5, 0.4, -0.6]]),
        Ball([3.0, 0.2, 0.3], 0.7),
        Block([5.0, -2.0, 4.0], [0.4, 0.6, 0.3], STRAIGHT),
    ];
    let place = Place { scale: 1.0, offset: 0.0, pose: Pose::identity() };
    let ask = |a: Def, b: Def| {
        let (x, y) = (a.thing::<f32>(&place), b.thing::<f32>(&place));
        let found: ClosestPoints<f32> = each!(&x, x => each!(&y, y => closest_points(x, y)));
        let moves = Vec3::new(-3.0, 0.4, -0.2);
        let still = Vec3::new(0.0, 0.0, 0.0);
        let touch = each!(&x, x => each!(&y, y => shape_cast(x, still, y, moves)));
        let n = found.normal;
        [found.distance, n.x, n.y, n.z, touch.map_or(-1.0, |touch| touch.time)]
    };
    let world = || {
        let mut world = World::<f32>::default();
        world.set_model(Model { response: Response::Impulse, ..Model::default() }).unwrap();
        world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        for i in 0..20_u8 {
            let at = Point3::new(f32::from(i % 4) * 0.9, 1.0 + f32::from(i / 4), 0.3);
            world.marbles.insert(Marble::new(at, 0.5)).unwrap();
        }
        for _ in 0..20 {
            world.step(1.0 / 60.0).unwrap();
        }
        world.marbles.position().to_vec()
    };
    for a in defs {
        for b in defs {
            let (usual, other) = (ask(a, b), flushed(|| ask(a, b)));
            let ulp = |x: f32, y: f32| (x - y).abs() <= x.abs().max(y.abs()) * f32::EPSILON;
            let same = usual.iter().zip(other).all(|(x, y)| ulp(*x, y));
            tally.check(same, || format!("{a:?} {b:?}: {usual:?} {other:?}"));
        }
    }
    let (usual, other) = (world(), flushed(world));
    for (a, b) in usual.iter().zip(&other) {
        tally.check(a.distance(*b) <= 1e-6, || format!("{a:?} {b:?}"));
    }
    tally.end("11, denormal numbers flushed to zero");
}
