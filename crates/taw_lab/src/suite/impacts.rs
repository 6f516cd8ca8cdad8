//! Single collisions, and chains of a few.

use taw::prelude::*;
use taw::response::{ContactLaw, Elasticity};

use super::{CostClass, SuiteCase};
use crate::scene::{Ball, EXACT, Stopwatch, state, surface, wall, weightless};

/// Velocity along x and y, and spin about z, of a ball after an impact on a wall with normal +y.
fn bounce(
    stopwatch: &mut Stopwatch,
    model: Model,
    v: [f64; 2],
    spin: f64,
    radius: f64,
    material: Material<f64>,
    dt: f64,
) -> [f64; 3] {
    let mut world = weightless::<f32>(model);
    wall(&mut world, [0.0, 1.0, 0.0], 0.0);
    // It meets the wall in the middle of the second step.
    let at = [0.0, radius - 1.5 * v[1] * dt, 0.0];
    let ball = Ball {
        at,
        radius,
        velocity: [v[0], v[1], 0.0],
        angular_velocity: [0.0, 0.0, spin],
        material,
        ..Ball::default()
    };
    let id = ball.insert(&mut world);
    for _ in 0..4 {
        stopwatch.step(&mut world, dt);
    }
    let [_, v, w] = state(&world, id);
    [v.x, v.y, w.z]
}

/// Analytic impact of a rigid ball (Chung and Ooi 2011): its contact point sticks, or slides with
/// all the friction that the whole impact allows.
fn rigid(v: [f64; 2], spin: f64, radius: f64, material: Material<f64>) -> [f64; 3] {
    let pressure = (1.0 + material.restitution) * -v[1];
    let slip = v[0] + radius * spin;
    let stop = -(1.0 + material.tangential_restitution) * slip / 3.5;
    let limit = material.friction * pressure;
    let grip = stop.clamp(-limit, limit);
    [v[0] + grip, -material.restitution * v[1], spin + 2.5 * grip / radius]
}

/// The worst of velocity and rim speed over the speed, over all cases, steps and radii.
fn oblique(
    stopwatch: &mut Stopwatch,
    cases: &[([f64; 2], f64)],
    rim: bool,
    material: Material<f64>,
) -> f64 {
    let mut worst: f64 = 0.0;
    for (v, spin) in cases {
        for radius in [1e-5, 2.5e-3, 0.1, 1.0, 1e3] {
            // A second's flight must not be longer than f32 can place a ball of that size.
            let spin = if rim { spin / radius } else { *spin };
            for dt in [1.0 / 30.0, 1.0 / 60.0, 1e-3, 1e-4] {
                let found = bounce(stopwatch, EXACT, *v, spin, radius, material, dt);
                let exact = rigid(*v, spin, radius, material);
                let speed = v[0].hypot(v[1]).max((radius * spin).abs());
                let off =
                    [found[0] - exact[0], found[1] - exact[1], radius * (found[2] - exact[2])];
                worst = off.iter().fold(worst, |worst, off| worst.max(off.abs() / speed));
            }
        }
    }
    worst
}

fn angles() -> Vec<([f64; 2], f64)> {
    (1..=17_u32)
        .map(|i| {
            let (sin, cos) = (5.0 * f64::from(i)).to_radians().sin_cos();
            ([3.9 * sin, -3.9 * cos], 0.0)
        })
        .collect()
}

