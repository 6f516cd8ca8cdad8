//! Joints against what mechanics says of them.

mod chains;
mod drives;
mod input;
mod pendulums;
mod random;
mod springs;

use taw::joint::{Joint, JointEnd, JointKind};
use taw::prelude::*;
use taw::world::Marble;

/// World of the game model with this many substeps.
fn world<S: Scalar>(substeps: u32) -> World<S> {
    let mut world = World::default();
    let model = Model { substeps, ..Model::GAME };
    world.set_model(model).unwrap();
    world
}

/// Marble of 1 kg and a radius of .1 m at a place.
fn marble<S: Scalar>(world: &mut World<S>, x: f64, y: f64, z: f64) -> MarbleId {
    let number = S::from_f64;
    let position = Point3::new(number(x), number(y), number(z));
    let mass = Mass::Kilograms(S::one());
    world.marbles.insert(Marble { mass, ..Marble::new(position, number(0.1)) }).unwrap()
}

fn vector<S: Scalar>(x: f64, y: f64, z: f64) -> Vec3<S> {
    Vec3::new(x, y, z).map(S::from_f64)
}

fn position<S: Scalar>(world: &World<S>, id: MarbleId) -> Vec3<f64> {
    let at = world.marbles.get(id).unwrap().position;
    Vec3::new(at.x, at.y, at.z).map(S::as_f64)
}

fn velocity<S: Scalar>(world: &World<S>, id: MarbleId) -> Vec3<f64> {
    world.marbles.get(id).unwrap().velocity.map(S::as_f64)
}

/// End of a joint in the world.
fn place<S: Scalar>(x: f64, y: f64, z: f64) -> JointEnd<S> {
    JointEnd::world(Point3::from_vec(vector(x, y, z)))
}

fn join<S: Scalar>(
    world: &mut World<S>,
    kind: JointKind<S>,
    ends: [JointEnd<S>; 2],
) -> taw::joint::JointId {
    world.joints.insert(Joint::new(kind, ends)).unwrap()
}

fn step<S: Scalar>(world: &mut World<S>) {
    world.step(S::from_f64(1.0 / 60.0)).unwrap();
}

/// Center of a joint's end in the world.
fn anchor<S: Scalar>(world: &World<S>, end: JointEnd<S>) -> Vec3<f64> {
    let frame = end.frame();
    match end.marble_id() {
        None => frame.translation.map(S::as_f64),
        Some(id) => {
            let marble = world.marbles.get(id).unwrap();
            position(world, id) + (marble.rotation * frame.translation).map(S::as_f64)
        }
    }
}
