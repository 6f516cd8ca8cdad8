//! Rounding, scale and extreme values.

use taw::math::Quat;
use taw::motion::FreeRotation;
use taw::prelude::*;

use super::{CostClass, SuiteCase};
use crate::scene::{
    Ball, EXACT, IMPULSE, Stopwatch, energy, state, surface, vector, wall, weightless, world,
};

/// The box of Dzhanibekov for a hundred seconds in f32: relative errors of energy and
/// angular momentum, flips missing or too many, and how late the last one is.
fn dzhanibekov(dt: f64) -> [f64; 4] {
    let inertia = Vec3::new(1.6_f32, 4.16, 5.44);
    let momentum = Vec3::new(0.01 * 1.6, 5.0 * 4.16, 0.01 * 5.44);
    let mut body = FreeRotation::new(Quat::new(1.0, 0.0, 0.0, 0.0), momentum);
    let (start, axis) = (f64::from(body.energy(inertia)), body.angular_momentum().map(f64::from));
    let (mut energy, mut turned): (f64, f64) = (0.0, 0.0);
    let (mut flips, mut last, mut at) = (0, 1.0, 0.0);
    for step in 1..=(100.0 / dt).round() as u32 {
        body = body.step(inertia, dt as f32);
        energy = energy.max((f64::from(body.energy(inertia)) / start - 1.0).abs());
        let off = body.angular_momentum().map(f64::from) - axis;
        turned = turned.max(off.magnitude() / axis.magnitude());
        let now = f64::from(body.momentum().y);
        if now * last < 0.0 {
            flips += 1;
            at = f64::from(step) * dt;
        }
        last = now;
    }
    let exact = 2.84256 + 19.0 * 5.024_785;
    [energy, turned, f64::from(20_i32 - flips).abs(), (at - exact).abs()]
}

fn dzhanibekov_worst(part: usize) -> f64 {
    [1.0 / 60.0, 1.0 / 240.0, 1e-3].map(|dt| dzhanibekov(dt)[part]).into_iter().fold(0.0, f64::max)
}

/// A ball that rolls down a slope into a wall and another ball, at this scale of length
/// (and time by the root): positions over the scale.
fn small_scene(stopwatch: &mut Stopwatch, model: Model, scale: f64) -> [Vec3<f64>; 2] {
    let mut world = world::<f32>(model);
    let time = scale.sqrt();
    let (sin, cos) = 10_f64.to_radians().sin_cos();
    wall(&mut world, [sin, cos, 0.0], 0.0);
    wall(&mut world, [-1.0, 0.0, 0.0], -4.0 * scale);
    let ball = |along: f64, lift: f64| {
        let at = [along * cos + (0.5 + lift) * sin, -along * sin + (0.5 + lift) * cos, 0.1 * lift];
        let material = surface(0.4, 0.3);
        Ball { at: at.map(|x| x * scale), radius: 0.5 * scale, material, ..Ball::default() }
    };
    let ids = [ball(-3.0, 0.0), ball(1.0, 0.7)].map(|ball| ball.insert(&mut world));
    let dt = time / 64.0;
    for _ in 0..128 {
        stopwatch.step(&mut world, dt);
    }
    ids.map(|id| state(&world, id)[0] / scale)
}

/// Dependence of the outcome on the scale of the scene, from a millimetre to a kilometre.
fn scale_free(stopwatch: &mut Stopwatch, model: Model) -> f64 {
    let exact = small_scene(stopwatch, model, 1.0);
    let mut worst: f64 = 0.0;
    for scale in [1e-3, 1e-2, 0.1, 0.3, 10.0, 100.0, 1e3] {
        let scaled = small_scene(stopwatch, model, scale);
        for (a, b) in exact.iter().zip(scaled) {
            worst = worst.max((a - b).magnitude());
        }
    }
    worst
}

