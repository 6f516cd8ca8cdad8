//! The cases that break collision code, as tables: coincident, touching exactly, parallel,
//! flat, without length, huge beside tiny, at rest, at the first and the last moment.
//!
//! Each is asked at five scales, three offsets and three rotations, in both scalars and both
//! orders. The numbering is that of the families in which such cases are usually listed.
//! `cargo test -p taw --test degenerate -- --nocapture` prints how many there are.

#[path = "common/things.rs"]
mod things;

use std::fmt::Debug;

use cgmath::MetricSpace;
use taw::contact::{
    ClosestPoints, RayCast, RayHit, closest_points, closest_points_brute_force,
    closest_points_of_plane, manifold, shape_cast,
};
use taw::frame::{AxisAngle, Pose, Ray, Rotor};
use taw::math::{Quat, cast_point, cast_vector};
use taw::motion::integrate_rotation;
use taw::prelude::*;
use taw::shape::{BoundedShape, Capsule, Hull, Obb, Triangle};
use things::Thing;

const SCALES: [f64; 5] = [1e-6, 1e-3, 1.0, 1e3, 1e6];
const OFFSETS: [f64; 3] = [0.0, 1e3, 1e6];
/// Axes and angles: none, a quarter, and a crooked one.
const TURNS: [([f64; 3], f64); 3] = [
    ([0.0, 1.0, 0.0], 0.0),
    ([0.0, 0.0, 1.0], std::f64::consts::FRAC_PI_2),
    ([0.267, 0.535, -0.802], 0.7),
];

/// Where a case is put.
#[derive(Clone, Copy, Debug)]
struct Place {
    scale: f64,
    offset: f64,
    pose: Pose<f64>,
}

impl Place {
    fn all() -> impl Iterator<Item = Self> {
        let turns = TURNS.iter().map(|(axis, angle)| {
            let turn = AxisAngle::new(Vec3::from(*axis).normalize(), *angle).unwrap();
            Pose { rotation: turn.into(), ..Pose::identity() }
        });
        turns.flat_map(|pose| {
            SCALES.into_iter().flat_map(move |scale| {
                OFFSETS.into_iter().map(move |offset| Self { scale, offset, pose })
            })
        })
    }

    fn vector(&self, v: [f64; 3]) -> Vec3<f64> {
        self.pose.transform_vector(Vec3::from(v)) * self.scale
    }

    fn point<S: Scalar>(&self, p: [f64; 3]) -> Point3<S> {
        let offset = Vec3::new(self.offset, -self.offset, self.offset);
        Point3::from_vec((self.vector(p) + offset).map(S::from_f64))
    }

    /// What rounding of the input and of the answer can do, for things of this size.
    fn tolerance<S: Scalar>(&self, size: f64) -> f64 {
        let digits = 16.0 * S::epsilon().as_f64();
        (digits + 1e-11) * size * self.scale + digits * self.offset
    }
}

/// A shape in metres, about the origin.
#[derive(Clone, Copy, Debug)]
enum Def {
    Ball([f64; 3], f64),
    Rod([f64; 3], [f64; 3], f64),
    /// Middle, half widths, and a turn about an axis.
    Block([f64; 3], [f64; 3], ([f64; 3], f64)),
    Tri([[f64; 3]; 3]),
    /// The hull of a box.
    Hull([f64; 3], [f64; 3]),
}
use Def::{Ball, Block, Rod, Tri};

const STRAIGHT: ([f64; 3], f64) = ([0.0, 1.0, 0.0], 0.0);
const O: [f64; 3] = [0.0; 3];

impl Def {
    fn thing<S: Scalar>(self, place: &Place) -> Thing<S> {
        let length = |x: f64| S::from_f64(x * place.scale);
        match self {
            Ball(at, radius) => {
                Thing::Sphere(Sphere::new(place.point(at), length(radius)).unwrap())
            }
            Rod(a, b, radius) => Thing::Capsule(
                Capsule::new(place.point(a), place.point(b), length(radius)).unwrap(),
            ),
            Block(at, half, (axis, angle)) => {
                let own: Quat<f64> = AxisAngle::new(Vec3::from(axis), angle).unwrap().into();
                let turn = place.pose.rotation * own;
                let turn = Quat::from_sv(S::from_f64(turn.s), turn.v.map(S::from_f64));
                let half = Vec3::from(half.map(length));
                Thing::Obb(Obb::new(place.point(at), turn, half).unwrap())
            }
            Tri(corners) => Thing::Triangle(Triangle { corners: corners.map(|p| place.point(p)) }),
            Def::Hull(at, half) => {
                let corner = |i: usize| {
                    let side = |axis: usize| if i >> axis & 1 == 0 { -1.0 } else { 1.0 };
                    place.point([0, 1, 2].map(|axis| at[axis] + side(axis) * half[axis]))
                };
                let corners: Vec<_> = (0..8).map(corner).collect();
                match Hull::new(&corners) {
                    Ok(hull) => Thing::Hull(hull),
                    // What rounding has made flat is a box that is.
                    Err(_) => Block(at, half, STRAIGHT).thing(place),
                }
            }
        }
    }

