use std::ops::Mul;

use cgmath::{Decomposed, EuclideanSpace, One, Zero};

use super::{Motor, slerp};
use crate::Error;
use crate::error::{finite_vector, rotation};
use crate::math::{Mat4, Point3, Quat, Scalar, Vec3};

/// Where a thing is and how it is turned, in the frame of something else: what takes its
/// own coordinates to those of the other. Poses multiply from the left, local ones last:
/// `world = parent * local`.
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
    /// A unit quaternion.
    pub rotation: Quat<S>,
    /// In metres.
    pub translation: Vec3<S>,
}

impl<S: Scalar> Pose<S> {
    /// That which leaves everything where it is.
    #[must_use]
    pub fn identity() -> Self {
        Self { rotation: Quat::one(), translation: Vec3::zero() }
    }

    /// This pose, if it is one: finite, and with a rotation of length one, from which it may
    /// have drifted by 1e-3.
    ///
    /// # Errors
    /// [`Error::NotFinite`] for the translation, [`Error::NotUnit`] for the rotation.
    pub fn checked(self) -> Result<Self, Error> {
        let fields = ["translation.x", "translation.y", "translation.z"];
        let translation = finite_vector(fields, self.translation)?;
        Ok(Self { rotation: rotation("rotation", self.rotation)?, translation })
    }

    /// The way back.
    #[must_use]
    pub fn inverse(self) -> Self {
        let rotation = self.rotation.conjugate();
        Self { rotation, translation: rotation * -self.translation }
    }

    /// Where a point is that has these coordinates here.
    #[must_use]
    pub fn point(self, point: Point3<S>) -> Point3<S> {
        Point3::from_vec(self.rotation * point.to_vec() + self.translation)
    }

    /// Where a direction points.
    #[must_use]
    pub fn vector(self, vector: Vec3<S>) -> Vec3<S> {
        self.rotation * vector
    }

    /// The coordinates here of a point that is there.
    #[must_use]
    pub fn point_back(self, point: Point3<S>) -> Point3<S> {
        Point3::from_vec(self.rotation.conjugate() * (point.to_vec() - self.translation))
    }

    /// The direction here of one that points there.
    #[must_use]
    pub fn vector_back(self, vector: Vec3<S>) -> Vec3<S> {
        self.rotation.conjugate() * vector
    }

    /// The pose that is `part` of the way to another: straight, and turning at a steady
    /// speed the short way round.
    #[must_use]
    pub fn toward(self, other: Self, part: S) -> Self {
        let translation = self.translation + (other.translation - self.translation) * part;
        Self { rotation: slerp(self.rotation, other.rotation, part), translation }
    }

    /// The same as a matrix.
    #[must_use]
    pub fn matrix(self) -> Mat4<S> {
        self.scaled(S::one()).into()
    }

    /// The same after all lengths have been multiplied, as cgmath's type for such.
    #[must_use]
    pub fn scaled(self, scale: S) -> Decomposed<Vec3<S>, Quat<S>> {
        Decomposed { scale, rot: self.rotation, disp: self.translation }
    }
}

impl<S: Scalar> Mul for Pose<S> {
    type Output = Self;

    /// What takes first there, then here.
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
