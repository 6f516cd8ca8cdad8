//! Heaps of balls in taw, Box3D, Rapier and Avian: time of a step, overlap, motion.
//!
//! `cargo run --release --bin race` in this folder. Arguments: beginnings of the names of scenes and
//! of engines (`pour`, `taw`); `--million` adds a million balls in taw; `--csv FILE` also writes the
//! table there. "Bevy alone" is an app in which a system marks the transforms of awake balls as changed: what it
//! takes is no part of the physics. Two threads, f32, 60 Hz, nothing sleeps except in the scene of that name; means of
//! the last 60 of 240 steps, and of steps 61 to 120, in which most still moves.

mod avian;
mod box3d;
mod entities;
mod rapier;
mod scene;
mod taw;

use std::fmt::Write as _;
use std::time::{Duration, Instant};

use ::taw::response::Response;
use ::taw::swarm::Tier;
use bevy::math::{Quat, Vec3};

use crate::scene::Scene;

const DT: f32 = 1.0 / 60.0;
const MEASURED: u32 = 60;
const THREADS: usize = 2;
/// taw takes as many threads as pay: of a larger machine, give it two (`taskset -c 0,1`).
const AUTOMATIC: usize = 0;
const FRICTION: f32 = 0.3;
const RESTITUTION: f32 = 0.2;

trait Engine {
    /// A step at whose end the frame is turned so.
    fn step(&mut self, from: Quat, to: Quat);
    /// Centers and velocities, in the order of the scene.
    fn state(&self) -> Vec<[Vec3; 2]>;
}

/// Means over the measured steps, and how things are at the end.
struct Outcome {
    ms: f64,
    early_ms: f64,
    deepest: f32,
    mean: f64,
    kinetic: f64,
}

fn run(scene: &Scene, mut engine: Box<dyn Engine>) -> Outcome {
    let (mut time, mut early) = (Duration::ZERO, Duration::ZERO);
    for step in 0..scene.steps {
        let at = |step: u32| (scene.turn)(step as f32 * DT);
        let (from, to) = (at(step), at(step + 1));
        let began = Instant::now();
        engine.step(from, to);
        if step >= scene.steps - MEASURED {
            time += began.elapsed();
        } else if (MEASURED..2 * MEASURED).contains(&step) {
            early += began.elapsed();
        }
    }
    let state = engine.state();
    let radius: Vec<f32> = scene.balls.iter().map(|ball| ball.1).collect();
    let at: Vec<_> =
        state.iter().map(|[at, _]| ::taw::math::Point3::new(at.x, at.y, at.z)).collect();
    let mut grid = ::taw::broad::Grid::default();
    grid.rebuild(&at, &radius, 0.0);
    let (mut deepest, mut sum, mut count) = (0.0_f32, 0.0, 0_u32);
    grid.pairs(&at, |a, b| {
        let (a, b) = (a as usize, b as usize);
        let overlap = radius[a] + radius[b] - state[a][0].distance(state[b][0]);
        if overlap > 0.0 {
            deepest = deepest.max(overlap);
            sum += f64::from(overlap);
            count += 1;
        }
    });
    let mass = |r: &f32| 4.0 / 3.0 * std::f64::consts::PI * f64::from(*r).powi(3);
    let energy =
        state.iter().zip(&radius).map(|([_, v], r)| 0.5 * mass(r) * f64::from(v.length_squared()));
    let ms = |time: Duration| time.as_secs_f64() * 1e3 / f64::from(MEASURED);
    Outcome {
        ms: ms(time),
        early_ms: ms(early),
        deepest,
        mean: sum / f64::from(count.max(1)),
        kinetic: energy.sum::<f64>() / state.len() as f64,
    }
}

