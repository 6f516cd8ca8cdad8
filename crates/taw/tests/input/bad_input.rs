//! Input that was accepted once and should not have been, refused and changed something, or turned
//! bad while running: case by case. Table and random sequences are in `every_entry.rs`.

use std::time::Instant;

use taw::Error;
use taw::contact::Contact;
use taw::frame::Pose;
use taw::math::Quat;
use taw::prelude::*;
use taw::scene::{
    GravityKeyframe, KinematicMotion, Lattice, MarbleDesc, Scene, ShapeDesc, WallDesc,
};
use taw::shape::{Aabb, Capsule, Compound, HeightField, Mesh, Obb, Shape};
use taw::swarm::Ball;

const RESPONSES: [Response; 6] = [
    Response::Displacement,
    Response::Impulse,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::Penalty(ContactLaw::HertzMindlin),
    Response::EventDriven,
    Response::SoftStep,
];

fn model(response: Response) -> Model {
    Model { response, rotation: Rotation::Dynamic, ..Model::default() }
}

fn on_a_floor<S: Scalar>(model: Model) -> World<S> {
    let mut world = World::default();
    world.set_model(model).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), S::zero()).unwrap()).unwrap();
    world
}

fn at<S: Scalar>(x: f64, y: f64, z: f64) -> Point3<S> {
    Point3::new(S::from_f64(x), S::from_f64(y), S::from_f64(z))
}

fn number<S: Scalar>(x: f64) -> S {
    S::from_f64(x)
}

fn is_sane<S: Scalar>(marble: &Marble<S>) -> bool {
    let point = [marble.position.x, marble.position.y, marble.position.z];
    let rotation =
        [marble.rotation.s, marble.rotation.v.x, marble.rotation.v.y, marble.rotation.v.z];
    let vectors = [marble.velocity, marble.angular_velocity].map(|v| [v.x, v.y, v.z]);
    point.iter().chain(&rotation).chain(vectors.iter().flatten()).all(|x| x.is_finite())
}

fn all_sane<S: Scalar>(world: &World<S>) -> bool {
    let ids = (0..world.marbles.len()).filter_map(|row| world.marbles.id(row));
    ids.map(|id| world.marbles.get(id).unwrap()).all(|marble| is_sane(&marble))
}

/// Such a speed, or, in m/s, that beyond which a response refuses its marble.
fn fastest(response: Response, speed: f64) -> f64 {
    if response == Response::SoftStep { 9e11 } else { speed }
}

fn a_step_of_no_use_is_refused<S: Scalar>() {
    for response in RESPONSES {
        for substeps in [1, 8] {
            let mut world = on_a_floor::<S>(Model { substeps, ..model(response) });
            let fast = Vec3::unit_x() * number::<S>(fastest(response, 2e38));
            let mad = Marble { velocity: fast, ..Marble::new(at(0.0, 9.0, 0.0), number(0.5)) };
            world.marbles.insert(mad).unwrap();
            world.marbles.insert(Marble::new(at(5.0, 0.4, 0.0), number(0.5))).unwrap();
            for _ in 0..3 {
                world.step(number(1e3)).unwrap();
            }
            let before = world.clone();
            for dt in [1e-46, 1e-40, 1e-30, 1e-19, 1.1e18, 1e30, 1e39, 1e300, 0.0, -1.0, f64::NAN] {
                let dt: S = number(dt);
                let error = world.step(dt).unwrap_err();
                let (Error::NotPositive { field, value } | Error::OutOfRange { field, value, .. }) =
                    error
                else {
                    panic!("{error}")
                };
                assert_eq!((field, value.to_bits()), ("dt", dt.as_f64().to_bits()), "{error}");
                assert!(world == before, "{dt:?} has changed the world");
                assert!(world.stopped().eq(before.stopped()), "{dt:?} has cleared who stopped");
                assert_eq!(world.impacts(), before.impacts());
                let verbs = [world.integrate(dt), world.restitute(dt)];
                assert!(verbs.iter().all(Result::is_err) && world == before, "{dt:?}: {verbs:?}");
                assert!(world.step_swarm(dt, &mut |_| ()).is_err());
            }
        }
    }
}

