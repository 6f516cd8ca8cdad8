//! Many cases, on several threads, with a watch over those that do not end.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::thread;
use std::time::Duration;

use super::case::{Case, Kind, Name};
use super::generate::generate;
use super::judge::{Finding, Invariant};
use super::report::Tally;
use super::run::{Failure, Pulse, Verdict, run, run_for, trail};
use super::shrink::shrink;

/// Settings that all cases have instead of random ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// Length of a step, in seconds.
    pub step: Option<f64>,
    /// From 1 to 1,000.
    pub substeps: Option<u32>,
    /// From 1 to 1,000.
    pub iterations: Option<u32>,
}

impl Settings {
    /// The case with these settings, and of the same duration.
    #[must_use]
    pub fn apply(self, mut case: Case) -> Case {
        let step = self.step.unwrap_or(case.step);
        case.steps = (f64::from(case.steps) * case.step / step).round().max(1.0) as u32;
        case.step = step;
        case.model.substeps = self.substeps.unwrap_or(case.model.substeps);
        case.model.iterations = self.iterations.unwrap_or(case.model.iterations);
        case
    }
}

/// Plan of a storm.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Number of scenes, of all kinds together.
    pub scenes: u64,
    /// Of all random numbers.
    pub seed: u64,
    /// Only kinds whose name contains this.
    pub only: String,
    /// Settings of all scenes.
    pub settings: Settings,
    /// Number of scenes run in parallel.
    pub jobs: usize,
    /// Folder for failures, if they are written.
    pub out: Option<PathBuf>,
    /// Failures are shrunk.
    pub shrink: bool,
    /// Number of failures of one kind and invariant to write and shrink.
    pub keep: u64,
    /// Time limit of a step, after which it counts as hung.
    pub patience: Duration,
}

/// Result of a storm.
#[derive(Clone, Debug, Default)]
pub struct Storm {
    /// By kind.
    pub tallies: BTreeMap<Kind, Tally>,
    /// Violated invariants and the written files.
    pub failures: Vec<(Name, Failure, Option<PathBuf>)>,
}

/// Maximum duration of shrinking a failure.
const SHRINK_FOR: Duration = Duration::from_secs(20);

/// A thread that runs scenes, seen from outside.
struct Worker {
    pulse: Arc<Pulse>,
    at: Arc<Mutex<Option<Name>>>,
}

/// The scenes of a plan: of all its kinds in turn.
fn names(plan: &Plan) -> Vec<Name> {
    let kinds: Vec<Kind> =
        Kind::ALL.into_iter().filter(|kind| kind.name().contains(&plan.only)).collect();
    let turns = kinds.len().max(1) as u64;
    let name = |i: u64| {
        Some(Name { kind: *kinds.get((i % turns) as usize)?, seed: plan.seed, number: i / turns })
    };
    (0..plan.scenes).filter_map(name).collect()
}

/// Runs all scenes of a plan. `progress` is told of each that is done.
///
/// # Errors
/// If a file cannot be written.
pub fn weather(plan: &Plan, mut progress: impl FnMut(u64, u64)) -> std::io::Result<Storm> {
    // A panic is reported with its scene; what it prints besides would be in between.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let names = Arc::new(names(plan));
    let next = Arc::new(AtomicUsize::new(0));
    let (send, receive) = mpsc::channel();
    let settings = plan.settings;
    let work = || hire(Arc::clone(&names), settings, Arc::clone(&next), send.clone());
    let mut workers: Vec<Worker> = (0..plan.jobs.max(1)).map(|_| work()).collect();
    let mut verdicts = BTreeMap::new();
    while verdicts.len() < names.len() {
        match receive.recv_timeout(Duration::from_millis(200)) {
            Ok((name, verdict)) => {
                verdicts.insert(name, verdict);
                progress(verdicts.len() as u64, names.len() as u64);
            }
            Err(_) => {
                for worker in &mut workers {
                    if worker.pulse.running() < plan.patience {
                        continue;
                    }
                    let name = worker.at.lock().ok().and_then(|mut at| at.take());
                    if let Some(name) = name {
                        verdicts.insert(name, stuck(&worker.pulse));
                        // The thread is left to itself; another one goes on.
                        *worker = work();
                    }
                }
            }
        }
    }
    let storm = report(plan, &verdicts);
    std::panic::set_hook(hook);
    storm
}