/// Balls of extreme masses, spins, steps and materials collide: how many runs end with
/// something that is not finite, or with energy that was gained.
fn extremes(stopwatch: &mut Stopwatch, model: Model) -> f64 {
    let mut failures = 0.0;
    for mass in [1e-30, 1.0, 1e30, f64::INFINITY] {
        for spin in [0.0, 1e5] {
            for dt in [1e-9, 1e-3, 1.0] {
                for (e, mu) in [(0.0, 0.0), (1.0, 0.0), (0.5, 1e30), (1.0, 1.0)] {
                    let mut world = weightless::<f32>(model);
                    wall(&mut world, [0.0, 1.0, 0.0], 0.0);
                    let material = surface(e, mu);
                    let ball = Ball {
                        at: [0.0, 0.5, 0.0],
                        velocity: [1.0, -1.0, 0.0],
                        angular_velocity: [0.0, 0.0, spin],
                        material,
                        ..Ball::default()
                    };
                    let first = ball.insert(&mut world);
                    let second =
                        Ball { at: [1.0, 0.5, 0.0], velocity: [-1.0, 0.0, 0.0], mass, ..ball }
                            .insert(&mut world);
                    let before = energy(&world);
                    for _ in 0..20 {
                        stopwatch.step(&mut world, dt);
                    }
                    let finite = [first, second].iter().all(|id| {
                        state(&world, *id)
                            .iter()
                            .all(|v| v.x.is_finite() && v.y.is_finite() && v.z.is_finite())
                    });
                    let after = energy(&world);
                    // Displacements part by half whatever the masses; that is their nature.
                    let keeps = model.response == Response::Displacement
                        || mass.is_infinite() // which may push for ever
 || !before.is_finite()
                        || after <= before * (1.0 + 1e-5);
                    if !finite || !keeps {
                        failures += 1.0;
                    }
                }
            }
        }
    }
    // Invalid values are rejected.
    let mut world = weightless::<f32>(EXACT);
    for dt in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        failures += f64::from(u8::from(world.step(dt).is_ok()));
    }
    let good = Marble::new(Point3::new(0.0, 0.0, 0.0), 0.5_f32);
    let with = |material: Material<f32>| Marble { material: Some(material), ..good };
    let bad = [
        Marble { mass: Mass::Kilograms(0.0), ..good },
        Marble { mass: Mass::Kilograms(-1.0), ..good },
        with(Material { restitution: -0.1, ..Material::default() }),
        with(Material { restitution: 1.1, ..Material::default() }),
        with(Material { friction: -1.0, ..Material::default() }),
        with(Material { friction: f32::INFINITY, ..Material::default() }),
        with(Material { rolling_resistance: f32::NAN, ..Material::default() }),
    ];
    for marble in bad {
        failures += f64::from(u8::from(world.marbles.insert(marble).is_ok()));
    }
    failures
}

/// NaN and infinity in each field are refused, and a force that returns NaN for one ball
/// stops that one alone: how many of these fail.
fn not_finite(stopwatch: &mut Stopwatch) -> f64 {
    let mut failures = 0.0;
    let good = Marble::new(Point3::new(0.0, 2.0, 0.0), 0.5_f32);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let v = Vec3::new(0.0, bad, 0.0);
        let refused = [
            Marble { position: Point3::new(bad, 0.0, 0.0), ..good },
            Marble { velocity: v, ..good },
            Marble { angular_velocity: v, ..good },
            Marble { radius: bad, ..good },
            Marble { rotation: Quat::new(bad, 0.0, 0.0, 0.0), ..good },
            Marble { gravity_scale: bad, ..good },
            Marble { mass: Mass::Kilograms(bad), ..good },
        ];
        let mut world = world::<f32>(EXACT);
        for marble in refused {
            failures += f64::from(u8::from(world.marbles.insert(marble).is_ok()));
        }
    }
    for model in [EXACT, IMPULSE, Model { response: Response::Displacement, ..IMPULSE }] {
        let run = |stopwatch: &mut Stopwatch, sick: bool| {
            let mut world = world::<f32>(model);
            wall(&mut world, [0.0, 1.0, 0.0], 0.0);
            for i in 0..20_u32 {
                Ball {
                    at: [f64::from(i) * 1.01, 1.0, 0.0],
                    material: surface(0.5, 0.3),
                    ..Ball::default()
                }
                .insert(&mut world);
            }
            // Far from the others, and heavy, by which the force knows it.
            Ball { at: [-50.0, 1.0, 0.0], mass: 1e3, ..Ball::default() }.insert(&mut world);
            if sick {
                let force = ForceField::Custom(|_, mass| {
                    vector([if mass > 100.0 { f64::NAN } else { 0.0 }, 0.0, 0.0])
                });
                world.set_forces(vec![force]).expect("a function");
            } else {
                world
                    .set_forces(vec![ForceField::Custom(|_, _| vector([0.0; 3]))])
                    .expect("a function");
            }
            let mut stopped = 0;
            for _ in 0..60 {
                stopwatch.step(&mut world, 1.0 / 60.0);
                stopped += world.stopped().count();
            }
            (world.marbles.position()[..20].to_vec(), stopped, world.marbles.position()[20])
        };
        let (healthy, none, _) = run(stopwatch, false);
        let (others, stopped, at) = run(stopwatch, true);
        if healthy != others || none != 0 || stopped != 60 || !at.x.is_finite() {
            failures += 1.0;
        }
    }
    failures
}

