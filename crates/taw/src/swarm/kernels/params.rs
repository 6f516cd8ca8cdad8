//! Parameters of the solver's passes.

use crate::constraint::ContactSoftness;
use crate::math::Row;

/// Kind of a pass.
#[derive(Clone, Copy, Debug)]
pub(in crate::swarm) enum Pass<S> {
    /// Restitution: lets bounce what meets in a substep, above the threshold.
    Restitution(SolverParams<S>),
    /// Warm start: applies the impulses of the last substep again.
    WarmStart(SolverParams<S>),
    /// Lets nothing approach by more than the separation within a substep (speculative contacts).
    Solve(SolverParams<S>),
    /// Solves once more, after the balls moved, and moves what overlaps apart. What bears nothing
    /// and comes fast is left for the next bounce.
    Relax(SolverParams<S>),
}

/// Parameters of a substep.
///
/// Bounces come before gravity and contacts, one pair after another, each by the velocities that
/// the ones before it left: an impulse of at most twice what stops a pair adds no energy to it, so
/// none of them does, in whatever order and however many meet at once (Guendelman, Bridson and
/// Fedkiw, 2003, "Nonconvex rigid bodies with stacking"). What contacts remember is
/// left out of it: a bounce comes once.
#[derive(Clone, Copy, Debug)]
pub(in crate::swarm) struct SolverParams<S> {
    /// Speed below which two that come together are a contact, in m/s.
    pub restitution_threshold: S,
    /// The part of the speed that balls have afterwards.
    pub restitution: S,
    /// Length of a substep in seconds.
    pub time: S,
    /// In m/s².
    pub gravity: Row<S>,
    /// Stiffness of contacts.
    pub softness: ContactSoftness<S>,
    /// Overlap of two balls that is left alone, over twice the smaller radius.
    pub slop: S,
    /// Speed that the relax pass has to take back of a pair that is jammed, in m/s.
    pub jam_speed: S,
    /// Fraction of its radius by which a ball may sink into what it touches in a substep.
    pub max_sinking: S,
    /// Set if the relax pass moves apart what overlaps by more.
    pub moves_apart: bool,
    /// Set if bounces are noted as impacts.
    pub notes_impacts: bool,
}

/// So much of its radius a ball may be in a wall: more than what bears a heap gets.
pub(in crate::swarm) const WALL_SLOP: f64 = 0.1;
/// Mark of a ball that a wall bears in this step, be it through others; one less in the next
/// one, and after that not at all.
pub(in crate::swarm) const GROUNDED: f64 = 2.0;