/// Collisions of elastic spheres by Hertz: contact time, largest overlap and force of two
/// materials, worst relative error.
fn hertz(stopwatch: &mut Stopwatch, with_wall: bool) -> f64 {
    let cases = if with_wall {
        [
            (7.0e10, 0.30, 2699.0, 0.1, 0.2, [731.59e-6, 49.717e-6, 11_369.9]),
            (4.0e10, 0.35, 1800.0, 0.1, 0.2, [766.99e-6, 52.123e-6, 7232.7]),
        ]
    } else {
        [
            (4.8e10, 0.20, 2800.0, 0.01, 10.0, [40.336e-6, 274.11e-6, 10_696.9]),
            (2.0e10, 0.25, 2500.0, 0.01, 10.0, [54.196e-6, 368.30e-6, 7108.2]),
        ]
    };
    let mut worst: f64 = 0.0;
    for (youngs_modulus, poissons_ratio, density, radius, speed, exact) in cases {
        let model = Model {
            response: Response::Penalty(ContactLaw::HertzMindlin),
            rotation: Rotation::None,
            integrator: Integrator::SemiImplicitEuler,
            ..EXACT
        };
        let mut world = weightless::<f64>(model);
        let mass = 4.0 / 3.0 * std::f64::consts::PI * radius * radius * radius * density;
        // A hundredth of the Rayleigh time.
        let shear = youngs_modulus / (2.0 + 2.0 * poissons_ratio);
        let dt = 0.01 * std::f64::consts::PI * radius * (density / shear).sqrt()
            / (0.1631 * poissons_ratio + 0.8766);
        let material = Material {
            elasticity: Elasticity { youngs_modulus, poissons_ratio },
            ..surface(1.0, 0.35)
        };
        let ball = |x: f64, v: f64| Ball {
            at: [x, 0.0, 0.0],
            radius,
            velocity: [v, 0.0, 0.0],
            mass,
            material,
            ..Ball::default()
        };
        let id = if with_wall {
            wall(&mut world, [1.0, 0.0, 0.0], 0.0);
            ball(radius, -speed).insert(&mut world)
        } else {
            ball(-radius, speed).insert(&mut world);
            ball(radius, -speed).insert(&mut world)
        };
        let [time, overlap, acceleration] = collision(stopwatch, &mut world, id, radius, dt);
        let found = [time, if with_wall { overlap } else { 2.0 * overlap }, acceleration * mass];
        worst = found
            .iter()
            .zip(exact)
            .fold(worst, |worst, (found, exact)| worst.max((found / exact - 1.0).abs()));
    }
    worst
}

/// Contact time in s of a ball with what lies at x < 0, its largest overlap in m with x = 0, and its
/// largest acceleration in m/s².
fn collision(
    stopwatch: &mut Stopwatch,
    world: &mut World<f64>,
    id: MarbleId,
    radius: f64,
    dt: f64,
) -> [f64; 3] {
    let (mut time, mut overlap, mut acceleration): (f64, f64, f64) = (0.0, 0.0, 0.0);
    loop {
        let before = state(world, id)[1].x;
        stopwatch.step(world, dt);
        let [x, v, _] = state(world, id);
        let apart = x.x - radius;
        if apart > 0.0 || time > 1.0 {
            // They parted within this step, at this speed.
            return [time + dt - apart / v.x, overlap, acceleration];
        }
        time += dt;
        overlap = overlap.max(-apart);
        acceleration = acceleration.max((v.x - before) / dt);
    }
}

/// Five balls in a row, the first at 1 m/s: the largest error of a speed.
fn cradle(stopwatch: &mut Stopwatch, gap: f64) -> f64 {
    let mut world = weightless::<f32>(EXACT);
    let ids = [0, 1, 2, 3, 4].map(|i| {
        let first = if i == 0 { 1.0 } else { 0.0 };
        let at = [f64::from(i) * (1.0 + gap), 0.0, 0.0];
        Ball { at, velocity: [first, 0.0, 0.0], material: surface(1.0, 0.0), ..Ball::default() }
            .insert(&mut world)
    });
    stopwatch.run(&mut world, 1.0 / 60.0, 1.0);
    let exact = [0.0, 0.0, 0.0, 0.0, 1.0];
    ids.iter()
        .zip(exact)
        .map(|(id, exact)| (state(&world, *id)[1].x - exact).abs())
        .fold(0.0, f64::max)
}

