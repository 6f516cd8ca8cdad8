//! `taw-lab`: what every choice costs and buys.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use futures_lite::future::block_on;
use indicatif::{ProgressBar, ProgressStyle};
use peak_alloc::PeakAlloc;
use taw::scene::Scene;
use taw::world::Model;
use taw_lab::advise::{Requirements, advise, quantity, read_scene};
use taw_lab::stages::{self, Stages};
use taw_lab::storm::{self, Case};
use taw_lab::suite::{self, CostClass, SuiteCase};
use taw_lab::trade::sweep::{Job, Plan, by_the_clock, in_order, read_points, sweep, write_points};
use taw_lab::trade::trace::{RunConfig, ScalarType};
use taw_lab::trade::{Point, write_report, write_tables};

/// Counts what is allocated.
#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

#[derive(Parser)]
#[command(about = "Measures what taw's models cost and how exact they are")]
struct Options {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Measures every row of the reference suite. Exit status 1 if one is not reached.
    Suite {
        /// Only rows whose name contains this.
        #[arg(long, default_value = "")]
        filter: String,
        /// Only rows of models whose name contains this.
        #[arg(long, default_value = "")]
        model: String,
        /// Leaves out what takes longer than a few seconds.
        #[arg(long)]
        quick: bool,
        /// Leaves out set-up, metric and source.
        #[arg(long)]
        short: bool,
        /// File for all of it besides, as JSON.
        #[arg(long, value_name = "FILE")]
        json: Option<PathBuf>,
        /// Number of cases measured in parallel. (Time measurements run alone.)
        #[arg(long, default_value_t = std::thread::available_parallelism().map_or(1, usize::from))]
        jobs: usize,
    },
    /// Sweeps models, scalars, steps, substeps and iterations over the scenes, and draws error
    /// against cost. What was measured is kept: interrupted, it goes on where it was.
    Trade {
        /// Folder of the points.
        #[arg(long, default_value = "target/trade")]
        out: PathBuf,
        /// File of the report, with its charts beside it [default: report.md among the points]
        #[arg(long, value_name = "FILE")]
        report: Option<PathBuf>,
        /// Only some settings: less than two minutes.
        #[arg(long)]
        quick: bool,
        /// Only scenes whose name contains this.
        #[arg(long, default_value = "")]
        scene: String,
        /// Only models whose name contains this.
        #[arg(long, default_value = "")]
        model: String,
        /// Only part K of N, counted from 1, and no report: see `merge`.
        #[arg(long, value_name = "K/N", value_parser = shard)]
        shard: Option<[usize; 2]>,
        /// More points to draw and report, of other engines for example.
        #[arg(long, value_name = "FILE")]
        with: Vec<PathBuf>,
    },
    /// Names the model that suits a scene: the cheapest that is right enough, the most exact that is
    /// cheap enough, or, asked for neither, those that no other one beats in both.
    Advise {
        /// A scene in RON (see `crates/taw_lab/scenes`).
        scene: PathBuf,
        /// Maximum position error: 1mm.
        #[arg(long, value_parser = length)]
        max_error: Option<f64>,
        /// Maximum cost of a step: 2ms.
        #[arg(long, value_parser = duration)]
        budget: Option<f64>,
        /// Only models in these numbers; worlds of Bevy games are f32.
        #[arg(long, value_enum)]
        number: Option<ScalarType>,
        /// The step of the game.
        #[arg(long, value_parser = duration, default_value = "16.666667ms")]
        step: f64,
    },
    /// Prints what each stage of a scene's steps takes, and how much memory its world has.
    Bench {
        /// A scene in RON (see `crates/taw_lab/scenes`).
        scene: PathBuf,
        /// The model in RON; what is left out is as by default.
        #[arg(long, default_value = "(response: Impulse, rotation: Dynamic)")]
        model: String,
        /// In which numbers.
        #[arg(long, value_enum, default_value = "f32")]
        number: ScalarType,
        /// The step of the game.
        #[arg(long, value_parser = duration, default_value = "16.666667ms")]
        step: f64,
    },
    /// Runs random ordinary scenes and judges them by what holds in all of them: no energy from
    /// nothing, nothing hangs, nothing sinks in. Exit status 1 if something did not hold.
    Storm(Storm),
    /// Joins the parts of a sweep into one report.
    Merge {
        /// Folder of the points.
        #[arg(long, default_value = "target/trade")]
        out: PathBuf,
        /// File of the report, with its charts beside it [default: report.md among the points]
        #[arg(long, value_name = "FILE")]
        report: Option<PathBuf>,
        /// The parts: `points-K-of-N.jsonl`.
        #[arg(required = true)]
        files: Vec<PathBuf>,
    },
}