    fn size(self) -> f64 {
        let far = |p: [f64; 3]| Vec3::from(p).magnitude();
        match self {
            Ball(at, radius) => far(at) + radius,
            Rod(a, b, radius) => far(a) + far(b) + radius,
            Block(at, half, _) | Def::Hull(at, half) => far(at) + far(half),
            Tri(corners) => corners.map(far).iter().sum(),
        }
    }
}

fn finite<S: Scalar>(found: &ClosestPoints<S>) -> bool {
    let point = |p: Point3<S>| p.x.is_finite() && p.y.is_finite() && p.z.is_finite();
    found.distance.is_finite() && point(found.on_a) && point(found.on_b)
}

/// Counts the cases, and what went wrong with them.
#[derive(Default)]
struct Tally {
    cases: u32,
    failures: Vec<String>,
}

impl Tally {
    fn check(&mut self, right: bool, what: impl FnOnce() -> String) {
        self.cases += 1;
        if !right {
            self.failures.push(what());
        }
    }

    fn end(self, family: &str) {
        println!("{family}: {} cases, {} failures", self.cases, self.failures.len());
        let some: Vec<_> = self.failures.iter().take(5).collect();
        assert!(self.failures.is_empty(), "{some:#?}");
    }

    /// A pair in one place: finite, as far apart as it should be, the same both ways round.
    fn pair<S: Scalar>(&mut self, a: Def, b: Def, distance: f64, place: &Place) {
        let (x, y) = (a.thing::<S>(place), b.thing::<S>(place));
        let size = a.size() + b.size();
        let tolerance = place.tolerance::<S>(size);
        let one = each!(&x, x => each!(&y, y => closest_points(x, y)));
        let other = each!(&x, x => each!(&y, y => closest_points(y, x)));
        let slow = each!(&x, x => each!(&y, y => closest_points_brute_force(x, y)));
        let touches = each!(&x, x => each!(&y, y => manifold(x, y, S::zero())));
        let off =
            |found: &ClosestPoints<S>| (found.distance.as_f64() - distance * place.scale).abs();
        let length = one.normal.map(Scalar::as_f64).magnitude();
        let apart: Point3<f64> = cast_point(one.on_b);
        let apart = (apart - cast_point::<S, f64>(one.on_a)).dot(one.normal.map(Scalar::as_f64));
        let what = |why: &str| format!("{a:?} and {b:?}, {place:?}: {why}: {one:?} {other:?}");
        self.check(finite(&one), || what("not finite"));
        self.check((length - 1.0).abs() < 1e-5, || what("no unit vector"));
        self.check(off(&one) <= tolerance, || what("wrong by more than rounding"));
        self.check(off(&slow) <= tolerance, || what("the readable version is wrong"));
        self.check((apart - one.distance.as_f64()).abs() <= tolerance, || what("wrong points"));
        self.check(one.distance == other.distance, || what("depends on the order"));
        let same = each!(&x, x => each!(&y, y => x.bounding_box() == y.bounding_box()));
        let swapped = one.normal == -other.normal || same; // then every way is as good
        self.check(swapped, || what("the normal depends on the order"));
        let count = touches.points.len();
        let expected = if one.distance <= S::zero() { 1..=4 } else { 0..=0 };
        let sure = one.distance.as_f64().abs() > tolerance;
        self.check(!sure || expected.contains(&count), || what(&format!("{count} touches")));
    }

    fn pairs(&mut self, cases: &[(Def, Def, f64)]) {
        for place in Place::all() {
            for (a, b, distance) in cases {
                self.pair::<f32>(*a, *b, *distance, &place);
                self.pair::<f64>(*a, *b, *distance, &place);
            }
        }
    }
}

const ULP: f64 = f64::EPSILON;

