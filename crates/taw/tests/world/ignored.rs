//! Pairs that pass through each other, in every response, with any detection.

use taw::Error;
use taw::prelude::*;
use taw::shape::{Aabb, Obb};
use taw::swarm::{Ball, SwarmModel};
use taw::world::{ColliderId, WallId, WallShape};

const RESPONSES: [Response; 6] = [
    Response::Displacement,
    Response::Impulse,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::Penalty(ContactLaw::HertzMindlin),
    Response::EventDriven,
    Response::SoftStep,
];

fn models() -> impl Iterator<Item = Model> {
    RESPONSES.into_iter().flat_map(|response| {
        [Detection::Discrete, Detection::Swept].map(|detection| {
            let substeps = if response == Response::EventDriven { 1 } else { 4 };
            let rotation = Rotation::Dynamic;
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
    Obb::from_aabb(&Aabb { min: corner(-40.0, -0.5), max: corner(40.0, 0.0) }).into()
}

fn marble<S: Scalar>([x, y, z]: [f64; 3]) -> Marble<S> {
    let material = Material { restitution: S::zero(), ..Material::default() };
    let position = Point3::new(x, y, z).map(S::from_f64);
    Marble { material: Some(material), ..Marble::new(position, S::from_f64(0.5)) }
}

fn run<S: Scalar>(world: &mut World<S>, seconds: f64) {
    for _ in 0..(seconds * 64.0) as u32 {
        world.step(S::from_f64(1.0 / 64.0)).unwrap();
    }
}

fn height<S: Scalar>(world: &World<S>, id: MarbleId) -> f64 {
    world.marbles.get(id).unwrap().position.y.as_f64()
}

fn ignore<S: Scalar>(world: &mut World<S>, id: MarbleId, others: &[ColliderId]) {
    world.marbles.set_ignored(id, others).unwrap();
    assert_eq!(world.marbles.ignored(id).unwrap(), others);
}

/// One lies on the floor; a second falls through it and through the floor; a third onto it.
fn falls_through<S: Scalar>(model: Model, floor: WallShape<S>, speed: f64) {
    let mut world = world::<S>(model);
    let wall = world.walls.insert(floor).unwrap();
    let velocity = Vec3::new(S::zero(), S::from_f64(-speed), S::zero());
    let mut insert = |y| {
        let marble = Marble { velocity, ..marble([0.0, y, 0.0]) };
        world.marbles.insert(marble).unwrap()
    };
    let [lies, passes, lands] = [0.6, 1.7, 2.8].map(&mut insert);
    ignore(&mut world, passes, &[ColliderId::Wall(wall), ColliderId::Marble(lies)]);
    // Either of the two may name the other.
    ignore(&mut world, lands, &[ColliderId::Marble(passes)]);
    let context = format!("{model:?} at {speed} m/s");
    // Later, who fell onto the very top tips over.
    run(&mut world, 0.75);
    assert!(height(&world, lands) > 0.9, "{context}: {}", height(&world, lands));
    run(&mut world, 1.25);
    assert!(height(&world, lies) > 0.0, "{context}: {}", height(&world, lies));
    let marble = world.marbles.get(passes).unwrap();
    assert!(marble.position.y.as_f64() < -10.0, "{context}: {:?}", marble.position);
    assert_eq!((marble.position.x, marble.position.z), (S::zero(), S::zero()), "{context}");
    // Nothing braked it: v² = v₀² + 2 g s.
    let fall = 1.7 - marble.position.y.as_f64();
    let free = (speed * speed + 2.0 * 9.81 * fall).sqrt();
    let after = -marble.velocity.y.as_f64();
    assert!((after - free).abs() < 0.02 * free, "{context}: {after} m/s, free {free} m/s");
}

#[test]
fn a_marble_passes_through_whom_it_names_and_meets_all_others() {
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
fn who_passes_changes_while_running() {
    for model in models() {
        let mut world = world::<f32>(model);
        let wall = world.walls.insert(slab()).unwrap();
        let held = Marble {
            mass: taw::world::Mass::Infinite,
            gravity_scale: 0.0,
            ..marble([5.0, 0.5, 0.0])
        };
        let bearer = world.marbles.insert(held).unwrap();
        let [on_wall, on_bearer] =
            [[0.0, 0.5, 0.0], [5.0, 1.5, 0.0]].map(|at| world.marbles.insert(marble(at)).unwrap());
        run(&mut world, 3.0);
        assert!(height(&world, on_wall) > 0.4 && height(&world, on_bearer) > 1.2, "{model:?}");
        if model.response == Response::SoftStep {
            assert!(world.is_asleep(on_wall).unwrap() && world.is_asleep(on_bearer).unwrap());
        }
        let copy = world.clone();
        ignore(&mut world, on_wall, &[ColliderId::Wall(wall)]);
        ignore(&mut world, bearer, &[ColliderId::Marble(on_bearer)]);
        assert!(world != copy);
        run(&mut world, 1.0);
        assert!(height(&world, on_wall) < -2.0, "{model:?}: {}", height(&world, on_wall));
        let at = height(&world, on_bearer);
        assert!((at - 0.5).abs() < 0.1, "{model:?}: {at}");
        // And it falls on: the wall is there again for who comes later only.
        ignore(&mut world, on_wall, &[]);
        let next = world.marbles.insert(marble([0.0, 2.0, 0.0])).unwrap();
        run(&mut world, 2.0);
        assert!(height(&world, next) > 0.4, "{model:?}");
    }
}

/// A handle of one that is gone names nobody else, and a pair stays one when rows move.
#[test]
fn pairs_follow_marbles_and_walls_that_come_and_go() {
    for model in models() {
        let mut world = world::<f64>(model);
        let far: Vec<WallId> = (0..3).map(|_| world.walls.insert(far_wall()).unwrap()).collect();
        let floor = world.walls.insert(plane()).unwrap();
        let places = [-20.0, -10.0, 0.0, 10.0, 20.0];
        let ids = places.map(|x| world.marbles.insert(marble([x, 0.5, 0.0])).unwrap());
        let gone = world.marbles.insert(marble([30.0, 0.5, 0.0])).unwrap();
        for id in ids {
            ignore(&mut world, id, &[ColliderId::Marble(gone), ColliderId::Wall(far[0])]);
        }
        ignore(&mut world, ids[4], &[ColliderId::Wall(floor)]);
        run(&mut world, 0.1);
        world.marbles.remove(ids[0]).unwrap();
        world.marbles.remove(gone).unwrap();
        world.walls.remove(far[0]).unwrap(); // the floor has its row now
        assert!(world.marbles.ignored(gone).is_err() && world.marbles.ignored(ids[0]).is_err());
        assert_eq!(world.marbles.ignoring().collect::<Vec<_>>(), ids[1..]);
        let above = world.marbles.insert(marble([0.0, 1.6, 0.0])).unwrap(); // in the slot of one gone
        run(&mut world, 1.0);
        assert!(ids[1..4].iter().all(|id| height(&world, *id) > 0.4), "{model:?}");
        assert!(height(&world, above) > 0.9, "{model:?}: {}", height(&world, above));
        assert!(height(&world, ids[4]) < -2.0, "{model:?}");
    }
}

fn far_wall() -> Sphere<f64> {
    Sphere::new(Point3::new(0.0, 1e3, 0.0), 1.0).unwrap()
}

/// Two groups of which all pairs are named go, bit for bit, as two that layers part.
#[test]
fn naming_all_pairs_of_two_layers_does_what_layers_do() {
    let mut random = fastrand::Rng::with_seed(11);
    for model in models() {
        for round in 0..25 {
            let places: Vec<[f64; 3]> =
                (0..10).map(|_| [0, 1, 2].map(|_| 0.5 + 2.0 * random.f64())).collect();
            let fast = if round % 3 == 0 { 60.0 } else { 2.0 };
            let velocities: Vec<[f64; 3]> =
                (0..10).map(|_| [0, 1, 2].map(|_| fast * (random.f64() - 0.5))).collect();
            let build = || {
                let mut world = world::<f32>(model);
                let floor = world.walls.insert(slab()).unwrap();
                let side = world.walls.insert(Plane::new(Vec3::unit_x(), 0.0).unwrap()).unwrap();
                let marbles = places.iter().zip(&velocities).map(|(at, v)| Marble {
                    velocity: Vec3::from(v.map(|x| x as f32)),
                    ..marble(*at)
                });
                let ids: Vec<_> = marbles.map(|it| world.marbles.insert(it).unwrap()).collect();
                (world, [floor, side], ids)
            };
            let (mut layers, [_, side], ids) = build();
            layers.walls.set_layers(side, CollisionLayers::new(4, 1)).unwrap();
            for (i, id) in ids.iter().enumerate() {
                let own = 1 << (i % 2);
                let filter = CollisionLayers::new(own | 4, if own == 1 { 1 | 4 } else { 2 });
                layers.marbles.set_layers(*id, filter).unwrap();
            }
            // The floor is for all.
            let floor = layers.walls.id(0).unwrap();
            layers.walls.set_layers(floor, CollisionLayers::new(7, 7)).unwrap();
            let (mut named, [_, side], ids) = build();
            for (i, id) in ids.iter().enumerate().filter(|(i, _)| i % 2 == 1) {
                let others = ids.iter().enumerate().filter(|(j, _)| (i + j) % 2 == 1);
                let others = others.map(|(_, id)| ColliderId::Marble(*id));
                ignore(
                    &mut named,
                    *id,
                    &others.chain([ColliderId::Wall(side)]).collect::<Vec<_>>(),
                );
            }
            for step in 0..40 {
                layers.step(1.0 / 64.0).unwrap();
                named.step(1.0 / 64.0).unwrap();
                assert_eq!(
                    (layers.marbles.position(), layers.marbles.velocity()),
                    (named.marbles.position(), named.marbles.velocity()),
                    "{model:?}, round {round}, step {step}"
                );
            }
        }
    }
}

/// A heap of which every third pair of neighbours passes, by one thread and by several, and a clone
/// from the middle of it.
#[test]
fn threads_and_clones_have_the_same_bits() {
    let build = |threads| {
        let mut world = world::<f32>(Model { response: Response::SoftStep, ..Model::GAME });
        world.swarm.set_model(SwarmModel { threads, ..SwarmModel::default() }).unwrap();
        let wall = world.walls.insert(slab()).unwrap();
        let ids: Vec<_> = (0..2_000_u32)
            .map(|i| {
                let [x, y, z] = [i % 20, i / 400, i / 20 % 20].map(f64::from);
                world.marbles.insert(marble([x * 0.97, 0.5 + y * 1.1, z * 0.98])).unwrap()
            })
            .collect();
        for pair in ids.windows(2).step_by(3) {
            ignore(&mut world, pair[0], &[ColliderId::Marble(pair[1])]);
        }
        for id in ids.iter().step_by(7) {
            ignore(&mut world, *id, &[ColliderId::Wall(wall)]);
        }
        run(&mut world, 0.3);
        let mut copy = world.clone();
        run(&mut world, 0.3);
        run(&mut copy, 0.3);
        assert!(world == copy, "{threads} threads");
        (world.marbles.position().to_vec(), world.marbles.velocity().to_vec())
    };
    let one = build(1);
    assert!(one.0.iter().any(|at| at.y < -0.5) && one.0.iter().any(|at| at.y > 0.4));
    for threads in [2, 3] {
        assert!(build(threads) == one, "{threads} threads");
    }
}

/// A marble that passes through a wall pushes the balls of a swarm in it as elsewhere.
#[test]
fn a_marble_among_balls_of_a_swarm_passes_through_the_wall_on_which_they_lie() {
    for response in [Response::Impulse, Response::SoftStep] {
        let mut world = world::<f32>(Model { response, ..Model::GAME });
        let wall = world.walls.insert(slab()).unwrap();
        let balls = [-2.0, 2.0].map(|x| Ball::new(Point3::new(x, 0.5, 0.0), 0.5));
        let balls = world.swarm.insert(&balls).unwrap();
        let id = world.marbles.insert(marble([0.0, 0.6, 0.0])).unwrap();
        ignore(&mut world, id, &[ColliderId::Wall(wall)]);
        run(&mut world, 1.0);
        assert!(height(&world, id) < -2.0, "{response:?}");
        for ball in balls {
            let at = world.swarm.balls()[world.swarm.row(ball).unwrap()];
            assert!((at[1] - 0.5).abs() < 0.02, "{response:?}: {at:?}");
        }
    }
}

#[test]
fn a_marble_that_is_gone_names_nobody() {
    let mut world = World::<f32>::default();
    let id = world.marbles.insert(marble([0.0; 3])).unwrap();
    world.marbles.remove(id).unwrap();
    assert_eq!(world.marbles.set_ignored(id, &[]), Err(Error::NoSuchMarble(id)));
    assert_eq!(world.marbles.ignored(id), Err(Error::NoSuchMarble(id)));
}

#[test]
fn who_may_collide_is_told_of_each_pair() {
    let mut world = world::<f64>(Model::default());
    let wall = world.walls.insert(plane()).unwrap();
    let [a, b] = [0.0, 9.0].map(|x| world.marbles.insert(marble([x, 0.5, 0.0])).unwrap());
    let others = [ColliderId::Marble(b), ColliderId::Wall(wall)];
    let told = |world: &World<f64>| others.map(|other| world.may_collide(a, other).unwrap());
    let from_b = |world: &World<f64>| world.may_collide(b, ColliderId::Marble(a)).unwrap();
    assert_eq!((told(&world), from_b(&world)), ([true, true], true));
    assert_eq!(world.may_collide(a, ColliderId::Marble(a)), Ok(false));
    // At once, before a step; whichever of the two names the other.
    ignore(&mut world, a, &others);
    assert_eq!((told(&world), from_b(&world)), ([false, false], false));
    ignore(&mut world, a, &[]);
    ignore(&mut world, b, &[ColliderId::Marble(a)]);
    assert_eq!((told(&world), from_b(&world)), ([false, true], false));
    ignore(&mut world, b, &[]);
    world.walls.set_layers(wall, CollisionLayers::new(2, 2)).unwrap();
    world.marbles.set_layers(a, CollisionLayers::new(1, u32::MAX)).unwrap();
    assert_eq!((told(&world), from_b(&world)), ([true, false], true));
    world.marbles.set_layers(a, CollisionLayers::NONE).unwrap();
    assert_eq!((told(&world), from_b(&world)), ([false, false], false));
    world.marbles.remove(b).unwrap();
    world.walls.remove(wall).unwrap();
    assert_eq!(world.may_collide(a, ColliderId::Marble(b)), Err(Error::NoSuchMarble(b)));
    assert_eq!(world.may_collide(b, ColliderId::Marble(a)), Err(Error::NoSuchMarble(b)));
    assert_eq!(world.may_collide(a, ColliderId::Wall(wall)), Err(Error::NoSuchWall(wall)));
}
