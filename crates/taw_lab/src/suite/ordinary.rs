//! Ordinary scenes: corners, cones, grooves, boards that tilt, lifts. None may make energy.

use std::f64::consts::TAU;

use taw::frame::Pose;
use taw::math::Quat;
use taw::motion::{WallMotion, integrate_rotation};
use taw::prelude::*;
use taw::shape::Mesh;

use super::{CostClass, SuiteCase};
use crate::scene::{
    Ball, EXACT, G, IMPULSE, Stopwatch, energy, overlaps, slope, state, surface, vector, wall,
    weightless, world,
};

const DT: f64 = 1.0 / 60.0;

const DISPLACEMENT: Model = Model { response: Response::Displacement, ..IMPULSE };
const SPRING: Model =
    Model { response: Response::Penalty(ContactLaw::SpringDashpot), substeps: 20, ..IMPULSE };

/// Numbers between two bounds.
struct Random(fastrand::Rng);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.f64()
    }

    fn vector(&mut self, size: f64) -> [f64; 3] {
        [0; 3].map(|_| self.between(-size, size))
    }
}

/// Energy gained in one step, as a part of the motion's, by balls that go into a corner of floor
/// and wall at 1 to 19 iterations: the most of 2,000.
fn corner(stopwatch: &mut Stopwatch, model: Model) -> f64 {
    let mut random = Random(fastrand::Rng::with_seed(1));
    let mut worst = f64::NEG_INFINITY;
    for _ in 0..2000 {
        let iterations = random.0.u32(1..20);
        let mut world = world::<f32>(Model { iterations, ..model });
        wall(&mut world, [0.0, 1.0, 0.0], 0.0);
        wall(&mut world, [0.0, 0.0, -1.0], 0.0);
        let radius = random.between(0.05, 0.5);
        let gap = [0; 2].map(|_| random.between(0.0, 0.02));
        let ball = Ball {
            at: [0.0, radius + gap[0], -radius - gap[1]],
            radius,
            velocity: [
                random.between(-3.0, 3.0),
                random.between(-3.0, 0.0),
                random.between(0.0, 3.0),
            ],
            angular_velocity: random.vector(10.0),
            material: surface(random.between(0.0, 1.0), random.between(0.0, 1.5)),
            ..Ball::default()
        };
        ball.insert(&mut world);
        let at_rest = G * ball.at[1];
        let before = energy(&world);
        stopwatch.step(&mut world, DT);
        worst = worst.max((energy(&world) - before) / (before - at_rest));
    }
    worst
}

/// Energy gained over `seconds`, as a height in metres.
fn gained_height(stopwatch: &mut Stopwatch, world: &mut World<f32>, seconds: f64) -> f64 {
    let begin = energy(world);
    let mut most = begin;
    for _ in 0..(seconds / DT) as u32 {
        stopwatch.step(world, DT);
        most = most.max(energy(world));
    }
    (most - begin) / G
}

/// A ball that is thrown about on the vertex of a mesh cone; the most of 40 cones.
fn cone(stopwatch: &mut Stopwatch, model: Model) -> f64 {
    let mut random = Random(fastrand::Rng::with_seed(2));
    let mut worst: f64 = 0.0;
    for _ in 0..40 {
        let (sides, steep) = (random.0.u32(16..100), random.between(0.2, 1.2));
        let mut points = vec![[0.0; 3]];
        points.extend((0..sides).map(|i| {
            let (sin, cos) = (TAU * f64::from(i) / f64::from(sides)).sin_cos();
            [2.0 * cos, 2.0 * steep, 2.0 * sin]
        }));
        let points = points.into_iter().map(|p| Point3::from_vec(vector(p))).collect();
        let faces = (0..sides).map(|i| [0, 1 + (i + 1) % sides, 1 + i]).collect();
        let iterations = [1, 2, 4, 8, 50][random.0.usize(..5)];
        let mut world = world::<f32>(Model { iterations, ..model });
        let mesh = Mesh::new(points, faces).expect("a cone");
        world.walls.insert(mesh).expect("finite");
        let gap = random.between(0.0, 0.05);
        let [x, z] = [0; 2].map(|_| random.between(-0.01, 0.01));
        // The middles of facets are nearer to the axis than the corners, and steeper.
        let steep = steep / (0.5 * TAU / f64::from(sides)).cos();
        let uphill = (0..sides).map(|i| {
            let (sin, cos) = (TAU * (f64::from(i) + 0.5) / f64::from(sides)).sin_cos();
            x * cos + z * sin
        });
        let touching = 0.25 * steep.hypot(1.0) + steep * uphill.fold(0.0, f64::max);
        let ball = Ball {
            at: [x, touching + gap, z],
            radius: 0.25,
            velocity: random.vector(0.8),
            angular_velocity: random.vector(10.0),
            material: surface(0.0, random.between(0.3, 1.3)),
            ..Ball::default()
        };
        ball.insert(&mut world);
        worst = worst.max(gained_height(stopwatch, &mut world, 4.0));
    }
    worst
}

