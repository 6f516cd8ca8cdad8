//! Sensors of rigid bodies, against the distances of their shapes.

use cgmath::Zero;
use taw::Error;
use taw::body::{Body, BodyId, BodyMass};
use taw::frame::Pose;
use taw::motion::WallMotion;
use taw::prelude::*;
use taw::shape::{Aabb, BoundedShape, Compound, Shape};

use crate::any_body::{any_body, any_point, any_vector, placed};
use crate::draw::Draw;

const DT: f64 = 1.0 / 64.0;

fn world<S: Scalar>() -> World<S> {
    let mut world = World::default();
    world.set_model(Model::GAME).unwrap();
    world.set_gravity(Vec3::zero()).unwrap();
    world
}

fn at<S: Scalar>(x: f64, y: f64, z: f64) -> Point3<S> {
    Point3::new(x, y, z).map(S::from_f64)
}

fn ball<S: Scalar>(radius: f64) -> Sphere<S> {
    Sphere::new(at(0.0, 0.0, 0.0), S::from_f64(radius)).unwrap()
}

/// Steps, and returns who entered (true) and left.
fn step<S: Scalar>(world: &mut World<S>) -> Vec<(ColliderId, bool)> {
    world.step(S::from_f64(DT)).unwrap();
    world.sensors.events().iter().map(|it| (it.collider, it.entered)).collect()
}

/// Distance of a body from a ball about the origin while it flies straight, in metres.
struct Flight {
    shape: Shape<f64>,
    velocity: Vec3<f64>,
    radius: f64,
}

impl Flight {
    fn gap(&self, time: f64) -> f64 {
        // The ball flies the other way.
        let ball = Point3::from_vec(-self.velocity * time);
        self.shape.project_point(ball).distance - self.radius
    }

    /// Least gap in metres, and first and last time of touch, to one of so many parts of the whole; none if it passes.
    fn touches(&self, until: f64, parts: u32) -> (f64, Option<[f64; 2]>) {
        let times = (0..=parts).map(|part| until * f64::from(part) / f64::from(parts));
        let gaps: Vec<_> = times.map(|time| (time, self.gap(time))).collect();
        let least = gaps.iter().map(|it| it.1).fold(9.0, f64::min);
        let touch = |it: &&(f64, f64)| it.1 <= 0.0;
        let first = gaps.iter().find(touch).map(|it| it.0);
        let last = gaps.iter().rev().find(touch).map(|it| it.0);
        (least, first.zip(last).map(|(first, last)| [first, last]))
    }
}

fn pass<S: Scalar>(tolerance: f64) {
    const PARTS: u32 = 4000;
    let (mut met, mut missed) = (0, 0);
    for seed in 0..150 {
        let mut draw = Draw(seed);
        let radius = draw.between(0.05, 0.5);
        let speed = 3.0 * 100_f64.powf(draw.next());
        let from: Point3<f64> = any_point(&mut draw, 1.0);
        let from = from + (from.to_vec()).normalize() * draw.between(2.0, 4.0);
        let aim: Point3<f64> = any_point(&mut draw, 0.6);
        let velocity = (aim - from).normalize() * speed;
        let body = any_body::<S>(&mut Draw(seed + 1000), 0.3, 0.1);
        let local = any_body::<f64>(&mut Draw(seed + 1000), 0.3, 0.1).shape;
        let (position, velocity_of) = (from.map(S::from_f64), velocity.map(S::from_f64));
        let body = Body { position, velocity: velocity_of, ..body };
        let mut world = world::<S>();
        let gate = world.sensors.insert(ball::<S>(radius)).unwrap();
        let id = world.bodies.insert(body).unwrap();
        let flight = Flight { shape: placed(&world, id, &local), velocity, radius };
        let steps = (8.0 / speed / DT) as u32 + 2;
        let until = f64::from(steps) * DT;
        let (least, touches) = flight.touches(until, PARTS);
        if least.abs() < 3e-3 {
            continue; // it grazes
        }
        let mut told = Vec::new();
        for step in 1..=steps {
            world.step(S::from_f64(DT)).unwrap();
            for event in world.sensors.events() {
                assert_eq!((event.sensor, event.collider), (gate, id.into()));
                told.push((event.entered, f64::from(step) * DT - event.time_left.as_f64()));
            }
        }
        let case = format!("{seed}, {speed} m/s: {told:?}, {touches:?}");
        assert!(told.iter().enumerate().all(|(i, it)| it.0 == (i % 2 == 0)), "{case}");
        assert_eq!(told.len() % 2, 0, "{case}");
        assert_eq!(world.sensors.bodies_inside(gate).unwrap(), []);
        for (_, time) in &told {
            let gap = flight.gap(*time);
            assert!(gap.abs() < tolerance, "{case}: {gap} m off");
        }
        let both = told.first().zip(told.last()).map(|(first, last)| [first.1, last.1]);
        assert_eq!(both.is_some(), touches.is_some(), "{case}");
        for (told, exact) in both.iter().flatten().zip(touches.iter().flatten()) {
            assert!((told - exact).abs() < 3.0 * until / f64::from(PARTS), "{case}");
        }
        met += u32::from(both.is_some());
        missed += u32::from(both.is_none());
    }
    assert!(met > 50 && missed > 5, "{met} and {missed} say little");
}

