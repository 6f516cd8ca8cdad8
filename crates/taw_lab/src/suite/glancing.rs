//! Glancing impacts on walls that are round or have edges: the normal is that where they touch.

use taw::prelude::*;
use taw::shape::Aabb;

use super::{CostClass, SuiteCase};
use crate::scene::{Ball, EXACT, IMPULSE, Stopwatch, state, surface, vector, weightless};

const SOFT_STEP: Model = Model { response: Response::SoftStep, substeps: 4, ..IMPULSE };
const SWEPT: Model = Model { detection: Detection::Swept, ..IMPULSE };
const RESTITUTION: f64 = 0.8;

/// Obstacle at the origin, of a size in metres.
#[derive(Clone, Copy)]
enum Obstacle {
    /// Sphere of this radius.
    Pin,
    /// Box of these half widths, met at the edge along z.
    Edge,
}

impl Obstacle {
    /// Center of the circle, across z, on which the center of a ball is when it touches, and the radius of the
    /// part of it that is round.
    fn arc(self, size: f64) -> (Vec3<f64>, f64) {
        match self {
            Self::Pin => (Vec3::zero(), size),
            Self::Edge => (Vec3::new(-size, size, 0.0), 0.0),
        }
    }

    fn insert(self, world: &mut World<f32>, size: f64) {
        let at = |v: [f64; 3]| Point3::from_vec(vector::<f32>(v));
        let wall = match self {
            Self::Pin => world.walls.insert(Sphere { center: at([0.0; 3]), radius: size as f32 }),
            Self::Edge => world.walls.insert(Aabb { min: at([-size; 3]), max: at([size; 3]) }),
        };
        wall.expect("finite");
    }
}

/// Largest error of the velocity after a bounce, over the speed: 17 angles of incidence from 5° to 85°, four sizes of
/// ball and obstacle, three step lengths, and 13 places of the impact within the step.
fn worst(stopwatch: &mut Stopwatch, model: Model, obstacle: Obstacle) -> f64 {
    let mut worst: f64 = 0.0;
    for angle in 1..=17 {
        for (size, radius) in [(0.05, 0.2), (0.2, 0.2), (0.5, 0.05), (0.02, 0.5)] {
            for (dt, part) in [1.0 / 30.0, 1.0 / 60.0, 1.0 / 240.0]
                .into_iter()
                .flat_map(|dt| (0..13).map(move |part| (dt, f64::from(part) / 13.0)))
            {
                let case = Case { angle: 5.0 * f64::from(angle), size, radius, dt, part };
                worst = worst.max(case.error(stopwatch, model, obstacle));
            }
        }
    }
    worst
}

/// One bounce.
struct Case {
    /// Angle of incidence, in degrees.
    angle: f64,
    size: f64,
    radius: f64,
    dt: f64,
    /// Fraction of the step at which the impact happens.
    part: f64,
}

impl Case {
    fn error(&self, stopwatch: &mut Stopwatch, model: Model, obstacle: Obstacle) -> f64 {
        let Self { angle, size, radius, dt, part } = *self;
        let (center, round) = obstacle.arc(size);
        // Normal where they touch, and a velocity at the angle to it.
        let normal = Vec3::new(-0.6, 0.8, 0.0);
        let (sin, cos) = angle.to_radians().sin_cos();
        let velocity = (Vec3::new(0.8, 0.6, 0.0) * sin - normal * cos) * 4.0;
        let touching = center + normal * (round + radius);
        let mut world = weightless::<f32>(model);
        obstacle.insert(&mut world, size);
        let ball = Ball {
            at: (touching - velocity * (dt * (2.0 + part))).into(),
            radius,
            velocity: velocity.into(),
            material: surface(RESTITUTION, 0.0),
            ..Ball::default()
        };
        let id = ball.insert(&mut world);
        for _ in 0..5 {
            stopwatch.step(&mut world, dt);
        }
        let [_, after, _] = state(&world, id);
        let exact = velocity - normal * (velocity.dot(normal) * (1.0 + RESTITUTION));
        (after - exact).magnitude() / velocity.magnitude()
    }
}

/// See the module.
pub static ROWS: &[SuiteCase] = &[
    SuiteCase {
        name: "glancing/pin",
        setup: "a ball at 4 m/s off a fixed sphere: 17 angles, 4 sizes, 1/30 to 1/240 s, e 0.8",
        metric: "worst error of the velocity over the speed",
        model: "event-driven",
        target: 1e-4,
        best: "none measured",
        source: "reflection at the common normal",
        effort: CostClass::Quick,
        measure: |stopwatch| worst(stopwatch, EXACT, Obstacle::Pin),
    },
    SuiteCase {
        name: "glancing/edge",
        setup: "a ball at 4 m/s off the edge of a box: 17 angles, 4 sizes, 1/30 to 1/240 s, e 0.8",
        metric: "worst error of the velocity over the speed",
        model: "event-driven",
        target: 1e-4,
        best: "none measured",
        source: "reflection at the common normal",
        effort: CostClass::Quick,
        measure: |stopwatch| worst(stopwatch, EXACT, Obstacle::Edge),
    },
    SuiteCase {
        name: "glancing/pin",
        setup: "a ball at 4 m/s off a fixed sphere: 17 angles, 4 sizes, 1/30 to 1/240 s, e 0.8",
        metric: "worst error of the velocity over the speed",
        model: "soft step, 4 substeps",
        target: 1e-3,
        best: "none measured",
        source: "reflection at the common normal",
        effort: CostClass::Quick,
        measure: |stopwatch| worst(stopwatch, SOFT_STEP, Obstacle::Pin),
    },
    SuiteCase {
        name: "glancing/edge",
        setup: "a ball at 4 m/s off the edge of a box: 17 angles, 4 sizes, 1/30 to 1/240 s, e 0.8",
        metric: "worst error of the velocity over the speed",
        model: "soft step, 4 substeps",
        target: 1e-3,
        best: "none measured",
        source: "reflection at the common normal",
        effort: CostClass::Quick,
        measure: |stopwatch| worst(stopwatch, SOFT_STEP, Obstacle::Edge),
    },
    SuiteCase {
        name: "glancing/pin",
        setup: "a ball at 4 m/s off a fixed sphere: 17 angles, 4 sizes, 1/30 to 1/240 s, e 0.8",
        metric: "worst error of the velocity over the speed",
        model: "impulse, swept",
        target: 1e-3,
        best: "none measured",
        source: "reflection at the common normal",
        effort: CostClass::Quick,
        measure: |stopwatch| worst(stopwatch, SWEPT, Obstacle::Pin),
    },
];
