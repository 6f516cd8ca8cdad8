//! What users of other engines run into, measured in Rapier 0.36: with its defaults and
//! with what its users may turn off.
//!
//! `cargo run --release` in this folder. f32, steps of 1/60 s unless a row says otherwise.

use rapier3d::prelude::*;

/// How a world is set up.
#[derive(Clone, Copy)]
struct Setup {
    name: &'static str,
    coulomb: bool,
    ccd: bool,
    /// The length that is usual in the scene, in metres; Rapier's thresholds scale by it.
    unit: f32,
    iterations: usize,
}

const DEFAULT: Setup =
    Setup { name: "defaults", coulomb: false, ccd: false, unit: 1.0, iterations: 4 };

fn world(setup: Setup, gravity: f32, dt: f32) -> PhysicsWorld {
    let mut world = PhysicsWorld { gravity: Vector::new(0.0, -gravity, 0.0), ..Default::default() };
    let parameters = &mut world.integration_parameters;
    parameters.dt = dt;
    parameters.length_unit = setup.unit;
    parameters.num_solver_iterations = setup.iterations;
    if setup.coulomb {
        parameters.friction_model = FrictionModel::Coulomb;
    }
    world
}

struct Ball {
    at: [f32; 3],
    velocity: [f32; 3],
    radius: f32,
    mass: f32,
    e: f32,
    mu: f32,
}

impl Default for Ball {
    fn default() -> Self {
        Self { at: [0.0; 3], velocity: [0.0; 3], radius: 0.5, mass: 1.0, e: 0.0, mu: 0.0 }
    }
}

fn insert(world: &mut PhysicsWorld, setup: Setup, ball: Ball) -> RigidBodyHandle {
    let body = RigidBodyBuilder::dynamic()
        .translation(ball.at.into())
        .linvel(ball.velocity.into())
        .can_sleep(false)
        .ccd_enabled(setup.ccd);
    let collider = ColliderBuilder::ball(ball.radius)
        .mass(ball.mass)
        .restitution(ball.e)
        .friction(ball.mu)
        .restitution_combine_rule(CoefficientCombineRule::Max)
        .friction_combine_rule(CoefficientCombineRule::Max);
    world.insert(body, collider).0
}

/// A floor whose slope goes down toward +x.
fn floor(world: &mut PhysicsWorld, degrees: f32) {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let plane =
        ColliderBuilder::new(SharedShape::halfspace(Vector::new(sin, cos, 0.0).normalize()))
            .friction(0.0)
            .restitution(0.0);
    world.insert(RigidBodyBuilder::fixed(), plane);
}

fn length(v: Vector) -> f64 {
    f64::from(v.length())
}

/// Radius 8 mm on 10 degrees, until 5 m/s: relative error of the speed.
fn no_spin_cap(setup: Setup) -> f64 {
    let mut world = world(setup, 9.81, 1.0 / 60.0);
    floor(&mut world, 10.0);
    let (sin, cos) = 10_f32.to_radians().sin_cos();
    let radius = 8e-3;
    let id = insert(
        &mut world,
        setup,
        Ball { at: [radius * sin, radius * cos, 0.0], radius, mu: 0.5, ..Default::default() },
    );
    let pull = 5.0 / 7.0 * 9.81 * f64::from(sin);
    let steps = (5.0 / pull * 60.0).round();
    for _ in 0..steps as u32 {
        world.step();
    }
    length(world.bodies[id].linvel()) / (pull * steps / 60.0) - 1.0
}

/// Drops of 1 mm, 1 cm, 0.1 m and 1 m with e = 0.8, in steps of 1/60 s: the largest error
/// of the first rebound over the height.
fn restitution(setup: Setup) -> f64 {
    let mut worst: f64 = 0.0;
    for height in [1e-3, 1e-2, 0.1, 1.0] {
        let mut world = world(setup, 9.81, 1.0 / 60.0);
        floor(&mut world, 0.0);
        let id = insert(
            &mut world,
            setup,
            Ball { at: [0.0, 0.05 + height, 0.0], radius: 0.05, e: 0.8, ..Default::default() },
        );
        let (mut fell, mut apex) = (false, 0.0_f32);
        for _ in 0..180 {
            world.step();
            let body = &world.bodies[id];
            let v = body.linvel().y;
            if v > 0.0 {
                fell = true;
            }
            if fell {
                apex = apex.max(body.translation().y - 0.05);
                if v < 0.0 && apex > 0.0 {
                    break;
                }
            }
        }
        worst = worst.max(f64::from((apex / height - 0.64).abs()));
    }
    worst
}