#[test]
fn spheres() {
    let mut tally = Tally::default();
    let at = |x: f64| [x, 0.0, 0.0];
    tally.pairs(&[
        (Ball(O, 0.5), Ball(O, 0.5), -1.0),
        (Ball(O, 0.5), Ball(O, 0.25), -0.75),
        (Ball(O, 0.5), Ball(at(ULP), 0.5), ULP - 1.0),
        (Ball(O, 0.5), Ball(at(f64::from(f32::EPSILON)), 0.5), f64::from(f32::EPSILON) - 1.0),
        (Ball(O, 0.5), Ball(at(1e-40), 0.5), -1.0),
        (Ball(O, 0.5), Ball([1e-40, -1e-42, 1e-45], 0.5), -1.0),
        (Ball(O, 0.5), Ball(at(1e-310), 0.5), -1.0),
        (Ball(O, 0.5), Ball(at(1.0), 0.5), 0.0),
        (Ball(O, 0.5), Ball(at(1.0 + ULP), 0.5), ULP),
        (Ball(O, 0.5), Ball(at(1.0 - ULP), 0.5), -ULP),
        (Ball(O, 0.5), Ball([0.6, 0.8, 0.0], 0.5), 0.0),
        (Ball(O, 0.5), Ball(at(0.1), 0.01), -0.41),
        (Ball(O, 0.5), Ball(at(0.25), 0.25), -0.5),
        (Ball([1e6, 0.0, 0.0], 1e6), Ball(O, 1.0), -1.0),
        (Ball([1e6, 0.0, 0.0], 1e6), Ball(at(-1.0), 1.0), 0.0),
        (Ball(O, 0.5), Ball(at(1e6), 0.5), 1e6 - 1.0),
    ]);
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let origin = Point3::new(0.0, 0.0, 0.0);
        tally.check(Sphere::new(origin, radius).is_err(), || format!("a radius of {radius}"));
    }
    tally.end("1, spheres");
}

