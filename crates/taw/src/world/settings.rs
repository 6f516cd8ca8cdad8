//! Settings of a world.

use super::integrate::StepContext;
use super::{Model, SpeedLimits};
use crate::math::{Scalar, Vec3};
use crate::motion::ForceField;

/// Settings of a world, each validated by its setter.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Settings<S: Scalar> {
    pub model: Model,
    /// Acceleration of every marble and ball, in m/s².
    pub gravity: Vec3<S>,
    pub forces: Vec<ForceField<S>>,
    pub limits: SpeedLimits<S>,
    /// True to fill contacts of `SoftStep` with the impulses of the step.
    pub records_impulses: bool,
}

impl<S: Scalar> Default for Settings<S> {
    /// Gravity 9.81 m/s² toward −y and the default [`Model`].
    fn default() -> Self {
        Self {
            model: Model::default(),
            gravity: Vec3::unit_y() * S::from_f64(-9.81),
            forces: Vec::new(),
            limits: SpeedLimits::default(),
            records_impulses: false,
        }
    }
}

impl<S: Scalar> Settings<S> {
    /// Forces on marbles over `dt` seconds.
    pub fn step_context(&self, dt: S) -> StepContext<'_, S> {
        StepContext {
            integrator: self.model.integrator,
            gravity: self.gravity,
            forces: &self.forces,
            dt,
        }
    }
}
