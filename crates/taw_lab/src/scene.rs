//! Building blocks of the suite's scenes.

use std::time::Duration;

use taw::prelude::*;
use taw::swarm::SwarmModel;
use web_time::Instant;

/// Earth's gravity, in m/s².
pub const G: f64 = 9.81;

/// Most accurate model: [`Response::EventDriven`], compensated, with angular momentum.
pub const EXACT: Model = Model {
    integrator: Integrator::VelocityVerlet,
    response: Response::EventDriven,
    rotation: Rotation::Dynamic,
    precision: Precision::Compensated,
    detection: Detection::Discrete,
    substeps: 1,
    iterations: 200,
};

/// Typical game model: [`Response::Impulse`] with angular momentum.
pub const IMPULSE: Model =
    Model { response: Response::Impulse, precision: Precision::Plain, ..EXACT };

/// Stopwatch for stepping worlds.
#[derive(Debug, Default)]
pub struct Stopwatch {
    time: Duration,
    ball_steps: u64,
}

impl Stopwatch {
    /// Steps a world. A rejected step is a bug of the suite.
    ///
    /// # Panics
    /// If the world refuses the step.
    pub fn step<S: Scalar>(&mut self, world: &mut World<S>, dt: f64) {
        let begin = Instant::now();
        world.step(S::from_f64(dt)).expect("the suite's steps are above zero");
        self.time += begin.elapsed();
        self.ball_steps += (world.marbles.len() + world.swarm.len()) as u64;
    }

    /// Steps a world for a duration in seconds, in whole steps; returns the simulated time.
    pub fn run<S: Scalar>(&mut self, world: &mut World<S>, dt: f64, seconds: f64) -> f64 {
        let steps = (seconds / dt).round();
        for _ in 0..steps as u64 {
            self.step(world, dt);
        }
        steps * S::from_f64(dt).as_f64()
    }

    /// Cost in nanoseconds per ball and step.
    #[must_use]
    pub fn cost(&self) -> f64 {
        self.time.as_nanos() as f64 / self.ball_steps.max(1) as f64
    }

    /// Total duration of stepping, in seconds.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.time.as_secs_f64()
    }
}

/// An empty world of this model, in which nothing sleeps.
#[must_use]
pub fn world<S: Scalar>(model: Model) -> World<S> {
    let mut world = World::default();
    world.set_model(model).expect("the suite's models are right");
    // What is slow beside an unstable balance would sleep there.
    let awake = SwarmModel { sleeps: false, ..world.swarm.model() };
    world.swarm.set_model(awake).expect("as it was");
    world
}

/// An empty world of this model without gravity.
#[must_use]
pub fn weightless<S: Scalar>(model: Model) -> World<S> {
    let mut world = world(model);
    world.set_gravity(vector([0.0; 3])).expect("zero is finite");
    world
}

/// A world with a floor at zero that is tilted down toward +x.
#[must_use]
pub fn slope<S: Scalar>(model: Model, degrees: f64) -> World<S> {
    let mut world = world(model);
    let (sin, cos) = degrees.to_radians().sin_cos();
    wall(&mut world, [sin, cos, 0.0], 0.0);
    world
}

/// Adds a wall: the direction of its free side, and its distance from the origin along it.
pub fn wall<S: Scalar>(world: &mut World<S>, normal: [f64; 3], offset: f64) -> WallId {
    let plane = Plane::new(vector(normal), S::from_f64(offset)).expect("a unit vector");
    world.walls.insert(plane).expect("a few walls")
}

/// Adds four upright walls around a square, this far from its middle.
pub fn box_around<S: Scalar>(world: &mut World<S>, half: f64) {
    for normal in [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]] {
        wall(world, normal, -half);
    }
}

/// A vector in any scalar.
#[must_use]
pub fn vector<S: Scalar>(v: [f64; 3]) -> Vec3<S> {
    Vec3::from(v.map(S::from_f64))
}

/// A ball on its way into a scene.
#[derive(Clone, Copy, Debug)]
pub struct Ball {
    /// In metres.
    pub at: [f64; 3],
    /// In metres.
    pub radius: f64,
    /// In m/s.
    pub velocity: [f64; 3],
    /// In rad/s.
    pub angular_velocity: [f64; 3],
    /// In kilograms.
    pub mass: f64,
    /// Material.
    pub material: Material<f64>,
}

impl Default for Ball {
    /// Of half a metre and a kilogram, at rest, without friction or restitution.
    fn default() -> Self {
        Self {
            at: [0.0, 0.5, 0.0],
            radius: 0.5,
            velocity: [0.0; 3],
            angular_velocity: [0.0; 3],
            mass: 1.0,
            material: surface(0.0, 0.0),
        }
    }
}

/// A material of this restitution and friction.
#[must_use]
pub fn surface(restitution: f64, friction: f64) -> Material<f64> {
    Material { restitution, friction, ..Material::default() }
}

impl Ball {
    /// Puts it in, as a marble of the world's scalar.
    ///
    /// # Panics
    /// If the world refuses it.
    pub fn insert<S: Scalar>(self, world: &mut World<S>) -> MarbleId {
        let number = S::from_f64;
        let m = self.material;
        let material = Material {
            restitution: number(m.restitution),
            friction: number(m.friction),
            tangential_restitution: number(m.tangential_restitution),
            rolling_resistance: number(m.rolling_resistance),
            spinning_resistance: number(m.spinning_resistance),
            elasticity: taw::response::Elasticity {
                youngs_modulus: number(m.elasticity.youngs_modulus),
                poissons_ratio: number(m.elasticity.poissons_ratio),
            },
            combine: m.combine,
        };
        let marble = Marble {
            velocity: vector(self.velocity),
            angular_velocity: vector(self.angular_velocity),
            mass: if self.mass.is_finite() {
                Mass::Kilograms(number(self.mass))
            } else {
                Mass::Infinite
            },
            material: Some(material),
            ..Marble::new(Point3::from_vec(vector(self.at)), number(self.radius))
        };
        world.marbles.insert(marble).expect("the suite's balls are right")
    }
}

/// State of a ball in `f64`: position, velocity, spin.
#[must_use]
pub fn state<S: Scalar>(world: &World<S>, id: MarbleId) -> [Vec3<f64>; 3] {
    let marble = world.marbles.get_high_precision(id).expect("nobody takes balls out");
    [marble.position.to_vec(), marble.velocity, marble.angular_velocity]
}

/// Kinetic (with spin) and potential energy of all balls, in joules.
#[must_use]
pub fn energy<S: Scalar>(world: &World<S>) -> f64 {
    world.energy().total()
}

/// Penetration of each pair of balls, and of balls and walls, in metres.
pub fn overlaps<S: Scalar>(world: &World<S>) -> Vec<f64> {
    let mut touched = world.clone();
    touched.generate_contacts();
    let contacts = touched.contacts.wm.iter().chain(&touched.contacts.mm);
    contacts.map(|c| c.penetration().as_f64()).collect()
}
