//! Contacts push nothing out of closed boxes, of half-spaces or of plates.

use crate::draw::Draw;
use taw::math::Quat;
use taw::prelude::*;
use taw::shape::{Aabb3, Obb};
use taw::swarm::Ball;

const RESPONSES: [Response; 2] = [Response::Displacement, Response::Impulse];

/// Walls of a box of half-spaces, or of plates of this thickness, 2 m wide inside.
fn closed_box(world: &mut World<f64>, thickness: Option<f64>) {
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let mut normal = Vec3::zero();
            normal[axis] = side;
            let Some(thickness) = thickness else {
                world.walls.insert(Plane::new(-normal, -1.0).unwrap()).unwrap();
                continue;
            };
            let mut half = Vec3::new(1.5, 1.5, 1.5);
            half[axis] = thickness / 2.0;
            let center = Point3::from_vec(normal * (1.0 + half[axis]));
            let upright = Quat::new(1.0, 0.0, 0.0, 0.0);
            world.walls.insert(Obb::new(center, upright, half).unwrap()).unwrap();
        }
    }
}

/// Balls at random places of that box, apart from each other.
fn crowd(
    world: &mut World<f64>,
    random: &mut fastrand::Rng,
    count: usize,
    speed: f64,
    masses: f64,
) {
    let mut balls: Vec<(Vec3<f64>, f64)> = Vec::new();
    for _ in 0..20 * count {
        let radius = 0.04 * 6.0_f64.powf(random.f64());
        let mut any = || 2.0 * random.f64() - 1.0;
        let at = Vec3::new(any(), any(), any()) * (1.0 - radius);
        let velocity = Vec3::new(any(), any(), any()) * speed;
        if balls.len() < count && balls.iter().all(|b| (b.0 - at).magnitude() > b.1 + radius) {
            balls.push((at, radius));
            let (restitution, friction) = (random.f64(), random.f64());
            let material = Some(Material { restitution, friction, ..Material::default() });
            let mass = taw::motion::Mass::Kilograms(masses.powf(random.f64()));
            let marble = Marble::new(Point3::from_vec(at), radius);
            world.marbles.insert(Marble { velocity, material, mass, ..marble }).unwrap();
        }
    }
}

/// Runs of each response that get a centre outside of the box.
fn escapes(runs: usize, run: impl Fn(Response, usize) -> World<f64>) -> [Vec<usize>; 2] {
    let leaves = |response: Response, number: usize| {
        let mut world = run(response, number);
        (0..30).any(|_| {
            world.step(1.0 / 60.0).unwrap();
            world.marbles.position().iter().any(|p| p.x.abs().max(p.y.abs()).max(p.z.abs()) > 1.0)
        })
    };
    RESPONSES.map(|response| (0..runs).filter(|number| leaves(response, *number)).collect())
}

fn in_a_box(response: Response, thickness: Option<f64>) -> World<f64> {
    let mut world = World::default();
    let rotation = Rotation::Dynamic;
    world.set_model(Model { response, rotation, ..Model::default() }).unwrap();
    closed_box(&mut world, thickness);
    world
}

#[test]
fn crowds_of_unequal_masses_stay_in_a_box_of_half_spaces() {
    let out = escapes(200, |response, run| {
        let mut random = fastrand::Rng::with_seed(run as u64);
        let mut world = in_a_box(response, None);
        crowd(&mut world, &mut random, 25, 1000.0, 1e9);
        world
    });
    assert!(out.iter().all(Vec::is_empty), "of {RESPONSES:?}: {out:?}");
}

#[test]
fn the_fastest_balls_stay_in_a_box_of_plates() {
    let out = escapes(100, |response, run| {
        let mut random = fastrand::Rng::with_seed(run as u64);
        let mut world = in_a_box(response, Some(0.1));
        crowd(&mut world, &mut random, 4, 1e6, 1.0);
        world
    });
    assert!(out.iter().all(Vec::is_empty), "of {RESPONSES:?}: {out:?}");
}

#[test]
fn heaps_stay_in_a_box_of_thin_plates() {
    let out = escapes(4, |response, run| {
        let mut random = fastrand::Rng::with_seed(run as u64);
        let mut world = in_a_box(response, Some(0.02));
        // Pressed against one of its edges.
        world.set_gravity(Vec3::new(-100.0, -100.0, 0.0)).unwrap();
        for i in 0..300 {
            let [x, y, z] = [i % 8, i / 64, i / 8 % 8].map(|i| 0.23 * f64::from(i) - 0.8);
            let jitter = 0.01 * random.f64();
            world.marbles.insert(Marble::new(Point3::new(x + jitter, y, z), 0.1)).unwrap();
        }
        world
    });
    assert!(out.iter().all(Vec::is_empty), "of {RESPONSES:?}: {out:?}");
}

