//! Between Bevy's glam and the core's cgmath. No other file converts.

use bevy::math::Vec3;
use taw::math::{Point3, Vec3 as TawVec3};

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
