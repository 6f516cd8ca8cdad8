//! A scene with all that says how it is stepped: what a file of the storm holds.

use std::fmt;

use ron::ser::PrettyConfig;
use serde::{Deserialize, Serialize};
use taw::prelude::*;
use taw::scene::{MarbleDesc, MaterialDesc, Scene, Simulation};
use taw::swarm::{SwarmModel, Tier};

use super::judge::Invariant;
use crate::trade::trace::ScalarType;

/// A scene, how it is stepped, and what is known of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// Which invariant it broke when it was kept.
    #[serde(default)]
    pub broke: Option<Invariant>,
    /// By which model marbles are stepped.
    pub model: Model,
    /// In which numbers.
    pub number: ScalarType,
    /// In seconds.
    pub step: f64,
    /// Number of steps.
    pub steps: u32,
    /// Walls have the motions of finite differences of their poses in `f32`, each about its own
    /// center, as the plugin's have.
    #[serde(default)]
    pub differenced: bool,
    /// The corners of a box that nothing leaves.
    #[serde(default)]
    pub closed: Option<[[f64; 3]; 2]>,
    /// Balls in bulk beside the marbles.
    #[serde(default)]
    pub swarm: Option<SwarmPart>,
    /// The scene.
    pub scene: Scene,
}

/// A swarm of a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SwarmPart {
    /// Full tier: friction, restitution and rotation.
    pub full: bool,
    /// From 1 to 1,000.
    pub substeps: u32,
    /// Balls may fall asleep.
    pub sleeps: bool,
    /// Of all its balls.
    pub material: MaterialDesc,
    /// Its balls; what they are made of is the swarm's.
    pub balls: Vec<MarbleDesc>,
}

impl SwarmPart {
    /// The tier of its model.
    #[must_use]
    pub fn tier(&self) -> Tier {
        if self.full { Tier::Full } else { Tier::Lab }
    }

    fn fill<S: Scalar>(&self, swarm: &mut taw::swarm::Swarm<S>) -> Result<(), taw::Error> {
        swarm.set_model(SwarmModel {
            tier: self.tier(),
            substeps: self.substeps,
            // Threads change no bit, and the storm has one thread a scene.
            threads: 1,
            material: self.material.to_material(),
            sleeps: self.sleeps,
        })?;
        let balls = self.balls.iter().map(|ball| taw::swarm::Ball {
            position: ball.position.map(S::from_f64).into(),
            radius: S::from_f64(ball.radius),
            velocity: ball.velocity.map(S::from_f64).into(),
            mass: Mass::Density(S::from_f64(ball.density)),
        });
        swarm.insert(&balls.collect::<Vec<_>>())?;
        Ok(())
    }
}

impl Case {
    /// The scene at its beginning, with its account kept.
    ///
    /// # Errors
    /// Errors of the world.
    pub fn begin<S: Scalar>(&self) -> Result<Simulation<S>, taw::Error> {
        let mut running = self.scene.run::<S>(self.model)?;
        if let Some(swarm) = &self.swarm {
            swarm.fill(&mut running.world.swarm)?;
        } else {
            let model = SwarmModel { threads: 1, ..SwarmModel::default() };
            running.world.swarm.set_model(model)?;
        }
        running.world.enable_energy_audit(true);
        Ok(running)
    }

    /// Number of bodies.
    #[must_use]
    pub fn bodies(&self) -> usize {
        self.scene.all_marbles().count() + self.swarm.as_ref().map_or(0, |swarm| swarm.balls.len())
    }

    /// The substep of the marbles, in seconds.
    #[must_use]
    pub fn substep(&self) -> f64 {
        self.step / f64::from(self.model.substeps)
    }

    /// Returns true if a wall moves.
    #[must_use]
    pub fn has_moving_walls(&self) -> bool {
        self.scene.walls.iter().any(|wall| wall.motion.is_some())
            || self.scene.structures.iter().any(|wall| wall.motion.is_some())
    }

    /// The case as a file.
    ///
    /// # Errors
    /// Errors of the serializer.
    pub fn to_text(&self) -> Result<String, ron::Error> {
        ron::ser::to_string_pretty(self, PrettyConfig::new().depth_limit(4))
    }

    /// The case of a file.
    ///
    /// # Errors
    /// Parse errors, with line and field.
    pub fn from_text(text: &str) -> Result<Self, Box<dyn std::error::Error>> {
        Ok(ron::from_str(text)?)
    }
}

