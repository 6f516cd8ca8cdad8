//! Slow marbles, which must not sleep.

use taw::motion::WallMotion;
use taw::prelude::*;

use super::{DT, steps, world};

fn slope(degrees: f32) -> World<f32> {
    let mut world = world();
    let (sin, cos) = degrees.to_radians().sin_cos();
    world.walls.insert(Plane::new(Vec3::new(sin, cos, 0.0), 0.0).unwrap()).unwrap();
    world
}

/// Distance that a marble goes in ten seconds, in metres, and if it sleeps then.
fn ten_seconds(world: &mut World<f32>, marble: Marble<f32>) -> (f32, bool) {
    let id = world.marbles.insert(marble).unwrap();
    for _ in 0..600 {
        world.step(DT).unwrap();
    }
    let way = world.marbles.get(id).unwrap().position - marble.position;
    (cgmath::InnerSpace::magnitude(way), world.is_asleep(id).unwrap())
}

#[test]
fn what_begins_to_roll_goes_on() {
    for (degrees, radius) in [(1.0_f32, 0.3), (0.5, 0.1), (2.0, 0.6), (25.0, 100.0), (0.2, 0.01)] {
        let mut world = slope(degrees);
        let (sin, cos) = degrees.to_radians().sin_cos();
        let at = Point3::new(sin * radius, cos * radius, 0.0);
        let rough = Material { friction: 0.8, ..Material::default() };
        let ball = Marble { material: Some(rough), ..Marble::new(at, radius) };
        let (way, _) = ten_seconds(&mut world, ball);
        let exact = 0.5 * 5.0 / 7.0 * 9.81 * sin * 100.0;
        assert!((way / exact - 1.0).abs() < 0.02, "{degrees}°, {radius} m: {way}, not {exact}");
    }
}

#[test]
fn what_no_force_moves_goes_on() {
    for speed in [0.03, 1e-4] {
        let ball = Marble {
            velocity: Vec3::new(speed, 0.0, 0.0),
            ..Marble::new(Point3::new(0.0, 5.0, 0.0), 0.1)
        };
        for ball in [Marble { mass: Mass::Infinite, ..ball }, Marble { gravity_scale: 0.0, ..ball }]
        {
            let (way, _) = ten_seconds(&mut slope(0.0), ball);
            assert!((way / (10.0 * speed) - 1.0).abs() < 1e-3, "{ball:?} went {way}");
        }
    }
}

#[test]
fn what_a_conveyor_carries_goes_on() {
    for speed in [0.04, 0.002] {
        let mut world = world();
        let floor = world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        let motion = WallMotion {
            velocity: Vec3::new(speed, 0.0, 0.0),
            angular_velocity: Vec3::new(0.0, 0.0, 0.0),
            pivot: Point3::new(0.0, 0.0, 0.0),
        };
        world.walls.set_motion(floor, Some(motion)).unwrap();
        let sticky = Material { rolling_resistance: 0.1, ..Material::default() };
        let ball =
            Marble { material: Some(sticky), ..Marble::new(Point3::new(0.0, 0.1, 0.0), 0.1) };
        let (way, _) = ten_seconds(&mut world, ball);
        assert!((way / (10.0 * speed) - 1.0).abs() < 0.02, "{way}, not {}", 10.0 * speed);
    }
}

#[test]
fn nothing_turns_back_so_slowly_that_it_sleeps_there() {
    let thrown = Marble {
        velocity: Vec3::new(0.0, 3.0, 0.0),
        ..Marble::new(Point3::new(0.0, 5000.0, 0.0), 1000.0)
    };
    let (_, asleep) = ten_seconds(&mut world(), thrown);
    assert!(!asleep);
    // Nor in steps of a second.
    let mut world = world();
    let id = world.marbles.insert(Marble::new(Point3::new(0.0, 100.0, 0.0), 0.1)).unwrap();
    for _ in 0..5 {
        world.step(1.0).unwrap();
    }
    let height = world.marbles.get(id).unwrap().position.y;
    assert!((height - (100.0 - 0.5 * 9.81 * 25.0)).abs() < 0.01, "{height}");
}

