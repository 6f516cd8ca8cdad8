//! Results of a storm as a table.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::case::{Kind, Name};
use super::judge::Invariant;
use super::run::Verdict;

/// Statistics of the scenes of a kind.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Number of scenes, and of those in which all invariants held.
    pub scenes: u64,
    /// In how many all held.
    pub held: u64,
    /// For each invariant, in how many scenes it did not hold.
    pub broken: BTreeMap<Invariant, u64>,
    /// The nearest that each came to its bound, as a part of it, and where.
    pub worst: BTreeMap<Invariant, (f64, Name)>,
    /// The slowest step, in seconds, and where.
    pub slowest: Option<(f64, Name)>,
}

impl Tally {
    /// Counts a scene.
    pub fn add(&mut self, name: Name, verdict: &Verdict) {
        self.scenes += 1;
        self.held += u64::from(verdict.failures.is_empty());
        for failure in &verdict.failures {
            *self.broken.entry(failure.finding.invariant).or_default() += 1;
        }
        for finding in &verdict.worst {
            let worst = self.worst.entry(finding.invariant).or_insert((0.0, name));
            if finding.ratio() > worst.0 {
                *worst = (finding.ratio(), name);
            }
        }
        if self.slowest.is_none_or(|(slowest, _)| verdict.slowest > slowest) {
            self.slowest = Some((verdict.slowest, name));
        }
    }
}

/// The table of all kinds.
#[must_use]
pub fn table(tallies: &BTreeMap<Kind, Tally>) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "| model | scenes | held | broken (scenes) |");
    let _ = writeln!(text, "|---|---|---|---|");
    for (kind, tally) in tallies {
        let Tally { scenes, held, broken, .. } = tally;
        let broken: Vec<_> = broken
            .iter()
            .map(|(invariant, count)| format!("{} {count}", invariant.name()))
            .collect();
        let _ = writeln!(text, "| {kind} | {scenes} | {held} | {} |", broken.join(", "));
    }
    let _ = writeln!(text, "\n| model | invariant | worst, of its bound | in |\n|---|---|---|---|");
    for (kind, tally) in tallies {
        for (invariant, (ratio, name)) in &tally.worst {
            let _ = writeln!(text, "| {kind} | {} | {ratio:.2e} | {name} |", invariant.name());
        }
        if let Some((slowest, name)) = tally.slowest {
            let _ = writeln!(text, "| {kind} | slowest step | {slowest:.1e} s | {name} |");
        }
    }
    text
}
