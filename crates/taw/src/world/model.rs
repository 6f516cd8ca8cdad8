use crate::Error;
use crate::error::within;
use crate::motion::{Integrator, Rotation};
use crate::response::Response;

/// Simulation settings: the physics to model, and its accuracy. A plain value, to be compared,
/// stored, and changed between steps.
///
/// ```
/// use taw::prelude::*;
///
/// let finer = Model { substeps: 8, ..Model::GAME };
/// assert_eq!(finer.response, Response::SoftStep);
/// assert_eq!(Model::default().response, Response::Displacement);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct Model {
    /// Integrator. A marble may have its own.
    pub integrator: Integrator,
    /// Contact response (solver).
    pub response: Response,
    /// Rotation model.
    pub rotation: Rotation,
    /// Numerical precision of the state.
    pub precision: Precision,
    /// Collision detection: discrete or continuous.
    pub detection: Detection,
    /// Substeps per step, from 1 to 1,000. The cost is proportional.
    pub substeps: u32,
    /// Maximum number of solver iterations over all contacts in a substep, from 1 to 1,000, of
    /// [`Response::Impulse`], of [`Response::Displacement`], of the rigid cores of
    /// [`Response::Penalty`] with [`Detection::Swept`], and of the large clusters of
    /// [`Response::EventDriven`]. They end sooner once the contacts have converged.
    pub iterations: u32,
}

/// Collision detection mode.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Detection {
    /// Discrete collision detection at the end of each substep. Marbles that move by more than
    /// their radii in a substep may tunnel through each other, and those that move by more than half
    /// of their radius through thin walls. (Half-spaces are solid behind.)
    Discrete,
    /// Continuous collision detection (CCD) within each substep, so that nothing tunnels. Marbles
    /// that move relative to each other or to a wall by more than half of their radius in a substep
    /// stop at the time of impact. Resting and sliding marbles continue along the surface; bouncing
    /// ones keep the velocity and normal of that moment, slide on along a wall, and lose the rest of
    /// the substep at another marble. Others lose none. A capsule stops at walls with its whole length,
    /// and turns no further until the next substep; at other marbles with the sphere around its
    /// center only. A wall that was
    /// [set](crate::world::Walls::set) to another pose since the last step, and has a
    /// [motion](crate::world::WallMotion), meets marbles on its way through the substep and carries
    /// them along. Nearly free where nothing is fast.
    ///
    /// [`Response::EventDriven`] is always continuous, and loses no time; [`Response::SoftStep`] is
    /// always continuous. With [`Response::Penalty`] only walls stop marbles, once they are half of
    /// their radius deep.
    #[default]
    Swept,
}

/// Numerical precision of positions and velocities.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Precision {
    /// Precision of the world's scalar.
    #[default]
    Plain,
    /// Compensated (double-single) precision, nearly that of `f64` also in a world of `f32`:
    /// rounding errors are kept in columns of their own (36 bytes per marble). Marbles then move
    /// correctly far from the origin, and in steps so short that a plain sum would not change. In a
    /// world of `f64` it changes nothing.
    Compensated,
}

impl Default for Model {
    /// The lecture's: positions only, by [`Response::Displacement`], without rotation, in one step.
    fn default() -> Self {
        let (response, rotation) = (Response::Displacement, Rotation::None);
        Self { response, rotation, substeps: 1, ..Self::GAME }
    }
}

impl Model {
    /// Marbles of a game: masses, restitution, friction and rotation, by [`Response::SoftStep`] in four
    /// substeps. Nothing tunnels, walls may move, what lies still sleeps; made for
    /// thousands of balls. Balls only.
    pub const GAME: Self = Self {
        integrator: Integrator::SemiImplicitEuler,
        response: Response::SoftStep,
        rotation: Rotation::Dynamic,
        precision: Precision::Plain,
        detection: Detection::Swept,
        substeps: 4,
        iterations: 8,
    };

    /// Few marbles that have to be exact, as in billiards, cradles and mazes: each collision at its
    /// time of impact, by [`Response::EventDriven`]. Balls only.
    pub const EXACT: Self =
        Self { response: Response::EventDriven, substeps: 1, iterations: 50, ..Self::GAME };

    /// Maximum number of [substeps](Model::substeps).
    pub const MAX_SUBSTEPS: u32 = 1000;
    /// Maximum number of [iterations](Model::iterations).
    pub const MAX_ITERATIONS: u32 = 1000;

    /// Number of times that the three verbs run in a step: once per substep, or once in all where
    /// the [response](Self::response) cuts its verb into substeps by itself.
    #[must_use]
    pub fn passes(&self) -> u32 {
        if self.response.uses_swarm_rows() { 1 } else { self.substeps }
    }

    /// Validates the model.
    pub(super) fn validated(self) -> Result<Self, Error> {
        let check = |field, count, most| within(field, f64::from(count), 1.0, f64::from(most));
        check("substeps", self.substeps, Self::MAX_SUBSTEPS)?;
        check("iterations", self.iterations, Self::MAX_ITERATIONS)?;
        Ok(self)
    }
}
