//! `taw-lab`: what every choice costs and buys.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};
use taw_lab::advise::{Wish, advise, quantity, read_scene};
use taw_lab::suite::{self, Effort};
use taw_lab::trade::sweep::{Job, Plan, by_the_clock, in_order, read_points, sweep, write_points};
use taw_lab::trade::{Point, write_report};

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
        /// Only rows whose name or model contains this.
        #[arg(long, default_value = "")]
        filter: String,
        /// Leaves out what takes longer than a few seconds.
        #[arg(long)]
        quick: bool,
        /// Prints set-up, metric and source of each row too.
        #[arg(long)]
        explain: bool,
    },
    /// Sweeps models, scalars, steps, substeps and iterations over the scenes, and draws error
    /// against cost. What was measured is kept: interrupted, it goes on where it was.
    Trade {
        /// Where points, charts and report go.
        #[arg(long, default_value = "target/trade")]
        out: PathBuf,
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
    /// Says which model suits a scene: the cheapest that is right enough, the most exact that is
    /// cheap enough, or, asked for neither, those that no other one beats in both.
    Advise {
        /// A scene in RON (see `crates/taw_lab/scenes`).
        scene: PathBuf,
        /// How wrong places may be: 1mm.
        #[arg(long, value_parser = length)]
        max_error: Option<f64>,
        /// How long a step may take: 2ms.
        #[arg(long, value_parser = duration)]
        budget: Option<f64>,
        /// The step of the game.
        #[arg(long, value_parser = duration, default_value = "16.666667ms")]
        step: f64,
    },
    /// Joins the parts of a sweep into one report.
    Merge {
        /// Where points, charts and report go.
        #[arg(long, default_value = "target/trade")]
        out: PathBuf,
        /// The parts: `points-K-of-N.jsonl`.
        #[arg(required = true)]
        files: Vec<PathBuf>,
    },
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
        Command::Suite { filter, quick, explain } => Ok(run_suite(&filter, quick, explain)),
        Command::Trade { out, quick, scene, model, shard, with } => {
            trade(&out, &Plan { quick, scene, model }, shard, &with)
        }
        Command::Advise { scene, max_error: most, budget, step } => {
            print_advice(&scene, Wish { most, budget, step })
        }
        Command::Merge { out, files } => merge(&out, &files),
    };
    outcome.unwrap_or_else(|error| {
        eprintln!("{error}");
        ExitCode::FAILURE
    })
}

fn trade(
    out: &Path,
    plan: &Plan,
    shard: Option<[usize; 2]>,
    with: &[PathBuf],
) -> Result<ExitCode, Box<dyn Error>> {
    std::fs::create_dir_all(out)?;
    let file = match shard {
        None => out.join("points.jsonl"),
        Some([number, of]) => out.join(format!("points-{number}-of-{of}.jsonl")),
    };
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
    report(out, points)
}

fn print_advice(file: &Path, wish: Wish) -> Result<ExitCode, Box<dyn Error>> {
    let name = file.display();
    let text = std::fs::read_to_string(file).map_err(|error| format!("{name}: {error}"))?;
    let scene = read_scene(&text).map_err(|error| format!("{name}:{error}"))?;
    let bar = ProgressBar::new(0);
    let advice = advise(&scene, wish, |done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    });
    bar.finish_and_clear();
    print!("{}", advice.text(&scene, wish));
    let asked = wish.most.is_some() || wish.budget.is_some();
    let found = !asked || advice.best(wish).is_some();
    Ok(if found { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn merge(out: &Path, files: &[PathBuf]) -> Result<ExitCode, Box<dyn Error>> {
    std::fs::create_dir_all(out)?;
    let mut points = Vec::new();
    for file in files {
        points.extend(read_points(file)?);
    }
    let points = in_order(points);
    write_points(&out.join("points.jsonl"), &points)?;
    report(out, points)
}

fn report(out: &Path, points: Vec<Point>) -> Result<ExitCode, Box<dyn Error>> {
    let points = in_order(points);
    write_report(&points, out)?;
    println!("{} points; see {}", points.len(), out.join("report.md").display());
    Ok(ExitCode::SUCCESS)
}

fn run_suite(filter: &str, quick: bool, explain: bool) -> ExitCode {
    let chosen = suite::rows()
        .filter(|row| row.name.contains(filter) || row.model.contains(filter))
        .filter(|row| !quick || row.effort == Effort::Quick);
    println!(
        "| row | model | figure | target | | best of today's engines | ns per ball and step |"
    );
    println!("|---|---|---|---|---|---|---|");
    let (mut reached, mut count) = (0, 0);
    for row in chosen {
        let outcome = row.run();
        count += 1;
        reached += u32::from(outcome.reached);
        let verdict = if outcome.reached { "reached" } else { "**missed**" };
        let (figure, cost) = (outcome.figure, outcome.cost);
        let suite::Row { name, model, target, best, .. } = row;
        println!(
            "| {name} | {model} | {figure:.2e} | {target:.0e} | {verdict} | {best} | {cost:.0} |"
        );
        if explain {
            println!(
                "| | {} | {} | | | {} | {:.1} s |",
                row.setup, row.metric, row.source, outcome.seconds
            );
        }
    }
    println!("\n{reached} of {count} rows reached");
    if reached == count { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
