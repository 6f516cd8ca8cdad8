//! A wall within a substep: where it is at each moment, and how it moves there.

use cgmath::{InnerSpace, One, Rotation as _, Zero};

use crate::math::{Point3, Quat, Vec3};
use crate::motion::{WallMotion, integrate_rotation};
use crate::response::{Material, Walls};
use crate::shape::{Aabb3, BoundedShape, PointProjection, Shape, Triangle};

/// Error of a distance by rounding, over itself and the coordinates: many times what
/// a handful of operations leave.
const ROUNDING: f64 = 1e-12;

/// A wall, or a part of one, and how it moves.
#[derive(Clone, Debug)]
pub(crate) struct Wall {
    /// As it is at the time that `there` says, or always.
    pub form: Form,
    /// Around the form, if it has an end.
    pub bounds: Option<Aabb3<f64>>,
    /// Row in the world.
    pub row: u32,
    pub motion: Option<WallMotion<f64>>,
    /// Of one that was moved to where it is: how many seconds after the begin of the substep
    /// it comes there. Before, it is where its motion, undone, puts it. None for one that
    /// stays, and only carries along what lies on it, like a conveyor.
    pub there: Option<f64>,
    pub material: Option<Material<f64>>,
    /// Error of a point of it by the rounding of its place, over
    /// its coordinates.
    pub digit: f64,
}

/// Kinds of a [`Wall`].
#[derive(Clone, Debug)]
pub(crate) enum Form {
    Plane {
        normal: Vec3<f64>,
        offset: f64,
    },
    Solid(Shape<f64>),
    Triangle(Triangle<f64>),
    /// Of a height field.
    SolidBelow(Triangle<f64>),
}

impl Form {
    /// The box around it, if it has an end.
    pub fn bounds(&self) -> Option<Aabb3<f64>> {
        match self {
            Self::Plane { .. } => None,
            Self::Solid(shape) => Some(shape.bounding_box()),
            Self::Triangle(triangle) | Self::SolidBelow(triangle) => Some(triangle.bounding_box()),
        }
    }

    fn nearest(&self, point: Point3<f64>) -> PointProjection<f64> {
        match self {
            Self::Plane { normal, offset } => {
                let distance = normal.dot(Vec3::new(point.x, point.y, point.z)) - offset;
                PointProjection { point: point - normal * distance, normal: *normal, distance }
            }
            Self::Solid(shape) => shape.project_point(point),
            Self::Triangle(triangle) => triangle.project_point(point),
            Self::SolidBelow(triangle) => triangle.project_point_one_sided(point),
        }
    }
}

impl Wall {
    /// Material that counts between this wall and a ball of that material.
    pub fn against(&self, ball: Material<f64>) -> Material<f64> {
        self.material.map_or(ball, |its| ball.against(its))
    }

    /// The motion of one that goes through the substep, and the time that it still has to go.
    pub fn going(&self, time: f64) -> Option<(WallMotion<f64>, f64)> {
        Some((self.motion?, self.there? - time))
    }

    /// Where its surface is nearest to a point at a time.
    pub fn nearest(&self, point: Point3<f64>, time: f64) -> PointProjection<f64> {
        let Some((WallMotion { velocity, angular_velocity: spin, pivot }, left)) = self.going(time)
        else {
            return self.form.nearest(point);
        };
        let on = point + velocity * left;
        if spin.is_zero() {
            let near = self.form.nearest(on);
            return PointProjection { point: near.point - velocity * left, ..near };
        }
        let turn = integrate_rotation(Quat::one(), spin, left);
        let near = self.form.nearest(pivot + turn.rotate_vector(on - pivot));
        let back = turn.conjugate();
        let point = pivot - velocity * left + back.rotate_vector(near.point - pivot);
        PointProjection { point, normal: back.rotate_vector(near.normal), ..near }
    }

    /// Lower bound of the distance that [`nearest`](Self::nearest) gives, at the cost of a few
    /// comparisons; minus infinity where none is known so cheaply.
    pub fn at_least(&self, point: Point3<f64>, time: f64) -> f64 {
        let Some(bounds) = &self.bounds else { return f64::NEG_INFINITY };
        let on = match self.going(time) {
            Some((motion, _)) if !motion.angular_velocity.is_zero() => return f64::NEG_INFINITY,
            Some((motion, left)) => point + motion.velocity * left,
            None => point,
        };
        let gap = bounds.distance_to_point(on);
        let deep = matches!(self.form, Form::SolidBelow(_))
            && gap <= (bounds.max - bounds.min).magnitude() * (1.0 + ROUNDING);
        if deep {
            return f64::NEG_INFINITY; // it may be inside
        }
        gap - ROUNDING * (gap + on.x.abs().max(on.y.abs()).max(on.z.abs()))
    }

    /// The velocity of a point that goes with the wall through its step; zero for one that
    /// stays.
    pub fn way(&self, point: Point3<f64>, time: f64) -> Vec3<f64> {
        let Some((motion, left)) = self.going(time) else { return Vec3::zero() };
        motion.velocity_at(point + motion.velocity * left)
    }

    /// The velocity of its surface, which points that way, at a point. What stays has none
    /// across its surface.
    pub fn surface_velocity(&self, normal: Vec3<f64>, point: Point3<f64>, time: f64) -> Vec3<f64> {
        let Some(motion) = self.motion else { return Vec3::zero() };
        if self.there.is_some() {
            return self.way(point, time);
        }
        let velocity = motion.velocity_at(point);
        velocity - normal * velocity.dot(normal)
    }

    /// Part of a gap to a point that may be due to the rounding of the wall's place.
    pub fn rounding(&self, point: Point3<f64>) -> f64 {
        let Some((motion, _)) = self.going(0.0) else { return 0.0 };
        let coordinates = [point, motion.pivot].map(|p| p.x.abs().max(p.y.abs()).max(p.z.abs()));
        self.digit * (coordinates[0] + coordinates[1])
    }
}

/// Walls while things rest on them, from one time to a later one.
pub(super) struct Between<'a> {
    pub walls: &'a [Wall],
    pub begin: f64,
    pub end: f64,
}

impl Walls<f64> for Between<'_> {
    fn normal_and_distance(&self, wall: usize, _: u32, point: Point3<f64>) -> (Vec3<f64>, f64) {
        let PointProjection { normal, distance, .. } = self.walls[wall].nearest(point, self.end);
        (normal, distance)
    }

    fn normal_and_distance_before(
        &self,
        wall: usize,
        _: u32,
        point: Point3<f64>,
    ) -> (Vec3<f64>, f64) {
        let PointProjection { normal, distance, .. } = self.walls[wall].nearest(point, self.begin);
        (normal, distance)
    }

    fn surface_velocity(&self, wall: usize, point: Point3<f64>) -> Vec3<f64> {
        let wall = &self.walls[wall];
        wall.surface_velocity(wall.nearest(point, self.end).normal, point, self.end)
    }

    fn material(&self, wall: usize) -> Option<Material<f64>> {
        self.walls[wall].material
    }
}
