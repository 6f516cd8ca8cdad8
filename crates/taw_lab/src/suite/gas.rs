//! Hard spheres that collide and nothing else.

use taw::prelude::*;

use super::{CostClass, SuiteCase};
use crate::scene::{Ball, EXACT, Stopwatch, box_around, energy, surface, wall, weightless};

/// Elastic balls of diameter one without gravity that fill this part of a cube around the
/// origin, on a lattice, with random velocities whose components have this deviation; and half
/// of the cube's width.
fn gas(count: u32, filling: f64, speed: f64) -> (World<f32>, f64) {
    let mut world = weightless::<f32>(Model { rotation: Rotation::None, ..EXACT });
    let volume = f64::from(count) * std::f64::consts::PI / 6.0 / filling;
    let half = 0.5 * volume.cbrt();
    let side = f64::from(count).cbrt().round() as u32;
    let pitch = 2.0 * half / f64::from(side);
    let mut random = fastrand::Rng::with_seed(1);
    // The sum of twelve has a deviation of one.
    let mut normal = || (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
    for i in 0..count {
        let at = [i % side, i / side % side, i / side / side];
        let at = at.map(|n| (f64::from(n) + 0.5) * pitch - half);
        let velocity = [normal(), normal(), normal()].map(|v| v * speed);
        Ball { at, velocity, material: surface(1.0, 0.0), ..Ball::default() }.insert(&mut world);
    }
    (world, half)
}

/// A gas between six walls.
fn boxed(count: u32, filling: f64, speed: f64) -> (World<f32>, f64) {
    let (mut world, half) = gas(count, filling, speed);
    box_around(&mut world, half);
    wall(&mut world, [0.0, 1.0, 0.0], -half);
    wall(&mut world, [0.0, -1.0, 0.0], -half);
    (world, half)
}

/// The energy after 60,000 collisions or more.
fn energy_kept(stopwatch: &mut Stopwatch) -> f64 {
    let (mut world, _) = boxed(216, 0.22, 10.0);
    let start = energy(&world);
    let mut collisions = 0;
    let mut seconds = 0.0;
    while collisions < 60_000 || seconds < 10.0 {
        stopwatch.step(&mut world, 1.0 / 60.0);
        collisions += world.impacts().len();
        seconds += 1.0 / 60.0;
    }
    (energy(&world) / start - 1.0).abs()
}

/// PV/NkT of the hard-sphere fluid at this filling (Boublik and Nezbeda 1986).
fn compressibility(filling: f64) -> f64 {
    let y = filling;
    let numerator = 1.0 + y + y * y - 2.0 / 3.0 * y.powi(3) * (1.0 + y);
    numerator / (1.0 - y).powi(3)
}

/// Relative error of the pressure in the middle of a box, against the hard-sphere fluid at the
/// density there. `margin` is what counts as wall.
fn pressure_in_the_middle(
    stopwatch: &mut Stopwatch,
    count: u32,
    filling: f64,
    margin: f64,
    seconds: f64,
) -> f64 {
    let (mut world, half) = boxed(count, filling, 1.0);
    let inner = half - margin;
    let dt = 0.02;
    stopwatch.run(&mut world, dt, 0.1 * seconds + 5.0); // until the lattice is forgotten
    let temperature = 2.0 * energy(&world) / (3.0 * f64::from(count));
    let inside = |p: &Point3<f32>| [p.x, p.y, p.z].iter().all(|x| f64::from(x.abs()) < inner);
    let (mut virial, mut balls) = (0.0, 0.0);
    let steps = (seconds / dt).round() as u32;
    for _ in 0..steps {
        stopwatch.step(&mut world, dt);
        let position = world.marbles.position();
        for impact in world.impacts().iter().filter(|impact| !impact.on_wall) {
            // Half of it belongs to each ball.
            for row in [impact.a, impact.b] {
                if inside(&position[row as usize]) {
                    virial += 0.5 * f64::from(impact.approach_speed);
                }
            }
        }
        balls += position.iter().filter(|p| inside(p)).count() as f64;
    }
    let mean = balls / f64::from(steps);
    let found = 1.0 + virial / (3.0 * mean * temperature * f64::from(steps) * dt);
    let there = mean * std::f64::consts::PI / 6.0 / (2.0 * inner).powi(3);
    (found / compressibility(there) - 1.0).abs()
}

/// Relative error of the pressure of a gas without walls, against the hard-sphere fluid.
fn pressure(stopwatch: &mut Stopwatch, count: u32, filling: f64, seconds: f64) -> f64 {
    let (mut world, half) = gas(count, filling, 1.0);
    let side = Some((2.0 * half) as f32);
    world.set_period([side; 3]).expect("far larger than a ball");
    let dt = 0.02;
    stopwatch.run(&mut world, dt, 0.1 * seconds + 5.0); // until the lattice is forgotten
    // Without walls momentum stays, and is no heat.
    let drift = world.momentum() / f64::from(count);
    let heat = energy(&world) - 0.5 * f64::from(count) * drift.magnitude2();
    let temperature = 2.0 * heat / (3.0 * f64::from(count - 1));
    let mut virial = 0.0;
    let steps = (seconds / dt).round() as u32;
    for _ in 0..steps {
        stopwatch.step(&mut world, dt);
        virial += world.impacts().iter().map(|i| f64::from(i.approach_speed)).sum::<f64>();
    }
    let time = f64::from(steps) * dt;
    let found = 1.0 + virial / (3.0 * f64::from(count) * temperature * time);
    (found / compressibility(filling) - 1.0).abs()
}

pub const ROWS: &[SuiteCase] = &[
    SuiteCase {
        name: "gas/energy",
        setup: "216 balls fill 0.22 of a box, over 60,000 collisions in 10 s at 1/60 s",
        metric: "relative error of the energy",
        model: "event-driven",
        target: 1e-5,
        best: "0.74 Box3D, 0.79 Rapier lost",
        source: "references 4.22",
        effort: CostClass::Quick,
        measure: energy_kept,
    },
    SuiteCase {
        name: "gas/pressure/1000",
        setup: "1,000 balls fill 0.05 and 0.1: PV/NkT in the middle (denser, the walls order too much of so small a box)",
        metric: "worst relative error",
        model: "event-driven",
        target: 1e-2,
        best: "none published; our prototype 0.7e-2",
        source: "Boublik and Nezbeda 1986; references 4.24",
        effort: CostClass::Quick,
        measure: |stopwatch| {
            [0.05, 0.1]
                .map(|filling| pressure_in_the_middle(stopwatch, 1000, filling, 2.0, 150.0))
                .into_iter()
                .fold(0.0, f64::max)
        },
    },
    SuiteCase {
        name: "gas/pressure/4096",
        setup: "4,096 balls fill 0.1, 0.3 and 0.45 of a periodic cube: PV/NkT",
        metric: "worst relative error",
        model: "event-driven",
        target: 2e-3,
        best: "none published",
        source: "Boublik and Nezbeda 1986; references 4.24",
        effort: CostClass::Long,
        measure: |stopwatch| {
            [(0.1, 200.0), (0.3, 100.0), (0.45, 80.0)]
                .map(|(filling, seconds)| pressure(stopwatch, 4096, filling, seconds))
                .into_iter()
                .fold(0.0, f64::max)
        },
    },
];
