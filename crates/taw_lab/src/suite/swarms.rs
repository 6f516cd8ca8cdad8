//! Balls of a swarm by its default model, the full tier, and marbles by [`Response::SoftStep`], the
//! same solver: two substeps of 1/60 s.

use taw::broad::Grid;
use taw::prelude::*;
use taw::swarm::{Ball, BallId, SwarmModel};
use taw::world::Energy;

use super::{CostClass, SuiteCase};
use crate::scene::G;
use crate::scene::Stopwatch;

const DT: f64 = 1.0 / 60.0;

/// Owner of the bodies of a case.
#[derive(Clone, Copy, PartialEq)]
enum Owner {
    Swarm,
    Marbles,
}

/// Handle of a body.
#[derive(Clone, Copy)]
enum Body {
    Ball(BallId),
    Marble(MarbleId),
}

/// A world of this friction and restitution where nothing sleeps, above a floor if there is
/// gravity.
fn world(owner: Owner, friction: f32, restitution: f32, gravity: Vec3<f32>) -> World<f32> {
    let mut world = World::default();
    if owner == Owner::Marbles {
        let (response, rotation) = (Response::SoftStep, Rotation::Dynamic);
        let model = Model { response, rotation, substeps: 2, ..Model::default() };
        world.set_model(model).expect("a model");
    }
    let material = Material { friction, restitution, ..Material::default() };
    let model = SwarmModel { material, threads: 1, sleeps: false, ..SwarmModel::default() };
    world.swarm.set_model(model).expect("a model");
    world.set_gravity(gravity).expect("a finite one");
    if gravity.y < 0.0 {
        plane(&mut world, Vec3::unit_y(), 0.0);
    }
    world
}

fn down() -> Vec3<f32> {
    Vec3::new(0.0, -G as f32, 0.0)
}

fn plane(world: &mut World<f32>, inward: Vec3<f32>, offset: f32) {
    world.walls.insert(Plane::new(inward, offset).expect("a unit vector")).expect("a wall");
}

fn insert(world: &mut World<f32>, balls: &[Ball]) -> Vec<Body> {
    if world.model().response != Response::SoftStep {
        return world.swarm.insert(balls).expect("balls").into_iter().map(Body::Ball).collect();
    }
    let material = Some(world.swarm.model().material);
    let marbles = balls.iter().map(|ball| {
        let &Ball { position, radius, velocity, mass } = ball;
        let marble = Marble { velocity, mass, material, ..Marble::new(position, radius) };
        Body::Marble(world.marbles.insert(marble).expect("a marble"))
    });
    marbles.collect()
}

/// A ball of a metre, moving along x.
fn ball(height: f32, mass: f32, speed: f32) -> Ball {
    let velocity = Vec3::new(speed, 0.0, 0.0);
    let mass = Mass::Kilograms(mass);
    Ball { velocity, mass, ..Ball::new(Point3::new(0.0, height, 0.0), 0.5) }
}

/// Height and velocity.
fn state(world: &World<f32>, body: Body) -> (f64, Vec3<f32>) {
    match body {
        Body::Ball(id) => {
            let row = world.swarm.row(id).expect("it is there");
            let [u, v, w, _] = world.swarm.velocities()[row];
            (f64::from(world.swarm.balls()[row][1]), Vec3::new(u, v, w))
        }
        Body::Marble(id) => {
            let marble = world.marbles.get(id).expect("it is there");
            (f64::from(marble.position.y), marble.velocity)
        }
    }
}

/// Of motion and spin, in joules.
fn kinetic(world: &World<f32>) -> f64 {
    if !world.marbles.is_empty() {
        let Energy { potential, .. } = world.energy();
        return world.energy().total() - potential;
    }
    let square = |v: &[f32; 4]| v[..3].iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
    let rows = world.swarm.velocities().iter().zip(world.swarm.spin_velocities());
    rows.map(|(v, rim)| (0.5 * square(v) + 0.2 * square(rim)) / f64::from(v[3].abs())).sum()
}

/// The gas of `gas/energy`: how far its energy is off at the end, or was above the begin's.
fn gas(stopwatch: &mut Stopwatch, owner: Owner) -> f64 {
    let mut world = world(owner, 0.0, 1.0, Vec3::new(0.0, 0.0, 0.0));
    for axis in [Vec3::unit_x(), Vec3::unit_y(), Vec3::unit_z()] {
        for inward in [axis, -axis] {
            plane(&mut world, inward, -3.0);
        }
    }
    // The fractional parts of multiples of the golden ratio spread evenly.
    let speed = |n: u16| ((f64::from(n) * 0.618_033_988_75).fract() - 0.5) as f32 * 4.0;
    let balls = (0..216_u16).map(|i| {
        let at = |cell: u16| f32::from(cell) - 2.5;
        let velocity = Vec3::new(speed(3 * i), speed(3 * i + 1), speed(3 * i + 2));
        let place = Point3::new(at(i % 6), at(i / 6 % 6), at(i / 36));
        Ball { velocity, ..Ball::new(place, 0.3) }
    });
    insert(&mut world, &balls.collect::<Vec<_>>());
    let (begin, mut worst) = (kinetic(&world), 0.0_f64);
    for _ in 0..600 {
        stopwatch.step(&mut world, DT);
        worst = worst.max(kinetic(&world) / begin - 1.0);
    }
    worst.max((kinetic(&world) / begin - 1.0).abs())
}