#[test]
fn a_step_that_cannot_be_made_is_refused_before_anything_moved() {
    a_step_of_no_use_is_refused::<f32>();
    a_step_of_no_use_is_refused::<f64>();
}

fn a_step_of_no_use_is_refused_beside_a_swarm<S: Scalar>() {
    for response in RESPONSES {
        let mut world = on_a_floor::<S>(Model { substeps: 4, ..model(response) });
        // Two that meet, one of which lands within six steps.
        for (x, y) in [(0.0, 0.55), (0.9, 1.6)] {
            let velocity = Vec3::new(0.0, -3.0, 0.0).map(number);
            let marble = Marble { velocity, ..Marble::new(at(x, y, 0.0), number(0.5)) };
            world.marbles.insert(marble).unwrap();
        }
        world.swarm.insert(&[Ball::new(at(5.0, 0.3, 0.0), number(0.2))]).unwrap();
        for _ in 0..6 {
            world.step(number(1.0 / 60.0)).unwrap();
        }
        let before = world.clone();
        for dt in [1e-46, 1e-40, 1e-30, 1e39, 1e30, 1e300, 0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(world.step(number(dt)).is_err(), "{response:?}: {dt}");
            assert!(world == before, "{response:?}: {dt} has changed the world");
            assert_eq!(world.impacts(), before.impacts(), "{response:?}: {dt}");
            assert!(world.stopped().eq(before.stopped()), "{response:?}: {dt}");
        }
    }
}

#[test]
fn a_step_that_cannot_be_made_is_refused_before_a_swarm_moved() {
    a_step_of_no_use_is_refused_beside_a_swarm::<f32>();
    a_step_of_no_use_is_refused_beside_a_swarm::<f64>();
}

#[test]
fn what_f64_holds_and_f32_does_not_stops_by_springs_too() {
    for law in [ContactLaw::SpringDashpot, ContactLaw::HertzMindlin] {
        for substeps in [1, 4] {
            let precision = Precision::Compensated;
            let model = Model { precision, substeps, ..model(Response::Penalty(law)) };
            let mut world = World::<f32>::default();
            world.set_model(model).unwrap();
            world.set_gravity(Vec3::new(1e38, 0.0, 0.0)).unwrap();
            let velocity = Vec3::new(3e38, 0.0, 0.0);
            let marble = Marble { velocity, ..Marble::new(at(3e38, 0.0, 0.0), 1.0) };
            let id = world.marbles.insert(marble).unwrap();
            world.step(1.0).unwrap();
            assert_eq!(world.stopped().collect::<Vec<_>>(), [id], "{law:?}, {substeps}");
            // In later substeps gravity begins anew.
            assert!(all_sane(&world), "{law:?}: {:?}", world.marbles.get(id));
        }
    }
}

#[test]
fn a_substep_too_short_is_refused_with_what_was_given() {
    let mut world = on_a_floor::<f32>(Model { substeps: 1000, ..Model::default() });
    let error = world.step(1e-16).unwrap_err();
    assert!(
        matches!(error, Error::OutOfRange { field: "dt", value, .. } if value == f64::from(1e-16_f32))
    );
}

#[test]
fn a_push_at_a_point_is_applied_whole_or_not_at_all() {
    let mut world = on_a_floor::<f32>(model(Response::Impulse));
    let id = world.marbles.insert(Marble::new(at(0.0, 1.0, 0.0), 0.5)).unwrap();
    let huge = Vec3::new(0.0, 0.0, 3e38);
    world.marbles.apply_torque(id, Vec3::new(3e38, 0.0, 0.0)).unwrap();
    let before = world.clone();
    // The force alone would do, and the torque alone; their sums would not.
    let error = world.marbles.apply_force_at(id, huge, at(0.0, 2.0, 0.0)).unwrap_err();
    assert!(error.to_string().starts_with("torque"), "{error}");
    assert!(world == before, "the force stayed");
}

