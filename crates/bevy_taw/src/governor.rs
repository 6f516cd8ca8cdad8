//! Keeps steps within a budget by the choice of the model (feature `trade`).

use std::time::Duration;

use bevy::prelude::*;
use taw::world::Model;

use crate::diagnostics::StepTimes;
use crate::resources::{TawModel, TawWorld};
use crate::trade::TawTrade;

/// Moves the [`TawModel`] along the measured front: to a cheaper one when steps run over the
/// budget, to a more exact one when there is room. Off by default.
///
/// If nothing was measured yet, it has it [measured](TawTrade::measure). It looks at the mean of
/// [`WINDOW`] steps; goes down at once, to what should take at most nine tenths of the budget;
/// goes up one at a time, after some windows in which the next one would have taken at most seven
/// tenths. Each time it has to come down again, it waits twice as long before it goes up. A model
/// that is not on the front is replaced by the dearest one there that is no dearer.
#[derive(Resource, Clone, Debug, Default)]
pub struct Governor {
    /// Time budget of a step, from gather to scatter. `None`: the governor is off.
    pub budget: Option<Duration>,
    window: Window,
    /// For how many windows there has been room, and how many it takes.
    roomy: u32,
    waits: u32,
    asked: bool,
}

/// Number of steps in a mean.
pub const WINDOW: u32 = 32;
/// Number of windows with room before it goes up, at first and at most.
const WAITS: [u32; 2] = [2, 64];
/// Which part of the budget may be used after going down, and after going up.
const DOWN_TO: f64 = 0.9;
const UP_TO: f64 = 0.7;

/// The [`Governor`] changed the model.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModelGoverned {
    /// Model before.
    pub from: Model,
    /// Model from now on.
    pub to: Model,
    /// Mean time of a step.
    pub step: Duration,
    /// Time budget of a step.
    pub budget: Duration,
}

/// Sums over some steps, in seconds.
#[derive(Clone, Copy, Debug, Default)]
struct Window {
    steps: u32,
    step: f64,
    verbs: f64,
}

impl Governor {
    /// Takes in a step that took so long in all, and so long in the three verbs (in seconds).
    /// Gives where on the front to go, if anywhere: `costs` are those of its models, ascending,
    /// and `now` is where it is.
    fn decide(&mut self, step: f64, verbs: f64, costs: &[f64], now: usize) -> Option<usize> {
        let budget = self.budget?.as_secs_f64();
        let Window { steps, step, verbs } = {
            let window = &mut self.window;
            window.steps += 1;
            window.step += step;
            window.verbs += verbs;
            if window.steps < WINDOW {
                return None;
            }
            std::mem::take(window)
        };
        let (step, verbs) = (step / f64::from(steps), verbs / f64::from(steps));
        let cost = *costs.get(now)?;
        // What is not the model's stays; the rest grows as it did when it was measured.
        let would = |at: usize| step - verbs + verbs * costs[at] / cost;
        if step > budget {
            self.roomy = 0;
            self.waits = (2 * self.waits).clamp(WAITS[0], WAITS[1]);
            return (0..now).rev().find(|at| *at == 0 || would(*at) <= DOWN_TO * budget);
        }
        let room = now + 1 < costs.len() && would(now + 1) <= UP_TO * budget;
        self.roomy = if room { self.roomy + 1 } else { 0 };
        if self.roomy < self.waits.max(WAITS[0]) {
            return None;
        }
        self.roomy = 0;
        Some(now + 1)
    }
}

