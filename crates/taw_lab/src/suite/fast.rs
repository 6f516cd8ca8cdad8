//! Fast balls: grazes, passages through thin walls, a break, and long flights.

use taw::prelude::*;

use super::{CostClass, SuiteCase};
use crate::scene::{
    Ball, EXACT, IMPULSE, Stopwatch, slope, state, surface, vector, weightless, world,
};

/// A ball passes one at rest and grazes it: the largest error of a velocity over the
/// speed, for impact parameters of a diameter less this part.
fn graze(stopwatch: &mut Stopwatch, model: Model, parts: &[f64]) -> f64 {
    let mut worst: f64 = 0.0;
    for part in parts {
        // A power of two of speed and radius, so that the set-up itself rounds nothing.
        let mut world = weightless::<f32>(Model { rotation: Rotation::None, ..model });
        let b = f64::from((1.0 - part) as f32);
        let moving = Ball {
            at: [-2.0, b, 0.0],
            velocity: [10.0, 0.0, 0.0],
            material: surface(1.0, 0.0),
            ..Ball::default()
        };
        let first = moving.insert(&mut world);
        let second = Ball { at: [0.0; 3], material: surface(1.0, 0.0), ..Ball::default() }
            .insert(&mut world);
        stopwatch.run(&mut world, 1.0 / 60.0, 1.0);
        let normal = Vec3::new((1.0 - b * b).sqrt(), -b, 0.0);
        let given = normal * (10.0 * normal.x);
        let off = (state(&world, second)[1] - given)
            .magnitude()
            .max((state(&world, first)[1] - (Vec3::new(10.0, 0.0, 0.0) - given)).magnitude());
        worst = worst.max(off / 10.0);
    }
    worst
}

/// Position after an impact, compared or not.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Places {
    Compared,
    Ignored,
}

/// Two balls at 300 m/s head on; a ball at 300 m/s against one of a tenth of its radius;
/// and a thousand grazing passes at 300 m/s: the largest error of velocity over the speed
/// and of the place a second later over the way.
fn fast(stopwatch: &mut Stopwatch, model: Model, compare_places: Places) -> f64 {
    let mut worst: f64 = 0.0;
    let elastic = surface(1.0, 0.0);
    let model = Model { rotation: Rotation::None, ..model };
    for (radius, mass) in [(0.5, 1.0), (0.05, 1e-3)] {
        let mut world = weightless::<f32>(model);
        let ball = Ball {
            velocity: [300.0, 0.0, 0.0],
            at: [-10.0, 0.0, 0.0],
            material: elastic,
            ..Ball::default()
        };
        let first = ball.insert(&mut world);
        let second =
            Ball { radius, mass, velocity: [-300.0, 0.0, 0.0], at: [10.0, 0.0, 0.0], ..ball }
                .insert(&mut world);
        let t = stopwatch.run(&mut world, 1.0 / 60.0, 1.0);
        let meet = (20.0 - 0.5 - radius) / 600.0;
        let common = 300.0 * (1.0 - mass) / (1.0 + mass);
        for (id, start, v) in [(first, -10.0, 300.0), (second, 10.0, -300.0)] {
            let after = 2.0 * common - v;
            let place = start + v * meet + after * (t - meet);
            let [x, v, _] = state(&world, id);
            worst = worst.max((v.x - after).abs() / 300.0);
            if compare_places == Places::Compared {
                worst = worst.max((x.x - place).abs() / (300.0 * t));
            }
        }
    }
    let mut random = fastrand::Rng::with_seed(7);
    for _ in 0..1000 {
        let mut world = weightless::<f32>(model);
        let b = f64::from((1.0 - 10_f64.powf(-1.0 - 2.0 * random.f64())) as f32);
        let x = -2.0 - random.f64();
        let first = Ball {
            at: [x, b, 0.0],
            velocity: [300.0, 0.0, 0.0],
            material: elastic,
            ..Ball::default()
        }
        .insert(&mut world);
        Ball { at: [0.0; 3], material: elastic, ..Ball::default() }.insert(&mut world);
        stopwatch.run(&mut world, 1.0 / 60.0, 0.1);
        let normal = Vec3::new((1.0 - b * b).sqrt(), -b, 0.0);
        let exact = Vec3::new(300.0, 0.0, 0.0) - normal * (300.0 * normal.x);
        worst = worst.max((state(&world, first)[1] - exact).magnitude() / 300.0);
    }
    worst
}

/// A rack of fifteen, mirrored about the cue ball's way: the largest deviation of a ball
/// from its mirror image after the break, in metres.
fn rack(stopwatch: &mut Stopwatch) -> f64 {
    let mut world = slope::<f32>(EXACT, 0.0);
    let r = 0.028_575;
    let material = surface(0.95, 0.06);
    let mut ids = Vec::new();
    for row in 0..5_u32 {
        for i in 0..=row {
            let x = f64::from(row) * r * 3.0_f64.sqrt() * 1.0001;
            let z = (f64::from(2 * i) - f64::from(row)) * r * 1.0001;
            let ball = Ball { at: [x, r, z], radius: r, mass: 0.17, material, ..Ball::default() };
            ids.push((row, i, ball.insert(&mut world)));
        }
    }
    let cue = Ball {
        at: [-0.5, r, 0.0],
        radius: r,
        mass: 0.17,
        velocity: [8.0, 0.0, 0.0],
        material,
        ..Ball::default()
    };
    cue.insert(&mut world);
    stopwatch.run(&mut world, 1.0 / 60.0, 2.0);
    let at = |row: u32, i: u32| {
        let id = ids.iter().find(|(r, j, _)| *r == row && *j == i).expect("a ball").2;
        state(&world, id)[0]
    };
    ids.iter()
        .map(|(row, i, _)| {
            let (ball, image) = (at(*row, *i), at(*row, row - i));
            (ball - Vec3::new(image.x, image.y, -image.z)).magnitude()
        })
        .fold(0.0, f64::max)
}