#[test]
fn masses_that_the_scalar_has_no_number_for_are_refused_by_what_was_given() {
    let mut world = on_a_floor::<f32>(model(Response::Impulse));
    let marble = |radius: f32, mass| Marble { mass, ..Marble::new(at(0.0, 1.0, 0.0), radius) };
    let mut refused = |marble: Marble<f32>, name: &str, given: f32| {
        let before = world.clone();
        let error = world.marbles.insert(marble).unwrap_err();
        let Error::OutOfRange { field, value, min, max } = error else { panic!("{error}") };
        assert_eq!((field, value), (name, f64::from(given)), "{error}");
        assert!(!(min..=max).contains(&value), "{error}");
        assert!(world == before);
    };
    refused(marble(1e-3, Mass::Density(1e-35)), "density", 1e-35);
    refused(marble(1e3, Mass::Density(1e35)), "density", 1e35);
    refused(marble(1e-15, Mass::default()), "radius", 1e-15);
    refused(marble(1e15, Mass::default()), "radius", 1e15);
    refused(marble(1e-30, Mass::Kilograms(1.0)), "radius", 1e-30);
    refused(marble(0.1, Mass::Kilograms(1e-40)), "mass", 1e-40);
    let long = Marble { half_length: 1e19, ..marble(1e10, Mass::default()) };
    refused(long, "half_length", 1e19);
    let id = world.marbles.insert(marble(1e-3, Mass::Density(1e-25))).unwrap();
    let before = world.clone();
    assert!(world.marbles.set_radius(id, 1e-6).is_err());
    assert!(world.marbles.set_mass(id, Mass::Density(1e-35)).is_err());
    assert!(world.marbles.set_half_length(id, 1e30).is_err());
    assert!(world == before);
}

#[test]
fn a_spin_that_overflows_is_stopped_named_once_and_leaves_a_rotation() {
    // `SoftStep` refuses it.
    for response in RESPONSES.into_iter().filter(|response| *response != Response::SoftStep) {
        let mut world = on_a_floor::<f32>(Model { substeps: 4, ..model(response) });
        let spin = Vec3::new(3e38, 3e38, 3e38);
        let mad = Marble { angular_velocity: spin, ..Marble::new(at(0.0, 0.49, 0.0), 0.5) };
        let mad = world.marbles.insert(mad).unwrap();
        let other = world.marbles.insert(Marble::new(at(9.0, 0.5, 0.0), 0.5)).unwrap();
        let mut alone = on_a_floor::<f32>(Model { substeps: 4, ..model(response) });
        let same = alone.marbles.insert(Marble::new(at(9.0, 0.5, 0.0), 0.5)).unwrap();
        for step in 0..30 {
            world.step(1.0 / 60.0).unwrap();
            alone.step(1.0 / 60.0).unwrap();
            let named: Vec<_> = world.stopped().collect();
            // One response counts in f64, where it is a spin like any other.
            let wide = response == Response::EventDriven && named.is_empty();
            assert!(step > 0 || named == [mad] || wide, "{response:?}: {named:?}");
            assert!(all_sane(&world), "{response:?}: {:?}", world.marbles.get(mad));
            assert_eq!(world.marbles.get(other), alone.marbles.get(same), "{response:?}");
        }
    }
}

#[test]
fn what_overflows_is_named_once_in_a_step_of_many_substeps_and_by_its_own_name() {
    for response in RESPONSES {
        let mut world = World::<f32>::default();
        world.set_model(Model { substeps: 8, ..model(response) }).unwrap();
        let first = world.marbles.insert(Marble::new(at(-50.0, 0.0, 0.0), 0.5)).unwrap();
        let mad = world.marbles.insert(Marble::new(at(0.0, 0.0, 0.0), 0.5)).unwrap();
        world
            .set_forces(vec![ForceField::Custom(|at, _| {
                if at.position.x > -1.0 {
                    Vec3::new(f32::NAN, 0.0, 0.0)
                } else {
                    Vec3::new(0.0, 0.0, 0.0)
                }
            })])
            .unwrap();
        world.step(1.0 / 60.0).unwrap();
        assert_eq!(world.stopped().collect::<Vec<_>>(), [mad], "{response:?}");
        world.marbles.remove(first).unwrap();
        assert_eq!(world.stopped().collect::<Vec<_>>(), [mad], "rows moved, names did not");
    }
}

