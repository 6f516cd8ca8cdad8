//! Resting bodies.

use taw::prelude::*;

use super::{Finding, Invariant, Rules};
use crate::storm::case::Kind;
use crate::storm::observe::Snapshot;

/// For how many steps in a row each body has not moved as it says.
#[derive(Clone, Debug, Default)]
pub struct Lies {
    wrong: Vec<u32>,
    hangs: Vec<u32>,
}

/// A bounce, a recovery from overlap or a meeting may make one step differ, and a few in a row;
/// what lies or rolls is the same in all of them.
const WRONG: u32 = 8;

impl Lies {
    /// The speed reported is the speed moved: over a step, a body goes by its velocity, up to
    /// - the change of the velocity in the step, since it is not known when it changed;
    /// - a hundredth of what gravity does in a step, below which nobody sees it;
    /// - where there is overlap, what parts it in a step (except for springs, which move nothing by
    ///   themselves);
    /// - rounding: that of the velocity, and of two places by the step.
    ///
    /// Counts consecutive steps at rest. A body that touches nothing within a fiftieth of its
    /// radius before and after, and is fast enough to reach the next body within the step, may
    /// bounce there and back and is not judged.
    pub fn judge(&mut self, rules: &Rules, before: &Snapshot, after: &Snapshot) -> Vec<Finding> {
        self.wrong.resize(after.bodies.len(), 0);
        let gravity = after.gravity().magnitude();
        let mut worst = Finding {
            invariant: Invariant::Speed,
            value: 0.0,
            bound: f64::from(WRONG),
            body: None,
        };
        let overlap = if rules.springs() { 0.0 } else { super::overlap::deepest(before).0 };
        for (i, (old, new)) in before.bodies.iter().zip(&after.bodies).enumerate() {
            let moved = (new.at - old.at) / rules.step;
            let place = old.at.magnitude().max(new.at.magnitude());
            let rounding = rules.velocity_rounding(new.velocity.magnitude(), place);
            let changed = (new.velocity - old.velocity).magnitude();
            // The path of what is carried round is bent.
            let bent = if rules.moving { 0.05 * new.carried } else { 0.0 };
            let bound =
                changed + 0.01 * gravity * rules.step + rounding + bent + overlap / rules.step;
            let gaps = [before, after].map(|snapshot| Self::gap(snapshot, i));
            let lies = gaps.iter().all(|gap| *gap <= 0.02 * new.radius);
            let fast = new.velocity.magnitude() * rules.step > gaps[0].min(gaps[1]);
            let wrong = (moved - new.velocity).magnitude() > bound && (lies || !fast);
            self.wrong[i] = if wrong { self.wrong[i] + 1 } else { 0 };
            // Balls that move apart by half whatever comes lie only where their heap lets them.
            let heap = rules.kind == Kind::SwarmLab;
            if !heap && f64::from(self.wrong[i]) > worst.value {
                worst.value = f64::from(self.wrong[i]);
                worst.body = Some(i);
            }
        }
        vec![worst, self.hang(rules, before, after)]
    }

    /// Distance from a body to the next thing, at least, in metres.
    fn gap(snapshot: &Snapshot, body: usize) -> f64 {
        let others = (0..snapshot.bodies.len()).filter(|other| *other != body);
        let gaps = others.map(|other| -snapshot.depth(body, other));
        gaps.fold(snapshot.bodies[body].wall_gap, f64::min)
    }

    /// A body that does not fall is supported by a contact: before and after a step, a body or wall
    /// is within a fiftieth of the radius, or within the fall of three substeps, where contacts
    /// exist already, or on its way: a body that bounces between walls turns back in every step,
    /// far from where it is seen. Only among balls, whose gaps are exact.
    ///
    /// The figure is for how many steps in a row that is not so: a bounce in the middle of a step
    /// takes one, and what is held without a touch is held in all.
    fn hang(&mut self, rules: &Rules, before: &Snapshot, after: &Snapshot) -> Finding {
        let count = after.bodies.len();
        self.hangs.resize(count, 0);
        let mut worst = Finding {
            invariant: Invariant::Support,
            value: 0.0,
            bound: f64::from(WRONG),
            body: None,
        };
        let long = after.bodies.iter().any(|body| body.half.magnitude2() > 0.0);
        let (gravity, g) = (after.gravity(), after.gravity().magnitude());
        if long || g == 0.0 {
            return worst;
        }
        for i in 0..count {
            let (old, new) = (&before.bodies[i], &after.bodies[i]);
            let held = (new.velocity - old.velocity - gravity * rules.step).magnitude();
            let gap = |snapshot: &Snapshot| Self::gap(snapshot, i);
            let way = old.velocity.magnitude().max(new.velocity.magnitude()) * rules.step;
            let reach = (0.02 * new.radius).max(3.0 * g * rules.substep * rules.substep).max(way);
            let falls = held < 0.5 * g * rules.step || gap(before).min(gap(after)) <= reach;
            self.hangs[i] = if falls { 0 } else { self.hangs[i] + 1 };
            if f64::from(self.hangs[i]) > worst.value {
                (worst.value, worst.body) = (f64::from(self.hangs[i]), Some(i));
            }
        }
        worst
    }
}
