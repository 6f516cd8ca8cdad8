//! Swarms hold what they should: fast balls, balls that others made fast, and marbles beside them.

use std::time::Instant;

use taw::Error;
use taw::motion::WallMotion;
use taw::prelude::*;
use taw::shape::Aabb;
use taw::swarm::{Ball, BallId, SwarmModel, Tier};

const DT: f32 = 1.0 / 60.0;

fn swarm(tier: Tier, gravity: f32) -> World<f32> {
    let mut world = World::default();
    let material = Material { friction: 0.3, restitution: 0.5, ..Material::default() };
    let model = SwarmModel { tier, threads: 1, material, ..SwarmModel::default() };
    world.swarm.set_model(model).unwrap();
    world.set_gravity(Vec3::new(0.0, -gravity, 0.0)).unwrap();
    world
}

fn ball(place: [f32; 3], velocity: [f32; 3], radius: f32, mass: f32) -> Ball {
    let mass = Mass::Kilograms(mass);
    Ball { velocity: velocity.into(), mass, ..Ball::new(place.into(), radius) }
}

fn floor(world: &mut World<f32>) {
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
}

/// A closed box of thin boxes, from -1 to 1 along each axis.
fn closed_box(world: &mut World<f32>) {
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let (mut min, mut max) = ([-1.1_f32; 3], [1.1_f32; 3]);
            (min[axis], max[axis]) = if side < 0.0 { (-1.04, -1.0) } else { (1.0, 1.04) };
            let wall = Aabb { min: min.into(), max: max.into() };
            world.walls.insert(wall).unwrap();
        }
    }
}

fn state(world: &World<f32>, id: BallId) -> (Vec3<f32>, Vec3<f32>) {
    let row = world.swarm.row(id).unwrap();
    let ([x, y, z, _], [u, v, w, _]) = (world.swarm.balls()[row], world.swarm.velocities()[row]);
    (Vec3::new(x, y, z), Vec3::new(u, v, w))
}

#[test]
fn a_fast_ball_stays_in_a_box_of_thin_boxes() {
    for tier in [Tier::Full, Tier::Lab] {
        for speed in [5.0, 20.0, 60.0] {
            let mut world = swarm(tier, 9.81);
            closed_box(&mut world);
            let velocity = [0.7, 0.5, -0.4].map(|x| x * speed);
            let ids = world.swarm.insert(&[ball([0.1, 0.2, 0.3], velocity, 0.05, 1.0)]).unwrap();
            for step in 0..300 {
                world.step(DT).unwrap();
                let (at, _) = state(&world, ids[0]);
                let out = at.x.abs().max(at.y.abs()).max(at.z.abs());
                assert!(out < 1.0, "{at:?} in step {step} at {speed} m/s, {tier:?}");
            }
        }
    }
}

#[test]
fn a_ball_that_a_fast_one_hits_does_not_pass_through_the_floor() {
    let mut world = swarm(Tier::Full, 9.81);
    floor(&mut world);
    let low = ball([0.0, 0.6, 0.0], [0.0; 3], 0.05, 0.1);
    let fast = ball([0.0, 1.2, 0.0], [0.0, -50.0, 0.0], 0.05, 10.0);
    let ids = world.swarm.insert(&[low, fast]).unwrap();
    for step in 0..60 {
        world.step(DT).unwrap();
        for id in &ids {
            let (at, _) = state(&world, *id);
            assert!(at.y > 0.04, "{at:?} in step {step}");
        }
    }
}

#[test]
fn a_marble_that_a_heap_presses_on_the_floor_reports_no_speed() {
    for tier in [Tier::Full, Tier::Lab] {
        let mut world = swarm(tier, 9.81);
        floor(&mut world);
        let low =
            Marble { mass: Mass::Kilograms(0.5), ..Marble::new(Point3::new(0.0, 0.2, 0.0), 0.2) };
        let id = world.marbles.insert(low).unwrap();
        let heap: Vec<_> = (0..5_u8)
            .map(|i| ball([0.0, 0.6 + 0.4 * f32::from(i), 0.0], [0.0; 3], 0.2, 5.0))
            .collect();
        world.swarm.insert(&heap).unwrap();
        for step in 0..60 {
            world.step(DT).unwrap();
            let marble = world.marbles.get(id).unwrap();
            let speed = marble.velocity.y.abs();
            assert!(speed < 0.1 && marble.position.y > 0.18, "{marble:?} in step {step}, {tier:?}");
        }
    }
}

#[test]
fn a_marble_and_the_ball_that_hits_it_keep_their_center_of_mass() {
    let mut world = swarm(Tier::Full, 0.0);
    let mass = Mass::Kilograms(2.0);
    let marble =
        world.marbles.insert(Marble { mass, ..Marble::new(Point3::new(0.0, 0.0, 0.0), 0.2) });
    let marble = marble.unwrap();
    let ids = world.swarm.insert(&[ball([1.0, 0.1, 0.0], [-7.0, 0.0, 0.0], 0.3, 1.0)]).unwrap();
    for step in 1..=60_u8 {
        world.step(DT).unwrap();
        let place = world.marbles.get(marble).unwrap().position;
        let center = (state(&world, ids[0]).0.x + 2.0 * place.x) / 3.0;
        let exact = (1.0 - 7.0 * DT * f32::from(step)) / 3.0;
        assert!((center - exact).abs() < 1e-5, "{center} m, not {exact} m, in step {step}");
    }
    assert!(world.marbles.get(marble).unwrap().velocity.x < -1.0);
}

