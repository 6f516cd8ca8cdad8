//! **A million marbles**: poured into a box that you tilt.
//!
//! `cargo run --release --example million` (`-- --help` for options)
//!
//! Tilt with the arrow keys or WASD, turn the view with the right mouse button, Space pours
//! anew. What to look at: the panel says what a step costs and where the time goes; two thousand
//! marbles and two million differ in nothing else.
//!
//! Tilting turns gravity about the box and not the box: at its far end, a box of a million would
//! move by 20 m.

mod headless;
mod panel;
mod scene;

use bevy::diagnostic::FrameTimeDiagnosticsPlugin;
use bevy::prelude::*;
use bevy_egui::EguiPlugin;
use bevy_taw::prelude::*;
use clap::Parser;
use taw_examples::{ExamplePlugins, OrbitCameraPlugin, Picture};

/// A million marbles in a box that you tilt
#[derive(Parser, Resource, Clone)]
#[command(version)]
pub struct Options {
    /// Number of marbles
    #[arg(long, default_value_t = 1_000_000, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=2_000_000))]
    marbles: u32,
    /// Physics: "lab" (lines and displacement) or "full" (friction, bounce, spin)
    #[arg(long, default_value = "full", value_name = "TIER", value_parser = ["lab", "full"])]
    tier: String,
    /// Into how many parts a step is cut; 1 for lab and 2 for full if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100))]
    substeps: Option<u32>,
    /// Number of threads; as many as pay if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=64))]
    threads: Option<u32>,
    /// No window: prints what the steps cost
    #[arg(long)]
    headless: bool,
    /// Number of steps of 1/60 s without a window
    #[arg(long, default_value_t = 300, value_name = "N")]
    steps: u32,
    /// Number of steps before the first frame, as for a picture
    #[arg(long, default_value_t = 0, value_name = "N")]
    poured: u32,
    #[command(flatten)]
    picture: Picture,
}

impl Options {
    fn model(&self) -> SwarmModel {
        let tier = if self.tier == "lab" { Tier::Lab } else { Tier::Full };
        let usual = SwarmModel::default();
        SwarmModel {
            tier,
            substeps: self.substeps.unwrap_or(if tier == Tier::Lab { 1 } else { 2 }),
            threads: self.threads.unwrap_or(usual.threads),
            material: bevy_taw::taw::prelude::Material {
                friction: 0.3,
                restitution: 0.2,
                ..usual.material
            },
            ..usual
        }
    }
}

fn main() -> AppExit {
    let options = Options::parse();
    if options.headless {
        return headless::run(&options);
    }
    App::new()
        .add_plugins(ExamplePlugins {
            title: "A million marbles",
            picture: options.picture.clone(),
        })
        .add_plugins((EguiPlugin::default(), OrbitCameraPlugin, TawPlugins))
        .add_plugins(FrameTimeDiagnosticsPlugin::default())
        .insert_resource(TawSwarmModel(options.model()))
        .insert_resource(options)
        .add_plugins((scene::plugin, panel::plugin))
        .run()
}
