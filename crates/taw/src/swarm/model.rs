use std::sync::OnceLock;

use crate::Error;
use crate::error::within;
use crate::math::{Point3, Scalar, Vec3};
use crate::motion::Mass;
use crate::response::Material;

/// Balls per thread: with fewer, waking a thread costs more than it saves.
const BALLS_PER_THREAD: usize = 1000;

/// Number of hardware threads, at most [`SwarmModel::MAX_THREADS`].
fn machine_threads() -> usize {
    static THREADS: OnceLock<usize> = OnceLock::new(); // asking the system takes microseconds
    *THREADS.get_or_init(|| {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        threads.min(SwarmModel::MAX_THREADS as usize)
    })
}

/// Physics of the balls of a swarm (fidelity of its solver).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Tier {
    /// Position projection, the lecture's displacement: balls move straight, and overlapping ones
    /// are moved apart, half each. No masses, friction, restitution or spin. A heap never quite comes
    /// to rest, as nothing holds a ball but its neighbours. No correction makes a ball faster than it
    /// was, so that overlap is no energy: a ball at rest that is hit moves aside, and stays there. So
    /// momentum is not conserved.
    Lab,
    /// Masses, restitution, Coulomb friction and spin, by soft contacts with substeps (TGS soft).
    #[default]
    Full,
}

/// Model by which a swarm steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SwarmModel<S: Scalar = f32> {
    /// Physics of its balls.
    pub tier: Tier,
    /// Substeps per step, from 1 to 1,000; in [`Tier::Lab`], passes in which overlapping balls are
    /// moved apart.
    pub substeps: u32,
    /// Number of threads that work on a step, from 1 to 64, or 0 for automatic: one per 1,000 balls,
    /// at most all hardware threads. Islands of `Impulse` and `EventDriven` are solved by one per 128
    /// contacts, within the same limit. The result has the same bits with any number.
    pub threads: u32,
    /// Material of balls that have none of their own. Tangential restitution acts where restitution
    /// is above zero; [`Tier::Lab`] uses no number of it.
    pub material: Material<S>,
    /// Lets balls at rest fall asleep in [`Tier::Full`], with those that they touch; and marbles by every
    /// response.
    pub sleeps: bool,
}

impl<S: Scalar> Default for SwarmModel<S> {
    /// [`Tier::Full`] in two substeps, with automatic threads and sleep.
    fn default() -> Self {
        Self {
            tier: Tier::Full,
            substeps: 2,
            threads: 0,
            material: Material::default(),
            sleeps: true,
        }
    }
}

impl SwarmModel {
    /// Maximum number of [substeps](Self::substeps), for any scalar.
    pub const MAX_SUBSTEPS: u32 = 1000;
    /// Maximum number of [threads](Self::threads), for any scalar.
    pub const MAX_THREADS: u32 = crate::workers::MAX_THREADS as u32;
}

impl<S: Scalar> SwarmModel<S> {
    /// Validates the model.
    pub(super) fn validated(self) -> Result<Self, Error> {
        within("substeps", f64::from(self.substeps), 1.0, f64::from(SwarmModel::MAX_SUBSTEPS))?;
        within("threads", f64::from(self.threads), 0.0, f64::from(SwarmModel::MAX_THREADS))?;
        self.material.validated()?;
        Ok(self)
    }

    /// Number of threads for work that pays for all of them.
    pub(crate) fn all_threads(self) -> usize {
        self.threads_for(usize::MAX)
    }

    /// Number of threads that work on a step of this many balls; [`threads`](Self::threads) if it is
    /// not automatic.
    #[must_use]
    pub fn threads_for(self, balls: usize) -> usize {
        match self.threads {
            0 => (balls / BALLS_PER_THREAD).clamp(1, machine_threads()),
            threads => threads as usize,
        }
    }
}

/// Initial state of a ball of a swarm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball<S: Scalar = f32> {
    /// Center, in metres.
    pub position: Point3<S>,
    /// Radius in metres, from 1e-9 to 1e9.
    pub radius: S,
    /// Velocity, in m/s.
    pub velocity: Vec3<S>,
    /// Mass of the ball.
    pub mass: Mass<S>,
}

impl<S: Scalar> Ball<S> {
    /// Ball at rest with the density of glass, 2,500 kg/m³.
    #[must_use]
    pub fn new(position: Point3<S>, radius: S) -> Self {
        let velocity = Vec3::new(S::zero(), S::zero(), S::zero());
        Self { position, radius, velocity, mass: Mass::default() }
    }
}

/// Stage of a swarm's step, for profiling.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Stage {
    /// Integration of velocities and positions.
    Integrate,
    /// Sorting of rows by cell.
    Order,
    /// Search for pairs that may touch (broad phase), and restoring of their cached impulses.
    Pairs,
    /// Search for balls near walls.
    Walls,
    /// Solving of contacts: velocity and position changes.
    Restitute,
}