#[test]
fn walls_that_cannot_be_are_refused_by_name() {
    let mut world = World::<f32>::default();
    let origin: Point3<f32> = at(0.0, 0.0, 0.0);
    let one = Vec3::new(1.0, 1.0, 1.0);
    let nan = f32::NAN;
    let turned = |q: Quat<f32>| Pose { rotation: q, ..Pose::identity() };
    let corners = vec![origin, at(1.0, 0.0, 0.0), at(0.0, 0.0, 1.0)];
    let mesh = std::sync::Arc::new(Mesh::new(corners, vec![[0, 1, 2]]).unwrap());
    let heights = HeightField::new(origin, [1.0, 1.0], 2, vec![0.0; 4]).unwrap();
    let heights = std::sync::Arc::new(heights);
    let rotations = [
        Quat::new(0.0, 0.0, 0.0, 0.0),
        Quat::new(nan, 0.0, 0.0, 0.0),
        Quat::new(1.0, nan, 0.0, 0.0),
        Quat::new(2.0, 0.0, 0.0, 0.0),
        Quat::new(f32::INFINITY, 0.0, 0.0, 0.0),
    ];
    let sphere = |radius| Shape::Sphere(Sphere { center: origin, radius });
    let capsule = |radius| Shape::Capsule(Capsule { a: origin, b: at(1.0, 0.0, 0.0), radius });
    let mut walls: Vec<(&str, WallShape<f32>)> = Vec::new();
    for rotation in rotations {
        walls.push(("rotation", WallShape::Mesh(mesh.clone(), turned(rotation))));
        walls.push(("rotation", WallShape::HeightField(heights.clone(), turned(rotation))));
        let obb = Shape::Obb(Obb { center: origin, rotation, half_extents: one });
        walls.push(("rotation", obb.clone().into()));
        walls.push(("rotation", Compound::new(vec![sphere(1.0), obb]).unwrap().into()));
    }
    for radius in [-1.0, 0.0, nan, f32::INFINITY] {
        walls.push(("radius", sphere(radius).into()));
        walls.push(("radius", capsule(radius).into()));
        walls.push(("radius", Compound::new(vec![capsule(radius)]).unwrap().into()));
    }
    let upside_down = Shape::Aabb(Aabb { min: at(0.0, 1.0, 0.0), max: origin });
    walls.push(("max.y", upside_down.into()));
    let half_extents = Vec3::new(1.0, -1.0, 1.0);
    let inverted = Obb { center: origin, rotation: Quat::new(1.0, 0.0, 0.0, 0.0), half_extents };
    walls.push(("half_extents.y", inverted.into()));
    let far = Aabb { min: at(-3e38, 0.0, 0.0), max: at::<f32>(3e38, 1.0, 1.0) };
    walls.push(("size.x", far.into()));
    let id = world.walls.insert(sphere(1.0)).unwrap();
    let before = world.clone();
    for (name, wall) in walls {
        for error in
            [world.walls.insert(wall.clone()).map(|_| ()), world.walls.set(id, wall.clone())]
        {
            let error = error.expect_err(&format!("{wall:?}")).to_string();
            assert!(error.starts_with(name), "{error} for {wall:?}");
        }
        assert!(world == before, "{wall:?}");
    }
}

#[test]
fn a_rotation_that_drifted_a_little_is_taken_without_the_drift() {
    let mut world = World::<f32>::default();
    let rotation = Quat::new(1.0005, 0.0, 0.0, 0.0);
    let half_extents = Vec3::new(1.0, 1.0, 1.0);
    let id = world.walls.insert(Obb { center: at(0.0, 0.0, 0.0), rotation, half_extents }).unwrap();
    let WallShape::Solid(Shape::Obb(obb)) = world.walls.get(id).unwrap() else { panic!() };
    assert_eq!(obb.rotation.s, 1.0);
}

