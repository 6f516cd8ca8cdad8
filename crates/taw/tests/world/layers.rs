//! Collision layers: who meets whom, in every response, with any detection, and in swarms.

use taw::prelude::*;
use taw::shape::{Aabb, Obb};
use taw::swarm::{Ball, BallId, SwarmModel, Tier};
use taw::world::WallShape;

const SOLID: u32 = 1 << 0;
const RED: u32 = 1 << 1;
const BLUE: u32 = 1 << 31;
const RESPONSES: [Response; 5] = [
    Response::Displacement,
    Response::Impulse,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::EventDriven,
    Response::SoftStep,
];

fn models() -> impl Iterator<Item = Model> {
    let detections = [Detection::Discrete, Detection::Swept];
    RESPONSES.into_iter().flat_map(move |response| {
        let rotation = Rotation::Dynamic;
        detections.map(|detection| {
            let substeps = if response == Response::EventDriven { 1 } else { 4 };
            Model { response, detection, rotation, substeps, ..Model::default() }
        })
    })
}

fn world<S: Scalar>(model: Model) -> World<S> {
    let mut world = World::default();
    world.set_model(model).unwrap();
    world
}

fn plane<S: Scalar>() -> WallShape<S> {
    Plane::new(Vec3::unit_y(), S::zero()).unwrap().into()
}

/// A box of which the top is at height zero.
fn slab<S: Scalar>() -> WallShape<S> {
    let corner = |x: f64, y: f64| Point3::new(S::from_f64(x), S::from_f64(y), S::from_f64(x));
    Obb::from_aabb(&Aabb { min: corner(-9.0, -0.5), max: corner(9.0, 0.0) }).into()
}

fn marble<S: Scalar>([x, y, z]: [f64; 3], layers: CollisionLayers) -> Marble<S> {
    let material = Material { restitution: S::zero(), ..Material::default() };
    let position = Point3::new(S::from_f64(x), S::from_f64(y), S::from_f64(z));
    Marble { layers, material: Some(material), ..Marble::new(position, S::from_f64(0.5)) }
}

fn run<S: Scalar>(world: &mut World<S>, seconds: f64) {
    for _ in 0..(seconds * 64.0) as u32 {
        world.step(S::from_f64(1.0 / 64.0)).unwrap();
    }
}

fn place<S: Scalar>(world: &World<S>, id: MarbleId) -> Point3<S> {
    world.marbles.get(id).unwrap().position
}

fn height<S: Scalar>(world: &World<S>, id: MarbleId) -> f64 {
    place(world, id).y.as_f64()
}

/// Red marbles rest on a red floor, blue ones fall through it, and through red ones; fast ones too.
fn falls_through<S: Scalar>(model: Model, floor: WallShape<S>, speed: f64) {
    let mut world = world::<S>(model);
    let wall = world.walls.insert(floor).unwrap();
    world.walls.set_layers(wall, CollisionLayers::new(SOLID, RED)).unwrap();
    let red = CollisionLayers::new(RED, RED | SOLID);
    let blue = CollisionLayers::new(BLUE, BLUE | SOLID);
    let velocity = Vec3::new(S::zero(), S::from_f64(-speed), S::zero());
    let marble = |at, layers| Marble { velocity, ..marble(at, layers) };
    let reds = [0.6, 1.7].map(|y| world.marbles.insert(marble([0.0, y, 0.0], red)).unwrap());
    let blues = [4.0, 5.1].map(|y| world.marbles.insert(marble([0.0, y, 0.0], blue)).unwrap());
    run(&mut world, 2.0);
    let context = format!("{model:?} at {speed} m/s");
    for id in reds {
        assert!(height(&world, id) > 0.0, "{context}: {:?}", place(&world, id));
    }
    for id in blues {
        assert!(height(&world, id) < -10.0, "{context}: {:?}", place(&world, id));
        let at = place(&world, id);
        assert_eq!((at.x, at.z), (S::zero(), S::zero()), "{context}");
    }
    // They still meet each other.
    assert!(height(&world, blues[1]) - height(&world, blues[0]) > 0.9, "{context}");
    let listed = world.contacts.wm.iter().map(|c| c.b);
    assert!(listed.chain(world.contacts.mm.iter().flat_map(|c| [c.a, c.b])).all(|row| {
        let id = world.marbles.id(row as usize).unwrap();
        let other_blue = |c: &Contact<S>| c.a == row || c.b == row;
        reds.contains(&id)
            || world.contacts.mm.iter().filter(|c| other_blue(c)).all(|c| {
                [c.a, c.b]
                    .iter()
                    .all(|row| blues.contains(&world.marbles.id(*row as usize).unwrap()))
            }) && !world.contacts.wm.iter().any(|c| c.b == row)
    }));
}