#[test]
fn a_body_enters_and_leaves_at_its_time_at_any_speed() {
    pass::<f64>(1e-6);
    pass::<f32>(3e-4);
}

/// Bodies and marbles bounce and turn in a room: after each step, those are inside that overlap, and events are the
/// changes.
#[test]
fn inside_are_the_bodies_that_overlap_and_events_are_the_changes() {
    let mut world = world::<f64>();
    for normal in [Vec3::unit_x(), Vec3::unit_y(), Vec3::unit_z()] {
        for normal in [normal, -normal] {
            world.walls.insert(Plane::new(normal, -2.0).unwrap()).unwrap();
        }
    }
    let mut shapes = Vec::new();
    for seed in 0..40 {
        let mut draw = Draw(seed);
        let body = any_body(&mut draw, 0.25, 1.5);
        let local = body.shape.clone();
        let (velocity, angular_velocity) =
            (any_vector(&mut draw, 20.0), any_vector(&mut draw, 9.0));
        let body = Body { velocity, angular_velocity, ..body };
        shapes.push((world.bodies.insert(body).unwrap(), local));
        let marble = Marble::new(any_point(&mut draw, 1.5), 0.1);
        world.marbles.insert(Marble { velocity, ..marble }).unwrap();
    }
    let balls = [([0.5, -0.5, 0.0], 0.7), ([-1.0, 0.0, 0.8], 0.3), ([0.0, 1.5, 0.0], 1.0)];
    let balls = balls.map(|([x, y, z], radius)| Sphere::new(at(x, y, z), radius).unwrap());
    let gates = balls.map(|ball| world.sensors.insert(ball).unwrap());
    let mut inside = [const { Vec::<ColliderId>::new() }; 3];
    let mut changes = 0;
    for _ in 0..400 {
        world.step(DT).unwrap();
        for event in world.sensors.events() {
            let gate = gates.iter().position(|gate| *gate == event.sensor).unwrap();
            let known = &mut inside[gate];
            match (event.entered, known.binary_search(&event.collider)) {
                (true, Err(at)) => known.insert(at, event.collider),
                (false, Ok(at)) => drop(known.remove(at)),
                _ => panic!("{event:?} of {known:?}"),
            }
            changes += u32::from(matches!(event.collider, ColliderId::Body(_)));
            assert!((0.0..=DT + 1e-12).contains(&event.time_left), "{event:?}");
        }
        for ((gate, known), ball) in gates.iter().zip(&inside).zip(&balls) {
            let marbles = world.sensors.inside(*gate).unwrap().iter().map(|id| (*id).into());
            let bodies = world.sensors.bodies_inside(*gate).unwrap();
            let all = marbles.chain(bodies.iter().map(|id| (*id).into()));
            assert_eq!(*known, all.collect::<Vec<_>>());
            for (id, local) in &shapes {
                let gap = placed(&world, *id, local).project_point(ball.center).distance;
                let gap = gap - ball.radius;
                assert!(bodies.contains(id) == (gap <= 0.0) || gap.abs() < 1e-6, "{id:?} {gap}");
            }
        }
    }
    assert!(changes > 60, "{changes} changes say little");
}

