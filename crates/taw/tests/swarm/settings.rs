//! Settings of single balls of a swarm, and force fields: the same physics as marbles have.

use cgmath::InnerSpace;
use taw::Error;
use taw::motion::{ForceField, Medium};
use taw::prelude::*;
use taw::swarm::{Ball, BallId, SwarmModel, Tier};

const DT: f32 = 1.0 / 64.0;

fn world(tier: Tier, threads: u32) -> World<f32> {
    let mut world = World::default();
    let material = Material { friction: 0.3, restitution: 0.0, ..Material::default() };
    let model = SwarmModel { tier, threads, material, ..SwarmModel::default() };
    world.swarm.set_model(model).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    world
}

fn ball(at: [f32; 3], velocity: [f32; 3]) -> Ball {
    Ball { velocity: velocity.into(), ..Ball::new(at.into(), 0.5) }
}

fn steps(world: &mut World<f32>, count: u32) {
    for _ in 0..count {
        world.step(DT).unwrap();
    }
}

fn place(world: &World<f32>, ball: BallId) -> Vec3<f32> {
    let [x, y, z, _] = world.swarm.balls()[world.swarm.row(ball).unwrap()];
    Vec3::new(x, y, z)
}

fn velocity(world: &World<f32>, ball: BallId) -> Vec3<f32> {
    let [x, y, z, _] = world.swarm.velocities()[world.swarm.row(ball).unwrap()];
    Vec3::new(x, y, z)
}

fn with_friction(friction: f32) -> Material<f32> {
    Material { friction, restitution: 0.0, ..Material::default() }
}

#[test]
fn each_ball_slides_by_its_own_friction() {
    let mut world = world(Tier::Full, 1);
    let balls: Vec<_> =
        (0..3_u8).map(|i| ball([0.0, 0.5, 3.0 * f32::from(i)], [4.0, 0.0, 0.0])).collect();
    let ids = world.swarm.insert(&balls).unwrap();
    // By the geometric mean with the floor, which has no material of its own.
    world.swarm.set_material(ids[0], Some(with_friction(0.0))).unwrap();
    world.swarm.set_material(ids[2], Some(with_friction(0.05))).unwrap();
    steps(&mut world, 8);
    for (id, friction) in ids.iter().zip([0.0, 0.3, 0.05]) {
        let exact = 4.0 - friction * 9.81 * 8.0 * DT;
        let speed = velocity(&world, *id).x;
        assert!((speed - exact).abs() < 1e-2, "{friction}: {speed} for {exact}");
        assert_eq!(world.swarm.material(*id).unwrap().friction, friction);
    }
}

#[test]
fn one_material_of_all_balls_is_the_models_to_the_bit() {
    let heap = |of_model: bool| {
        let mut world = world(Tier::Full, 1);
        let material = Material { friction: 0.6, restitution: 0.4, ..Material::default() };
        let balls: Vec<_> = (0..60_u8)
            .map(|i| ball([f32::from(i % 3) * 0.9, f32::from(i), f32::from(i % 2) * 0.3], [0.0; 3]))
            .collect();
        let ids = world.swarm.insert(&balls).unwrap();
        if of_model {
            let model = SwarmModel { material, ..world.swarm.model() };
            world.swarm.set_model(model).unwrap();
        } else {
            for id in &ids {
                world.swarm.set_material(*id, Some(material)).unwrap();
            }
        }
        steps(&mut world, 100);
        ids.iter().map(|id| place(&world, *id)).collect::<Vec<_>>()
    };
    assert_eq!(heap(true), heap(false));
}

#[test]
fn balls_fall_float_and_rise_by_their_gravity_scales() {
    for tier in [Tier::Full, Tier::Lab] {
        let mut world = world(tier, 1);
        let scales = [1.0, 0.5, 0.0, -1.0];
        let balls: Vec<_> =
            (0..4_u8).map(|i| ball([3.0 * f32::from(i), 50.0, 0.0], [0.0; 3])).collect();
        let ids = world.swarm.insert(&balls).unwrap();
        for (id, scale) in ids.iter().zip(scales) {
            world.swarm.set_gravity_scale(*id, scale).unwrap();
        }
        steps(&mut world, 64);
        for (id, scale) in ids.iter().zip(scales) {
            let exact = -9.81 * scale;
            let speed = velocity(&world, *id).y;
            // The lab's tier takes speeds from places, which have these digits at 50 m.
            let bound = if tier == Tier::Lab { 50.0 * f32::EPSILON / DT * 8.0 } else { 1e-4 };
            assert!((speed - exact).abs() < bound, "{tier:?} {scale}: {speed} for {exact}");
            assert_eq!(world.swarm.gravity_scale(*id).unwrap(), scale);
        }
        // A floating one stays where it is, to the bit.
        assert_eq!(place(&world, ids[2]), Vec3::new(6.0, 50.0, 0.0));
    }
}

