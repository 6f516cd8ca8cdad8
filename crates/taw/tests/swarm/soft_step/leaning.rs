//! Heavy balls that lean on light ones.

use taw::world::Mass;

use super::*;
use tunnelling::dice;

/// A light ball between the floor and a heavy one that leans over: it is held by friction, of as much
/// as the floor bears for the heavy one. That friction goes with the load.
#[test]
fn a_heavy_ball_that_leans_on_a_light_one_makes_no_energy() {
    let mut random = dice(9);
    for number in 0..1_200 {
        let rotation = [Rotation::None, Rotation::Rolling, Rotation::Dynamic][number % 3];
        let mut world = world::<f32>(1 + number as u32 / 3 % 8);
        world.set_model(Model { rotation, ..world.model() }).unwrap();
        let friction = [0.0, 0.5, 1.0][number / 24 % 3];
        let restitution = if random() < 0.7 { 0.0 } else { 0.5 };
        let material = Some(Material { friction, restitution, ..Material::default() });
        world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        let upper = 0.1 + 0.5 * random() as f32;
        let lower = upper * 25_f32.powf(random() as f32) / 5.0;
        let (ratio, lean) = (10.0 * 30_f32.powf(random() as f32), 0.1 * random() as f32);
        let height = 0.1 * random() as f32 + lower + (upper + lower) * (1.0 - lean * lean).sqrt();
        let mut insert = |x, y, radius, kilograms| {
            let ball = Marble::new(Point3::new(x, y, 0.0), radius);
            let marble = Marble { mass: Mass::Kilograms(kilograms), material, ..ball };
            world.marbles.insert(marble).unwrap();
        };
        insert(0.0, lower, lower, 1.0);
        insert(lean * (upper + lower), height, upper, ratio);
        let begin = world.energy().total();
        for step in 0..120 {
            world.step(1.0 / 60.0).unwrap();
            let now = world.energy().total();
            assert!(
                now < begin * 1.005,
                "{number}, step {step}: {begin} J to {now} J, radii {lower} and {upper}, {ratio} times as heavy"
            );
        }
    }
}

/// The load of a wall goes with the ball that pressed on it: a light ball slides down a slope once
/// the heavy one on it is gone.
#[test]
fn friction_for_others_goes_with_them() {
    let mut world = world::<f32>(2);
    world.set_model(Model { rotation: Rotation::None, ..world.model() }).unwrap();
    let normal = Vec3::new(0.5, 0.75_f32.sqrt(), 0.0);
    world.walls.insert(Plane::new(normal, 0.0).unwrap()).unwrap();
    let material = Some(Material { friction: 0.1, restitution: 0.0, ..Material::default() });
    let mut insert = |along: f32, kilograms| {
        let ball = Marble::new(Point3::new(0.0, 0.0, 0.0) + normal * along, 0.5);
        let marble = Marble { mass: Mass::Kilograms(kilograms), material, ..ball };
        world.marbles.insert(marble).unwrap()
    };
    let (light, heavy) = (insert(0.5, 1.0), insert(1.5, 2000.0));
    for _ in 0..6 {
        world.step(1.0 / 60.0).unwrap();
    }
    world.marbles.remove(heavy).unwrap();
    let before = world.marbles.get(light).unwrap().velocity;
    for _ in 0..60 {
        world.step(1.0 / 60.0).unwrap();
    }
    let gained = (world.marbles.get(light).unwrap().velocity - before).magnitude();
    // Down a slope of 30 degrees, less friction.
    let expected = 9.81 * (0.5 - 0.1 * 0.75_f32.sqrt());
    assert!((gained - expected).abs() < 0.1 * expected, "{gained} in place of {expected} m/s");
}

/// Two tonnes that lean on a kilogram: 29 kJ became 7.6 MJ.
#[test]
fn two_tonnes_on_a_kilogram_make_no_energy() {
    let mut world = world::<f64>(1);
    world.set_model(Model { rotation: Rotation::None, ..world.model() }).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    let material = Some(Material { friction: 0.5, restitution: 0.0, ..Material::default() });
    for (x, y, kilograms) in [(0.0, 0.5, 1.0), (0.1, 0.5 + 0.99_f64.sqrt(), 2000.0)] {
        let ball = Marble::new(Point3::new(x, y, 0.0), 0.5);
        let marble = Marble { mass: Mass::Kilograms(kilograms), material, ..ball };
        world.marbles.insert(marble).unwrap();
    }
    let begin = world.energy().total();
    for step in 0..120 {
        world.step(1.0 / 60.0).unwrap();
        let now = world.energy().total();
        assert!(now < begin * 1.001, "step {step}: {begin} to {now} J");
    }
}
