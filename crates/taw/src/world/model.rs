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
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct Model {
    /// How things move. A marble may have its own.
    pub integrator: Integrator,
    /// What touches do.
    pub response: Response,
    /// Whether marbles turn.
    pub rotation: Rotation,
    /// Whether marbles keep what the scalar cuts off.
    pub precision: Precision,
    /// Whether touches are looked for on the way, too.
    pub detection: Detection,
    /// Into how many equal parts each step is cut, from 1 to 1,000. Costs as many
    /// times as much.
    pub substeps: u32,
    /// Iterations of [`Response::Impulse`] and [`Response::Displacement`] over all contacts in a
    /// substep, from 1 to 1,000. They end sooner when nothing changes any more.
    pub iterations: u32,
}

/// When touches are looked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Detection {
    /// At the end of each substep. Marbles that move by more than their radii in it may
    /// pass through each other, and through thin walls. (Half-spaces are solid behind.)
    Discrete,
    /// On the way through the substep too (continuous collision detection), so that nothing
    /// tunnels. Marbles that move against each other or a wall by more than half of their radius
    /// in a substep stop where they first touch. What lies or slides there goes on along the surface;
    /// what bounces has the velocity and the normal of that moment, slides on along a wall, and
    /// against another marble loses what was left of its time. Others lose none. Costs next to
    /// nothing where nothing is fast.
    ///
    /// [`Response::EventDriven`] always does, and loses nothing. By [`Response::Penalty`] only
    /// walls stop marbles, once they are half of their radius deep.
    #[default]
    Swept,
}

/// How exactly marbles remember where they are and how they move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Precision {
    /// As the world's scalar can.
    #[default]
    Plain,
    /// Nearly as `f64` can, also in a world of `f32`, which keeps what it cuts off in
    /// columns of its own (36 bytes a marble). Far from the origin, and in steps so short
    /// that a plain sum would not change, marbles then move as they should. In a world of
    /// `f64` it changes nothing.
    Compensated,
}

impl Default for Model {
    fn default() -> Self {
        Self {
            integrator: Integrator::SemiImplicitEuler,
            response: Response::Displacement,
            rotation: Rotation::None,
            precision: Precision::Plain,
            detection: Detection::Swept,
            substeps: 1,
            iterations: 8,
        }
    }
}

impl Model {
    /// The largest number of [substeps](Model::substeps).
    pub const MAX_SUBSTEPS: u32 = 1000;
    /// The largest number of [iterations](Model::iterations).
    pub const MAX_ITERATIONS: u32 = 1000;

    /// Number of times that the three verbs run in a step: once per substep, or once in all where
    /// the [response](Self::response) cuts its verb into substeps by itself.
    #[must_use]
    pub fn passes(&self) -> u32 {
        if self.response == Response::SoftStep { 1 } else { self.substeps }
    }

    /// This model, if a world can step with it.
    pub(super) fn checked(self) -> Result<Self, Error> {
        let check = |field, count, most| within(field, f64::from(count), 1.0, f64::from(most));
        check("substeps", self.substeps, Self::MAX_SUBSTEPS)?;
        check("iterations", self.iterations, Self::MAX_ITERATIONS)?;
        Ok(self)
    }
}
