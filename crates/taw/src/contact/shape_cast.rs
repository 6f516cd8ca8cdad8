use cgmath::InnerSpace;

use super::advance::time_to_close;
use super::closest::{LocalClosestPoints, local_closest_points, should_swap};
use super::core::Convex;
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector};

/// First contact of two moving shapes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeCastHit<S> {
    /// Time of impact as a fraction of the motion, in [0, 1].
    pub time: S,
    /// Unit vector from the first to the second.
    pub normal: Vec3<S>,
    /// Contact point at that time, in metres.
    pub point: Point3<S>,
}

/// Approach slower than this fraction of the motion is rounding noise.
pub(super) const SLIDING: f64 = 1e-12;

/// Enough for any contact except the most grazing.
const MAX_ITERATIONS: u32 = 200;

/// First contact of two convex shapes that translate along straight lines, without rotation; none
/// if they do not meet. Shapes that touch at the start hit at once if they approach, and not if
/// they separate or only slide.
///
/// Conservative advancement (Mirtich 1996): each iteration advances as far as the separating plane
/// allows. The shapes touch where 1e-10 of their size is left.
#[must_use]
pub fn shape_cast<S: Scalar>(
    a: &(impl Convex<S> + ?Sized),
    a_translation: Vec3<S>,
    b: &(impl Convex<S> + ?Sized),
    b_translation: Vec3<S>,
) -> Option<ShapeCastHit<S>> {
    if should_swap(a, b) {
        let touch = shape_cast(b, b_translation, a, a_translation)?;
        return Some(ShapeCastHit { normal: -touch.normal, ..touch });
    }
    let origin = cast_point::<S, f64>(a.center());
    let (x, start) = (a.core(origin), b.core(origin));
    let (first, second) =
        (cast_vector::<S, f64>(a_translation), cast_vector::<S, f64>(b_translation));
    // Relative to the first shape.
    let motion = second - first;
    let near = 1e-10 * (x.size() + start.size());
    let mut time = 0.0;
    for _ in 0..MAX_ITERATIONS {
        let y = start.translated(motion * time);
        let LocalClosestPoints { distance, normal, on_a, .. } = local_closest_points(&x, &y);
        let approach_speed = -motion.dot(normal);
        if approach_speed.is_nan() || approach_speed <= 0.0 {
            return None; // a plane between them that they never cross again
        }
        if distance <= near {
            if approach_speed <= SLIDING * motion.magnitude() {
                return None; // one slides along the other, to within rounding
            }
            return Some(ShapeCastHit {
                time: S::from_f64(time),
                normal: cast_vector(normal),
                point: cast_point(origin + on_a + first * time),
            });
        }
        time += time_to_close(distance, approach_speed, 0.0);
        if time > 1.0 {
            return None;
        }
    }
    None
}
