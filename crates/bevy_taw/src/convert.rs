//! Conversion between Bevy's glam and the core's cgmath, and checks of numbers.

use bevy::math::{Quat, Vec3};
use taw::math::{Point3, Quat as TawQuat, Vec3 as TawVec3};

/// A glam vector as a displacement, velocity or direction.
pub fn to_vector(v: Vec3) -> TawVec3<f32> {
    TawVec3::new(v.x, v.y, v.z)
}

/// A glam vector as a location.
pub fn to_point(v: Vec3) -> Point3<f32> {
    Point3::new(v.x, v.y, v.z)
}

/// A displacement, velocity or direction for glam.
pub fn from_vector(v: TawVec3<f32>) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}

/// A location for glam.
pub fn from_point(p: Point3<f32>) -> Vec3 {
    Vec3::new(p.x, p.y, p.z)
}

/// A glam rotation for the core.
pub fn to_rotation(q: Quat) -> TawQuat<f32> {
    TawQuat::new(q.w, q.x, q.y, q.z)
}

/// A rotation for glam.
pub fn from_rotation(q: TawQuat<f32>) -> Quat {
    Quat::from_xyzw(q.v.x, q.v.y, q.v.z, q.s)
}

/// Checks that fields are finite, by their names.
pub fn all_finite<const N: usize>(fields: [(&'static str, f32); N]) -> Result<(), taw::Error> {
    let bad = fields.into_iter().find(|(_, value)| !value.is_finite());
    bad.map_or(Ok(()), |(field, value)| Err(taw::Error::NotFinite { field, value: value.into() }))
}

/// Checks that a field is finite and at least zero.
pub fn at_least_zero(field: &'static str, value: f32) -> Result<(), taw::Error> {
    within(field, value, 0.0, f32::MAX)
}

/// Checks that a field is in a range.
pub fn within(field: &'static str, value: f32, min: f32, max: f32) -> Result<(), taw::Error> {
    if (min..=max).contains(&value) {
        return Ok(());
    }
    let [value, min, max] = [value, min, max].map(f64::from);
    Err(taw::Error::OutOfRange { field, value, min, max })
}
