//! What happened in a scene, whatever stepped it.

use std::time::Duration;

use futures_lite::future::{block_on, yield_now};
use taw::prelude::*;
use taw::scene::{Scene, Simulation};
use web_time::Instant;

/// In which numbers a world counts.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum ScalarType {
    /// Single precision, as games do.
    F32,
    /// Double precision.
    F64,
}

impl std::fmt::Display for ScalarType {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(if *self == Self::F32 { "f32" } else { "f64" })
    }
}

/// How a scene is stepped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunConfig {
    /// By which model.
    pub model: Model,
    /// In which numbers.
    pub number: ScalarType,
    /// In seconds.
    pub step: f64,
}

/// A scene at a moment: one entry for each marble, in the order of the scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// In seconds.
    pub time: f64,
    /// In metres.
    pub at: Vec<Vec3<f64>>,
    /// In m/s.
    pub velocity: Vec<Vec3<f64>>,
    /// How deep all contacts overlap together, in metres.
    pub overlap: f64,
    /// Of all marbles in gravity, in joules.
    pub energy: f64,
    /// Of all marbles, in kg m/s.
    pub momentum: [f64; 3],
    /// How many marbles are behind the scene's gates.
    pub passed: usize,
}

/// Every so many seconds what there is to see. A divisor of it must be a whole number of any step
/// of a sweep.
pub const SAMPLE_INTERVAL: f64 = 0.1;

/// A run: what there was to see, and what it cost.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// The first one at the beginning, the last one at the end.
    pub frames: Vec<Frame>,
    /// The median time of a step, in seconds.
    pub cost: f64,
}

/// What a run does not go on for, without a look at what else is to be done.
const YIELD_INTERVAL: Duration = Duration::from_millis(1);

/// Runs something for so many seconds, with a frame in every `every` of them. `None` if a marble
/// left all numbers behind, or a step is refused. Pauses every millisecond, so that it can share
/// a thread.
pub async fn record<S: Scalar>(
    mut running: Simulation<S>,
    [seconds, step, every]: [f64; 3],
) -> Option<Recording> {
    let ids: Vec<MarbleId> =
        (0..running.world.marbles.len()).filter_map(|row| running.world.marbles.id(row)).collect();
    let steps = (seconds / step).round() as u64;
    let every = (every / step).round().max(1.0) as u64;
    let dt = S::constant(step);
    let mut recording = Recording::default();
    let mut times = Vec::new();
    let mut turn = Instant::now();
    for i in 0..=steps {
        if i > 0 {
            let begin = Instant::now();
            running.step(dt).ok()?;
            times.push(begin.elapsed());
            if running.world.stopped().next().is_some() {
                return None;
            }
        }
        if i % every == 0 || i == steps {
            let mut frame = Frame { time: i as f64 * step, ..Frame::default() };
            for id in &ids {
                let marble = running.world.marbles.get_high_precision(*id).ok()?;
                frame.at.push(marble.position.to_vec());
                frame.velocity.push(marble.velocity);
            }
            if !running.scene().gravity_keyframes.is_empty() {
                // Steps have left that of their middle.
                let gravity = running.scene().gravity_at(frame.time).map(S::constant);
                running.world.set_gravity(gravity.into()).ok()?;
            }
            frame.energy = running.world.energy().total();
            frame.momentum = running.world.momentum().into();
            frame.passed = running.sensor_count();
            frame.overlap = crate::scene::overlaps(&running.world).iter().sum();
            recording.frames.push(frame);
        }
        if turn.elapsed() > YIELD_INTERVAL {
            yield_now().await;
            turn = Instant::now();
        }
    }
    times.sort_unstable();
    recording.cost = times.get(times.len() / 2).map_or(0.0, Duration::as_secs_f64);
    Some(recording)
}

/// Runs a scene to its end and keeps its frames, the first one at the beginning. `None` if a
/// marble left all numbers behind.
#[must_use]
pub fn trace(scene: &Scene, setting: RunConfig) -> Option<Vec<Frame>> {
    block_on(record_scene(scene, setting, SAMPLE_INTERVAL)).map(|recording| recording.frames)
}

/// [Records](record) a scene to its end. `None` also if the scene cannot be run.
pub async fn record_scene(scene: &Scene, setting: RunConfig, every: f64) -> Option<Recording> {
    let RunConfig { model, number, step } = setting;
    let times = [scene.duration, step, every];
    match number {
        ScalarType::F32 => record(scene.run::<f32>(model).ok()?, times).await,
        ScalarType::F64 => record(scene.run::<f64>(model).ok()?, times).await,
    }
}

/// How many seconds of the wall's clock a scene takes, from the first step to the last one.
///
/// # Panics
/// If the scene cannot be run.
#[must_use]
pub fn time(scene: &Scene, setting: RunConfig) -> f64 {
    match setting.number {
        ScalarType::F32 => time_in::<f32>(scene, setting),
        ScalarType::F64 => time_in::<f64>(scene, setting),
    }
}

fn time_in<S: Scalar>(scene: &Scene, RunConfig { model, step, .. }: RunConfig) -> f64 {
    let mut running = scene.run::<S>(model).expect("scenes are checked before");
    let (dt, steps) = (S::constant(step), (scene.duration / step).round() as u64);
    let begin = Instant::now();
    for _ in 0..steps {
        running.step(dt).expect("steps are above zero");
    }
    begin.elapsed().as_secs_f64()
}
