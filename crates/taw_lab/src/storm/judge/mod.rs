//! Invariants of every ordinary scene. One function per invariant, with its bound and the reason
//! for the bound.

mod energy;
mod flight;
mod overlap;
mod rest;
mod stays;

pub use overlap::deepest;

use serde::{Deserialize, Serialize};
use taw::prelude::*;

use super::case::{Case, Kind};
use super::observe::Snapshot;
use crate::trade::trace::ScalarType;

/// An invariant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Invariant {
    /// A scene and a step that are right are not refused.
    Refused,
    /// Nothing panics.
    Panics,
    /// A step ends.
    Ends,
    /// All numbers are finite, and nothing is stopped in an ordinary scene.
    Finite,
    /// No step makes energy.
    EnergyOfStep,
    /// No run makes energy.
    EnergyOfRun,
    /// Momentum is conserved without wall contacts, except for gravity.
    Momentum,
    /// Unsupported bodies fall.
    Support,
    /// The speed reported is the speed moved.
    Speed,
    /// Bodies at rest stay at rest, unless they fall.
    Stays,
    /// A step takes no longer than a game can wait.
    Time,
    /// Nothing sinks into anything.
    Overlap,
    /// Nothing leaves a closed box.
    Closed,
    /// A clone goes on with the same bits.
    Clone,
    /// A scene in the mirror goes the same way.
    Mirror,
    /// A scene turned by a quarter about the vertical goes the same way.
    Turn,
}

impl Invariant {
    /// All of them.
    pub const ALL: [Self; 16] = [
        Self::Refused,
        Self::Panics,
        Self::Ends,
        Self::Finite,
        Self::EnergyOfStep,
        Self::EnergyOfRun,
        Self::Momentum,
        Self::Support,
        Self::Speed,
        Self::Stays,
        Self::Time,
        Self::Overlap,
        Self::Closed,
        Self::Clone,
        Self::Mirror,
        Self::Turn,
    ];

    /// Its name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Refused => "refused",
            Self::Panics => "panics",
            Self::Ends => "ends",
            Self::Finite => "finite",
            Self::EnergyOfStep => "energy/step",
            Self::EnergyOfRun => "energy/run",
            Self::Momentum => "momentum",
            Self::Support => "support",
            Self::Speed => "speed",
            Self::Stays => "stays",
            Self::Time => "time",
            Self::Overlap => "overlap",
            Self::Closed => "closed",
            Self::Clone => "clone",
            Self::Mirror => "mirror",
            Self::Turn => "turn",
        }
    }
}

/// Value of an invariant and its bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finding {
    /// Which one.
    pub invariant: Invariant,
    /// In the unit of the invariant.
    pub value: f64,
    /// Largest allowed value.
    pub bound: f64,
    /// The body that it is about, if it is about one.
    pub body: Option<usize>,
}

impl Finding {
    /// The value as a part of its bound: above one, it does not hold.
    #[must_use]
    pub fn ratio(&self) -> f64 {
        if self.value <= 0.0 {
            0.0
        } else if self.value.is_nan() || self.bound.is_nan() {
            f64::INFINITY
        } else {
            self.value / self.bound
        }
    }

    /// Returns true if the invariant holds.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.ratio() <= 1.0
    }
}

/// A step of at most 300 bodies takes less than a second of processor time, some thousand times what
/// most take: a player may see it stutter, but not hang.
#[must_use]
pub fn time(seconds: f64) -> Finding {
    Finding { invariant: Invariant::Time, value: seconds, bound: 1.0, body: None }
}

/// Properties of a case that all invariants use.
#[derive(Clone, Copy, Debug)]
pub struct Rules {
    /// By what it is stepped.
    pub kind: Kind,
    /// In seconds.
    pub step: f64,
    /// The longest substep of marbles and swarm, in seconds, and the most of them in a step.
    pub substep: f64,
    /// Maximum number of substeps per step.
    pub substeps: f64,
    /// Of the scalar that the state is kept in.
    pub epsilon: f64,
    /// Integrator.
    pub integrator: Integrator,
    /// Walls move.
    pub moving: bool,
    /// The softest contact's modulus: `E / (2 (1 − ν²))` of the softest material, in pascals.
    pub modulus: f64,
    /// Number of bodies whose contacts are looked for at the end of substeps only: the first ones.
    pub discrete: usize,
    /// Substep of marbles, in seconds.
    pub marble_substep: f64,
    /// Sag of heaps relative to that of eight iterations.
    pub sag: f64,
}

