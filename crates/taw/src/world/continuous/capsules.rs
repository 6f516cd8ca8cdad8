//! Time of impact of capsules, which turn on their way, with walls; what walls do to their rotation.

use cgmath::{InnerSpace, Zero};

use super::moving_walls::RelativePath;
use super::swept_marble::SweptMarble;
use super::walls::{MAX_ITERATIONS, MAX_OVERSHOOT, WallImpact};
use crate::contact::time_to_close;
use crate::math::{Scalar, Vec3, length};
use crate::shape::Capsule;
use crate::world::walls::{SubShape, Walls};
use crate::world::{WallShape, World};

/// Nearest points of a capsule and a sub-shape of a wall.
struct Nearest<S> {
    /// Unit normal, from the wall to the capsule.
    normal: Vec3<S>,
    /// Separation of the surfaces, in metres.
    gap: S,
    /// Vector from the middle of its axis to the point there that is nearest, in metres.
    anchor: Vec3<S>,
}

impl<S: Scalar> Walls<S> {
    /// Time of impact of a capsule with a sub-shape of a wall, by conservative advancement (Mirtich
    /// 1996): a plane separates the two until one of its ends may get there.
    pub(super) fn time_of_impact_of_capsule(
        &self,
        part: SubShape,
        marble: &SweptMarble<S>,
        path: &RelativePath<S>,
    ) -> Option<WallImpact<S>> {
        let (radius, near) = (marble.sphere.radius, marble.rounding());
        let mut time = S::zero();
        let mut last = None;
        for _ in 0..MAX_ITERATIONS {
            let (center, capsule) = (path.at(time), marble.capsule_at(path, time, radius));
            let Nearest { normal, gap, anchor } = self.nearest_to_capsule(part, &capsule)?;
            let closing = |anchor: Vec3<S>| {
                -(path.velocity(time, center) + marble.swing(path, time, anchor)).dot(normal)
            };
            let bend = marble.max_acceleration(path, normal);
            // One that rolls or pivots where it touches closes by rounding.
            let closes = closing(anchor) > near;
            let impact = WallImpact {
                time,
                part,
                normal,
                center,
                anchor,
                swing: marble.swing(path, time, anchor),
                place: path.place(time, center),
                gap,
            };
            if closes && gap <= near {
                return Some(impact);
            }
            last = Some(impact);
            // While the nearest point parts, the other end may come.
            let overshoot = if closes { gap } else { radius * S::from_f64(MAX_OVERSHOOT) };
            let half = (capsule.b - capsule.a) * S::from_f64(0.5);
            let [first, second] = [half, -half].map(|end| {
                let gap = gap + (end - anchor).dot(normal);
                time_to_close(gap.max(overshoot), closing(end), bend)
            });
            // However it turns, it stays within its reach.
            let outside = gap - anchor.dot(normal) - length(half);
            let around = if outside > S::zero() {
                time_to_close(outside, closing(Vec3::zero()), path.max_acceleration())
            } else {
                S::zero()
            };
            time += first.min(second).max(around);
            // Infinite where it never meets the wall.
            if !time.is_finite() || time > S::one() {
                return None;
            }
        }
        // A grazing contact, or within rounding: it has not passed up to there.
        last
    }

    /// Nearest points of a sub-shape and a capsule.
    fn nearest_to_capsule(&self, part: SubShape, capsule: &Capsule<S>) -> Option<Nearest<S>> {
        let Capsule { a, b, radius } = *capsule;
        let half = (b - a) * S::from_f64(0.5);
        if let WallShape::Plane(plane) = &self.shapes()[part.wall as usize] {
            let normal = plane.normal();
            let (end, anchor) = if half.dot(normal) > S::zero() { (a, -half) } else { (b, half) };
            return Some(Nearest { normal, gap: plane.signed_distance(end) - radius, anchor });
        }
        let touch = self.closest_points(part, capsule)?;
        let anchor = touch.on_b + touch.normal * radius - (a + half);
        Some(Nearest { normal: touch.normal, gap: touch.distance, anchor })
    }
}

impl<S: Scalar> World<S> {
    /// Rotation of a marble with a wall that carries it for `time` seconds, an axial vector in radians;
    /// zero for a ball, and for a capsule that contacts do not turn.
    pub(super) fn turn_with_wall(&self, row: usize, wall: u32, time: S) -> Vec3<S> {
        if self.marbles.half_length(row) == S::zero()
            || !self.marbles.is_dynamic(row, self.settings.model.rotation)
        {
            return Vec3::zero();
        }
        let motion = self.walls.swept_motion_of_row(wall as usize);
        motion.map_or_else(Vec3::zero, |motion| motion.angular_velocity * time)
    }

    /// Velocity of a point of a capsule's axis about its center, in m/s; zero for a ball, and for a
    /// capsule whose axis does not turn.
    pub(super) fn swing_velocity(&self, row: usize, anchor: Vec3<S>) -> Vec3<S> {
        if anchor.is_zero() {
            return Vec3::zero();
        }
        self.marbles.axis_velocity(row, self.settings.model.rotation).cross(anchor)
    }
}
