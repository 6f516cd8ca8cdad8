//! Balls that fall exactly onto the top of others, as in [`tipping`](crate::constraint::tipping_speed).

use super::direction;
use super::params::SolverParams;
use crate::constraint::{ContactImpulse, TIPPING, tipping_speed};
use crate::math::{LANES, RealVector, Scalar, Simd, Vec3Wide};
use crate::swarm::batches::Batch;

/// Largest coefficient of restitution of such an impact: what moves across the normal takes its energy
/// from the bounce, `TIPPING`² and at most five halves as much in spin.
const RESTITUTION: f64 = 1.0 - 4.0 * TIPPING * TIPPING;

/// Velocities by which pairs leave the top that one falls onto at this approach speed, across the normal, in
/// a direction of each pair's own. None if there is no such pair.
#[inline(always)]
pub(super) fn tip<S: Scalar, L: Simd<Scalar = S>>(
    batch: &Batch,
    params: &SolverParams<S>,
    normal: Vec3Wide<L>,
    approach_speed: L,
) -> Option<Vec3Wide<L>> {
    let zero = L::constant(0.0);
    let gravity = Vec3Wide::of(&params.gravity.map(L::splat));
    let speed = tipping_speed(normal, gravity, approach_speed);
    if speed.gt_mask(zero) == 0 {
        return None;
    }
    let mut directions = [[S::zero(); LANES]; 3];
    for lane in 0..LANES {
        let direction = direction(batch.pair(lane));
        for (axis, x) in directions.iter_mut().zip(direction) {
            axis[lane] = x;
        }
    }
    Some(Vec3Wide::load(&directions).reject_from(normal) * speed)
}

/// Coefficient of restitution of pairs that leave a top by these velocities.
#[inline(always)]
pub(super) fn restitution<L: Simd>(tipping: Vec3Wide<L>, restitution: L) -> L {
    let most = L::constant(RESTITUTION);
    let most = restitution.select_gt(most, most, restitution);
    tipping.dot(tipping).select_gt(L::constant(0.0), most, restitution)
}

/// Change of an impulse that stops a pair, for pairs of this normal impulse before, parting speed, and
/// effective mass. Those that had none and came fast tip over: without restitution, nothing else lets them.
#[inline(always)]
pub(super) fn lean<L: Simd>(
    batch: &Batch,
    params: &SolverParams<L::Scalar>,
    normal: Vec3Wide<L>,
    (before, mut change): (L, ContactImpulse<L, Vec3Wide<L>>),
    (parting, mass): (L, L),
) -> ContactImpulse<L, Vec3Wide<L>> {
    let (zero, threshold) = (L::constant(0.0), L::splat(params.restitution_threshold));
    if !params.notes_impacts {
        return change; // in swarms alone nothing has to
    }
    let fast = (zero - parting).select_gt(threshold, zero - parting, zero);
    if fast.gt_mask(zero) == 0 {
        return change;
    }
    let struck = before.select_gt(zero, zero, change.normal.select_gt(zero, fast, zero));
    if let Some(tipping) = tip(batch, params, normal, struck) {
        change.tangent = change.tangent + tipping * mass;
    }
    change
}
