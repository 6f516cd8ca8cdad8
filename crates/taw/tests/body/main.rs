//! Rigid bodies against what mechanics says of them.

mod asleep;
mod balls;
mod bridges;
mod flight;
mod joined;
mod loads;
mod piles;
mod random;
mod sleep;
mod sliding;

use taw::body::{Body, BodyId};
use taw::math::Quat;
use taw::prelude::*;
use taw::shape::Shape;

/// World of the game model, with a gravity of 9.81 m/s² and, if asked for, a floor at zero.
fn world<S: Scalar>(floor: bool) -> World<S> {
    let mut world = World::default();
    world.set_model(Model::GAME).unwrap();
    world.set_gravity(vector(0.0, -9.81, 0.0)).unwrap();
    if floor {
        world.walls.insert(Plane::new(Vec3::unit_y(), S::zero()).unwrap()).unwrap();
    }
    world
}

fn vector<S: Scalar>(x: f64, y: f64, z: f64) -> Vec3<S> {
    Vec3::new(x, y, z).map(S::from_f64)
}

fn point<S: Scalar>(x: f64, y: f64, z: f64) -> Point3<S> {
    Point3::from_vec(vector(x, y, z))
}

/// Rotation about z by an angle in rad.
fn about_z<S: Scalar>(angle: f64) -> Quat<S> {
    let [s, z] = [(angle * 0.5).cos(), (angle * 0.5).sin()].map(S::from_f64);
    Quat::new(s, S::zero(), S::zero(), z)
}

/// Box of 1,000 kg/m³.
fn cuboid<S: Scalar>(half: [f64; 3], at: Point3<S>) -> Body<S> {
    let [x, y, z] = half;
    let mass = taw::body::BodyMass::Uniform(Mass::Density(S::from_f64(1000.0)));
    Body { mass, ..Body::cuboid(vector(x, y, z), at) }
}

fn material<S: Scalar>(friction: f64, restitution: f64) -> Material<S> {
    Material {
        friction: S::from_f64(friction),
        restitution: S::from_f64(restitution),
        ..Material::default()
    }
}

fn step<S: Scalar>(world: &mut World<S>) {
    world.step(S::from_f64(1.0 / 60.0)).unwrap();
}

fn run<S: Scalar>(world: &mut World<S>, seconds: f64) {
    for _ in 0..(seconds * 60.0).round() as u32 {
        step(world);
    }
}

fn place<S: Scalar>(world: &World<S>, id: BodyId) -> Vec3<f64> {
    world.bodies.pose(id).unwrap().translation.map(S::as_f64)
}

fn velocity<S: Scalar>(world: &World<S>, id: BodyId) -> Vec3<f64> {
    world.bodies.get(id).unwrap().velocity.map(S::as_f64)
}

fn spin<S: Scalar>(world: &World<S>, id: BodyId) -> Vec3<f64> {
    world.bodies.get(id).unwrap().angular_velocity.map(S::as_f64)
}

/// Kinetic and potential energy of all bodies and marbles, in J.
fn energy<S: Scalar>(world: &World<S>) -> f64 {
    world.energy().total()
}

/// Cosine of the angle by which a body's y axis leans.
fn upright<S: Scalar>(world: &World<S>, id: BodyId) -> f64 {
    (world.bodies.pose(id).unwrap().rotation * Vec3::unit_y()).y.as_f64()
}
