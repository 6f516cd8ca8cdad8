//! Balls that roll on: carried, resisted, far from the origin, and never worse by rounding.

use taw::motion::WallMotion;
use taw::prelude::*;

use super::rolling::{STEPS, incline, on_slope, slip_to_roll, worst};
use super::{CostClass, SuiteCase};
use crate::scene::{
    Ball, EXACT, G, IMPULSE, Stopwatch, slope, state, surface, vector, wall, world,
};

/// Stopping distance of a rolling ball, time until a ball that spins on the spot stands,
/// and how far a ball moves that lies on a slope below its rolling angle; relative errors,
/// and metres.
fn resistances(stopwatch: &mut Stopwatch, model: Model, dt: f64) -> f64 {
    let rough = |rolling, spinning| Material {
        rolling_resistance: rolling,
        spinning_resistance: spinning,
        ..surface(0.0, 0.5)
    };
    let mut world = slope::<f32>(model, 0.0);
    let rolling = Ball {
        velocity: [2.0, 0.0, 0.0],
        angular_velocity: [0.0, 0.0, -4.0],
        material: rough(0.05, 0.0),
        ..Ball::default()
    }
    .insert(&mut world);
    let spinning = Ball {
        at: [0.0, 0.5, 5.0],
        angular_velocity: [0.0, 10.0, 0.0],
        material: rough(0.0, 0.02),
        ..Ball::default()
    }
    .insert(&mut world);
    let still = 10.0 / (2.5 * 0.02 * G / 0.5);
    let mut seen = 0.0;
    let mut spin_time = f64::NAN;
    let mut before = 10.0;
    for _ in 0..(15.0 / dt).round() as u32 {
        stopwatch.step(&mut world, dt);
        let now = state(&world, spinning)[2].y;
        if now.abs() < 1e-6 && spin_time.is_nan() {
            // Within this step it lost what it had before.
            spin_time = seen + before / 10.0 * still;
        }
        (before, seen) = (now, seen + f64::from(dt as f32));
    }
    let way = state(&world, rolling)[0].x;
    let exact = 2.0_f64.powi(2) / (2.0 * 5.0 / 7.0 * 0.05 * G);
    let mut slope = slope::<f32>(model, 2.8); // tan = 0.0489
    let start = on_slope(2.8, 0.5);
    let lying = Ball { material: rough(0.05, 0.0), ..start }.insert(&mut slope);
    stopwatch.run(&mut slope, dt, 10.0);
    let crept = (state(&slope, lying)[0] - Vec3::from(start.at)).magnitude();
    [(way / exact - 1.0).abs(), (spin_time / still - 1.0).abs(), crept]
        .into_iter()
        .fold(0.0, f64::max)
}

/// Change of heading in rad of a ball that first slides and then rolls, at 24 angles to the axes.
fn heading(stopwatch: &mut Stopwatch, model: Model) -> f64 {
    let mut worst: f64 = 0.0;
    for i in 0..24 {
        let mut world = slope::<f32>(model, 0.0);
        let angle = f64::from(i) * 0.2617 + 0.01;
        let toward = Vec3::new(angle.cos(), 0.0, angle.sin());
        let id = Ball { velocity: (toward * 5.0).into(), ..on_slope(0.0, 0.3) }.insert(&mut world);
        stopwatch.run(&mut world, 1.0 / 60.0, 2.0);
        let [x, v, _] = state(&world, id);
        let off = |d: Vec3<f64>| {
            let along = Vec3::new(d.x, 0.0, d.z);
            along.cross(toward).magnitude() / along.magnitude()
        };
        worst = worst.max(off(v)).max(off(x));
    }
    worst
}

/// A ball of 8 mm on ten degrees, up to 5 m/s: relative error of its speed.
fn no_spin_cap(stopwatch: &mut Stopwatch, model: Model) -> f64 {
    let mut world = slope::<f32>(model, 10.0);
    let (sin, cos) = 10_f64.to_radians().sin_cos();
    let id = Ball { radius: 8e-3, at: [8e-3 * sin, 8e-3 * cos, 0.0], ..on_slope(10.0, 0.5) }
        .insert(&mut world);
    let pull = 5.0 / 7.0 * G * sin;
    let t = stopwatch.run(&mut world, 1.0 / 60.0, 5.0 / pull);
    (state(&world, id)[1].magnitude() / (pull * t) - 1.0).abs()
}

