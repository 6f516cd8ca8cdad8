#![allow(dead_code, reason = "not every test needs all of it")]
//! Shapes of six kinds from the same numbers, for the tests of pairs and queries.

use proptest::prelude::*;
use taw::frame::{AxisAngle, Pose};
use taw::prelude::*;
use taw::shape::{Aabb, BoundedShape, Capsule, Hull, Obb, Triangle};

/// One of each kind, of about this size, about here; its size beside it.
#[derive(Clone, Debug)]
pub enum Thing<S> {
    Sphere(Sphere<S>),
    Aabb(Aabb<Point3<S>>),
    Obb(Obb<S>),
    Capsule(Capsule<S>),
    Hull(Hull<S>),
    Triangle(Triangle<S>),
}

/// Evaluates an expression for whichever kind it is.
#[macro_export]
macro_rules! each {
    ($thing:expr, $name:ident => $value:expr) => {
        match $thing {
            $crate::things::Thing::Sphere($name) => $value,
            $crate::things::Thing::Aabb($name) => $value,
            $crate::things::Thing::Obb($name) => $value,
            $crate::things::Thing::Capsule($name) => $value,
            $crate::things::Thing::Hull($name) => $value,
            $crate::things::Thing::Triangle($name) => $value,
        }
    };
}

impl Thing<f64> {
    /// Moves it elsewhere. A box along the axes stays one unless it is turned.
    pub fn transformed(&self, pose: Pose<f64>) -> Self {
        let by = pose.translation;
        match self.clone() {
            Self::Sphere(it) => {
                Self::Sphere(Sphere { center: pose.transform_point(it.center), ..it })
            }
            Self::Aabb(it) if pose == (Pose { translation: by, ..Pose::identity() }) => {
                Self::Aabb(Aabb { min: it.min + by, max: it.max + by })
            }
            Self::Aabb(it) => Self::Obb(it.obb().transformed(pose)),
            Self::Obb(it) => Self::Obb(it.transformed(pose)),
            Self::Capsule(it) => Self::Capsule(it.transformed(pose)),
            Self::Triangle(it) => Self::Triangle(Triangle {
                corners: it.corners.map(|corner| pose.transform_point(corner)),
            }),
            Self::Hull(it) => Self::Hull(it.transformed(pose)),
        }
    }
}

pub type Numbers = ([f64; 3], [f64; 3], f64, Vec<[f64; 3]>);

/// The six kinds, from the same numbers, at a scale and an offset.
pub fn things<S: Scalar>(
    (at, axis, angle, points): &Numbers,
    scale: f64,
    offset: f64,
) -> Vec<Thing<S>> {
    let point = |p: [f64; 3]| {
        Point3::from([0, 1, 2].map(|i| S::from_f64((p[i] + at[i]) * scale + offset * scale)))
    };
    let size = |x: f64| S::from_f64(x.abs() * scale + 0.01 * scale);
    let turn = AxisAngle::new(Vec3::from(*axis), *angle).unwrap();
    let axis = turn.axis().map(S::from_f64);
    let rotation = AxisAngle::new(axis, S::from_f64(turn.angle())).unwrap().into();
    let half_extents = Vec3::from([0, 1, 2].map(|i| size(points[0][i])));
    let obb = Obb::new(point([0.0; 3]), rotation, half_extents).unwrap();
    let corners: Vec<_> = points.iter().map(|p| point(*p)).collect();
    let mut all = vec![
        Thing::Sphere(Sphere::new(point([0.0; 3]), size(points[0][0])).unwrap()),
        Thing::Aabb(obb.bounding_box()),
        Thing::Obb(obb),
        Thing::Capsule(Capsule::new(point(points[1]), point(points[2]), size(0.3)).unwrap()),
    ];
    all.push(Thing::Triangle(Triangle { corners: [corners[3], corners[4], corners[5]] }));
    all.extend(Hull::new(&corners).ok().map(Thing::Hull));
    all
}

pub fn numbers() -> impl Strategy<Value = Numbers> {
    let part = || prop_oneof![4 => -1.5..1.5_f64, 1 => Just(0.0), 1 => Just(1.0)];
    let three = move || [part(), part(), part()];
    let axis = [-1.0..1.0_f64, -1.0..1.0, 0.1..1.0];
    let angle = prop_oneof![3 => -3.0..3.0_f64, 2 => Just(0.0), 1 => Just(1e-9)];
    (three(), axis, angle, prop::collection::vec(three(), 6..10))
}
