//! The reference suite: one row for each thing that physics knows the answer to.
//!
//! A row measures how far a model is from the answer. What it must reach, and what
//! today's engines reach (measured in the same set-up, with their defaults), stand beside
//! it. A row that is not reached stays in the suite and fails.

mod bouncing;
mod gas;
mod granular;
mod impacts;
mod numbers;
mod rolling;

use crate::scene::Meter;

/// One thing to measure.
pub struct Row {
    /// Its name, as `family/case`.
    pub name: &'static str,
    /// What is set up and what is the answer.
    pub setup: &'static str,
    /// What measures how far off the answer is, with its unit.
    pub metric: &'static str,
    /// The model that is measured.
    pub model: &'static str,
    /// The most that it may be.
    pub target: f64,
    /// The same of today's best engine.
    pub best: &'static str,
    /// Where the answer is from.
    pub source: &'static str,
    /// How long it takes.
    pub effort: Effort,
    /// Measures it.
    pub measure: fn(&mut Meter) -> f64,
}

/// How long a row takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// Up to a few seconds: also a test.
    Quick,
    /// Longer.
    Long,
}

/// What a row gave.
#[derive(Debug)]
pub struct Outcome {
    /// How far off the answer is.
    pub figure: f64,
    /// Whether that is within the target.
    pub reached: bool,
    /// Nanoseconds per ball and step.
    pub cost: f64,
    /// Seconds that stepping took.
    pub seconds: f64,
}

impl Row {
    /// Measures this row.
    #[must_use]
    pub fn run(&self) -> Outcome {
        let mut meter = Meter::default();
        let figure = (self.measure)(&mut meter);
        // NaN is no figure at all.
        let reached = figure <= self.target;
        Outcome { figure, reached, cost: meter.cost(), seconds: meter.seconds() }
    }
}

/// Every row, in the order of `references.md`.
pub fn rows() -> impl Iterator<Item = &'static Row> {
    [rolling::ROWS, bouncing::ROWS, impacts::ROWS, gas::ROWS, granular::ROWS, numbers::ROWS]
        .into_iter()
        .flatten()
}