/// Five seconds at 1 m/s far out: relative error of the way.
fn far_roll(stopwatch: &mut Stopwatch, model: Model, far: f64) -> f64 {
    let mut world = slope::<f32>(model, 0.0);
    let id = Ball {
        at: [far, 0.5, 0.0],
        velocity: [1.0, 0.0, 0.0],
        angular_velocity: [0.0, 0.0, -2.0],
        ..on_slope(0.0, 0.5)
    }
    .insert(&mut world);
    let t = stopwatch.run(&mut world, 1.0 / 60.0, 5.0);
    ((state(&world, id)[0].x - far) / t - 1.0).abs()
}

/// A ball that rests on a conveyor, a lift and beside a moving wall: the largest error of
/// its velocity, in m/s.
fn carried(stopwatch: &mut Stopwatch, model: Model) -> f64 {
    let motion = |velocity: [f64; 3]| {
        Some(WallMotion {
            velocity: vector(velocity),
            angular_velocity: vector([0.0; 3]),
            pivot: Point3::new(0.0, 0.0, 0.0),
        })
    };
    let mut conveyor = world::<f32>(Model { rotation: Rotation::None, ..model });
    let belt = wall(&mut conveyor, [0.0, 1.0, 0.0], 0.0);
    conveyor.walls.set_motion(belt, motion([0.7, 0.0, 0.0])).expect("finite");
    let id = on_slope(0.0, 0.3).insert(&mut conveyor);
    stopwatch.run(&mut conveyor, 1.0 / 60.0, 1.0);
    let off_belt = (state(&conveyor, id)[1] - Vec3::new(0.7, 0.0, 0.0)).magnitude();
    let mut lift = world::<f32>(model);
    let floor = wall(&mut lift, [0.0, 1.0, 0.0], 0.0);
    lift.walls.set_motion(floor, motion([0.0, 2.0, 0.0])).expect("finite");
    let id = on_slope(0.0, 0.3).insert(&mut lift);
    let mut off_lift: f64 = 0.0;
    for step in 1..=120_u8 {
        let plane =
            Plane::new(Vec3::unit_y(), 2.0 * f32::from(step) / 60.0).expect("a unit vector");
        lift.walls.set(floor, plane).expect("it is there");
        stopwatch.step(&mut lift, 1.0 / 60.0);
        let [x, v, _] = state(&lift, id);
        if step > 5 {
            off_lift =
                off_lift.max((v.y - 2.0).abs()).max((x.y - 0.5 - f64::from(plane.offset())).abs());
        }
    }
    off_belt.max(off_lift)
}

/// By how much a shorter step is worse, at most, than a longer one: errors of slip to
/// roll, incline and far roll over steps of 1/30 s to 1 ms, where they are above `floor`.
fn never_worse(stopwatch: &mut Stopwatch, model: Model, floor: f64) -> f64 {
    let mut worst: f64 = 0.0;
    let curves: [&mut dyn FnMut(&mut Stopwatch, f64) -> f64; 4] = [
        &mut |stopwatch, dt| slip_to_roll(stopwatch, model, dt)[0],
        &mut |stopwatch, dt| slip_to_roll(stopwatch, model, dt)[1],
        &mut |stopwatch, dt| incline(stopwatch, model, dt, 20.0, 0.5),
        &mut |stopwatch, dt| incline(stopwatch, model, dt, 60.0, 0.45),
    ];
    for curve in curves {
        let errors = STEPS.map(|dt| curve(stopwatch, dt).max(floor));
        for (i, longer) in errors.iter().enumerate() {
            worst =
                errors[i..].iter().fold(worst, |worst, shorter| worst.max(shorter / longer - 1.0));
        }
    }
    worst
}

