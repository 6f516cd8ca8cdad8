//! Accuracy–cost profiles: every model, in both scalars, with many settings, on scenes of known
//! outcome.

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

/// Tested counts of substeps, and of iterations where they matter.
pub const COUNTS: [u32; 6] = [1, 2, 4, 8, 16, 32];

/// Result of one run configuration on one scene.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Point {
    /// Engine: `taw`, or another one with its version.
    pub engine: String,
    /// Name of the scene.
    pub scene: String,
    /// Name of the model.
    pub model: String,
    /// `f32` or `f64`.
    pub number: String,
    /// Name of the step, and its length in seconds.
    pub step: String,
    /// Length of the step, in seconds.
    pub seconds: f64,
    /// Substeps in a step.
    pub substeps: u32,
    /// Iterations in a substep.
    pub iterations: u32,
    /// Error relative to the size of the scene; none if undefined.
    pub error: Option<f64>,
    /// Reason of a failed run.
    pub failure: Option<Failure>,
    /// Cost in nanoseconds per marble and simulated second.
    pub cost: f64,
    /// Real-time factor: simulated seconds per second.
    pub real_time: f64,
    /// Remarks: another engine's defaults.
    #[serde(default)]
    pub note: String,
}

/// Reason of a failed run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Failure {
    /// The state of a marble became non-finite.
    Overflow,
    /// An error of more than one.
    Wrong,
}

impl Point {
    /// Unique key.
    #[must_use]
    pub fn key(&self) -> String {
        let Self { engine, scene, model, number, step, substeps, iterations, .. } = self;
        format!("{engine}|{scene}|{model}|{number}|{step}|{substeps}|{iterations}")
    }

    /// Short description of the run configuration: the step, and substeps and iterations.
    #[must_use]
    pub fn setting(&self) -> String {
        format!("{} × {} × {}", self.step, self.substeps, self.iterations)
    }
}
