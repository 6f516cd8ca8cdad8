//! Time of impact. Within a substep every trajectory is a parabola, so the distance to a plane is a
//! quadratic in time, and the squared distance of two centers a quartic.

use cgmath::InnerSpace;

use crate::contact::time_to_close;
use crate::math::Vec3;

/// Separation along a normal, its rate and the rate of that: m, m/s, m/s².
#[derive(Clone, Copy, Debug)]
pub(super) struct SeparationMotion {
    pub distance: f64,
    pub speed: f64,
    pub acceleration: f64,
}

/// Time of impact on a plane, in seconds, from a positive separation; none if there is no impact.
pub(super) fn time_of_impact_plane(separation: SeparationMotion) -> Option<f64> {
    let SeparationMotion { distance, speed, acceleration } = separation;
    Some(time_to_close(distance, -speed, -acceleration)).filter(|time| !time.is_infinite())
}

/// Time of impact of two spheres between `start` and `end`, in seconds, from the offset of their
/// centers, relative velocity and relative acceleration; they are separated at `start`.
pub(super) fn time_of_impact_spheres(
    center_offset: Vec3<f64>,
    velocity: Vec3<f64>,
    acceleration: Vec3<f64>,
    radius_sum: f64,
    [start, end]: [f64; 2],
) -> Option<f64> {
    let distance = center_offset.magnitude();
    // Difference of squares without cancellation for nearly equal ones.
    let gap_squared = (distance - radius_sum) * (distance + radius_sum);
    let (radial, squared) = (center_offset.dot(velocity), velocity.magnitude2());
    if acceleration.magnitude2() == 0.0 {
        // Relative motion along a line: |center_offset + velocity t|² = radius_sum².
        let discriminant = radial * radial - squared * gap_squared;
        if radial >= 0.0 || discriminant < 0.0 {
            return None;
        }
        let time = gap_squared / (discriminant.sqrt() - radial);
        return (time >= start && time <= end).then_some(time);
    }
    let quartic = [
        gap_squared,
        2.0 * radial,
        squared + center_offset.dot(acceleration),
        velocity.dot(acceleration),
        0.25 * acceleration.magnitude2(),
    ];
    first_root(quartic, start, end)
}

/// First root of a quartic (lowest coefficient first) with a sign change from positive to negative.
///
/// Between the roots of its second derivative the first is monotone, and between the roots of that
/// the quartic itself, so no root is missed, however close two are.
fn first_root(c: [f64; 5], start: f64, end: f64) -> Option<f64> {
    let value = |t: f64| (((c[4] * t + c[3]) * t + c[2]) * t + c[1]) * t + c[0];
    let slope = |t: f64| ((4.0 * c[4] * t + 3.0 * c[3]) * t + 2.0 * c[2]) * t + c[1];
    let mut extrema = [end; 3]; // of the quartic
    let mut count = 0;
    let mut lo = start;
    for hi in inflections(c, start, end) {
        if (slope(lo) < 0.0) != (slope(hi) < 0.0) && count < 3 {
            extrema[count] = bisect(slope, lo, hi);
            count += 1;
        }
        lo = hi;
    }
    let mut lo = start;
    for hi in extrema.into_iter().take(count).chain([end]) {
        if value(lo) > 0.0 && value(hi) <= 0.0 {
            return Some(bisect(value, lo, hi));
        }
        lo = hi;
    }
    None
}

/// Inflection points of a quartic, in order, and then `end`.
fn inflections(c: [f64; 5], start: f64, end: f64) -> impl Iterator<Item = f64> {
    // 12 c4 t² + 6 c3 t + 2 c2, halved. c4 is above zero.
    let (a, half_b) = (6.0 * c[4], 1.5 * c[3]);
    let discriminant = half_b * half_b - a * c[2];
    let zeros = if discriminant > 0.0 {
        // Sum without cancellation, and the other root by the product.
        let q = -(half_b + half_b.signum() * discriminant.sqrt());
        let (x, y) = (q / a, c[2] / q);
        [x.min(y), x.max(y)]
    } else {
        [end; 2]
    };
    zeros.into_iter().filter(move |t| *t > start && *t < end).chain([end])
}

