//! **taw**: marble physics. This crate is its core: pure mathematics on
//! [`cgmath`], no engine, no clock, no files, and generic over the scalar (`f32`
//! for speed, `f64` for accuracy).
//!
//! The smallest program drops a marble on a floor:
//!
//! ```
//! use taw::prelude::*;
//!
//! # fn main() -> Result<(), taw::Error> {
//! let mut world = World::<f32>::default();
//! world.walls.insert(Plane::new(Vec3::unit_y(), 0.0)?)?;
//! let taw = world.marbles.insert(Marble::new(Point3::new(0.0, 2.0, 0.0), 0.5))?;
//! for _ in 0..180 {
//!     world.step(1.0 / 60.0)?;
//! }
//! let marble = world.marbles.get(taw)?;
//! assert!((marble.position.y - 0.5).abs() < 1e-4, "it rests on the floor");
//! # Ok(())
//! # }
//! ```
//!
//! # Three verbs
//! A substep is always the same walk, and [`World::step`](world::World::step)
//! reads like it: *integrate*, *generate contacts*, *restitute*.
//!
//! # The rooms
//! | room | what for |
//! |---|---|
//! | [`math`] | names for cgmath's types, the [`Scalar`](math::Scalar), lengths that neither overflow nor vanish |
//! | `workers` | threads that share the work of a step |
//! | [`frame`] | where a thing is and how it is turned: poses, every form of a rotation, motors, cameras |
//! | [`shape`] | what a thing is: sphere, plane, boxes, capsule, hull, compound |
//! | [`contact`] | when things touch, where, and the shortest way apart; rays and sweeps |
//! | [`broad`] | who might touch: a grid for marbles |
//! | [`motion`] | how a thing moves: integrators, forces, masses, rotation |
//! | `constraint` | the impulse of one contact point, for all methods |
//! | [`body`] | rigid bodies of any shape, and their contacts |
//! | [`response`] | what a touch does |
//! | [`swarm`] | balls in bulk: few features, a million of them |
//! | [`world`] | the state in columns, the [`Model`](world::Model), the step |
//! | [`scene`] | a scene as a plain value, to be read from a file and run by any model |
//!
//! Imports follow the order of this table: a module never uses a later one (`tests/modules.rs`).
//!
//! With the feature `serde`, scenes and models are read from files and written. With the
//! feature `mint`, cgmath's types convert to and from those of any other
//! mathematics library.
//!
//! # Units and bad input
//! Lengths are metres, times seconds, whatever else follows from them. What
//! cannot be right (NaN, a negative radius, a step of zero) is refused with an
//! [`Error`] that names the field and the value, and changes nothing. Nothing in
//! this crate panics.

#![cfg_attr(not(test), warn(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod body;
pub mod broad;
mod constraint;
pub mod contact;
mod error;
pub mod frame;
mod handle;
pub mod joint;
pub mod math;
pub mod motion;
pub mod response;
pub mod scene;
pub mod shape;
pub mod swarm;
mod uncompared;
mod workers;
pub mod world;

pub use error::Error;

/// Items that nearly every program needs.
pub mod prelude {
    pub use crate::broad::CollisionLayers;
    pub use crate::contact::{Contact, Contacts};
    pub use crate::math::{Point3, Scalar, Vec3};
    pub use crate::motion::{ForceField, Integrator, LockedAxes, Rotation};
    pub use crate::response::{Combine, ContactLaw, Material, Response};
    pub use crate::shape::{Plane, Sphere};
    pub use crate::world::{
        ColliderId, Detection, Marble, MarbleId, Mass, Model, Precision, QueryHit, QueryTree,
        SensorEvent, SensorId, WallId, WallShape, World,
    };
    pub use cgmath::prelude::*;
}

/// The examples of `docs/hello.md`, tested.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/hello.md")]
mod hello {}
