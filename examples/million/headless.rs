//! The example without a window: a table of what the steps cost.

use std::time::{Duration, Instant};

use bevy::app::AppExit;
use taw::prelude::*;
use taw::swarm::Stage;

use crate::Options;
use crate::scene::half_side;

const STAGES: [Stage; 5] =
    [Stage::Integrate, Stage::Order, Stage::Pairs, Stage::Walls, Stage::Restitute];

pub fn run(options: &Options) -> AppExit {
    match pour(options) {
        Ok(()) => AppExit::Success,
        Err(error) => {
            eprintln!("{error}");
            AppExit::error()
        }
    }
}

fn pour(options: &Options) -> Result<(), taw::Error> {
    let mut world = World::<f32>::default();
    let half = half_side(options.marbles);
    for (normal, offset) in [
        (Vec3::unit_y(), 0.0),
        (Vec3::unit_x(), -half),
        (-Vec3::unit_x(), -half),
        (Vec3::unit_z(), -half),
        (-Vec3::unit_z(), -half),
    ] {
        world.walls.insert(Plane::new(normal, offset)?)?;
    }
    world.swarm.set_model(options.model())?;
    let began = Instant::now();
    let marbles = crate::scene::marbles(options.marbles);
    let balls: Vec<_> = marbles.coming().iter().map(|ball| (*ball).into()).collect();
    world.swarm.insert(&balls)?;
    let inserted = began.elapsed();
    println!(
        "{} marbles, {:?} tier, {} substeps, {} threads; made and put in within {} ms",
        options.marbles,
        options.model().tier,
        options.model().substeps,
        options.model().threads_for(options.marbles as usize),
        inserted.as_millis()
    );
    run_and_report(&mut world, options.steps)
}

/// Steps the swarm and prints a line for every 60 steps.
fn run_and_report(world: &mut World<f32>, steps: u32) -> Result<(), taw::Error> {
    println!(
        "| steps | ms a step, median | mean | integrate | order | pairs | walls | restitute | ns a marble | sought anew | asleep | bytes a marble |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    let mut times = Vec::new();
    let mut stages = [Duration::ZERO; STAGES.len()];
    let mut rebuilds = world.swarm.rebuilds();
    for step in 1..=steps {
        let mut last: Option<(Stage, Instant)> = None;
        let began = Instant::now();
        world.step_swarm(1.0 / 60.0, &mut |stage| {
            let now = Instant::now();
            add(&mut stages, last.replace((stage, now)), now);
        })?;
        add(&mut stages, last, Instant::now());
        times.push(began.elapsed());
        if step % 60 == 0 || step == steps {
            times.sort_unstable();
            let ms = |time: Duration| time.as_secs_f64() * 1e3;
            let median = ms(times[times.len() / 2]);
            let count = times.len() as u32;
            let mean = ms(times.iter().sum::<Duration>() / count);
            let parts: Vec<_> =
                stages.iter().map(|stage| format!("{:.2}", ms(*stage / count))).collect();
            println!(
                "| {}–{step} | {median:.2} | {mean:.2} | {} | {:.0} | {} | {} | {} |",
                step - count + 1,
                parts.join(" | "),
                mean * 1e6 / world.swarm.len() as f64,
                world.swarm.rebuilds() - rebuilds,
                world.swarm.asleep(),
                world.swarm.bytes() / world.swarm.len(),
            );
            rebuilds = world.swarm.rebuilds();
            times.clear();
            stages = [Duration::ZERO; STAGES.len()];
        }
    }
    Ok(())
}

fn add(stages: &mut [Duration], last: Option<(Stage, Instant)>, now: Instant) {
    if let Some((stage, since)) = last
        && let Some(at) = STAGES.iter().position(|other| *other == stage)
    {
        stages[at] += now - since;
    }
}
