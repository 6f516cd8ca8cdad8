//! Pairs that are near.

use crate::swarm::batches::Batch;
use crate::swarm::simd::{Kernel, Row, Simd};
use crate::swarm::vec3_wide::Vec3Wide;

/// Limits within which pairs count as near.
#[derive(Clone, Copy)]
pub(crate) struct NearLimits {
    /// Separation in metres, besides what closes within a time, in seconds.
    pub reach: f32,
    pub time: f32,
    /// Approach speed above which balls that touch come together, in m/s.
    pub fast: f32,
}

/// Visits the pairs that are near and have a ball that is awake, and tells which may come together: begin to touch
/// within the time, or are fast although they overlap. The rows of all pairs exist.
pub(in crate::swarm) struct NearPairs<'a, V> {
    pub at: &'a [Row],
    pub velocity: &'a [Row],
    pub batches: &'a [Batch],
    pub limits: NearLimits,
    /// Is given the two rows, and true for those that come together.
    pub visit: V,
}

/// Fraction of a separation that rounding may hide.
const ROUNDING: f32 = 1e-3;

impl<V: FnMut([u32; 2], bool)> Kernel for NearPairs<'_, V> {
    #[inline(always)]
    fn run<L: Simd>(mut self) {
        let (zero, least) = (L::splat(0.0), L::splat(f32::MIN_POSITIVE));
        let NearLimits { reach, time, fast } = self.limits;
        let [reach, time] = [reach, time].map(L::splat);
        let [fast, shrunk] = [fast * (1.0 - ROUNDING), 1.0 - ROUNDING].map(L::splat);
        for batch in self.batches {
            let [p, q] = gather::<L>(self.at, batch);
            let [u, v] = gather::<L>(self.velocity, batch);
            let apart = Vec3Wide::of(&q) - Vec3Wide::of(&p);
            let squared = apart.dot(apart);
            let distance = squared.sqrt();
            let separation = distance - (p[3] + q[3]);
            let closing = (Vec3Wide::of(&u) - Vec3Wide::of(&v)).dot(apart);
            let speed = squared.select_gt(least, closing * (distance / squared), zero);
            let closes = speed.max(zero) * time;
            let far = separation.gt_mask(reach + closes);
            let meets = !(separation * shrunk).gt_mask(closes) & speed.gt_mask(zero);
            let comes = meets & (separation.gt_mask(zero) | speed.gt_mask(fast));
            let asleep = zero.gt_mask(u[3]) & zero.gt_mask(v[3]);
            let mut left = !(far | asleep) & ((1 << batch.count) - 1);
            while left != 0 {
                let lane = left.trailing_zeros();
                (self.visit)(batch.pair(lane as usize), comes >> lane & 1 != 0);
                left &= left - 1;
            }
        }
    }
}

/// The rows of a column that the pairs of a batch are about.
#[inline(always)]
fn gather<L: Simd>(column: &[Row], batch: &Batch) -> [[L; 4]; 2] {
    let [a, b] = batch.first.map(|row| column.as_ptr().wrapping_add(row as usize));
    // SAFETY: they exist, and nobody writes a column that is borrowed.
    unsafe { [L::gather(a, &batch.a), L::gather(b, &batch.b)] }
}
