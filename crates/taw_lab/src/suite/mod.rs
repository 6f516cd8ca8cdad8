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
mod ordinary;
mod rolling;
mod swarms;

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::channel;

use crate::scene::Stopwatch;

/// One thing to measure.
pub struct SuiteCase {
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
    pub effort: CostClass,
    /// Measures it.
    pub measure: fn(&mut Stopwatch) -> f64,
}

/// How long a row takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CostClass {
    /// Up to a few seconds: also a test.
    Quick,
    /// Longer.
    Long,
}

/// What a row gave.
#[derive(Debug)]
pub struct Measurement {
    /// How far off the answer is.
    pub figure: f64,
    /// Whether that is within the target.
    pub reached: bool,
    /// Nanoseconds per ball and step.
    pub cost: f64,
    /// Seconds that stepping took.
    pub seconds: f64,
}

impl SuiteCase {
    /// Measures this row.
    #[must_use]
    pub fn run(&self) -> Measurement {
        let mut stopwatch = Stopwatch::default();
        let figure = (self.measure)(&mut stopwatch);
        // NaN is no figure at all.
        let reached = figure <= self.target;
        Measurement { figure, reached, cost: stopwatch.cost(), seconds: stopwatch.seconds() }
    }
}

/// A row and its outcome, for other programs.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Report {
    /// See [`SuiteCase`].
    pub name: &'static str,
    /// What is set up and what is the answer.
    pub setup: &'static str,
    /// What the figure is, with its unit.
    pub metric: &'static str,
    /// The model that is measured.
    pub model: &'static str,
    /// How far off the answer is; nothing if that is no number.
    pub figure: Option<f64>,
    /// The most that it may be.
    pub target: f64,
    /// Whether it is no more.
    pub reached: bool,
    /// The same of today's best engine.
    pub best: &'static str,
    /// Where the answer is from.
    pub source: &'static str,
    /// Nanoseconds per ball and step.
    pub cost: f64,
    /// Seconds that stepping took.
    pub seconds: f64,
}

impl Report {
    /// What there is to say of a row.
    #[must_use]
    pub fn new(row: &SuiteCase, outcome: &Measurement) -> Self {
        let SuiteCase { name, setup, metric, model, target, best, source, .. } = *row;
        let Measurement { figure, reached, cost, seconds } = *outcome;
        let figure = figure.is_finite().then_some(figure);
        Self { name, setup, metric, model, figure, target, reached, best, source, cost, seconds }
    }
}

impl SuiteCase {
    /// Whether it measures time, and so wants no others beside it.
    #[must_use]
    pub fn is_time(&self) -> bool {
        self.name.ends_with("/time")
    }
}

/// Measures rows, some at a time, and tells the outcomes in the order of the rows.
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
                    // Nobody listens any more only if the other side panicked.
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

/// Every row, in the order of `references.md`.
pub fn rows() -> impl Iterator<Item = &'static SuiteCase> {
    let families = [rolling::ROWS, bouncing::ROWS, impacts::ROWS, gas::ROWS, granular::ROWS];
    families.into_iter().chain([ordinary::ROWS, swarms::ROWS, numbers::ROWS]).flatten()
}