#[test]
fn overlap_of_unlike_balls_that_fly_moves_no_center_of_mass() {
    let mut world = swarm(Tier::Full, 9.81);
    let both = [ball([0.0; 3], [0.0; 3], 0.2, 1.0), ball([0.1, 0.0, 0.0], [0.0; 3], 0.2, 9.0)];
    let ids = world.swarm.insert(&both).unwrap();
    for step in 0..30 {
        world.step(DT).unwrap();
        let [one, other] = [0, 1].map(|i| state(&world, ids[i]).0.x);
        let center = (one + 9.0 * other) / 10.0;
        assert!((center - 0.09).abs() < 1e-6, "{center} m in step {step}");
    }
    let apart = state(&world, ids[1]).0 - state(&world, ids[0]).0;
    assert!(apart.x > 0.36, "{apart:?}");
}

#[test]
fn a_tower_in_the_labs_tier_presses_nothing_into_the_floor() {
    let mut world = swarm(Tier::Lab, 9.81);
    floor(&mut world);
    let tower: Vec<_> =
        (0..10_u8).map(|i| ball([0.0, 0.5 + f32::from(i), 0.0], [0.0; 3], 0.5, 1.0)).collect();
    let ids = world.swarm.insert(&tower).unwrap();
    for step in 0..120 {
        world.step(DT).unwrap();
        let (at, _) = state(&world, ids[0]);
        assert!(at.y > 0.5 - 1e-6, "{at:?} in step {step}");
    }
}

#[test]
fn ten_thousand_balls_at_one_point_part_and_it_is_said_how_many_pairs_wait() {
    let mut world = swarm(Tier::Full, 0.0);
    let at_one_point = vec![Ball::new(Point3::new(0.0, 0.0, 0.0), 0.1); 10_000];
    world.swarm.insert(&at_one_point).unwrap();
    world.step(DT).unwrap();
    let error = world.swarm.check_pairs().unwrap_err();
    let Error::OutOfRange { field, value, max, .. } = error else { panic!("{error}") };
    assert_eq!(field, "pairs");
    assert!(value > max && max >= 64.0 * 10_000.0, "{value} of {max}");
    let begin = Instant::now();
    let mut steps = 1;
    while world.swarm.check_pairs().is_err() {
        world.step(DT).unwrap();
        steps += 1;
        assert!(steps < 600, "{:?} after {steps} steps", world.swarm.check_pairs());
    }
    println!("all pairs are listed after {steps} steps, {:?}", begin.elapsed());
}

#[test]
fn a_lift_does_not_pass_through_balls_while_others_are_fast() {
    for tier in [Tier::Full, Tier::Lab] {
        let mut world = swarm(tier, 9.81);
        let block = |height: f32| Aabb {
            min: Point3::new(-5.0, height - 1.0, -5.0),
            max: Point3::new(5.0, height, 5.0),
        };
        let lift = world.walls.insert(block(0.0)).unwrap();
        // Some fast ones leave their budget in each step.
        let mut balls = vec![ball([0.0, 0.6, 0.0], [0.0; 3], 0.1, 1.0)];
        balls
            .extend((0..4_u8).map(|i| ball([f32::from(i), 50.0, 0.0], [60.0, 0.0, 0.0], 0.1, 1.0)));
        let ids = world.swarm.insert(&balls).unwrap();
        for step in 1..=60_u8 {
            let height = 0.05 * f32::from(step);
            world.walls.set(lift, block(height)).unwrap();
            let motion = WallMotion {
                velocity: Vec3::new(0.0, 3.0, 0.0),
                angular_velocity: Vec3::new(0.0, 0.0, 0.0),
                pivot: Point3::new(0.0, height, 0.0),
            };
            world.walls.set_motion(lift, Some(motion)).unwrap();
            world.step(DT).unwrap();
            let (at, _) = state(&world, ids[0]);
            assert!(at.y > height + 0.07, "{at:?} in step {step}, {tier:?}");
        }
    }
}

#[test]
fn marbles_beside_a_swarm_hit_each_other_as_without_it() {
    let worlds = [false, true].map(|beside| {
        let mut world = swarm(Tier::Full, 9.81);
        floor(&mut world);
        let marble = |x: f32, speed: f32| Marble {
            velocity: Vec3::new(speed, 1.0, 0.0),
            ..Marble::new(Point3::new(x, 0.5, 0.0), 0.1)
        };
        world.marbles.insert(marble(-0.5, 2.0)).unwrap();
        world.marbles.insert(marble(0.5, -3.0)).unwrap();
        if beside {
            world.swarm.insert(&[ball([50.0, 0.1, 0.0], [0.0; 3], 0.1, 1.0)]).unwrap();
        }
        (0..90).for_each(|_| world.step(DT).unwrap());
        world
    });
    assert_eq!(worlds[0].marbles.position(), worlds[1].marbles.position());
}
