//! A paddle that sweeps through balls in a closed box, under `Response::EventDriven`: with room
//! for them and without.

use taw::motion::WallMotion;
use taw::prelude::*;
use taw::shape::Obb;

const DT: f64 = 1.0 / 64.0;
const RADIUS: f64 = 0.1;
const RESTITUTION: f64 = 0.4;

#[derive(Clone, Copy, Debug)]
struct Sweep {
    count: u32,
    amplitude: f64,
    rate: f64,
    iterations: u32,
    seed: u64,
}

fn block<S: Scalar>(center: [f64; 3], half: [f64; 3]) -> Obb<S> {
    let [center, half] = [center, half].map(|v| v.map(S::from_f64));
    let upright = taw::math::Quat::new(S::one(), S::zero(), S::zero(), S::zero());
    Obb::new(Point3::from(center), upright, Vec3::from(half)).unwrap()
}

fn paddle_at(sweep: Sweep, time: f64) -> f64 {
    sweep.amplitude * (sweep.rate * std::f64::consts::PI * time).sin()
}

fn pit<S: Scalar>(sweep: Sweep) -> (World<S>, WallId) {
    let mut world = World::<S>::default();
    let model = Model {
        response: Response::EventDriven,
        iterations: sweep.iterations,
        rotation: Rotation::Dynamic,
        ..Model::default()
    };
    world.set_model(model).unwrap();
    for height in [-0.1, 6.1] {
        world.walls.insert(block([0.0, height, 0.0], [1.2, 0.1, 1.2])).unwrap();
    }
    for side in [-1.1, 1.1] {
        world.walls.insert(block([side, 3.0, 0.0], [0.1, 3.0, 1.2])).unwrap();
        world.walls.insert(block([0.0, 3.0, side], [1.2, 3.0, 0.1])).unwrap();
    }
    let paddle = world.walls.insert(block([0.0, 0.52, 0.0], [0.05, 0.5, 0.95])).unwrap();
    let material = Material {
        restitution: S::from_f64(RESTITUTION),
        friction: S::from_f64(0.4),
        ..Material::default()
    };
    let mut random = fastrand::Rng::with_seed(sweep.seed);
    for i in 0..sweep.count {
        let [x, y, z] = [i % 8, i / 64, i / 8 % 8].map(f64::from);
        let mut jitter = || 0.018 * random.f64();
        let at =
            [-0.84 + 0.235 * x + jitter(), 1.4 + 0.25 * y + jitter(), -0.83 + 0.235 * z + jitter()];
        world
            .marbles
            .insert(Marble {
                mass: Mass::Kilograms(S::from_f64(0.05)),
                material: Some(material),
                ..Marble::new(Point3::from(at.map(S::from_f64)), S::from_f64(RADIUS))
            })
            .unwrap();
    }
    (world, paddle)
}

/// Speed, in m/s, that bounces between the paddle and a wall that stands still approach, and that
/// of a fall from the top of the pit.
fn max_speed(sweep: Sweep) -> f64 {
    let paddle = sweep.amplitude * sweep.rate * std::f64::consts::PI;
    let height = 1.5 + 0.25 * f64::from(sweep.count / 64);
    paddle * (1.0 + RESTITUTION) / (1.0 - RESTITUTION) + (2.0 * 9.81 * height).sqrt()
}

/// Description of the first step in which a ball leaves the box or is faster than that.
fn fault<S: Scalar>(sweep: Sweep, seconds: f64) -> Option<String> {
    let (mut world, paddle) = pit::<S>(sweep);
    for step in 0..(seconds / DT).round() as u32 {
        let [before, after] = [step, step + 1].map(|n| paddle_at(sweep, f64::from(n) * DT));
        let still = S::zero();
        let motion = WallMotion {
            velocity: Vec3::new(S::from_f64((after - before) / DT), still, still),
            angular_velocity: Vec3::new(still, still, still),
            pivot: Point3::from([after, 0.52, 0.0].map(S::from_f64)),
        };
        world.walls.set(paddle, block([after, 0.52, 0.0], [0.05, 0.5, 0.95])).unwrap();
        world.walls.set_motion(paddle, Some(motion)).unwrap();
        world.step(S::from_f64(DT)).unwrap();
        let speeds = world.marbles.velocity().iter().map(|v| v.magnitude().as_f64());
        let fastest = speeds.fold(0.0, f64::max);
        let is_outside = |p: &Point3<S>| {
            let [x, y, z] = [p.x, p.y, p.z].map(S::as_f64);
            x.abs() > 1.0 || z.abs() > 1.0 || !(0.0..6.0).contains(&y)
        };
        let outside = world.marbles.position().iter().filter(|p| is_outside(p)).count();
        if !(outside == 0 && fastest <= max_speed(sweep)) {
            return Some(format!("{sweep:?}, step {step}: {outside} outside, {fastest} m/s"));
        }
    }
    None
}

fn check(count: u32, amplitude: f64, rate: f64, seconds: f64) {
    let mut faults = Vec::new();
    for seed in 0..3 {
        for iterations in [8, 50] {
            let sweep = Sweep { count, amplitude, rate, iterations, seed };
            faults.extend(fault::<f64>(sweep, seconds));
            faults.extend(fault::<f32>(sweep, seconds));
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn a_slow_paddle_that_squeezes_a_crowd_makes_no_speed() {
    check(40, 0.65, 0.1, 4.0);
}

#[test]
fn a_fast_paddle_that_squeezes_a_few_makes_no_speed_that_it_does_not_have() {
    check(20, 0.65, 1.5, 4.0);
}

#[test]
fn a_paddle_with_room_for_all_makes_no_speed() {
    check(40, 0.3, 0.2, 6.0);
    check(20, 0.45, 0.3, 6.0);
}