fn slip_to_roll(stopwatch: &mut Stopwatch, owner: Owner) -> f64 {
    let mut world = world(owner, 0.3, 0.0, down());
    let id = insert(&mut world, &[ball(0.5, 1.0, 7.0)])[0];
    stopwatch.run(&mut world, DT, 2.0);
    (f64::from(state(&world, id).1.x) / 5.0 - 1.0).abs()
}

fn incline(stopwatch: &mut Stopwatch, owner: Owner) -> f64 {
    let angle = 10_f64.to_radians();
    let pull = Vec3::new((G * angle.sin()) as f32, (-G * angle.cos()) as f32, 0.0);
    let mut world = world(owner, 0.5, 0.0, pull);
    let id = insert(&mut world, &[ball(0.5, 1.0, 0.0)])[0];
    stopwatch.run(&mut world, DT, 2.0);
    let exact = G * angle.sin() * 5.0 / 7.0 * 2.0;
    (f64::from(state(&world, id).1.x) / exact - 1.0).abs()
}

/// Drops from a metre: the worst error of the first rebound's height, over the drop's.
fn bounce(stopwatch: &mut Stopwatch, owner: Owner) -> f64 {
    let mut worst = 0.0_f64;
    for e in [0.3_f32, 0.5, 0.8, 1.0] {
        let mut world = world(owner, 0.0, e, down());
        let id = insert(&mut world, &[ball(1.5, 1.0, 0.0)])[0];
        let (mut rises, mut apex) = (false, 0.0_f64);
        for _ in 0..120 {
            stopwatch.step(&mut world, DT);
            let (height, velocity) = state(&world, id);
            if rises && velocity.y < 0.0 {
                break;
            }
            rises |= velocity.y > 0.0;
            apex = if rises { apex.max(height - 0.5) } else { 0.0 };
        }
        worst = worst.max((apex - f64::from(e * e)).abs());
    }
    worst
}

/// A heap of 600 in a box, poured and left alone for 10 s: its fastest ball that lies on others. (One
/// that lies on the floor alone rolls on for ever, as it should without rolling resistance; how fast
/// is chance.)
fn heap(stopwatch: &mut Stopwatch, owner: Owner) -> f64 {
    let mut world = world(owner, 0.3, 0.2, down());
    for inward in [Vec3::unit_x(), -Vec3::unit_x(), Vec3::unit_z(), -Vec3::unit_z()] {
        plane(&mut world, inward, -5.25);
    }
    let balls = (0..600_u16).map(|i| {
        let random = |n: u16| (f64::from(i * 3 + n) * 0.618_033_988_75).fract() as f32;
        let at = |cell: u16, n: u16| f32::from(cell) * 1.05 - 4.725 + (random(n) - 0.5) * 0.04;
        let place = Point3::new(at(i % 10, 1), 0.5 + f32::from(i / 100) * 1.05, at(i / 10 % 10, 2));
        Ball::new(place, 0.3 + 0.2 * random(0))
    });
    let balls: Vec<_> = balls.collect();
    let bodies = insert(&mut world, &balls);
    stopwatch.run(&mut world, DT, 10.0);
    let on_others = bodies.into_iter().zip(&balls).filter_map(|(body, ball)| {
        let (height, Vec3 { x, y, z }) = state(&world, body);
        (height > f64::from(ball.radius) + 0.01).then(|| f64::from(x.hypot(y).hypot(z)))
    });
    on_others.fold(0.0, f64::max)
}

/// The deepest that a ball a thousand times as heavy is in a light one within 5 s, in radii.
fn heavy(stopwatch: &mut Stopwatch, owner: Owner) -> f64 {
    let mut world = world(owner, 0.3, 0.2, down());
    let ids = insert(&mut world, &[ball(0.5, 1.0, 0.0), ball(1.5, 1000.0, 0.0)]);
    let mut worst = 0.0_f64;
    for _ in 0..300 {
        stopwatch.step(&mut world, DT);
        let [low, high] = [0, 1].map(|i| state(&world, ids[i]).0);
        worst = worst.max((low + 1.0 - high) / 0.5).max((0.5 - low) / 0.5);
    }
    worst
}

