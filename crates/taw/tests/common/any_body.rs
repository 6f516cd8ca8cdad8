#![allow(dead_code, reason = "not every test needs all of it")]
//! Bodies that nobody chose. The same draws give the same body in each scalar, up to rounding.

use cgmath::InnerSpace;
use taw::body::Body;
use taw::frame::Pose;
use taw::math::Quat;
use taw::prelude::*;
use taw::shape::{Capsule, Compound, Hull, Obb, Shape};

use crate::draw::Draw;

pub fn any_vector<S: Scalar>(draw: &mut Draw, most: f64) -> Vec3<S> {
    let [x, y, z] = [0; 3].map(|_| S::from_f64(draw.between(-most, most)));
    Vec3::new(x, y, z)
}

pub fn any_point<S: Scalar>(draw: &mut Draw, most: f64) -> Point3<S> {
    Point3::from_vec(any_vector(draw, most))
}

pub fn any_rotation<S: Scalar>(draw: &mut Draw) -> Quat<S> {
    let v = any_vector(draw, 1.0);
    Quat::from_sv(S::from_f64(draw.between(0.1, 1.0)), v).normalize()
}

/// Sphere, box, capsule or hull of this size, in metres, about a place.
fn any_part<S: Scalar>(draw: &mut Draw, size: f64, place: Point3<S>) -> Shape<S> {
    let [a, b, c] = [0; 3].map(|_| S::from_f64(draw.between(0.2, 1.0) * size));
    let shift = place.to_vec();
    match (draw.next() * 4.0) as u8 {
        0 => Shape::Sphere(Sphere::new(place, a).unwrap()),
        1 => Shape::Obb(Obb::new(place, any_rotation(draw), Vec3::new(a, b, c)).unwrap()),
        2 => {
            let ends = [0; 2].map(|_| any_point::<S>(draw, size) + shift);
            Shape::Capsule(Capsule::new(ends[0], ends[1], a).unwrap())
        }
        _ => {
            let corners = [0; 8].map(|_| any_point::<S>(draw, size) + shift);
            Shape::Hull(Hull::new(&corners).unwrap())
        }
    }
}

/// One part, or a compound of two or three.
pub fn any_shape<S: Scalar>(draw: &mut Draw, size: f64) -> Shape<S> {
    let count = (draw.next() * 3.0) as usize + 1;
    let mut parts: Vec<_> = (0..count)
        .map(|_| {
            let place = any_point(draw, size);
            any_part(draw, size, place)
        })
        .collect();
    if count == 1 { parts.remove(0) } else { Shape::Compound(Compound::new(parts).unwrap()) }
}

/// At rest within this distance of the origin along each axis.
pub fn any_body<S: Scalar>(draw: &mut Draw, size: f64, most: f64) -> Body<S> {
    let shape = any_shape(draw, size);
    let position = any_point(draw, most);
    Body { rotation: any_rotation(draw), ..Body::new(shape, position) }
}

/// Shape of a body where it is now, given its shape in its frame.
pub fn placed<S: Scalar>(
    world: &World<S>,
    id: taw::body::BodyId,
    local: &Shape<f64>,
) -> Shape<f64> {
    let Pose { rotation: Quat { s, v }, translation } = world.bodies.pose(id).unwrap();
    let rotation = Quat::from_sv(s.as_f64(), v.map(S::as_f64)).normalize();
    local.transformed(Pose { rotation, translation: translation.map(S::as_f64) })
}
