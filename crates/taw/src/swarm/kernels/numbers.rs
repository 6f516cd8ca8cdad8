//! Numbers of a batch: of the surfaces of its pairs, or those that all have in common.

use super::inverse_mass;
use super::meeting::meeting;
use super::params::SolverParams;
use crate::math::Simd;
use crate::motion::BALL_INVERSE_INERTIA;
use crate::swarm::surfaces::PairNumbers;

/// Numbers of the surfaces of a batch.
#[derive(Clone, Copy)]
pub(super) struct Numbers<L> {
    pub friction: L,
    pub restitution: L,
    pub tangential_restitution: L,
    /// Mass times radius squared over the moment of inertia of both.
    pub inertia_factors: [L; 2],
}

impl<L: Simd> Numbers<L> {
    #[inline(always)]
    pub fn load<const OWN: bool>(
        own: &[PairNumbers<L::Scalar>],
        batch: usize,
        friction: L::Scalar,
        restitution: L::Scalar,
    ) -> Self {
        if OWN {
            let PairNumbers {
                friction,
                restitution,
                tangential_restitution,
                inertia_factors: [a, b],
                ..
            } = &own[batch];
            Self {
                friction: L::load(friction),
                restitution: L::load(restitution),
                tangential_restitution: L::load(tangential_restitution),
                inertia_factors: [L::load(a), L::load(b)],
            }
        } else {
            Self {
                friction: L::splat(friction),
                restitution: L::splat(restitution),
                tangential_restitution: L::constant(0.0),
                inertia_factors: [L::constant(BALL_INVERSE_INERTIA); 2],
            }
        }
    }

    /// One where a pair is no contact yet: it bears nothing and comes fast.
    #[inline(always)]
    pub fn fresh<const FIRST: bool>(
        &self,
        params: &SolverParams<L::Scalar>,
        at: [&[L; 4]; 2],
        velocity: [&[L; 4]; 2],
        before: L,
        [separation, parting]: [L; 2],
    ) -> L {
        let (zero, speed) = (L::constant(0.0), L::splat(params.restitution_threshold));
        let fast = (zero - parting).select_gt(speed, L::constant(1.0), zero);
        let fresh = before.select_gt(zero, zero, fast);
        if fresh.gt_mask(zero) == 0 {
            return fresh;
        }
        let bounces = self.restitution.select_gt(zero, fresh, zero);
        // Where nothing bounces, all is a contact but what passes by far away.
        let beside = (at[0][3] + at[1][3]) * L::constant(0.5);
        let stops = self.restitution.select_gt(zero, zero, fresh);
        let stops = separation.select_gt(beside, stops, zero);
        let unsure = if FIRST { bounces + stops } else { stops };
        if unsure.gt_mask(zero) == 0 {
            return bounces;
        }
        // What meets nevertheless is stopped: it may come so fast only because of impulses that were
        // applied again, and are taken back by the contacts that bear them.
        let meets = meeting(params, at, velocity).approach_speed;
        let missed = meets.select_gt(zero, zero, unsure);
        if FIRST { missed } else { bounces + missed }
    }

    /// Effective mass of the touched points across the normal. `alone` is that along it.
    #[inline(always)]
    pub fn tangent_mass<const OWN: bool>(&self, alone: L, [a, b]: [&[L; 4]; 2]) -> L {
        if OWN {
            let one = L::constant(1.0);
            let [of_a, of_b] = self.inertia_factors;
            let sum = inverse_mass(a) * (one + of_a) + inverse_mass(b) * (one + of_b);
            sum.select_gt(L::constant(0.0), one / sum, L::constant(0.0))
        } else {
            alone * L::constant(2.0 / 7.0)
        }
    }
}