#[test]
fn marbles_meet_only_whom_their_layers_say() {
    for model in models() {
        for speed in [0.0, 100.0] {
            falls_through::<f32>(model, plane(), speed);
            falls_through::<f64>(model, plane(), speed);
            // Discrete detection misses thin walls.
            if speed == 0.0 || model.detection == Detection::Swept {
                falls_through::<f32>(model, slab(), speed);
                falls_through::<f64>(model, slab(), speed);
            }
        }
    }
}

#[test]
fn both_must_agree() {
    let (one, other) = (CollisionLayers::new(RED, BLUE), CollisionLayers::new(BLUE, RED));
    let deaf = CollisionLayers::new(BLUE, SOLID);
    assert!(one.interacts_with(other) && other.interacts_with(one));
    assert!(!one.interacts_with(deaf) && !deaf.interacts_with(one));
    assert!(!CollisionLayers::ALL.interacts_with(CollisionLayers::NONE));
    assert_eq!(CollisionLayers::default(), CollisionLayers::ALL);
}

/// Two groups that do not meet, in the same place, go as each goes alone.
#[test]
fn groups_go_as_each_goes_alone() {
    let mut seed = fastrand::Rng::with_seed(5);
    for model in models() {
        for round in 0..20 {
            // `SoftStep` solves in the order of colours, which differs: so gentler there.
            let soft = model.response == Response::SoftStep;
            let spread = if soft { 3.0 } else { 1.5 };
            let at: Vec<[f64; 3]> =
                (0..8).map(|_| [0, 1, 2].map(|_| 0.5 + spread * seed.f64())).collect();
            let groups = [RED, BLUE].map(|layer| CollisionLayers::new(layer | SOLID, layer));
            let build = |with: &[u32]| {
                let mut world = world::<f64>(model);
                for (normal, layers) in [(Vec3::unit_y(), RED | BLUE), (Vec3::unit_x(), RED)] {
                    let wall = world.walls.insert(Plane::new(normal, 0.0).unwrap()).unwrap();
                    world.walls.set_layers(wall, CollisionLayers::new(layers, SOLID)).unwrap();
                }
                let ids: Vec<_> = (0..8)
                    .filter(|i| with.contains(&(i % 2)))
                    .map(|i| {
                        let layers = groups[i as usize % 2];
                        world.marbles.insert(marble(at[i as usize], layers)).unwrap()
                    })
                    .collect();
                (world, ids)
            };
            let (mut both, all) = build(&[0, 1]);
            run(&mut both, 0.1);
            for group in 0..2_usize {
                let (mut alone, ids) = build(&[group as u32]);
                run(&mut alone, 0.1);
                for (id, in_both) in ids.iter().zip(all.iter().skip(group).step_by(2)) {
                    let (x, y) = (place(&alone, *id), place(&both, *in_both));
                    let apart = (x - y).magnitude();
                    let bound = if soft { 3e-2 } else { 1e-3 };
                    assert!(apart < bound, "{model:?} {round}: {apart} m, {x:?} and {y:?}");
                }
            }
        }
    }
}

