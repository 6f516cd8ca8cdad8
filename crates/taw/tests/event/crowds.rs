//! Crowds under `Response::EventDriven`: more balls at one point than could touch each other.

use taw::prelude::*;

const DT: f64 = 1.0 / 60.0;
const RADIUS: f64 = 0.1;

fn world<S: Scalar>(gravity: f64) -> World<S> {
    let mut world = World::default();
    let (response, rotation) = (Response::EventDriven, Rotation::Dynamic);
    world.set_model(Model { response, rotation, ..Model::default() }).unwrap();
    world.set_gravity(Vec3::new(0.0, -gravity, 0.0).map(S::from_f64)).unwrap();
    world
}

/// Inserts balls of one kilogram at one point.
fn insert<S: Scalar>(world: &mut World<S>, count: usize, at: [f64; 3], velocity: [f64; 3]) {
    let marble = Marble {
        mass: Mass::Kilograms(S::one()),
        velocity: velocity.map(S::from_f64).into(),
        ..Marble::new(at.map(S::from_f64).into(), S::from_f64(RADIUS))
    };
    for _ in 0..count {
        world.marbles.insert(marble).unwrap();
    }
}

fn kinetic<S: Scalar>(world: &World<S>) -> f64 {
    let energy = world.energy();
    energy.kinetic + energy.rotational
}

/// Deepest overlap of two balls, in metres.
fn deepest<S: Scalar>(world: &World<S>) -> f64 {
    let at: Vec<Point3<f64>> =
        world.marbles.position().iter().map(|p| p.map(Scalar::as_f64)).collect();
    let pairs = at.iter().enumerate().flat_map(|(i, a)| at[..i].iter().map(move |b| (a, b)));
    pairs.map(|(a, b)| 2.0 * RADIUS - (a - b).magnitude()).fold(0.0, f64::max)
}

fn falls_on_a_floor_and_parts<S: Scalar>() {
    let (count, height) = (500, 1.0);
    let mut world = world::<S>(9.81);
    world.walls.insert(Plane::new(Vec3::unit_y(), S::zero()).unwrap()).unwrap();
    insert(&mut world, count, [0.0, height, 0.0], [0.0; 3]);
    let potential = count as f64 * 9.81 * (height - RADIUS);
    for step in 0..120 {
        world.step(S::from_f64(DT)).unwrap();
        assert_eq!(world.stopped().count(), 0, "step {step}");
        assert!(kinetic(&world) <= potential * (1.0 + 1e-3), "{} J, step {step}", kinetic(&world));
        assert!(world.contacts.mm.len() <= 32 * count, "step {step}");
    }
    let deepest = deepest(&world);
    assert!(deepest < 0.01 * RADIUS, "overlaps by {deepest} m");
}

#[test]
fn hundreds_at_one_point_fall_on_a_floor_finish_each_step_and_part() {
    falls_on_a_floor_and_parts::<f64>();
    falls_on_a_floor_and_parts::<f32>();
}

#[test]
fn hundreds_at_one_point_part_without_speed() {
    let mut world = world::<f64>(0.0);
    insert(&mut world, 300, [0.0; 3], [0.0; 3]);
    for step in 0..150 {
        world.step(DT).unwrap();
        assert_eq!(world.impacts(), [], "step {step}");
        assert_eq!(world.stopped().count(), 0, "step {step}");
        assert_eq!(kinetic(&world), 0.0, "step {step}");
    }
    assert!(deepest(&world) < 0.01 * RADIUS, "overlaps by {} m", deepest(&world));
}

/// Two crowds that fly towards each other by twice their width in a step.
#[test]
fn crowds_do_not_pass_through_each_other() {
    let (count, speed) = (40, 24.0);
    let mut world = world::<f64>(0.0);
    insert(&mut world, count, [-1.0, 0.0, 0.0], [speed, 0.0, 0.0]);
    insert(&mut world, count, [1.0, 0.05, 0.0], [-speed, 0.0, 0.0]);
    let initial = kinetic(&world);
    let mut impacts = 0;
    for step in 0..20 {
        world.step(DT).unwrap();
        impacts += world.impacts().len();
        assert_eq!(world.stopped().count(), 0, "step {step}");
        assert!(kinetic(&world) <= initial * (1.0 + 1e-9), "{} J, step {step}", kinetic(&world));
        let momentum = world.marbles.velocity().iter().fold(Vec3::zero(), |all, v| all + v);
        assert!(momentum.magnitude() < 1e-9 * speed * count as f64, "{momentum:?}, step {step}");
    }
    assert!(impacts > 0);
    let mean = |rows: &[Point3<f64>]| rows.iter().map(|p| p.x).sum::<f64>() / count as f64;
    let (first, second) = world.marbles.position().split_at(count);
    assert!(mean(first) < mean(second), "{} and {}", mean(first), mean(second));
}
