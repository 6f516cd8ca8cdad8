//! Pairs of balls that meet within a substep.

use super::ALL;
use super::params::SolverParams;
use crate::math::{Scalar, Simd, Vec3Wide};

/// Meetings of the pairs of a batch within a substep.
#[derive(Clone, Copy)]
pub(super) struct PairMeeting<L> {
    /// Normal when they meet.
    pub normal: Vec3Wide<L>,
    /// Speed at which they then approach, in m/s: zero for those that do not meet, or too slowly.
    pub approach_speed: L,
    /// Time until they meet, in seconds.
    pub time: L,
}

/// Finds out which pairs meet within a substep.
#[inline(always)]
pub(super) fn meeting<S: Scalar, L: Simd<Scalar = S>>(
    params: &SolverParams<S>,
    [at_a, at_b]: [&[L; 4]; 2],
    [a, b]: [&[L; 4]; 2],
) -> PairMeeting<L> {
    let (zero, one, least) =
        (L::constant(0.0), L::constant(1.0), L::splat(S::min_positive_value()));
    let displacement = Vec3Wide::of(at_b) - Vec3Wide::of(at_a);
    let relative = Vec3Wide::of(b) - Vec3Wide::of(a);
    let reach = at_a[3] + at_b[3];
    let approach = zero - displacement.dot(relative);
    // Where a sphere as wide as both meets a point.
    let apart = (displacement.dot(displacement) - reach * reach).max(zero);
    let limit = L::splat(params.time);
    // Nobody is there before half of the time that the approach would take.
    let farthest = approach * (limit * L::constant(2.0 * (1.0 + 1e-5)));
    if apart.gt_mask(farthest) == ALL {
        return PairMeeting { normal: displacement, approach_speed: zero, time: zero };
    }
    // By how far it goes past the point, which is exact from afar too.
    let speed = relative.dot(relative);
    let across = displacement + relative * speed.select_gt(least, approach / speed, zero);
    let square = speed * (reach * reach - across.dot(across));
    let time = approach.select_gt(zero, apart / (approach + square.max(zero).sqrt()), zero);
    // Of what does not meet, any time will do: what hardly moves would take longer than a number
    // is.
    let meets = limit.select_gt(time, one, zero);
    let time = limit.select_gt(time, time, zero);
    let then = displacement + relative * time;
    let length = then.dot(then).sqrt();
    let inverse = length.select_gt(zero, one / length, zero);
    let normal = then * inverse;
    let approach_speed = zero - relative.dot(normal);
    let approach_speed =
        approach_speed.select_gt(L::splat(params.restitution_threshold), approach_speed, zero);
    let approach_speed = square.select_gt(zero, approach_speed, zero);
    PairMeeting { normal, approach_speed: meets.select_gt(zero, approach_speed, zero), time }
}
