use std::ops::Mul;

use cgmath::{Decomposed, EuclideanSpace, One, Zero};

use super::{Motor, slerp};
use crate::Error;
use crate::error::{finite_vector, rotation};
use crate::math::{Mat4, Point3, Quat, Scalar, Vec3};

/// A rigid transform (isometry): position and rotation of a local frame in a parent frame. Poses
/// multiply from the left, local ones last: `world = parent * local`.
///
/// ```
/// use taw::frame::{AxisAngle, Pose};
/// use taw::prelude::*;
///
/// # fn main() -> Result<(), taw::Error> {
/// let quarter = AxisAngle::new(Vec3::unit_y(), std::f64::consts::FRAC_PI_2)?;
/// let cart = Pose { rotation: quarter.into(), translation: Vec3::new(5.0, 0.0, 0.0) };
/// let wheel = Pose { translation: Vec3::new(1.0, 0.0, 0.0), ..Pose::identity() };
/// let at = (cart * wheel).translation;
/// assert!((at - Vec3::new(5.0, 0.0, -1.0)).magnitude() < 1e-15);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose<S> {
    /// Rotation, a unit quaternion.
    pub rotation: Quat<S>,
    /// Translation, in metres.
    pub translation: Vec3<S>,
}

impl<S: Scalar> Pose<S> {
    /// The identity.
    #[must_use]
    pub fn identity() -> Self {
        Self { rotation: Quat::one(), translation: Vec3::zero() }
    }

    /// Validates the pose: finite, and with a rotation whose length is within 1e-3 of one, which is
    /// then normalized.
    ///
    /// # Errors
    /// [`Error::NotFinite`] for the translation, [`Error::NotUnit`] for the rotation.
    pub fn validated(self) -> Result<Self, Error> {
        let fields = ["translation.x", "translation.y", "translation.z"];
        let translation = finite_vector(fields, self.translation)?;
        Ok(Self { rotation: rotation("rotation", self.rotation)?, translation })
    }

    /// Inverse transform.
    #[must_use]
    pub fn inverse(self) -> Self {
        let rotation = self.rotation.conjugate();
        Self { rotation, translation: rotation * -self.translation }
    }

    /// Transforms a point from the local to the parent frame.
    #[must_use]
    pub fn transform_point(self, point: Point3<S>) -> Point3<S> {
        Point3::from_vec(self.rotation * point.to_vec() + self.translation)
    }

    /// Transforms a vector from the local to the parent frame.
    #[must_use]
    pub fn transform_vector(self, vector: Vec3<S>) -> Vec3<S> {
        self.rotation * vector
    }

    /// Transforms a point from the parent to the local frame.
    #[must_use]
    pub fn inverse_transform_point(self, point: Point3<S>) -> Point3<S> {
        Point3::from_vec(self.rotation.conjugate() * (point.to_vec() - self.translation))
    }

    /// Transforms a vector from the parent to the local frame.
    #[must_use]
    pub fn inverse_transform_vector(self, vector: Vec3<S>) -> Vec3<S> {
        self.rotation.conjugate() * vector
    }

    /// Interpolates to another pose by a fraction: straight, and rotating at a steady speed the
    /// short way round.
    #[must_use]
    pub fn interpolate(self, other: Self, fraction: S) -> Self {
        let translation = self.translation + (other.translation - self.translation) * fraction;
        Self { rotation: slerp(self.rotation, other.rotation, fraction), translation }
    }

    /// Homogeneous matrix.
    #[must_use]
    pub fn matrix(self) -> Mat4<S> {
        self.scaled(S::one()).into()
    }

    /// Adds a uniform scale, as cgmath's type for such transforms.
    #[must_use]
    pub fn scaled(self, scale: S) -> Decomposed<Vec3<S>, Quat<S>> {
        Decomposed { scale, rot: self.rotation, disp: self.translation }
    }
}

impl<S: Scalar> Mul for Pose<S> {
    type Output = Self;

    /// Composition: the local pose first, then this one.
    fn mul(self, local: Self) -> Self {
        Self {
            rotation: self.rotation * local.rotation,
            translation: self.rotation * local.translation + self.translation,
        }
    }
}

impl<S: Scalar> From<Pose<S>> for Motor<S> {
    fn from(pose: Pose<S>) -> Self {
        Self::new(pose.rotation, pose.translation)
    }
}

impl<S: Scalar> From<Motor<S>> for Pose<S> {
    fn from(motor: Motor<S>) -> Self {
        Self { rotation: motor.rotation(), translation: motor.translation() }
    }
}
