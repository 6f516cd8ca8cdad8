//! **Marble Madness**: tilt the board and roll every marble onto the pad of its
//! colour.
//!
//! `cargo run --example marble_madness` (`-- --help` for options)
//!
//! Tilt with the arrow keys, WASD, a drag of the left mouse button or the left
//! stick; F1 lists all other keys. What to look at: the panel on the left changes
//! the physics while it runs, and shows what each choice costs.

mod board;
mod controls;
mod flick;
mod goals;
mod inspect;
mod level;
mod marbles;
mod panel;
mod time;

use std::path::PathBuf;

use bevy::prelude::*;
use bevy_egui::EguiPlugin;
use bevy_taw::prelude::*;
use bevy_taw::trade::TawTradePlugin;
use clap::{CommandFactory, Parser};
use level::Level;
use taw_examples::{ExamplePlugins, OrbitCameraPlugin, Picture};

/// Tilt the board and roll every marble onto the pad of its colour
#[derive(Parser, Resource, Clone)]
#[command(version)]
#[expect(clippy::struct_excessive_bools, reason = "switches are what a command line has")]
struct Options {
    /// Number of marbles to begin with
    #[arg(long, default_value_t = 120, value_name = "N")]
    marbles: u32,
    /// Seed of the random sizes, colours and places
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Draw contacts, normals, velocities and the grid
    #[arg(long)]
    gizmos: bool,
    /// The board sways by itself until somebody tilts it
    #[arg(long)]
    sway: bool,
    /// The board is made of boxes, over which marbles can fly
    #[arg(long)]
    boxes: bool,
    /// The marbles are capsules
    #[arg(long)]
    capsules: bool,
    /// Open the panel that shows what each model costs and buys, and measure after a second
    #[arg(long)]
    trade: bool,
    /// Open the window that shows a marble, the sensors and the layers
    #[arg(long)]
    inspect: bool,
    /// Play a scene in RON: one of assets/levels by its name (maze, mill), or a file
    #[arg(long, value_name = "FILE")]
    level: Option<PathBuf>,
    #[command(flatten)]
    picture: Picture,
}

fn main() -> AppExit {
    let options = Options::parse();
    let level = Level::read(options.level.as_deref()).unwrap_or_else(|error| {
        Options::command().error(clap::error::ErrorKind::ValueValidation, error).exit()
    });
    App::new()
        .add_plugins(ExamplePlugins { title: "Marble Madness", picture: options.picture.clone() })
        .add_plugins((EguiPlugin::default(), OrbitCameraPlugin, TawPlugins, TawTradePlugin))
        .insert_resource(options)
        .insert_resource(level)
        .add_plugins((
            board::plugin,
            controls::plugin,
            flick::plugin,
            goals::plugin,
            inspect::plugin,
            level::plugin,
            marbles::plugin,
            panel::plugin,
            time::plugin,
        ))
        .run()
}
