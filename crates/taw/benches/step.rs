//! Cost of a step: `cargo bench -p taw`.
//!
//! Marbles with radii in [0.2, 0.6] m in a box of planes, as in the demo: while
//! they fall, and when they lie in a heap. The whole step, and each verb by itself, by
//! the default model unless it says otherwise; 60 Hz, one substep. Add `--profile dev` for the figures of `cargo run --example
//! marble_madness`, whose profile optimises this crate too.

use divan::Bencher;
use divan::counter::ItemsCount;
use taw::math::Quat;
use taw::motion::WallMotion;
use taw::prelude::*;
use taw::swarm::SwarmModel;

const DT: f32 = 1.0 / 60.0;
const COUNTS: [u32; 3] = [100, 1_000, 10_000];

fn main() {
    divan::main();
}

/// Marbles on a lattice, each well inside its cell, over a box that fits it. None sleeps.
fn falling(count: u32) -> World<f32> {
    let mut world = World::default();
    let model = SwarmModel { sleeps: false, ..SwarmModel::default() };
    world.swarm.set_model(model).expect("a model");
    let side = f64::from(count / 5).sqrt().ceil() as u32;
    let half = side as f32 * 1.3 / 2.0;
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
    for i in 0..count {
        // The fractional parts of multiples of the golden ratio spread evenly.
        let random = |n: u32| (i * 3 + n) as f32 * 0.618_034 % 1.0;
        let at = |cell: u32, n: u32| (cell as f32 + 0.5) * 1.3 - half + (random(n) - 0.5) * 0.1;
        let layer = i / (side * side);
        let position =
            Point3::new(at(i % side, 0), 1.0 + layer as f32 * 1.3, at(i / side % side, 1));
        world.marbles.insert(Marble::new(position, 0.2 + 0.4 * random(2))).expect("a marble");
    }
    world
}

/// That heap after ten seconds by this model.
fn settled_by(model: Model, count: u32) -> World<f32> {
    let mut world = falling(count);
    world.set_model(model).expect("a model");
    for _ in 0..600 {
        world.step(DT).expect("a step");
    }
    world
}

/// That heap after ten seconds by the default model.
fn settled(count: u32) -> World<f32> {
    settled_by(Model::default(), count)
}

fn bench(bencher: Bencher, world: World<f32>, run: impl Fn(&mut World<f32>) + Sync) {
    bencher
        .counter(ItemsCount::new(world.marbles.len()))
        .with_inputs(|| world.clone())
        .bench_local_refs(run);
}

fn step(world: &mut World<f32>) {
    world.step(DT).expect("a step");
}

#[divan::bench(args = COUNTS)]
fn step_falling(bencher: Bencher, count: u32) {
    bench(bencher, falling(count), step);
}

#[divan::bench(args = COUNTS)]
fn step_settled(bencher: Bencher, count: u32) {
    bench(bencher, settled(count), step);
}

/// With masses, friction and spin.
#[divan::bench(args = COUNTS)]
fn step_settled_impulse(bencher: Bencher, count: u32) {
    let (response, rotation) = (Response::Impulse, Rotation::Dynamic);
    let model = Model { response, rotation, ..Model::default() };
    bench(bencher, settled_by(model, count), step);
}

/// That heap asleep.
#[divan::bench(args = COUNTS)]
fn step_asleep_impulse(bencher: Bencher, count: u32) {
    let (response, rotation) = (Response::Impulse, Rotation::Dynamic);
    let mut world = settled_by(Model { response, rotation, ..Model::default() }, count);
    world.swarm.set_model(SwarmModel::default()).expect("a model");
    let ids: Vec<_> = (0..count as usize).filter_map(|row| world.marbles.id(row)).collect();
    for _ in 0..3_000 {
        if ids.iter().all(|id| world.is_asleep(*id) == Ok(true)) {
            break;
        }
        world.step(DT).expect("a step");
    }
    assert!(ids.iter().all(|id| world.is_asleep(*id) == Ok(true)), "it does not come to rest");
    bench(bencher, world, step);
}

