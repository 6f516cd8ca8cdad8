//! Conservative advancement (Mirtich, *Impulse-based dynamic simulation of rigid body systems*, 1996,
//! §2.3): while a plane separates two bodies they do not meet; where it may not do so any longer, the
//! next plane is that at their closest points. Each caller has its own loop, as bodies move differently.

use crate::math::Scalar;

/// Time for which a gap of zero or more metres stays open at least if it closes by `closing` m/s, and by
/// `acceleration` m/s² at most beyond that; infinite if it never closes. (With paths instead of seconds,
/// per path.)
pub(crate) fn time_to_close<S: Scalar>(gap: S, closing: S, acceleration: S) -> S {
    let zero = S::zero();
    if acceleration == zero {
        return if closing > zero { gap / closing } else { S::infinity() };
    }
    let two = S::from_f64(2.0);
    let discriminant = closing * closing + two * acceleration * gap;
    if discriminant < zero || (closing <= zero && acceleration < zero) {
        return S::infinity();
    }
    // Root of the quadratic equation in the form without cancellation.
    let root = discriminant.sqrt();
    if closing > zero { two * gap / (closing + root) } else { (root - closing) / acceleration }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// At that time the gap is closed, and not before.
        #[test]
        fn the_gap_closes_then_and_not_before(
            gap in 0.0_f64..10.0,
            closing in prop_oneof![-5.0_f64..5.0, Just(0.0)],
            acceleration in prop_oneof![-5.0_f64..5.0, Just(0.0)],
        ) {
            let time = time_to_close(gap, closing, acceleration);
            let left = |t: f64| gap - (closing + 0.5 * acceleration * t) * t;
            let before = if time.is_finite() { time } else { 1e3 };
            for part in 1..100 {
                prop_assert!(left(before * f64::from(part) / 100.0) >= -1e-9 * (1.0 + gap));
            }
            if time.is_finite() {
                prop_assert!(left(time).abs() <= 1e-9 * (1.0 + gap + closing.abs() * time));
            }
        }
    }
}