/// Flight under gravity for four seconds in steps of every length: relative error of way
/// and velocity.
fn flight(stopwatch: &mut Stopwatch, model: Model) -> f64 {
    let mut worst: f64 = 0.0;
    for dt in [0.5, 1.0 / 30.0, 1.0 / 60.0, 1e-3, 1e-4] {
        let mut world = world::<f32>(model);
        let start = Vec3::new(1.0, 2.0, -3.0);
        let id = Ball { at: start.into(), velocity: [3.0, 4.0, 5.0], ..Ball::default() }
            .insert(&mut world);
        let t = stopwatch.run(&mut world, dt, 4.0);
        let v0 = Vec3::new(3.0, 4.0, 5.0);
        let g = vector::<f64>([0.0, -crate::scene::G, 0.0]);
        let [x, v, _] = state(&world, id);
        let way = v0 * t + g * (0.5 * t * t);
        worst = worst.max((x - start - way).magnitude() / way.magnitude());
        worst = worst.max((v - v0 - g * t).magnitude() / v.magnitude());
    }
    worst
}

pub const ROWS: &[SuiteCase] = &[
    SuiteCase {
        name: "impact/graze",
        setup: "10 m/s past a ball at rest, by a diameter less 0.5 to 1e-3 of it",
        metric: "error of velocity over the speed",
        model: "event-driven",
        target: 1e-4,
        best: "1.4e-3 to 0.15 Rapier",
        source: "references §6.3",
        effort: CostClass::Quick,
        measure: |stopwatch| graze(stopwatch, EXACT, &[0.5, 0.1, 0.01, 1e-3]),
    },
    SuiteCase {
        name: "impact/graze/1e-4",
        setup: "the same by a diameter less 1e-4 of it",
        metric: "error of velocity over the speed",
        model: "event-driven",
        target: 1e-3,
        best: "0.18 Rapier; Bullet misses",
        source: "references §6.3",
        effort: CostClass::Quick,
        measure: |stopwatch| graze(stopwatch, EXACT, &[1e-4]),
    },
    SuiteCase {
        name: "impact/fast",
        setup: "300 m/s head on, against a ball of a tenth, and 1,000 grazing passes, 1/60 s",
        metric: "error of velocity over the speed, and of the place over the way",
        model: "event-driven",
        target: 1e-4,
        best: "1.8e-3 Avian; 2.0 and 4.0 Rapier, ccd on or off: through (`peers`)",
        source: "issue 4",
        effort: CostClass::Quick,
        measure: |stopwatch| fast(stopwatch, EXACT, Places::Compared),
    },
    SuiteCase {
        name: "impact/fast",
        setup: "the same; what is left of a step after a hit is lost, so places are not compared",
        metric: "error of velocity over the speed",
        model: "impulse, swept",
        target: 1e-3,
        best: "1.8e-3 Avian; 2.0 and 4.0 Rapier, ccd on or off: through (`peers`)",
        source: "issue 4",
        effort: CostClass::Quick,
        measure: |stopwatch| {
            fast(stopwatch, Model { detection: Detection::Swept, ..IMPULSE }, Places::Ignored)
        },
    },
    SuiteCase {
        name: "impact/graze",
        setup: "10 m/s past a ball at rest, by a diameter less 0.5 to 1e-3 of it",
        metric: "error of velocity over the speed",
        model: "impulse, swept",
        target: 1e-2,
        best: "1.4e-3 to 0.15 Rapier",
        source: "references §6.3",
        effort: CostClass::Quick,
        measure: |stopwatch| {
            let swept = Model { detection: Detection::Swept, ..IMPULSE };
            graze(stopwatch, swept, &[0.5, 0.1, 0.01, 1e-3])
        },
    },
    SuiteCase {
        name: "impact/rack",
        setup: "fifteen balls and a cue ball at 8 m/s, mirrored about its way, 2 s",
        metric: "deviation from the mirror image, m",
        model: "event-driven",
        target: 0.0,
        best: "depends on the order of solving",
        source: "references 4.20",
        effort: CostClass::Quick,
        measure: rack,
    },
    SuiteCase {
        name: "impact/flight",
        setup: "4 s in steps of 0.5 s to 0.1 ms: x0 + v0 t + g t²/2",
        metric: "worst relative error of way and velocity",
        model: "event-driven",
        target: 1e-6,
        best: "g dt t / 2 off: semi-implicit Euler",
        source: "references 4.32",
        effort: CostClass::Quick,
        measure: |stopwatch| flight(stopwatch, EXACT),
    },
    SuiteCase {
        name: "impact/flight",
        setup: "4 s in steps of 0.5 s to 0.1 ms: x0 + v0 t + g t²/2",
        metric: "worst relative error of way and velocity",
        model: "impulse, Verlet, compensated",
        target: 1e-6,
        best: "g dt t / 2 off: semi-implicit Euler",
        source: "references 4.32",
        effort: CostClass::Quick,
        measure: |stopwatch| flight(stopwatch, Model { response: Response::Impulse, ..EXACT }),
    },
];
