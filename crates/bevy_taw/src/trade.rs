//! Cost and accuracy of each model in the game that is running (feature `trade`).
//!
//! [`TawTrade::measure`] takes a snapshot of the marbles and runs it by every model, beside the
//! game. `debug_ui::trade` shows what comes of it, and lets the player of the game choose;
//! a [`Governor`] chooses by itself.
//!
//! ```
//! # use bevy::prelude::*;
//! # use bevy_taw::prelude::*;
//! use bevy_taw::trade::{TawTrade, TawTradePlugin, TradeMeasured};
//!
//! # let mut app = App::new();
//! app.add_plugins(TawTradePlugin);
//! fn measure(mut trade: ResMut<TawTrade>, mut world: ResMut<TawWorld>, time: Res<Time<Fixed>>) {
//!     trade.measure(&mut world, time.timestep());
//! }
//! fn choose(mut done: MessageReader<TradeMeasured>, trade: Res<TawTrade>, mut model: ResMut<TawModel>) {
//!     for _ in done.read() {
//!         // The most exact one of which a step takes half a millisecond.
//!         let best = trade.front().filter(|choice| choice.cost < 0.5e-3).last();
//!         model.0 = best.map_or(model.0, |choice| choice.setting.model);
//!     }
//! }
//! # app.add_systems(Update, choose);
//! ```

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, TaskPool};
use taw_lab::advise::{Advice, Requirements, Snapshot, advise};

pub use taw_lab::advise::Candidate;

use crate::governor::{self, Governor, ModelGoverned};
use crate::plugin::time_passes;
use crate::resources::TawWorld;
use crate::schedule::TawSchedule;

/// Measures models beside the game, and governs which one is used if that is asked for.
#[derive(Debug, Default)]
pub struct TawTradePlugin;

impl Plugin for TawTradePlugin {
    fn build(&self, app: &mut App) {
        let schedule = TawSchedule::of(app).label();
        app.init_resource::<TawTrade>()
            .init_resource::<Governor>()
            .add_message::<TradeMeasured>()
            .add_message::<ModelGoverned>()
            .add_systems(Update, take_in)
            .add_systems(
                schedule,
                governor::govern.run_if(time_passes).after(crate::TawSystems::Scatter),
            );
    }
}

/// The last measurement, and the one under way.
#[derive(Resource, Debug)]
pub struct TawTrade {
    /// Time that a measurement simulates ahead, in seconds of the game.
    pub seconds: f64,
    /// A model of which a run takes longer, in seconds, is not tried with more substeps.
    pub patience: f64,
    advice: Advice,
    measuring: Option<Measuring>,
}

/// A measurement has come to its end: its outcome is in [`TawTrade`].
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct TradeMeasured;

#[derive(Debug)]
struct Measuring {
    task: Task<Advice>,
    told: Arc<Mutex<Told>>,
    part: f32,
}

/// Progress and results that a measurement has sent.
#[derive(Debug, Default)]
struct Told {
    part: f32,
    news: Option<Advice>,
}

impl Default for TawTrade {
    /// Nothing measured yet; looks a second ahead, with a quarter of a second's patience.
    fn default() -> Self {
        Self { seconds: 1.0, patience: 0.25, advice: Advice::default(), measuring: None }
    }
}

impl TawTrade {
    /// Begins to measure all models on the marbles as they are now, for a game with so long a
    /// step. One that is under way is given up. Without marbles there is nothing to measure.
    ///
    /// It works on [`AsyncComputeTaskPool`], and pauses every millisecond. Walls stand still for
    /// it, swarms are left out, and so is what the game's own systems do within a step.
    pub fn measure(&mut self, world: &mut TawWorld, step: Duration) {
        self.cancel();
        if world.marbles.is_empty() || step.is_zero() {
            return;
        }
        let snapshot = Snapshot::new(world, self.seconds);
        let step = step.as_secs_f64();
        let wish = Requirements { step, time_limit: self.patience, ..Requirements::default() };
        let told = Arc::new(Mutex::new(Told::default()));
        let ours = told.clone();
        let task = AsyncComputeTaskPool::get_or_init(TaskPool::default).spawn(async move {
            let tell = |done: usize, all: usize, advice: &Advice| {
                let mut told = ours.lock().unwrap_or_else(PoisonError::into_inner);
                *told = Told { part: done as f32 / all as f32, news: Some(advice.clone()) };
            };
            Box::pin(advise(&snapshot, wish, tell)).await
        });
        self.advice = Advice::default();
        self.measuring = Some(Measuring { task, told, part: 0.0 });
    }

    /// Gives up a measurement that is under way.
    pub fn cancel(&mut self) {
        self.measuring = None;
    }

    /// Progress of a measurement, from 0 to 1, if one is under way.
    #[must_use]
    pub fn progress(&self) -> Option<f32> {
        self.measuring.as_ref().map(|measuring| measuring.part)
    }

    /// Results so far.
    #[must_use]
    pub fn advice(&self) -> &Advice {
        &self.advice
    }

    /// The settings that no other one beats in both, the cheapest first.
    pub fn front(&self) -> impl Iterator<Item = &Candidate> {
        self.advice.front().into_iter()
    }
}

/// Takes in what the measurement has told.
fn take_in(mut trade: ResMut<TawTrade>, mut done: MessageWriter<TradeMeasured>) {
    let trade = trade.bypass_change_detection();
    let Some(measuring) = &mut trade.measuring else { return };
    let mut told = measuring.told.lock().unwrap_or_else(PoisonError::into_inner);
    measuring.part = told.part;
    if let Some(mut news) = told.news.take() {
        news.sort();
        trade.advice = news;
    }
    drop(told);
    if let Some(advice) = bevy::tasks::futures::check_ready(&mut measuring.task) {
        trade.advice = advice;
        trade.measuring = None;
        done.write(TradeMeasured);
    }
}