/// A ball that is thrown into a groove of two half-spaces; the most of 40 grooves.
fn groove(stopwatch: &mut Stopwatch, model: Model) -> f64 {
    let mut random = Random(fastrand::Rng::with_seed(3));
    let mut worst: f64 = 0.0;
    for _ in 0..40 {
        let (sin, cos) = random.between(0.2, 1.3).sin_cos();
        let iterations = [1, 2, 4, 8, 50][random.0.usize(..5)];
        let mut world = world::<f32>(Model { iterations, ..model });
        wall(&mut world, [sin, cos, 0.0], 0.0);
        wall(&mut world, [-sin, cos, 0.0], 0.0);
        let ball = Ball {
            at: [0.0, 0.25 / cos + random.between(0.0, 0.1), 0.0],
            radius: 0.25,
            velocity: random.vector(1.0),
            angular_velocity: random.vector(10.0),
            material: surface(random.between(0.0, 1.0), random.between(0.3, 1.3)),
            ..Ball::default()
        };
        ball.insert(&mut world);
        worst = worst.max(gained_height(stopwatch, &mut world, 4.0));
    }
    worst
}

/// A wall that goes where it is told, with the mean motion of the way there, in `f32` as engines
/// know it.
struct Moving {
    wall: WallId,
    normal: [f64; 3],
    through: [f64; 3],
    pose: Pose<f32>,
}

impl Moving {
    fn new(world: &mut World<f32>, normal: [f64; 3], through: [f64; 3]) -> Self {
        let plane = Plane::through(Point3::from_vec(vector(through)), vector(normal));
        let wall = world.walls.insert(plane.expect("a unit vector")).expect("a few walls");
        Self { wall, normal, through, pose: Pose::identity() }
    }

    fn go(&mut self, world: &mut World<f32>, pose: Pose<f32>) {
        let [before, after] = [self.pose, pose]
            .map(|pose| pose.transform_point(Point3::from_vec(vector(self.through))));
        let normal = pose.transform_vector(vector::<f32>(self.normal)).normalize();
        let turn = pose.rotation * self.pose.rotation.conjugate();
        let motion = WallMotion {
            velocity: (after - before) / DT as f32,
            angular_velocity: turn.v * (2.0 / DT as f32),
            pivot: after,
        };
        let plane = Plane::through(after, normal).expect("a unit vector");
        world.walls.set(self.wall, plane).expect("it is there");
        world.walls.set_motion(self.wall, Some(motion)).expect("it is there");
        self.pose = pose;
    }
}

/// Gain of speed in one step of balls on a board with rails that tilts by .05 rad at .25 Hz, in
/// m/s: the most of ten boards in 20 s.
fn tilting_board(stopwatch: &mut Stopwatch, model: Model) -> f64 {
    let mut random = Random(fastrand::Rng::with_seed(4));
    let mut worst: f64 = 0.0;
    for _ in 0..10 {
        let mut world = world::<f32>(model);
        let rails = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
        let mut walls: Vec<_> =
            rails.map(|n| Moving::new(&mut world, n, n.map(|x| -2.0 * x))).into_iter().collect();
        walls.push(Moving::new(&mut world, [0.0, 1.0, 0.0], [0.0; 3]));
        let material = surface(random.between(0.0, 0.5), random.between(0.2, 1.2));
        for i in 0..10 {
            let at = [0.35 * f64::from(i) - 1.6, 0.1, random.between(-1.5, 1.5)];
            Ball { at, radius: 0.1, material, ..Ball::default() }.insert(&mut world);
        }
        for step in 0..1200 {
            let angle = 0.05 * (TAU * 0.25 * DT * f64::from(step)).sin();
            let rotation =
                integrate_rotation(Quat::new(1.0, 0.0, 0.0, 0.0), vector([angle, 0.0, 0.0]), 1.0);
            let pose = Pose { rotation, ..Pose::identity() };
            for wall in &mut walls {
                wall.go(&mut world, pose);
            }
            let before = world.marbles.velocity().to_vec();
            stopwatch.step(&mut world, DT);
            for (after, before) in world.marbles.velocity().iter().zip(before) {
                worst = worst.max(f64::from(after.magnitude() - before.magnitude()));
            }
        }
    }
    worst
}

