//! Boxes and thin boards: nothing gets through, and nothing is faster than what drives it.

use fastrand::Rng;
use taw::math::Quat;
use taw::prelude::*;
use taw::shape::Obb;

use super::{DT, room};

const EVERY_RESPONSE: [Response; 6] = [
    Response::Displacement,
    Response::Impulse,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::Penalty(ContactLaw::HertzMindlin),
    Response::EventDriven,
    Response::SoftStep,
];

/// In layers of so many, 0.22 m apart, into a box of such a half width.
fn poured(model: Model, [count, layer]: [usize; 2], half: f32, random: &mut Rng) -> World<f32> {
    let mut world = room(model.response);
    world.set_model(model).unwrap();
    for normal in [Vec3::unit_x(), -Vec3::unit_x(), Vec3::unit_z(), -Vec3::unit_z()] {
        world.walls.insert(Plane::new(normal, -half).unwrap()).unwrap();
    }
    let side = layer.isqrt();
    for i in 0..count {
        let mut jitter = || 0.02 * (random.f32() - 0.5);
        let cell = |i: usize| 0.28 * (i as f32 - 0.5 * (side - 1) as f32);
        let [x, y, z] = [i % side, i / layer, i / side % side];
        let at = Point3::new(cell(x) + jitter(), 0.2 + 0.22 * y as f32, cell(z) + jitter());
        world.marbles.insert(Marble::new(at, 0.1)).unwrap();
    }
    world
}

#[test]
fn ten_and_a_thousand_balls_poured_into_a_box_are_no_faster_than_they_fell() {
    let mut random = Rng::with_seed(8);
    let (response, rotation) = (Response::Impulse, Rotation::Dynamic);
    for detection in [Detection::Swept, Detection::Discrete] {
        let model = Model { response, rotation, detection, ..Model::default() };
        for (balls, half) in [([10, 1], 0.3), ([1000, 16], 0.6)] {
            let mut world = poured(model, balls, half, &mut random);
            // Nothing can be faster than what fell from the top.
            let top = world.marbles.position().iter().map(|at| at.y).fold(0.0, f32::max);
            let fastest = (2.0 * 9.81 * top).sqrt();
            for step in 0..200 {
                world.step(DT).unwrap();
                for (at, v) in world.marbles.position().iter().zip(world.marbles.velocity()) {
                    let speed = v.magnitude();
                    assert!(
                        speed < fastest && at.y > 0.0 && at.y < top + 0.01,
                        "{balls:?}, {detection:?}, step {step}: {at:?} {speed} m/s"
                    );
                }
            }
        }
    }
}

fn plate(center: [f32; 3], half: [f32; 3]) -> Obb<f32> {
    Obb::new(Point3::from(center), Quat::new(1.0, 0.0, 0.0, 0.0), Vec3::from(half)).unwrap()
}

#[test]
fn a_thin_box_is_not_passed_by_default() {
    let mut random = Rng::with_seed(2);
    for response in EVERY_RESPONSE {
        for run in 0..80 {
            let mut world = World::<f32>::default();
            let rotation = Rotation::Dynamic;
            world.set_model(Model { response, rotation, ..Model::default() }).unwrap();
            world.walls.insert(plate([0.0, -0.01, 0.0], [5.0, 0.01, 5.0])).unwrap();
            let speed = [10.0, 30.0, 100.0, 300.0][run % 4];
            let mut any = || random.f32();
            let at = Point3::new(any(), 1.0 + any(), any());
            let velocity = Vec3::new(2.0 * any() - 1.0, -speed, 2.0 * any() - 1.0);
            world.marbles.insert(Marble { velocity, ..Marble::new(at, 0.05) }).unwrap();
            for _ in 0..60 {
                world.step(DT).unwrap();
                let at = world.marbles.position()[0];
                assert!(at.y > 0.0, "{response:?}, {speed} m/s: {at:?}");
            }
        }
    }
}

#[test]
fn two_fast_balls_stay_in_a_box_of_boards_by_any_response() {
    let mut random = Rng::with_seed(2);
    for response in EVERY_RESPONSE {
        for run in 0..60 {
            let mut world = World::<f32>::default();
            let rotation = Rotation::Dynamic;
            world.set_model(Model { response, rotation, ..Model::default() }).unwrap();
            for axis in 0..3 {
                for side in [-1.03, 1.03] {
                    let (mut center, mut half) = ([0.0; 3], [1.06; 3]);
                    (center[axis], half[axis]) = (side, 0.03);
                    world.walls.insert(plate(center, half)).unwrap();
                }
            }
            let speed = [30.0, 100.0, 300.0, 1000.0][run % 4];
            let mut any = || 2.0 * random.f32() - 1.0;
            for x in [-0.5, 0.5] {
                let velocity = Vec3::new(any(), any(), any()).normalize() * speed;
                let at = Point3::new(x + 0.2 * any(), 0.5 * any(), 0.5 * any());
                let bouncy = Material { friction: 0.3, restitution: 0.9, ..Material::default() };
                let marble = Marble { velocity, material: Some(bouncy), ..Marble::new(at, 0.1) };
                world.marbles.insert(marble).unwrap();
            }
            for step in 0..120 {
                world.step(DT).unwrap();
                for at in world.marbles.position() {
                    let far = at.x.abs().max(at.y.abs()).max(at.z.abs());
                    assert!(far < 1.0, "{response:?}, run {run}, step {step}: {at:?}");
                }
            }
        }
    }
}