#[test]
fn spheres_and_others() {
    let mut tally = Tally::default();
    let cube = Block(O, [1.0; 3], STRAIGHT);
    let tall = Block(O, [1.0, 2.0, 3.0], STRAIGHT);
    let flat = Tri([[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 0.0, 1.0]]);
    let rod = Rod([0.0, -1.0, 0.0], [0.0, 1.0, 0.0], 0.5);
    let (d2, d3) = (2.0_f64.sqrt(), 3.0_f64.sqrt());
    tally.pairs(&[
        // On a face, an edge and a corner, within, and without.
        (Ball([1.0, 0.0, 0.0], 0.5), cube, -0.5),
        (Ball([1.0, 1.0, 0.0], 0.5), cube, -0.5),
        (Ball([1.0, 1.0, 1.0], 0.5), cube, -0.5),
        (Ball([1.5, 0.0, 0.0], 0.5), cube, 0.0),
        (Ball([1.5 + ULP, 0.0, 0.0], 0.5), cube, ULP),
        (Ball([2.0, 2.0, 0.0], 0.5), cube, d2 - 0.5),
        (Ball([2.0, 2.0, 2.0], 0.5), cube, d3 - 0.5),
        (Ball([2.0, 1.0, 0.0], 0.5), cube, 0.5),
        (Ball([0.9, 0.0, 0.0], 0.5), cube, -0.6),
        (Ball([0.9, 0.9, 0.9], 0.5), cube, -0.6),
        (Ball([0.5, 0.5, 0.0], 0.5), cube, -1.0),
        // In the middle, with one, two and three half widths that are as short.
        (Ball(O, 0.5), tall, -1.5),
        (Ball(O, 0.5), Block(O, [1.0, 1.0, 3.0], STRAIGHT), -1.5),
        (Ball(O, 0.5), cube, -1.5),
        (Ball(O, 1e-3), cube, -1.001),
        (Ball(O, 100.0), cube, -101.0),
        (Ball([1e4, 0.0, 0.0], 1e4), Block(O, [1e-2; 3], STRAIGHT), -1e-2),
        // Long and thin, and of no extent at all.
        (Ball([0.0, 1.0, 0.0], 0.5), Block(O, [1e3, 1e-3, 1e-3], STRAIGHT), 0.5 - 1e-3),
        (Ball([0.0, 1.0, 0.0], 0.5), Block(O, [1.0, 0.0, 1.0], STRAIGHT), 0.5),
        (Ball(O, 0.5), Block(O, [1.0, 0.0, 1.0], STRAIGHT), -0.5),
        (Ball([0.0, 1.0, 0.0], 0.5), Block(O, [0.0; 3], STRAIGHT), 0.5),
        (Ball(O, 0.5), Block(O, [0.0; 3], STRAIGHT), -0.5),
        // On the line of a capsule, at its end, beside it.
        (Ball(O, 0.5), rod, -1.0),
        (Ball([0.0, 1.0, 0.0], 0.5), rod, -1.0),
        (Ball([0.0, 2.0, 0.0], 0.5), rod, 0.0),
        (Ball([1.0, 0.3, 0.0], 0.5), rod, 0.0),
        (Ball([1.0, 1.0, 0.0], 0.5), rod, 0.0),
        (Ball([3.0, 5.0, 0.0], 0.5), rod, 4.0),
        // Triangles: over one, on it, on an edge, on a corner; slivers, lines and points.
        (Ball([0.0, 0.5, 0.0], 0.5), flat, 0.0),
        (Ball(O, 0.5), flat, -0.5),
        (Ball([0.0, 0.0, -1.0], 0.5), flat, -0.5),
        (Ball([0.0, 0.0, 1.0], 0.5), flat, -0.5),
        (Ball([0.0, 0.0, -2.0], 0.5), flat, 0.5),
        (Ball([0.0, 3.0, 5.0], 0.5), flat, 4.5),
        (
            Ball([0.0, 1.0, 0.0], 0.5),
            Tri([[-1.0, 0.0, 0.0], [1.0, 0.0, 1e-9], [1.0, 0.0, 0.0]]),
            0.5,
        ),
        (
            Ball([0.0, 1.0, 0.0], 0.5),
            Tri([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.0, 0.0]]),
            0.5,
        ),
        (
            Ball([0.5, 0.0, 0.0], 0.5),
            Tri([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.0, 0.0]]),
            -0.5,
        ),
        (Ball([0.0, 1.0, 0.0], 0.5), Tri([O; 3]), 0.5),
        (Ball(O, 0.5), Tri([O; 3]), -0.5),
        (Ball([2.0, 0.0, 0.0], 0.5), Def::Hull(O, [1.0; 3]), 0.5),
        (Ball([1.0, 1.0, 1.0], 0.5), Def::Hull(O, [1.0; 3]), -0.5),
        (Ball(O, 0.5), Def::Hull(O, [1.0, 1.0, 1.0]), -1.5),
    ]);
    for place in Place::all() {
        for (height, gap) in [(0.5, 0.0), (0.0, -0.5), (-3.0, -3.5), (1.0, 0.5), (0.5 + ULP, ULP)] {
            let normal: Vec3<f64> = place.vector([0.0, 1.0, 0.0]);
            let floor = Plane::through(place.point::<f64>(O), normal).unwrap();
            let Thing::Sphere(ball) = Ball([7.0, height, -3.0], 0.5).thing::<f64>(&place) else {
                continue;
            };
            let found = closest_points_of_plane(&floor, &ball);
            let off = (found.distance - gap * place.scale).abs();
            tally.check(finite(&found) && off <= 4.0 * place.tolerance::<f64>(10.0), || {
                format!("a plane at {height}, {place:?}: {found:?}")
            });
        }
    }
    tally.end("2, spheres and others");
}

