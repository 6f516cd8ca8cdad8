//! Collision response: methods that change positions and velocities where bodies are in contact.
//! One method per file; all take the same columns and the same contacts.

mod bodies;
mod contact_key;
pub(crate) mod displacement;
mod energy_ledger;
pub(crate) mod event;
mod impact;
pub(crate) mod impulse;
pub(crate) mod penalty;

pub use crate::contact::{Combine, Elasticity, Material};
pub(crate) use bodies::{CapsuleInertia, SolverBodies};
pub(crate) use contact_key::{ContactKey, KeyedByContact, follow_rows, rename_rows};
pub(crate) use energy_ledger::{EnergyLedger, ImpulseSample};
pub use event::Impact;
pub use impact::{BallRotation, InverseEffectiveMass, impact};
pub(crate) use impulse::Colliders;
pub use penalty::ContactLaw;
pub(crate) use penalty::SpringHistory;

/// Collision response (lecture: restitution), the solver of a world's contacts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Response {
    /// Position projection (the lecture's method; engines call it position-based). Bodies that
    /// penetrated in this substep are moved apart, deepest contact first (a wall stays, marbles
    /// take half each), and velocities change by that displacement per substep. Penetration from
    /// before the substep (spawned, grown or placed bodies) is resolved afterwards without a change
    /// of velocity: penetration is no energy.
    ///
    /// The simplest method. The correction ignores masses, so momentum is conserved only where they
    /// are equal; no friction, no restitution coefficient, no spin. A warm start and at most
    /// [`Model::iterations`] passes over all contacts, so that resting marbles report no speed;
    /// tall heaps sag until the contacts converge.
    ///
    /// [`Model::iterations`]: crate::world::Model::iterations
    #[default]
    Displacement,
    /// Sequential impulses, at most [`Model::iterations`](crate::world::Model::iterations) passes
    /// over the contacts: masses, restitution and friction of the [`Material`], spin if the model's
    /// rotation is dynamic, moving walls that carry what lies on them; rolling and torsional
    /// friction. Passes are accelerated by a conjugate search until the contacts converge
    /// ([`World::residual`](crate::world::World::residual)).
    ///
    /// A bounce acts at the end of its substep, so its height is exact only to first order in the
    /// substep. The restitution threshold is the speed that gravity adds in two substeps.
    /// Penetration is resolved by mass, without a change of velocity.
    ///
    /// Where walls that move squeeze marbles, no velocities satisfy all contacts: such marbles overlap
    /// until there is room, and get no more energy than they had and the walls could give them; so a
    /// wedge that closes does not throw a marble out faster than that. A contact bears about a thousand
    /// times the mass of all that are in contact times their largest relative velocity.
    Impulse,
    /// Soft contacts in small steps (Catto, 2024, `Solver2D`): masses, restitution, friction,
    /// rolling and torsional friction, and spin if the model's rotation is dynamic. Made for games:
    /// for thousands of balls, on all threads.
    ///
    /// Marbles and the balls of the [swarm](crate::world::World::swarm) are solved as one, with the
    /// threads and the sleep of its [model](crate::swarm::SwarmModel), in the
    /// [substeps](crate::world::Model::substeps) of the world's model, all within the third verb.
    /// A contact sinks in by about a thousandth of the radius for three balls on it. Where masses differ
    /// by more than eight times (infinite ones too) and balls still sink after a pass over the contacts,
    /// the contacts of up to 256 balls next to them are solved as by [`Impulse`](Self::Impulse). What lies
    /// still for half a second sleeps. Free flight is exact for constant acceleration, and a bounce keeps
    /// its height to rounding; but an approach slower than what gravity adds in two substeps ends without
    /// one, in any direction.
    ///
    /// Balls only, and no periods. Marbles may have their own mass, material,
    /// gravity scale, damping, forces and rotation model; tangential restitution has no effect where
    /// restitution is zero. Force fields and damping act once a step, by the integrator's mean acceleration
    /// over it; free flight is the parabola of that acceleration, whatever the integrator. A ball stops at thin
    /// walls and other balls at any speed, whatever the world's [detection](crate::world::Detection);
    /// so it does at walls that were [set](crate::world::Walls::set) elsewhere and have a motion;
    /// but rows of touching balls of very unlike masses that a fast one hits may end in another order,
    /// a ball that leans on one over three thousand times lighter may gain energy by friction,
    /// and a ball that another very fast one drives into a thin wall may get through.
    /// It finds contacts itself, so removing some from the world's lists does not keep marbles apart.
    SoftStep,
    /// Penalty method: forces that grow with penetration. Contacts last for a finite time, many
    /// marbles can push at once, and the load of a contact is a force in newtons.
    ///
    /// For engineers (with [`ContactLaw::HertzMindlin`]), and to see why games do without: a marble
    /// penetrates as far as the stiffness allows, and a stiffer contact needs shorter substeps. A
    /// contact that bears m times its marble's weight by [`ContactLaw::SpringDashpot`] penetrates
    /// by about 26 m g dt² at most, for substeps of dt seconds, and a collision at v m/s by about
    /// 5 v dt at most. Where either is more than its radius, a marble may pass through another
    /// one, or with [`Detection::Discrete`](crate::world::Detection::Discrete) through a thin wall;
    /// if it sinks in beyond the middle of the wall without leaving it, it comes back on the side
    /// that it came from. With [`Detection::Swept`](crate::world::Detection::Swept) a marble goes no
    /// deeper into a wall than half of its radius: there it bounces off as a rigid body, by its
    /// restitution. Half-spaces are the exception: they are solid all through, so springs alone turn
    /// a marble round there, however deep. No contact releases more energy than it absorbed, and penetration from the
    /// start separates at one radius per second at most.
    Penalty(ContactLaw),
    /// Event-driven: collisions in the order of time, each with its own normal at its own time of
    /// impact, thousands in one substep if need be. Nothing tunnels at any speed, and bounces lose
    /// no height except by restitution.
    ///
    /// Between events marbles fly along parabolas, with the integrator's mean acceleration of the
    /// substep; exact for gravity. A marble on one wall of any shape rests, rolls or slides by the
    /// equations of a rolling ball, and changes regime at the exact time. On half-spaces and flat
    /// faces these are solved in closed form. On curved surfaces (spheres, capsules, edges and
    /// corners) and on tilting walls they are integrated in steps in which the normal turns by 0.02
    /// rad at most, and a marble leaves where the normal force vanishes. Marbles that touch several
    /// walls, or other marbles, are solved as by [`Response::Impulse`], with as many iterations as
    /// needed for up to 4,000 contact solves altogether; only in larger heaps do the
    /// [iterations](crate::world::Model::iterations) count. Give it 50 or more there: an
    /// unconverged contact becomes one more event, which costs more. A series of bounces ends when
    /// the rest of it would take less than a few thousandths of a substep.
    ///
    /// A wall that was [set](crate::world::Walls::set) to another pose since the last step, and has
    /// a [motion](crate::world::WallMotion), moves through the step by that motion, and ends where
    /// it was set. A wall that only has a motion stays, and its surface carries what lies on it.
    ///
    /// Marbles that overlap more than twelve others of their size or larger are a crowd: no more than
    /// twelve can touch one. A crowd is solved once per substep, as by [`Response::Impulse`], with
    /// the 32 deepest contacts of each marble, and reports no impacts among its own. Overlap gives
    /// positions, not speeds: a marble is pushed by half of its radius per substep at most, so that
    /// a thousand at one point part within about four seconds.
    ///
    /// A step has a budget: 32 million tests against one wall or one other marble, plus 20,000 per
    /// marble, about a second for a few hundred. Each substep may spend its share, in the ratio of
    /// times, of what those before it have left. A marble that has not finished the substep by then
    /// stays where it is, loses its velocity, and is listed by
    /// [`World::stopped`](crate::world::World::stopped).
    ///
    /// Computes in `f64` also in a world of `f32`; see [`Precision`](crate::world::Precision) for
    /// what such a world stores of it. It detects its own collisions, so removing contacts from the
    /// world's lists does not keep marbles apart.
    EventDriven,
}