/// Distance of a ball from a lift that it stands on, which rises or sinks at 3 m/s, in metres, at
/// the most.
fn lift(stopwatch: &mut Stopwatch, model: Model) -> f64 {
    let mut worst: f64 = 0.0;
    for (speed, substeps) in [(3.0, 1), (-3.0, 1), (3.0, 4), (-3.0, 4)] {
        let mut world = world::<f32>(Model { substeps, ..model });
        let mut floor = Moving::new(&mut world, [0.0, 1.0, 0.0], [0.0; 3]);
        let (at, velocity) = ([0.0, 0.1, 0.0], [0.0, speed, 0.0]);
        let id = Ball { at, velocity, radius: 0.1, ..Ball::default() }.insert(&mut world);
        for step in 1..=60 {
            let height = speed * DT * f64::from(step);
            let translation = vector([0.0, height, 0.0]);
            floor.go(&mut world, Pose { translation, ..Pose::identity() });
            stopwatch.step(&mut world, DT);
            worst = worst.max((state(&world, id)[0].y - height - 0.1).abs());
        }
    }
    worst
}

/// Error of the angle at which a ball that starts a thousandth beside the top of a fixed sphere
/// leaves it, in degrees. It leaves where nothing presses any more, at `v² = g R cos θ`, and then
/// keeps its speed across, `v cos θ`.
fn off_a_sphere(stopwatch: &mut Stopwatch, model: Model, friction: f64, cosine: f64) -> f64 {
    let mut world = world::<f64>(model);
    let sphere = Sphere::new(Point3::new(0.0, 0.0, 0.0), 1.0).expect("a metre");
    world.walls.insert(sphere).expect("finite");
    let (far, (sin, cos)) = (1.1, 1e-3_f64.sin_cos());
    let ball = Ball { at: [far * sin, far * cos, 0.0], radius: 0.1, ..Ball::default() };
    let id = Ball { material: surface(0.0, friction), ..ball }.insert(&mut world);
    // It leaves within three seconds; one that never does has no angle.
    for _ in 0..1200 {
        if state(&world, id)[0].y <= -1.0 {
            break;
        }
        stopwatch.step(&mut world, DT);
    }
    let across = state(&world, id)[1].x;
    let left = (across * across / (G * far)).cbrt();
    // From rest a thousandth beside the top, instead of on it.
    (left.acos() - (cosine * cos).acos()).to_degrees().abs()
}

/// Speed of balls that overlap by a fifth of their radius, when they are apart or after two
/// seconds, without gravity, in m/s.
fn overlap(stopwatch: &mut Stopwatch, model: Model) -> f64 {
    let mut world = weightless::<f32>(model);
    for x in [0.0, 0.9] {
        Ball { at: [x, 0.0, 0.0], ..Ball::default() }.insert(&mut world);
    }
    stopwatch.run(&mut world, DT, 2.0);
    let deepest = overlaps(&world).into_iter().fold(0.0, f64::max);
    if deepest > 0.01 {
        return f64::NAN;
    }
    world.marbles.velocity().iter().map(|v| f64::from(v.magnitude())).fold(0.0, f64::max)
}

/// Speed that balls report which lie: one on the floor, five on each other, in m/s.
fn rest(stopwatch: &mut Stopwatch, model: Model) -> f64 {
    let mut world = slope::<f32>(model, 0.0);
    Ball { at: [5.0, 0.5, 0.0], ..Ball::default() }.insert(&mut world);
    for i in 0..5 {
        Ball { at: [0.0, 0.5 + f64::from(i), 0.0], ..Ball::default() }.insert(&mut world);
    }
    stopwatch.run(&mut world, DT, 5.0);
    world.marbles.velocity().iter().map(|v| f64::from(v.magnitude())).fold(0.0, f64::max)
}