#[test]
fn capsules() {
    let mut tally = Tally::default();
    let up = |x: f64, from: f64, to: f64| Rod([x, from, 0.0], [x, to, 0.0], 0.5);
    let across = |y: f64, z: f64| Rod([-1.0, y, z], [1.0, y, z], 0.5);
    let dot = |x: f64| Rod([x, 0.0, 0.0], [x, 0.0, 0.0], 0.5);
    let block = Block(O, [2.0, 0.5, 2.0], STRAIGHT);
    tally.pairs(&[
        (dot(0.0), dot(0.75), -0.25),
        (dot(0.0), dot(1.0), 0.0),
        (dot(0.0), dot(0.0), -1.0),
        (dot(1.5), up(0.0, -1.0, 1.0), 0.5),
        (dot(0.0), up(0.0, -1.0, 1.0), -1.0),
        (up(0.0, -1.0, 1.0), up(0.8, -1.0, 1.0), -0.2),
        (up(0.0, -1.0, 1.0), up(0.8, 0.0, 3.0), -0.2),
        (up(0.0, -1.0, 1.0), up(2.0, -1.0, 1.0), 1.0),
        (up(0.0, -1.0, 1.0), up(0.0, 2.0, 3.0), 0.0),
        (up(0.0, -1.0, 1.0), up(0.0, 1.5, 3.0), -0.5),
        (up(0.0, -1.0, 1.0), up(0.0, 3.0, 4.0), 1.0),
        (up(0.0, -1.0, 1.0), up(0.0, -1.0, 1.0), -1.0),
        (up(0.0, -1.0, 1.0), up(0.0, 0.0, 3.0), -1.0),
        (up(0.0, -1.0, 1.0), across(0.0, 0.0), -1.0),
        (up(0.0, -1.0, 1.0), across(0.5, 0.0), -1.0),
        (up(0.0, -1.0, 1.0), across(1.0, 0.0), -1.0),
        (up(0.0, -1.0, 1.0), across(0.0, 1e-9), 1e-9 - 1.0),
        (up(0.0, -1.0, 1.0), across(0.0, 1.0), 0.0),
        (up(0.0, -1.0, 1.0), Rod([1.0, -1.0, 0.0], [1.0 + 1e-9, 1.0, 0.0], 0.5), 0.0),
        // Lying on a box, standing on it, through it, along its edge.
        (block, across(1.0, 0.0), 0.0),
        (block, across(0.9, 0.0), -0.1),
        (block, up(0.0, 1.0, 3.0), 0.0),
        (block, up(0.0, -3.0, 3.0), -2.5),
        (block, up(0.0, -1.0, 3.0), -2.0),
        (block, up(2.0, -1.0, 1.0), -0.5),
        (block, Rod([-2.0, 0.5, 2.0], [2.0, 0.5, 2.0], 0.5), -0.5),
        (block, Rod([-2.0, 1.1, 2.8], [2.0, 1.1, 2.8], 0.5), 0.5),
        (Tri([[-2.0, 0.0, -2.0], [2.0, 0.0, -2.0], [0.0, 0.0, 2.0]]), across(0.5, 0.0), 0.0),
        (Tri([[-2.0, 0.0, -2.0], [2.0, 0.0, -2.0], [0.0, 0.0, 2.0]]), across(0.0, 0.0), -0.5),
    ]);
    tally.end("3, capsules");
}

#[test]
fn boxes() {
    let mut tally = Tally::default();
    let cube = |x: f64, y: f64| Block([x, y, 0.0], [0.5; 3], STRAIGHT);
    let turned =
        |x: f64, y: f64, axis: [f64; 3], angle: f64| Block([x, y, 0.0], [0.5; 3], (axis, angle));
    let (y, z) = ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let quarter = std::f64::consts::FRAC_PI_4;
    let d2 = 2.0_f64.sqrt();
    tally.pairs(&[
        (cube(0.0, 0.0), cube(0.0, 0.0), -1.0),
        (cube(0.0, 0.0), cube(0.9, 0.0), -0.1),
        (cube(0.0, 0.0), cube(1.0, 0.0), 0.0),
        (cube(0.0, 0.0), cube(1.0, 1.0), 0.0),
        (cube(0.0, 0.0), cube(0.8, 0.8), -0.2),
        (cube(0.0, 0.0), cube(2.0, 0.0), 1.0),
        (cube(0.0, 0.0), cube(2.0, 2.0), d2),
        (cube(0.0, 0.0), turned(1.0, 0.0, y, 1e-7), -0.5e-7),
        (cube(0.0, 0.0), turned(0.9, 0.0, z, 1e-7), -0.1 - 0.5e-7),
        (cube(0.0, 0.0), turned(0.0, 0.9, [0.6, 0.0, 0.8], 1e-12), -0.1),
        (cube(0.0, 0.0), turned(0.0, 0.0, y, quarter), -1.0),
        // An edge on a face, an edge on an edge, an edge where the face is as near.
        (cube(0.0, 0.0), turned(0.5 + d2 / 2.0, 0.0, z, quarter), 0.0),
        (cube(0.0, 0.0), turned(0.4 + d2 / 2.0, 0.0, z, quarter), -0.1),
        (turned(0.0, 0.0, z, quarter), turned(d2, 0.0, y, quarter), 0.0),
        (turned(0.0, 0.0, z, quarter), turned(d2 - 0.1, 0.0, y, quarter), -0.1),
        (turned(0.0, 0.0, z, quarter), turned(d2 + 0.1, 0.0, y, quarter), 0.1),
        // Flat ones, lines and points.
        (cube(0.0, 0.0), Block([0.0, 0.5, 0.0], [1.0, 0.0, 1.0], STRAIGHT), 0.0),
        (cube(0.0, 0.0), Block([0.0, 0.4, 0.0], [1.0, 0.0, 1.0], STRAIGHT), -0.1),
        (cube(0.0, 0.0), Block([0.0, 1.0, 0.0], [1.0, 0.0, 0.0], STRAIGHT), 0.5),
        (cube(0.0, 0.0), Block([0.0, 1.0, 0.0], [0.0; 3], STRAIGHT), 0.5),
        (Block(O, [1.0, 0.0, 1.0], STRAIGHT), Block(O, [1.0, 0.0, 1.0], STRAIGHT), 0.0),
        (Block(O, [1.0, 0.0, 1.0], STRAIGHT), Block(O, [1.0, 1.0, 0.0], STRAIGHT), -1.0),
        // A million times as long as wide.
        (cube(0.0, 0.0), Block([0.0, 1.0, 0.0], [1e3, 1e-3, 1e-3], STRAIGHT), 0.5 - 1e-3),
        (cube(0.0, 0.0), Block([0.0, 0.5, 0.0], [1e3, 1e-3, 1e-3], STRAIGHT), -1e-3),
        (
            Block(O, [1e3, 1e-3, 1e-3], STRAIGHT),
            Block([0.0, 2e-3, 0.0], [1e-3, 1e-3, 1e3], STRAIGHT),
            0.0,
        ),
        (Def::Hull(O, [0.5; 3]), cube(0.9, 0.0), -0.1),
        (Def::Hull(O, [0.5; 3]), Def::Hull([1.0, 0.0, 0.0], [0.5; 3]), 0.0),
        (Def::Hull(O, [0.5; 3]), Def::Hull([2.0, 2.0, 0.0], [0.5; 3]), d2),
        (Def::Hull(O, [0.5; 3]), Def::Hull([0.1, 0.2, 0.3], [0.5; 3]), -0.7),
        (Def::Hull(O, [0.5; 3]), Tri([[-9.0, 0.4, -9.0], [9.0, 0.4, -9.0], [0.0, 0.4, 9.0]]), -0.1),
    ]);
    tally.end("4, boxes");
}

