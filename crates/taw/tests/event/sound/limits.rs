//! Steps end, whatever is asked of them, and balls stay inside.

use std::time::{Duration, Instant};

use taw::frame::AxisAngle;
use taw::prelude::*;
use taw::shape::{Mesh, Obb};

use super::{DT, point, surface, vector, world};
use crate::draw::Draw;

/// The hopper of the lab, with one wall askew by nothing.
fn hopper<S: Scalar>(askew: f64, substeps: u32) -> World<S> {
    let mut world = world::<S>(Rotation::Dynamic, substeps);
    let mut plane = |normal: Vec3<S>, offset: f64| {
        world.walls.insert(Plane::new(normal, S::from_f64(offset)).unwrap()).unwrap()
    };
    plane(vector(0.0, 1.0, 0.0), -0.3);
    plane(vector(0.0, askew, 1.0), -0.012);
    plane(vector(0.0, 0.0, -1.0), -0.012);
    for side in [-1.0, 1.0] {
        let turn =
            AxisAngle::new(vector(0.0, 0.0, 1.0), S::from_f64(-side * std::f64::consts::FRAC_PI_4));
        let center = point(0.145 * side, 0.1, 0.0);
        let half = vector(0.01, 0.15, 0.025);
        world.walls.insert(Obb::new(center, turn.unwrap().into(), half).unwrap()).unwrap();
    }
    let mut draw = Draw(7);
    for i in 0..36 {
        let (column, row) = (f64::from(i % 6), f64::from(i / 6));
        let mut off = || draw.between(-0.0008, 0.0008);
        let at = point(-0.055 + 0.022 * column + off(), 0.13 + 0.022 * row + off(), 0.2 * off());
        let marble =
            Marble { material: Some(surface(0.3, 0.3)), ..Marble::new(at, S::from_f64(0.01)) };
        world.marbles.insert(marble).unwrap();
    }
    world
}

#[test]
fn steps_of_any_length_end() {
    for askew in [0.0, 1e-20] {
        for substeps in [1, 2] {
            let mut world = hopper::<f64>(askew, substeps);
            for (number, dt) in (0..40).zip([DT, 1e-3, 0.5].into_iter().cycle()) {
                let begin = Instant::now();
                world.step(dt).unwrap();
                let took = begin.elapsed();
                assert!(took < Duration::from_secs(20), "step {number} of {dt} took {took:?}");
            }
        }
    }
}

#[test]
fn a_ball_that_cannot_be_finished_is_named_and_stays_inside() {
    let mut world = world::<f64>(Rotation::None, 1);
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let mut normal = Vec3::new(0.0, 0.0, 0.0);
            normal[axis] = side;
            world.walls.insert(Plane::new(normal, -1.0).unwrap()).unwrap();
        }
    }
    let marble = Marble {
        velocity: Vec3::new(1e10, 2e9, 3e8),
        material: Some(surface(1.0, 0.0)),
        ..Marble::new(Point3::new(0.0, 0.0, 0.0), 0.1)
    };
    let id = world.marbles.insert(marble).unwrap();
    let begin = Instant::now();
    world.step(DT).unwrap();
    let took = begin.elapsed();
    // Others may have the processor, too.
    assert!(took < Duration::from_secs(20), "{took:?}");
    let at = world.marbles.position()[0];
    assert!(at.x.abs() <= 0.9 + 1e-9 && at.y.abs() <= 0.9 + 1e-9 && at.z.abs() <= 0.9 + 1e-9);
    assert_eq!(world.stopped().collect::<Vec<_>>(), [id]);
}

#[test]
fn what_f64_holds_and_f32_does_not_stops() {
    for response in [Response::EventDriven, Response::Displacement, Response::Impulse] {
        let mut world = World::<f32>::default();
        let model = Model {
            response,
            precision: Precision::Compensated,
            rotation: Rotation::Dynamic,
            ..Model::default()
        };
        world.set_model(model).unwrap();
        world.set_gravity(Vec3::new(1e38, 0.0, 0.0)).unwrap();
        let at = Point3::new(3e38, 0.0, 0.0);
        let velocity = Vec3::new(3e38, 0.0, 0.0);
        let id = world.marbles.insert(Marble { velocity, ..Marble::new(at, 1.0) }).unwrap();
        for _ in 0..4 {
            world.step(1.0).unwrap();
            assert_eq!(world.stopped().collect::<Vec<_>>(), [id], "{response:?}");
            let marble = world.marbles.get(id).unwrap();
            assert_eq!(marble.position, at, "{response:?}");
            assert_eq!(marble.velocity, Vec3::new(0.0, 0.0, 0.0), "{response:?}");
        }
    }
}

