//! Motion without contacts: integrators, force fields, masses, rotation, locked axes.

mod force_field;
mod free_body;
mod integrator;
mod locked_axes;
mod mass;
pub(crate) mod rest;
mod rotation;
mod wall_motion;

pub(crate) use force_field::acceleration_in_step;
pub use force_field::{ForceField, Medium};
pub use free_body::{integrate_free_body, world_velocity};
pub use integrator::{Integrator, Motion};
pub use locked_axes::LockedAxes;
pub(crate) use locked_axes::{LEAST_SHARE, MAX_ESCAPE};
pub(crate) use mass::BALL_INVERSE_INERTIA;
pub use mass::Mass;
pub use rotation::{FreeRotation, Rotation, integrate_rotation};
pub use wall_motion::WallMotion;
