use crate::Error;
use crate::error::within;
use crate::motion::{Integrator, Rotation};
use crate::response::Response;

/// The choice that the user makes: what to model, and how finely. A plain value,
/// to be compared, stored, and changed between steps.
///
/// ```
/// use taw::prelude::*;
///
/// let finer = Model { substeps: 4, ..Model::default() };
/// assert_eq!(finer.response, Response::Displacement);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Model {
    /// How things move. A marble may have its own.
    pub integrator: Integrator,
    /// What touches do.
    pub response: Response,
    /// Whether marbles turn.
    pub rotation: Rotation,
    /// Into how many equal parts each step is cut, from 1 to 1,000. Costs as many
    /// times as much.
    pub substeps: u32,
}

impl Default for Model {
    fn default() -> Self {
        Self {
            integrator: Integrator::SemiImplicitEuler,
            response: Response::Displacement,
            rotation: Rotation::None,
            substeps: 1,
        }
    }
}

impl Model {
    /// The largest number of [substeps](Model::substeps).
    pub const MAX_SUBSTEPS: u32 = 1000;

    /// This model, if a world can step with it.
    pub(super) fn checked(self) -> Result<Self, Error> {
        let most = f64::from(Self::MAX_SUBSTEPS);
        within("substeps", f64::from(self.substeps), 1.0, most).map(|_| self)
    }
}