/// What should come of a sweep: a time, none, or, where rounding decides, either.
#[derive(Clone, Copy, Debug)]
enum When {
    At(f64),
    Never,
    Either,
}

impl Tally {
    fn sweep<S: Scalar>(
        &mut self,
        (a, a_moves): (Def, [f64; 3]),
        (b, b_moves): (Def, [f64; 3]),
        when: When,
        place: &Place,
    ) {
        let (x, y) = (a.thing::<S>(place), b.thing::<S>(place));
        let moves = |v: [f64; 3]| cast_vector::<f64, S>(place.vector(v));
        let (p, q) = (moves(a_moves), moves(b_moves));
        let one = each!(&x, x => each!(&y, y => shape_cast(x, p, y, q)));
        let other = each!(&x, x => each!(&y, y => shape_cast(y, q, x, p)));
        let apart = place.vector(b_moves) - place.vector(a_moves);
        let speed = one
            .map_or(apart.magnitude(), |touch| apart.dot(touch.normal.map(Scalar::as_f64)).abs());
        let size = a.size() + b.size() + Vec3::from(a_moves).magnitude();
        // A way of rounding takes a time of rounding.
        let tolerance = 64.0 * place.tolerance::<S>(size) / speed.max(f64::MIN_POSITIVE) + 1e-9;
        let right = match (when, one) {
            (When::At(time), Some(touch)) => (touch.time.as_f64() - time).abs() <= tolerance,
            // Rounding may let it pass, or touch too early.
            (When::At(time), None) => time > 1.0 - tolerance || time < tolerance,
            (When::Never, found) => found.is_none() || tolerance > 0.1,
            (When::Either, _) => true,
        };
        let what = |why: &str| format!("{a:?} and {b:?}, {place:?}: {why}: {one:?} {other:?}");
        self.check(right, || what("at another time"));
        let sane = one.is_none_or(|touch| touch.time >= S::zero() && touch.time <= S::one());
        self.check(sane, || what("no part of the way"));
        let both = match (one, other) {
            (Some(one), Some(other)) => {
                (one.time - other.time).abs().as_f64() <= tolerance.min(1.0)
            }
            (None, None) => true,
            _ => !matches!(when, When::At(time) if time > tolerance && time < 1.0 - tolerance),
        };
        self.check(both, || what("depends on the order"));
    }
}