/// Counts the collisions of Galperin's billiard with masses 1 and 100^n; gives by how many
/// it is off the digits of π.
fn galperin<S: Scalar>(stopwatch: &mut Stopwatch, n: i32) -> f64 {
    let mut world = weightless::<S>(Model { rotation: Rotation::None, ..EXACT });
    wall(&mut world, [1.0, 0.0, 0.0], 0.0);
    let elastic = surface(1.0, 0.0);
    Ball { at: [1.0, 0.0, 0.0], material: elastic, ..Ball::default() }.insert(&mut world);
    Ball {
        at: [3.0, 0.0, 0.0],
        velocity: [-1.0, 0.0, 0.0],
        mass: 100_f64.powi(n),
        material: elastic,
        ..Ball::default()
    }
    .insert(&mut world);
    let mut count = 0.0;
    for _ in 0..600 {
        stopwatch.step(&mut world, 1.0 / 60.0);
        count += world.impacts().len() as f64;
    }
    let digits = (std::f64::consts::PI * 10_f64.powi(n)).floor();
    (count - digits).abs()
}

/// Garwin's superball under a table, and 10,000 bounces between floor and ceiling for the
/// energy.
fn superball(stopwatch: &mut Stopwatch) -> f64 {
    let rubber = Material { tangential_restitution: 1.0, ..surface(1.0, 1e6) };
    let mut world = weightless::<f32>(EXACT);
    wall(&mut world, [0.0, 1.0, 0.0], 0.0);
    wall(&mut world, [0.0, -1.0, 0.0], -2.0);
    let id = Ball {
        at: [0.0, 1.0, 0.0],
        velocity: [1.0, -2.0, 0.0],
        material: rubber,
        ..Ball::default()
    }
    .insert(&mut world);
    let mut bounces = 0;
    let mut worst: f64 = 0.0;
    let start = 0.5 * (1.0 + 4.0);
    while bounces < 10_000 {
        stopwatch.step(&mut world, 1.0 / 60.0);
        let [_, v, w] = state(&world, id);
        if !world.impacts().is_empty() {
            bounces += world.impacts().len();
            let exact = match bounces {
                1 => Some((147.0, -490.0)),
                2 => Some((-217.0, 420.0)),
                3 => Some((-333.0, 130.0)),
                _ => None,
            };
            if let Some((speed, rim)) = exact {
                worst = worst.max((v.x - speed / 343.0).abs()).max((0.5 * w.z - rim / 343.0).abs());
            }
        }
    }
    let [_, v, w] = state(&world, id);
    let end = 0.5 * v.magnitude2() + 0.2 * (0.5 * w.z).powi(2);
    worst.max((end / start - 1.0).abs())
}

/// Restitution of 0 to 1 head on, two materials' worth of density: the largest error of e.
fn restitution_sweep(stopwatch: &mut Stopwatch) -> f64 {
    let mut worst: f64 = 0.0;
    for e in [0.0, 0.2, 0.4, 0.6, 0.8, 1.0] {
        for dt in [1.0 / 30.0, 1.0 / 60.0, 1e-3] {
            let [_, v, _] = bounce(stopwatch, EXACT, [0.0, -3.9], 0.0, 2.5e-3, surface(e, 0.0), dt);
            worst = worst.max((v / 3.9 - e).abs());
        }
    }
    worst
}

/// A million impacts of two balls: what must be conserved is, and what must not grow does
/// not; the largest relative violation.
fn fuzz(_: &mut Stopwatch) -> f64 {
    use taw::response::{BallRotation, InverseEffectiveMass, impact};
    let mut random = fastrand::Rng::with_seed(12);
    let mut worst: f64 = 0.0;
    for _ in 0..1_000_000 {
        let mut number = |low: f64, high: f64| low + (high - low) * random.f64();
        let inverse =
            [10_f64.powf(number(-3.0, 3.0)), 10_f64.powf(number(-3.0, 3.0))].map(|x| x as f32);
        let (Some(normal), closing) = (
            taw::math::normalize_and_length(Vec3::new(
                number(-1.0, 1.0),
                number(-1.0, 1.0),
                number(-1.0, 1.0),
            ))
            .map(|(d, _)| d.map(|x| x as f32)),
            Vec3::new(number(-1.0, 1.0), number(-1.0, 1.0), number(-1.0, 1.0)).map(|x| x as f32),
        ) else {
            continue;
        };
        let material = Material {
            restitution: number(0.0, 1.0) as f32,
            friction: number(0.0, 2.0) as f32,
            tangential_restitution: number(-1.0, 1.0) as f32,
            ..Material::default()
        };
        let mobility = InverseEffectiveMass::of_balls(inverse[0], inverse[1], BallRotation::Free);
        let j = impact(normal, closing, mobility, material.on_wall(None)).map(f64::from);
        // In f64, with the f32 numbers that it was given.
        let (n, c) = (normal.map(f64::from), closing.map(f64::from));
        let approach = -c.dot(n);
        if approach < 1e-3 {
            continue;
        }
        let give = f64::from(inverse[0]) + f64::from(inverse[1]);
        let pressure = j.dot(n);
        let grip = j - n * pressure;
        let restored = (c + n * (pressure * give)).dot(n);
        let e = f64::from(material.restitution);
        worst = worst.max((restored - e * approach).abs() / c.magnitude());
        worst = worst.max(grip.magnitude() / pressure - f64::from(material.friction));
        let before = (c.dot(n).powi(2) + (c + n * approach).magnitude2() / 3.5) / give;
        let slide = c + n * approach + grip * (3.5 * give);
        let after = (restored * restored + slide.magnitude2() / 3.5) / give;
        worst = worst.max((after - before) / before);
    }
    worst
}

