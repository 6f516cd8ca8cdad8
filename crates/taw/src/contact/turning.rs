use cgmath::{InnerSpace, Matrix3, Quaternion};

use super::closest::{Between, between};
use super::core::{Convex, Core};
use super::sweep::{SLIDES, Touch};
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector, direction_and_length};

/// How a rigid thing moves, all of it: evenly along a line, while it turns evenly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course<S> {
    /// Where the pivot goes, in metres.
    pub moves: Vec3<S>,
    /// How far it turns about the pivot: an axial vector, in radians.
    pub turns: Vec3<S>,
    /// A point that moves along without turning; of a free body, its center of mass.
    pub pivot: Point3<S>,
}

/// One of the two on its way, in `f64` about an origin.
struct Mover<'a> {
    /// About the pivot.
    core: Core<'a>,
    moves: Vec3<f64>,
    turns: Vec3<f64>,
    pivot: Vec3<f64>,
    /// Half of the square of the spin times the farthest distance from the pivot: how much
    /// nearer than its velocity says a point comes, over the square of the time.
    bend: f64,
}

impl<'a> Mover<'a> {
    fn new<S: Scalar>(
        shape: &'a (impl Convex<S> + ?Sized),
        course: &Course<S>,
        origin: Point3<f64>,
    ) -> Self {
        let pivot = cast_point::<S, f64>(course.pivot) - origin;
        let turns = cast_vector::<S, f64>(course.turns);
        let core = shape.core(origin).moved(-pivot);
        let farthest = core.inside().magnitude() + 2.0 * core.size() + core.radius;
        let bend = 0.5 * turns.magnitude2() * farthest;
        Self { core, moves: cast_vector(course.moves), turns, pivot, bend }
    }

    fn at(&self, time: f64) -> Core<'a> {
        let turned = match direction_and_length(self.turns) {
            Some((axis, angle)) => {
                let (sin, cos) = (0.5 * angle * time).sin_cos_portable();
                self.core.turned(Matrix3::from(Quaternion::from_sv(cos, axis * sin)))
            }
            None => self.core,
        };
        turned.moved(self.pivot + self.moves * time)
    }

    /// How far it reaches along a direction at most, some time after it was in a place.
    fn reach(&self, place: &Core<'_>, pivot: Vec3<f64>, direction: Vec3<f64>, after: f64) -> f64 {
        // (direction + after · direction × turns) · p is where a point p about the pivot
        // would be if it went straight on.
        let ahead = direction + direction.cross(self.turns) * after;
        let farthest = (place.support(ahead).0 - pivot).dot(ahead) + pivot.dot(direction);
        farthest + place.radius + (self.moves.dot(direction) + self.bend * after) * after
    }

    fn velocity(&self, time: f64, point: Vec3<f64>) -> Vec3<f64> {
        self.moves + self.turns.cross(point - self.pivot - self.moves * time)
    }
}

/// More steps than any pair takes that does not slide along the other; then they count as
/// touching, early rather than late.
const STEPS: u32 = 10_000;
/// How often the time is looked for until which a plane keeps two things apart.
const LOOKS: u32 = 4;

/// When two convex shapes that move and turn first touch, if they do. What touches from the
/// start does so at once if its points come closer there, and not at all otherwise.
///
/// Each step goes as far as the plane between them keeps them apart (conservative
/// advancement; Mirtich, *Impulse-based dynamic simulation of rigid body systems*, 1996,
/// §2.3, with the bend of the paths beside their velocities), so none is too long. They
/// touch where less than 1e-6 of their size is left: nearer than that, the normal between edges
/// that are nearly parallel is rounded.
#[must_use]
pub fn sweep_turning<S: Scalar>(
    a: &(impl Convex<S> + ?Sized),
    a_course: &Course<S>,
    b: &(impl Convex<S> + ?Sized),
    b_course: &Course<S>,
) -> Option<Touch<S>> {
    let origin = cast_point::<S, f64>(a.middle());
    let (x, y) = (Mover::new(a, a_course, origin), Mover::new(b, b_course, origin));
    let near = 1e-9 * (x.core.size() + y.core.size());
    let mut time = 0.0;
    for step in 0..STEPS {
        let (p, q) = (x.at(time), y.at(time));
        let Between { distance, normal, on_a, on_b } = between(&p, &q);
        // How wide the gap along the normal is at least; a concave function of the time.
        let pivots = [&x, &y].map(|it| it.pivot + it.moves * time);
        let gap = |after: f64| {
            -x.reach(&p, pivots[0], normal, after) - y.reach(&q, pivots[1], -normal, after)
        };
        // Of what is very near, the normal is rounded, and its plane may part less.
        let open = distance.min(gap(0.0));
        let closing = (x.velocity(time, on_a) - y.velocity(time, on_b)).dot(normal);
        let speed = (x.velocity(time, on_a) - y.velocity(time, on_b)).magnitude();
        if open.is_nan() || (open <= near && step == 0 && closing <= SLIDES * speed) {
            return None;
        }
        if open <= near || step + 1 == STEPS {
            return Some(Touch {
                time: S::constant(time),
                normal: cast_vector(normal),
                point: cast_point(origin + on_a),
            });
        }
        let left = 1.0 - time;
        if gap(left) > 0.0 {
            return None;
        }
        // The zero, if the points that are nearest now stay so; in the form that subtracts
        // nothing. From there on, the zero of a chord is before that of the function.
        let bend = x.bend + y.bend;
        let root = (closing * closing + 4.0 * bend * open).sqrt();
        let guess = if closing > 0.0 {
            2.0 * open / (root + closing)
        } else {
            (root - closing) / (2.0 * bend)
        };
        let (mut safe, mut far) = ((0.0, open), (left, gap(left)));
        for look in 0..LOOKS {
            let chord = safe.0 + (far.0 - safe.0) * (safe.1 / (safe.1 - far.1));
            let after = if look == 0 && guess < left { guess } else { chord };
            let there = gap(after);
            // Below zero by rounding only.
            if there >= -0.01 * near {
                safe = (after, there.max(0.0));
            } else {
                far = (after, there);
            }
        }
        time += safe.0;
    }
    None
}
