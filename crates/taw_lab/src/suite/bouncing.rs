//! Balls that fall and bounce.

use taw::prelude::*;

use super::{CostClass, SuiteCase};
use crate::scene::{
    Ball, EXACT, G, IMPULSE, Stopwatch, energy, overlaps, slope, state, surface, wall, world,
};

/// Event-driven without rotation: nothing here spins.
const FALLING: Model = Model { rotation: Rotation::None, ..EXACT };

/// SimBenchmark's bouncing: 49 elastic balls from 5 m for 20 s; root mean square of the
/// energy's error over the energy.
fn bouncing(stopwatch: &mut Stopwatch, dt: f64) -> f64 {
    let mut world = slope::<f32>(FALLING, 0.0);
    for i in 0..49_u32 {
        let at = [f64::from(i % 7) * 2.0, 5.0, f64::from(i / 7) * 2.0];
        Ball { at, radius: 0.1, mass: 10.0, material: surface(1.0, 0.0), ..Ball::default() }
            .insert(&mut world);
    }
    rms_energy(stopwatch, &mut world, dt, 20.0)
}

/// The root mean square over the steps of the energy's deviation from the start's, over
/// the latter.
fn rms_energy(stopwatch: &mut Stopwatch, world: &mut World<f32>, dt: f64, seconds: f64) -> f64 {
    let start = energy(world);
    let steps = (seconds / dt).round() as u32;
    let mut sum = 0.0;
    for _ in 0..steps {
        stopwatch.step(world, dt);
        sum += (energy(world) - start).powi(2);
    }
    (sum / f64::from(steps)).sqrt() / start
}

/// The height of the hundredth apex of an elastic ball that is dropped from 5 m.
fn apex_after_100(stopwatch: &mut Stopwatch, dt: f64) -> f64 {
    let mut world = slope::<f32>(FALLING, 0.0);
    let ball =
        Ball { at: [0.0, 5.0, 0.0], radius: 0.1, material: surface(1.0, 0.0), ..Ball::default() };
    let id = ball.insert(&mut world);
    let (mut bounces, mut apex) = (0, f64::NAN);
    while bounces < 101 {
        stopwatch.step(&mut world, dt);
        bounces += world.impacts().len();
        let [x, v, _] = state(&world, id);
        if bounces == 100 {
            // Where it is on its way up or down says how high it will or did come.
            apex = x.y + v.y * v.y / (2.0 * G);
        }
    }
    (apex / 5.0 - 1.0).abs()
}

/// Drops of 1 mm to 10 m at every restitution and step: the largest error of the rebound
/// height, over the height.
fn rebound(stopwatch: &mut Stopwatch, steps: &[f64]) -> f64 {
    let mut worst: f64 = 0.0;
    for dt in steps {
        for height in [1e-3, 1e-2, 0.1, 1.0, 2.0, 10.0] {
            for e in [0.3, 0.5, 0.8, 0.95, 1.0] {
                let mut world = slope::<f32>(FALLING, 0.0);
                let ball = Ball {
                    at: [0.0, 0.05 + height, 0.0],
                    radius: 0.05,
                    material: surface(e, 0.0),
                    ..Ball::default()
                };
                let id = ball.insert(&mut world);
                while world.impacts().is_empty() {
                    stopwatch.step(&mut world, *dt);
                }
                // Several bounces within the step of the first: as many powers.
                let exact = world.impacts().iter().fold(height, |left, _| left * e * e);
                let [x, v, _] = state(&world, id);
                let reached = x.y - 0.05 + v.y * v.y / (2.0 * G);
                worst = worst.max((reached - exact).abs() / height);
            }
        }
    }
    worst
}

/// MFiX DEM02: heights of all bounces above 1 % of the first fall, relative errors, as
/// read off the speeds of the impacts.
fn heights(stopwatch: &mut Stopwatch) -> f64 {
    let mut worst: f64 = 0.0;
    for e in [1.0, 0.9, 0.8, 0.7, 0.6, 0.5_f64] {
        let mut world = slope::<f32>(FALLING, 0.0);
        Ball {
            at: [0.0, 0.5, 0.0],
            radius: 0.1,
            mass: 10.891,
            material: surface(e, 0.0),
            ..Ball::default()
        }
        .insert(&mut world);
        let (mut bounce, mut seen) = (0, 0.0);
        while seen < 10.0 {
            stopwatch.step(&mut world, 1.0 / 60.0);
            seen += 1.0 / 60.0;
            for impact in world.impacts() {
                let fallen = f64::from(impact.approach_speed).powi(2) / (2.0 * G);
                let exact = 0.4 * e.powi(2 * bounce);
                if exact < 0.004 {
                    break;
                }
                worst = worst.max((fallen / exact - 1.0).abs());
                bounce += 1;
            }
        }
    }
    worst
}

