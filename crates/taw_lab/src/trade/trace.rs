//! What happened in a scene, whatever stepped it.

use taw::prelude::*;
use taw::scene::Scene;

/// In which numbers a world counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum Number {
    /// Single precision, as games do.
    F32,
    /// Double precision.
    F64,
}

impl std::fmt::Display for Number {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(if *self == Self::F32 { "f32" } else { "f64" })
    }
}

/// How a scene is stepped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    /// By which model.
    pub model: Model,
    /// In which numbers.
    pub number: Number,
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
}

/// Every so many seconds what there is to see. A divisor of it must be a whole number of any step
/// of a sweep.
pub const FRAME: f64 = 0.1;

/// Runs a scene to its end and keeps its frames, the first one at the beginning. `None` if a
/// marble left all numbers behind.
///
/// # Panics
/// If the scene cannot be run.
#[must_use]
pub fn trace(scene: &Scene, setting: Setting) -> Option<Vec<Frame>> {
    match setting.number {
        Number::F32 => trace_in::<f32>(scene, setting),
        Number::F64 => trace_in::<f64>(scene, setting),
    }
}

fn trace_in<S: Scalar>(scene: &Scene, Setting { model, step, .. }: Setting) -> Option<Vec<Frame>> {
    let mut running = scene.run::<S>(model).expect("scenes are checked before");
    let ids: Vec<MarbleId> =
        (0..running.world.marbles.len()).filter_map(|row| running.world.marbles.id(row)).collect();
    let steps = (scene.seconds / step).round() as u64;
    let every = (FRAME / step).round().max(1.0) as u64;
    let dt = S::constant(step);
    let mut frames = Vec::new();
    for i in 0..=steps {
        if i > 0 {
            running.step(dt).expect("steps are above zero");
            if running.world.stopped().next().is_some() {
                return None;
            }
        }
        if i % every == 0 || i == steps {
            let mut frame = Frame { time: i as f64 * step, ..Frame::default() };
            for id in &ids {
                let marble =
                    running.world.marbles.get_exact(*id).expect("nobody takes marbles out");
                frame.at.push(marble.position.to_vec());
                frame.velocity.push(marble.velocity);
            }
            frame.overlap = crate::scene::overlaps(&running.world).iter().sum();
            frames.push(frame);
        }
    }
    Some(frames)
}

/// How many seconds of the wall's clock a scene takes, from the first step to the last one.
///
/// # Panics
/// If the scene cannot be run.
#[must_use]
pub fn time(scene: &Scene, setting: Setting) -> f64 {
    match setting.number {
        Number::F32 => time_in::<f32>(scene, setting),
        Number::F64 => time_in::<f64>(scene, setting),
    }
}

fn time_in<S: Scalar>(scene: &Scene, Setting { model, step, .. }: Setting) -> f64 {
    let mut running = scene.run::<S>(model).expect("scenes are checked before");
    let (dt, steps) = (S::constant(step), (scene.seconds / step).round() as u64);
    let begin = std::time::Instant::now();
    for _ in 0..steps {
        running.step(dt).expect("steps are above zero");
    }
    begin.elapsed().as_secs_f64()
}
