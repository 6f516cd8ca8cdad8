//! Where the energy of a step goes, against what formulas say of the same scene.

use taw::prelude::*;
use taw::world::EnergyAudit;

const BOTH: [Response; 2] = [Response::EventDriven, Response::Impulse];

fn model(response: Response) -> Model {
    Model { response, rotation: Rotation::Dynamic, iterations: 50, ..Model::default() }
}

fn material(restitution: f64, friction: f64) -> Material<f64> {
    Material { restitution, friction, ..Material::default() }
}

/// A floor, and marbles of a kilogram each with this material, places and velocities.
fn world(
    response: Response,
    material: Material<f64>,
    marbles: &[([f64; 3], [f64; 3])],
) -> World<f64> {
    let mut world = World::default();
    world.set_model(model(response)).unwrap();
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    for (at, velocity) in marbles {
        let marble = Marble {
            velocity: Vec3::from(*velocity),
            mass: Mass::Kilograms(1.0),
            material: Some(material),
            ..Marble::new(Point3::from(*at), 0.1)
        };
        world.marbles.insert(marble).unwrap();
    }
    world.enable_energy_audit(true);
    world
}

/// Steps for so many seconds and adds the accounts up. In each step, what is accounted for is
/// what the energy changed by.
fn run(world: &mut World<f64>, seconds: f64, dt: f64) -> EnergyAudit {
    let mut sum = EnergyAudit::default();
    for _ in 0..(seconds / dt).round() as u32 {
        let before = world.energy().total();
        world.step(dt).unwrap();
        let a = world.energy_audit().unwrap();
        let taken = a.friction + a.restitution + a.resistance + a.solver;
        let change = a.forces + a.walls - taken;
        let error = world.energy().total() - before - change;
        let scale = before.abs().max(world.energy().total().abs()).max(1.0);
        assert!(error.abs() < 1e-12 * scale, "{error:e} of {scale:e}");
        sum.forces += a.forces;
        sum.walls += a.walls;
        sum.friction += a.friction;
        sum.restitution += a.restitution;
        sum.resistance += a.resistance;
        sum.solver += a.solver;
        sum.momentum = sum.momentum.max(a.momentum);
        sum.max_penetration = sum.max_penetration.max(a.max_penetration);
        sum.collisions += a.collisions;
    }
    sum
}

#[track_caller]
fn near(what: f64, should: f64, tolerance: f64) {
    assert!((what - should).abs() <= tolerance, "{what:e} is not {should:e}");
}

#[test]
fn a_bounce_takes_what_restitution_says() {
    // Falls a metre: v² = 2 g h, of which 1 - e² goes.
    let taken = 9.81 * (1.0 - 0.8 * 0.8);
    let falls = [([0.0, 1.1, 0.0], [0.0; 3])];
    let sum = run(&mut world(Response::EventDriven, material(0.8, 0.5), &falls), 0.6, 1.0 / 60.0);
    near(sum.restitution, taken, 1e-12);
    for nothing in [sum.friction, sum.resistance, sum.solver, sum.walls, sum.forces, sum.momentum] {
        near(nothing, 0.0, 1e-12);
    }
    assert_eq!(sum.collisions, 1);
    // The bounce of an impulse is of the speed at the end of its substep.
    let sum = run(&mut world(Response::Impulse, material(0.8, 0.5), &falls), 0.6, 1e-4);
    near(sum.restitution, taken, 2e-3);
    near(sum.solver, 0.0, 2e-2);
    assert_eq!(sum.collisions, 1);
    // A spring gives back what it does not take; how much that is, its 16 steps decide.
    let springs = Response::Penalty(ContactLaw::SpringDashpot);
    let mut world = world(springs, material(0.8, 0.5), &falls);
    let before = world.energy().total();
    let sum = run(&mut world, 0.6, 1e-5);
    near(sum.restitution, before - world.energy().total(), 2e-3);
    near(sum.restitution, taken, 5e-2);
}

