//! The budget of a step under `Response::EventDriven`: all its substeps share it, and ordinary scenes
//! stay far below.

use taw::prelude::*;
use taw::shape::{Aabb3, Capsule, Sphere};
use taw::world::{StopReason, WallShape};

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

#[test]
fn two_balls_that_overlap_far_inside_a_wall_need_few_events() {
    for offset in [1e3, 1e6, 1e9, 1e12] {
        let mut world = World::<f64>::default();
        world.set_model(Model::EXACT).unwrap();
        world.walls.insert(Plane::new(Vec3::unit_y(), offset).unwrap()).unwrap();
        for i in 0..2 {
            let at = Point3::new(0.3 * f64::from(i), 0.5 + 0.9 * f64::from(i), 0.0);
            world.marbles.insert(Marble::new(at, 0.5)).unwrap();
        }
        for _ in 0..3 {
            world.step(1.0 / 60.0).unwrap();
            assert_eq!(world.stopped().count(), 0, "a wall at {offset} m");
        }
    }
}

/// A board with pins and bins between two panes, 2 cm wider than the balls. All centers are in the
/// plane z = 0, which is the border of two cells of the grid, and leave it by rounding alone.
#[test]
fn a_pachinko_between_panes_needs_few_events() {
    let mut world = World::<f32>::default();
    world.set_model(Model::EXACT).unwrap();
    let shape = |world: &mut World<f32>, shape: WallShape<f32>| world.walls.insert(shape).unwrap();
    shape(&mut world, Plane::new(Vec3::unit_y(), 0.0).unwrap().into());
    for normal in [Vec3::unit_z(), -Vec3::unit_z()] {
        let pane = shape(&mut world, Plane::new(normal, -0.11).unwrap().into());
        let slick = Material { friction: 0.0, ..Material::default() };
        world.walls.set_material(pane, Some(slick)).unwrap();
    }
    for i in 0..=8_u8 {
        let (x, height) = (0.5 * f32::from(i) - 2.0, if i % 8 == 0 { 8.0 } else { 1.0 });
        let corners = [Point3::new(x - 0.02, 0.0, -0.2), Point3::new(x + 0.02, height, 0.2)];
        shape(&mut world, Aabb3::new(corners[0], corners[1]).unwrap().into());
    }
    for (row, column) in (0..8_u8).flat_map(|row| (0..8 - row % 2).map(move |column| (row, column)))
    {
        let x = 0.5 * (f32::from(column) - 3.5) + 0.25 * f32::from(row % 2);
        let at = Point3::new(x, 1.6 + 0.5 * f32::from(row), 0.0);
        let half = Vec3::unit_z() * 0.15;
        shape(
            &mut world,
            if row % 4 < 2 {
                Sphere::new(at, 0.07).unwrap().into()
            } else {
                Capsule::new(at - half, at + half, 0.05).unwrap().into()
            },
        );
    }
    for step in 0..600_u16 {
        if step % 5 == 0 && step < 400 {
            let x = ((f32::from(step) / 5.0 * 0.618).fract() - 0.5) * 0.3;
            let mut ball = Marble::new(Point3::new(x, 7.0, 0.0), 0.1);
            let material = Material { restitution: 0.4, friction: 0.1, ..Material::default() };
            ball.material = Some(material);
            world.marbles.insert(ball).unwrap();
        }
        world.step(1.0 / 64.0).unwrap();
        assert_eq!(world.stopped().count(), 0, "step {step}");
    }
}

/// In a periodic box a marble crosses cells as long as it moves: so fast that a step would take seconds, it is
/// stopped and named; a tenth of that is done.
#[test]
fn cells_of_a_periodic_box_cost_what_they_take() {
    let stopped = |speed: f32| {
        let mut world = World::<f32>::default();
        world.set_model(Model::EXACT).unwrap();
        world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
        world.set_period([Some(8.0), None, Some(8.0)]).unwrap();
        let velocity = Vec3::new(1.0, 0.0, 0.3) * speed;
        let marble = Marble { velocity, ..Marble::new(Point3::new(0.0, 1.0, 0.0), 0.2) };
        let id = world.marbles.insert(marble).unwrap();
        world.step(1.0 / 60.0).unwrap();
        let stopped: Vec<_> = world.stopped().collect();
        assert!(stopped.is_empty() || stopped == [id]);
        assert!(world.stop_reason(id).is_none_or(|reason| reason == StopReason::EventBudget));
        assert_eq!(world.stop_reason(id).is_some(), !stopped.is_empty());
        !stopped.is_empty()
    };
    assert!(stopped(1e8));
    assert!(!stopped(1e7));
}
