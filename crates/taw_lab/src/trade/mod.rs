//! Error against cost: every model, in both scalars, by many settings, on scenes whose outcome is
//! known.

#[cfg(feature = "cli")]
mod chart;
pub mod models;
#[cfg(feature = "cli")]
mod report;
pub mod scenes;
#[cfg(feature = "cli")]
pub mod sweep;
pub mod trace;

#[cfg(feature = "cli")]
pub use report::{Curve, curves, front, write_report, write_tables};

/// Substeps, and iterations where they count.
pub const COUNTS: [u32; 6] = [1, 2, 4, 8, 16, 32];

/// What one setting came to on one scene.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Point {
    /// Whose it is: `taw`, or another engine with its version.
    pub engine: String,
    /// The scene.
    pub scene: String,
    /// The model's name.
    pub model: String,
    /// `f32` or `f64`.
    pub number: String,
    /// The step's name, and its length.
    pub step: String,
    /// In seconds.
    pub seconds: f64,
    /// Substeps in a step.
    pub substeps: u32,
    /// Iterations in a substep.
    pub iterations: u32,
    /// As a part of what the scene is about; nothing if there is no telling.
    pub error: Option<f64>,
    /// Why it does not count, if it does not.
    pub failure: Option<Failure>,
    /// Nanoseconds for each marble and simulated second.
    pub cost: f64,
    /// Simulated seconds in a second.
    pub real_time: f64,
    /// What else there is to know: another engine's defaults.
    #[serde(default)]
    pub note: String,
}

/// Why a point does not count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Failure {
    /// A marble left all numbers behind.
    Overflow,
    /// An error of more than one.
    Wrong,
}

impl Point {
    /// What tells it from others.
    #[must_use]
    pub fn key(&self) -> String {
        let Self { engine, scene, model, number, step, substeps, iterations, .. } = self;
        format!("{engine}|{scene}|{model}|{number}|{step}|{substeps}|{iterations}")
    }

    /// Its setting, in a few characters: the step, and substeps and iterations if there are any.
    #[must_use]
    pub fn setting(&self) -> String {
        format!("{} × {} × {}", self.step, self.substeps, self.iterations)
    }
}