fn hire(
    names: Arc<Vec<Name>>,
    settings: Settings,
    next: Arc<AtomicUsize>,
    send: mpsc::Sender<(Name, Verdict)>,
) -> Worker {
    let worker = Worker { pulse: Arc::default(), at: Arc::default() };
    let (pulse, at) = (Arc::clone(&worker.pulse), Arc::clone(&worker.at));
    thread::spawn(move || {
        while let Some(name) = names.get(next.fetch_add(1, Ordering::Relaxed)) {
            if let Ok(mut at) = at.lock() {
                *at = Some(*name);
            }
            let verdict = run(&settings.apply(generate(*name)), &pulse);
            // Whoever was given up as stuck has been replaced.
            let mine = at.lock().is_ok_and(|mut at| at.take().is_some());
            if !mine || send.send((*name, verdict)).is_err() {
                return;
            }
        }
    });
    worker
}

fn stuck(pulse: &Pulse) -> Verdict {
    let finding = Finding {
        invariant: Invariant::Ends,
        value: pulse.running().as_secs_f64(),
        bound: 1.0,
        body: None,
    };
    let failure = Failure { finding, step: pulse.step(), what: "it does not end".into() };
    Verdict { worst: vec![finding], failures: vec![failure], slowest: 0.0 }
}

/// Counts, and writes failures, the first few of each sort.
fn report(plan: &Plan, verdicts: &BTreeMap<Name, Verdict>) -> std::io::Result<Storm> {
    let mut storm = Storm::default();
    let mut kept: BTreeMap<(Kind, Invariant), u64> = BTreeMap::new();
    for (name, verdict) in verdicts {
        storm.tallies.entry(name.kind).or_default().add(*name, verdict);
        for failure in &verdict.failures {
            let count = kept.entry((name.kind, failure.finding.invariant)).or_default();
            *count += 1;
            let mut file = None;
            if let Some(out) = &plan.out
                && *count <= plan.keep
            {
                let case = plan.settings.apply(generate(*name));
                file = Some(write(&name.to_string(), case, failure, plan.shrink, out)?);
            }
            storm.failures.push((*name, failure.clone(), file));
        }
    }
    Ok(storm)
}

/// Writes a case that failed, up to the step in which it did, or the smallest that still fails. Returns
/// the file.
///
/// # Errors
/// Errors of the file system.
pub fn write(
    name: &str,
    case: Case,
    failure: &Failure,
    shrinks: bool,
    out: &std::path::Path,
) -> std::io::Result<PathBuf> {
    let invariant = failure.finding.invariant;
    let mut case = Case { broke: Some(invariant), steps: failure.step.max(1), ..case };
    // A hung case cannot be run again.
    if shrinks && invariant != Invariant::Ends {
        case = shrink(&case, invariant, SHRINK_FOR);
    }
    std::fs::create_dir_all(out)?;
    let file = format!("{}-{name}.ron", invariant.name()).replace(['/', ':'], "-");
    let file = out.join(file);
    std::fs::write(&file, case.to_text().map_err(std::io::Error::other)?)?;
    Ok(file)
}

/// Runs a case and says what came of it, with the last steps of the body that it is about, and what
/// failed.
#[must_use]
pub fn replay(case: &Case) -> (String, Vec<Failure>) {
    let verdict = run_for(case, case.broke, &Pulse::default());
    let mut text = format!("{}\n", case.scene.description);
    let _ = writeln!(text, "{:?} {} step {} s", case.model, case.number, case.step);
    if let Some(swarm) = &case.swarm {
        let (marbles, balls) = (case.scene.all_marbles().count(), swarm.balls.len());
        let _ = writeln!(text, "{marbles} marbles, then {balls} balls in {} parts", swarm.substeps);
    }
    for Finding { invariant, value, bound, body } in &verdict.worst {
        let name = invariant.name();
        let body = body.map_or_else(String::new, |body| format!(" (body {body})"));
        let _ = writeln!(text, "{name}: {value:.3e} of {bound:.3e}{body}");
    }
    for Failure { finding, step, what } in &verdict.failures {
        text += &trail(case, finding.body.unwrap_or(0), *step);
        let _ = writeln!(text, "{} broke in step {step} {what}", finding.invariant.name());
    }
    if verdict.failures.is_empty() {
        text += "all held\n";
    }
    (text, verdict.failures)
}
