use cgmath::InnerSpace;

use crate::math::{Quat, Scalar};

/// Spherical linear interpolation from one rotation to another by a fraction, the short way round
/// (Shoemake 1985). Fractions outside of [0, 1] extrapolate.
#[must_use]
pub fn slerp<S: Scalar>(from: Quat<S>, to: Quat<S>, fraction: S) -> Quat<S> {
    let to = if from.dot(to) < S::zero() { -to } else { to };
    // Accurate for any angle between them (Kahan, *How futile are mindless assessments of
    // roundoff*, 2006, §12); an arc cosine is not for small ones.
    let angle = (to - from).magnitude().atan2_portable((to + from).magnitude()) * S::from_f64(2.0);
    let (sin, _) = angle.sin_cos_portable();
    let weight = |fraction: S| {
        // Small-angle limit.
        if angle < S::epsilon() { fraction } else { (angle * fraction).sin_cos_portable().0 / sin }
    };
    (from * weight(S::one() - fraction) + to * weight(fraction)).normalize()
}