pub const ROWS: &[SuiteCase] = &[
    SuiteCase {
        name: "numbers/dzhanibekov/energy",
        setup: "box turning about its middle axis, 100 s at 1/60, 1/240 and 1 ms, f32",
        metric: "largest relative error of the energy",
        model: "free rotation",
        target: 1e-4,
        best: "1.9e-3 Rapier (1/60), 2.8e-2 (1 ms)",
        source: "Euler; references 4.8",
        effort: CostClass::Quick,
        measure: |_| dzhanibekov_worst(0),
    },
    SuiteCase {
        name: "numbers/dzhanibekov/momentum",
        setup: "the same",
        metric: "relative error of the angular momentum, a vector",
        model: "free rotation",
        target: 1e-5,
        best: "–",
        source: "Euler; references 4.8",
        effort: CostClass::Quick,
        measure: |_| dzhanibekov_worst(1),
    },
    SuiteCase {
        name: "numbers/dzhanibekov/flips",
        setup: "the same: 20 flips",
        metric: "flips off",
        model: "free rotation",
        target: 0.0,
        best: "3 Rapier, 1 Box3D (1/60)",
        source: "Euler; references 4.8",
        effort: CostClass::Quick,
        measure: |_| dzhanibekov_worst(2),
    },
    SuiteCase {
        name: "numbers/dzhanibekov/last",
        setup: "the same: the last at 98.3135 s",
        metric: "seconds off",
        model: "free rotation",
        target: 0.3,
        best: "–",
        source: "Euler; references 4.8",
        effort: CostClass::Quick,
        measure: |_| dzhanibekov_worst(3),
    },
    SuiteCase {
        name: "numbers/scale-free",
        setup: "a slope, a wall and two balls at scales of 1e-3 to 1e3, 2 s of its own time",
        metric: "deviation of a place over the scale",
        model: "event-driven",
        target: 1e-5,
        best: "2.9e-2 Avian, 4e-2 Rapier, their length unit or not (`peers`)",
        source: "issue 4",
        effort: CostClass::Quick,
        measure: |stopwatch| scale_free(stopwatch, EXACT),
    },
    SuiteCase {
        name: "numbers/scale-free",
        setup: "a slope, a wall and two balls at scales of 1e-3 to 1e3, 2 s of its own time",
        metric: "deviation of a place over the scale",
        model: "impulse",
        target: 1e-4,
        best: "2.9e-2 Avian, 4e-2 Rapier, their length unit or not (`peers`)",
        source: "issue 4",
        effort: CostClass::Quick,
        measure: |stopwatch| scale_free(stopwatch, IMPULSE),
    },
    SuiteCase {
        name: "numbers/extremes",
        setup: "masses 1e-30 to infinity, 1e5 rad/s, steps 1 ns to 1 s, e and µ at their ends",
        metric: "runs with energy gained or something not finite, and bad input taken",
        model: "event-driven",
        target: 0.0,
        best: "–",
        source: "references §6.4, family 7",
        effort: CostClass::Quick,
        measure: |stopwatch| extremes(stopwatch, EXACT),
    },
    SuiteCase {
        name: "numbers/extremes",
        setup: "the same; masses 1e-30 to infinity, 1e5 rad/s, steps 1 ns to 1 s, e and µ at their ends",
        metric: "runs with energy gained or something not finite, and bad input taken",
        model: "impulse",
        target: 0.0,
        best: "–",
        source: "references §6.4, family 7",
        effort: CostClass::Quick,
        measure: |stopwatch| extremes(stopwatch, IMPULSE),
    },
    SuiteCase {
        name: "numbers/not-finite",
        setup: "NaN and infinity in each field; a force that is NaN for one of 21 balls",
        metric: "not refused, or more than that ball changed by a bit",
        model: "event-driven, impulse, displacement",
        target: 0.0,
        best: "Rapier stops that body: the bar",
        source: "references §6.4, family 8",
        effort: CostClass::Quick,
        measure: not_finite,
    },
];