/// An engine by name, the largest scene that it runs, and how it is made.
type Entry = (&'static str, usize, fn(&Scene) -> Box<dyn Engine>);

/// Rapier first: the others are compared with it.
const ENGINES: [Entry; 13] = [
    ("Rapier 0.36.1", 100_000, |scene| Box::new(rapier::Rapier::new(scene))),
    ("Box3D (boxddd 0.4.0)", 100_000, |scene| Box::new(box3d::Box3d::new(scene).expect("a world"))),
    ("Avian 0.7.0", 10_000, |scene| Box::new(avian::Avian::new(scene))),
    ("Bevy alone", 100_000, |scene| Box::new(entities::Bevy::new(scene))),
    ("taw entities in Bevy, SoftStep", 100_000, |scene| Box::new(entities::Entities::new(scene))),
    ("taw marbles, SoftStep", 100_000, |scene| marbles(scene, Response::SoftStep, AUTOMATIC)),
    ("taw marbles, SoftStep, one thread", 100_000, |scene| marbles(scene, Response::SoftStep, 1)),
    ("taw marbles, Impulse", 10_000, |scene| marbles(scene, Response::Impulse, AUTOMATIC)),
    ("taw marbles, EventDriven", 1_000, |scene| marbles(scene, Response::EventDriven, AUTOMATIC)),
    ("taw swarm, full", 1_000_000, |scene| swarm(scene, Tier::Full, AUTOMATIC)),
    ("taw swarm, full, one thread", 1_000_000, |scene| swarm(scene, Tier::Full, 1)),
    ("taw swarm, lab", 1_000_000, |scene| swarm(scene, Tier::Lab, AUTOMATIC)),
    ("taw swarm, lab, one thread", 1_000_000, |scene| swarm(scene, Tier::Lab, 1)),
];

fn marbles(scene: &Scene, response: Response, threads: usize) -> Box<dyn Engine> {
    Box::new(taw::Taw::marbles(scene, response, threads))
}

fn swarm(scene: &Scene, tier: Tier, threads: usize) -> Box<dyn Engine> {
    let substeps = if tier == Tier::Lab { 1 } else { 2 };
    Box::new(taw::Taw::swarm(scene, tier, substeps, threads))
}

const COLUMNS: [&str; 9] = [
    "scene, balls",
    "engine",
    "ms a step while most moves",
    "ms a step",
    "ns a ball",
    "times as fast as Rapier",
    "deepest overlap, m",
    "mean, m",
    "kinetic energy a ball, J",
];

fn cells(scene: &Scene, name: &str, result: &Outcome, rapier: Option<f64>) -> [String; 9] {
    let balls = scene.balls.len();
    [
        format!("{} {balls}", scene.name),
        name.into(),
        format!("{:.3}", result.early_ms),
        format!("{:.3}", result.ms),
        format!("{:.0}", result.ms * 1e6 / balls as f64),
        rapier.map_or("–".into(), |rapier| format!("{:.1}", rapier / result.ms)),
        format!("{:.4}", result.deepest),
        format!("{:.5}", result.mean),
        format!("{:.1e}", result.kinetic),
    ]
}

fn main() -> std::io::Result<()> {
    rayon::ThreadPoolBuilder::new().num_threads(THREADS).build_global().expect("once");
    let mut arguments: Vec<_> = std::env::args().skip(1).collect();
    let csv = arguments.iter().position(|word| word == "--csv");
    let csv = csv.map(|at| arguments.drain(at..(at + 2).min(arguments.len())).last());
    let million = arguments.iter().any(|word| word == "--million");
    arguments.retain(|word| !word.starts_with("--"));
    let counts: &[usize] = &[1_000, 10_000, 100_000, 1_000_000];
    let mut scenes: Vec<_> =
        counts[..if million { 4 } else { 3 }].iter().map(|n| scene::pour(*n)).collect();
    scenes.extend([scene::few(), scene::asleep(), scene::drum(), scene::hopper(), scene::board()]);
    let among = |known: Vec<&str>, name: &str| {
        let wanted = |word: &&String| known.iter().any(|known| known.starts_with(word.as_str()));
        let mut some = arguments.iter().filter(wanted).peekable();
        some.peek().is_none() || some.any(|word| name.starts_with(word.as_str()))
    };
    let scene_names: Vec<_> = scenes.iter().map(|scene| scene.name).collect();
    let engine_names: Vec<_> = ENGINES.iter().map(|engine| engine.0).collect();
    println!("| {} |\n|{}", COLUMNS.join(" | "), "---|".repeat(COLUMNS.len()));
    let mut table = COLUMNS.map(|name| name.replace(", ", " ")).join(",") + "\n";
    for scene in scenes.iter().filter(|scene| among(scene_names.clone(), scene.name)) {
        let mut rapier = None;
        for (name, most, new) in ENGINES {
            let runs = !scene.sleeps || ["taw", "Bevy"].iter().any(|taw| name.starts_with(taw));
            if scene.balls.len() > most || !runs || !among(engine_names.clone(), name) {
                continue;
            }
            let result = run(scene, new(scene));
            rapier = rapier.or(name.starts_with("Rapier").then_some(result.ms));
            let cells = cells(scene, name, &result, rapier);
            println!("| {} |", cells.join(" | "));
            let _ = writeln!(table, "{}", cells.map(|cell| cell.replace(", ", " ")).join(","));
        }
    }
    match csv.flatten() {
        Some(file) => std::fs::write(file, table),
        None => Ok(()),
    }
}
