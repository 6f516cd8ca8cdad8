//! The budget of a step under `Response::EventDriven`: all its substeps share it.

use taw::prelude::*;

/// Tests that the documented budget of a step allows for one ball.
const BUDGET: usize = 32_020_000;
const HALF_SPACES: usize = 60;

/// Number of bounces in a step of a ball without losses, all around which there are half-spaces,
/// with this many substeps, and if it was stopped.
fn bounces(speed: f64, substeps: u32) -> (usize, bool) {
    let mut world = World::<f64>::default();
    let response = Response::EventDriven;
    world.set_model(Model { response, substeps, ..Model::default() }).unwrap();
    world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
    for i in 0..HALF_SPACES {
        // Directions on a sphere, by the golden angle.
        let y = 1.0 - (2.0 * i as f64 + 1.0) / HALF_SPACES as f64;
        let (sin, cos) = (2.399_963_229_728_653 * i as f64).sin_cos();
        let across = (1.0 - y * y).sqrt();
        let normal = Vec3::new(across * cos, y, across * sin);
        world.walls.insert(Plane::new(normal, -1.1).unwrap()).unwrap();
    }
    let marble = Marble {
        velocity: Vec3::new(0.6, 0.7, -0.4) * speed,
        material: Some(Material { restitution: 1.0, friction: 0.0, ..Material::default() }),
        ..Marble::new(Point3::new(0.0, 0.0, 0.0), 1.0)
    };
    world.marbles.insert(marble).unwrap();
    world.step(1.0 / 60.0).unwrap();
    (world.impacts().len(), world.stopped().next().is_some())
}

#[test]
fn the_substeps_of_a_step_share_its_budget() {
    // So fast that each substep would spend most of a step's budget.
    let (count, stopped) = bounces(2e7, 8);
    assert!(stopped, "{count} bounces");
    assert!(count * HALF_SPACES <= BUDGET, "{count} bounces");
    // A step that needs less than a substep's share ends, in substeps or without.
    for substeps in [1, 8] {
        let (count, stopped) = bounces(1e6, substeps);
        assert!(!stopped && count > 10_000, "{count} bounces in {substeps} substeps");
    }
}
