//! No energy from nothing.

use taw::prelude::*;

use super::flight::Near;
use super::{Finding, Invariant, Rules, overlap};
use crate::storm::case::Kind;
use crate::storm::observe::Snapshot;

/// Energy record of a run, in joules.
#[derive(Clone, Debug)]
pub struct Ledger {
    /// Energy less what walls brought in: now at the beginning, and the least since.
    begin: f64,
    least: f64,
    /// Work of walls, and its absolute sum.
    walls: f64,
    walls_moved: f64,
    /// Energy that the initial overlap may lift, and the energy lifted so far.
    overlap: f64,
    lifted: f64,
    /// The largest fluctuation that a step may have, what all may have together by an integrator
    /// that gains, and the sum of the squares of what they may have by rounding.
    fluctuation: f64,
    drift: f64,
    rounding: f64,
    /// The largest kinetic energy so far.
    kinetic: f64,
    /// The most that overlap may have taken.
    sunk: f64,
}

/// Allowed energy gain of a step, in joules.
struct Allowance {
    /// By being of the first order.
    fluctuation: f64,
    /// By an integrator that gains.
    drift: f64,
    /// By rounding.
    rounding: f64,
    /// By parting what overlaps.
    lifted: f64,
}

impl Ledger {
    /// Before the first step.
    #[must_use]
    pub fn new(begin: &Snapshot) -> Self {
        let energy = begin.kinetic() + begin.potential();
        Self {
            begin: energy,
            least: energy,
            walls: 0.0,
            walls_moved: 0.0,
            overlap: weight(begin) * overlap::deepest(begin).1,
            lifted: 0.0,
            fluctuation: 0.0,
            drift: 0.0,
            rounding: 0.0,
            kinetic: begin.kinetic(),
            sunk: 0.0,
        }
    }

    /// A step gains no energy but what [walls bring in](taw::world::EnergyAudit::walls), up to
    /// - first order: a bounce happens at the end of its substep, so its height is right to the
    ///   way of a substep: `m g v dt` of what touches, for the speeds before and after (twice, where
    ///   there is time for two bounces in a step), and what gravity adds in a substep;
    ///   event-driven bounces happen when they do, so a hundredth of that, for what rests;
    /// - a hundredth of what moving walls bring in, as they do so by steps;
    /// - rounding, of velocities and heights;
    /// - explicit Euler, which gains `m g² dt² / 2` in each substep;
    /// - recovery from overlap lifts by what the displacement needs, and gains no speed.
    ///
    /// A run gains no more, over its least energy so far, than three such steps at once (what one
    /// bounce gains, another one loses), and rounding, whose signs are random, so that it grows
    /// with the root of the steps; four times that, as four standard deviations. Soft contacts
    /// store energy, so their run is compared with its beginning; of springs, 16 substeps a
    /// collision are right to a twentieth (`(ω dt)² / 2` for `ω dt = π / 16` is a fiftieth, twice).
    pub fn judge(
        &mut self,
        rules: &Rules,
        before: &Snapshot,
        after: &Snapshot,
        near: &Near,
    ) -> Vec<Finding> {
        if rules.moving && rules.kind == Kind::SwarmLab {
            return Vec::new(); // nobody counts what walls do there
        }
        let energy = after.kinetic() + after.potential();
        let change = energy - before.kinetic() - before.potential();
        let gain = change - after.walls_work;
        let allowed = allowance(rules, before, after, near);
        let walls = 0.01 * after.walls_work.abs();
        self.walls += after.walls_work;
        self.walls_moved += walls;
        self.kinetic = self.kinetic.max(after.kinetic());
        self.fluctuation = self.fluctuation.max(allowed.fluctuation);
        self.drift += allowed.drift;
        self.rounding += allowed.rounding * allowed.rounding;
        self.lifted += allowed.lifted;
        let (_, sum) = overlap::deepest(after);
        self.sunk = self.sunk.max(weight(after) * sum);

        let net = energy - self.walls;
        let rounding = 4.0 * self.rounding.sqrt();
        let slack = self.lifted.min(self.overlap) + 3.0 * self.fluctuation + self.drift + rounding;
        let mut run = Finding {
            invariant: Invariant::EnergyOfRun,
            value: net - self.least,
            bound: slack + self.walls_moved + self.sunk + f64::MIN_POSITIVE,
            body: None,
        };
        let step = Finding {
            invariant: Invariant::EnergyOfStep,
            value: gain,
            bound: allowed.fluctuation
                + allowed.drift
                + allowed.rounding
                + allowed.lifted
                + walls
                + f64::MIN_POSITIVE,
            body: None,
        };
        self.least = self.least.min(net);
        if rules.soft() {
            run.value = net - self.begin;
            run.bound += if rules.springs() { 0.05 * self.kinetic } else { 0.0 };
            return vec![run];
        }
        vec![step, run]
    }
}

/// The weight of all bodies, in newtons.
fn weight(snapshot: &Snapshot) -> f64 {
    snapshot.gravity().magnitude() * snapshot.bodies.iter().map(|body| body.mass).sum::<f64>()
}

fn allowance(rules: &Rules, before: &Snapshot, after: &Snapshot, near: &Near) -> Allowance {
    let gravity = after.gravity();
    let g = gravity.magnitude();
    let down = if g > 0.0 { gravity / g } else { Vec3::zero() };
    let mut allowed = Allowance { fluctuation: 0.0, drift: 0.0, rounding: 0.0, lifted: 0.0 };
    let (_, overlaps) = overlap::deepest(before);
    for (i, (old, new)) in before.bodies.iter().zip(&after.bodies).enumerate() {
        let mass = new.mass;
        let speed = old.velocity.magnitude().max(new.velocity.magnitude()) + g * rules.step;
        let place = old.at.magnitude().max(new.at.magnitude());
        let touched = near.touched[i];
        let rounding = rules.velocity_rounding(speed, if touched { place } else { 0.0 });
        let height = 8.0 * rules.epsilon * rules.substeps * place;
        allowed.rounding += mass * (speed * rounding + rounding * rounding + g * height);
        let rim =
            new.angular_velocity.magnitude().max(old.angular_velocity.magnitude()) * new.reach();
        allowed.rounding += mass * rim * rules.velocity_rounding(rim, 0.0);
        if rules.integrator == Integrator::ExplicitEuler {
            allowed.drift += 0.5 * mass * g * g * rules.step * rules.substep;
        }
        if touched {
            let vertical = old.velocity.dot(down).abs() + new.velocity.dot(down).abs();
            let part = if rules.kind == Kind::EventDriven { 0.01 } else { 1.0 };
            let bounces = if rules.substeps > 1.0 { 2.0 } else { 1.0 };
            let change = bounces * vertical + g * rules.substep;
            allowed.fluctuation += part * mass * g * rules.substep * change;
        }
        let mean = (old.velocity + new.velocity) * (0.5 * rules.step);
        let up = -(new.at - old.at - mean).dot(down);
        if overlaps > 0.0 && up > 0.0 {
            allowed.lifted += mass * g * up.min(overlaps);
        }
    }
    allowed
}