#[test]
fn a_slide_that_ends_in_rolling_takes_two_sevenths() {
    for response in BOTH {
        let slides = [([0.0, 0.1, 0.0], [2.0, 0.0, 0.0])];
        let sum = run(&mut world(response, material(0.0, 0.2), &slides), 1.0, 1.0 / 120.0);
        let tolerance = if response == Response::Impulse { 2e-3 } else { 1e-12 };
        near(sum.friction, 0.5 * 4.0 * 2.0 / 7.0, tolerance);
        near(sum.restitution, 0.0, 1e-12);
        near(sum.resistance, 0.0, 1e-12);
        near(sum.solver, 0.0, tolerance);
        near(sum.momentum, 0.0, 1e-12);
    }
}

#[test]
fn rolling_resistance_takes_the_rest() {
    for response in BOTH {
        let resists = Material { rolling_resistance: 0.05, ..material(0.0, 0.5) };
        let mut world = world(response, resists, &[([0.0, 0.1, 0.0], [1.0, 0.0, 0.0])]);
        let id = world.marbles.id(0).unwrap();
        world.marbles.set_angular_velocity(id, Vec3::new(0.0, 0.0, -10.0)).unwrap();
        let sum = run(&mut world, 5.0, 1.0 / 240.0);
        near(world.energy().kinetic, 0.0, 1e-20);
        let tolerance = if response == Response::Impulse { 1e-2 } else { 1e-10 };
        near(sum.resistance + sum.friction, 0.7, tolerance);
        near(sum.resistance, 0.7, tolerance);
    }
}

#[test]
fn a_belt_brings_in_what_it_gives_and_what_it_rubs_off() {
    for response in BOTH {
        let mut world = world(response, material(0.0, 0.3), &[([0.0, 0.1, 0.0], [0.0; 3])]);
        let belt = world.walls.id(0).unwrap();
        let velocity = Vec3::new(1.4, 0.0, 0.0);
        let motion = taw::motion::WallMotion {
            velocity,
            angular_velocity: Vec3::zero(),
            pivot: Point3::origin(),
        };
        world.walls.set_motion(belt, Some(motion)).unwrap();
        let sum = run(&mut world, 1.0, 1.0 / 240.0);
        // Friction brings the ball to 2/7 of the belt's speed.
        let speed = 0.4;
        let tolerance = if response == Response::Impulse { 2e-3 } else { 1e-12 };
        near(world.energy().kinetic, 0.5 * speed * speed, tolerance);
        near(sum.walls, speed * 1.4, tolerance);
        let rest = world.energy().kinetic + world.energy().rotational;
        near(sum.friction, speed * 1.4 - rest, tolerance);
        near(sum.solver, 0.0, tolerance);
    }
}

#[test]
fn a_collision_of_two_takes_what_restitution_says_and_no_momentum() {
    for response in BOTH {
        // Above the floor, without gravity: m = 1 and 3, head-on with 2 m/s.
        let pair = [([0.0, 5.0, 0.0], [2.0, 0.3, 0.0]), ([1.0, 5.0, 0.0], [0.0, 0.3, 0.0])];
        let mut world = world(response, material(0.5, 0.0), &pair);
        world.set_gravity(Vec3::zero()).unwrap();
        let second = world.marbles.id(1).unwrap();
        world.marbles.set_mass(second, Mass::Kilograms(3.0)).unwrap();
        let sum = run(&mut world, 1.0, 1.0 / 60.0);
        near(sum.restitution, 0.5 * 0.75 * 4.0 * (1.0 - 0.25), 1e-12);
        near(sum.friction, 0.0, 1e-12);
        near(sum.solver, 0.0, 1e-12);
        near(sum.momentum, 0.0, 1e-12);
        assert_eq!(sum.collisions, 1);
    }
}