pub const ROWS: &[SuiteCase] = &[
    SuiteCase {
        name: "rolling/carried",
        setup: "a ball on a conveyor of 0.7 m/s, and on a lift of 2 m/s",
        metric: "largest error of velocity and place, m/s and m",
        model: "event-driven",
        target: 1e-6,
        best: "–",
        source: "kinematics",
        effort: CostClass::Quick,
        measure: |stopwatch| carried(stopwatch, EXACT),
    },
    SuiteCase {
        name: "rolling/no-spin-cap",
        setup: "radius 8 mm on 10° up to 5 m/s (625 rad/s)",
        metric: "relative error of the speed",
        model: "event-driven",
        target: 1e-6,
        best: "0.19 Avian; 0.93 Rapier: stops at 47.1 rad/s (`peers`)",
        source: "rigid ball; issue 4",
        effort: CostClass::Quick,
        measure: |stopwatch| no_spin_cap(stopwatch, EXACT),
    },
    SuiteCase {
        name: "rolling/no-spin-cap",
        setup: "radius 8 mm on 10° up to 5 m/s (625 rad/s)",
        metric: "relative error of the speed",
        model: "impulse",
        target: 1e-4,
        best: "0.19 Avian; 0.93 Rapier: stops at 47.1 rad/s (`peers`)",
        source: "rigid ball; issue 4",
        effort: CostClass::Quick,
        measure: |stopwatch| no_spin_cap(stopwatch, IMPULSE),
    },
    SuiteCase {
        name: "rolling/resistances",
        setup: "v²/(2·5/7·c g) to a stop, spin gone in ω r/(5/2 c g), at rest below atan c; worst of 1/30 s to 1 ms",
        metric: "largest relative error, and metres crept",
        model: "event-driven",
        target: 1e-4,
        best: "–",
        source: "rigid ball; issue 4",
        effort: CostClass::Quick,
        measure: |stopwatch| worst(&STEPS, |dt| resistances(stopwatch, EXACT, dt)),
    },
    SuiteCase {
        name: "rolling/resistances",
        setup: "the same at 1/240 s",
        metric: "largest relative error, and metres crept",
        model: "impulse",
        target: 1e-2,
        best: "–",
        source: "rigid ball; issue 4",
        effort: CostClass::Quick,
        measure: |stopwatch| resistances(stopwatch, IMPULSE, 1.0 / 240.0),
    },
    SuiteCase {
        name: "rolling/straight",
        setup: "slides, then rolls, at 24 angles to the axes",
        metric: "turn of its heading, rad",
        model: "event-driven",
        target: 1e-6,
        best: "1.0e-6 Rapier, 1.4e-6 Avian (`peers`)",
        source: "issue 4",
        effort: CostClass::Quick,
        measure: |stopwatch| heading(stopwatch, EXACT),
    },
    SuiteCase {
        name: "rolling/straight",
        setup: "slides, then rolls, at 24 angles to the axes",
        metric: "turn of its heading, rad",
        model: "impulse",
        target: 2e-6,
        best: "1.0e-6 Rapier, 1.4e-6 Avian (`peers`)",
        source: "issue 4",
        effort: CostClass::Quick,
        measure: |stopwatch| heading(stopwatch, IMPULSE),
    },
    SuiteCase {
        name: "rolling/far/1e4",
        setup: "1 m/s for 5 s from x = 1e4 m",
        metric: "relative error of the way",
        model: "event-driven",
        target: 1e-5,
        best: "4e-3 Box3D",
        source: "references §6.3",
        effort: CostClass::Quick,
        measure: |stopwatch| far_roll(stopwatch, EXACT, 1e4),
    },
    SuiteCase {
        name: "rolling/far/1e6",
        setup: "1 m/s for 5 s from x = 1e6 m; the world's own f32 cannot show better than 6e-3",
        metric: "relative error of the way",
        model: "event-driven",
        target: 1e-4,
        best: "stuck: all",
        source: "references §6.3",
        effort: CostClass::Quick,
        measure: |stopwatch| far_roll(stopwatch, EXACT, 1e6),
    },
    SuiteCase {
        name: "rolling/far/1e4",
        setup: "1 m/s for 5 s from x = 1e4 m",
        metric: "relative error of the way",
        model: "impulse, compensated",
        target: 1e-5,
        best: "4e-3 Box3D",
        source: "references §6.3",
        effort: CostClass::Quick,
        measure: |stopwatch| {
            far_roll(stopwatch, Model { precision: Precision::Compensated, ..IMPULSE }, 1e4)
        },
    },
    SuiteCase {
        name: "rolling/never-worse",
        setup: "speed and way of slip to roll and inclines, 1/30 s to 1 ms: shorter steps are no worse above a floor of 1e-7",
        metric: "how much worse a shorter step is, relatively",
        model: "event-driven",
        target: 0.0,
        best: "non-monotone: Rapier, Box3D",
        source: "design, rule 3",
        effort: CostClass::Quick,
        measure: |stopwatch| never_worse(stopwatch, EXACT, 1e-7),
    },
    SuiteCase {
        name: "rolling/never-worse",
        setup: "the same above a floor of 5e-5, which plain f32 has",
        metric: "how much worse a shorter step is, relatively",
        model: "impulse",
        target: 0.0,
        best: "non-monotone: Rapier, Box3D",
        source: "design, rule 3",
        effort: CostClass::Quick,
        measure: |stopwatch| never_worse(stopwatch, IMPULSE, 5e-5),
    },
];