#[test]
fn compounds_are_nested_up_to_a_limit() {
    let ball = Sphere::new(at::<f64>(0.0, 0.0, 0.0), 1.0).unwrap();
    let mut shape = Shape::Sphere(ball);
    let error = loop {
        match Compound::new(vec![shape.clone()]) {
            Ok(compound) => shape = Shape::Compound(compound),
            Err(error) => break error,
        }
    };
    let most = f64::from(Compound::<Shape<f64>>::MAX_LEVELS);
    assert_eq!(
        error,
        Error::OutOfRange {
            field: "levels of the compound",
            value: most + 1.0,
            min: 1.0,
            max: most
        }
    );
    let mut world = World::<f64>::default();
    let id = world.walls.insert(shape).unwrap();
    assert_eq!(
        *world.walls.get(id).unwrap(),
        Compound::new(vec![Shape::Sphere(ball)]).unwrap().into(),
        "laid out flat"
    );
}

/// A scene with this wall.
fn with_wall(shape: ShapeDesc, motion: Option<KinematicMotion>) -> Scene {
    Scene { walls: vec![WallDesc { shape, material: None, motion }], ..Scene::default() }
}

#[test]
fn a_scene_that_cannot_go_on_is_refused_when_its_world_is_built() {
    let ball = MarbleDesc { radius: 0.5, ..MarbleDesc::default() };
    let lattice = |count, pitch| Lattice { first: ball, count, pitch, jitter: 0.0 };
    let lattices = |lattice| Scene { lattices: vec![lattice], ..Scene::default() };
    let tilted = |gravity| Scene {
        gravity_keyframes: vec![
            GravityKeyframe { time: 0.0, gravity: [0.0; 3] },
            GravityKeyframe { time: 1.0, gravity },
        ],
        ..Scene::default()
    };
    let half_space = |normal| ShapeDesc::HalfSpace { normal, point: [0.0; 3] };
    let swings = |amplitude, period| KinematicMotion::Oscillate {
        amplitude,
        pivot: [0.0; 3],
        axis: [0.0, 1.0, 0.0],
        degrees: 0.0,
        period,
    };
    let floor = half_space([0.0, 1.0, 0.0]);
    let tiny = MarbleDesc { radius: 1e-50, ..ball };
    let bad = [
        ("gravity.y", 1e39, tilted([0.0, 1e39, 0.0])),
        ("gravity.y", -1e39, Scene { gravity: [0.0, -1e39, 0.0], ..Scene::default() }),
        ("lattices.count", 65535.0_f64.powi(3), lattices(lattice([65535; 3], [1.0; 3]))),
        ("pitch.z", 1e38, lattices(lattice([2, 2, 9], [1.0, 1.0, 1e38]))),
        ("radius", 1e-50, Scene { marbles: vec![tiny], ..Scene::default() }),
        ("amplitude / period", 1e30 * std::f64::consts::TAU / 1e-30, {
            with_wall(floor, Some(swings([1e30, 0.0, 0.0], 1e-30)))
        }),
        ("period", 1e-50, with_wall(floor, Some(swings([1.0, 0.0, 0.0], 1e-50)))),
        ("the reach of a wall", 3.3e38, {
            with_wall(
                ShapeDesc::Ball { center: [2e38, 0.0, 0.0], radius: 1.0 },
                Some(swings([1.3e38, 0.0, 0.0], 60.0)),
            )
        }),
    ];
    for (name, given, scene) in bad {
        for error in [
            scene.run::<f32>(Model::default()).map(|_| ()).unwrap_err(),
            scene.run::<f64>(Model::default()).map(|_| ()).unwrap_err(),
        ] {
            let Error::OutOfRange { field, value, .. } = error else { panic!("{error}") };
            assert_eq!(field, name, "{error}");
            assert!((value / given - 1.0).abs() < 1e-12, "{error}");
        }
    }
}