/// That heap, event by event.
#[divan::bench(args = [100, 1_000])]
fn step_settled_event_driven(bencher: Bencher, count: u32) {
    let (response, rotation) = (Response::Impulse, Rotation::Dynamic);
    let model = Model { response, rotation, ..Model::default() };
    let mut world = settled_by(model, count);
    let precision = Precision::Compensated;
    let exact = Model { response: Response::EventDriven, precision, iterations: 64, ..model };
    world.set_model(exact).expect("a model");
    for _ in 0..120 {
        world.step(DT).expect("a step");
    }
    bench(bencher, world, step);
}

/// A second in which a board tilts to and fro, and the marbles on it crowd at its rails:
/// sixty steps, event by event.
#[divan::bench(args = [60, 150], sample_count = 20)]
fn second_on_a_board_event_driven(bencher: Bencher, count: u32) {
    const FACES: [([f32; 3], f32); 5] = [
        ([0.0, 1.0, 0.0], 0.0),
        ([1.0, 0.0, 0.0], -5.0),
        ([-1.0, 0.0, 0.0], -5.0),
        ([0.0, 0.0, 1.0], -5.0),
        ([0.0, 0.0, -1.0], -5.0),
    ];
    let turned = |step: u16| {
        let seconds = f32::from(step) * DT;
        let about = |axis, speed: f32| {
            Quat::from_axis_angle(axis, cgmath::Rad((speed * seconds).sin() * 0.26))
        };
        about(Vec3::unit_x(), 0.7) * about(Vec3::unit_z(), 1.1)
    };
    let mut world = World::default();
    let model = Model {
        response: Response::EventDriven,
        rotation: Rotation::Dynamic,
        iterations: 50,
        ..Model::default()
    };
    world.set_model(model).expect("a model");
    let walls = FACES.map(|(normal, offset)| {
        let plane = Plane::new(Vec3::from(normal), offset).expect("a unit vector");
        world.walls.insert(plane).expect("few walls")
    });
    for i in 0..count {
        let random = |n: u32| (i * 3 + n) as f32 * 0.618_034 % 1.0;
        let at = |cell: u32| cell as f32 * 0.9 - 4.0;
        let height = 0.5 + (i / 100) as f32 * 0.7 + random(0);
        let position = Point3::new(at(i % 10), height, at(i / 10 % 10));
        world.marbles.insert(Marble::new(position, 0.1 + 0.2 * random(2))).expect("a marble");
    }
    let run = |world: &mut World<f32>, from: u16, to: u16| {
        for step in from..to {
            let (before, after) = (turned(step), turned(step + 1));
            let spin = (after * before.conjugate()).v * (2.0 / DT);
            let pivot = Point3::origin();
            let motion = WallMotion { velocity: Vec3::zero(), angular_velocity: spin, pivot };
            for (wall, (normal, offset)) in walls.iter().zip(FACES) {
                let normal = (after * Vec3::from(normal)).normalize();
                let plane = Plane::new(normal, offset).expect("a unit vector");
                world.walls.set(*wall, plane).expect("a wall");
                world.walls.set_motion(*wall, Some(motion)).expect("a wall");
            }
            world.step(DT).expect("a step");
        }
    };
    run(&mut world, 0, 120);
    bench(bencher, world, |world| run(world, 120, 180));
}

#[divan::bench(args = COUNTS)]
fn verb_1_integrate(bencher: Bencher, count: u32) {
    bench(bencher, settled(count), |world| world.integrate(DT).expect("a step"));
}

#[divan::bench(args = COUNTS)]
fn verb_2_generate_contacts(bencher: Bencher, count: u32) {
    bench(bencher, settled(count), World::generate_contacts);
}

#[divan::bench(args = COUNTS)]
fn verb_3_restitute(bencher: Bencher, count: u32) {
    let mut world = settled(count);
    world.integrate(DT).expect("a step");
    world.generate_contacts();
    bench(bencher, world, |world| world.restitute(DT).expect("a step"));
}