/// Through walls and another one of infinite mass, which it meets behind the wall; it pushes aside what it
/// meets before it. (`EventDriven` stops what it squeezes, and itself.)
#[test]
fn a_marble_of_infinite_mass_goes_through_walls_as_it_is_told() {
    // `Displacement` knows no masses.
    let penalties = [ContactLaw::SpringDashpot, ContactLaw::HertzMindlin].map(Response::Penalty);
    let exact = [Response::Impulse, Response::SoftStep, Response::EventDriven];
    for response in exact.into_iter().chain(penalties) {
        for (thickness, speed) in
            [None, Some(0.02)].into_iter().flat_map(|thickness| [0.5, 20.0].map(|v| (thickness, v)))
        {
            let mut world = in_a_box(response, thickness);
            world.set_gravity(Vec3::zero()).unwrap();
            let velocity = Vec3::new(0.0, -speed, 0.0);
            let infinite = |y: f64, velocity| Marble {
                velocity,
                mass: taw::motion::Mass::Infinite,
                ..Marble::new(Point3::new(0.0, y, 0.0), 0.1)
            };
            let ids = [infinite(-0.7, velocity), infinite(-1.25, Vec3::zero())]
                .map(|marble| world.marbles.insert(marble).unwrap());
            let x = if response == Response::EventDriven { 0.5 } else { 0.02 };
            let start = Point3::new(x, -0.86, 0.0);
            let light = world.marbles.insert(Marble::new(start, 0.05)).unwrap();
            for step in 1..=60 {
                world.step(1.0 / 60.0).unwrap();
                let y = -0.7 - speed * f64::from(step) / 60.0;
                let name = || format!("{response:?} {thickness:?} {speed} m/s, step {step}");
                let [moves, stays] = ids.map(|id| world.marbles.get(id).unwrap());
                assert!((moves.position.y / y - 1.0).abs() < 1e-5, "{}: {moves:?}", name());
                assert_eq!(stays.velocity, Vec3::zero(), "{}", name());
                assert_eq!(stays.position.y, -1.25, "{}", name());
            }
            let light = world.marbles.get(light).unwrap();
            let name = || format!("{response:?} {thickness:?} {speed} m/s: {light:?}");
            assert!(light.position.y > -1.0, "{}", name());
            let moved = (light.position - start).magnitude();
            // Penalties do not sweep marbles against each other.
            let meets = match response {
                Response::EventDriven => false,
                Response::Penalty(_) => speed < 1.0,
                _ => true,
            };
            assert_eq!(moved > 0.02, meets, "{}", name());
        }
    }
}

/// Two of infinite mass come together about light ones, which follow the faster one.
#[test]
fn marbles_between_two_of_infinite_mass_are_pinched_in_finite_time() {
    for response in [Response::Impulse, Response::SoftStep] {
        for (count, speeds) in
            [1, 2, 3].into_iter().flat_map(|n| [[20.0, 20.0], [5.0, 40.0]].map(|v| (n, v)))
        {
            for order in 0..2 {
                let mut world = World::<f64>::default();
                let rotation = Rotation::Dynamic;
                world.set_model(Model { response, rotation, ..Model::default() }).unwrap();
                world.set_gravity(Vec3::zero()).unwrap();
                let heavy = |x: f64, speed: f64| Marble {
                    velocity: Vec3::new(speed, 0.0, 0.0),
                    mass: taw::motion::Mass::Infinite,
                    ..Marble::new(Point3::new(x, 0.0, 0.0), 0.1)
                };
                let mut marbles = vec![heavy(-0.4, speeds[0])];
                marbles.extend((0..count).map(|i| {
                    let x = 0.11 * f64::from(i) - 0.055 * f64::from(count - 1);
                    Marble::new(Point3::new(x, 0.001, 0.0), 0.05)
                }));
                marbles.push(heavy(0.4, -speeds[1]));
                if order == 1 {
                    marbles.reverse();
                }
                let ids: Vec<_> =
                    marbles.iter().map(|marble| world.marbles.insert(*marble).unwrap()).collect();
                for _ in 0..20 {
                    world.step(1.0 / 60.0).unwrap();
                }
                for (id, began) in ids.iter().zip(&marbles) {
                    let ends = world.marbles.get(*id).unwrap();
                    assert!(ends.position.x.is_finite(), "{response:?} {speeds:?} {ends:?}");
                    if began.mass == taw::motion::Mass::Infinite {
                        let x = began.position.x + began.velocity.x / 3.0;
                        let name = || format!("{response:?} {count} {speeds:?}: {ends:?}");
                        assert!((ends.position.x - x).abs() < 1e-4, "{}", name());
                    }
                }
            }
        }
    }
}

/// A marble flies at a ball of the swarm that lies before a sheet or a thick box: their bounces must not
/// carry it through.
#[test]
fn swarms_push_no_marble_through_a_wall() {
    let mut draw = Draw(1);
    for scene in 0..6_000 {
        let mut between = |low: f32, high: f32| draw.between(low.into(), high.into()) as f32;
        let response =
            [Response::Displacement, Response::Impulse, Response::EventDriven][scene % 3];
        let thickness = [0.0, 0.5][scene / 3 % 2];
        let restitution = [0.0, 0.5, 1.0][scene / 6 % 3];
        let (speed, density) = (between(1.0, 100.0), between(100.0, 10_000.0));
        let (radius, of_ball) = (between(0.05, 0.25), between(0.05, 0.25));
        let ball = Point3::new(between(0.0, 0.2), between(of_ball, 0.6), 0.0);
        let height = ball.y + (radius + of_ball) * between(1.0, 2.0);
        let mut world = World::<f32>::default();
        world.set_model(Model { response, substeps: 1, ..Model::GAME }).unwrap();
        world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
        let [min, max] = [[-9.0, -thickness, -9.0], [9.0, 0.0, 9.0]].map(Point3::from);
        world.walls.insert(Aabb3::new(min, max).unwrap()).unwrap();
        let material = Material { restitution, friction: 0.0, ..Material::default() };
        let marble = Marble {
            velocity: Vec3::new(0.0, -speed, 0.0),
            mass: Mass::Density(density),
            material: Some(material),
            ..Marble::new(Point3::new(0.0, height, 0.0), radius)
        };
        world.marbles.insert(marble).unwrap();
        world.swarm.insert(&[Ball::new(ball, of_ball)]).unwrap();
        for step in 1..=8 {
            world.step(1.0 / 60.0).unwrap();
            let y = world.marbles.position()[0].y;
            assert!(y > 0.0, "scene {scene}, {response:?}: {y} m in step {step}");
        }
    }
}
