//! What a touch does to those who touch. One method a file; all of them take the
//! same columns and the same contacts.

mod bodies;
pub(crate) mod displacement;
mod energy_ledger;
pub(crate) mod event;
mod impact;
pub(crate) mod impulse;
mod material;
pub(crate) mod penalty;

pub(crate) use bodies::{CapsuleInertia, SolverBodies};
pub(crate) use energy_ledger::{EnergyLedger, ImpulseSample};
pub use event::Impact;
pub use impact::{BallRotation, InverseEffectiveMass, impact};
pub(crate) use impulse::Colliders;
pub use material::{Combine, Elasticity, Material};
pub use penalty::ContactLaw;
pub(crate) use penalty::SpringHistory;

/// The method that restitutes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Response {
    /// The lab's method: what moved into each other is moved back (a wall stays, marbles take
    /// half each), the largest displacement first, and velocities change by that displacement
    /// per step. What overlapped before (spawned, grown, put there) is moved apart afterwards,
    /// and no velocity changes: overlap is no energy.
    ///
    /// The bottom of the ladder. The same push whatever the masses, so momentum is kept only
    /// where they are equal; no friction, no restitution, no spin. Changes begin with those of
    /// the last substep and go over all contacts [`Model::iterations`] times at most, so that
    /// what lies reports no speed; tall heaps sag until they agree.
    ///
    /// [`Model::iterations`]: crate::world::Model::iterations
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
    /// substeps: what bears m times its own weight by [`ContactLaw::SpringDashpot`] sinks in by
    /// 26 m g dt², for substeps of dt. No contact gives more energy than it took, and what
    /// overlaps from the start parts at a radius a second at most.
    Penalty(ContactLaw),
    /// Collision after collision in the order of time: each with its own normal, at its
    /// own moment, thousands in one substep if need be. Nothing tunnels at any speed, and
    /// bounces lose no height that restitution does not take.
    ///
    /// In between marbles fly along parabolas, with the mean acceleration of the substep
    /// by the integrator; exact for gravity. What lies on one wall of whatever form rests,
    /// rolls or slides as the equations of a rolling ball say, and changes over at its moment.
    /// On half-spaces and flat faces they are solved in closed form. On what bends (spheres,
    /// capsules, edges and corners) and on walls that tilt they are integrated in steps by
    /// which the normal turns by 0.02 rad at most, and a marble leaves where nothing presses it
    /// any more. What touches several walls, or other marbles, is held as by
    /// [`Response::Impulse`], in as many iterations as it takes, for 4,000 contacts altogether;
    /// only in heaps of more do the [iterations](crate::world::Model::iterations) count. Give it
    /// 50 or more there: a contact that they leave undecided is one more event, which costs
    /// more. Bounces end when the rest of them would take less than
    /// a few thousandths of a substep.
    ///
    /// A wall that was [set](crate::world::Colliders::set) to another place since the last step,
    /// and has a [motion](crate::world::WallMotion), goes through the step by that motion, and
    /// is at its end where it was set to. One that only has a motion stays, and carries along
    /// its surface what lies on it.
    ///
    /// A substep has a budget: 32 million looks at one wall or one other marble, and 20,000 for
    /// each marble besides, about a second for a few hundred. What is not at the end of the
    /// substep then stays where it is, loses its velocity, and is named by
    /// [`World::stopped`](crate::world::World::stopped).
    ///
    /// Counts in `f64` also in a world of `f32`; see
    /// [`Precision`](crate::world::Precision) for what such a world remembers of it. It
    /// finds its collisions by itself, so taking contacts out of the world's lists does
    /// not keep marbles apart.
    EventDriven,
}

impl Response {
    /// Whether it acts only on what overlaps.
    pub(crate) fn needs_overlap(self) -> bool {
        matches!(self, Self::Penalty(_))
    }
}