#[test]
fn a_giant_far_away_stops_nobody() {
    for giant in [None, Some(1.0), Some(10.0), Some(1000.0)] {
        let mut world = slope(0.0);
        if let Some(radius) = giant {
            let at = Point3::new(0.0, radius, 5000.0);
            world.marbles.insert(Marble::new(at, radius)).unwrap();
        }
        let rolls = Marble {
            velocity: Vec3::new(0.2, 0.0, 0.0),
            angular_velocity: Vec3::new(0.0, 0.0, -20.0),
            ..Marble::new(Point3::new(0.0, 0.01, 0.0), 0.01)
        };
        let (way, _) = ten_seconds(&mut world, rolls);
        assert!((way - 2.0).abs() < 0.02, "beside {giant:?}: {way}");
    }
}

#[test]
fn a_clone_goes_on_alike_whatever_the_radius() {
    for radius in [0.1, 0.125, 1.0 / 3.0] {
        let mut world = World::<f64>::default();
        let model =
            Model { response: Response::SoftStep, rotation: Rotation::Dynamic, ..Model::default() };
        world.set_model(model).unwrap();
        world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        let id = world.marbles.insert(Marble::new(Point3::new(0.0, radius, 0.0), radius)).unwrap();
        for _ in 0..180 {
            world.step(1.0 / 60.0).unwrap();
        }
        let mut clone = world.clone();
        assert!(world.is_asleep(id).unwrap(), "{radius}");
        for world in [&mut world, &mut clone] {
            world.step(1.0 / 60.0).unwrap();
        }
        assert!(clone.is_asleep(id).unwrap(), "{radius}");
        assert_eq!(clone, world, "{radius}");
    }
}

/// Spin alone is motion, of what nothing bears.
#[test]
fn what_spins_in_mid_air_goes_on() {
    for mass in [Mass::Infinite, Mass::default()] {
        let mut world = slope(0.0);
        let angular_velocity = Vec3::new(0.0, 2.0, 0.0);
        let at = Point3::new(0.0, 5.0, 0.0);
        let spins = Marble { mass, gravity_scale: 0.0, angular_velocity, ..Marble::new(at, 0.1) };
        let id = world.marbles.insert(spins).unwrap();
        steps(&mut world, 600);
        let rate = world.marbles.get(id).unwrap().angular_velocity;
        assert!((rate.y - 2.0).abs() < 1e-3, "{mass:?}: {rate:?}");
    }
}

/// One that nothing turns aside, however slowly it comes to one that sleeps.
#[test]
fn what_has_infinite_mass_moves_on_through_sleepers() {
    for speed in [0.003, 0.01, 0.1, 1.0] {
        let mut world = world();
        world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        let light = Marble::new(Point3::new(0.3, 0.25, 0.0), 0.25);
        let light = world.marbles.insert(light).unwrap();
        steps(&mut world, 120);
        assert!(world.is_asleep(light).unwrap());
        let down = Vec3::new(0.0, -speed, 0.0);
        let heavy = Marble {
            mass: Mass::Infinite,
            gravity_scale: 0.0,
            velocity: down,
            ..Marble::new(Point3::new(0.0, 1.0654, 0.0), 0.6)
        };
        let heavy = world.marbles.insert(heavy).unwrap();
        let count = (0.05 / speed * 60.0) as u32;
        for step in 0..count {
            steps(&mut world, 1);
            let velocity = world.marbles.get(heavy).unwrap().velocity;
            // Except for rounding of gravity, which is added and taken.
            let turned = cgmath::InnerSpace::magnitude(velocity - down);
            assert!(turned < 0.01 * speed, "{speed} m/s, step {step}: {velocity:?}");
        }
        assert!(world.marbles.get(light).unwrap().position.x > 0.31, "{speed} m/s");
    }
}

/// Damping slows one of infinite mass as it slows others.
#[test]
fn damping_slows_what_has_infinite_mass() {
    let ends = [Mass::Infinite, Mass::default()].map(|mass| {
        let mut world = slope(0.0);
        let slows = Marble {
            mass,
            gravity_scale: 0.0,
            velocity: Vec3::new(2.0, 0.0, 0.0),
            damping: taw::world::Damping { linear: 1.0, angular: 0.0 },
            ..Marble::new(Point3::new(0.0, 5.0, 0.0), 0.1)
        };
        let id = world.marbles.insert(slows).unwrap();
        steps(&mut world, 60);
        world.marbles.get(id).unwrap()
    });
    let [infinite, finite] = ends;
    assert!((finite.velocity.x - 2.0 * (-1.0_f32).exp()).abs() < 1e-3, "{finite:?}");
    assert!((infinite.velocity - finite.velocity).x.abs() < 1e-3, "{infinite:?}");
    assert!((infinite.position - finite.position).x.abs() < 1e-3, "{infinite:?}");
}
