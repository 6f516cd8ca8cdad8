//! How a thing moves while nothing touches it.

mod integrator;

pub use integrator::{Integrator, explicit_euler, semi_implicit_euler};
