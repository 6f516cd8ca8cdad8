use cgmath::InnerSpace;

use super::marbles::Marbles;
use crate::Error;
use crate::error::positive;
use crate::math::{Scalar, length};

/// Speed limits of marbles, for games. None by default.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct SpeedLimits<S> {
    /// Maximum speed in m/s, above zero.
    pub linear: Option<S>,
    /// Maximum angular speed in rad/s, above zero.
    pub angular: Option<S>,
}

impl<S: Scalar> SpeedLimits<S> {
    pub(super) fn validated(self) -> Result<Self, Error> {
        self.linear.map(|speed| positive("linear", speed)).transpose()?;
        self.angular.map(|speed| positive("angular", speed)).transpose()?;
        Ok(self)
    }

    /// Clamps velocities and angular velocities to the limits.
    pub(super) fn apply(self, marbles: &mut Marbles<S>) {
        let rows = marbles.len();
        let Marbles { velocity, angular_velocity, changed, .. } = marbles;
        for (limit, column) in [(self.linear, velocity), (self.angular, angular_velocity)] {
            let Some(limit) = limit else { continue };
            for (row, v) in column.iter_mut().enumerate() {
                // Squares alone might overflow.
                if v.magnitude2() > limit * limit || !v.magnitude2().is_finite() {
                    let speed = length(*v);
                    if speed > limit {
                        *v *= limit / speed;
                        changed.add(row, rows);
                    }
                }
            }
        }
    }
}
