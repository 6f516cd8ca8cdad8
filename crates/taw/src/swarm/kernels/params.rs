//! Parameters of the solver's passes.

use crate::swarm::simd::{Row, Simd};

/// Kind of a pass.
#[derive(Clone, Copy, Debug)]
pub(in crate::swarm) enum Pass {
    /// Restitution: lets bounce what meets in a substep, above the threshold.
    Restitution(SolverParams),
    /// Warm start: applies the impulses of the last substep again.
    WarmStart(SolverParams),
    /// Lets nothing approach by more than the separation within a substep (speculative contacts).
    Solve(SolverParams),
    /// Solves once more, after the balls moved, and moves what overlaps apart. What bears nothing
    /// and comes fast is left for the next bounce.
    Relax(SolverParams),
}

/// Parameters of a substep.
///
/// Bounces come before gravity and contacts, one pair after another, each by the velocities that
/// the ones before it left: an impulse of at most twice what stops a pair adds no energy to it, so
/// none of them does, in whatever order and however many meet at once (Guendelman, Bridson and
/// Fedkiw, 2003, "Nonconvex rigid bodies with stacking"). What contacts remember is
/// left out of it: a bounce comes once.
#[derive(Clone, Copy, Debug)]
pub(in crate::swarm) struct SolverParams {
    /// Speed below which two that come together are a contact, in m/s.
    pub restitution_threshold: f32,
    /// The part of the speed that balls have afterwards.
    pub restitution: f32,
    /// Length of a substep in seconds.
    pub time: f32,
    /// In m/s².
    pub gravity: Row,
    /// Stiffness of contacts.
    pub softness: Softness,
}

/// Stiffness by which contacts bear what lies on them: overlap makes it part a little, which the
/// pass after that takes back, though not what contacts have learned to bear. What they give back
/// is what damps it: impulses that are applied again and corrected once a substep swing for a long
/// time, and what pushes overlap out meanwhile makes them swing more (Catto, `Solver2D`, 2024: soft
/// contacts).
#[derive(Clone, Copy, Debug)]
pub(in crate::swarm) struct Softness {
    /// The part of an overlap that is to go per second.
    pub bias_rate: f32,
    /// Speed of that at most, in m/s.
    pub max_push_speed: f32,
    /// The part of the impulse that a hard contact would need, and how much of what it has borne
    /// so far it gives back.
    pub mass_scale: f32,
    pub impulse_scale: f32,
    /// So much of twice the smaller radius two balls may overlap before they are moved apart.
    pub slop: f32,
}

impl Softness {
    /// Velocity that a separation adds to the target, the part of the impulse of a hard contact
    /// that is applied, and the part of the accumulated one that is given back: an overlap is soft,
    /// a gap may close within the substep.
    #[inline(always)]
    pub fn of<L: Simd>(self, separation: L, per_second: L) -> (L, L, L) {
        let (zero, one) = (L::splat(0.0), L::splat(1.0));
        let pushed = (separation * L::splat(self.bias_rate)).max(L::splat(-self.max_push_speed));
        let bias = separation.select_gt(zero, separation * per_second, pushed);
        let part = separation.select_gt(zero, one, L::splat(self.mass_scale));
        let back = separation.select_gt(zero, zero, L::splat(self.impulse_scale));
        (bias, part, back)
    }
}

/// So much of its radius a ball may be in a wall: more than what bears a heap gets.
pub(in crate::swarm) const WALL_SLOP: f32 = 0.1;
/// Mark of a ball that a wall bears in this step, be it through others; one less in the next
/// one, and after that not at all.
pub(in crate::swarm) const GROUNDED: f32 = 2.0;
