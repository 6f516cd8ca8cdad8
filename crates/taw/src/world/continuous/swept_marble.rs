//! Marbles as continuous detection sweeps them: balls, and capsules that turn on their way.

use cgmath::{InnerSpace, One, Rotation as _, Zero};

use super::moving_walls::{RelativePath, path_bounds};
use crate::math::{Point3, Quat, Scalar, Vec3, length};
use crate::motion::{Rotation, integrate_rotation};
use crate::shape::{Aabb3, BoundedShape as _, Capsule, Sphere};
use crate::world::marbles::Marbles;
use crate::world::narrow_phase::flush_distance;

/// Ball or capsule at the start of a path.
#[derive(Clone, Copy, Debug)]
pub(super) struct SweptMarble<S> {
    /// Sphere around its center.
    pub sphere: Sphere<S>,
    /// Vector from the center of a capsule to an end of its segment, in metres; zero for a ball.
    pub half_axis: Vec3<S>,
    /// Rotation of that vector on the path, an axial vector in radians.
    pub turn: Vec3<S>,
    /// True until a wall stops its rotation.
    pub is_free: bool,
}

/// Rotation of a capsule in a substep.
#[derive(Clone, Copy, Debug)]
pub(in crate::world) struct Turn<S> {
    /// Fraction of its free rotation until a wall stops it.
    pub free: S,
    /// Rotation after that with the walls that carry it.
    pub carried: Quat<S>,
}

impl<S: Scalar> Default for Turn<S> {
    fn default() -> Self {
        Self { free: S::one(), carried: Quat::one() }
    }
}

impl<S: Scalar> SweptMarble<S> {
    /// Sphere around the center of a marble.
    pub fn ball(marbles: &Marbles<S>, row: usize, center: Point3<S>) -> Self {
        let sphere = Sphere { center, ..marbles.sphere(row) };
        Self { sphere, half_axis: Vec3::zero(), turn: Vec3::zero(), is_free: true }
    }

    /// Marble on a path on which it does not turn.
    pub fn without_turn(marbles: &Marbles<S>, row: usize, center: Point3<S>) -> Self {
        let ball = Self::ball(marbles, row, center);
        let half = marbles.half_length(row);
        if half > S::zero() { Self { half_axis: marbles.axis(row) * half, ..ball } } else { ball }
    }

    /// Marble at the start of its free motion over `dt` seconds in a world of this model.
    pub fn in_free_motion(
        marbles: &Marbles<S>,
        row: usize,
        center: Point3<S>,
        (model, dt): (Rotation, S),
    ) -> Self {
        let still = Self::without_turn(marbles, row, center);
        if still.is_ball() {
            return still;
        }
        Self { turn: marbles.axis_velocity(row, model) * dt, ..still }
    }

    /// Returns true for a ball, and false for a capsule.
    pub fn is_ball(&self) -> bool {
        self.half_axis.is_zero()
    }

    /// Rounding of places on a capsule, in metres.
    pub fn rounding(&self) -> S {
        flush_distance(&self.sphere) + S::epsilon() * S::from_f64(4.0) * length(self.half_axis)
    }

    /// Radius of a sweep that stops so that a capsule touches with this radius: where it stops is
    /// known up to rounding, and its rotation is rounded again there. A ball stops where it touches.
    pub fn touching(&self, radius: S) -> S {
        if self.is_ball() {
            return radius;
        }
        // However far from the origin, most of it is left.
        radius - (self.rounding() * S::from_f64(2.0)).min(radius * S::from_f64(0.25))
    }

    /// Radius around its center that it keeps within, in metres.
    pub fn reach(&self) -> S {
        self.sphere.radius + length(self.half_axis)
    }

    /// Box around a straight path of its center, in world space.
    pub fn bounds(&self, displacement: Vec3<S>) -> Aabb3<S> {
        let Sphere { center, radius } = self.sphere;
        if self.is_ball() {
            return path_bounds(center, displacement, radius);
        }
        // Farthest that its ends are from the chords of their arcs, by the error of linear
        // interpolation.
        let bulge = self.turn.magnitude2() * length(self.half_axis) * S::from_f64(0.125);
        let far = radius + bulge.min(self.reach());
        let pose = |center: Point3<S>, half: Vec3<S>| {
            Capsule { a: center - half, b: center + half, radius: far }.bounding_box()
        };
        let end = integrate_rotation(Quat::one(), self.turn, S::one()) * self.half_axis;
        pose(center, self.half_axis).union(&pose(center + displacement, end))
    }

    /// Capsule of this radius at a place on a path, in the frame of the wall.
    pub fn capsule_at(&self, path: &RelativePath<S>, time: S, radius: S) -> Capsule<S> {
        let turned = integrate_rotation(Quat::one(), self.turn, time) * self.half_axis;
        let (center, half) = (path.at(time), path.rotate_into_frame(time, turned));
        Capsule { a: center - half, b: center + half, radius }
    }

    /// Velocity about its center of a point of its axis, `anchor` metres from there, in the frame of the
    /// wall, in metres per path.
    pub fn swing(&self, path: &RelativePath<S>, time: S, anchor: Vec3<S>) -> Vec3<S> {
        (path.rotate_into_frame(time, self.turn) - path.turn()).cross(anchor)
    }

    /// Upper bound of the distances that its ends move about its center in the frame of the wall, in
    /// metres.
    #[inline]
    pub fn max_swing(&self, path: &RelativePath<S>) -> S {
        if self.is_ball() {
            return S::zero();
        }
        self.max_angle(path) * length(self.half_axis)
    }

    /// Upper bound of the acceleration of its points in the frame of the wall toward a plane with this
    /// normal, in metres per squared path: centripetal, beside that of the center.
    pub fn max_acceleration(&self, path: &RelativePath<S>, normal: Vec3<S>) -> S {
        let centripetal = if path.turn().is_zero() {
            length(self.turn.cross(self.half_axis)) * length(self.turn.cross(normal))
        } else {
            let angle = self.max_angle(path);
            angle * angle * length(self.half_axis)
        };
        path.max_acceleration() + centripetal
    }

    /// Upper bound of the angle by which it turns in the frame of the wall, in radians; zero if it
    /// turns with the wall.
    fn max_angle(&self, path: &RelativePath<S>) -> S {
        let turn = path.turn();
        if self.turn == turn { S::zero() } else { length(self.turn) + length(turn) }
    }

    /// Goes on from a fraction of the path with the rest of its rotation.
    pub fn advance(&mut self, time: S, center: Point3<S>) {
        self.sphere.center = center;
        if !self.is_ball() {
            self.half_axis =
                integrate_rotation(Quat::one(), self.turn, time).rotate_vector(self.half_axis);
            self.turn *= S::one() - time;
        }
    }

    /// Stops its rotation at a wall, which from there on rotates it by `carried`, in radians.
    pub fn stop_turning(&mut self, carried: Vec3<S>) {
        (self.turn, self.is_free) = (carried, false);
    }
}

impl<S: Scalar> Turn<S> {
    /// Rotation that is free until a fraction of the substep, and then this one, in radians.
    pub fn until(free: S, carried: Vec3<S>) -> Self {
        Self { free, carried: integrate_rotation(Quat::one(), carried, S::one()) }
    }

    /// Adds the rotation of a marble until a fraction of a path, which takes `left` of the substep.
    pub(super) fn add(&mut self, marble: &SweptMarble<S>, time: S, left: S) {
        if marble.is_free {
            self.free += time * left;
        } else {
            self.carried = integrate_rotation(self.carried, marble.turn, time);
        }
    }
}
