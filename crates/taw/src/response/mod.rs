//! What a touch does to those who touch. One method a file; all of them take the
//! same columns and the same contacts.

mod displacement;

pub use displacement::displacement;

use crate::math::{Point3, Vec3};

/// The method that restitutes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Response {
    /// Moves what overlaps apart and lets the velocity follow: the lab's method.
    /// No friction, no restitution, no spin; see [`displacement`].
    #[default]
    Displacement,
}

/// The columns that a response works on; all of one length.
#[derive(Debug)]
pub struct Columns<'a, S> {
    /// Centers, in metres.
    pub position: &'a mut [Point3<S>],
    /// In metres per second.
    pub velocity: &'a mut [Vec3<S>],
    /// In metres.
    pub radius: &'a [S],
}
