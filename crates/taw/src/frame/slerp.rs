use cgmath::InnerSpace;

use crate::math::{Quat, Scalar};

/// The rotation that is `part` of the way from one to another, at a steady speed and the
/// short way round (Shoemake 1985). Parts outside of [0, 1] go on beyond.
#[must_use]
pub fn slerp<S: Scalar>(from: Quat<S>, to: Quat<S>, part: S) -> Quat<S> {
    let to = if from.dot(to) < S::zero() { -to } else { to };
    // Right for any angle between them (Kahan, *How futile are mindless assessments of
    // roundoff*, 2006, §12); an arc cosine is not where it is small.
    let angle = (to - from).magnitude().atan2_portable((to + from).magnitude()) * S::constant(2.0);
    let (sin, _) = angle.sin_cos_portable();
    let weight = |part: S| {
        // So near that sines are angles.
        if angle < S::epsilon() { part } else { (angle * part).sin_cos_portable().0 / sin }
    };
    (from * weight(S::one() - part) + to * weight(part)).normalize()
}