/// The hopper of the race after its 240 steps: the deepest overlap in metres.
fn hopper(stopwatch: &mut Stopwatch, owner: Owner) -> f64 {
    let mut world = world(owner, 0.3, 0.2, down());
    for inward in [Vec3::unit_x(), -Vec3::unit_x(), Vec3::unit_z(), -Vec3::unit_z()] {
        plane(&mut world, inward, -16.0);
    }
    let turn = |axis: Vec3<f32>, angle: f32| {
        let (sin, cos) = (0.5 * angle).sin_cos();
        taw::math::Quat::from_sv(cos, axis * sin)
    };
    for i in 0..4_u8 {
        let about = turn(Vec3::unit_y(), f32::from(i) * std::f32::consts::FRAC_PI_2);
        let tilt = turn(Vec3::unit_z(), 0.8);
        let center = about * (Vec3::new(1.5, 6.0, 0.0) + tilt * Vec3::new(8.0, 0.0, 0.0));
        let center = Point3::new(center.x, center.y, center.z);
        let half = Vec3::new(8.0, 0.5, 14.0);
        let board = taw::shape::Obb::new(center, about * tilt, half).expect("a box");
        let board = WallShape::Solid(taw::shape::Shape::Obb(board));
        world.walls.insert(board).expect("a wall");
    }
    let mut seed = 3_000_u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (seed >> 40) as f32 / (1 << 24) as f32
    };
    let at = |cell: u16| (f32::from(cell) - 5.5) * 1.05;
    let height = |i: u16| 16.5 + f32::from(i / 144) * 1.05;
    let mut balls: Vec<_> = (0..3_000_u16)
        .map(|i| {
            let place = Point3::new(at(i % 12), height(i), at(i / 12 % 12));
            Ball { mass: Mass::Density(1.0), ..Ball::new(place, 0.3 + 0.2 * random()) }
        })
        .collect();
    for ball in &mut balls {
        ball.position.x += (random() - 0.5) * 0.042;
        ball.position.z += (random() - 0.5) * 0.042;
    }
    insert(&mut world, &balls);
    stopwatch.run(&mut world, DT, 4.0);
    deepest(&world)
}

fn deepest(world: &World<f32>) -> f64 {
    let place = |ball: &[f32; 4]| Point3::new(ball[0], ball[1], ball[2]);
    let at: Vec<Point3<f32>> = world.swarm.balls().iter().map(place).collect();
    let radius: Vec<f32> = world.swarm.balls().iter().map(|ball| ball[3]).collect();
    let (mut grid, mut deepest) = (Grid::default(), 0.0_f32);
    grid.rebuild(&at, &radius, 0.0);
    grid.pairs(&at, |a, b| {
        let (a, b) = (a as usize, b as usize);
        let apart = at[a] - at[b];
        let apart = apart.x.hypot(apart.y).hypot(apart.z);
        deepest = deepest.max(radius[a] + radius[b] - apart);
    });
    f64::from(deepest)
}

const MODEL: &str = "swarm, full";
const SOFT_STEP: &str = "soft step, 2 substeps";
const NONE: &str = "none measured";

