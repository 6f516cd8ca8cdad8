//! `Response::SoftStep`: marbles on the rows of the swarm.

mod breaks;
mod columns;
mod drums;
mod glancing;
mod impacts;
mod impulses;
mod leaning;
mod moving_walls;
mod overlaps;
mod precision;
mod state;
mod tangential;
mod tunnelling;
mod walls;

use cgmath::{InnerSpace, Zero};
use taw::prelude::*;
use taw::swarm::Ball;

fn world<S: Scalar>(substeps: u32) -> World<S> {
    let mut world = World::default();
    let model = Model {
        response: Response::SoftStep,
        rotation: Rotation::Dynamic,
        substeps,
        ..Model::default()
    };
    world.set_model(model).unwrap();
    world
}

fn floor<S: Scalar>(world: &mut World<S>) -> WallId {
    world.walls.insert(Plane::new(Vec3::unit_y(), S::zero()).unwrap()).unwrap()
}

#[test]
fn a_marble_dropped_on_a_floor_comes_to_rest_there() {
    let mut world = world::<f32>(4);
    floor(&mut world);
    let taw = world.marbles.insert(Marble::new(Point3::new(0.0, 2.0, 0.0), 0.5)).unwrap();
    for _ in 0..600 {
        world.step(1.0 / 60.0).unwrap();
    }
    let marble = world.marbles.get(taw).unwrap();
    assert!((marble.position.y - 0.5).abs() < 1e-3, "{marble:?}");
    assert!(marble.velocity.magnitude() < 1e-6, "{marble:?}");
}

#[test]
fn a_bounce_reaches_the_height_that_restitution_leaves() {
    for (substeps, e) in [(1, 0.5), (4, 0.5), (4, 0.9), (8, 1.0), (2, 0.7)] {
        let mut world = world::<f32>(substeps);
        floor(&mut world);
        let material = Material { restitution: e, ..Material::default() };
        let marble =
            Marble { material: Some(material), ..Marble::new(Point3::new(0.0, 1.1, 0.0), 0.1) };
        let taw = world.marbles.insert(marble).unwrap();
        let (mut highest, mut bounced) = (0.0_f32, false);
        for _ in 0..120 {
            world.step(1.0 / 60.0).unwrap();
            let marble = world.marbles.get(taw).unwrap();
            if marble.velocity.y > 0.0 {
                bounced = true;
            } else if bounced && highest > 0.0 {
                break;
            }
            if bounced {
                highest = highest.max(marble.position.y - 0.1);
            }
        }
        let asked = e * e;
        println!("{substeps} {e}: {highest} asked {asked}");
        assert!((highest - asked).abs() < 0.02 * asked, "{substeps}: {highest}, not {asked}");
    }
}

#[test]
fn a_slipping_ball_rolls_at_five_sevenths_of_its_speed() {
    let mut world = world::<f32>(2);
    floor(&mut world);
    let marble = Marble {
        velocity: Vec3::new(3.0, 0.0, 0.0),
        ..Marble::new(Point3::new(0.0, 0.2, 0.0), 0.2)
    };
    let taw = world.marbles.insert(marble).unwrap();
    for _ in 0..120 {
        world.step(1.0 / 60.0).unwrap();
    }
    let marble = world.marbles.get(taw).unwrap();
    println!("{} {}", marble.velocity.x, marble.angular_velocity.z);
    assert!((marble.velocity.x - 15.0 / 7.0).abs() < 1e-3, "{marble:?}");
    assert!((marble.angular_velocity.z * 0.2 + marble.velocity.x).abs() < 1e-3, "{marble:?}");
}

#[test]
fn on_a_slope_it_rolls_with_five_sevenths_of_gravity() {
    for angle in [0.1_f32, 0.3] {
        let mut world = world::<f32>(2);
        let normal = Vec3::new(-angle.sin(), angle.cos(), 0.0);
        world.walls.insert(Plane::new(normal, 0.0).unwrap()).unwrap();
        let material = Material { friction: 0.5, ..Material::default() };
        let marble = Marble {
            material: Some(material),
            ..Marble::new(Point3::new(0.0, 0.0, 0.0) + normal * 0.1, 0.1)
        };
        let taw = world.marbles.insert(marble).unwrap();
        for _ in 0..60 {
            world.step(1.0 / 60.0).unwrap();
        }
        let speed = world.marbles.get(taw).unwrap().velocity.magnitude();
        let asked = 5.0 / 7.0 * 9.81 * angle.sin();
        println!("{angle}: {speed} {asked}");
        assert!((speed - asked).abs() < 2e-3 * asked, "{speed}, not {asked}");
    }
}