/// When a ball that bounces for ever shorter times stands still, over when it should; and
/// a failure if it moves afterwards.
fn zeno(stopwatch: &mut Stopwatch, e: f64, dt: f64) -> f64 {
    let mut world = slope::<f32>(FALLING, 0.0);
    let id = Ball { at: [0.0, 1.5, 0.0], material: surface(e, 0.0), ..Ball::default() }
        .insert(&mut world);
    let exact = (2.0 / G).sqrt() * (1.0 + e) / (1.0 - e);
    let (mut now, mut moved) = (0.0, 0.0);
    let mut last = f64::NAN;
    while now < 2.0 * exact {
        stopwatch.step(&mut world, dt);
        if !world.impacts().is_empty() || state(&world, id)[1].y != 0.0 {
            moved = now;
            last = state(&world, id)[1].y;
        }
        now += dt;
    }
    // It rested within the step after `moved`; anywhere in it is right.
    let stop = if last == 0.0 { exact.clamp(moved, moved + dt) } else { moved + dt };
    (stop / exact - 1.0).abs()
}

/// SimBenchmark's 666: 216 balls in a lattice over the ground.
fn lattice(model: Model, e: f64, lowest: f64) -> World<f32> {
    let mut world = world::<f32>(model);
    wall(&mut world, [0.0, 1.0, 0.0], 0.0);
    let mut random = fastrand::Rng::with_seed(42);
    for i in 0..216_u32 {
        let jitter = [0; 3].map(|_| random.f64() * 1e-3);
        let [x, y, z] = [i % 6, i / 36, i / 6 % 6].map(|n| f64::from(n) * 0.21);
        let at = [x + jitter[0], y + lowest + jitter[1], z + jitter[2]];
        Ball { at, radius: 0.1, mass: 10.0, material: surface(e, 0.0), ..Ball::default() }
            .insert(&mut world);
    }
    world
}

/// Inelastic: mean over the steps of the sum of squared overlaps, the deepest of them, and
/// the largest gain of energy in a step over the energy at the start.
fn inelastic(stopwatch: &mut Stopwatch, model: Model, dt: f64) -> [f64; 3] {
    let mut world = lattice(model, 0.0, 0.101);
    let steps = (10.0 / dt).round() as u32;
    let (mut sum, mut deepest, mut gain): (f64, f64, f64) = (0.0, 0.0, 0.0);
    let start = energy(&world);
    let mut before = start;
    for _ in 0..steps {
        stopwatch.step(&mut world, dt);
        let overlaps = overlaps(&world);
        sum += overlaps.iter().map(|d| d * d).sum::<f64>();
        deepest = overlaps.into_iter().fold(deepest, f64::max);
        let now = energy(&world);
        gain = gain.max((now - before) / start);
        before = now;
    }
    [sum / f64::from(steps), deepest, gain]
}

fn elastic(stopwatch: &mut Stopwatch, dt: f64) -> f64 {
    rms_energy(stopwatch, &mut lattice(FALLING, 1.0, 1.101), dt, 10.0)
}

/// A heavy ball on a light one on the floor: the deepest overlap in ten seconds over the
/// radius.
fn heavy_on_light(stopwatch: &mut Stopwatch, model: Model, ratio: f64) -> f64 {
    let mut world = slope::<f32>(model, 0.0);
    for (y, mass) in [(0.5, 1.0), (1.5, ratio)] {
        Ball { at: [0.0, y, 0.0], mass, ..Ball::default() }.insert(&mut world);
    }
    let mut deepest: f64 = 0.0;
    for _ in 0..600 {
        stopwatch.step(&mut world, 1.0 / 60.0);
        deepest = overlaps(&world).into_iter().fold(deepest, f64::max);
        // Nor may the upper one leave its place.
        let top = world.marbles.position()[1];
        deepest = deepest.max(f64::from((top.y - 1.5).abs())).max(f64::from(top.x.abs()));
    }
    deepest / 0.5
}

/// A ball at rest on the floor for ten seconds: how far it is off its height, over the
/// radius.
fn rest(stopwatch: &mut Stopwatch, model: Model) -> f64 {
    let mut worst: f64 = 0.0;
    for radius in [1e-4, 1e-3, 1e-2, 1.0, 100.0] {
        let mut world = slope::<f32>(model, 0.0);
        let id = Ball { at: [0.0, radius, 0.0], radius, ..Ball::default() }.insert(&mut world);
        stopwatch.run(&mut world, 1.0 / 60.0, 10.0);
        worst = worst.max((state(&world, id)[0].y / radius - 1.0).abs());
    }
    worst
}