/// Displacement moves both by half whatever they weigh.
#[test]
fn what_the_labs_method_does_to_momentum_is_seen() {
    let pair = [([0.0, 5.0, 0.0], [0.0; 3]), ([0.2, 5.0, 0.0], [-4.0, 0.0, 0.0])];
    let mut world = world(Response::Displacement, material(0.5, 0.0), &pair);
    world.set_gravity(Vec3::zero()).unwrap();
    let second = world.marbles.id(1).unwrap();
    world.marbles.set_mass(second, Mass::Kilograms(3.0)).unwrap();
    world.step(0.01).unwrap();
    let account = world.energy_audit().unwrap();
    near(account.max_penetration, 0.04, 1e-12);
    // Each gets 0.02 m in 0.01 s.
    near(account.momentum, (3.0 - 1.0) * 2.0, 1e-9);
    near(account.solver, 0.5 * 3.0 * 4.0 * 4.0 - 0.5 * (1.0 + 3.0) * 2.0 * 2.0, 1e-9);
    assert_eq!((account.friction, account.restitution), (0.0, 0.0));
    assert_eq!(account.collisions, 1);
    // A wall may give momentum: it is no error.
    world.marbles.set_position(second, Point3::new(5.0, 0.1, 0.0)).unwrap();
    world.marbles.set_velocity(second, Vec3::new(0.0, -2.0, 0.0)).unwrap();
    world.step(0.01).unwrap();
    near(world.energy_audit().unwrap().momentum, 0.0, 1e-9);
}

/// A lift at 1 m/s: the weight times its way, and what sets it in motion in the first step.
#[test]
fn the_labs_method_counts_what_a_lift_does() {
    let mut lift =
        world(Response::Displacement, material(0.0, 0.0), &[([0.0, 0.1, 0.0], [0.0; 3])]);
    moved_floor(&mut lift, Vec3::unit_y());
    let floor = lift.walls.id(0).unwrap();
    let (dt, steps) = (1.0 / 60.0, 60);
    let mut walls = 0.0;
    for step in 1..=steps {
        lift.walls.set(floor, Plane::new(Vec3::unit_y(), f64::from(step) * dt).unwrap()).unwrap();
        walls += run(&mut lift, dt, dt).walls;
    }
    near(walls, 9.81 * f64::from(steps) * dt + 1.0, 1e-9);
}

#[test]
fn what_rests_takes_nothing() {
    for response in BOTH {
        let rest = [([0.0, 0.1, 0.0], [0.0; 3]), ([0.0, 0.3, 0.0], [0.0; 3])];
        let mut world = world(response, material(0.5, 0.5), &rest);
        let sum = run(&mut world, 1.0, 1.0 / 60.0);
        for nothing in [sum.friction, sum.restitution, sum.resistance, sum.solver, sum.momentum] {
            near(nothing, 0.0, 1e-6);
        }
        assert_eq!(sum.collisions, 0);
    }
}

#[test]
fn drag_and_pushes_are_forces() {
    for response in BOTH {
        let mut world = world(response, material(0.5, 0.5), &[([0.0, 9.0, 0.0], [3.0, 0.0, 0.0])]);
        world.set_model(Model { integrator: Integrator::Rk4, ..model(response) }).unwrap();
        let medium = taw::motion::Medium { velocity: Vec3::zero(), linear: 0.5, quadratic: 0.0 };
        world.set_forces(vec![ForceField::Drag(medium)]).unwrap();
        world.set_gravity(Vec3::zero()).unwrap();
        let sum = run(&mut world, 1.0, 1.0 / 240.0);
        let left = 0.5 * 9.0 * (-1.0_f64).exp();
        near(sum.forces, left - 4.5, 1e-4);
        near(sum.solver, 0.0, 1e-9);
    }
}

#[test]
fn off_it_says_nothing_and_on_it_changes_nothing() {
    for response in [
        Response::Displacement,
        Response::Impulse,
        Response::Penalty(ContactLaw::HertzMindlin),
        Response::Penalty(ContactLaw::SpringDashpot),
        Response::EventDriven,
        Response::SoftStep,
    ] {
        let marbles: Vec<_> = (0..20)
            .map(f64::from)
            .map(|i| {
                ([0.15 * (i % 4.0), 0.1 + 0.17 * i, 0.03 * (i % 3.0)], [0.5 - 0.1 * i, 0.0, 0.2])
            })
            .collect();
        let resists = Material { rolling_resistance: 0.02, ..material(0.4, 0.4) };
        let mut on = world(response, resists, &marbles);
        let mut off = on.clone();
        off.enable_energy_audit(false);
        run(&mut on, 1.0, 1.0 / 120.0);
        for _ in 0..120 {
            off.step(1.0 / 120.0).unwrap();
        }
        assert!(on == off, "{response:?}");
        assert_eq!(off.energy_audit(), None);
    }
}

