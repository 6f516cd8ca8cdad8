//! **Games**: six small ones, a file of some hundred lines each, to begin your own from.
//!
//! `cargo run --example games -- pachinko` (`run`, `pit`, `hero`, `sounds`, `pinball`; `--help` for
//! options)
//!
//! Each file is a plugin that needs no window: `tests/headless/games.rs` plays them.

mod hero;
mod pachinko;
mod paint;
mod pinball;
mod pit;
mod run;
mod sounds;

use bevy::prelude::*;
use bevy_egui::{EguiContexts, EguiPlugin, EguiPrimaryContextPass, egui};
use bevy_taw::prelude::*;
use clap::{Parser, ValueEnum};
use taw_examples::{ExamplePlugins, Picture};

#[derive(Parser)]
struct Options {
    /// Game to play
    #[arg(value_enum, default_value_t = Game::Pachinko)]
    game: Game,
    #[command(flatten)]
    picture: Picture,
}

#[derive(Clone, Copy, ValueEnum)]
enum Game {
    /// Marbles fall through pins into bins
    Pachinko,
    /// Marbles race down a track
    Run,
    /// A ball wades through thousands
    Pit,
    /// A ball that you roll: W, A, S, D and space
    Hero,
    /// Marbles rain on bars, and each bar has its note
    Sounds,
    /// Left and right arrow are the flippers
    Pinball,
}

fn main() -> AppExit {
    let Options { game, picture } = Options::parse();
    let mut app = App::new();
    app.add_plugins(ExamplePlugins { title: "Games", picture });
    app.add_plugins((EguiPlugin::default(), TawPlugins));
    match game {
        Game::Pachinko => app.add_plugins(pachinko::plugin),
        Game::Run => app.add_plugins(run::plugin),
        Game::Pit => app.add_plugins(pit::plugin),
        Game::Hero => app.add_plugins(hero::plugin),
        Game::Sounds => app.add_plugins(sounds::plugin),
        Game::Pinball => app.add_plugins(pinball::plugin),
    };
    app.add_systems(EguiPrimaryContextPass, show).run()
}

fn show(mut contexts: EguiContexts, said: Res<paint::Said>) -> Result {
    egui::Window::new("Score").default_pos([12.0, 12.0]).show(contexts.ctx_mut()?, |ui| {
        ui.label(egui::RichText::new(&said.0).size(18.0));
    });
    Ok(())
}
