use cgmath::InnerSpace;

use super::rotation_of_matrix;
use crate::Error;
use crate::error::finite_vector;
use crate::math::{Mat3, Quat, Scalar, Vec3, normalize_and_length};

/// A rotation given by the images of two axes: −z looks `forward`, y points `up`. Both are
/// perpendicular unit vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LookAt<S> {
    forward: Vec3<S>,
    up: Vec3<S>,
}

impl<S: Scalar> LookAt<S> {
    /// Creates a rotation that looks along a direction with `up` as upright as possible. Straight
    /// up or down, the up vector is −z or z instead (or y, if that is the direction).
    ///
    /// # Errors
    /// [`Error::NotFinite`], or [`Error::NotUnit`] if one of them is zero.
    pub fn new(forward: Vec3<S>, up: Vec3<S>) -> Result<Self, Error> {
        finite_vector(["forward.x", "forward.y", "forward.z"], forward)?;
        finite_vector(["up.x", "up.y", "up.z"], up)?;
        let zero = |field| Error::NotUnit { field, value: 0.0 };
        let (forward, _) = normalize_and_length(forward).ok_or(zero("forward"))?;
        let (up, _) = normalize_and_length(up).ok_or(zero("up"))?;
        // Component perpendicular to the direction, if it is more than rounding.
        let beside = |v: Vec3<S>| {
            let rest = v - forward * v.dot(forward);
            let (unit, length) = normalize_and_length(rest)?;
            // Once more, for the rounding of the first subtraction.
            let unit = (unit - forward * unit.dot(forward)).normalize();
            (length > S::epsilon() * S::from_f64(8.0)).then_some(unit)
        };
        let instead = if up.dot(forward) > S::zero() { Vec3::unit_z() } else { -Vec3::unit_z() };
        let up = beside(up).or_else(|| beside(instead)).or_else(|| beside(Vec3::unit_y()));
        Ok(Self { forward, up: up.unwrap_or_else(Vec3::unit_y) })
    }

    /// Forward direction.
    #[must_use]
    pub fn forward(self) -> Vec3<S> {
        self.forward
    }

    /// Up direction.
    #[must_use]
    pub fn up(self) -> Vec3<S> {
        self.up
    }
}

impl<S: Scalar> From<LookAt<S>> for Quat<S> {
    fn from(LookAt { forward, up }: LookAt<S>) -> Self {
        rotation_of_matrix(&Mat3::from_cols(forward.cross(up), up, -forward))
    }
}

impl<S: Scalar> From<Quat<S>> for LookAt<S> {
    fn from(rotation: Quat<S>) -> Self {
        Self { forward: rotation * -Vec3::unit_z(), up: rotation * Vec3::unit_y() }
    }
}