#[derive(clap::Args)]
struct Storm {
    /// Number of scenes, of all models in turn.
    #[arg(long, default_value_t = 900)]
    scenes: u64,
    /// Of the random numbers: the same scenes for the same seed, whatever else is asked for.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of scenes run in parallel.
    #[arg(long, default_value_t = std::thread::available_parallelism().map_or(1, usize::from))]
    jobs: usize,
    /// Only models whose name contains this: impulse/swept.
    #[arg(long, value_name = "PATTERN", default_value = "")]
    only: String,
    /// Length of all steps, in s, ms or µs [default: random]
    #[arg(long, value_parser = duration)]
    step: Option<f64>,
    /// Substeps of all marbles [default: random]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    substeps: Option<u32>,
    /// Iterations of all marbles [default: random]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    iterations: Option<u32>,
    /// Folder for failures, as files for --replay; of --replay, too [default: nowhere]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Writes failures as they are.
    #[arg(long)]
    no_shrink: bool,
    /// Number of failures of one model and invariant to write.
    #[arg(long, default_value_t = 3)]
    keep: u64,
    /// Time limit of a step, after which it counts as hung.
    #[arg(long, value_parser = duration, default_value = "30s")]
    patience: f64,
    /// Does not count an invariant of a model or of one scene, as NAME:INVARIANT:
    /// impulse/swept:speed, impulse/swept:1:67:speed.
    #[arg(long, value_name = "NAME:INVARIANT")]
    except: Vec<String>,
    /// Runs one scene, of a file or by its name (impulse:1:7), and says how it went.
    #[arg(long, value_name = "FILE")]
    replay: Option<String>,
}

fn shard(text: &str) -> Result<[usize; 2], String> {
    let parts = text.split_once('/').map(|(k, n)| (k.parse(), n.parse()));
    match parts {
        Some((Ok(number), Ok(of))) if (1..=of).contains(&number) => Ok([number, of]),
        _ => Err("not K/N with K from 1 to N".into()),
    }
}