#[test]
fn sweeps() {
    use When::{At, Either, Never};
    let mut tally = Tally::default();
    let ball = |x: f64, y: f64| Ball([x, y, 0.0], 0.5);
    let right = |v: f64| [v, 0.0, 0.0];
    let far = [1e6, 1e6, -1e6];
    let further = [1e6 + 4.0, 1e6, -1e6];
    let graze = (50.0 - (1.0 - (1.0 - 1e-4_f64).powi(2)).sqrt()) / 100.0;
    let cases = [
        ((ball(0.0, 0.0), O), (ball(3.0, 0.0), O), Never),
        ((ball(0.0, 0.0), O), (ball(1.0, 0.0), O), Never),
        ((ball(0.0, 0.0), O), (ball(0.5, 0.0), O), Never),
        ((ball(0.0, 0.0), O), (ball(0.0, 0.0), O), Never),
        ((ball(0.0, 0.0), O), (ball(0.5, 0.0), right(1.0)), Never),
        ((ball(0.0, 0.0), O), (ball(1.0, 0.0), right(1.0)), Never),
        ((ball(0.0, 0.0), right(1.0)), (ball(0.5, 0.0), O), At(0.0)),
        ((ball(0.0, 0.0), right(4.0)), (ball(3.0, 0.0), O), At(0.5)),
        ((ball(0.0, 0.0), right(2.0)), (ball(3.0, 0.0), O), At(1.0)),
        ((ball(0.0, 0.0), right(1.9)), (ball(3.0, 0.0), O), Never),
        ((ball(0.0, 0.0), right(1.0)), (ball(1.0, 0.0), O), At(0.0)),
        ((ball(0.0, 0.0), right(1e6)), (ball(3.0, 0.0), O), At(2e-6)),
        ((ball(0.0, 0.0), right(1e-310)), (ball(3.0, 0.0), O), Never),
        ((ball(0.0, 0.0), far), (ball(3.0, 0.0), far), Never),
        ((ball(0.0, 0.0), further), (ball(3.0, 0.0), far), Either),
        ((ball(0.0, 0.0), right(100.0)), (ball(50.0, 1.0 - 1e-4), O), At(graze)),
        ((ball(0.0, 0.0), right(100.0)), (ball(50.0, 1.0 + 1e-4), O), Never),
        ((ball(0.0, 0.0), right(100.0)), (ball(50.0, 1.0 - 1e-6), O), Either),
        ((ball(0.0, 0.0), right(100.0)), (ball(50.0, 1.0 + 1e-6), O), Never),
        ((ball(0.0, 0.0), right(100.0)), (ball(50.0, 1.0 + 1e-7), O), Either),
        ((ball(0.0, 0.0), right(100.0)), (ball(50.0, 1.0 - 1e-7), O), Either),
        ((ball(0.0, 0.0), right(4.0)), (Block([3.0, 0.0, 0.0], [0.5; 3], STRAIGHT), O), At(0.5)),
        ((ball(0.0, 0.0), O), (Block([0.5, 0.0, 0.0], [0.5; 3], STRAIGHT), right(1.0)), Never),
        (
            (Block(O, [0.5; 3], STRAIGHT), right(4.0)),
            (Block([3.0, 0.0, 0.0], [0.5; 3], STRAIGHT), O),
            At(0.5),
        ),
        // Along a face that it lies on.
        (
            (Block(O, [5.0, 0.5, 5.0], STRAIGHT), O),
            (Block([0.0, 1.0, 0.0], [0.5; 3], STRAIGHT), right(2.0)),
            Either,
        ),
        (
            (Rod([0.0, -1.0, 0.0], [0.0, 1.0, 0.0], 0.5), right(4.0)),
            (Rod([3.0, 0.0, -1.0], [3.0, 0.0, 1.0], 0.5), O),
            At(0.5),
        ),
        (
            (Rod([0.0, -1.0, 0.0], [0.0, 1.0, 0.0], 0.5), right(4.0)),
            (Rod([3.0, -1.0, 0.0], [3.0, 1.0, 0.0], 0.5), O),
            At(0.5),
        ),
        ((ball(0.0, 0.0), right(4.0)), (Def::Hull([3.0, 0.0, 0.0], [0.5; 3]), O), At(0.5)),
        (
            (ball(0.0, 0.0), right(4.0)),
            (Tri([[2.5, -9.0, -9.0], [2.5, 9.0, -9.0], [2.5, 0.0, 9.0]]), O),
            At(0.5),
        ),
    ];
    for place in Place::all() {
        for (a, b, when) in cases {
            tally.sweep::<f32>(a, b, when, &place);
            tally.sweep::<f64>(a, b, when, &place);
        }
    }
    tally.end("5, sweeps");
}

