//! Walls that stay where they are and have a motion: conveyor belts. They drag, and never push.

use cgmath::Zero;
use taw::motion::WallMotion;
use taw::prelude::*;
use taw::shape::Aabb;

const RESPONSES: [Response; 4] = [
    Response::Impulse,
    Response::EventDriven,
    Response::SoftStep,
    Response::Penalty(ContactLaw::SpringDashpot),
];
const SPEED: f64 = 3.0;

/// A floor, and on it a box whose surface moves along x.
fn world(response: Response) -> World<f64> {
    let mut world = World::default();
    let model = Model { response, rotation: Rotation::Dynamic, substeps: 4, ..Model::default() };
    world.set_model(model).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    let (min, max) = (Point3::new(-2.0, 0.0, -1.0), Point3::new(2.0, 1.0, 1.0));
    let belt = world.walls.insert(Aabb { min, max }).unwrap();
    let (velocity, none) = (Vec3::new(SPEED, 0.0, 0.0), Vec3::zero());
    let motion = WallMotion { velocity, angular_velocity: none, pivot: Point3::new(0.0, 0.0, 0.0) };
    world.walls.set_motion(belt, Some(motion)).unwrap();
    world
}

fn ball(x: f64, y: f64, velocity: f64) -> Marble<f64> {
    let material = Material { restitution: 0.0, friction: 0.8, ..Material::default() };
    Marble {
        velocity: Vec3::new(velocity, 0.0, 0.0),
        material: Some(material),
        ..Marble::new(Point3::new(x, y, 0.0), 0.1)
    }
}

#[test]
fn what_lies_on_a_belt_goes_with_it() {
    for response in RESPONSES {
        let mut world = world(response);
        let id = world.marbles.insert(ball(-1.8, 1.1, 0.0)).unwrap();
        for _ in 0..60 {
            world.step(1.0 / 60.0).unwrap();
        }
        // A ball that slides rolls from 2/7 of the speed of the belt on.
        let speed = world.marbles.get(id).unwrap().velocity.x;
        assert!((speed - SPEED * 2.0 / 7.0).abs() < 0.02, "{response:?}: {speed}");
    }
}

/// The end faces of a belt stay where they are: a ball at rest beside one is left alone, and one that
/// rolls against one, with restitution 0, stops there.
#[test]
fn the_ends_of_a_belt_push_nobody() {
    for response in RESPONSES {
        for (x, velocity) in [(2.1, 0.0), (2.3, -1.0), (-2.1, 0.0), (-2.3, 1.0)] {
            let mut world = world(response);
            let id = world.marbles.insert(ball(x, 0.1, velocity)).unwrap();
            for _ in 0..120 {
                world.step(1.0 / 60.0).unwrap();
                let marble = world.marbles.get(id).unwrap();
                let energy = marble.velocity.magnitude2();
                assert!(energy <= velocity * velocity + 1e-3, "{response:?} at {x}: {marble:?}");
            }
            let marble = world.marbles.get(id).unwrap();
            assert!(
                (marble.position.x.abs() - 2.1).abs() < 0.35,
                "{response:?} at {x}: {marble:?}"
            );
        }
    }
}