fn fields() -> Vec<ForceField<f32>> {
    let wind = Medium { velocity: Vec3::new(3.0, 0.0, 0.0), linear: 40.0, quadratic: 2.0 };
    vec![
        ForceField::Drag(wind),
        ForceField::Attraction { center: Point3::new(0.0, 60.0, 9.0), strength: 30.0 },
        ForceField::Custom(|_, mass| Vec3::new(0.0, 0.0, mass)),
    ]
}

#[test]
fn fields_move_balls_as_they_move_marbles() {
    for softly in [false, true] {
        let mut world = world(Tier::Full, 1);
        let response = if softly { Response::SoftStep } else { Response::Impulse };
        let detection = taw::world::Detection::Discrete;
        world.set_model(Model { response, detection, ..Model::default() }).unwrap();
        world.set_forces(fields()).unwrap();
        let at = [0.0, 50.0, 0.0];
        let id = world.swarm.insert(&[ball(at, [0.0; 3])]).unwrap()[0];
        let far = Point3::new(0.0, 50.0, 0.0);
        let mut alone = World::default();
        alone.set_model(world.model()).unwrap();
        alone.set_forces(fields()).unwrap();
        let marble = alone.marbles.insert(Marble::new(far, 0.5)).unwrap();
        steps(&mut world, 64);
        steps(&mut alone, 64);
        let marble = alone.marbles.get(marble).unwrap();
        let gap = taw::math::length(velocity(&world, id) - marble.velocity);
        let moved = taw::math::length(velocity(&world, id) + Vec3::new(0.0, 9.81, 0.0));
        assert!(moved > 0.5, "the fields change {moved} m/s");
        let bound = if softly { 1e-4 } else { 0.02 };
        assert!(gap < bound * moved, "{response:?}: {gap} m/s from the marble's");
    }
}

