//! Balls that stay on what they roll on.

use taw::motion::WallMotion;
use taw::prelude::*;

use super::{CostClass, SuiteCase};
use crate::scene::{Ball, EXACT, G, IMPULSE, Stopwatch, slope, state, surface, vector};

pub(super) const STEPS: [f64; 5] = [1.0 / 30.0, 1.0 / 60.0, 1.0 / 120.0, 1.0 / 240.0, 1e-3];

/// A ball that touches the floor of [`slope`].
pub(super) fn on_slope(degrees: f64, friction: f64) -> Ball {
    let (sin, cos) = degrees.to_radians().sin_cos();
    Ball { at: [0.5 * sin, 0.5 * cos, 0.0], material: surface(0.0, friction), ..Ball::default() }
}

/// Largest relative error of speed, distance and spin after four seconds on a slope.
pub(super) fn incline(
    stopwatch: &mut Stopwatch,
    model: Model,
    dt: f64,
    degrees: f64,
    friction: f64,
) -> f64 {
    let mut world = slope::<f32>(model, degrees);
    let ball = on_slope(degrees, friction);
    let id = ball.insert(&mut world);
    let t = stopwatch.run(&mut world, dt, 4.0);
    let (sin, cos) = degrees.to_radians().sin_cos();
    let slips = friction < 2.0 / 7.0 * sin / cos;
    let pull = if slips { G * (sin - friction * cos) } else { 5.0 / 7.0 * G * sin };
    let spin = if slips { 2.5 * friction * G * cos / 0.5 } else { pull / 0.5 };
    let [x, v, w] = state(&world, id);
    let way = (x - Vec3::from(ball.at)).magnitude();
    let errors =
        [v.magnitude() / (pull * t), 2.0 * way / (pull * t * t), w.magnitude() / (spin * t)];
    errors.into_iter().map(|e| (e - 1.0).abs()).fold(0.0, f64::max)
}

pub(super) fn worst(steps: &[f64], mut error: impl FnMut(f64) -> f64) -> f64 {
    steps.iter().map(|dt| error(*dt)).fold(0.0, f64::max)
}

/// Slip to roll from 5 m/s with friction 0.3, after 2 s: relative errors of speed, way,
/// and of the moment at which it rolls, as the way and the speed give it away.
pub(super) fn slip_to_roll(stopwatch: &mut Stopwatch, model: Model, dt: f64) -> [f64; 3] {
    let mut world = slope::<f32>(model, 0.0);
    let heading = 0.6_f64;
    let toward = Vec3::new(heading.cos(), 0.0, heading.sin());
    let velocity = (toward * 5.0).into();
    let id = Ball { velocity, ..on_slope(0.0, 0.3) }.insert(&mut world);
    let t = stopwatch.run(&mut world, dt, 2.0);
    let [x, v, _] = state(&world, id);
    let (start, end, slowing) = (5.0, 25.0 / 7.0, 0.3 * G);
    let stop = (start - end) / slowing;
    let way = |stop: f64| start * stop - 0.5 * slowing * stop * stop + end * (t - stop);
    // d way / d stop = start − slowing · stop − end = 0 at the true one, so the moment
    // is read off a run that ends halfway into the slide's last step instead.
    let mut world = slope::<f32>(model, 0.0);
    let id = Ball { velocity, ..on_slope(0.0, 0.3) }.insert(&mut world);
    let (mut now, mut rolls) = (0.0, f64::NAN);
    let mut before = 5.0;
    while now < 1.0 {
        stopwatch.step(&mut world, dt);
        now += f64::from(dt as f32);
        let speed = state(&world, id)[1].magnitude();
        if rolls.is_nan() && (speed - end).abs() < 1e-6 * end {
            // Within this step it slid from `before` to the end's speed.
            rolls = now - f64::from(dt as f32) + (before - end) / slowing;
        }
        before = speed;
    }
    let relative = |value: f64, exact: f64| (value / exact - 1.0).abs();
    [relative(v.magnitude(), end), relative(x.dot(toward), way(stop)), relative(rolls, stop)]
}