impl Response {
    /// Returns false for responses that support balls only.
    #[must_use]
    pub fn knows_capsules(self) -> bool {
        !matches!(self, Self::EventDriven | Self::SoftStep)
    }

    /// Returns false for responses that refuse marbles with
    /// [locked axes](crate::motion::LockedAxes).
    #[must_use]
    pub fn knows_locked_axes(self) -> bool {
        self != Self::EventDriven
    }

    /// Returns false for responses that refuse rigid bodies and joints.
    #[must_use]
    pub fn knows_bodies(self) -> bool {
        self == Self::SoftStep
    }

    /// True if only contacts with penetration matter: no speculative margin.
    pub(crate) fn needs_penetration(self) -> bool {
        matches!(self, Self::Penalty(_))
    }

    /// True if marbles are rows of the swarm's solver, which finds its own contacts and substeps.
    pub(crate) fn uses_swarm_rows(self) -> bool {
        self == Self::SoftStep
    }

    /// True if impulses are shared by mass, and marbles of infinite mass stay on their way.
    pub(crate) fn knows_masses(self) -> bool {
        self != Self::Displacement
    }

    /// True if the solver reads the column of inverse masses.
    pub(crate) fn reads_inverse_masses(self) -> bool {
        matches!(self, Self::Impulse | Self::Penalty(_))
    }

    /// True if a step stops what has more events than its budget.
    pub(crate) fn has_event_budget(self) -> bool {
        self == Self::EventDriven
    }

    /// True if pairs are listed that met within the substep and are apart at its end.
    pub(crate) fn lists_grazes(self) -> bool {
        matches!(self, Self::Displacement | Self::Impulse)
    }

    /// True if nothing passes through a wall, whatever the world's detection.
    pub(crate) fn never_passes_walls(self) -> bool {
        matches!(self, Self::EventDriven | Self::Displacement)
    }
}
