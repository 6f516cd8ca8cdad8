//! The lab's method: overlap is no energy, and the speed reported is the speed moved.

use taw::prelude::*;

const DT: f64 = 1.0 / 60.0;
const G: f64 = 9.81;
const DETECTIONS: [Detection; 2] = [Detection::Discrete, Detection::Swept];

fn world(detection: Detection, integrator: Integrator) -> World<f64> {
    let mut world = World::default();
    world.set_model(Model { detection, integrator, ..Model::default() }).unwrap();
    world
}

fn floor(world: &mut World<f64>) {
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
}

fn ball(world: &mut World<f64>, at: [f64; 3], radius: f64) -> MarbleId {
    // All of a kilogram: the method knows no masses.
    let marble = Marble { mass: Mass::Kilograms(1.0), ..Marble::new(Point3::from(at), radius) };
    world.marbles.insert(marble).unwrap()
}

fn fastest(world: &World<f64>) -> f64 {
    world.marbles.velocity().iter().map(|v| v.magnitude()).fold(0.0, f64::max)
}

/// Greatest overlap of two marbles, in metres.
fn deepest(world: &World<f64>) -> f64 {
    let (at, radius) = (world.marbles.position(), world.marbles.radius());
    let depth = |i: usize, j: usize| radius[i] + radius[j] - (at[i] - at[j]).magnitude();
    let pairs = (0..at.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    pairs.map(|(i, j)| depth(i, j)).fold(0.0, f64::max)
}

#[test]
fn marbles_at_one_point_part_within_two_seconds_and_gain_no_speed() {
    for detection in DETECTIONS {
        for (count, gravity) in [(2, 0.0), (2, G), (30, 0.0), (30, G)] {
            let mut world = world(detection, Integrator::SemiImplicitEuler);
            world.set_gravity(Vec3::unit_y() * -gravity).unwrap();
            floor(&mut world);
            for _ in 0..count {
                ball(&mut world, [0.0, 0.2, 0.0], 0.2);
            }
            let (mut most, mut highest) = (0.0_f64, 0.0_f64);
            for _ in 0..120 {
                world.step(DT).unwrap();
                most = most.max(fastest(&world));
                highest = world.marbles.position().iter().map(|at| at.y).fold(highest, f64::max);
            }
            let name = format!("{count} under {gravity} m/s² {detection:?}");
            // They are lifted to where they have room, and what gravity gives then is theirs.
            let fall = (2.0 * gravity * highest).sqrt();
            assert!(most <= fall, "{name}: {most} m/s, {highest} m high");
            assert!(deepest(&world) < 0.02, "{name}: {} m deep", deepest(&world));
        }
    }
}

#[test]
fn a_radius_that_grows_throws_nothing() {
    for detection in DETECTIONS {
        let mut world = world(detection, Integrator::SemiImplicitEuler);
        floor(&mut world);
        let grows = ball(&mut world, [0.0, 0.8, 0.0], 0.8);
        let lies = ball(&mut world, [0.0, 2.4, 0.0], 0.8);
        for step in 0..120 {
            if step == 30 {
                world.marbles.set_radius(grows, 2.0).unwrap();
            }
            world.step(DT).unwrap();
            let speed = fastest(&world);
            // Where parting opens a gap, gravity closes it in the next substep.
            let fall = G * DT * 1.001;
            assert!(step < 30 || speed < fall, "{detection:?}, step {step}: {speed} m/s");
        }
        let heights = [grows, lies].map(|id| world.marbles.get(id).unwrap().position.y);
        assert!((heights[0] - 2.0).abs() < 0.01, "{detection:?}: {heights:?}");
        assert!((heights[1] - 4.8).abs() < 0.02, "{detection:?}: {heights:?}");
    }
}

/// Five layers of marbles that were dropped into a shaft as a column.
#[test]
fn a_pit_sags_a_little_and_less_with_more_iterations() {
    let radius = 0.09;
    // Allowed overlap over the radius, and mean speed in m/s.
    for (iterations, substeps, overlap, speed) in
        [(8, 1, 0.5, 0.15), (50, 1, 0.02, 0.04), (8, 4, 0.02, 0.04)]
    {
        let mut world = world(Detection::Discrete, Integrator::SemiImplicitEuler);
        world.set_model(Model { iterations, substeps, ..world.model() }).unwrap();
        world.set_gravity(Vec3::unit_y() * -G).unwrap();
        floor(&mut world);
        for inward in [Vec3::unit_x(), -Vec3::unit_x(), Vec3::unit_z(), -Vec3::unit_z()] {
            world.walls.insert(Plane::new(inward, -0.8).unwrap()).unwrap();
        }
        for i in 0..300_u32 {
            let (place, aside) = (f64::from(i), |part: f64| 0.01 * (f64::from(i) * part).fract());
            let x = (place % 4.0 - 1.5) * 0.19 + aside(0.618);
            let z = ((place / 4.0).floor() % 4.0 - 1.5) * 0.19 + aside(0.414);
            ball(&mut world, [x, 0.3 + 0.2 * (place / 16.0).floor(), z], radius);
        }
        let (mut deepest_late, mut mean_late) = (0.0_f64, 0.0_f64);
        for step in 0..1_200 {
            world.step(DT).unwrap();
            if step >= 1_140 {
                let sum: f64 = world.marbles.velocity().iter().map(|v| v.magnitude()).sum();
                deepest_late = deepest_late.max(deepest(&world) / radius);
                mean_late = mean_late.max(sum / 300.0);
            }
        }
        let name = format!("{iterations} iterations, {substeps} substeps");
        println!("{name}: {deepest_late} radii, {mean_late} m/s");
        assert!(deepest_late < overlap, "{name}: {deepest_late} radii deep");
        assert!(mean_late < speed, "{name}: {mean_late} m/s");
    }
}

/// However slowly, and whether or not positions follow the change of velocity within the substep.
#[test]
fn a_marble_lands_on_the_floor_not_above_it() {
    for detection in DETECTIONS {
        for integrator in Integrator::ALL {
            for height in [1e-4, 3e-3, 6e-3, 0.1] {
                let mut world = world(detection, integrator);
                world.set_gravity(Vec3::unit_y() * -G).unwrap();
                floor(&mut world);
                ball(&mut world, [0.0, 0.2 + height, 0.0], 0.2);
                for _ in 0..60 {
                    world.step(DT).unwrap();
                }
                let gap = world.marbles.position()[0].y - 0.2;
                let name = format!("{integrator:?}, {detection:?}, from {height} m");
                assert!(gap.abs() < 1e-3, "{name}: {gap} m above the floor");
            }
        }
    }
}

#[test]
fn what_lies_reports_no_speed() {
    for integrator in Integrator::ALL {
        for detection in DETECTIONS {
            for count in [1, 5] {
                let mut world = world(detection, integrator);
                floor(&mut world);
                for i in 0..count {
                    ball(&mut world, [0.0, 0.2 + 0.4 * f64::from(i), 0.0], 0.2);
                }
                for step in 0..240 {
                    world.step(DT).unwrap();
                    let (speed, name) = (fastest(&world), format!("{integrator:?} {detection:?}"));
                    // Eight passes leave a hundredth of what gravity gives to a tower of five.
                    let most = if count == 1 { 1e-3 } else { 0.02 * G * DT };
                    assert!(step < 120 || speed < most, "{name}, {count}, {step}: {speed} m/s");
                }
                for (i, at) in (0..count).zip(world.marbles.position()) {
                    let off = at.y - 0.2 - 0.4 * f64::from(i);
                    assert!(off.abs() < 0.02, "{integrator:?} {detection:?}: {off} m off");
                }
            }
        }
    }
}

#[test]
fn nothing_bounces_whatever_its_restitution() {
    for integrator in Integrator::ALL {
        for restitution in [0.5, 0.9] {
            let mut world = world(Detection::Swept, integrator);
            floor(&mut world);
            let id = ball(&mut world, [0.0, 1.2, 0.0], 0.2);
            let material = Material { restitution, ..Material::default() };
            world.marbles.set_material(id, Some(material)).unwrap();
            let mut landed = false;
            for _ in 0..240 {
                world.step(DT).unwrap();
                let height = world.marbles.get(id).unwrap().position.y;
                landed |= height < 0.201;
                assert!(!landed || height < 0.201, "{integrator:?}: {height} m");
            }
            assert!(landed);
        }
    }
}

/// Marbles thrown into a box, many over each other. Nothing may add to the energy but what parts
/// them lifts, and the speeds are only those that were there and those of the falls.
#[test]
fn a_squeezed_heap_gains_no_speed() {
    let mut random = fastrand::Rng::with_seed(11);
    for scene in 0..400 {
        let detection = DETECTIONS[scene % 2];
        let mut world = world(detection, Integrator::SemiImplicitEuler);
        let gravity = if random.bool() { G } else { 0.0 };
        world.set_gravity(Vec3::unit_y() * -gravity).unwrap();
        for (normal, at) in [
            (Vec3::unit_y(), 0.0),
            (Vec3::unit_x(), -0.5),
            (-Vec3::unit_x(), -0.5),
            (Vec3::unit_z(), -0.5),
            (-Vec3::unit_z(), -0.5),
        ] {
            world.walls.insert(Plane::new(normal, at).unwrap()).unwrap();
        }
        let speed = if random.bool() { 0.0 } else { 2.0 * random.f64() };
        for _ in 0..2 + random.usize(0..40) {
            let mut number = || random.f64() - 0.5;
            let at = [0.8 * number(), 0.5 + 0.8 * number(), 0.8 * number()];
            let velocity = Vec3::new(number(), number(), number()) * speed;
            let id = ball(&mut world, at, 0.05 + 0.1 * (number() + 0.5));
            world.marbles.set_velocity(id, velocity).unwrap();
        }
        for step in 0..120 {
            let (before, from) = (world.energy().kinetic, world.marbles.position().to_vec());
            world.step(DT).unwrap();
            let after = world.energy().kinetic;
            let fall = |row: usize| -gravity * DT * world.marbles.velocity()[row].y;
            let falls: f64 = (0..from.len()).map(|row| fall(row).abs()).sum();
            let allowed = falls + 0.5 * (gravity * DT).powi(2) * from.len() as f64;
            let gained = after - before - allowed;
            assert!(gained <= 1e-9, "scene {scene}, step {step}: {before} J to {after} J");
        }
    }
}

/// The speed reported is the speed moved, but for what parts an overlap; and marbles give each
/// other what they take.
#[test]
fn marbles_that_meet_move_as_they_say_and_keep_their_momentum() {
    let mut random = fastrand::Rng::with_seed(5);
    for scene in 0..400 {
        let mut world = world(DETECTIONS[scene % 2], Integrator::SemiImplicitEuler);
        world.set_gravity(Vec3::zero()).unwrap();
        for x in 0..3 {
            for y in 0..3 {
                let mut number = || random.f64() - 0.5;
                let id = ball(&mut world, [0.5 * f64::from(x), 0.5 * f64::from(y), 0.0], 0.2);
                let velocity = Vec3::new(number(), number(), number()) * 6.0;
                world.marbles.set_velocity(id, velocity).unwrap();
            }
        }
        let (momentum, energy) = (world.momentum(), world.energy().kinetic);
        for _ in 0..60 {
            world.step(DT).unwrap();
            assert!((world.momentum() - momentum).magnitude() < 1e-12, "scene {scene}");
        }
        assert!(world.energy().kinetic <= energy * (1.0 + 1e-12), "scene {scene}");
        let from = world.marbles.position().to_vec();
        let apart = deepest(&world) == 0.0;
        world.step(DT).unwrap();
        if apart {
            for (row, velocity) in world.marbles.velocity().iter().enumerate() {
                let moved = (world.marbles.position()[row] - from[row]) / DT;
                assert!((moved - velocity).magnitude() < 1e-9, "scene {scene}");
            }
        }
    }
}
