//! One case from its first step to its last.

use std::fmt::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use cpu_time::ThreadTime;
use taw::frame::Pose;
use taw::prelude::*;
use taw::scene::{KinematicMotion, Simulation};

use super::case::Case;
use super::judge::{self, Bench, Finding, Invariant};
use super::observe::{Body, Snapshot};
use super::symmetry::{self, Symmetry};
use crate::trade::trace::ScalarType;

/// Result of a case.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// For each invariant that was judged, how near it came to its bound.
    pub worst: Vec<Finding>,
    /// Violated invariants, each once, in the order of time.
    pub failures: Vec<Failure>,
    /// Processor time of the slowest step, in seconds.
    pub slowest: f64,
}

/// An invariant that did not hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// Which one, by how much, and of whom.
    pub finding: Finding,
    /// In which step, counted from one; zero before the first.
    pub step: u32,
    /// Details.
    pub what: String,
}

/// Since when a step has been running, for whoever watches it.
#[derive(Debug)]
pub struct Pulse {
    begin: Instant,
    /// In milliseconds after `begin`, and one; zero while nothing runs.
    since: AtomicU64,
    step: AtomicU64,
}

impl Default for Pulse {
    fn default() -> Self {
        Self { begin: Instant::now(), since: AtomicU64::new(0), step: AtomicU64::new(0) }
    }
}

impl Pulse {
    fn beat(&self, step: u32) {
        self.step.store(u64::from(step), Ordering::Relaxed);
        self.since.store(self.begin.elapsed().as_millis() as u64 + 1, Ordering::Relaxed);
    }

    fn rest(&self) {
        self.since.store(0, Ordering::Relaxed);
    }

    /// For how long the present step has been running.
    #[must_use]
    pub fn running(&self) -> Duration {
        let since = self.since.load(Ordering::Relaxed);
        if since == 0 {
            return Duration::ZERO;
        }
        self.begin.elapsed().saturating_sub(Duration::from_millis(since - 1))
    }

    /// Which step that is.
    #[must_use]
    pub fn step(&self) -> u32 {
        self.step.load(Ordering::Relaxed) as u32
    }
}

/// Runs a case until an invariant does not hold, or to its end.
#[must_use]
pub fn run(case: &Case, pulse: &Pulse) -> Verdict {
    run_for(case, None, pulse)
}

/// Runs a case until this invariant does not hold, or, for none, any of them.
#[must_use]
pub fn run_for(case: &Case, only: Option<Invariant>, pulse: &Pulse) -> Verdict {
    let mut verdict = Verdict { worst: Vec::new(), failures: Vec::new(), slowest: 0.0 };
    let caught = catch_unwind(AssertUnwindSafe(|| match case.number {
        ScalarType::F32 => go::<f32>(case, only, pulse, &mut verdict),
        ScalarType::F64 => go::<f64>(case, only, pulse, &mut verdict),
    }));
    pulse.rest();
    if let Err(panic) = caught {
        let text = panic.downcast_ref::<String>().cloned();
        let text = text.or_else(|| panic.downcast_ref::<&str>().map(ToString::to_string));
        let what = text.unwrap_or_else(|| "a panic".into());
        verdict.note(only, failed(Invariant::Panics), pulse.step(), what);
    }
    verdict
}

fn failed(invariant: Invariant) -> Finding {
    Finding { invariant, value: 1.0, bound: 0.5, body: None }
}

impl Verdict {
    /// Remembers a finding. True if the run is over: what was made of nothing breaks the rest,
    /// too, but a wrong speed or a place out of bounds says nothing about the rest.
    fn note(
        &mut self,
        only: Option<Invariant>,
        finding: Finding,
        step: u32,
        what: impl Into<String>,
    ) -> bool {
        match self.worst.iter_mut().find(|worst| worst.invariant == finding.invariant) {
            Some(worst) if finding.ratio() > worst.ratio() => *worst = finding,
            Some(_) => {}
            None => self.worst.push(finding),
        }
        let counts = only.is_none_or(|only| only == finding.invariant);
        let known = |failure: &Failure| failure.finding.invariant == finding.invariant;
        if counts && !finding.holds() && !self.failures.iter().any(known) {
            self.failures.push(Failure { finding, step, what: what.into() });
        }
        let goes_on = |failure: &Failure| {
            only.is_none()
                && matches!(
                    failure.finding.invariant,
                    Invariant::Speed | Invariant::Overlap | Invariant::Closed | Invariant::Time
                )
        };
        !self.failures.iter().all(goes_on)
    }

    /// The first that did not hold.
    #[must_use]
    pub fn failure(&self) -> Option<&Failure> {
        self.failures.first()
    }
}

fn go<S: Scalar>(case: &Case, only: Option<Invariant>, pulse: &Pulse, verdict: &mut Verdict) {
    pulse.beat(0);
    let mut running = match case.begin::<S>() {
        Ok(running) => running,
        Err(error) => {
            verdict.note(only, failed(Invariant::Refused), 0, error.to_string());
            return;
        }
    };
    let mut before = Snapshot::of(&running.world);
    let mut bench = Bench::new(case, &before);
    for step in 1..=case.steps {
        pulse.beat(step);
        let begin = ThreadTime::now(); // what others do on the machine does not count
        if let Err(error) = advance(case, &mut running) {
            verdict.note(only, failed(Invariant::Refused), step, error.to_string());
            return;
        }
        let took = begin.elapsed().as_secs_f64();
        verdict.slowest = verdict.slowest.max(took);
        verdict.note(only, judge::time(took), step, "");
        let after = Snapshot::of(&running.world);
        let mut over = false;
        for finding in bench.judge(&before, &after) {
            over |= verdict.note(only, finding, step, "");
        }
        if over || !after.bodies.iter().all(Body::is_finite) {
            return;
        }
        before = after;
        if step == case.steps / 2 && !clones_go_on_alike(case, &running) {
            verdict.note(only, failed(Invariant::Clone), step, "");
            return;
        }
    }
    if case.number == ScalarType::F64 {
        for symmetry in [Symmetry::Mirror, Symmetry::Turn] {
            if only.is_none_or(|only| only == symmetry.invariant()) {
                let Some(finding) = symmetry::compare(case, symmetry) else { continue };
                if verdict.note(only, finding, 0, "") {
                    return;
                }
            }
        }
    }
}

