//! `taw-lab`: what every choice costs and buys.

use clap::{Parser, Subcommand};
use taw_lab::suite::{self, Effort};

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
}

fn main() -> std::process::ExitCode {
    let Command::Suite { filter, quick, explain } = Options::parse().command;
    let chosen = suite::rows()
        .filter(|row| row.name.contains(&filter) || row.model.contains(&filter))
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
    if reached == count { std::process::ExitCode::SUCCESS } else { std::process::ExitCode::FAILURE }
}
