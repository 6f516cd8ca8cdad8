use cgmath::InnerSpace;

use super::marbles::Marbles;
use crate::Error;
use crate::error::positive;
use crate::math::{Scalar, length};

/// The fastest that marbles may be, for games that want it. There is no limit unless one
/// is set here.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedLimits<S> {
    /// Of the velocity, in m/s, above zero.
    pub linear: Option<S>,
    /// Of the spin, in rad/s, above zero.
    pub angular: Option<S>,
}

impl<S> Default for SpeedLimits<S> {
    /// None.
    fn default() -> Self {
        Self { linear: None, angular: None }
    }
}

impl<S: Scalar> SpeedLimits<S> {
    pub(super) fn checked(self) -> Result<Self, Error> {
        self.linear.map(|speed| positive("linear", speed)).transpose()?;
        self.angular.map(|speed| positive("angular", speed)).transpose()?;
        Ok(self)
    }

    /// Slows down whatever is faster.
    pub(super) fn apply(self, marbles: &mut Marbles<S>) {
        for (limit, column) in
            [(self.linear, &mut marbles.velocity), (self.angular, &mut marbles.spin)]
        {
            let Some(limit) = limit else { continue };
            for v in column {
                // Squares alone might overflow.
                if v.magnitude2() > limit * limit || !v.magnitude2().is_finite() {
                    let speed = length(*v);
                    if speed > limit {
                        *v *= limit / speed;
                    }
                }
            }
        }
    }
}