/// A ball that rolls on a turntable: errors of the rate at which it goes round, of its
/// speed, and of the radius of its circle (worst over the run), all relative.
fn turntable(stopwatch: &mut Stopwatch, dt: f64) -> [f64; 3] {
    let omega = 2.0;
    let mut world = slope::<f32>(EXACT, 0.0);
    let table = world.walls.id(0).expect("the floor");
    let motion = WallMotion {
        velocity: vector([0.0; 3]),
        angular_velocity: vector([0.0, omega, 0.0]),
        pivot: Point3::new(0.0, 0.0, 0.0),
    };
    world.walls.set_motion(table, Some(motion)).expect("finite");
    // It rolls from the start: the velocity of the table under it is v + r n × w.
    let (at, v) = (Vec3::new(2.0, 0.5, 0.0), Vec3::new(0.0, 0.0, 0.5));
    let table_velocity = Vec3::new(0.0, omega, 0.0).cross(Vec3::new(2.0, 0.0, 0.0));
    // n × w = (table − v) / r, so w = (table − v) × n / r.
    let spin = (table_velocity - v).cross(Vec3::unit_y()) / 0.5;
    let id = Ball {
        at: at.into(),
        velocity: v.into(),
        angular_velocity: spin.into(),
        ..on_slope(0.0, 1e3)
    }
    .insert(&mut world);
    let rate = 2.0 / 7.0 * omega;
    let radius = 0.5 / rate;
    // The velocity turns about +y with the table.
    let center = at + Vec3::unit_y().cross(v) / rate;
    let (mut speed_error, mut radius_error): (f64, f64) = (0.0, 0.0);
    let steps = (30.0 / dt).round() as u32;
    let (mut angle, mut last) = (0.0, v);
    for _ in 0..steps {
        stopwatch.step(&mut world, dt);
        let [x, v, _] = state(&world, id);
        speed_error = speed_error.max((v.magnitude() / 0.5 - 1.0).abs());
        radius_error = radius_error.max(((x - center).magnitude() / radius - 1.0).abs());
        angle += Vec3::unit_y().dot(last.cross(v)).atan2(last.dot(v));
        last = v;
    }
    let time = f64::from(steps) * f64::from(dt as f32);
    [(angle / time / rate - 1.0).abs(), speed_error, radius_error]
}

/// SimBenchmark's rolling test: a box of 10 kg that slides on the ground under 150 N and
/// carries 25 balls of 1 kg. Mean over the steps of the squared errors of the box's and
/// a ball's velocity, in m²/s².
///
/// The box is a wall that moves. In each step its speed is the one at which its momentum
/// and the balls' change by what the force and the ground give them.
fn box_with_balls(stopwatch: &mut Stopwatch, degrees: f64, dt: f64) -> f64 {
    let toward = Vec3::new(degrees.to_radians().cos(), 0.0, degrees.to_radians().sin());
    let mut world = slope::<f32>(EXACT, 0.0);
    let top = world.walls.id(0).expect("the top of the box");
    for i in 0..25_u32 {
        let at = [f64::from(i % 5 * 2) - 4.0, 0.5, f64::from(i / 5 * 2) - 4.0];
        Ball { at, material: surface(0.0, 0.8), ..Ball::default() }.insert(&mut world);
    }
    let balls = |world: &World<f32>| -> f64 {
        (0..25).map(|row| world.marbles.velocity()[row].map(f64::from).dot(toward)).sum()
    };
    let push = 150.0 - 0.4 * 35.0 * G;
    let ball_force = push / 10.0 / (3.5 + 2.5);
    let box_acceleration = (push - 25.0 * ball_force) / 10.0;
    let (mut speed, mut change, mut sum) = (0.0, box_acceleration * dt, 0.0);
    let steps = (4.0 / dt).round() as u32;
    for step in 0..steps {
        let t = f64::from(step) * dt;
        let first = world.marbles.velocity()[0].map(f64::from);
        sum += (speed - box_acceleration * t).powi(2)
            + (first - toward * (ball_force * t)).magnitude2();
        let before = balls(&world);
        let mut stepped = |speed: f64, world: &World<f32>| {
            let mut next = world.clone();
            let velocity = vector((toward * speed).into());
            let motion = WallMotion {
                velocity,
                angular_velocity: vector([0.0; 3]),
                pivot: Point3::new(0.0, 0.0, 0.0),
            };
            next.walls.set_motion(top, Some(motion)).expect("finite");
            stopwatch.step(&mut next, dt);
            next
        };
        let imbalance =
            |change: f64, next: &World<f32>| 10.0 * change + balls(next) - before - push * dt;
        let (mut low, mut high) = (change, 1.5 * change + 1e-9);
        let mut low_imbalance = imbalance(low, &stepped(speed + low, &world));
        for _ in 0..3 {
            let high_imbalance = imbalance(high, &stepped(speed + high, &world));
            if high_imbalance == low_imbalance {
                break;
            }
            let next = high - high_imbalance * (high - low) / (high_imbalance - low_imbalance);
            (low, low_imbalance) = (high, high_imbalance);
            high = next;
        }
        change = high;
        world = stepped(speed + change, &world);
        speed += change;
    }
    sum / f64::from(steps)
}