/// See the module.
pub static ROWS: &[SuiteCase] = &[
    SuiteCase {
        name: "swarm/gas",
        setup: "216 elastic balls of 0.3 m in a box of 6 m for 10 s at 1/60 s",
        metric: "relative error of the energy, or the most that it rose",
        model: MODEL,
        target: 1e-2,
        best: "0.74 Box3D, 0.79 Rapier lost",
        source: "conservation of energy; references 4.22",
        effort: CostClass::Quick,
        measure: |stopwatch| gas(stopwatch, Owner::Swarm),
    },
    SuiteCase {
        name: "swarm/slip-to-roll",
        setup: "a ball slides at 7 m/s on a floor of friction 0.3: rolls with 5/7 of it",
        metric: "relative error of the speed",
        model: MODEL,
        target: 2e-3,
        best: NONE,
        source: "Coulomb friction on a solid ball: 5/7, whatever the friction",
        effort: CostClass::Quick,
        measure: |stopwatch| slip_to_roll(stopwatch, Owner::Swarm),
    },
    SuiteCase {
        name: "swarm/incline",
        setup: "a ball rolls down 10 degrees for 2 s: with 5/7 of the pull",
        metric: "relative error of the speed",
        model: MODEL,
        target: 2e-3,
        best: NONE,
        source: "rolling without slip of a solid ball",
        effort: CostClass::Quick,
        measure: |stopwatch| incline(stopwatch, Owner::Swarm),
    },
    SuiteCase {
        name: "swarm/bounce",
        setup: "drops from 1 m at restitution 0.3, 0.5, 0.8 and 1: comes up to its square",
        metric: "worst error of the height over the drop's",
        model: MODEL,
        target: 5e-2,
        best: NONE,
        source: "Newton's restitution; a substep is 3.7 cm at 4.4 m/s",
        effort: CostClass::Quick,
        measure: |stopwatch| bounce(stopwatch, Owner::Swarm),
    },
    SuiteCase {
        name: "swarm/heap",
        setup: "600 balls of 0.3 to 0.5 m poured into a box, after 10 s: all that are on others lie",
        metric: "speed of the fastest of these in m/s",
        model: MODEL,
        target: 1e-2,
        best: NONE,
        source: "friction holds a heap",
        effort: CostClass::Quick,
        measure: |stopwatch| heap(stopwatch, Owner::Swarm),
    },
    SuiteCase {
        name: "swarm/heavy-on-light",
        setup: "a ball 1,000 times as heavy on one of 0.5 m, within 5 s: sinks in by nothing",
        metric: "deepest overlap in radii",
        model: MODEL,
        target: 1e-2,
        best: NONE,
        source: "rigid bodies",
        effort: CostClass::Quick,
        measure: |stopwatch| heavy(stopwatch, Owner::Swarm),
    },
    SuiteCase {
        name: "swarm/hopper",
        setup: "3,000 balls of 0.3 to 0.5 m fall 10 m into a hopper, after 4 s",
        metric: "deepest overlap in metres",
        model: MODEL,
        target: 4.4e-2,
        best: "0.044 Rapier",
        source: "rigid bodies; the race in peers/",
        effort: CostClass::Quick,
        measure: |stopwatch| hopper(stopwatch, Owner::Swarm),
    },
    SuiteCase {
        name: "soft-step/gas",
        setup: "216 elastic balls of 0.3 m in a box of 6 m for 10 s at 1/60 s",
        metric: "relative error of the energy, or the most that it rose",
        model: SOFT_STEP,
        target: 1e-2,
        best: "0.74 Box3D, 0.79 Rapier lost",
        source: "conservation of energy; references 4.22",
        effort: CostClass::Quick,
        measure: |stopwatch| gas(stopwatch, Owner::Marbles),
    },
    SuiteCase {
        name: "soft-step/slip-to-roll",
        setup: "a ball slides at 7 m/s on a floor of friction 0.3: rolls with 5/7 of it",
        metric: "relative error of the speed",
        model: SOFT_STEP,
        target: 2e-3,
        best: NONE,
        source: "Coulomb friction on a solid ball: 5/7, whatever the friction",
        effort: CostClass::Quick,
        measure: |stopwatch| slip_to_roll(stopwatch, Owner::Marbles),
    },
    SuiteCase {
        name: "soft-step/incline",
        setup: "a ball rolls down 10 degrees for 2 s: with 5/7 of the pull",
        metric: "relative error of the speed",
        model: SOFT_STEP,
        target: 2e-3,
        best: NONE,
        source: "rolling without slip of a solid ball",
        effort: CostClass::Quick,
        measure: |stopwatch| incline(stopwatch, Owner::Marbles),
    },
    SuiteCase {
        name: "soft-step/bounce",
        setup: "drops from 1 m at restitution 0.3, 0.5, 0.8 and 1: comes up to its square",
        metric: "worst error of the height over the drop's",
        model: SOFT_STEP,
        target: 2e-2,
        best: NONE,
        source: "Newton's restitution; a substep is 3.7 cm at 4.4 m/s",
        effort: CostClass::Quick,
        measure: |stopwatch| bounce(stopwatch, Owner::Marbles),
    },
    SuiteCase {
        name: "soft-step/heap",
        setup: "600 balls of 0.3 to 0.5 m poured into a box, after 10 s: all that are on others lie",
        metric: "speed of the fastest of these in m/s",
        model: SOFT_STEP,
        target: 1e-2,
        best: NONE,
        source: "friction holds a heap",
        effort: CostClass::Quick,
        measure: |stopwatch| heap(stopwatch, Owner::Marbles),
    },
    SuiteCase {
        name: "soft-step/heavy-on-light",
        setup: "a ball 1,000 times as heavy on one of 0.5 m, within 5 s: sinks in by nothing",
        metric: "deepest overlap in radii",
        model: SOFT_STEP,
        target: 1e-2,
        best: NONE,
        source: "rigid bodies",
        effort: CostClass::Quick,
        measure: |stopwatch| heavy(stopwatch, Owner::Marbles),
    },
    SuiteCase {
        name: "soft-step/hopper",
        setup: "3,000 balls of 0.3 to 0.5 m fall 10 m into a hopper, after 4 s",
        metric: "deepest overlap in metres",
        model: SOFT_STEP,
        target: 4.4e-2,
        best: "0.044 Rapier",
        source: "rigid bodies; the race in peers/",
        effort: CostClass::Quick,
        measure: |stopwatch| hopper(stopwatch, Owner::Marbles),
    },
];
