//! Cost of a swarm: `cargo bench -p taw --bench swarm`, or with `-- 1000000` those of a
//! million alone; with `-- stages` what each stage of a step takes.
//!
//! The scene is the one that the race in `peers/` begins with: balls with radii in [0.3, 0.5] m
//! and density 1, dropped into a box from a lattice of twelve layers; 60 Hz, no sleep, on one
//! thread and on two. While they fall and meet, and when they have settled for four seconds.

use std::time::{Duration, Instant};

use divan::Bencher;
use divan::counter::ItemsCount;
use taw::prelude::*;
use taw::swarm::{Ball, BallId, Stage, SwarmModel, Tier};

const DT: f32 = 1.0 / 60.0;
const COUNTS: [usize; 4] = [1_000, 10_000, 100_000, 1_000_000];

fn main() {
    if std::env::args().any(|word| word == "stages") {
        stages();
    } else {
        divan::main();
    }
}

/// Prints the mean milliseconds of each stage over steps 181 to 240.
fn stages() {
    const STAGES: [Stage; 5] =
        [Stage::Integrate, Stage::Order, Stage::Pairs, Stage::Walls, Stage::Restitute];
    println!(
        "| tier | balls | {} | a step |",
        STAGES.map(|stage| format!("{stage:?}")).join(" | ")
    );
    println!("|---|---|---|---|---|---|---|---|");
    for tier in [Tier::Full, Tier::Lab] {
        for count in COUNTS {
            let mut world = world(count, tier, 2);
            let mut taken = [Duration::ZERO; STAGES.len()];
            for step in 0..240 {
                let (mut stage, mut begun) = (None, Instant::now());
                let mut end = |next: Option<Stage>| {
                    let place = STAGES.iter().position(|known| Some(*known) == stage);
                    if let Some(place) = place
                        && step >= 180
                    {
                        taken[place] += begun.elapsed();
                    }
                    (stage, begun) = (next, Instant::now());
                };
                world.step_swarm(DT, &mut |stage| end(Some(stage))).expect("a step");
                end(None);
            }
            let ms = |time: Duration| format!("{:.3}", time.as_secs_f64() * 1e3 / 60.0);
            let all = taken.iter().sum();
            println!("| {tier:?} | {count} | {} | {} |", taken.map(ms).join(" | "), ms(all));
        }
    }
}

fn balls(count: usize, radius: impl Fn(f32) -> f32) -> (Vec<Ball>, f32) {
    let side = (count as f32 / 12.0).sqrt().ceil() as usize;
    let half = side as f32 * 1.05 / 2.0;
    let ball = |i: usize| {
        // The fractional parts of multiples of the golden ratio spread evenly.
        let random = |n: usize| ((i * 3 + n) as f64 * 0.618_033_988_75).fract() as f32;
        let at = |cell: usize| (cell as f32 + 0.5) * 1.05;
        let aside = |n: usize| (random(n) - 0.5) * 0.04;
        let (x, z) = (at(i % side) - half + aside(1), at(i / side % side) - half + aside(2));
        let position = Point3::new(x, at(i / side / side), z);
        Ball { mass: Mass::Density(1.0), ..Ball::new(position, radius(random(0))) }
    };
    ((0..count).map(ball).collect(), half)
}

/// Evenly from 0.3 to 0.5 m.
fn alike(random: f32) -> f32 {
    0.3 + 0.2 * random
}

fn world(count: usize, tier: Tier, threads: u32) -> World<f32> {
    world_of(balls(count, alike), tier, threads)
}

