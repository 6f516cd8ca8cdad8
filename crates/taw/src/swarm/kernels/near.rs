//! Pairs that are near.

use super::gather_from;
use crate::math::{Kernel, Row, Scalar, Simd, Vec3Wide};
use crate::swarm::batches::Batch;

/// Limits within which pairs count as near.
#[derive(Clone, Copy)]
pub(crate) struct NearLimits<S> {
    /// Separation in metres, besides what closes within the time.
    pub reach: S,
    /// Time within which pairs may come together, in seconds.
    pub time: S,
    /// Approach speed above which balls that touch come together, in m/s.
    pub fast: S,
}

/// Visits the pairs that are near and have a ball that is awake, and tells which may come together: begin
/// to touch within the time, or are fast although they overlap. The rows of all pairs exist.
pub(in crate::swarm) struct NearPairs<'a, S, V> {
    pub at: &'a [Row<S>],
    pub velocity: &'a [Row<S>],
    pub batches: &'a [Batch],
    pub limits: NearLimits<S>,
    /// Is given the two rows, and true for those that come together.
    pub visit: V,
}

/// Fraction of a separation or of a speed by which whoever decides may find them smaller or larger: with
/// other rounding.
const MARGIN: f64 = 1e-3;
/// Fraction of a distance that a separation may be off by rounding; more than
/// [`is_touching`](crate::contact::Contact::is_touching) allows for.
const ROUNDING: f64 = 1e-5;

impl<S: Scalar, V: FnMut([u32; 2], bool)> Kernel<S> for NearPairs<'_, S, V> {
    #[inline(always)]
    fn run<L: Simd<Scalar = S>>(mut self) {
        let (zero, least) = (L::constant(0.0), L::splat(S::min_positive_value()));
        let NearLimits { reach, time, fast } = self.limits;
        let (reach, time) = (L::splat(reach), L::splat(time));
        let (fast, shrunk) =
            (L::splat(fast * (S::one() - S::from_f64(MARGIN))), L::constant(1.0 - MARGIN));
        let rounding = L::constant(ROUNDING);
        for batch in self.batches.iter().filter(|batch| !batch.is_idle) {
            debug_assert!(batch.pairs().flatten().all(|row| (row as usize) < self.at.len()));
            // SAFETY: the rows of pairs exist, and nobody writes columns that are borrowed.
            let ([p, q], [u, v]) = unsafe {
                (gather_from(self.at.as_ptr(), batch), gather_from(self.velocity.as_ptr(), batch))
            };
            let apart: Vec3Wide<L> = Vec3Wide::of(&q) - Vec3Wide::of(&p);
            let squared = apart.dot(apart);
            let distance = squared.sqrt();
            let separation = distance - (p[3] + q[3]);
            let closing = (Vec3Wide::of(&u) - Vec3Wide::of(&v)).dot(apart);
            // Where the centers coincide there is no direction to come from.
            let speed = squared.select_gt(least, closing * (distance / squared), zero);
            let closes = speed.max(zero) * time;
            let far = separation.gt_mask(reach + closes);
            let gap = separation * shrunk - distance * rounding;
            let meets = !gap.gt_mask(closes) & speed.gt_mask(zero);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::time_of_impact_sphere_sphere;
    use crate::math::{LANES, SimdLevel};
    use crate::math::{Point3, Vec3, cast_vector};
    use crate::shape::Sphere;
    use cgmath::{EuclideanSpace, InnerSpace};
    use proptest::prelude::*;

    /// Pair of rows as eight equal lanes, of which one counts.
    fn batch() -> Batch {
        Batch { first: [0, 1], a: [0; LANES], b: [0; LANES], count: 1, is_idle: false }
    }

    proptest! {
        /// Whatever meets within the time, or touches and is fast, is said to come together, at any scale
        /// and any distance from the origin, near contact above all.
        #[test]
        fn who_meets_is_said_to_come(
            radii in prop::array::uniform2(-3.0_f32..1.0),
            gap in prop_oneof![-1e-2_f32..1e-2, -1e-5_f32..1e-5, Just(0.0)],
            directions in prop::array::uniform2(prop::array::uniform3(-1.0_f32..1.0)),
            speed in -7.0_f32..3.0,
            from in prop_oneof![Just(0.0_f32), -100.0_f32..100.0],
            gravity in prop_oneof![Just(0.0_f32), Just(9.81)],
        ) {
            let [towards, motion] = directions.map(Vec3::from);
            prop_assume!(towards.magnitude() > 0.1);
            let [r, s] = radii.map(|power| 10.0_f32.powf(power));
            let (time, smaller) = (1.0 / 60.0_f32, r.min(s));
            let centers = [
                Vec3::new(from, 0.0, 0.0),
                Vec3::new(from, 0.0, 0.0) + towards.normalize() * (r + s + gap * smaller),
            ];
            let velocity = motion * 10.0_f32.powf(speed) * smaller;
            let row = |v: Vec3<f32>, last: f32| [v.x, v.y, v.z, last];
            let at = [row(centers[0], r), row(centers[1], s)];
            let velocities = [row(velocity, 1.0), row(Vec3::new(0.0, 0.0, 0.0), 1.0)];
            let fast = 2.0 * gravity * time;
            let (mut visited, mut said) = (false, false);
            let visit = |_: [u32; 2], comes: bool| (visited, said) = (true, comes);
            let limits = NearLimits { reach: fast * time, time, fast };
            let batches = &[batch()];
            let near = NearPairs { at: &at, velocity: &velocities, batches, limits, visit };
            SimdLevel::default().run(near);
            let sphere = |center: Vec3<f32>, radius: f32| Sphere {
                center: Point3::from_vec(cast_vector::<f32, f64>(center)),
                radius: f64::from(radius),
            };
            let (a, b) = (sphere(centers[0], r), sphere(centers[1], s));
            let way = cast_vector::<f32, f64>(velocity) * f64::from(time);
            let meets =
                time_of_impact_sphere_sphere(&a, way, &b, Vec3::new(0.0, 0.0, 0.0)).is_some();
            let distance = (b.center - a.center).magnitude();
            let approach =
                cast_vector::<f32, f64>(velocity).dot(b.center - a.center) / distance;
            let separation = distance - a.radius - b.radius;
            let near = f64::from(limits.reach) + approach.max(0.0) * f64::from(time);
            prop_assert!(visited || separation > near - 1e-6 * distance, "{separation} {near}");
            let touches = separation <= 1e-6 * distance; // in any scalar
            let is_fast = touches && approach > f64::from(fast) && approach > 0.0;
            let meets = meets && !touches; // what touches already does not begin to
            prop_assert!(said || !visited || !(meets || is_fast), "{meets}, {approach} m/s");
        }
    }
}