#[test]
fn a_scene_that_refuses_a_step_has_moved_no_wall() {
    let motion = KinematicMotion::Conveyor { velocity: [1.0, 0.0, 0.0] };
    let floor = ShapeDesc::HalfSpace { normal: [0.0, 1.0, 0.0], point: [0.0; 3] };
    let swing = KinematicMotion::Oscillate {
        amplitude: [1.0, 0.0, 0.0],
        pivot: [0.0; 3],
        axis: [0.0, 1.0, 0.0],
        degrees: 3.0,
        period: 1.0,
    };
    let mut scene = with_wall(floor, Some(motion));
    scene.walls.push(WallDesc { motion: Some(swing), ..scene.walls[0] });
    let mut running = scene.run::<f64>(Model::default()).unwrap();
    running.step(0.1).unwrap();
    let before = running.clone();
    for dt in [1e-46, 1e39, 0.0, f64::NAN] {
        assert!(running.step(dt).is_err() && running.move_walls(dt).is_err());
        assert!(running.world == before.world && running.time() == before.time());
    }
    let id = running.world.walls.id(1).unwrap();
    running.world.walls.remove(id).unwrap();
    let before = running.clone();
    assert!(running.step(0.1).is_err());
    assert!(running.world == before.world && running.time() == before.time());
}

/// So many balls within a micrometre.
fn crowd(count: u32, response: Response) -> World<f32> {
    let mut world = World::<f32>::default();
    world.set_model(Model { response, rotation: Rotation::Dynamic, ..Model::default() }).unwrap();
    world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
    for i in 0..count {
        let part = |step: f64| 1e-6 * (f64::from(i) * step).fract();
        let center = at(part(0.819_172_513), part(0.671_043_607), part(0.549_700_478));
        world.marbles.insert(Marble::new(center, 0.05)).unwrap();
    }
    world
}

#[test]
fn thousands_in_one_place_have_a_bounded_number_of_contacts() {
    for response in [Response::Impulse, Response::Displacement, RESPONSES[2]] {
        let mut world = crowd(4000, response);
        let clock = Instant::now();
        world.step(1.0 / 60.0).unwrap();
        // All pairs would be 8 million; it takes a quarter of a second where nothing else runs.
        assert!(world.contacts.mm.len() <= 32 * 4000, "{}", world.contacts.mm.len());
        assert!(clock.elapsed().as_secs_f64() < 20.0, "{:?}", clock.elapsed());
    }
}

#[test]
fn a_boulder_has_contacts_with_all_its_pebbles() {
    let mut world = World::<f64>::default();
    world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
    world.marbles.insert(Marble::new(at(0.0, 0.0, 0.0), 1.0)).unwrap();
    for i in 0..400_u32 {
        // On a spiral about the sphere (Vogel 1979), in touch with it.
        let y = 1.0 - 2.0 * (f64::from(i) + 0.5) / 400.0;
        let (sin, cos) = (f64::from(i) * 2.399_963_229_728_653).sin_cos();
        let across = (1.0 - y * y).sqrt();
        let far = 1.009;
        let center = at(far * cos * across, far * y, far * sin * across);
        world.marbles.insert(Marble::new(center, 0.01)).unwrap();
    }
    world.step(1e-3).unwrap();
    assert_eq!(world.contacts.mm.len(), 400);
}

#[test]
fn thousands_in_one_place_part_in_seconds_and_without_energy() {
    let mut world = crowd(3000, Response::Impulse);
    let clock = Instant::now();
    let deepest = |world: &World<f32>| {
        let depths = world.contacts.mm.iter().map(Contact::penetration);
        depths.fold(0.0, f32::max)
    };
    let mut steps = 0;
    // A fifth of the radius, after which they are a heap like any other.
    while steps == 0 || deepest(&world) > 0.01 {
        world.step(1.0 / 60.0).unwrap();
        steps += 1;
        assert!(steps < 600, "still {} m deep", deepest(&world));
        let fastest = world.marbles.velocity().iter().map(|v| v.magnitude()).fold(0.0, f32::max);
        assert!(fastest < 1e-3, "{fastest} m/s from nothing after {steps} steps");
    }
    println!("3000 parted in {steps} steps, {:?}", clock.elapsed());
    assert!(clock.elapsed().as_secs_f64() < 60.0, "{:?}", clock.elapsed());
}
