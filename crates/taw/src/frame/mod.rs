//! Where a thing is and how it is turned.

mod bivector;
mod motor;

pub use bivector::Bivector;
pub use motor::{Motor, Twist};