/// Slides, then rolls, at 24 angles: the largest turn of its heading, in rad.
fn straight(setup: Setup) -> f64 {
    let mut worst: f64 = 0.0;
    for i in 0..24_u8 {
        let mut world = world(setup, 9.81, 1.0 / 60.0);
        floor(&mut world, 0.0);
        let angle = f32::from(i) * 0.2617 + 0.01;
        let (sin, cos) = angle.sin_cos();
        let id = insert(
            &mut world,
            setup,
            Ball {
                at: [0.0, 0.5, 0.0],
                velocity: [5.0 * cos, 0.0, 5.0 * sin],
                mu: 0.3,
                ..Default::default()
            },
        );
        for _ in 0..120 {
            world.step();
        }
        let v = world.bodies[id].linvel();
        worst =
            worst.max(f64::from((v.x * sin - v.z * cos).abs() / (v.x * v.x + v.z * v.z).sqrt()));
    }
    worst
}

/// Two balls at 300 m/s head on, e = 1: error of the velocity over the speed, and of the
/// place a second later over the way.
fn fast(setup: Setup, radius: f32) -> f64 {
    let mut world = world(setup, 0.0, 1.0 / 60.0);
    let mass = if radius < 0.5 { 1e-3 } else { 1.0 };
    let ball = |x: f32, v: f32, radius, mass| Ball {
        at: [x, 0.0, 0.0],
        velocity: [v, 0.0, 0.0],
        radius,
        mass,
        e: 1.0,
        ..Default::default()
    };
    let first = insert(&mut world, setup, ball(-10.0, 300.0, 0.5, 1.0));
    let second = insert(&mut world, setup, ball(10.0, -300.0, radius, mass));
    for _ in 0..60 {
        world.step();
    }
    let (meet, mass) = ((19.5 - f64::from(radius)) / 600.0, f64::from(mass));
    let common = 300.0 * (1.0 - mass) / (1.0 + mass);
    [(first, -10.0, 300.0), (second, 10.0, -300.0)].into_iter().fold(
        0.0,
        |worst: f64, (id, start, v)| {
            let after = 2.0 * common - v;
            let place = start + v * meet + after * (1.0 - meet);
            let body = &world.bodies[id];
            worst
                .max((f64::from(body.linvel().x) - after).abs() / 300.0)
                .max((f64::from(body.translation().x) - place).abs() / 300.0)
        },
    )
}

/// A scene of a slope and two balls at scales of 1e-3, 1 and 1e3 (times by the root): the
/// largest deviation of a place, over the scale.
fn scale_free(setup: Setup, follow: bool) -> f64 {
    let run = |scale: f32| {
        let setup = Setup { unit: if follow { scale } else { 1.0 }, ..setup };
        let mut world = world(setup, 9.81, scale.sqrt() / 64.0);
        floor(&mut world, 10.0);
        let (sin, cos) = 10_f32.to_radians().sin_cos();
        let ids = [(-3.0, 0.0), (1.0, 0.7)].map(|(along, lift): (f32, f32)| {
            let at =
                [along * cos + (0.5 + lift) * sin, -along * sin + (0.5 + lift) * cos, 0.1 * lift];
            insert(
                &mut world,
                setup,
                Ball {
                    at: at.map(|x| x * scale),
                    radius: 0.5 * scale,
                    e: 0.4,
                    mu: 0.3,
                    ..Default::default()
                },
            )
        });
        for _ in 0..128 {
            world.step();
        }
        ids.map(|id| world.bodies[id].translation() / scale)
    };
    let exact = run(1.0);
    let mut worst: f64 = 0.0;
    for scale in [1e-3, 1e3] {
        for (a, b) in exact.iter().zip(run(scale)) {
            worst = worst.max(length(*a - b));
        }
    }
    worst
}

fn main() {
    let fine = Setup { name: "32 iterations", iterations: 32, ..DEFAULT };
    let coulomb = Setup { name: "Coulomb friction", coulomb: true, ..DEFAULT };
    let ccd = Setup { name: "ccd on", ccd: true, ..DEFAULT };
    println!("| scene | Rapier 0.36.1 | error |\n|---|---|---|");
    let row = |scene: &str, setup: Setup, error: f64| {
        println!("| {scene} | {} | {error:.1e} |", setup.name);
    };
    for setup in [DEFAULT, fine, coulomb] {
        row("no spin cap: 8 mm to 5 m/s, relative", setup, no_spin_cap(setup));
    }
    let small = Setup { name: "length unit 0.05", unit: 0.05, ..DEFAULT };
    for setup in [DEFAULT, fine, small] {
        row("rebound of 1 mm to 1 m, e 0.8, over the height", setup, restitution(setup));
    }
    for setup in [DEFAULT, fine, coulomb] {
        row("straight: turn of the heading, rad", setup, straight(setup));
    }
    for setup in [DEFAULT, ccd] {
        row("300 m/s head on", setup, fast(setup, 0.5));
        row("300 m/s against a tenth", setup, fast(setup, 0.05));
    }
    row("scale 1e-3 to 1e3", DEFAULT, scale_free(DEFAULT, false));
    let unit = Setup { name: "length unit follows", ..DEFAULT };
    row("scale 1e-3 to 1e3", unit, scale_free(unit, true));
}
