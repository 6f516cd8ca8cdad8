//! More marbles at one place than a step takes are refused, before anything has moved.

use taw::Error;
use taw::prelude::*;
use taw::swarm::{Ball, SwarmModel, Tier};

const DT: f32 = 1.0 / 60.0;

fn world(response: Response, count: usize, place: impl Fn(usize) -> Marble<f32>) -> World<f32> {
    let mut world = World::default();
    world.set_model(Model { response, ..Model::default() }).unwrap();
    for i in 0..count {
        world.marbles.insert(place(i)).unwrap();
    }
    world
}

fn at_one_point(_: usize) -> Marble<f32> {
    Marble::new(Point3::new(0.3, 1.0, -2.0), 0.1)
}

const RESPONSES: [Response; 5] = [
    Response::Displacement,
    Response::Impulse,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::EventDriven,
    Response::SoftStep,
];

const TIERS: [Tier; 2] = [Tier::Lab, Tier::Full];

/// World of some marbles and balls at one point.
fn beside_a_swarm(tier: Tier, response: Response, marbles: usize, balls: usize) -> World<f32> {
    let mut world = world(response, marbles, at_one_point);
    world.swarm.set_model(SwarmModel { tier, ..SwarmModel::default() }).unwrap();
    let ball = Ball::new(at_one_point(0).position, 0.1);
    world.swarm.insert(&vec![ball; balls]).unwrap();
    world
}

/// Checks that a world refuses its step and is as it was.
fn refuses(world: &mut World<f32>, at_least: u64) {
    let before = world.clone();
    let error = world.step(DT).unwrap_err();
    let Error::TooManyPairs { pairs, max } = error else { panic!("{error}") };
    assert_eq!((pairs, max), (at_least, World::<f32>::MAX_PAIRS));
    assert!(error.to_string().starts_with(&format!("at least {pairs} pairs")), "{error}");
    assert!(*world == before, "something has changed");
}

const PAIRS: u64 = 20_000 * 19_999 / 2;

#[test]
fn too_many_at_one_point_are_refused_and_nothing_has_changed() {
    for response in RESPONSES {
        let mut world = world(response, 20_000, at_one_point);
        refuses(&mut world, PAIRS);
        // Fewer are taken.
        let surplus: Vec<_> = (0..5_000).filter_map(|row| world.marbles.id(row)).collect();
        for id in surplus {
            world.marbles.remove(id).unwrap();
        }
        world.integrate(DT).unwrap();
    }
}

#[test]
fn too_many_balls_of_a_swarm_at_one_point_are_refused() {
    for tier in TIERS {
        for response in [Response::Impulse, Response::SoftStep] {
            let mut world = beside_a_swarm(tier, response, 0, 20_000);
            refuses(&mut world, PAIRS);
            if response != Response::SoftStep {
                let error = world.step_swarm(DT, &mut |_| ()).unwrap_err();
                assert!(matches!(error, Error::TooManyPairs { .. }), "{error}");
            }
            let surplus: Vec<_> = (0..5_000).filter_map(|row| world.swarm.id(row)).collect();
            world.swarm.remove(&surplus).unwrap();
            world.step(DT).unwrap();
            assert_eq!(world.swarm.len(), 15_000);
        }
    }
}

#[test]
fn marbles_and_balls_at_one_point_are_counted_together() {
    for tier in TIERS {
        refuses(&mut beside_a_swarm(tier, Response::SoftStep, 10_000, 10_000), PAIRS);
        refuses(&mut beside_a_swarm(tier, Response::Impulse, 10_000, 10_000), PAIRS);
    }
}

/// Solved contacts part marbles, so by `SoftStep` they are counted again only after somebody set
/// them.
#[test]
fn marbles_that_are_set_to_one_point_are_counted_too() {
    let spread = |i: usize| Marble::new(Point3::new(i as f32, 1.0, 0.0), 0.1);
    let mut world = world(Response::SoftStep, 20_000, spread);
    world.step(DT).unwrap();
    world.step(DT).unwrap();
    let ids: Vec<_> = (0..20_000).filter_map(|row| world.marbles.id(row)).collect();
    for id in &ids {
        world.marbles.set_position(*id, at_one_point(0).position).unwrap();
    }
    refuses(&mut world, PAIRS);
    refuses(&mut world, PAIRS); // and again
    for (i, id) in ids.into_iter().enumerate() {
        world.marbles.set_position(id, spread(i).position).unwrap();
    }
    world.step(DT).unwrap();
}

#[test]
fn many_that_do_not_overlap_or_do_not_collide_are_no_crowd() {
    let spread = |i: usize| Marble::new(Point3::new(i as f32 * 0.1, 1.0, 0.0), 0.1);
    let ghosts = |_: usize| Marble { layers: CollisionLayers::NONE, ..at_one_point(0) };
    let far = |i: usize| Marble::new(Point3::new(1e30, i as f32, 0.0), 0.1);
    for response in RESPONSES {
        for place in [&spread as &dyn Fn(usize) -> Marble<f32>, &ghosts] {
            world(response, 20_000, place).integrate(DT).unwrap();
        }
        if response != Response::SoftStep {
            world(response, 20_000, far).integrate(DT).unwrap(); // farther than it takes
        }
    }
    let mut world = beside_a_swarm(Tier::Full, Response::Impulse, 0, 0);
    let balls: Vec<_> = (0..20_000).map(|i| Ball::new(spread(i).position, 0.1)).collect();
    world.swarm.insert(&balls).unwrap();
    world.step(DT).unwrap();
}
