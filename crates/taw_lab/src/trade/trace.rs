//! Recordings of runs of a scene.

use std::time::Duration;

use futures_lite::future::{block_on, yield_now};
use taw::prelude::*;
use taw::scene::{Scene, Simulation};
use web_time::Instant;

/// Floating-point type of a world.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum ScalarType {
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

impl std::fmt::Display for ScalarType {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(if *self == Self::F32 { "f32" } else { "f64" })
    }
}

/// Configuration of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunConfig {
    /// Model.
    pub model: Model,
    /// Floating-point type.
    pub number: ScalarType,
    /// Time step, in seconds.
    pub step: f64,
}

/// State of a scene at one time, with one entry per marble in the order of the scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// Time, in seconds.
    pub time: f64,
    /// Positions, in metres.
    pub at: Vec<Vec3<f64>>,
    /// Velocities, in m/s.
    pub velocity: Vec<Vec3<f64>>,
    /// Total penetration of all contacts, in metres.
    pub overlap: f64,
    /// Total energy of all marbles, in joules.
    pub energy: f64,
    /// Total momentum of all marbles, in kg m/s.
    pub momentum: [f64; 3],
    /// Number of marbles behind the scene's sensor planes.
    pub passed: usize,
}

/// Sample interval of recordings in seconds. Every step of a sweep must divide it by a whole
/// number.
pub const SAMPLE_INTERVAL: f64 = 0.1;

/// Recording of a run with its cost.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// Frames from the start to the end.
    pub frames: Vec<Frame>,
    /// Median duration of a step, in seconds.
    pub cost: f64,
}

/// Longest time a run keeps the thread before it yields.
const YIELD_INTERVAL: Duration = Duration::from_millis(1);

/// Records a run of a given duration with a frame every `every` seconds. `None` if the state of a
/// marble becomes non-finite, or a step is rejected. Yields every millisecond, so that it can share
/// a thread.
pub async fn record<S: Scalar>(
    mut running: Simulation<S>,
    [seconds, step, every]: [f64; 3],
) -> Option<Recording> {
    let ids: Vec<MarbleId> =
        (0..running.world.marbles.len()).filter_map(|row| running.world.marbles.id(row)).collect();
    let steps = (seconds / step).round() as u64;
    let every = (every / step).round().max(1.0) as u64;
    let dt = S::from_f64(step);
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
                // The steps have set the gravity of their midpoint.
                let gravity = running.scene().gravity_at(frame.time).map(S::from_f64);
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

/// Records a scene to its end. `None` if the state of a marble becomes non-finite.
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