#[test]
fn fields_change_no_bit_with_threads() {
    let run = |threads| {
        let mut world = world(Tier::Full, threads);
        world.set_forces(fields()).unwrap();
        let balls: Vec<_> = (0..3000_u16)
            .map(|i| {
                let [x, y, z] = [i % 15, i / 225, i / 15 % 15].map(f32::from);
                ball([x * 1.01, 0.6 + y * 1.1, z * 1.01], [0.0; 3])
            })
            .collect();
        let ids = world.swarm.insert(&balls).unwrap();
        for (i, id) in ids.iter().enumerate() {
            world.swarm.set_gravity_scale(*id, 0.5 + (i % 5) as f32 * 0.2).unwrap();
            world.swarm.set_material(*id, Some(with_friction((i % 3) as f32 * 0.3))).unwrap();
        }
        steps(&mut world, 60);
        ids.iter().map(|id| place(&world, *id)).collect::<Vec<_>>()
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn what_rests_in_a_field_sleeps_until_the_field_changes() {
    let mut world = world(Tier::Full, 1);
    let material = Material { rolling_resistance: 0.1, ..world.swarm.model().material };
    world.swarm.set_model(SwarmModel { material, ..world.swarm.model() }).unwrap();
    world.set_forces(vec![ForceField::Custom(|_, mass| Vec3::new(0.0, -mass, 0.0))]).unwrap();
    let balls: Vec<_> = (0..9_u8)
        .map(|i| ball([f32::from(i % 3) * 1.5, 0.5, f32::from(i / 3) * 1.5], [0.0; 3]))
        .collect();
    let ids = world.swarm.insert(&balls).unwrap();
    steps(&mut world, 200);
    assert_eq!(world.swarm.asleep(), 9);
    world.set_forces(vec![ForceField::Custom(|_, mass| Vec3::new(4.0 * mass, 0.0, 0.0))]).unwrap();
    steps(&mut world, 10);
    assert_eq!(world.swarm.asleep(), 0);
    assert!(velocity(&world, ids[4]).x > 0.1);
    world.set_forces(Vec::new()).unwrap();
    steps(&mut world, 2000);
    assert_eq!(world.swarm.asleep(), 9);
    world.swarm.set_gravity_scale(ids[0], -0.5).unwrap();
    steps(&mut world, 30);
    assert!(place(&world, ids[0]).y > 0.6, "it rises");
}

#[test]
fn settings_stay_with_their_ball_and_go_with_it() {
    let mut world = world(Tier::Full, 1);
    world.marbles.insert(Marble::new(Point3::new(50.0, 0.5, 0.0), 0.5)).unwrap();
    let ids = world.swarm.insert(&[ball([0.0, 0.5, 0.0], [0.0; 3])]).unwrap();
    world.swarm.set_material(ids[0], Some(with_friction(0.9))).unwrap();
    world.swarm.set_gravity_scale(ids[0], 0.7).unwrap();
    for response in [Response::SoftStep, Response::Impulse, Response::SoftStep] {
        world.set_model(Model { response, ..Model::default() }).unwrap();
        steps(&mut world, 3);
        assert_eq!(world.swarm.material(ids[0]).unwrap().friction, 0.9, "{response:?}");
        assert_eq!(world.swarm.gravity_scale(ids[0]), Ok(0.7), "{response:?}");
    }
    world.swarm.remove(&ids).unwrap();
    let next = world.swarm.insert(&[ball([0.0, 0.5, 0.0], [0.0; 3])]).unwrap()[0];
    assert_eq!(world.swarm.material(next).unwrap().friction, 0.3);
    assert_eq!(world.swarm.gravity_scale(next), Ok(1.0));
    assert_eq!(world.swarm.gravity_scale(ids[0]), Err(Error::NoSuchBall(ids[0])));
}

#[test]
fn bad_settings_are_refused_and_change_nothing() {
    let mut world = world(Tier::Full, 1);
    let marble = world.marbles.insert(Marble::new(Point3::new(50.0, 0.5, 0.0), 0.5));
    assert!(marble.is_ok());
    let own = world.swarm.insert(&[ball([0.0, 0.5, 0.0], [0.0; 3])]).unwrap()[0];
    steps(&mut world, 2);
    let before = world.clone();
    assert!(world.swarm.set_material(own, Some(with_friction(-1.0))).is_err());
    assert!(world.swarm.set_material(own, Some(with_friction(f32::NAN))).is_err());
    assert!(world.swarm.set_gravity_scale(own, f32::INFINITY).is_err());
    // The ball that stands for a marble has the marble's settings.
    let row = (0..world.swarm.len()).find(|row| world.swarm.is_marble(*row)).unwrap();
    let of_marble = world.swarm.id(row).unwrap();
    let refused = Err(Error::NoSuchBall(of_marble));
    assert_eq!(world.swarm.set_gravity_scale(of_marble, 2.0), refused);
    assert_eq!(world.swarm.set_material(of_marble, None), refused);
    assert!(world == before);
}

#[test]
fn accelerations_act_for_one_step_and_add_up() {
    for (tier, response) in [
        (Tier::Full, Response::SoftStep),
        (Tier::Full, Response::Impulse),
        (Tier::Lab, Response::Impulse),
    ] {
        let mut world = world(tier, 1);
        world.set_model(Model { response, ..Model::default() }).unwrap();
        world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
        let high = |x: f32| ball([x, 20.0, 0.0], [0.0; 3]);
        let ids = world.swarm.insert(&[high(0.0), high(5.0)]).unwrap();
        world.swarm.set_gravity_scale(ids[1], 2.0).unwrap();
        for acceleration in [Vec3::new(3.0, 0.0, 0.0), Vec3::new(0.0, 0.0, -2.0)] {
            world.swarm.apply_acceleration(ids[0], acceleration).unwrap();
        }
        steps(&mut world, 3);
        let expected = Vec3::new(3.0, 0.0, -2.0) * DT;
        let is = velocity(&world, ids[0]);
        assert!((is - expected).magnitude() < 1e-5, "{tier:?}, {response:?}: {is:?}");
        assert_eq!(velocity(&world, ids[1]), Vec3::new(0.0, 0.0, 0.0));
        let state = world.swarm.get(ids[0]).unwrap();
        assert_eq!((state.velocity, state.radius), (is, 0.5));
        let mass = state.mass.of(0.5) / Mass::default().of(0.5);
        assert!((mass - 1.0).abs() < 1e-6, "{mass}");
        world.swarm.apply_acceleration(ids[0], expected).unwrap();
        world.swarm.remove(&ids[..1]).unwrap();
        assert_eq!(world.swarm.get(ids[0]), Err(Error::NoSuchBall(ids[0])));
        steps(&mut world, 1);
    }
}

#[test]
fn an_acceleration_wakes_whom_it_moves_and_lets_sleep_who_leans_on_a_wall_by_it() {
    let mut world = world(Tier::Full, 1);
    let id = world.swarm.insert(&[ball([0.0, 0.5, 0.0], [0.0; 3])]).unwrap()[0];
    let mut blow = |speed: f32, count: u32| {
        for _ in 0..count {
            world.swarm.apply_acceleration(id, Vec3::new(0.0, speed, 0.0)).unwrap();
            steps(&mut world, 1);
        }
        world.swarm.asleep()
    };
    assert_eq!(blow(-1.0, 200), 1);
    assert_eq!(blow(20.0, 2), 0);
}

/// Balls of the lab's tier have no spin: marbles that become rows of theirs begin without.
#[test]
fn marbles_beside_balls_of_the_lab_become_soft_between_two_steps() {
    for response in [Response::Displacement, Response::Impulse, Response::EventDriven] {
        let mut world = World::<f32>::default();
        world.set_model(Model { response, ..Model::GAME }).unwrap();
        world.swarm.set_model(SwarmModel { tier: Tier::Lab, ..SwarmModel::default() }).unwrap();
        world.swarm.insert(&[Ball::new(Point3::new(0.0, 3.0, 0.0), 0.5)]).unwrap();
        world.marbles.insert(Marble::new(Point3::new(0.0, 0.0, 0.0), 0.5)).unwrap();
        world.step(1.0 / 60.0).unwrap();
        world.set_model(Model::GAME).unwrap();
        assert_eq!(world.unsupported_marbles().len(), 0, "{response:?}");
        world.step(1.0 / 60.0).unwrap();
        assert!(world.marbles.position()[0].y < 0.0, "{response:?}");
    }
}

/// Balls of the swarm that stand for marbles belong to these; and their slots are given out again as those of
/// any ball.
#[test]
fn a_marbles_ball_is_the_marbles() {
    for response in [Response::SoftStep, Response::Impulse] {
        let mut world = world(Tier::Full, 1);
        world.set_model(Model { response, ..Model::default() }).unwrap();
        let marble = world.marbles.insert(Marble::new(Point3::new(0.0, 3.0, 0.0), 0.5)).unwrap();
        let own = world.swarm.insert(&[ball([5.0, 3.0, 0.0], [0.0; 3])]).unwrap()[0];
        steps(&mut world, 1);
        let is_marble = |row: &usize| world.swarm.is_marble(*row);
        let row = (0..world.swarm.len()).find(is_marble).unwrap();
        let of_marble = world.swarm.id(row).unwrap();
        let before = world.clone();
        let refused = Err(Error::NoSuchBall(of_marble));
        assert_eq!(world.swarm.remove(&[of_marble]), refused, "{response:?}");
        assert_eq!(world.swarm.remove(&[own, of_marble]), refused);
        assert_eq!(world.swarm.set_position(of_marble, Point3::new(0.0, 9.0, 0.0)), refused);
        assert_eq!(world.swarm.set_velocity(of_marble, Vec3::unit_x()), refused);
        assert!(world == before);
        // Slots of both are free again.
        world.swarm.remove(&[own]).unwrap();
        let _ = world.marbles.remove(marble).unwrap();
        steps(&mut world, 1);
        let new = [ball([5.0, 3.0, 0.0], [0.0; 3]), ball([7.0, 3.0, 0.0], [0.0; 3])];
        for id in world.swarm.insert(&new).unwrap() {
            assert!(!world.swarm.is_marble(world.swarm.row(id).unwrap()), "{response:?}");
            world.swarm.set_gravity_scale(id, 0.0).unwrap();
        }
    }
}