pub const ROWS: &[SuiteCase] = &[
    SuiteCase {
        name: "impact/hertz/balls",
        setup: "Chung & Ooi 1: glass and limestone balls head on, 10 m/s, step 1 % of Rayleigh's",
        metric: "worst relative error of time, overlap and force",
        model: "penalty, Hertz–Mindlin",
        target: 1e-3,
        best: "1e-3 EDEM, PFC3D",
        source: "Chung and Ooi 2011; references §2",
        effort: CostClass::Quick,
        measure: |stopwatch| hertz(stopwatch, false),
    },
    SuiteCase {
        name: "impact/hertz/wall",
        setup: "Chung & Ooi 2: aluminium and magnesium alloy balls on a plane, 0.2 m/s",
        metric: "worst relative error of time, overlap and force",
        model: "penalty, Hertz–Mindlin",
        target: 1e-3,
        best: "1e-3 EDEM, PFC3D",
        source: "Chung and Ooi 2011; references §2",
        effort: CostClass::Quick,
        measure: |stopwatch| hertz(stopwatch, true),
    },
    SuiteCase {
        name: "impact/restitution-sweep",
        setup: "Chung & Ooi 3: e 0 to 1 at 3.9 m/s, r 2.5 mm, three steps",
        metric: "error of e",
        model: "event-driven",
        target: 2e-6,
        best: "5e-5 Rapier, Box3D",
        source: "Chung and Ooi 2011; references §2",
        effort: CostClass::Quick,
        measure: restitution_sweep,
    },
    SuiteCase {
        name: "impact/oblique",
        setup: "Chung & Ooi 4: 17 angles at 3.9 m/s, µ 0.092, e 0.98; r 1e-5 to 1e3, 1/30 s to 0.1 ms",
        metric: "worst of velocity and rim speed over the speed",
        model: "event-driven",
        target: 2e-6,
        best: "0.18 Rapier and Box3D",
        source: "Chung and Ooi 2011; references §2",
        effort: CostClass::Quick,
        measure: |stopwatch| oblique(stopwatch, &angles(), false, surface(0.98, 0.092)),
    },
    SuiteCase {
        name: "impact/oblique/speeds",
        setup: "Chung & Ooi 5: 5 m/s onto it, 0.1 to 70 along, µ 0.3, e 1",
        metric: "worst of velocity and rim speed over the speed",
        model: "event-driven",
        target: 2e-6,
        best: "the same defect",
        source: "Chung and Ooi 2011; references §2",
        effort: CostClass::Quick,
        measure: |stopwatch| {
            let cases = [0.1, 0.5, 1.0, 2.0, 5.0, 8.0, 10.0, 12.0, 20.0, 40.0, 70.0]
                .map(|vt| ([vt, -5.0], 0.0));
            oblique(stopwatch, &cases, false, surface(1.0, 0.3))
        },
    },
    SuiteCase {
        name: "impact/spin",
        setup: "Chung & Ooi 6: 0.2 m/s onto it, spin 0.175 to 22.86 rad/s at r 0.1, µ 0.4, e 0.5",
        metric: "worst of velocity and rim speed over the speed",
        model: "event-driven",
        target: 2e-6,
        best: "the same defect",
        source: "Chung and Ooi 2011; references §2",
        effort: CostClass::Quick,
        measure: |stopwatch| {
            let cases = [0.175, 0.5, 1.0, 2.0, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 10.0, 22.86]
                .map(|w| ([0.0, -0.2], 0.1 * w));
            oblique(stopwatch, &cases, true, surface(0.5, 0.4))
        },
    },
    SuiteCase {
        name: "impact/superball",
        setup: "Garwin: three bounces under a table, and the energy after 10,000",
        metric: "worst error of speed and rim speed, and relative of the energy",
        model: "event-driven",
        target: 1e-6,
        best: "no engine has the material",
        source: "Garwin 1969; references 4.16",
        effort: CostClass::Quick,
        measure: superball,
    },
    SuiteCase {
        name: "impact/spin-bounce",
        setup: "Cross: 17 angles with spin, tangential restitution −1 to 1",
        metric: "worst of velocity and rim speed over the speed",
        model: "event-driven",
        target: 2e-6,
        best: "0.18 Rapier and Box3D at 0",
        source: "Cross 2002; references 4.17",
        effort: CostClass::Quick,
        measure: |stopwatch| {
            let cases: Vec<_> = angles()
                .into_iter()
                .zip([3.0, -5.0, 0.5].into_iter().cycle())
                .map(|((v, _), spin)| (v, spin))
                .collect();
            [-1.0, -0.4, 0.3, 1.0]
                .map(|beta| {
                    oblique(
                        stopwatch,
                        &cases,
                        true,
                        Material { tangential_restitution: beta, ..surface(0.7, 0.4) },
                    )
                })
                .into_iter()
                .fold(0.0, f64::max)
        },
    },
    SuiteCase {
        name: "impact/conservation",
        setup: "a million impacts, masses 1e-3 to 1e3, all e, µ and β",
        metric: "worst relative violation of restitution, Coulomb and energy",
        model: "closed form, f32",
        target: 1e-6,
        best: "–",
        source: "references §6.4, family 12",
        effort: CostClass::Quick,
        measure: fuzz,
    },
    SuiteCase {
        name: "impact/cradle/0",
        setup: "five balls that touch, the first at 1 m/s, 1/60 s: 0 0 0 0 1",
        metric: "largest error of a speed, m/s",
        model: "event-driven",
        target: 1e-5,
        best: "0.48 Rapier, 0.57 Box3D",
        source: "references 4.10",
        effort: CostClass::Quick,
        measure: |stopwatch| cradle(stopwatch, 0.0),
    },
    SuiteCase {
        name: "impact/cradle/gaps",
        setup: "the same with gaps of 0.1 mm and 1 cm",
        metric: "largest error of a speed, m/s",
        model: "event-driven",
        target: 1e-5,
        best: "6e-2 Box3D (0.1 mm), exact (1 cm)",
        source: "references 4.10",
        effort: CostClass::Quick,
        measure: |stopwatch| cradle(stopwatch, 1e-4).max(cradle(stopwatch, 1e-2)),
    },
    SuiteCase {
        name: "impact/galperin/f32",
        setup: "masses 1 and 100^n, n 0 to 4: 3, 31, 314, 3141, 31415 collisions",
        metric: "collisions off",
        model: "event-driven",
        target: 0.0,
        best: "n = 1",
        source: "Galperin 2003; references 4.11",
        effort: CostClass::Quick,
        measure: |stopwatch| (0..=4).map(|n| galperin::<f32>(stopwatch, n)).sum(),
    },
    SuiteCase {
        name: "impact/galperin/f64",
        setup: "the same in f64, n = 5 and 6: 314159, 3141592",
        metric: "collisions off",
        model: "event-driven, f64",
        target: 0.0,
        best: "n = 1",
        source: "Galperin 2003; references 4.11",
        effort: CostClass::Quick,
        measure: |stopwatch| galperin::<f64>(stopwatch, 5) + galperin::<f64>(stopwatch, 6),
    },
];
