use cgmath::InnerSpace;

use super::closest::{Between, between, swaps};
use super::core::Convex;
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector};

/// When and where two moving things first touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch<S> {
    /// As a part of their motion, from zero to one.
    pub time: S,
    /// From the first to the second, a unit vector.
    pub normal: Vec3<S>,
    /// Where they touch then.
    pub point: Point3<S>,
}

/// What comes closer by less than this part of its motion does so by rounding.
pub(super) const SLIDES: f64 = 1e-12;

/// So many steps are enough for any touch but the slightest.
const STEPS: u32 = 200;

/// When two convex shapes that move along straight lines, without turning, first touch, if
/// they do; `a_moves` and `b_moves` is all of their motion. What touches from the start
/// and comes closer does so at once; what touches and parts, or only slides, does not.
///
/// Each step goes as far as the plane between them allows, so none is too long
/// (conservative advancement; Mirtich 1996). They touch where 1e-10 of their size is left.
#[must_use]
pub fn sweep<S: Scalar>(
    a: &(impl Convex<S> + ?Sized),
    a_moves: Vec3<S>,
    b: &(impl Convex<S> + ?Sized),
    b_moves: Vec3<S>,
) -> Option<Touch<S>> {
    if swaps(a, b) {
        let touch = sweep(b, b_moves, a, a_moves)?;
        return Some(Touch { normal: -touch.normal, ..touch });
    }
    let origin = cast_point::<S, f64>(a.middle());
    let (x, start) = (a.core(origin), b.core(origin));
    let (first, second) = (cast_vector::<S, f64>(a_moves), cast_vector::<S, f64>(b_moves));
    // As the first sees it.
    let motion = second - first;
    let near = 1e-10 * (x.size() + start.size());
    let mut time = 0.0;
    for _ in 0..STEPS {
        let y = start.moved(motion * time);
        let Between { distance, normal, on_a, .. } = between(&x, &y);
        let closing = -motion.dot(normal);
        if closing.is_nan() || closing <= 0.0 {
            return None; // a plane between them that they never cross again
        }
        if distance <= near {
            if closing <= SLIDES * motion.magnitude() {
                return None; // but for rounding, one slides along the other
            }
            return Some(Touch {
                time: S::constant(time),
                normal: cast_vector(normal),
                point: cast_point(origin + on_a + first * time),
            });
        }
        time += distance / closing;
        if time > 1.0 {
            return None;
        }
    }
    None
}