fn world_of((balls, half): (Vec<Ball>, f32), tier: Tier, threads: u32) -> World<f32> {
    let mut world = World::default();
    for (direction, offset) in [
        (Vec3::unit_y(), 0.0),
        (Vec3::unit_x(), -half),
        (-Vec3::unit_x(), -half),
        (Vec3::unit_z(), -half),
        (-Vec3::unit_z(), -half),
    ] {
        let wall = Plane::new(direction, offset).expect("a unit vector");
        world.walls.insert(wall).expect("few walls");
    }
    let material = Material { friction: 0.3, restitution: 0.2, ..Material::default() };
    let substeps = if tier == Tier::Lab { 1 } else { 2 };
    let model = SwarmModel { tier, substeps, threads, material, sleeps: false };
    world.swarm.set_model(model).expect("a model");
    world.swarm.insert(&balls).expect("balls");
    world
}

/// As many marbles in the same box, which never sleep.
fn marbles(count: usize, response: Response, threads: u32) -> World<f32> {
    let (balls, half) = balls(count, alike);
    let mut world = world_of((Vec::new(), half), Tier::Full, threads);
    let model = Model {
        response,
        rotation: Rotation::Dynamic,
        substeps: if response == Response::SoftStep { 2 } else { 1 },
        ..Model::default()
    };
    world.set_model(model).expect("a model");
    for Ball { position, radius, mass, .. } in balls {
        let material = Some(world.swarm.model().material);
        let marble = taw::world::Marble { mass, material, ..Marble::new(position, radius) };
        world.marbles.insert(marble).expect("a marble");
    }
    world
}

fn bench_marbles(bencher: Bencher, mut world: World<f32>) {
    for _ in 0..180 {
        world.step(DT).expect("a step");
    }
    let count = ItemsCount::new(world.marbles.len());
    bencher.counter(count).bench_local(|| world.step(DT).expect("a step"));
}

#[divan::bench(args = [20, 1_000, 10_000, 100_000], sample_count = 30, sample_size = 1)]
fn marbles_soft_step(bencher: Bencher, count: usize) {
    bench_marbles(bencher, marbles(count, Response::SoftStep, 2));
}

#[divan::bench(args = [20, 1_000, 10_000, 100_000], sample_count = 30, sample_size = 1)]
fn marbles_soft_step_one_thread(bencher: Bencher, count: usize) {
    bench_marbles(bencher, marbles(count, Response::SoftStep, 1));
}

#[divan::bench(args = [20, 1_000, 10_000], sample_count = 30, sample_size = 1)]
fn marbles_impulse(bencher: Bencher, count: usize) {
    bench_marbles(bencher, marbles(count, Response::Impulse, 1));
}

/// Goes on from step to step: the mean over some steps is what they cost, also that some of
/// them seek pairs anew and others do not.
fn bench(bencher: Bencher, count: usize, tier: Tier, threads: u32, after: u32) {
    let mut world = world(count, tier, threads);
    for _ in 0..after {
        world.step(DT).expect("a step");
    }
    bencher.counter(ItemsCount::new(count)).bench_local(|| world.step(DT).expect("a step"));
}

#[divan::bench(args = COUNTS, sample_count = 30, sample_size = 1)]
fn lab_settled(bencher: Bencher, count: usize) {
    bench(bencher, count, Tier::Lab, 2, 180);
}

#[divan::bench(args = COUNTS, sample_count = 30, sample_size = 1)]
fn lab_settled_one_thread(bencher: Bencher, count: usize) {
    bench(bencher, count, Tier::Lab, 1, 180);
}

#[divan::bench(args = COUNTS, sample_count = 30, sample_size = 1)]
fn lab_moving(bencher: Bencher, count: usize) {
    bench(bencher, count, Tier::Lab, 2, 60);
}

#[divan::bench(args = COUNTS, sample_count = 30, sample_size = 1)]
fn full_settled(bencher: Bencher, count: usize) {
    bench(bencher, count, Tier::Full, 2, 180);
}

#[divan::bench(args = COUNTS, sample_count = 30, sample_size = 1)]
fn full_settled_one_thread(bencher: Bencher, count: usize) {
    bench(bencher, count, Tier::Full, 1, 180);
}

