use std::sync::OnceLock;

use crate::Error;
use crate::error::within;
use crate::math::{Point3, Vec3};
use crate::motion::Mass;
use crate::response::Material;

/// Number of balls from which on another thread saves more than waking it costs.
const BALLS_PER_THREAD: usize = 1000;

/// Number of threads of the machine, at most [`SwarmModel::MAX_THREADS`].
fn machine_threads() -> usize {
    static THREADS: OnceLock<usize> = OnceLock::new(); // asking the system takes microseconds
    *THREADS.get_or_init(|| {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        threads.min(SwarmModel::MAX_THREADS as usize)
    })
}

/// Physics of the balls of a swarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Tier {
    /// They move along lines, and overlapping ones are moved apart, half each: the displacement of
    /// the lecture. No masses, no friction, no bounce, no spin. What lies in a heap never quite
    /// comes to rest, as nothing holds it but its neighbours. No push makes a ball faster than it
    /// was, so that overlap is no energy: one at rest that another hits is moved, and stays there.
    Lab,
    /// Masses, restitution, Coulomb friction and spin, by soft contacts in small steps.
    #[default]
    Full,
}

/// Model by which a swarm steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SwarmModel {
    /// Physics of its balls.
    pub tier: Tier,
    /// Into how many equal parts each step is cut, from 1 to 1,000: in the lab's tier, how often
    /// overlapping balls are moved apart.
    pub substeps: u32,
    /// Number of threads that work on a step, from 1 to 64, or 0 for as many of the machine's as
    /// there are balls enough to keep busy. They change no bit of it.
    pub threads: u32,
    /// Material of the balls. Tangential restitution is not modelled, nor in the lab's tier are
    /// friction, restitution, rolling and spinning resistance.
    pub material: Material<f32>,
    /// Lets balls that lie still fall asleep, in the full tier.
    pub sleeps: bool,
}

impl Default for SwarmModel {
    /// The full tier in two substeps, on as many threads as pay, with sleep.
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
    /// The largest number of [substeps](Self::substeps).
    pub const MAX_SUBSTEPS: u32 = 1000;
    /// The largest number of [threads](Self::threads).
    pub const MAX_THREADS: u32 = super::workers::MAX_THREADS as u32;

    /// This model, if a swarm can step with it.
    pub(super) fn validated(self) -> Result<Self, Error> {
        within("substeps", f64::from(self.substeps), 1.0, f64::from(Self::MAX_SUBSTEPS))?;
        within("threads", f64::from(self.threads), 0.0, f64::from(Self::MAX_THREADS))?;
        self.material.validated()?;
        Ok(self)
    }

    /// Number of threads that work on a step of so many balls.
    #[must_use]
    pub fn threads_for(self, balls: usize) -> usize {
        match self.threads {
            0 => (balls / BALLS_PER_THREAD).clamp(1, machine_threads()),
            threads => threads as usize,
        }
    }
}

/// A ball on its way into a swarm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// The center, in metres.
    pub position: Point3<f32>,
    /// In metres, from 1e-9 to 1e9.
    pub radius: f32,
    /// In metres per second.
    pub velocity: Vec3<f32>,
    /// Mass of the ball.
    pub mass: Mass<f32>,
}

impl Ball {
    /// A ball of glass, at rest.
    #[must_use]
    pub fn new(position: Point3<f32>, radius: f32) -> Self {
        let velocity = Vec3::new(0.0, 0.0, 0.0);
        Self { position, radius, velocity, mass: Mass::default() }
    }
}

/// Part of a step, for whoever wants to know how long each takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Stage {
    /// Velocities and places move on.
    Integrate,
    /// Rows are put in the order of cells.
    Order,
    /// Pairs that might touch are searched, and their cached impulses restored.
    Pairs,
    /// Balls at walls are searched.
    Walls,
    /// Contacts change velocities or places.
    Restitute,
}
