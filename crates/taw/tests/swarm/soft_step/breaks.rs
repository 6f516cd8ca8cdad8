//! Bounces of several balls within a step, as in a break of billiards.

use cgmath::{InnerSpace, Zero};
use taw::prelude::*;

use super::impacts::ball;
use super::world;

const RADIUS: f64 = 0.028_575;
const RESTITUTION: f64 = 0.9;
const DT: f64 = 1.0 / 64.0;

fn weightless<S: Scalar>() -> World<S> {
    let mut world = world::<S>(4);
    world.set_gravity(Vec3::zero()).unwrap();
    world
}

/// Part of its energy that a ball and one that it strikes at this distance from a wall keep.
fn kept_energy(gap: f64, speed: f64) -> f64 {
    let mut world = weightless::<f64>();
    world.walls.insert(Plane::new(-Vec3::unit_x(), -(RADIUS + gap)).unwrap()).unwrap();
    world.marbles.insert(ball([-0.3, 0.0, 0.0], [speed, 0.0, 0.0], RADIUS, RESTITUTION)).unwrap();
    world.marbles.insert(ball([0.0; 3], [0.0; 3], RADIUS, RESTITUTION)).unwrap();
    for _ in 0..64 {
        world.step(DT).unwrap();
    }
    world.marbles.velocity().iter().map(|v| v.magnitude2()).sum::<f64>() / (speed * speed)
}

/// Ball, ball, wall, ball: each bounce keeps what restitution leaves, though all may lie in one substep.
#[test]
fn a_ball_that_is_struck_before_a_wall_bounces_off_it_in_the_same_substep() {
    let (kept, lost) = (0.5 * (1.0 + RESTITUTION), 0.5 * (1.0 - RESTITUTION));
    let back = RESTITUTION * kept;
    let right = (back * kept - lost * lost).powi(2) + (back * lost - lost * kept).powi(2);
    for gap in [0.0, 1e-4, 1e-3, 5e-3, 0.01, 0.02, 0.05, 0.1] {
        for speed in [2.0, 4.0, 8.0] {
            let kept = kept_energy(gap, speed);
            assert!((kept / right - 1.0).abs() < 0.01, "{gap}, {speed}: {kept} of {right}");
        }
    }
}

/// Runs some steps. Returns how many impacts were told, and the most that a velocity changed in a step beyond
/// what they give, in m/s: each gives both balls (1 + e) times approach speed times reduced mass along its
/// normal, and nothing else changes a velocity here. All balls weigh the same.
fn unexplained_velocity<S: Scalar>(world: &mut World<S>, steps: u32) -> (usize, f64) {
    let (mut told, mut worst) = (0, 0.0_f64);
    for _ in 0..steps {
        let mut expected = world.marbles.velocity().to_vec();
        world.step(S::from_f64(DT)).unwrap();
        for impact in world.impacts() {
            let part = if impact.on_wall { 1.0 } else { 0.5 };
            let change =
                impact.normal * (S::from_f64((1.0 + RESTITUTION) * part) * impact.approach_speed);
            if !impact.on_wall {
                expected[impact.a as usize] -= change;
            }
            expected[impact.b as usize] += change;
        }
        let off = world.marbles.velocity().iter().zip(&expected);
        worst = off.fold(worst, |worst, (v, right)| worst.max((v - right).magnitude().as_f64()));
        told += world.impacts().len();
    }
    (told, worst)
}

/// A cue ball and a triangle of others between four cushions.
fn table<S: Scalar>(rows: u32, seed: u64) -> World<S> {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut world = weightless::<S>();
    for (normal, distance) in [(Vec3::unit_x(), 0.4), (Vec3::unit_z(), 0.2)] {
        for side in [-1.0, 1.0] {
            let plane = Plane::new(normal * S::from_f64(side), S::from_f64(-distance));
            world.walls.insert(plane.unwrap()).unwrap();
        }
    }
    let cue = [-0.35 + 0.1 * random.f64(), 0.0, 0.02 * (random.f64() - 0.5)];
    world.marbles.insert(ball(cue, [8.0, 0.0, 0.0], RADIUS, RESTITUTION)).unwrap();
    for row in 0..rows {
        for place in 0..=row {
            let x = f64::from(row) * 1.75 * RADIUS;
            let z = (f64::from(place) - 0.5 * f64::from(row)) * 2.02 * RADIUS;
            world.marbles.insert(ball([x, 0.0, z], [0.0; 3], RADIUS, RESTITUTION)).unwrap();
        }
    }
    world
}

#[test]
fn the_impacts_of_a_break_account_for_every_change_of_velocity() {
    for rows in [2, 5] {
        for seed in 0..200 {
            let single = unexplained_velocity(&mut table::<f32>(rows, seed), 20);
            let double = unexplained_velocity(&mut table::<f64>(rows, seed), 20);
            for (told, worst) in [single, double] {
                assert!(told as u32 > rows && worst < 1e-5, "{rows}, {seed}: {told}, {worst} m/s");
            }
        }
    }
}

/// Thousands of balls, of which each thread works on some; and large ones, struck without going far.
#[test]
fn so_do_those_of_a_bullet_among_thousands() {
    for (radius, gap, speed) in [(RADIUS, 0.8, 10.0), (1.0, 0.02, 4.0)] {
        for axis in 0..3 {
            let mut random = fastrand::Rng::with_seed(axis);
            let mut world = weightless::<f32>();
            for cell in 0..16 * 16 * 16 {
                let at = [cell % 16, cell / 16 % 16, cell / 256].map(|i| f64::from(i) - 7.5);
                let at = at.map(|i| radius * ((2.0 + gap) * i + 0.2 * gap * random.f64()));
                world.marbles.insert(ball(at, [0.0; 3], radius, RESTITUTION)).unwrap();
            }
            let mut at = [0.1 * radius, 0.2 * radius, -0.1 * radius];
            let mut velocity = [0.0; 3];
            velocity[axis as usize] = speed;
            at[axis as usize] = -8.0 * (2.0 + gap) * radius - 2.5 * radius;
            world.marbles.insert(ball(at, velocity, radius, RESTITUTION)).unwrap();
            let (told, worst) = unexplained_velocity(&mut world, 60);
            assert!(told > 80 && worst < 1e-4, "{radius}, {axis}: {told}, {worst} m/s");
        }
    }
}
