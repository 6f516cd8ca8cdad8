//! How a thing moves while nothing touches it: integrators, forces, masses, rotation.

mod force;
mod integrator;
mod mass;
mod rigid;
mod rotation;
mod wall;

pub use force::{Force, Medium};
pub use integrator::{Integrator, Motion};
pub use mass::Mass;
pub use rigid::{move_free, world_velocity};
pub use rotation::{FreeRotation, Rotation, turned};
pub use wall::WallMotion;