/// A row of this family; the others are measured in no other engine.
const fn row(
    name: &'static str,
    [setup, metric]: [&'static str; 2],
    model: &'static str,
    target: f64,
    measure: fn(&mut Stopwatch) -> f64,
) -> SuiteCase {
    let (best, source) = ("–", "energy from nothing is an error");
    SuiteCase {
        name,
        setup,
        metric,
        model,
        target,
        best,
        source,
        effort: CostClass::Quick,
        measure,
    }
}

const CORNER: [&str; 2] = [
    "2,000 random balls into a corner of floor and wall, 1 to 19 iterations, one step",
    "most energy gained, as a part",
];
const CONE: [&str; 2] = [
    "a ball thrown about on the vertex of 40 mesh cones of 16 to 100 triangles, 4 s",
    "most energy gained, as metres of height",
];
const GROOVE: [&str; 2] = [
    "a ball thrown into 40 grooves of two half-spaces, 4 s",
    "most energy gained, as metres of height",
];
const BOARD: [&str; 2] = [
    "10 balls on a board with rails that tilts by 0.05 rad at 0.25 Hz, ten boards, 20 s",
    "most speed gained in a step, m/s",
];
const LIFT: [&str; 2] =
    ["a ball (r 0.1) on a lift at 3 m/s up and down, 1 and 4 substeps", "farthest off the lift, m"];
const ROLLS_OFF: [&str; 2] =
    ["a ball rolls off a fixed sphere: cos θ = 10/17", "error of the angle where it leaves, °"];
const SLIDES_OFF: [&str; 2] =
    ["a ball slides off a fixed sphere: cos θ = 2/3", "error of the angle where it leaves, °"];
const OVERLAP: [&str; 2] = [
    "two balls (r 0.5) that overlap by 0.1, 2 s without gravity; NaN if 0.01 is left",
    "speed afterwards, m/s",
];
const REST: [&str; 2] =
    ["a ball on the floor and a tower of five, after 5 s", "most speed reported, m/s"];

pub const ROWS: &[SuiteCase] = &[
    row("ordinary/corner", CORNER, "impulse", 1e-4, |stopwatch| corner(stopwatch, IMPULSE)),
    row("ordinary/corner", CORNER, "event-driven", 1e-4, |stopwatch| corner(stopwatch, EXACT)),
    row("ordinary/cone", CONE, "impulse", 0.01, |stopwatch| cone(stopwatch, IMPULSE)),
    row("ordinary/cone", CONE, "event-driven", 1e-3, |stopwatch| cone(stopwatch, EXACT)),
    row("ordinary/groove", GROOVE, "impulse", 0.01, |stopwatch| groove(stopwatch, IMPULSE)),
    row("ordinary/groove", GROOVE, "event-driven", 1e-3, |stopwatch| groove(stopwatch, EXACT)),
    row("ordinary/tilting-board", BOARD, "impulse", 0.8, |stopwatch| {
        tilting_board(stopwatch, IMPULSE)
    }),
    row("ordinary/tilting-board", BOARD, "event-driven", 0.8, |stopwatch| {
        tilting_board(stopwatch, EXACT)
    }),
    row("ordinary/lift", LIFT, "impulse", 1e-3, |stopwatch| lift(stopwatch, IMPULSE)),
    row("ordinary/lift", LIFT, "event-driven", 1e-3, |stopwatch| lift(stopwatch, EXACT)),
    row("ordinary/off-a-sphere/rolls", ROLLS_OFF, "event-driven", 0.05, |stopwatch| {
        off_a_sphere(stopwatch, EXACT, 1e6, 10.0 / 17.0)
    }),
    row("ordinary/off-a-sphere/slides", SLIDES_OFF, "event-driven", 0.05, |stopwatch| {
        off_a_sphere(stopwatch, EXACT, 0.0, 2.0 / 3.0)
    }),
    row("ordinary/overlap", OVERLAP, "displacement", 1e-3, |stopwatch| {
        overlap(stopwatch, DISPLACEMENT)
    }),
    row("ordinary/overlap", OVERLAP, "impulse", 1e-3, |stopwatch| overlap(stopwatch, IMPULSE)),
    row("ordinary/overlap", OVERLAP, "event-driven", 1e-3, |stopwatch| overlap(stopwatch, EXACT)),
    row("ordinary/overlap", OVERLAP, "spring and dashpot", 0.1, |stopwatch| {
        overlap(stopwatch, SPRING)
    }),
    row("ordinary/rest", REST, "displacement", 1e-3, |stopwatch| rest(stopwatch, DISPLACEMENT)),
    row("ordinary/rest", REST, "impulse", 1e-3, |stopwatch| rest(stopwatch, IMPULSE)),
    row("ordinary/rest", REST, "event-driven", 1e-3, |stopwatch| rest(stopwatch, EXACT)),
    row("ordinary/rest", REST, "spring and dashpot", 1e-3, |stopwatch| rest(stopwatch, SPRING)),
];