fn length(text: &str) -> Result<f64, String> {
    quantity(text, &[("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("µm", 1e-6), ("um", 1e-6)])
}

fn duration(text: &str) -> Result<f64, String> {
    quantity(text, &[("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("us", 1e-6)])
}

fn main() -> ExitCode {
    let outcome = match Options::parse().command {
        Command::Suite { filter, model, quick, short, json, jobs } => {
            let wanted = |row: &&SuiteCase| {
                row.name.contains(&filter)
                    && row.model.contains(&model)
                    && (!quick || row.effort == CostClass::Quick)
            };
            run_suite(&suite::rows().filter(wanted).collect::<Vec<_>>(), short, json, jobs)
        }
        Command::Trade { out, report, quick, scene, model, shard, with } => {
            trade(&out, report, &Plan { quick, scene, model }, shard, &with)
        }
        Command::Advise { scene, max_error, budget: max_cost, number, step } => print_advice(
            &scene,
            Requirements { max_error, max_cost, number, step, ..Requirements::default() },
        ),
        Command::Bench { scene, model, number, step } => bench(&scene, &model, number, step),
        Command::Storm(options) => storm(options),
        Command::Merge { out, report, files } => merge(&out, report, &files),
    };
    outcome.unwrap_or_else(|error| {
        eprintln!("{error}");
        ExitCode::FAILURE
    })
}

fn trade(
    out: &Path,
    to: Option<PathBuf>,
    plan: &Plan,
    shard: Option<[usize; 2]>,
    with: &[PathBuf],
) -> Result<ExitCode, Box<dyn Error>> {
    std::fs::create_dir_all(out)?;
    let file = match shard {
        None => out.join("points.jsonl"),
        Some([number, of]) => out.join(format!("points-{number}-of-{of}.jsonl")),
    };
    let kept = read_points(&file)?.len();
    if kept > 0 {
        let name = file.display();
        eprintln!("Goes on from {kept} points in {name}; to measure them anew, delete it");
    }
    let bar = ProgressBar::new(0);
    let style = "{bar:40} {pos} of {len}, {eta} left  {msg}";
    bar.set_style(ProgressStyle::with_template(style)?);
    let points = sweep(plan, shard.unwrap_or([1, 1]), &file, by_the_clock, |done, all, job| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
        bar.set_message(format!("{}: {}", job.scene.name, job.model.name));
    })?;
    bar.finish_and_clear();
    if shard.is_some() {
        println!("{} points in {}", points.len(), file.display());
        return Ok(ExitCode::SUCCESS);
    }
    let wanted: std::collections::BTreeSet<_> = plan.jobs().iter().map(Job::key).collect();
    let mut points: Vec<_> =
        points.into_iter().filter(|point| wanted.contains(&point.key())).collect();
    for file in with {
        points.extend(read_points(file)?);
    }
    report(out, to, points)
}

fn read(file: &Path) -> Result<Scene, Box<dyn Error>> {
    let name = file.display();
    let text = std::fs::read_to_string(file).map_err(|error| format!("{name}: {error}"))?;
    Ok(read_scene(&text).map_err(|error| format!("{name}:{error}"))?)
}

fn bench(
    file: &Path,
    model: &str,
    number: ScalarType,
    step: f64,
) -> Result<ExitCode, Box<dyn Error>> {
    let scene = read(file)?;
    let model: Model = ron::from_str(model).map_err(|error| format!("--model: {error}"))?;
    let setting = RunConfig { model, number, step };
    let Stages { integrate, generate_contacts, restitute, contacts, bytes } =
        stages::measure(&scene, setting, || MEMORY.current_usage())?;
    let all = integrate + generate_contacts + restitute;
    println!("| stage | µs a step | part |\n|---|---|---|");
    for (name, time) in [
        ("integrate", integrate),
        ("generate contacts", generate_contacts),
        ("restitute", restitute),
        ("all", all),
    ] {
        println!("| {name} | {:.1} | {:.0} % |", time * 1e6, 100.0 * time / all);
    }
    let marbles = scene.all_marbles().count();
    println!("\n{marbles} marbles, {contacts:.1} contacts in the mean");
    println!("{bytes} bytes, {:.0} for each marble", bytes as f64 / marbles.max(1) as f64);
    Ok(ExitCode::SUCCESS)
}

fn print_advice(file: &Path, wish: Requirements) -> Result<ExitCode, Box<dyn Error>> {
    let scene = read(file)?;
    let bar = ProgressBar::new(0);
    let advice = block_on(advise(&scene, wish, |done, all, _| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    }));
    bar.finish_and_clear();
    print!("{}", advice.text(wish));
    let asked = wish.max_error.is_some() || wish.max_cost.is_some();
    let found = !asked || advice.best(wish).is_some();
    Ok(if found { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn storm(options: Storm) -> Result<ExitCode, Box<dyn Error>> {
    let Storm { step, substeps, iterations, .. } = options;
    let settings = storm::Settings { step, substeps, iterations };
    if let Some(name) = options.replay {
        let case = match std::fs::read_to_string(&name) {
            Ok(text) => Case::from_text(&text)?,
            Err(error) => storm::generate(
                name.parse().map_err(|other| format!("{name}: {error}, and {other}"))?,
            ),
        };
        let case = settings.apply(case);
        let (text, failures) = storm::replay(&case);
        print!("{text}");
        if let Some(out) = &options.out {
            let stem = std::path::Path::new(&name).file_stem().unwrap_or_default();
            for failure in &failures {
                let case = case.clone();
                let stem = stem.to_string_lossy();
                let file = storm::write(&stem, case, failure, !options.no_shrink, out)?;
                println!("{}", file.display());
            }
        }
        return Ok(if failures.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE });
    }
    let plan = storm::Plan {
        scenes: options.scenes,
        seed: options.seed,
        only: options.only,
        settings,
        jobs: options.jobs,
        out: options.out,
        shrink: !options.no_shrink,
        keep: options.keep,
        patience: std::time::Duration::from_secs_f64(options.patience),
    };
    let bar = ProgressBar::new(0);
    let found = storm::weather(&plan, |done, all| {
        bar.set_length(all);
        bar.set_position(done);
    })?;
    bar.finish_and_clear();
    print!("{}", storm::table(&found.tallies));
    if !found.failures.is_empty() {
        println!("\nDid not hold (`taw-lab storm --replay NAME`):");
    }
    let mut held = true;
    for (name, storm::Failure { finding, step, what }, file) in &found.failures {
        let storm::Finding { invariant, value, bound, .. } = finding;
        let file = file.as_ref().map_or_else(String::new, |file| format!(", {}", file.display()));
        let invariant = invariant.name();
        let of_model = format!("{}:{invariant}", name.kind);
        let of_scene = format!("{name}:{invariant}");
        let known = options.except.iter().any(|known| [&of_model, &of_scene].contains(&known));
        held &= known;
        let known = if known { " (known)" } else { "" };
        println!(
            "{name}: {invariant} in step {step}: {value:.2e} of {bound:.2e} {what}{file}{known}"
        );
    }
    Ok(if held { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn merge(out: &Path, to: Option<PathBuf>, files: &[PathBuf]) -> Result<ExitCode, Box<dyn Error>> {
    std::fs::create_dir_all(out)?;
    let mut points = Vec::new();
    for file in files {
        points.extend(read_points(file)?);
    }
    let points = in_order(points);
    write_points(&out.join("points.jsonl"), &points)?;
    report(out, to, points)
}

fn report(out: &Path, to: Option<PathBuf>, points: Vec<Point>) -> Result<ExitCode, Box<dyn Error>> {
    let points = in_order(points);
    write_tables(&points, out)?;
    let to = to.unwrap_or_else(|| out.join("report.md"));
    write_report(&points, &to)?;
    println!("{} points; see {}", points.len(), to.display());
    Ok(ExitCode::SUCCESS)
}

fn run_suite(
    rows: &[&'static SuiteCase],
    short: bool,
    json: Option<PathBuf>,
    jobs: usize,
) -> Result<ExitCode, Box<dyn Error>> {
    let more = if short { "" } else { " set-up | metric | source |" };
    println!(
        "| row | model | figure | target | | best of today's engines | ns per ball and step |{more}"
    );
    println!("|---|---|---|---|---|---|---|{}", if short { "" } else { "---|---|---|" });
    let mut reports = Vec::new();
    suite::measure(rows, jobs, |row, outcome| {
        let verdict = if outcome.reached { "reached" } else { "**missed**" };
        let (figure, cost) = (outcome.figure, outcome.cost);
        let SuiteCase { name, model, target, best, setup, metric, source, .. } = row;
        print!(
            "| {name} | {model} | {figure:.2e} | {target:.0e} | {verdict} | {best} | {cost:.0} |"
        );
        println!(
            "{}",
            if short { String::new() } else { format!(" {setup} | {metric} | {source} |") }
        );
        reports.push(suite::Report::new(row, &outcome));
    });
    let (reached, count) = (reports.iter().filter(|report| report.reached).count(), reports.len());
    println!("\n{reached} of {count} rows reached");
    if let Some(file) = json {
        std::fs::write(file, serde_json::to_string_pretty(&reports)?)?;
    }
    Ok(if reached == count { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
