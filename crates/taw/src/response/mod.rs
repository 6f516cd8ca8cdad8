//! What a touch does to those who touch. One method a file; all of them take the
//! same columns and the same contacts.

mod displacement;
pub(crate) mod event;
mod impact;
pub(crate) mod impulse;
mod material;
mod penalty;

pub(crate) use displacement::displacement;
pub use event::Impact;
pub use impact::{BallSpin, Mobility, impact};
pub(crate) use impulse::Walls;
pub use material::{Combine, Elasticity, Material};
pub use penalty::ContactLaw;
pub(crate) use penalty::{Shear, penalty};

use cgmath::Zero;

use crate::math::{Point3, Scalar, Vec3};

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
    /// walls that carry along what lies on them; rolling and spinning resistance. Sweeps
    /// that go on along their way until the contacts agree
    /// ([`World::residual`](crate::world::World::residual)).
    ///
    /// A bounce happens at the end of the substep in which it falls due, so its height
    /// is right only to the first order in the substep; slower than what gravity does
    /// in two substeps nothing bounces. What overlaps is pushed apart by the masses
    /// without a change of velocity.
    Impulse,
    /// Forces that grow with the overlap: touches take time, many marbles can push at
    /// once, and what a contact bears is a force in newtons.
    ///
    /// For engineers (with [`ContactLaw::HertzMindlin`]), and to see why games do without:
    /// a marble sinks in by what the stiffness gives, and a stiffer contact needs shorter
    /// substeps.
    Penalty(ContactLaw),
    /// Collision after collision in the order of time: each with its own normal, at its
    /// own moment, thousands in one substep if need be. Nothing tunnels at any speed, and
    /// bounces lose no height that restitution does not take.
    ///
    /// In between marbles fly along parabolas, with the mean acceleration of the substep
    /// by the integrator; exact for gravity. What lies on one wall rests, rolls or slides
    /// as the equations of a rolling ball say, and changes over at its moment. What lies
    /// on other marbles is held as by [`Response::Impulse`]. Give it 50
    /// [iterations](crate::world::Model::iterations) or more where there are heaps: a
    /// contact that they leave undecided is one more event, which costs more. Bounces end
    /// when the rest of them would take less than a few thousandths of a substep.
    ///
    /// Counts in `f64` also in a world of `f32`; see
    /// [`Precision`](crate::world::Precision) for what such a world remembers of it. It
    /// finds its collisions by itself, so taking contacts out of the world's lists does
    /// not keep marbles apart.
    EventDriven,
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
    /// In rad/s; empty where contacts neither feel nor change it.
    pub spin: &'a mut [Vec3<S>],
    /// Which rows contacts cannot set spinning; empty if there are none.
    pub held: &'a [bool],
}

impl<S: Scalar> Columns<'_, S> {
    /// Whether an impulse can set the marble in a row spinning.
    fn ball_spin(&self, row: usize) -> BallSpin {
        let held = self.held.get(row).copied().unwrap_or(false);
        if held || self.spin.is_empty() { BallSpin::Ignored } else { BallSpin::Free }
    }

    /// The spin in a row, in rad/s, as far as contacts feel it.
    fn felt_spin(&self, row: usize) -> Vec3<S> {
        match self.ball_spin(row) {
            BallSpin::Free => self.spin[row],
            BallSpin::Ignored => Vec3::zero(),
        }
    }

    /// Radius times spin, in m/s.
    fn rim(&self, row: usize) -> Vec3<S> {
        self.felt_spin(row) * self.radius[row]
    }

    /// In 1/(kg m²); zero for what cannot be turned.
    fn inverse_inertia(&self, row: usize) -> S {
        let whirl = self.ball_spin(row).of_solid_ball::<S>();
        whirl * self.inverse_mass[row] / (self.radius[row] * self.radius[row])
    }

    /// Changes a velocity by a hit where a marble is touched, and its spin with it;
    /// `normal` points to its center.
    fn hit(&mut self, row: usize, change: Vec3<S>, normal: Vec3<S>) {
        self.velocity[row] += change;
        let whirl = self.ball_spin(row).of_solid_ball::<S>();
        if let Some(spin) = self.spin.get_mut(row) {
            *spin -= normal.cross(change) * (whirl / self.radius[row]);
        }
    }

    /// Changes a spin by an angular impulse, in kg m²/s.
    fn twist(&mut self, row: usize, twist: Vec3<S>) {
        let inverse = self.inverse_inertia(row);
        if let Some(spin) = self.spin.get_mut(row) {
            *spin += twist * inverse;
        }
    }
}