#[divan::bench(args = COUNTS, sample_count = 30, sample_size = 1)]
fn full_moving(bencher: Bencher, count: usize) {
    bench(bencher, count, Tier::Full, 2, 60);
}

/// As many steps later, for each contact: balls that are near each other or near a wall.
fn per_contact(bencher: Bencher, mut world: World<f32>) {
    for _ in 0..300 {
        world.step(DT).expect("a step");
    }
    let contacts = ItemsCount::new(world.swarm.pairs() + world.swarm.near_walls());
    bencher.counter(contacts).bench_local(|| world.step(DT).expect("a step"));
}

/// Items are contacts here, to be compared with those of the next one.
#[divan::bench(sample_count = 60, sample_size = 1)]
fn contacts_of_sizes_alike(bencher: Bencher) {
    per_contact(bencher, world(100_000, Tier::Full, 2));
}

/// Radii from 0.005 to 0.5 m, as many in each octave.
#[divan::bench(sample_count = 60, sample_size = 1)]
fn contacts_of_sizes_one_to_a_hundred(bencher: Bencher) {
    let mixed = balls(100_000, |random| 0.005 * 100_f32.powf(random));
    per_contact(bencher, world_of(mixed, Tier::Full, 2));
}

/// In one call.
#[divan::bench(args = COUNTS, sample_count = 5, sample_size = 1)]
fn insert(bencher: Bencher, count: usize) {
    let (balls, _) = balls(count, alike);
    bencher.counter(ItemsCount::new(count)).with_inputs(World::<f32>::default).bench_local_refs(
        |world| {
            world.swarm.insert(&balls).expect("balls");
        },
    );
}

/// Every other one, in one call, after ten steps.
#[divan::bench(args = COUNTS, sample_count = 5, sample_size = 1)]
fn remove_half(bencher: Bencher, count: usize) {
    let mut world = world(count, Tier::Full, 2);
    for _ in 0..10 {
        world.step(DT).expect("a step");
    }
    let half: Vec<BallId> = (0..count).step_by(2).filter_map(|row| world.swarm.id(row)).collect();
    bencher
        .counter(ItemsCount::new(count / 2))
        .with_inputs(|| world.clone())
        .bench_local_refs(|world| world.swarm.remove(&half).expect("they are there"));
}

/// Balls on a floor, each by itself, a second and a half later. Of so many, one rolls.
fn lying(count: usize, rolls: usize) -> World<f32> {
    let mut world = World::<f32>::default();
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).expect("a unit vector")).expect("a wall");
    let side = (count as f32).sqrt().ceil() as usize;
    let at = |i: usize| i as f32 * 1.1;
    let ball = |i: usize| {
        let velocity = if i % rolls == rolls - 1 { 1.0 } else { 0.0 };
        let ball = Ball::new(Point3::new(at(i % side), 0.5, at(i / side)), 0.5);
        Ball { velocity: Vec3::new(velocity, 0.0, 0.1 * velocity), ..ball }
    };
    world.swarm.insert(&(0..count).map(ball).collect::<Vec<_>>()).expect("balls");
    for _ in 0..90 {
        world.step(DT).expect("a step");
    }
    world
}

/// All asleep.
#[divan::bench(args = COUNTS, sample_count = 30, sample_size = 1)]
fn asleep(bencher: Bencher, count: usize) {
    let mut world = lying(count, usize::MAX);
    assert_eq!(world.swarm.asleep(), count);
    bencher.counter(ItemsCount::new(count)).bench_local(|| world.step(DT).expect("a step"));
}

/// All but one in 500 asleep, which roll among the others.
#[divan::bench(args = COUNTS, sample_count = 30, sample_size = 1)]
fn few_roll(bencher: Bencher, count: usize) {
    let mut world = lying(count, 500);
    bencher.counter(ItemsCount::new(count)).bench_local(|| world.step(DT).expect("a step"));
}
