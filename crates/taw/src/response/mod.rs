//! What a touch does to those who touch. One method a file; all of them take the
//! same columns and the same contacts.

mod displacement;
mod impact;
mod impulse;
mod material;

pub(crate) use displacement::displacement;
pub use impact::{BallSpin, Mobility, impact};
pub(crate) use impulse::{Constraint, Settings, Walls, Warm, impulse};
pub use material::Material;

use crate::math::{Point3, Vec3};

/// The method that restitutes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Response {
    /// The lab's method: largest displacement first, each contact is tested again;
    /// what still touches is moved apart (a wall stays, marbles take half each), and
    /// velocities change by that displacement per step.
    ///
    /// The bottom of the ladder. The same push whatever the masses; no friction, no
    /// restitution, no spin; one pass, so tall heaps sag; deep overlap turns into
    /// speed.
    #[default]
    Displacement,
    /// Impulses, contact by contact and round after round
    /// ([`Model::iterations`](crate::world::Model::iterations)): masses, restitution
    /// and friction as the [`Material`] says, spin if the model's rotation is dynamic,
    /// walls that carry along what lies on them.
    ///
    /// A bounce happens at the end of the substep in which it falls due, so its height
    /// is right only to the first order in the substep; slower than what gravity does
    /// in two substeps nothing bounces. What overlaps is pushed apart by the masses
    /// without a change of velocity.
    Impulse,
}

/// The columns that a response works on; all of one length.
#[derive(Debug)]
pub(crate) struct Columns<'a, S> {
    /// Centers, in metres.
    pub position: &'a mut [Point3<S>],
    /// In metres per second.
    pub velocity: &'a mut [Vec3<S>],
    /// In metres.
    pub radius: &'a [S],
    /// In 1/kg; zero for what cannot be moved. Empty for a response that has no use
    /// for it.
    pub inverse_mass: &'a [S],
    /// In rad/s; empty in a model without rotation.
    pub spin: &'a mut [Vec3<S>],
}