/// A clone steps on with the same bits.
fn clones_go_on_alike<S: Scalar>(case: &Case, running: &Simulation<S>) -> bool {
    let (mut one, mut other) = (running.clone(), running.clone());
    for _ in 0..3 {
        if advance(case, &mut one).is_err() || advance(case, &mut other).is_err() {
            return true; // found where it is judged
        }
    }
    one.world == other.world
}

/// One step.
pub fn advance<S: Scalar>(case: &Case, running: &mut Simulation<S>) -> Result<(), taw::Error> {
    let dt = S::from_f64(case.step);
    let from = running.time();
    running.move_walls(dt)?;
    if case.differenced {
        let to = running.time();
        let walls = case.scene.walls.iter().map(|wall| wall.motion);
        let motion = walls.chain(case.scene.structures.iter().map(|wall| wall.motion));
        for (row, motion) in motion.enumerate() {
            if let (Some(motion), Some(id)) = (motion, running.world.walls.id(row)) {
                let motion = difference(case, row, motion, [from, to])?;
                running.world.walls.set_motion(id, motion)?;
            }
        }
    }
    running.world.step(dt)
}

/// Motion of a wall by finite differences of its poses in `f32` about its center; none if they are
/// equal.
fn difference<S: Scalar>(
    case: &Case,
    row: usize,
    motion: KinematicMotion,
    [from, to]: [f64; 2],
) -> Result<Option<taw::motion::WallMotion<S>>, taw::Error> {
    let middle = match case.scene.walls.get(row).map(|wall| wall.shape) {
        Some(taw::scene::ShapeDesc::Box { center, .. }) => Point3::from(center),
        _ => Point3::origin(),
    };
    let single = |pose: Pose<f64>| {
        let place = pose.transform_point(middle);
        let place = Point3::new(place.x as f32, place.y as f32, place.z as f32);
        let turn = pose.rotation;
        let [x, y, z] = [turn.v.x, turn.v.y, turn.v.z].map(|x| x as f32);
        (place, taw::math::Quat::new(turn.s as f32, x, y, z))
    };
    let (last, now) = (single(motion.pose(from)?), single(motion.pose(to)?));
    if last == now {
        return Ok(None);
    }
    let dt = case.step as f32;
    let turn = now.1 * last.1.conjugate();
    let (sin, cos) = (turn.v.magnitude(), turn.s);
    // The short way round.
    let angle = 2.0 * (sin * cos.signum()).atan2(cos.abs());
    let axis = if sin > 0.0 { turn.v / sin } else { Vec3::zero() };
    let vector = |v: Vec3<f32>| Vec3::new(v.x, v.y, v.z).map(|x: f32| S::from_f64(f64::from(x)));
    Ok(Some(taw::motion::WallMotion {
        velocity: vector((now.0 - last.0) / dt),
        angular_velocity: vector(axis * (angle / dt)),
        pivot: Point3::from_vec(vector(now.0.to_vec())),
    }))
}

/// Number of steps of a [`trail`].
const TRAIL: u32 = 12;

/// Trail of a body in the steps until this one, and the energy of all, as lines to read.
pub fn trail(case: &Case, body: usize, until: u32) -> String {
    match case.number {
        ScalarType::F32 => trail_in::<f32>(case, body, until),
        ScalarType::F64 => trail_in::<f64>(case, body, until),
    }
}

fn trail_in<S: Scalar>(case: &Case, body: usize, until: u32) -> String {
    let mut text = String::new();
    let Ok(mut running) = case.begin::<S>() else { return text };
    for step in 0..=until {
        let ended = step > 0
            && catch_unwind(AssertUnwindSafe(|| advance(case, &mut running)))
                .map_or(true, |result| result.is_err());
        if ended {
            break;
        }
        if step + TRAIL < until && step > 1 {
            continue;
        }
        let now = Snapshot::of(&running.world);
        let Some(of) = now.bodies.get(body) else { break };
        let (at, velocity, spin) = (of.at, of.velocity, of.angular_velocity);
        let _ = write!(text, "{step}: at {:.6} {:.6} {:.6}", at.x, at.y, at.z);
        let _ = write!(text, " velocity {:.6} {:.6} {:.6}", velocity.x, velocity.y, velocity.z);
        let _ = write!(text, " spin {:.4} {:.4} {:.4}", spin.x, spin.y, spin.z);
        let (kinetic, potential) = (now.kinetic(), now.potential());
        let (deepest, _) = super::judge::deepest(&now);
        let _ = write!(text, " wall {:.3e} overlap {deepest:.3e}", of.wall_gap);
        let _ = writeln!(text, " kinetic {kinetic:.6e} potential {potential:.6e}");
    }
    text
}