/// Kind of a scene: a response, its detection, or a tier of swarms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// [`Response::Displacement`], discrete.
    Displacement,
    /// [`Response::Displacement`], swept.
    DisplacementSwept,
    /// [`Response::Impulse`], discrete.
    Impulse,
    /// [`Response::Impulse`], swept.
    ImpulseSwept,
    /// [`Response::Penalty`] by springs and dashpots, discrete.
    SpringDashpot,
    /// [`Response::Penalty`] by springs and dashpots, swept.
    SpringDashpotSwept,
    /// [`Response::Penalty`] by Hertz and Mindlin, discrete.
    HertzMindlin,
    /// [`Response::Penalty`] by Hertz and Mindlin, swept.
    HertzMindlinSwept,
    /// [`Response::EventDriven`].
    EventDriven,
    /// [`Response::SoftStep`], with or without a swarm beside marbles.
    SoftStep,
    /// A swarm of the lab's tier, with marbles by displacement.
    SwarmLab,
    /// A swarm of the full tier, with marbles by impulses.
    SwarmFull,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 12] = [
        Self::Displacement,
        Self::DisplacementSwept,
        Self::Impulse,
        Self::ImpulseSwept,
        Self::SpringDashpot,
        Self::SpringDashpotSwept,
        Self::HertzMindlin,
        Self::HertzMindlinSwept,
        Self::EventDriven,
        Self::SoftStep,
        Self::SwarmLab,
        Self::SwarmFull,
    ];

    /// Its name in tables and options.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Displacement => "displacement",
            Self::DisplacementSwept => "displacement/swept",
            Self::Impulse => "impulse",
            Self::ImpulseSwept => "impulse/swept",
            Self::SpringDashpot => "spring-dashpot",
            Self::SpringDashpotSwept => "spring-dashpot/swept",
            Self::HertzMindlin => "hertz-mindlin",
            Self::HertzMindlinSwept => "hertz-mindlin/swept",
            Self::EventDriven => "event-driven",
            Self::SoftStep => "soft-step",
            Self::SwarmLab => "swarm/lab",
            Self::SwarmFull => "swarm/full",
        }
    }

    /// Contact law of a kind whose contacts are springs.
    #[must_use]
    pub fn law(self) -> Option<ContactLaw> {
        match self {
            Self::SpringDashpot | Self::SpringDashpotSwept => Some(ContactLaw::SpringDashpot),
            Self::HertzMindlin | Self::HertzMindlinSwept => Some(ContactLaw::HertzMindlin),
            _ => None,
        }
    }

    /// Kind of a case.
    #[must_use]
    pub fn of(case: &Case) -> Self {
        if case.model.response == Response::SoftStep {
            return Self::SoftStep;
        }
        if let Some(swarm) = &case.swarm {
            return if swarm.full { Self::SwarmFull } else { Self::SwarmLab };
        }
        match (case.model.response, case.model.detection) {
            (Response::Displacement, Detection::Discrete) => Self::Displacement,
            (Response::Displacement, Detection::Swept) => Self::DisplacementSwept,
            (Response::Impulse, Detection::Discrete) => Self::Impulse,
            (Response::Impulse, Detection::Swept) => Self::ImpulseSwept,
            (Response::Penalty(law), detection) => match (law, detection) {
                (ContactLaw::SpringDashpot, Detection::Discrete) => Self::SpringDashpot,
                (ContactLaw::SpringDashpot, Detection::Swept) => Self::SpringDashpotSwept,
                (ContactLaw::HertzMindlin, Detection::Discrete) => Self::HertzMindlin,
                (ContactLaw::HertzMindlin, Detection::Swept) => Self::HertzMindlinSwept,
            },
            (Response::EventDriven, _) => Self::EventDriven,
            (Response::SoftStep, _) => Self::SoftStep,
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Identifier of a scene of the storm: its kind, the seed of the storm, and its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Name {
    /// By what it is stepped.
    pub kind: Kind,
    /// Of the storm.
    pub seed: u64,
    /// Counted from zero.
    pub number: u64,
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}:{}:{}", self.kind, self.seed, self.number)
    }
}

impl std::str::FromStr for Name {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("{text} is not KIND:SEED:NUMBER");
        let [kind, seed, number] = text.split(':').collect::<Vec<_>>()[..] else {
            return Err(wrong());
        };
        let kind = Kind::ALL.into_iter().find(|other| other.name() == kind).ok_or_else(wrong)?;
        let parse = |number: &str| number.parse().map_err(|_| wrong());
        Ok(Self { kind, seed: parse(seed)?, number: parse(number)? })
    }
}
