//! Cost of a step with rigid bodies: `cargo bench -p taw --bench bodies`. `SoftStep`, 60 Hz, four substeps, one thread;
//! nothing sleeps.

use divan::Bencher;
use divan::counter::ItemsCount;
use taw::body::Body;
use taw::joint::{Joint, JointEnd, JointKind};
use taw::prelude::*;

const DT: f32 = 1.0 / 60.0;

fn main() {
    divan::main();
}

fn world() -> World<f32> {
    let mut world = World::default();
    world.set_model(Model::GAME).expect("a model");
    world.set_gravity(Vec3::new(0.0, -9.81, 0.0)).expect("a gravity");
    let floor = Plane::new(Vec3::unit_y(), 0.0).expect("a unit vector");
    world.walls.insert(floor).expect("one wall");
    world
}

fn cube(x: f32, y: f32, z: f32) -> Body<f32> {
    let half = Vec3::new(0.1, 0.1, 0.1);
    Body { sleeping_disabled: true, ..Body::cuboid(half, Point3::new(x, y, z)) }
}

/// Steps a world that has come to rest.
fn step(bencher: Bencher, mut world: World<f32>) {
    for _ in 0..60 {
        world.step(DT).expect("a step");
    }
    let bodies = world.bodies.len();
    bencher.counter(ItemsCount::new(bodies)).bench_local(|| world.step(DT).expect("a step"));
}

/// Pyramid of boxes; 100 rows are 5,050.
#[divan::bench(args = [10, 30, 100], sample_count = 10)]
fn pyramid(bencher: Bencher, rows: u16) {
    let mut world = world();
    for row in 0..rows {
        for i in 0..rows - row {
            let x = (f32::from(i) - f32::from(rows - row - 1) * 0.5) * 0.21;
            let body = cube(x, 0.1 + 0.2 * f32::from(row), 0.0);
            world.bodies.insert(body).expect("a body");
        }
    }
    step(bencher, world);
}

/// Boxes on the floor, none touching another.
#[divan::bench(args = [100, 1_000], sample_count = 10)]
fn apart(bencher: Bencher, count: u16) {
    let mut world = world();
    for i in 0..count {
        let at = cube(f32::from(i % 32) * 0.5, 0.1, f32::from(i / 32) * 0.5);
        world.bodies.insert(at).expect("a body");
    }
    step(bencher, world);
}

/// Chain of boxes on ball-and-socket joints, hanging.
#[divan::bench(args = [10, 100], sample_count = 10)]
fn chain(bencher: Bencher, links: u16) {
    let mut world = world();
    let top = 1.0 + 0.2 * f32::from(links);
    let mut above = JointEnd::world(Point3::new(0.0, top, 0.0));
    for i in 0..links {
        let link = cube(0.0, top - 0.1 - 0.2 * f32::from(i), 0.0);
        let link = world.bodies.insert(link).expect("a body");
        let anchor = |y: f32| JointEnd::body(link, Vec3::new(0.0, y, 0.0));
        let joint = Joint::new(JointKind::BallAndSocket, [above, anchor(0.1)]);
        world.joints.insert(joint).expect("a joint");
        above = anchor(-0.1);
    }
    step(bencher, world);
}