pub const ROWS: &[SuiteCase] = &[
    SuiteCase {
        name: "bouncing/energy/60Hz",
        setup: "49 elastic balls from 5 m, 20 s at 1/60 s",
        metric: "rms of the energy's relative error",
        model: "event-driven",
        target: 2e-5,
        best: "4.4e-3 Rapier and Box3D",
        source: "SimBenchmark; references §1.2",
        effort: CostClass::Quick,
        measure: |stopwatch| bouncing(stopwatch, 1.0 / 60.0),
    },
    SuiteCase {
        name: "bouncing/energy/steps",
        setup: "the same, worst of 1/30, 1/240, 10 ms, 4 ms and 1 ms",
        metric: "rms of the energy's relative error",
        model: "event-driven",
        target: 1e-4,
        best: "5.8e-3 Box3D (RaiSim f64 5.7e-6 at 1 ms)",
        source: "SimBenchmark; references §1.2",
        effort: CostClass::Quick,
        measure: |stopwatch| {
            [1.0 / 30.0, 1.0 / 240.0, 0.01, 4e-3, 1e-3]
                .map(|dt| bouncing(stopwatch, dt))
                .into_iter()
                .fold(0.0, f64::max)
        },
    },
    SuiteCase {
        name: "bouncing/energy/0.1ms",
        setup: "the same in steps of 0.1 ms",
        metric: "rms of the energy's relative error",
        model: "event-driven",
        target: 1e-4,
        best: "RaiSim f64 5.7e-8",
        source: "SimBenchmark; references §1.2",
        effort: CostClass::Long,
        measure: |stopwatch| bouncing(stopwatch, 1e-4),
    },
    SuiteCase {
        name: "bouncing/apex-100",
        setup: "elastic from 5 m: the hundredth apex, at 1/60 and 1 ms",
        metric: "error of the height over the height",
        model: "event-driven",
        target: 1e-4,
        best: "1e-5 a bounce: Rapier #97",
        source: "references §1.2, 4.12",
        effort: CostClass::Quick,
        measure: |stopwatch| {
            apex_after_100(stopwatch, 1.0 / 60.0).max(apex_after_100(stopwatch, 1e-3))
        },
    },
    SuiteCase {
        name: "bouncing/restitution",
        setup: "drops of 1 mm to 10 m, e 0.3 to 1, steps 1/30 s to 1 ms: e² h",
        metric: "error of the rebound over the height",
        model: "event-driven",
        target: 1e-4,
        best: "0.45 Avian without its threshold; 0.64 Rapier: none at all (`peers`)",
        source: "Newton; references §1.2, issue 4",
        effort: CostClass::Quick,
        measure: |stopwatch| {
            rebound(stopwatch, &[1.0 / 30.0, 1.0 / 60.0, 1.0 / 120.0, 1.0 / 240.0, 1e-3])
        },
    },
    SuiteCase {
        name: "bouncing/heights",
        setup: "centre from 0.5 m, r 0.1, e 0.5 to 1: e^2k of the height, every bounce",
        metric: "largest relative error of a height",
        model: "event-driven",
        target: 1e-4,
        best: "1.1e-2 MFiX; 2–4 % Rapier's first",
        source: "MFiX DEM02; references §3",
        effort: CostClass::Quick,
        measure: heights,
    },
    SuiteCase {
        name: "bouncing/zeno",
        setup: "drop of 1 m, e 0.5 and 0.8, 1/60 s and 1 ms: at rest after sqrt(2h/g) (1+e)/(1−e)",
        metric: "relative error of the time",
        model: "event-driven",
        target: 1e-2,
        best: "7e-2 and 16e-2 Rapier, Box3D",
        source: "references 4.13",
        effort: CostClass::Quick,
        measure: |stopwatch| {
            let cases = [(0.5, 1.0 / 60.0), (0.8, 1.0 / 60.0), (0.5, 1e-3), (0.8, 1e-3)];
            cases.map(|(e, dt)| zeno(stopwatch, e, dt)).into_iter().fold(0.0, f64::max)
        },
    },
    SuiteCase {
        name: "bouncing/666/10ms",
        setup: "216 balls, e 0, fall into a heap, 10 s",
        metric: "mean sum of squared overlaps, m²",
        model: "event-driven",
        target: 1e-6,
        best: "1.6e-5 Rapier",
        source: "SimBenchmark; references §1.3",
        effort: CostClass::Quick,
        measure: |stopwatch| inelastic(stopwatch, FALLING, 0.01)[0],
    },
    SuiteCase {
        name: "bouncing/666/10ms/deepest",
        setup: "the same",
        metric: "deepest overlap, m",
        model: "event-driven",
        target: 5e-4,
        best: "1.1e-2 Rapier",
        source: "SimBenchmark; references §1.3",
        effort: CostClass::Quick,
        measure: |stopwatch| inelastic(stopwatch, FALLING, 0.01)[1],
    },
    SuiteCase {
        name: "bouncing/666/10ms/gain",
        setup: "the same; none may be gained, but for what f32 rounds",
        metric: "largest gain of energy in a step, relative",
        model: "event-driven",
        target: 1e-7,
        best: "–",
        source: "SimBenchmark; references §1.3",
        effort: CostClass::Quick,
        measure: |stopwatch| inelastic(stopwatch, FALLING, 0.01)[2],
    },
    SuiteCase {
        name: "bouncing/666/1ms",
        setup: "the same in steps of 1 ms",
        metric: "mean sum of squared overlaps, m²",
        model: "event-driven",
        target: 1e-8,
        best: "5.9e-6 Rapier; 3.1e-7 PyBullet",
        source: "SimBenchmark; references §1.3",
        effort: CostClass::Long,
        measure: |stopwatch| inelastic(stopwatch, FALLING, 1e-3)[0],
    },
    SuiteCase {
        name: "bouncing/666/10ms",
        setup: "216 balls, e 0, fall into a heap, 10 s",
        metric: "mean sum of squared overlaps, m²",
        model: "impulse",
        target: 1e-5,
        best: "1.6e-5 Rapier",
        source: "SimBenchmark; references §1.3",
        effort: CostClass::Quick,
        measure: |stopwatch| {
            inelastic(stopwatch, Model { rotation: Rotation::None, ..IMPULSE }, 0.01)[0]
        },
    },
    SuiteCase {
        name: "bouncing/666-elastic/60Hz",
        setup: "216 balls, e 1, 10 s at 1/60 s",
        metric: "rms of the energy's relative error",
        model: "event-driven",
        target: 1e-4,
        best: "4.6e-2 Box3D (10 ms)",
        source: "SimBenchmark; references §1.4",
        effort: CostClass::Quick,
        measure: |stopwatch| elastic(stopwatch, 1.0 / 60.0),
    },
    SuiteCase {
        name: "bouncing/666-elastic/steps",
        setup: "the same, worst of 10 ms, 4 ms and 1 ms",
        metric: "rms of the energy's relative error",
        model: "event-driven",
        target: 1e-4,
        best: "4.6e-2 Rapier (1 ms; RaiSim f64 8.4e-5)",
        source: "SimBenchmark; references §1.4",
        effort: CostClass::Quick,
        measure: |stopwatch| {
            [0.01, 4e-3, 1e-3].map(|dt| elastic(stopwatch, dt)).into_iter().fold(0.0, f64::max)
        },
    },
    SuiteCase {
        name: "bouncing/666-elastic/time",
        setup: "the same: 10 s at 1/60 s on one core",
        metric: "seconds of computing",
        model: "event-driven",
        target: 0.5,
        best: "–",
        source: "references §1.4",
        effort: CostClass::Quick,
        measure: |stopwatch| {
            elastic(stopwatch, 1.0 / 60.0);
            stopwatch.seconds()
        },
    },
    SuiteCase {
        name: "bouncing/heavy-on-light/1e6",
        setup: "1 kg under 1e6 kg, 10 s at 1/60 s",
        metric: "deepest overlap or drift over the radius",
        model: "event-driven",
        target: 1e-3,
        best: "through at 1e4: Rapier, Box3D, Bullet, MuJoCo",
        source: "references 4.14",
        effort: CostClass::Quick,
        measure: |stopwatch| heavy_on_light(stopwatch, EXACT, 1e6),
    },
    SuiteCase {
        name: "bouncing/heavy-on-light/1e5",
        setup: "1 kg under 1e5 kg, 10 s at 1/60 s",
        metric: "deepest overlap or drift over the radius",
        model: "impulse",
        target: 1e-2,
        best: "through at 1e4: Rapier, Box3D, Bullet, MuJoCo",
        source: "references 4.14, §7",
        effort: CostClass::Quick,
        measure: |stopwatch| heavy_on_light(stopwatch, IMPULSE, 1e5),
    },
    SuiteCase {
        name: "bouncing/rest",
        setup: "radii 0.1 mm to 100 m at rest, 10 s at 1/60 s",
        metric: "error of the height over the radius",
        model: "event-driven",
        target: 1e-3,
        best: "10e-2 Bullet, 69e-2 Rapier at 0.1 mm",
        source: "references §6.3",
        effort: CostClass::Quick,
        measure: |stopwatch| rest(stopwatch, EXACT),
    },
    SuiteCase {
        name: "bouncing/rest",
        setup: "radii 0.1 mm to 100 m at rest, 10 s at 1/60 s",
        metric: "error of the height over the radius",
        model: "impulse",
        target: 6e-3,
        best: "10e-2 Bullet, 69e-2 Rapier at 0.1 mm",
        source: "references §6.3",
        effort: CostClass::Quick,
        measure: |stopwatch| rest(stopwatch, IMPULSE),
    },
];
