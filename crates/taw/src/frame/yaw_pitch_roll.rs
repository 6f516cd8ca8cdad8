use cgmath::num_traits::FloatConst;

use crate::math::{Quat, Scalar};

/// A rotation by Euler angles in radians, intrinsic yaw (y), pitch (x), roll (z): Bevy's
/// `EulerRot::YXZ`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YawPitchRoll<S> {
    /// Yaw about y.
    pub yaw: S,
    /// Pitch about x.
    pub pitch: S,
    /// Roll about z.
    pub roll: S,
}

impl<S: Scalar> From<YawPitchRoll<S>> for Quat<S> {
    fn from(YawPitchRoll { yaw, pitch, roll }: YawPitchRoll<S>) -> Self {
        let half = |angle: S| (angle * S::from_f64(0.5)).sin_cos_portable();
        let [(sy, cy), (sx, cx), (sz, cz)] = [yaw, pitch, roll].map(half);
        Self::new(
            cy * cx * cz + sy * sx * sz,
            cy * sx * cz + sy * cx * sz,
            sy * cx * cz - cy * sx * sz,
            cy * cx * sz - sy * sx * cz,
        )
    }
}

impl<S: Scalar + FloatConst> From<Quat<S>> for YawPitchRoll<S> {
    /// Pitch in [−π/2, π/2]; yaw and roll in [−π, π]. In gimbal lock, only the sum or the
    /// difference of yaw and roll is defined: then the roll is zero. Near it, both lose digits, but
    /// not the rotation that they make together.
    ///
    /// The sums and differences of the components are products of sines and cosines of
    /// the half sum and half difference of yaw and roll, so no arc sine is needed
    /// (Bernardes and Viollet, *Quaternion to Euler angles conversion*, 2022).
    fn from(rotation: Quat<S>) -> Self {
        let Quat { s, v } = rotation;
        let (up, down) = ((v.y - v.z, s + v.x), (v.y + v.z, s - v.x));
        let (tall, deep) = (up.0.hypot(up.1), down.0.hypot(down.1));
        let two = S::from_f64(2.0);
        let pitch = (tall - deep).atan2_portable(tall + deep) * two;
        // Half of yaw less roll, and half of yaw and roll.
        let difference = up.0.atan2_portable(up.1);
        let sum = down.0.atan2_portable(down.1);
        let none = S::epsilon() * two;
        let (yaw, roll) = if deep <= none {
            (difference * two, S::zero())
        } else if tall <= none {
            (sum * two, S::zero())
        } else {
            (sum + difference, sum - difference)
        };
        let turn = S::PI() * two;
        let wrap = |angle: S| {
            if angle > S::PI() {
                angle - turn
            } else if angle < -S::PI() {
                angle + turn
            } else {
                angle
            }
        };
        Self { yaw: wrap(yaw), pitch, roll: wrap(roll) }
    }
}