#[test]
fn layers_change_while_running() {
    for model in models() {
        let mut world = world::<f32>(model);
        let wall = world.walls.insert(slab()).unwrap();
        let lower = Marble {
            mass: taw::world::Mass::Infinite,
            gravity_scale: 0.0,
            ..marble([5.0, 0.5, 0.0], CollisionLayers::ALL)
        };
        let bearer = world.marbles.insert(lower).unwrap();
        let [on_wall, on_bearer] = [[0.0, 0.5, 0.0], [5.0, 1.5, 0.0]]
            .map(|at| world.marbles.insert(marble(at, CollisionLayers::ALL)).unwrap());
        run(&mut world, 3.0);
        assert!(height(&world, on_wall) > 0.4, "{model:?}");
        assert!(height(&world, on_bearer) > 1.2, "{model:?}");
        if model.response == Response::SoftStep {
            assert!(world.is_asleep(on_wall).unwrap() && world.is_asleep(on_bearer).unwrap());
        }
        let copy = world.clone();
        world.walls.set_layers(wall, CollisionLayers::new(SOLID, BLUE)).unwrap();
        assert_eq!(world.walls.layers(wall).unwrap(), CollisionLayers::new(SOLID, BLUE));
        assert!(world != copy);
        world.marbles.set_layers(bearer, CollisionLayers::NONE).unwrap();
        assert_eq!(world.marbles.get(bearer).unwrap().layers, CollisionLayers::NONE);
        world.marbles.set_layers(on_wall, CollisionLayers::new(RED, RED)).unwrap();
        run(&mut world, 1.0);
        assert!(height(&world, on_wall) < -2.0, "{model:?}: {:?}", place(&world, on_wall));
        // It is in all layers, so in that of the wall below.
        let at = height(&world, on_bearer);
        assert!((at - 0.5).abs() < 0.1, "{model:?}: {at}");
    }
}

/// A wall that a marble does not meet hides no part of one that it does.
#[test]
fn a_filtered_wall_covers_no_other() {
    for model in models() {
        let mut world = world::<f64>(model);
        world.walls.insert(slab()).unwrap();
        let above = world.walls.insert(Plane::new(Vec3::unit_y(), 0.1).unwrap()).unwrap();
        let flush = world.walls.insert(slab()).unwrap();
        for wall in [above, flush] {
            world.walls.set_layers(wall, CollisionLayers::new(BLUE, BLUE)).unwrap();
        }
        let id = world.marbles.insert(marble([0.3, 0.7, 0.2], CollisionLayers::new(RED, !BLUE)));
        let id = id.unwrap();
        run(&mut world, 3.0);
        let at = height(&world, id);
        assert!((at - 0.5).abs() < 0.02, "{model:?}: {at}");
    }
}

fn ball_height(world: &World<f32>, ball: BallId) -> f32 {
    world.swarm.balls()[world.swarm.row(ball).unwrap()][1]
}

/// Balls of a swarm, among many, with slow and fast ones, on a plane and on a box.
#[test]
fn balls_of_swarms_have_layers() {
    for (tier, threads) in [(Tier::Full, 1), (Tier::Full, 3), (Tier::Lab, 1), (Tier::Lab, 2)] {
        for floor in [plane, slab] {
            let mut world = World::<f32>::default();
            let model = SwarmModel { tier, threads, ..SwarmModel::default() };
            world.swarm.set_model(model).unwrap();
            let wall = world.walls.insert(floor()).unwrap();
            world.walls.set_layers(wall, CollisionLayers::new(SOLID, !BLUE)).unwrap();
            let grid = || (0..12_u8).flat_map(|x| (0..12_u8).map(move |z| [x, z].map(f32::from)));
            let reds: Vec<_> =
                grid().map(|[x, z]| Ball::new(Point3::new(x - 5.5, 0.6, z - 5.5), 0.45)).collect();
            let blues: Vec<_> = grid()
                .enumerate()
                .map(|(i, [x, z])| Ball {
                    velocity: Vec3::unit_y() * if i % 3 == 0 { -30.0 } else { 0.0 },
                    ..Ball::new(Point3::new(x - 5.3, 1.2, z - 5.4), 0.45)
                })
                .collect();
            let reds = world.swarm.insert(&reds).unwrap();
            let blues = world.swarm.insert(&blues).unwrap();
            world.swarm.set_layers(&blues, CollisionLayers::new(BLUE, BLUE)).unwrap();
            let layers = world.swarm.layers(blues[7]).unwrap();
            assert_eq!(layers, CollisionLayers::new(BLUE, BLUE));
            world.swarm.set_layers(&reds, CollisionLayers::new(RED, RED | SOLID)).unwrap();
            run(&mut world, 1.5);
            for id in &reds {
                let at = ball_height(&world, *id);
                assert!((at - 0.45).abs() < 0.05, "{tier:?}: {at}");
            }
            for id in &blues {
                let at = ball_height(&world, *id);
                assert!(at < -8.0, "{tier:?}: {at}");
            }
        }
    }
}

