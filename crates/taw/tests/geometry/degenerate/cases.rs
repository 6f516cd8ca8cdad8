//! Shapes, the places where they are put, and a count of what went wrong.

use taw::contact::{ClosestPoints, closest_points, closest_points_brute_force, manifold};
use taw::frame::{AxisAngle, Pose};
use taw::math::{Quat, cast_point};
use taw::prelude::*;
use taw::shape::{BoundedShape, Capsule, Hull, Obb, Triangle};

use crate::things::Thing;
use Def::{Ball, Block, Rod, Tri};
pub const SCALES: [f64; 5] = [1e-6, 1e-3, 1.0, 1e3, 1e6];
pub const OFFSETS: [f64; 3] = [0.0, 1e3, 1e6];
/// Axes and angles: none, a quarter, and a crooked one.
pub const TURNS: [([f64; 3], f64); 3] = [
    ([0.0, 1.0, 0.0], 0.0),
    ([0.0, 0.0, 1.0], std::f64::consts::FRAC_PI_2),
    ([0.267, 0.535, -0.802], 0.7),
];

/// Where a case is put.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    pub scale: f64,
    pub offset: f64,
    pub pose: Pose<f64>,
}

impl Place {
    pub fn all() -> impl Iterator<Item = Self> {
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

    pub fn vector(&self, v: [f64; 3]) -> Vec3<f64> {
        self.pose.transform_vector(Vec3::from(v)) * self.scale
    }

    pub fn point<S: Scalar>(&self, p: [f64; 3]) -> Point3<S> {
        let offset = Vec3::new(self.offset, -self.offset, self.offset);
        Point3::from_vec((self.vector(p) + offset).map(S::from_f64))
    }

    /// Rounding of the input and of the answer, for things of this size.
    pub fn tolerance<S: Scalar>(&self, size: f64) -> f64 {
        let digits = 16.0 * S::epsilon().as_f64();
        (digits + 1e-11) * size * self.scale + digits * self.offset
    }
}

/// A shape in metres, about the origin.
#[derive(Clone, Copy, Debug)]
pub enum Def {
    Ball([f64; 3], f64),
    Rod([f64; 3], [f64; 3], f64),
    /// Middle, half widths, and a turn about an axis.
    Block([f64; 3], [f64; 3], ([f64; 3], f64)),
    Tri([[f64; 3]; 3]),
    /// The hull of a box.
    Hull([f64; 3], [f64; 3]),
}
pub const STRAIGHT: ([f64; 3], f64) = ([0.0, 1.0, 0.0], 0.0);
pub const O: [f64; 3] = [0.0; 3];

impl Def {
    pub fn thing<S: Scalar>(self, place: &Place) -> Thing<S> {
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

    pub fn size(self) -> f64 {
        let far = |p: [f64; 3]| Vec3::from(p).magnitude();
        match self {
            Ball(at, radius) => far(at) + radius,
            Rod(a, b, radius) => far(a) + far(b) + radius,
            Block(at, half, _) | Def::Hull(at, half) => far(at) + far(half),
            Tri(corners) => corners.map(far).iter().sum(),
        }
    }
}

pub fn finite<S: Scalar>(found: &ClosestPoints<S>) -> bool {
    let point = |p: Point3<S>| p.x.is_finite() && p.y.is_finite() && p.z.is_finite();
    found.distance.is_finite() && point(found.on_a) && point(found.on_b)
}

/// Counts the cases, and what went wrong with them.
#[derive(Default)]
pub struct Tally {
    cases: u32,
    failures: Vec<String>,
}

impl Tally {
    pub fn check(&mut self, right: bool, what: impl FnOnce() -> String) {
        self.cases += 1;
        if !right {
            self.failures.push(what());
        }
    }

    pub fn end(self, family: &str) {
        println!("{family}: {} cases, {} failures", self.cases, self.failures.len());
        let some: Vec<_> = self.failures.iter().take(5).collect();
        assert!(self.failures.is_empty(), "{some:#?}");
    }

    /// A pair in one place: finite, as far apart as it should be, the same both ways round.
    pub fn pair<S: Scalar>(&mut self, a: Def, b: Def, distance: f64, place: &Place) {
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

    pub fn pairs(&mut self, cases: &[(Def, Def, f64)]) {
        for place in Place::all() {
            for (a, b, distance) in cases {
                self.pair::<f32>(*a, *b, *distance, &place);
                self.pair::<f64>(*a, *b, *distance, &place);
            }
        }
    }
}

pub const ULP: f64 = f64::EPSILON;