#[test]
fn rolling_resistance_holds_a_ball_on_slopes_up_to_its_tangent() {
    for (angle, holds) in [(0.08_f32, true), (0.12, false)] {
        let mut world = world::<f32>(2);
        let normal = Vec3::new(-angle.sin(), angle.cos(), 0.0);
        world.walls.insert(Plane::new(normal, 0.0).unwrap()).unwrap();
        let material = Material { friction: 0.5, rolling_resistance: 0.1, ..Material::default() };
        let marble = Marble {
            material: Some(material),
            ..Marble::new(Point3::new(0.0, 0.0, 0.0) + normal * 0.1, 0.1)
        };
        let taw = world.marbles.insert(marble).unwrap();
        for _ in 0..120 {
            world.step(1.0 / 60.0).unwrap();
        }
        let way =
            world.marbles.get(taw).unwrap().position - (Point3::new(0.0, 0.0, 0.0) + normal * 0.1);
        println!("{angle}: {}", way.magnitude());
        assert_eq!(way.magnitude() < 1e-3, holds, "{}", way.magnitude());
    }
}

#[test]
fn an_elastic_gas_keeps_its_energy() {
    for substeps in [1, 2, 4] {
        let mut world = world::<f32>(substeps);
        world.set_gravity(Vec3::zero()).unwrap();
        for axis in [Vec3::unit_x(), Vec3::unit_y(), Vec3::unit_z()] {
            for n in [axis, -axis] {
                world.walls.insert(Plane::new(n, -3.0).unwrap()).unwrap();
            }
        }
        let material = Material { restitution: 1.0, friction: 0.0, ..Material::default() };
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 40) as f32 / (1 << 23) as f32 - 1.0
        };
        for i in 0..216_u16 {
            let at = [i % 6, i / 6 % 6, i / 36].map(|k| f32::from(k) * 0.9 - 2.25);
            let velocity = Vec3::new(random(), random(), random()) * 3.0;
            let marble =
                Marble { velocity, material: Some(material), ..Marble::new(Point3::from(at), 0.3) };
            world.marbles.insert(marble).unwrap();
        }
        let before = world.energy().total();
        let mut most = before;
        for _ in 0..600 {
            world.step(1.0 / 60.0).unwrap();
            most = most.max(world.energy().total());
        }
        let after = world.energy().total();
        println!("{substeps}: {} {}", after / before, most / before);
        assert!((after / before - 1.0).abs() < 0.01, "{}", after / before);
        assert!(most / before < 1.0 + 1e-4, "{}", most / before);
    }
}

#[test]
fn marbles_and_balls_of_a_swarm_go_the_same_way() {
    let places = (0..300_u16).map(|i| {
        let [x, y, z] = [i % 6, i / 36, i / 6 % 6].map(f32::from);
        Point3::new(x * 0.22 + y * 0.013, 0.2 + y * 0.25, z * 0.21 + y * 0.017)
    });
    let places: Vec<_> = places.collect();
    let mass = taw::world::Mass::Kilograms(0.5);
    let mut marbles = world::<f32>(2);
    let mut balls = world::<f32>(2);
    for world in [&mut marbles, &mut balls] {
        floor(world);
        for axis in [Vec3::unit_x(), Vec3::unit_z()] {
            world.walls.insert(Plane::new(axis, -0.2).unwrap()).unwrap();
            world.walls.insert(Plane::new(-axis, -1.4).unwrap()).unwrap();
        }
    }
    let ids: Vec<_> = places
        .iter()
        .map(|at| marbles.marbles.insert(Marble { mass, ..Marble::new(*at, 0.1) }).unwrap())
        .collect();
    let all: Vec<_> = places.iter().map(|at| Ball { mass, ..Ball::new(*at, 0.1) }).collect();
    let names = balls.swarm.insert(&all).unwrap();
    for _ in 0..300 {
        marbles.step(1.0 / 60.0).unwrap();
        balls.step(1.0 / 60.0).unwrap();
    }
    for (id, name) in ids.iter().zip(names) {
        let marble = marbles.marbles.get(*id).unwrap();
        let row = balls.swarm.row(name).unwrap();
        let [x, y, z, _] = balls.swarm.balls()[row];
        assert_eq!(Point3::new(x, y, z), marble.position);
    }
}