pub(crate) fn govern(
    mut governor: ResMut<Governor>,
    mut trade: ResMut<TawTrade>,
    mut world: ResMut<TawWorld>,
    mut model: ResMut<TawModel>,
    mut told: MessageWriter<ModelGoverned>,
    times: Res<StepTimes>,
    time: Res<Time>,
) {
    let governor = governor.bypass_change_detection();
    let Some(budget) = governor.budget else {
        governor.asked = false;
        return;
    };
    if trade.progress().is_some() {
        return;
    }
    let front: Vec<_> = trade.front().map(|choice| (choice.setting.model, choice.cost)).collect();
    if front.is_empty() {
        if !governor.asked && !world.marbles.is_empty() {
            trade.measure(world.bypass_change_detection(), time.delta());
            governor.asked = trade.progress().is_some();
        }
        return;
    }
    let (step, verbs) = (times.whole().as_secs_f64(), times.verbs().as_secs_f64());
    let costs: Vec<_> = front.iter().map(|(_, cost)| *cost).collect();
    let known = front.iter().position(|(known, _)| *known == model.0);
    let to = match known {
        Some(now) => governor.decide(step, verbs, &costs, now),
        // A model that is not on the front: the dearest that is no dearer, at once.
        None => Some(costs.partition_point(|cost| *cost <= verbs).saturating_sub(1)),
    };
    if let Some(at) = to {
        let (from, to) = (model.0, front[at].0);
        model.0 = to;
        let step = Duration::from_secs_f64(step);
        told.write(ModelGoverned { from, to, step, budget });
        log::info!("taw's governor: a step took {step:?} of {budget:?}, so it is {to:?} now");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COSTS: [f64; 4] = [1e-3, 2e-3, 4e-3, 8e-3];

    /// Lets a governor with 5 ms work for some windows on a machine that is `slow` times slower
    /// than measured, with a millisecond of other things; gives where it was in each.
    fn work(governor: &mut Governor, mut now: usize, slow: impl Fn(u32) -> f64) -> Vec<usize> {
        let mut places = Vec::new();
        for window in 0..200 {
            for step in 0..WINDOW {
                // Noise of a fifth.
                let noise = 0.9 + 0.2 * f64::from(step % 7) / 6.0;
                let verbs = COSTS[now] * slow(window) * noise;
                if let Some(at) = governor.decide(verbs + 1e-3, verbs, &COSTS, now) {
                    assert_eq!(step, WINDOW - 1);
                    now = at;
                }
            }
            places.push(now);
        }
        places
    }

    fn governor() -> Governor {
        Governor { budget: Some(Duration::from_millis(5)), ..Governor::default() }
    }

    #[test]
    fn it_goes_where_the_budget_is_and_stays() {
        // The third one would take 5 ms with the rest: not room enough to go there, but to stay
        // on the second one.
        assert_eq!(work(&mut governor(), 0, |_| 1.0).last(), Some(&1));
        let places = work(&mut governor(), 3, |_| 1.0);
        assert_eq!(places[0], 1, "down at once, past what would be too dear");
        assert!(places.iter().all(|at| *at == 1));
        // Twice as fast a machine has room for the third one.
        let places = work(&mut governor(), 0, |_| 0.5);
        assert_eq!(places[..6], [0, 1, 1, 2, 2, 2]);
        assert!(places[6..].iter().all(|at| *at == 2));
        // Nothing helps where even the cheapest is too dear.
        assert!(work(&mut governor(), 2, |_| 9.0).iter().all(|at| *at == 0));
    }

    #[test]
    fn a_load_that_comes_and_goes_does_not_make_it_swing() {
        let load = |window: u32| if window % 8 < 4 { 0.5 } else { 2.0 };
        let places = work(&mut governor(), 1, load);
        let changes = places.windows(2).filter(|two| two[0] != two[1]).count();
        assert!(changes < 20, "{changes} of 200");
        let late = places[120..].windows(2).filter(|two| two[0] != two[1]).count();
        assert!(late <= 2, "{late}");
    }

    #[test]
    fn without_a_budget_or_a_front_it_does_nothing() {
        let mut off = Governor::default();
        let mut lost = governor();
        for _ in 0..10 * WINDOW {
            assert_eq!(off.decide(1.0, 1.0, &COSTS, 3), None);
            assert_eq!(lost.decide(1.0, 1.0, &[], 0), None);
        }
    }
}
