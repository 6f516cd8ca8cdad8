//! Impacts of balls exactly onto the top of others. In numbers these could stand there for ever, one upon the
//! other; no real ones are that even.

use crate::math::{Real, RealVector, Scalar, Vec3, any_direction, normalize_and_length};

/// Sine of the angle between normal and gravity up to which a ball is on the top of another: some
/// roundings of `f32`.
const UPRIGHT: f64 = 1e-6;
/// Speed across the normal after an impact, over the approach speed: an unevenness of a tenth of a
/// millimetre on a ball of ten centimetres.
pub(crate) const TIPPING: f64 = 1e-3;

/// Speed across the normal by which balls leave the top that they fall onto at this approach speed; zero if
/// the normal is not upright.
#[inline(always)]
pub(crate) fn tipping_speed<R: Real>(
    normal: R::Vector,
    gravity: R::Vector,
    approach_speed: R,
) -> R {
    let across = gravity.reject_from(normal);
    let limit = gravity.inner_product(gravity) * R::constant(UPRIGHT * UPRIGHT);
    let on_top = across.inner_product(across);
    limit.select_gt(on_top, approach_speed * R::constant(TIPPING), R::constant(0.0))
}

/// Normal of the impact of two rows: an upright one leans in a direction of each pair's own, by this
/// that what is stopped along it leaves the top by the [tipping speed](tipping_speed). An impulse along
/// another unit normal conserves momentum and energy as one along the old one does.
pub(crate) fn tipped<S: Scalar>(normal: Vec3<S>, gravity: Vec3<S>, [a, b]: [u32; 2]) -> Vec3<S> {
    let slope = tipping_speed(normal, gravity, S::one());
    if slope == S::zero() {
        return normal;
    }
    let leaning = normal + any_direction(a, b).reject_from(normal) * slope;
    normalize_and_length(leaning).map_or(normal, |(leaning, _)| leaning)
}

#[cfg(test)]
mod tests {
    use cgmath::{InnerSpace, Zero};

    use super::*;

    #[test]
    fn only_an_upright_normal_leans_and_each_pair_its_own_way() {
        let gravity = Vec3::new(0.0, -9.81_f64, 0.0);
        let up = Vec3::unit_y();
        let [one, other] = [[0, 1], [1, 2]].map(|rows| tipped(up, gravity, rows));
        for leaning in [one, other] {
            assert!((leaning.magnitude() - 1.0).abs() < 1e-15);
            let slope = (leaning - up).magnitude();
            assert!(slope > 0.0 && slope <= TIPPING, "{slope}");
        }
        assert!((one - other).magnitude() > 0.1 * TIPPING, "{one:?} {other:?}");
        let askew = Vec3::new(2e-6, 1.0, 0.0).normalize();
        assert_eq!(tipped(askew, gravity, [0, 1]), askew);
        assert_eq!(tipped(up, Vec3::zero(), [0, 1]), up, "without gravity nothing is on top");
    }
}