impl Rules {
    /// Those of a case.
    #[must_use]
    pub fn of(case: &Case) -> Self {
        let kind = Kind::of(case);
        let parts = case.swarm.as_ref().map_or(1.0, |swarm| f64::from(swarm.substeps));
        // In the lab's tier of swarms, balls move once in a step, and its parts are how often they
        // are moved apart: iterations.
        let lab = kind == Kind::SwarmLab;
        let soft_step = kind == Kind::SoftStep; // one solve of both
        let own_parts = case.swarm.is_some() && !soft_step;
        let swarm = own_parts.then_some(if lab { 1.0 } else { parts });
        let iterations = f64::from(case.model.iterations).min(if lab { parts } else { f64::MAX });
        let marbles = f64::from(case.model.substeps);
        let single = case.number == ScalarType::F32;
        let looks_ahead = matches!(case.model.response, Response::EventDriven | Response::SoftStep);
        let discrete = case.model.detection == Detection::Discrete && !looks_ahead;
        Self {
            kind,
            step: case.step,
            substep: case.step / swarm.map_or(marbles, |swarm| swarm.min(marbles)),
            substeps: swarm.map_or(marbles, |swarm| swarm.max(marbles)),
            epsilon: if single { f64::from(f32::EPSILON) } else { f64::EPSILON },
            integrator: case.model.integrator,
            moving: case.has_moving_walls(),
            modulus: softest(case),
            discrete: if discrete { case.scene.all_marbles().count() } else { 0 },
            marble_substep: case.substep(),
            sag: (8.0 / iterations).max(1.0),
        }
    }

    /// Returns true if contacts are soft, so that a collision takes several steps, in which it
    /// stores energy and releases it.
    #[must_use]
    pub fn soft(&self) -> bool {
        self.springs() || matches!(self.kind, Kind::SoftStep | Kind::SwarmFull)
    }

    /// Returns true if contacts are springs, which store energy and release it.
    #[must_use]
    pub fn springs(&self) -> bool {
        self.kind.law().is_some()
    }

    /// Returns true if marbles stop at the time of impact and lose the rest of their motion.
    #[must_use]
    pub fn swept(&self) -> bool {
        matches!(self.kind, Kind::ImpulseSwept | Kind::DisplacementSwept)
    }

    /// By how much rounding changes a velocity in a step, at most, in m/s: that of the velocity
    /// itself, and that of a place by the substep, since contacts make velocities of gaps. Eight
    /// roundings, as a handful of operations make a number.
    fn velocity_rounding(&self, speed: f64, place: f64) -> f64 {
        8.0 * self.epsilon * self.substeps * (speed + place / self.substep)
    }
}

fn softest(case: &Case) -> f64 {
    let scene = &case.scene;
    let walls = scene.walls.iter().map(|wall| wall.material);
    let structures = scene.structures.iter().map(|wall| wall.material);
    let balls = scene.marbles.iter().map(|ball| ball.material);
    let all = walls.chain(structures).chain(balls).flatten().chain([scene.material]);
    let modulus = all.map(|surface| {
        0.5 * surface.youngs_modulus / (1.0 - surface.poissons_ratio * surface.poissons_ratio)
    });
    modulus.fold(f64::INFINITY, f64::min)
}

/// All judges of a run, and what they remember of it.
#[derive(Clone, Debug)]
pub struct Bench {
    rules: Rules,
    closed: Option<[[f64; 3]; 2]>,
    /// Bodies that may be outside of the closed box.
    outside: Vec<bool>,
    energy: energy::Ledger,
    flight: flight::Falls,
    rest: rest::Lies,
    rested: stays::Rested,
    /// The deepest overlap at the beginning, in metres, and the largest speed so far, in m/s.
    begin: f64,
    fastest: f64,
}

impl Bench {
    /// Before the first step.
    #[must_use]
    pub fn new(case: &Case, begin: &Snapshot) -> Self {
        Self {
            rules: Rules::of(case),
            closed: case.closed,
            outside: case.closed.map_or_else(Vec::new, |[low, high]| {
                let out = |at: Vec3<f64>| (0..3).any(|i| at[i] < low[i] || at[i] > high[i]);
                begin.bodies.iter().map(|body| out(body.at)).collect()
            }),
            energy: energy::Ledger::new(begin),
            flight: flight::Falls::default(),
            rest: rest::Lies::default(),
            rested: stays::Rested::default(),
            begin: overlap::deepest(begin).0,
            fastest: 0.0,
        }
    }

    /// After a step.
    #[must_use]
    pub fn judge(&mut self, before: &Snapshot, after: &Snapshot) -> Vec<Finding> {
        let finite = overlap::finite(after);
        if !finite.holds() {
            return vec![finite];
        }
        let speeds =
            before.bodies.iter().chain(&after.bodies).map(|body| body.velocity.magnitude());
        self.fastest = speeds.fold(self.fastest, f64::max);
        let rules = &self.rules;
        let near = flight::Near::find(rules, before, after);
        let mut findings = vec![finite];
        findings.extend(self.energy.judge(rules, before, after, &near));
        findings.extend(self.flight.judge(rules, before, after, &near));
        findings.extend(self.rest.judge(rules, before, after));
        findings.extend(self.rested.judge(rules, before, after, &near));
        findings.push(overlap::overlap(rules, before, after, [self.begin, self.fastest]));
        overlap::forget_the_fast(rules, after, &mut self.outside);
        let closed = |corners| overlap::closed(rules, after, self.fastest, &self.outside, corners);
        findings.extend(self.closed.map(closed));
        findings
    }
}