fn moved_floor(world: &mut World<f64>, velocity: Vec3<f64>) {
    let floor = world.walls.id(0).unwrap();
    let motion = taw::motion::WallMotion {
        velocity,
        angular_velocity: Vec3::zero(),
        pivot: Point3::origin(),
    };
    world.walls.set_motion(floor, Some(motion)).unwrap();
}

/// A thousandth of a radius is pressed in: hence the tolerances.
#[test]
fn soft_contacts_count_what_walls_and_forces_do() {
    let material = material(0.0, 0.3);
    let one = [([0.0, 0.1, 0.0], [0.0; 3])];
    // A belt brings the ball to 2/7 of its speed.
    let mut belt = world(Response::SoftStep, material, &one);
    moved_floor(&mut belt, Vec3::new(1.4, 0.0, 0.0));
    let sum = run(&mut belt, 1.0, 1.0 / 240.0);
    near(sum.walls, 0.4 * 1.4, 1e-3);
    near(sum.momentum, 0.0, 1e-5);
    // A lift bears a light ball and a heavy one on it, and goes up by a metre from their speed on.
    let tower = [([0.0, 0.1, 0.0], [0.0, 1.0, 0.0]), ([0.0, 0.3, 0.0], [0.0, 1.0, 0.0])];
    let mut lift = world(Response::SoftStep, material, &tower);
    let heavy = lift.marbles.id(1).unwrap();
    lift.marbles.set_mass(heavy, Mass::Kilograms(50.0)).unwrap();
    moved_floor(&mut lift, Vec3::unit_y());
    let floor = lift.walls.id(0).unwrap();
    let (mut walls, mut solver) = (0.0, 0.0);
    for step in 1..=60 {
        lift.walls.set(floor, Plane::new(Vec3::unit_y(), f64::from(step) / 60.0).unwrap()).unwrap();
        let sum = run(&mut lift, 1.0 / 60.0, 1.0 / 60.0);
        near(sum.momentum, 0.0, 1e-3);
        // In the first two they meet.
        if step > 2 {
            (walls, solver) = (walls + sum.walls, solver + sum.solver);
        }
    }
    near(walls, 51.0 * 9.81 * 58.0 / 60.0, 0.02);
    near(solver, 0.0, 0.5);
    // The same on a floor at rest: the wall behind the light ball bears the heavy one for it.
    let mut still = world(Response::SoftStep, material, &tower);
    still.marbles.set_mass(heavy, Mass::Kilograms(50.0)).unwrap();
    let sum = run(&mut still, 1.0, 1.0 / 60.0);
    near(sum.walls, 0.0, 0.0);
    near(sum.momentum, 0.0, 1e-3);
    // Weight scaled is no force, drag is one.
    let mut flight = world(Response::SoftStep, material, &[([0.0, 9.0, 0.0], [3.0, 0.0, 0.0])]);
    let ball = flight.marbles.id(0).unwrap();
    flight.marbles.set_gravity_scale(ball, 0.5).unwrap();
    let sum = run(&mut flight, 0.5, 1.0 / 240.0);
    near(sum.forces, 0.0, 1e-3);
    near(sum.solver, 0.0, 1e-3);
    flight.set_gravity(Vec3::zero()).unwrap();
    let medium = taw::motion::Medium { velocity: Vec3::zero(), linear: 0.5, quadratic: 0.0 };
    flight.set_forces(vec![ForceField::Drag(medium)]).unwrap();
    let before = flight.energy().total();
    let sum = run(&mut flight, 1.0, 1.0 / 240.0);
    near(sum.forces, before * ((-1.0_f64).exp() - 1.0), 1e-2 * before);
    near(sum.solver, 0.0, 1e-4);
    near(sum.momentum, 0.0, 1e-5);
}
