//! Reference suite: one case per known result of physics.
//!
//! A case measures the error of a model. Its target, and the results of today's engines (measured
//! in the same set-up, with their defaults), stand beside it. A case that misses its target stays
//! in the suite and fails.

mod bouncing;
mod fast;
mod gas;
mod glancing;
mod granular;
mod impacts;
mod long_rolls;
mod numbers;
mod ordinary;
mod rolling;
mod swarms;

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::channel;

use crate::scene::Stopwatch;

/// A case of the suite.
pub struct SuiteCase {
    /// Name, as `family/case`.
    pub name: &'static str,
    /// Set-up and expected result.
    pub setup: &'static str,
    /// Error metric, with its unit.
    pub metric: &'static str,
    /// Measured model.
    pub model: &'static str,
    /// Largest passing error.
    pub target: f64,
    /// Error of today's best engine.
    pub best: &'static str,
    /// Source of the expected result.
    pub source: &'static str,
    /// Cost class.
    pub effort: CostClass,
    /// Runs the case and returns the error.
    pub measure: fn(&mut Stopwatch) -> f64,
}

/// Cost class of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CostClass {
    /// Up to a few seconds: also run as a test.
    Quick,
    /// Longer.
    Long,
}

/// Measurement of a case.
#[derive(Debug)]
pub struct Measurement {
    /// Error.
    pub figure: f64,
    /// The error is within the target.
    pub reached: bool,
    /// Cost in nanoseconds per ball and step.
    pub cost: f64,
    /// Duration of stepping, in seconds.
    pub seconds: f64,
}

impl SuiteCase {
    /// Runs this case.
    #[must_use]
    pub fn run(&self) -> Measurement {
        let mut stopwatch = Stopwatch::default();
        let figure = (self.measure)(&mut stopwatch);
        // NaN fails.
        let reached = figure <= self.target;
        Measurement { figure, reached, cost: stopwatch.cost(), seconds: stopwatch.seconds() }
    }
}

/// A case with its measurement, for other programs.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Report {
    /// See [`SuiteCase`].
    pub name: &'static str,
    /// Set-up and expected result.
    pub setup: &'static str,
    /// Error metric, with its unit.
    pub metric: &'static str,
    /// Measured model.
    pub model: &'static str,
    /// Error; none if not finite.
    pub figure: Option<f64>,
    /// Largest passing error.
    pub target: f64,
    /// The error is within the target.
    pub reached: bool,
    /// Error of today's best engine.
    pub best: &'static str,
    /// Source of the expected result.
    pub source: &'static str,
    /// Cost in nanoseconds per ball and step.
    pub cost: f64,
    /// Duration of stepping, in seconds.
    pub seconds: f64,
}

impl Report {
    /// Creates the report of a case.
    #[must_use]
    pub fn new(row: &SuiteCase, outcome: &Measurement) -> Self {
        let SuiteCase { name, setup, metric, model, target, best, source, .. } = *row;
        let Measurement { figure, reached, cost, seconds } = *outcome;
        let figure = figure.is_finite().then_some(figure);
        Self { name, setup, metric, model, figure, target, reached, best, source, cost, seconds }
    }
}

impl SuiteCase {
    /// Returns true for a time measurement, which runs alone.
    #[must_use]
    pub fn is_time(&self) -> bool {
        self.name.ends_with("/time")
    }
}

/// Runs cases in parallel jobs, and reports the measurements in the order of the cases.
pub fn measure(
    rows: &[&'static SuiteCase],
    jobs: usize,
    mut tell: impl FnMut(&'static SuiteCase, Measurement),
) {
    let mut outcomes: Vec<Option<Measurement>> = Vec::new();
    outcomes.resize_with(rows.len(), || None);
    for (i, row) in rows.iter().enumerate().filter(|(_, row)| row.is_time()) {
        outcomes[i] = Some(row.run());
    }
    let next = AtomicUsize::new(0);
    let (send, receive) = channel();
    std::thread::scope(|scope| {
        for _ in 0..jobs.max(1) {
            let (send, next) = (send.clone(), &next);
            scope.spawn(move || {
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    let Some(row) = rows.get(i) else { break };
                    // The receiver is gone only if the other side panicked.
                    if !row.is_time() && send.send((i, row.run())).is_err() {
                        break;
                    }
                }
            });
        }
        drop(send);
        let mut told = 0;
        let mut tell_ready = |outcomes: &mut [Option<Measurement>]| {
            while let Some(outcome) = outcomes.get_mut(told).and_then(Option::take) {
                tell(rows[told], outcome);
                told += 1;
            }
        };
        tell_ready(&mut outcomes);
        for (i, outcome) in receive {
            outcomes[i] = Some(outcome);
            tell_ready(&mut outcomes);
        }
    });
}

/// All cases, in the order of `references.md`.
pub fn rows() -> impl Iterator<Item = &'static SuiteCase> {
    let rolling = [rolling::ROWS, long_rolls::ROWS];
    let impacts = [bouncing::ROWS, impacts::ROWS, glancing::ROWS, fast::ROWS];
    let many = [gas::ROWS, granular::ROWS, ordinary::ROWS, swarms::ROWS, numbers::ROWS];
    rolling.into_iter().chain(impacts).chain(many).flatten()
}