#[test]
fn a_thousand_at_one_point_end_their_step() {
    let mut world = world::<f32>(Rotation::Dynamic, 1);
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    for _ in 0..1000 {
        world.marbles.insert(Marble::new(Point3::new(0.0, 1.0, 0.0), 0.05)).unwrap();
    }
    for step in 0..2 {
        let begin = Instant::now();
        world.step(DT as f32).unwrap();
        let (took, stopped) = (begin.elapsed(), world.stopped().count());
        println!("step {step}: {took:?}, {stopped} stopped");
        assert!(took < Duration::from_mins(1), "{took:?}");
    }
}

#[test]
fn balls_that_part_from_each_other_stay_inside() {
    // Just below a ceiling that it does not touch yet, out of one that is much heavier.
    let mut closed = vec![("nothing", None)];
    let sheet = |y: f64, corners: [[u32; 3]; 2]| {
        let at = |x: f64, z: f64| Point3::new(x, y, z);
        let points = vec![at(-9.0, -9.0), at(9.0, -9.0), at(9.0, 9.0), at(-9.0, 9.0)];
        Mesh::new(points, corners.to_vec()).unwrap()
    };
    closed.push(("sheet", Some(sheet(1.0, [[0, 1, 2], [0, 2, 3]]))));
    for (name, sheet) in closed {
        for deep in [0.05, 0.1, 0.19] {
            let mut world = world::<f64>(Rotation::Dynamic, 1);
            let ceiling = if sheet.is_some() { 9.0 } else { 1.0 };
            world.walls.insert(Plane::new(-Vec3::unit_y(), -ceiling).unwrap()).unwrap();
            world.walls.insert(Plane::new(Vec3::unit_y(), -9.0).unwrap()).unwrap();
            if let Some(sheet) = sheet.clone() {
                world.walls.insert(sheet).unwrap();
            }
            for (mass, y) in [(1.0, 0.89), (1e6, 0.89 - 0.2 + deep)] {
                let mass = Mass::Kilograms(mass);
                let marble = Marble { mass, ..Marble::new(Point3::new(0.0, y, 0.0), 0.1) };
                world.marbles.insert(marble).unwrap();
            }
            for step in 0..30 {
                world.step(DT).unwrap();
                for at in world.marbles.position() {
                    let gap = 0.9 - at.y;
                    assert!(gap > -0.1 * 4e-3, "{name}, {deep}: {gap} m at step {step}");
                }
            }
        }
    }
}

#[test]
fn a_ball_in_a_valley_rests_on_both_of_its_sides() {
    // A fall of a step gives 0.16 m/s; a tenth of that counts as rest among others.
    for toward in [0.0, 0.01, 0.016] {
        let mut world = world::<f64>(Rotation::Dynamic, 1);
        for side in [-1.0, 1.0] {
            let normal = Vec3::new(-0.1, 1.0, side).normalize();
            world.walls.insert(Plane::new(normal, 0.0).unwrap()).unwrap();
        }
        let normal = Vec3::new(-0.1, 1.0, 1.0).normalize();
        let high = 0.1 / normal.y;
        let marble = Marble {
            material: Some(surface(0.0, 0.0)),
            velocity: normal * -toward,
            ..Marble::new(Point3::new(0.0, high, 0.0), 0.1)
        };
        world.marbles.insert(marble).unwrap();
        let mut energy = world.energy().total();
        for step in 0..120 {
            world.step(DT).unwrap();
            let (now, impacts) = (world.energy().total(), world.impacts().len());
            // First its approach ends.
            let (gain, begins) = (now - energy, step < 20);
            assert!(begins || gain <= 1e-9, "{toward}: {gain} J at step {step}");
            assert!(begins || impacts == 0, "{toward}: {impacts} impacts in step {step}");
            energy = now;
        }
        let across = world.marbles.velocity()[0].z;
        assert!(across.abs() < 1e-6, "{toward}: {across} m/s");
    }
}

#[test]
fn balls_that_start_in_each_other_part_at_once() {
    // Also if they part by themselves, but not soon enough.
    for apart in [0.0, 0.3, 1.0] {
        let mut world = world::<f64>(Rotation::Dynamic, 1);
        for side in [-1.0, 1.0] {
            let marble = Marble {
                velocity: Vec3::new(0.5 * side * apart, 0.0, 0.0),
                ..Marble::new(Point3::new(0.02 * side, 9.0, 0.0), 0.1)
            };
            world.marbles.insert(marble).unwrap();
        }
        let energy = world.energy().total();
        for step in 0..12 {
            world.step(DT).unwrap();
            let gained = world.energy().total() / energy - 1.0;
            assert!(gained.abs() < 1e-9, "{apart} m/s: {gained} at step {step}");
        }
        let at = world.marbles.position();
        let gap = (at[1] - at[0]).magnitude() - 0.2;
        assert!(gap > -0.1 * 4e-3, "{apart} m/s: {gap} m");
    }
}
