//! Forces that are finite, but give velocities that are not: what they move is stopped, named and
//! left where it was, and nothing else notices.

use cgmath::MetricSpace;
use taw::prelude::*;
use taw::swarm::Ball;

const RESPONSES: [Response; 5] = [
    Response::Displacement,
    Response::Impulse,
    Response::EventDriven,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::SoftStep,
];

fn world(response: Response) -> World<f32> {
    let mut world = World::default();
    world.set_model(Model { response, ..Model::GAME }).unwrap();
    world
}

/// Swarms move what flies freely on by half the fall of a substep, also if it is stopped in that one.
const MAX_DISPLACEMENT: f32 = 7e-4;

fn is_all_finite(world: &World<f32>) -> bool {
    let rows = world.swarm.balls().iter().chain(world.swarm.velocities());
    rows.flatten().all(|x| x.is_finite())
}

#[test]
fn the_rows_of_a_swarm_stay_numbers_beside_a_marble() {
    let spring = |stiffness| vec![ForceField::spring([0.0, 50.0, 0.0], 1.0, stiffness)];
    for response in RESPONSES {
        for (gravity, fields) in [(1e30, vec![]), (0.0, spring(1e37)), (0.0, spring(3e38))] {
            let mut world = world(response);
            world.marbles.insert(Marble::new(Point3::new(0.0, 0.5, 0.0), 0.5)).unwrap();
            world.swarm.insert(&[Ball::new(Point3::new(5.0, 0.5, 0.0), 0.2)]).unwrap();
            world.step(1.0 / 60.0).unwrap();
            world.set_gravity(Vec3::new(gravity, -1.0, gravity)).unwrap();
            world.set_forces(fields).unwrap();
            for step in 0..3 {
                world.step(1.0 / 60.0).unwrap();
                assert!(is_all_finite(&world), "{response:?}, step {step}: {:?}", world.swarm);
                assert!(world == world.clone(), "{response:?}, step {step}");
            }
        }
    }
}

#[test]
fn a_spring_that_overflows_stops_its_marble_where_it_is() {
    for response in [Response::Impulse, Response::EventDriven, Response::SoftStep] {
        let mut world = world(response);
        let at = Point3::new(3.0, 0.5, -2.0);
        let marble = world.marbles.insert(Marble::new(at, 0.5)).unwrap();
        world.set_forces(vec![ForceField::spring([0.0, 50.0, 0.0], 1.0, 3e38)]).unwrap();
        for step in 1..=3_u8 {
            world.step(1.0 / 60.0).unwrap();
            assert_eq!(world.stopped().collect::<Vec<_>>(), [marble], "{response:?}");
            let there = world.marbles.get(marble).unwrap().position;
            let max = MAX_DISPLACEMENT * f32::from(step);
            assert!(there.distance(at) < max, "{response:?}, step {step}: {there:?}");
        }
    }
}

#[test]
fn a_spring_that_overflows_stops_its_ball_of_a_swarm_where_it_is() {
    for response in RESPONSES {
        let mut world = world(response);
        let at = Point3::new(3.0, 0.5, -2.0);
        let ball = world.swarm.insert(&[Ball::new(at, 0.5)]).unwrap()[0];
        world.set_forces(vec![ForceField::spring([0.0, 50.0, 0.0], 1.0, 3e38)]).unwrap();
        for step in 1..=3_u8 {
            world.step(1.0 / 60.0).unwrap();
            assert_eq!(world.swarm.stopped().collect::<Vec<_>>(), [ball], "{response:?}");
            let there = world.swarm.get(ball).unwrap().position;
            let max = MAX_DISPLACEMENT * f32::from(step);
            assert!(there.distance(at) < max, "{response:?}, step {step}: {there:?}");
        }
    }
}