/// Two balls far apart, with their center of mass between them.
fn dumbbell(position: Point3<f64>) -> Body<f64> {
    let end = |x: f64| Shape::Sphere(Sphere::new(at(x, 0.0, 0.0), 0.2).unwrap());
    Body::new(Shape::Compound(Compound::new(vec![end(-2.0), end(2.0)]).unwrap()), position)
}

#[test]
fn a_compound_is_inside_if_a_part_is() {
    let mut world = world::<f64>();
    let gate = world.sensors.insert(ball(0.3)).unwrap();
    let left = world.bodies.insert(dumbbell(at(2.3, 0.0, 0.0))).unwrap();
    let right = world.bodies.insert(dumbbell(at(-2.0, 0.45, 0.0))).unwrap();
    let none = world.bodies.insert(dumbbell(at(0.0, 0.0, 0.0))).unwrap();
    assert_eq!(step(&mut world), [left, right].map(|id| (id.into(), true)));
    assert_eq!(world.sensors.bodies_inside(gate).unwrap(), [left, right]);
    assert!(!world.sensors.bodies_inside(gate).unwrap().contains(&none), "around it is not inside");
    assert_eq!(world.sensors.inside(gate).unwrap(), []);
}

fn crate_at(x: f64, y: f64) -> Body<f64> {
    Body::cuboid(Vec3::new(0.2, 0.2, 0.2), at(x, y, 0.0))
}

#[test]
fn bodies_that_are_put_elsewhere_or_removed_leave() {
    let mut world = world::<f64>();
    let gate = world.sensors.insert(ball(1.0)).unwrap();
    let [jumps, goes] = [0.0, 0.7].map(|y| world.bodies.insert(crate_at(0.0, y)).unwrap());
    let kinematic = BodyMass::Uniform(Mass::Infinite);
    let velocity = Vec3::new(0.0, -1.0, 0.0);
    let drives = Body { mass: kinematic, velocity, ..crate_at(0.0, 1.195) };
    let drives = world.bodies.insert(drives).unwrap();
    assert_eq!(step(&mut world), [jumps, goes, drives].map(|id| (id.into(), true)));
    assert_eq!(step(&mut world), []);
    // A jump across touches nothing on the way.
    let place = |x: f64| Pose { translation: Vec3::new(x, 0.0, 0.0), ..Pose::identity() };
    world.bodies.set_pose(jumps, place(3.0)).unwrap();
    assert_eq!(step(&mut world), [(jumps.into(), false)]);
    assert_eq!(world.sensors.events()[0].time_left, DT);
    world.bodies.set_pose(jumps, place(-3.0)).unwrap();
    assert_eq!(step(&mut world), []);
    world.bodies.set_pose(jumps, place(0.0)).unwrap();
    assert_eq!(step(&mut world), [(jumps.into(), true)]);
    // Removals move rows: nobody takes the path of another one.
    world.bodies.remove(jumps).unwrap();
    assert_eq!(step(&mut world), [(jumps.into(), false)]);
    world.bodies.remove(goes).unwrap();
    assert_eq!(step(&mut world), [(goes.into(), false)]);
    assert_eq!(world.sensors.bodies_inside(gate).unwrap(), [drives]);
    world.sensors.remove(gate).unwrap();
    assert_eq!(world.sensors.bodies_inside(gate), Err(Error::NoSuchSensor(gate)));
}