/// A ball that rested, asleep, on one that nobody meets any more, falls.
#[test]
fn balls_wake_when_layers_change() {
    let mut world = World::<f32>::default();
    world.walls.insert(plane()).unwrap();
    let places = [[0.0, 0.5, 0.0], [0.9, 0.5, 0.0], [0.45, 0.5, 0.8], [0.45, 1.2, 0.27]];
    let balls = world.swarm.insert(&places.map(|at| Ball::new(at.into(), 0.5))).unwrap();
    let cage = world.walls.insert(Sphere::new(Point3::new(0.45, 1e3, 0.27), 1.0).unwrap());
    cage.unwrap();
    run(&mut world, 4.0);
    let before = ball_height(&world, balls[3]);
    world.swarm.set_layers(&balls[..3], CollisionLayers::NONE).unwrap();
    run(&mut world, 2.0);
    let after = ball_height(&world, balls[3]);
    assert!((after - 0.5).abs() < 0.02 && before >= 0.49, "{before} {after}");
    assert!(ball_height(&world, balls[0]) < -5.0);
}

/// Marbles and balls of a swarm, as rows of one solve and as proxies.
#[test]
fn marbles_and_balls_of_swarms_agree() {
    for response in [Response::SoftStep, Response::Impulse] {
        let mut world =
            world::<f32>(Model { response, rotation: Rotation::Dynamic, ..Model::default() });
        world.walls.insert(plane()).unwrap();
        let platform = |x| Marble {
            mass: taw::world::Mass::Infinite,
            gravity_scale: 0.0,
            ..marble([x, 3.0, 0.0], CollisionLayers::new(SOLID, RED))
        };
        for x in [0.0, 5.0] {
            world.marbles.insert(platform(x)).unwrap();
        }
        let balls = world
            .swarm
            .insert(&[0.0, 5.0].map(|x| Ball::new(Point3::new(x, 5.0, 0.0), 0.5)))
            .unwrap();
        world.swarm.set_layers(&balls[..1], CollisionLayers::new(RED, u32::MAX)).unwrap();
        world.swarm.set_layers(&balls[1..], CollisionLayers::new(BLUE, u32::MAX)).unwrap();
        run(&mut world, 0.9);
        assert!(ball_height(&world, balls[0]) > 3.5, "{response:?}");
        assert!(ball_height(&world, balls[1]) < 2.0, "{response:?}");
        // And the other way about while they fall.
        world.swarm.remove(&balls).unwrap();
        let before = world.clone();
        assert!(world.swarm.set_layers(&balls, CollisionLayers::NONE).is_err());
        assert!(world == before);
        let ball = world.swarm.insert(&[Ball::new(Point3::new(5.0, 5.0, 0.0), 0.5)]).unwrap()[0];
        assert_eq!(world.swarm.layers(ball).unwrap(), CollisionLayers::ALL);
        run(&mut world, 0.9);
        assert!(ball_height(&world, ball) > 3.5, "{response:?}");
    }
}
