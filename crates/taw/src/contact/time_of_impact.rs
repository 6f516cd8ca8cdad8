use cgmath::{InnerSpace, Matrix3, Quaternion};

use super::advance::time_to_close;
use super::closest::{LocalClosestPoints, local_closest_points};
use super::core::{Convex, Core};
use super::shape_cast::{SLIDING, ShapeCastHit};
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector, normalize_and_length};

/// Rigid motion over a time interval at constant velocity and angular velocity (a sweep).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep<S> {
    /// Translation of the center, in metres.
    pub translation: Vec3<S>,
    /// Rotation about the center: an axial vector, in radians.
    pub rotation: Vec3<S>,
    /// Center of rotation, which only translates; for a free body, its center of mass. In metres.
    pub center: Point3<S>,
}

/// A moving core in `f64` relative to an origin.
struct MovingCore<'a> {
    /// Relative to the center of rotation.
    core: Core<'a>,
    translation: Vec3<f64>,
    rotation: Vec3<f64>,
    center: Vec3<f64>,
    /// Bound of the path curvature: half of the squared angular velocity times the farthest
    /// distance from the center. Times the squared time, it bounds how much nearer a point comes
    /// than its velocity predicts.
    curvature: f64,
}

impl<'a> MovingCore<'a> {
    fn new<S: Scalar>(
        shape: &'a (impl Convex<S> + ?Sized),
        sweep: &Sweep<S>,
        origin: Point3<f64>,
    ) -> Self {
        let center = cast_point::<S, f64>(sweep.center) - origin;
        let rotation = cast_vector::<S, f64>(sweep.rotation);
        let core = shape.core(origin).translated(-center);
        let farthest = core.inside().magnitude() + 2.0 * core.size() + core.radius;
        let curvature = 0.5 * rotation.magnitude2() * farthest;
        Self { core, translation: cast_vector(sweep.translation), rotation, center, curvature }
    }

    fn at(&self, time: f64) -> Core<'a> {
        let turned = match normalize_and_length(self.rotation) {
            Some((axis, angle)) => {
                let (sin, cos) = (0.5 * angle * time).sin_cos_portable();
                self.core.rotated(Matrix3::from(Quaternion::from_sv(cos, axis * sin)))
            }
            None => self.core,
        };
        turned.translated(self.center + self.translation * time)
    }

    /// Upper bound of the support distance along a direction some time after a given pose.
    fn support_bound(
        &self,
        pose: &Core<'_>,
        center: Vec3<f64>,
        direction: Vec3<f64>,
        after: f64,
    ) -> f64 {
        // (direction + after · direction × rotation) · p is where a point p relative to the center
        // would be if it went straight on.
        let ahead = direction + direction.cross(self.rotation) * after;
        let farthest = (pose.support(ahead).0 - center).dot(ahead) + center.dot(direction);
        farthest + pose.radius + (self.translation.dot(direction) + self.curvature * after) * after
    }

    fn velocity(&self, time: f64, point: Vec3<f64>) -> Vec3<f64> {
        self.translation + self.rotation.cross(point - self.center - self.translation * time)
    }
}

/// More iterations than any pair takes unless one slides along the other; then they count as
/// touching, early rather than late.
const MAX_ITERATIONS: u32 = 10_000;
/// Iterations of the root search for the time until which a plane separates the two.
const MAX_ROOT_ITERATIONS: u32 = 4;

/// Time of impact of two convex shapes that translate and rotate; none if they do not meet. Shapes
/// that touch at the start hit at once if their points approach there, and not at all otherwise.
///
/// Conservative advancement (Mirtich, *Impulse-based dynamic simulation of rigid body systems*,
/// 1996, §2.3, with the curvature of the paths beside their velocities). The shapes touch where
/// less than 1e-6 of their size is left: nearer than that, the normal between nearly parallel edges
/// is rounded.
#[must_use]
pub fn time_of_impact<S: Scalar>(
    a: &(impl Convex<S> + ?Sized),
    a_sweep: &Sweep<S>,
    b: &(impl Convex<S> + ?Sized),
    b_sweep: &Sweep<S>,
) -> Option<ShapeCastHit<S>> {
    let origin = cast_point::<S, f64>(a.center());
    let (x, y) = (MovingCore::new(a, a_sweep, origin), MovingCore::new(b, b_sweep, origin));
    let near = 1e-9 * (x.core.size() + y.core.size());
    let mut time = 0.0;
    for step in 0..MAX_ITERATIONS {
        let (p, q) = (x.at(time), y.at(time));
        let LocalClosestPoints { distance, normal, on_a, on_b } = local_closest_points(&p, &q);
        // Lower bound of the separation along the normal; a concave function of the time.
        let centers = [&x, &y].map(|it| it.center + it.translation * time);
        let separation = |after: f64| {
            -x.support_bound(&p, centers[0], normal, after)
                - y.support_bound(&q, centers[1], -normal, after)
        };
        // Very near, the normal is rounded, and its plane may separate less.
        let lower_bound = distance.min(separation(0.0));
        let approach_speed = (x.velocity(time, on_a) - y.velocity(time, on_b)).dot(normal);
        let speed = (x.velocity(time, on_a) - y.velocity(time, on_b)).magnitude();
        if lower_bound.is_nan()
            || (lower_bound <= near && step == 0 && approach_speed <= SLIDING * speed)
        {
            return None;
        }
        if lower_bound <= near || step + 1 == MAX_ITERATIONS {
            return Some(ShapeCastHit {
                time: S::from_f64(time),
                normal: cast_vector(normal),
                point: cast_point(origin + on_a),
            });
        }
        let left = 1.0 - time;
        if separation(left) > 0.0 {
            return None;
        }
        // As if the closest points stayed the same.
        let acceleration = 2.0 * (x.curvature + y.curvature);
        let guess = time_to_close(lower_bound, approach_speed, acceleration);
        time += safe_advance(separation, lower_bound, guess, left, near);
    }
    None
}

/// Time for which a concave `separation`, zero before `left`, stays positive, at most: from `guess`
/// on, the root of a chord is before that of the function.
fn safe_advance(
    separation: impl Fn(f64) -> f64,
    start: f64,
    guess: f64,
    left: f64,
    near: f64,
) -> f64 {
    let (mut safe, mut far) = ((0.0, start), (left, separation(left)));
    for iteration in 0..MAX_ROOT_ITERATIONS {
        let chord = safe.0 + (far.0 - safe.0) * (safe.1 / (safe.1 - far.1));
        let after = if iteration == 0 && guess < left { guess } else { chord };
        let there = separation(after);
        // Below zero by rounding only.
        if there >= -0.01 * near {
            safe = (after, there.max(0.0));
        } else {
            far = (after, there);
        }
    }
    safe.0
}
