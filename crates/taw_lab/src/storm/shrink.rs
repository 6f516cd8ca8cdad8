//! The smallest case that still fails.

use taw::prelude::*;
use taw::scene::{Build, MaterialDesc};

use super::case::Case;
use super::judge::Invariant;
use super::run::{Pulse, run_for};

/// Maximum number of runs of a shrinking: it ends when nothing can be left out, but bodies in a
/// heap can be left out in many ways.
const MOST_RUNS: u32 = 1500;

/// Leaves out and simplifies for as long as the case still breaks the invariant. `try_for`
/// says how many seconds that may take.
#[must_use]
pub fn shrink(case: &Case, invariant: Invariant, try_for: std::time::Duration) -> Case {
    let begin = std::time::Instant::now();
    let mut runs = 0;
    let mut fails = |case: &Case| {
        runs += 1;
        if runs > MOST_RUNS || begin.elapsed() > try_for {
            return None;
        }
        run_for(case, Some(invariant), &Pulse::default()).failure().map(|failure| failure.step)
    };
    shrink_by(&Case { broke: Some(invariant), ..case.clone() }, &mut fails)
}

/// Leaves out and simplifies for as long as `fails` gives the step of a failure.
pub fn shrink_by(case: &Case, fails: &mut dyn FnMut(&Case) -> Option<u32>) -> Case {
    let mut best = case.clone();
    if let Some(step) = fails(&best)
        && step > 0
    {
        best.steps = step;
    }
    loop {
        let before = best.clone();
        leave_out(&mut best, fails);
        for simpler in SIMPLER {
            attempt(&mut best, fails, simpler);
        }
        round(&mut best, fails);
        if best == before {
            best.scene.duration = best.step * f64::from(best.steps);
            return best;
        }
    }
}

/// Takes a change if the case still fails, and no later.
fn attempt(
    best: &mut Case,
    fails: &mut dyn FnMut(&Case) -> Option<u32>,
    change: impl Fn(&mut Case),
) -> bool {
    let mut other = best.clone();
    change(&mut other);
    if other == *best {
        return false;
    }
    let Some(step) = fails(&other) else { return false };
    if step > 0 {
        other.steps = step.min(other.steps);
    }
    *best = other;
    true
}

/// Leaves out bodies and walls: halves, quarters, … and one by one.
fn leave_out(best: &mut Case, fails: &mut dyn FnMut(&Case) -> Option<u32>) {
    thin(best, fails, |case| Some(&mut case.scene.marbles));
    thin(best, fails, |case| case.swarm.as_mut().map(|swarm| &mut swarm.balls));
    if best.broke == Some(Invariant::Closed) {
        return; // a box without its walls is open
    }
    thin(best, fails, |case| Some(&mut case.scene.walls));
    thin(best, fails, |case| Some(&mut case.scene.structures));
    thin(best, fails, |case| Some(&mut case.scene.force_fields));
    thin(best, fails, |case| Some(&mut case.scene.gravity_keyframes));
    for number in 0..best.scene.structures.len() {
        thin(best, fails, |case| match &mut case.scene.structures.get_mut(number)?.shape {
            Build::Mesh { triangles, .. } if triangles.len() > 1 => Some(triangles),
            _ => None,
        });
        thin(best, fails, |case| match &mut case.scene.structures.get_mut(number)?.shape {
            Build::Compound { parts } if parts.len() > 1 => Some(parts),
            _ => None,
        });
    }
}

fn thin<T: Clone>(
    best: &mut Case,
    fails: &mut dyn FnMut(&Case) -> Option<u32>,
    list: impl Fn(&mut Case) -> Option<&mut Vec<T>>,
) {
    let length = |case: &mut Case| list(case).map_or(0, |list| list.len());
    let mut size = length(best);
    while size > 0 {
        let mut from = 0;
        while from < length(best) {
            let left_out = attempt(best, fails, |case| {
                if let Some(list) = list(case) {
                    let to = (from + size).min(list.len());
                    list.drain(from..to);
                }
            });
            if !left_out {
                from += size;
            }
        }
        size /= 2;
    }
}

/// Simplifications, each applied as a whole.
const SIMPLER: [fn(&mut Case); 15] = [
    |case| case.model.substeps = 1,
    |case| case.model.iterations = 8,
    |case| case.model.precision = Precision::Plain,
    |case| case.model.integrator = Integrator::SemiImplicitEuler,
    |case| case.model.rotation = Rotation::None,
    |case| case.differenced = false,
    |case| case.closed = None,
    |case| case.step = 1.0 / 60.0,
    |case| case.scene.gravity = [0.0, -9.81, 0.0],
    |case| case.scene.marbles.iter_mut().for_each(|ball| ball.material = None),
    |case| case.scene.marbles.iter_mut().for_each(|ball| ball.angular_velocity = [0.0; 3]),
    |case| case.scene.marbles.iter_mut().for_each(|ball| ball.half_length = 0.0),
    |case| case.scene.marbles.iter_mut().for_each(|ball| ball.density = 1000.0),
    |case| {
        let MaterialDesc { restitution, friction, .. } = case.scene.material;
        let youngs_modulus = case.scene.material.youngs_modulus;
        case.scene.material =
            MaterialDesc { restitution, friction, youngs_modulus, ..MaterialDesc::default() };
    },
    |case| {
        if let Some(swarm) = &mut case.swarm {
            (swarm.substeps, swarm.sleeps) = (1, false);
        }
    },
];

/// Leaves out digits, and numbers.
fn round(best: &mut Case, fails: &mut dyn FnMut(&Case) -> Option<u32>) {
    for friction in [0.0, 0.5, 1.0] {
        attempt(best, fails, |case| case.scene.material.friction = friction);
    }
    for restitution in [0.0, 1.0, 0.5] {
        attempt(best, fails, |case| case.scene.material.restitution = restitution);
    }
    let count = best.scene.marbles.len();
    if count > 40 {
        return; // each number of each would take too many runs
    }
    for body in 0..count {
        for field in 0..3 {
            for axis in 0..3 {
                // Nothing at all, or a few digits.
                for scale in [0.0, 1.0, 10.0, 100.0, 1000.0] {
                    let shorter =
                        |x: f64| if scale > 0.0 { (x * scale).round() / scale } else { 0.0 };
                    if attempt(best, fails, |case| {
                        let ball = &mut case.scene.marbles[body];
                        let vector =
                            [&mut ball.position, &mut ball.velocity, &mut ball.angular_velocity];
                        let [position, velocity, spin] = vector;
                        let number = &mut [position, velocity, spin][field][axis];
                        *number = shorter(*number);
                    }) {
                        break;
                    }
                }
            }
        }
        for digits in [1, 2, 3] {
            let scale = 10.0_f64.powi(digits);
            if attempt(best, fails, |case| {
                let ball = &mut case.scene.marbles[body];
                let radius = (ball.radius * scale).round() / scale;
                ball.radius = if radius > 0.0 { radius } else { ball.radius };
            }) {
                break;
            }
        }
    }
}