/// A ball on a slope whose angle is just below or above that at which it begins to slip:
/// the largest error of the friction at which it changes over.
fn critical_friction(stopwatch: &mut Stopwatch) -> f64 {
    let degrees = 60.0_f64;
    let exact = 2.0 / 7.0 * degrees.to_radians().tan();
    let slips = |stopwatch: &mut Stopwatch, friction: f64| {
        let mut world = slope::<f32>(EXACT, degrees);
        let id = on_slope(degrees, friction).insert(&mut world);
        stopwatch.run(&mut world, 1.0 / 60.0, 1.0);
        let [_, v, w] = state(&world, id);
        (v.magnitude() - 0.5 * w.magnitude()) / v.magnitude() > 1e-7
    };
    let (mut slipping, mut rolling) = (0.4, 0.6);
    while rolling - slipping > 1e-8 {
        let middle = 0.5 * (slipping + rolling);
        if slips(stopwatch, middle) { slipping = middle } else { rolling = middle }
    }
    (0.5 * (slipping + rolling) - exact).abs()
}

pub const ROWS: &[SuiteCase] = &[
    SuiteCase {
        name: "rolling/box/1ms",
        setup: "box of 10 kg pushed by 150 N carries 25 balls, heading 60°",
        metric: "mean squared velocity error, m²/s²",
        model: "event-driven",
        target: 1e-8,
        best: "2.5e-6 Box3D (RaiSim f64 4.1e-7)",
        source: "SimBenchmark; references §1.1",
        effort: CostClass::Quick,
        measure: |stopwatch| box_with_balls(stopwatch, 60.0, 1e-3),
    },
    SuiteCase {
        name: "rolling/box/60Hz",
        setup: "the same in steps of 1/60 s",
        metric: "mean squared velocity error, m²/s²",
        model: "event-driven",
        target: 1e-6,
        best: "5.7e-5 Box3D",
        source: "SimBenchmark; references §1.1",
        effort: CostClass::Quick,
        measure: |stopwatch| box_with_balls(stopwatch, 60.0, 1.0 / 60.0),
    },
    SuiteCase {
        name: "rolling/box/isotropy",
        setup: "the same at headings 0, 15, 30 and 45°",
        metric: "largest mean squared error where it is above the f32 floor of 1e-12, as a spread",
        model: "event-driven",
        target: 0.1,
        best: "sticks or errs by 0.39–3.1: ODE, DART, Rapier-Coulomb",
        source: "SimBenchmark; references §1.1, §7",
        effort: CostClass::Quick,
        measure: |stopwatch| {
            let errors = [0.0, 15.0, 30.0, 45.0]
                .map(|degrees| box_with_balls(stopwatch, degrees, 1.0 / 60.0));
            let (low, high) =
                errors.iter().fold((f64::MAX, 0.0_f64), |(l, h), e| (l.min(*e), h.max(*e)));
            if high < 1e-12 { 0.0 } else { high / low - 1.0 }
        },
    },
    SuiteCase {
        name: "rolling/slip-to-roll/speed",
        setup: "5 m/s, friction 0.3, 2 s: 5/7 of the speed; worst of 1/30 s to 1 ms",
        metric: "relative error of the speed",
        model: "event-driven",
        target: 1e-6,
        best: "6.1e-4 Box3D (1/60)",
        source: "MFiX DEM04; references §3",
        effort: CostClass::Quick,
        measure: |stopwatch| worst(&STEPS, |dt| slip_to_roll(stopwatch, EXACT, dt)[0]),
    },
    SuiteCase {
        name: "rolling/slip-to-roll/way",
        setup: "the same",
        metric: "relative error of the way",
        model: "event-driven",
        target: 2e-6,
        best: "4.5e-4 Box3D (1/60)",
        source: "MFiX DEM04; references §3",
        effort: CostClass::Quick,
        measure: |stopwatch| worst(&STEPS, |dt| slip_to_roll(stopwatch, EXACT, dt)[1]),
    },
    SuiteCase {
        name: "rolling/slip-to-roll/moment",
        setup: "the same: it rolls after 2 v / (7 µ g)",
        metric: "relative error of the moment",
        model: "event-driven",
        target: 1e-5,
        best: "4e-4 MFiX; Rapier and Box3D never quite roll",
        source: "MFiX DEM04; references §3",
        effort: CostClass::Quick,
        measure: |stopwatch| worst(&STEPS, |dt| slip_to_roll(stopwatch, EXACT, dt)[2]),
    },
    SuiteCase {
        name: "rolling/slip-to-roll/speed",
        setup: "5 m/s, friction 0.3, 2 s; worst of 1/30 s to 1 ms",
        metric: "relative error of the speed",
        model: "impulse",
        target: 1e-4,
        best: "6.1e-4 Box3D (1/60)",
        source: "MFiX DEM04; references §3",
        effort: CostClass::Quick,
        measure: |stopwatch| worst(&STEPS, |dt| slip_to_roll(stopwatch, IMPULSE, dt)[0]),
    },
    SuiteCase {
        name: "rolling/incline",
        setup: "20°, friction 0.5, 4 s: 5/7 g sin; worst of 1/30 s to 1 ms",
        metric: "largest relative error of speed, way and spin",
        model: "event-driven",
        target: 1e-6,
        best: "9e-4 Rapier, 7e-4 Box3D (1/60)",
        source: "rigid ball; references 4.1",
        effort: CostClass::Quick,
        measure: |stopwatch| worst(&STEPS, |dt| incline(stopwatch, EXACT, dt, 20.0, 0.5)),
    },
    SuiteCase {
        name: "rolling/incline/slipping",
        setup: "60°, friction 0.45, 4 s: g (sin − µ cos), 5 µ g cos t / 2r; worst of 1/30 s to 1 ms",
        metric: "largest relative error of speed, way and spin",
        model: "event-driven",
        target: 1e-6,
        best: "7e-3 Rapier, 6e-3 Box3D (1/60)",
        source: "rigid ball; references 4.2",
        effort: CostClass::Quick,
        measure: |stopwatch| {
            worst(&STEPS, |dt| incline(stopwatch, EXACT, dt, 60.0, 0.45))
                .max(worst(&STEPS, |dt| incline(stopwatch, EXACT, dt, 60.0, 0.55)))
        },
    },
    SuiteCase {
        name: "rolling/incline/critical",
        setup: "60°: slips below a friction of 2/7 tan, rolls above",
        metric: "error of that friction",
        model: "event-driven",
        target: 1e-4,
        best: "Rapier's spin is 3.4 % off at 0.55",
        source: "rigid ball; references 4.2",
        effort: CostClass::Quick,
        measure: critical_friction,
    },
    SuiteCase {
        name: "rolling/turntable/rate",
        setup: "2 rad/s, ball at 2 m with 0.5 m/s, 30 s at 1/60: circles at 2/7 of the rate",
        metric: "relative error of the rate",
        model: "event-driven",
        target: 1e-5,
        best: "1.4e-3 Box3D",
        source: "Weltner 1979; references 4.3",
        effort: CostClass::Quick,
        measure: |stopwatch| turntable(stopwatch, 1.0 / 60.0)[0],
    },
    SuiteCase {
        name: "rolling/turntable/speed",
        setup: "the same",
        metric: "relative drift of the speed",
        model: "event-driven",
        target: 1e-4,
        best: "8.8e-2 Rapier and Box3D",
        source: "Weltner 1979; references 4.3",
        effort: CostClass::Quick,
        measure: |stopwatch| turntable(stopwatch, 1.0 / 60.0)[1],
    },
    SuiteCase {
        name: "rolling/turntable/radius",
        setup: "the same",
        metric: "relative error of the radius",
        model: "event-driven",
        target: 1e-4,
        best: "–",
        source: "Weltner 1979; references 4.3",
        effort: CostClass::Quick,
        measure: |stopwatch| turntable(stopwatch, 1.0 / 60.0)[2],
    },
];
