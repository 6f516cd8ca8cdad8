use cgmath::Zero;

use crate::Error;
use crate::error::{finite, finite_vector};
use crate::math::{Quat, Scalar, Vec3, normalize_and_length};

/// A rotation by an angle about an axis, by the right hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisAngle<S> {
    axis: Vec3<S>,
    angle: S,
}

impl<S: Scalar> AxisAngle<S> {
    /// Creates the rotation by `angle` radians about a direction of any length except zero.
    ///
    /// # Errors
    /// [`Error::NotFinite`], or [`Error::NotUnit`] if the axis is zero.
    pub fn new(axis: Vec3<S>, angle: S) -> Result<Self, Error> {
        finite_vector(["axis.x", "axis.y", "axis.z"], axis)?;
        finite("angle", angle)?;
        let Some((axis, _)) = normalize_and_length(axis) else {
            return Err(Error::NotUnit { field: "axis", value: 0.0 });
        };
        Ok(Self { axis, angle })
    }

    /// Axis, a unit vector.
    #[must_use]
    pub fn axis(self) -> Vec3<S> {
        self.axis
    }

    /// Angle, in radians.
    #[must_use]
    pub fn angle(self) -> S {
        self.angle
    }
}

impl<S: Scalar> From<AxisAngle<S>> for Quat<S> {
    fn from(AxisAngle { axis, angle }: AxisAngle<S>) -> Self {
        let (sin, cos) = (angle * S::from_f64(0.5)).sin_cos_portable();
        Self::from_sv(cos, axis * sin)
    }
}

impl<S: Scalar> From<Quat<S>> for AxisAngle<S> {
    /// The short way round: an angle in [0, π]. The identity becomes a zero rotation about x.
    fn from(rotation: Quat<S>) -> Self {
        let short = if rotation.s < S::zero() { -rotation } else { rotation };
        match normalize_and_length(short.v) {
            Some((axis, sin)) => {
                Self { axis, angle: sin.atan2_portable(short.s) * S::from_f64(2.0) }
            }
            None => Self { axis: Vec3::unit_x(), angle: Zero::zero() },
        }
    }
}
