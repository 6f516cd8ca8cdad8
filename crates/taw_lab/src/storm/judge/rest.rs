//! What lies.

use taw::prelude::*;

use super::{Finding, Invariant, Rules};
use crate::storm::case::Kind;
use crate::storm::observe::Snapshot;

/// For how many steps in a row each body has not moved as it says.
#[derive(Clone, Debug, Default)]
pub struct Lies {
    wrong: Vec<u32>,
}

/// A bounce, a recovery from overlap or a meeting may make one step differ, and a few in a row;
/// what lies or rolls is the same in all of them.
const WRONG: u32 = 8;

impl Lies {
    /// The speed reported is the speed moved: over a step, a body goes by its velocity, up to
    /// - the change of the velocity in the step, since it is not known when it changed;
    /// - a hundredth of what gravity does in a step, below which nobody sees it;
    /// - where there is overlap, what parts it in a step (but for springs, which move nothing by
    ///   themselves);
    /// - rounding: that of the velocity, and of two places by the step.
    ///
    /// The figure is for how many steps in a row that is not so.
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
            let wrong = (moved - new.velocity).magnitude() > bound;
            self.wrong[i] = if wrong { self.wrong[i] + 1 } else { 0 };
            // Balls that move apart by half whatever comes lie only where their heap lets them.
            let heap = rules.kind == Kind::SwarmLab;
            if !heap && f64::from(self.wrong[i]) > worst.value {
                worst.value = f64::from(self.wrong[i]);
                worst.body = Some(i);
            }
        }
        vec![worst]
    }
}