#[test]
fn a_body_that_sleeps_inside_stays_inside() {
    let mut world = world::<f64>();
    world.set_gravity(Vec3::new(0.0, -9.81, 0.0)).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    let gate = world.sensors.insert(ball(1.0)).unwrap();
    let id = world.bodies.insert(crate_at(0.0, 0.3)).unwrap();
    assert_eq!(step(&mut world), [(id.into(), true)]);
    let slept = (0..600).any(|_| {
        assert_eq!(step(&mut world), []);
        world.bodies.is_asleep(id).unwrap()
    });
    assert!(slept, "it does not sleep");
    assert_eq!(step(&mut world), []);
    assert_eq!(world.sensors.bodies_inside(gate).unwrap(), [id]);
    let late = world.sensors.insert(ball(0.5)).unwrap();
    assert_eq!(step(&mut world), [(id.into(), true)], "also where the sensor comes to it");
    world.sensors.set(late, Sphere::new(at(9.0, 0.0, 0.0), 0.5).unwrap()).unwrap();
    assert_eq!(step(&mut world), [(id.into(), false)]);
    assert!(world.bodies.is_asleep(id).unwrap(), "sensors wake nobody");
}

#[test]
fn a_sensor_notices_the_bodies_of_its_layers() {
    let mut world = world::<f64>();
    let gate = world.sensors.insert(ball(1.0)).unwrap();
    world.sensors.set_layers(gate, CollisionLayers::new(u32::MAX, 1)).unwrap();
    let one = CollisionLayers::new(1, u32::MAX);
    let seen = world.bodies.insert(Body { layers: one, ..crate_at(0.3, 0.0) }).unwrap();
    let other = CollisionLayers::new(2, u32::MAX);
    let unseen = world.bodies.insert(Body { layers: other, ..crate_at(-0.3, 0.0) }).unwrap();
    assert_eq!(step(&mut world), [(seen.into(), true)]);
    world.sensors.set_layers(gate, CollisionLayers::new(u32::MAX, 2)).unwrap();
    let mut both = step(&mut world);
    both.sort_unstable();
    assert_eq!(both, [(seen.into(), false), (unseen.into(), true)]);
}

/// A plate of 1 cm at 90 m/s passes over a crate at rest.
#[test]
fn a_sensor_that_moves_sweeps_over_bodies() {
    let mut world = world::<f64>();
    let plate = |x: f64| Aabb { min: at(x, -1.0, -1.0), max: at(x + 0.01, 1.0, 1.0) };
    let gate = world.sensors.insert(plate(-3.0)).unwrap();
    let id: BodyId = world.bodies.insert(crate_at(0.0, 0.0)).unwrap();
    let (speed, mut told) = (90.0, Vec::new());
    for step in 1..=5 {
        let x = -3.0 + speed * DT * f64::from(step);
        world.sensors.set(gate, plate(x)).unwrap();
        let (velocity, pivot) = (Vec3::new(speed, 0.0, 0.0), at(x, 0.0, 0.0));
        let motion = WallMotion { velocity, angular_velocity: Vec3::zero(), pivot };
        world.sensors.set_motion(gate, Some(motion)).unwrap();
        world.step(DT).unwrap();
        told.extend(world.sensors.events().iter().map(|it| {
            assert_eq!(it.collider, id.into());
            (it.entered, f64::from(step) * DT - it.time_left)
        }));
    }
    let [(true, enters), (false, leaves)] = told[..] else { panic!("{told:?}") };
    assert!((enters - (2.99 - 0.2) / speed).abs() < 1e-7, "{told:?}");
    assert!((leaves - (3.0 + 0.2) / speed).abs() < 1e-7, "{told:?}");
}

#[test]
fn bodies_do_not_feel_sensors() {
    let end = |sensor: bool| {
        let mut world = world::<f32>();
        world.set_gravity(Vec3::new(0.0, -9.81, 0.0)).unwrap();
        world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        if sensor {
            world.sensors.insert(ball(2.0)).unwrap();
        }
        let bodies = (0..10).map(|seed| any_body(&mut Draw(seed), 0.2, 1.0));
        let ids: Vec<_> = bodies.map(|body| world.bodies.insert(body).unwrap()).collect();
        for _ in 0..60 {
            world.step(DT as f32).unwrap();
        }
        ids.into_iter().map(|id| world.bodies.pose(id).unwrap()).collect::<Vec<_>>()
    };
    assert_eq!(end(true), end(false));
}