fn cast<S: Scalar>(thing: &Thing<S>, ray: &Ray<S>, longest: S) -> Option<RayHit<S>> {
    match thing {
        Thing::Sphere(it) => it.cast_ray(ray, longest),
        Thing::Aabb(it) => it.cast_ray(ray, longest),
        Thing::Obb(it) => it.cast_ray(ray, longest),
        Thing::Capsule(it) => it.cast_ray(ray, longest),
        Thing::Hull(it) => it.cast_ray(ray, longest),
        Thing::Triangle(_) => None,
    }
}

impl Tally {
    fn ray<S: Scalar>(
        &mut self,
        def: Def,
        (from, along): ([f64; 3], [f64; 3]),
        longest: f64,
        when: When,
        place: &Place,
    ) {
        let thing = def.thing::<S>(place);
        let direction = place.pose.transform_vector(Vec3::from(along)).map(S::from_f64);
        let ray = Ray { origin: place.point(from), direction };
        let found = cast(&thing, &ray, S::from_f64(longest * place.scale));
        let far = Vec3::from(from).magnitude() + def.size();
        // A ray at a slant comes to the surface later than it is off.
        let tolerance = 64.0 * place.tolerance::<S>(far);
        let right = match (when, found) {
            (When::At(distance), Some(hit)) => {
                (hit.distance.as_f64() - distance * place.scale).abs() <= tolerance
            }
            (When::At(distance), None) => {
                distance * place.scale > longest * place.scale - tolerance
            }
            (When::Never, found) => found.is_none() || tolerance > 0.05 * place.scale,
            (When::Either, _) => true,
        };
        let what = || format!("{def:?} {ray:?} {place:?}: {found:?}, not {when:?}");
        self.check(right || tolerance > place.scale, what);
        let sane = found.is_none_or(|hit| {
            let length = hit.normal.map(Scalar::as_f64).magnitude();
            hit.distance >= S::zero() && hit.distance.is_finite() && (length - 1.0).abs() < 1e-5
        });
        self.check(sane, what);
    }
}

#[test]
fn rays() {
    use When::{At, Either, Never};
    let mut tally = Tally::default();
    let inf = f64::INFINITY;
    let (x, y) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    let ball = Ball(O, 1.0);
    let cube = Block(O, [1.0; 3], STRAIGHT);
    let hull = Def::Hull(O, [1.0; 3]);
    let rod = Rod([0.0, -1.0, 0.0], [0.0, 1.0, 0.0], 1.0);
    for place in Place::all() {
        for def in [ball, cube, hull, rod] {
            for (ray, longest, when) in [
                (([-4.0, 0.0, 0.0], x), inf, At(3.0)),
                (([-4.0, 0.0, 0.0], x), 3.0 + 1e-3, At(3.0)),
                (([-4.0, 0.0, 0.0], x), 2.9, Never),
                (([-4.0, 0.0, 0.0], [-1.0, 0.0, 0.0]), inf, Never),
                (([-4.0, 0.0, 0.0], O), inf, Never),
                (([-1.0, 0.0, 0.0], x), inf, At(0.0)),
                ((O, x), inf, At(0.0)),
                ((O, O), 1.0, Either),
                (([0.3, 0.2, 0.1], y), 1e-3, At(0.0)),
                (([-1e7, 0.0, 0.0], x), inf, At(1e7 - 1.0)),
                (([0.0, 1e7, 1e7], [0.0, -0.5_f64.sqrt(), -0.5_f64.sqrt()]), inf, Either),
                // Tangent: touched or just missed.
                (([-4.0, 0.0, 1.0], x), inf, Either),
                (([-4.0, 0.0, 1.0 + 1e-3], x), inf, Never),
                (([-4.0, 0.0, 1.0 - 1e-3], x), inf, Either),
                // Along the axis of the rod and the sides of the box.
                (([0.0, -9.0, 0.0], y), inf, Either),
                (([1.0, -9.0, 0.0], y), inf, Either),
                (([1.01, -9.0, 0.0], y), inf, Never),
            ] {
                tally.ray::<f32>(def, ray, longest, when, &place);
                tally.ray::<f64>(def, ray, longest, when, &place);
            }
        }
    }
    tally.end("6, rays");
}

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

/// What is asked with denormal numbers flushed to zero must answer the same, to an ulp.
#[cfg(target_arch = "x86_64")]
#[test]
fn flushing_to_zero_changes_nothing() {
    /// Runs with the flags "flush to zero" and "denormals are zero" set.
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