#[test]
fn a_heavy_ball_hardly_sinks_into_a_light_one() {
    let mut world = world::<f32>(4);
    floor(&mut world);
    let dense = |density| taw::world::Mass::Density(density);
    let light = Marble { mass: dense(1.0), ..Marble::new(Point3::new(0.0, 0.5, 0.0), 0.5) };
    let heavy = Marble { mass: dense(1000.0), ..Marble::new(Point3::new(0.0, 1.5, 0.0), 0.5) };
    let light = world.marbles.insert(light).unwrap();
    let heavy = world.marbles.insert(heavy).unwrap();
    let mut deepest = 0.0_f32;
    for _ in 0..300 {
        world.step(1.0 / 60.0).unwrap();
        let [a, b] = [light, heavy].map(|id| world.marbles.get(id).unwrap().position);
        deepest = deepest.max(1.0 - (b - a).magnitude()).max(0.5 - a.y);
    }
    println!("{deepest}");
    assert!(deepest < 0.005, "{deepest}");
}

#[test]
fn a_marble_without_gravity_stays_and_a_push_moves_it_as_newton_says() {
    let mut world = world::<f32>(3);
    let free = Marble { gravity_scale: 0.0, ..Marble::new(Point3::new(0.0, 2.0, 0.0), 0.5) };
    let free = world.marbles.insert(free).unwrap();
    let half = Marble { gravity_scale: 0.5, ..Marble::new(Point3::new(5.0, 0.0, 0.0), 0.5) };
    let half = world.marbles.insert(half).unwrap();
    let mass = taw::world::Mass::Kilograms(3.0);
    let pushed = Marble { mass, ..Marble::new(Point3::new(9.0, 0.0, 0.0), 0.5) };
    let pushed = world.marbles.insert(pushed).unwrap();
    for _ in 0..60 {
        world.marbles.apply_force(pushed, Vec3::new(6.0, 0.0, 0.0)).unwrap();
        world.step(1.0 / 60.0).unwrap();
    }
    let at = |id| world.marbles.get(id).unwrap();
    assert_eq!(at(free).position.y, 2.0);
    assert!((at(half).velocity.y + 4.905).abs() < 1e-3, "{:?}", at(half));
    assert!((at(pushed).velocity.x - 2.0).abs() < 1e-3, "{:?}", at(pushed));
}

#[test]
fn marbles_and_balls_push_each_other_as_equals() {
    for marble_first in [true, false] {
        let mut world = world::<f32>(2);
        world.set_gravity(Vec3::zero()).unwrap();
        let mass = taw::world::Mass::Kilograms(1.0);
        let ends = [Vec3::new(2.0, 0.0, 0.0), Vec3::zero()];
        let [u, v] = if marble_first { ends } else { [ends[1], ends[0]] };
        let [p, q] = if marble_first { [0.0, 1.0] } else { [1.0, 0.0] };
        let marble = Marble { velocity: u, mass, ..Marble::new(Point3::new(p, 0.0, 0.0), 0.1) };
        let id = world.marbles.insert(marble).unwrap();
        let ball = Ball { velocity: v, mass, ..Ball::new(Point3::new(q, 0.01, 0.0), 0.1) };
        let ball = world.swarm.insert(&[ball]).unwrap()[0];
        for _ in 0..60 {
            world.step(1.0 / 60.0).unwrap();
        }
        let row = world.swarm.row(ball).unwrap();
        let [x, ..] = world.swarm.velocities()[row];
        let sum = world.marbles.get(id).unwrap().velocity.x + x;
        assert!((sum - 2.0).abs() < 1e-5, "{sum}");
        let struck = if marble_first { x } else { world.marbles.get(id).unwrap().velocity.x };
        assert!(struck > 1.4, "{struck}");
    }
}