/// Root of a function with different signs at both ends: by the secant where that narrows the
/// bracket well, else by bisection (Illinois, Dowell and Jarratt 1971).
fn bisect(f: impl Fn(f64) -> f64, mut lo: f64, mut hi: f64) -> f64 {
    let (mut f_lo, mut f_hi) = (f(lo), f(hi));
    let falling = f_lo > 0.0;
    for _ in 0..100 {
        let secant = (lo * f_hi - hi * f_lo) / (f_hi - f_lo);
        let middle = if secant > lo && secant < hi { secant } else { 0.5 * (lo + hi) };
        if middle <= lo || middle >= hi || hi - lo <= 1e-16 * hi.abs() {
            break;
        }
        let f_middle = f(middle);
        if (f_middle > 0.0) == falling {
            (lo, f_lo) = (middle, f_middle);
            f_hi *= 0.5;
        } else {
            (hi, f_hi) = (middle, f_middle);
            f_lo *= 0.5;
        }
        if f_middle == 0.0 {
            return middle;
        }
    }
    // The side before the impact, without penetration.
    if falling { lo } else { hi }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cgmath::Zero;
    use proptest::prelude::*;

    #[test]
    fn a_fall_takes_the_square_root_of_twice_its_height() {
        let gap = |distance, speed, acceleration| {
            time_of_impact_plane(SeparationMotion { distance, speed, acceleration })
        };
        assert_eq!(gap(8.0, 0.0, -4.0), Some(2.0));
        assert_eq!(gap(3.0, -1.0, -4.0), Some(1.0));
        assert_eq!(gap(0.0, 3.0, -2.0), Some(3.0), "up and down again");
        assert_eq!(gap(1.0, -0.5, 0.0), Some(2.0));
        assert_eq!(gap(1.0, -2.0, 2.0), Some(1.0), "just reaches it");
        for never in [gap(1.0, -2.0, 2.1), gap(1.0, 0.0, 0.0), gap(1.0, 1.0, 0.0)] {
            assert_eq!(never, None);
        }
    }

    #[test]
    fn balls_on_lines_meet_when_the_distance_says() {
        let center_offset = Vec3::new(5.0, 3.0, 0.0);
        let meet = |v: f64| {
            time_of_impact_spheres(
                center_offset,
                Vec3::new(-v, 0.0, 0.0),
                Vec3::zero(),
                5.0,
                [0.0, 9.0],
            )
        };
        assert!((meet(0.5).unwrap() - 2.0).abs() < 1e-15);
        assert_eq!(meet(-1.0), None);
        assert_eq!(meet(0.1), None, "too late");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2_000))]

        /// Compared with a search in small steps.
        #[test]
        fn the_first_meeting_is_found(
            center_offset in [-3.0..3.0_f64, -3.0..3.0, -3.0..3.0],
            velocity in [-3.0..3.0_f64, -3.0..3.0, -3.0..3.0],
            acceleration in [-9.0..9.0_f64, -9.0..9.0, -9.0..9.0],
        ) {
            let [d, v, a] = [center_offset, velocity, acceleration].map(Vec3::from);
            prop_assume!(d.magnitude() > 1.01);
            let distance = |t: f64| (d + v * t + a * (0.5 * t * t)).magnitude();
            let found = time_of_impact_spheres(d, v, a, 1.0, [0.0, 2.0]);
            let walked = (0..=20_000).map(|i| f64::from(i) * 1e-4).find(|t| distance(*t) <= 1.0);
            match (found, walked) {
                (Some(found), Some(walked)) => {
                    prop_assert!(found <= walked && found >= walked - 1e-4 - 1e-12);
                    prop_assert!((distance(found) - 1.0).abs() < 1e-12);
                }
                // The search may step over a short contact.
                (Some(found), None) => prop_assert!((distance(found) - 1.0).abs() < 1e-12),
                (None, walked) => prop_assert_eq!(walked, None),
            }
        }
    }
}
