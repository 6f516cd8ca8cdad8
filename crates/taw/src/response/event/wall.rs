//! Walls within a substep, static or kinematic: shape, motion, and pose at each time.

use std::fmt::Debug;
use std::sync::Arc;

use cgmath::{InnerSpace, One, Rotation as _, Zero};

use crate::broad::CollisionLayers;
use crate::math::{Point3, Quat, Vec3};
use crate::motion::{WallMotion, integrate_rotation};
use crate::response::{Colliders, Material};
use crate::shape::{Aabb3, BoundedShape, PointProjection, Shape, Triangle};

/// Rounding error of a distance, relative to it and the coordinates: many times that of a few
/// operations.
const ROUNDING: f64 = 1e-12;

/// Rounding error of a distance from a point, both in metres.
pub(super) fn distance_rounding(point: Point3<f64>, distance: f64) -> f64 {
    ROUNDING * (distance.abs() + point.x.abs().max(point.y.abs()).max(point.z.abs()))
}

/// Wall, or a sub-shape of one (static or kinematic collider).
#[derive(Clone, Debug)]
pub(crate) struct Wall {
    /// Shape at `arrival_time`, or at all times.
    pub collider: WallCollider,
    /// Bounding box of the shape, if it is bounded.
    pub bounds: Option<Aabb3<f64>>,
    /// Row of the wall in the world.
    pub row: u32,
    pub motion: Option<WallMotion<f64>>,
    /// Time after the start of the substep when a moving wall reaches its pose, in seconds; before,
    /// its motion is rewound. None for a static wall, whose motion only moves the surface, like a
    /// conveyor.
    pub arrival_time: Option<f64>,
    pub material: Option<Material<f64>>,
    pub layers: CollisionLayers,
    /// Rounding error of its points, relative to their coordinates.
    pub relative_rounding: f64,
}

/// Shapes of a [`Wall`].
#[derive(Clone, Debug)]
pub(crate) enum WallCollider {
    Plane {
        normal: Vec3<f64>,
        offset: f64,
    },
    Solid(Shape<f64>),
    Triangle(Triangle<f64>),
    /// Triangle of a height field's top, and the solid below that.
    OneSidedTriangle(Triangle<f64>, Arc<dyn Solid>),
}

/// Volume that triangles enclose.
pub(crate) trait Solid: Debug + Send + Sync {
    /// Tests if a point is in the solid.
    fn has_inside(&self, point: Point3<f64>) -> bool;
}

impl WallCollider {
    /// Bounding box, if the shape is bounded.
    pub fn bounds(&self) -> Option<Aabb3<f64>> {
        match self {
            Self::Plane { .. } => None,
            Self::Solid(shape) => Some(shape.bounding_box()),
            Self::Triangle(triangle) | Self::OneSidedTriangle(triangle, _) => {
                Some(triangle.bounding_box())
            }
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
            Self::OneSidedTriangle(triangle, solid) => {
                triangle.project_point_one_sided(point, |point| solid.has_inside(point))
            }
        }
    }
}

impl Wall {
    /// Combined material of this wall and a ball.
    pub fn combined_with(&self, ball: Material<f64>) -> Material<f64> {
        self.material.map_or(ball, |its| ball.combined_with(its))
    }

    /// Motion of a moving wall, and the time until it reaches its pose, in seconds.
    pub fn motion_at(&self, time: f64) -> Option<(WallMotion<f64>, f64)> {
        Some((self.motion?, self.arrival_time? - time))
    }

    /// Nearest point of the surface at a time.
    pub fn nearest(&self, point: Point3<f64>, time: f64) -> PointProjection<f64> {
        let Some((WallMotion { velocity, angular_velocity: spin, pivot }, remaining)) =
            self.motion_at(time)
        else {
            return self.collider.nearest(point);
        };
        let shifted = point + velocity * remaining;
        if spin.is_zero() {
            let nearest = self.collider.nearest(shifted);
            return PointProjection { point: nearest.point - velocity * remaining, ..nearest };
        }
        let rotation = integrate_rotation(Quat::one(), spin, remaining);
        let nearest = self.collider.nearest(pivot + rotation.rotate_vector(shifted - pivot));
        let inverse = rotation.conjugate();
        let point = pivot - velocity * remaining + inverse.rotate_vector(nearest.point - pivot);
        PointProjection { point, normal: inverse.rotate_vector(nearest.normal), ..nearest }
    }

    /// Lower bound of the distance of [`nearest`](Self::nearest), by a few comparisons; minus
    /// infinity where there is no cheap one.
    pub fn distance_lower_bound(&self, point: Point3<f64>, time: f64) -> f64 {
        let Some(bounds) = &self.bounds else { return f64::NEG_INFINITY };
        let shifted = match self.motion_at(time) {
            Some((motion, _)) if !motion.angular_velocity.is_zero() => return f64::NEG_INFINITY,
            Some((motion, remaining)) => point + motion.velocity * remaining,
            None => point,
        };
        let distance = bounds.distance_to_point(shifted);
        let may_be_inside = matches!(self.collider, WallCollider::OneSidedTriangle(..))
            && distance <= (bounds.max - bounds.min).magnitude() * (1.0 + ROUNDING);
        if may_be_inside {
            return f64::NEG_INFINITY; // negative if it is inside
        }
        distance - distance_rounding(shifted, distance)
    }

    /// Velocity of a point that moves with the wall; zero for a static one.
    pub fn velocity_at(&self, point: Point3<f64>, time: f64) -> Vec3<f64> {
        let Some((motion, remaining)) = self.motion_at(time) else { return Vec3::zero() };
        motion.velocity_at(point + motion.velocity * remaining)
    }

    /// Surface velocity at a point with this normal; tangential for a static wall.
    pub fn surface_velocity(&self, normal: Vec3<f64>, point: Point3<f64>, time: f64) -> Vec3<f64> {
        let Some(motion) = self.motion else { return Vec3::zero() };
        if self.arrival_time.is_some() {
            return self.velocity_at(point, time);
        }
        let velocity = motion.velocity_at(point);
        velocity - normal * velocity.dot(normal)
    }

    /// Error of a distance to the wall by the rounding of its pose, in metres.
    pub fn position_error(&self, point: Point3<f64>) -> f64 {
        let Some((motion, _)) = self.motion_at(0.0) else { return 0.0 };
        let coordinates = [point, motion.pivot].map(|p| p.x.abs().max(p.y.abs()).max(p.z.abs()));
        self.relative_rounding * (coordinates[0] + coordinates[1])
    }
}

/// Moving walls between two times, as the impulse solver reads them.
pub(super) struct MovingWalls<'a> {
    pub walls: &'a [Wall],
    pub start: f64,
    pub end: f64,
    /// True if their velocities do not count: they are where they are, and carry nothing along.
    pub at_rest: bool,
}

impl MovingWalls<'_> {
    /// Velocity of a wall at a point that moves with it, or with its surface, in m/s.
    pub fn velocity_at(&self, wall: usize, point: Point3<f64>) -> Vec3<f64> {
        let wall = &self.walls[wall];
        match wall.motion {
            Some(motion) if wall.arrival_time.is_none() => motion.velocity_at(point),
            _ => wall.velocity_at(point, self.end),
        }
    }
}

impl Colliders<f64> for MovingWalls<'_> {
    fn normal_and_distance(&self, wall: usize, _: u32, point: Point3<f64>) -> (Vec3<f64>, f64) {
        let PointProjection { normal, distance, .. } = self.walls[wall].nearest(point, self.end);
        (normal, distance)
    }

    fn normal_and_distance_at_start(
        &self,
        wall: usize,
        _: u32,
        point: Point3<f64>,
    ) -> (Vec3<f64>, f64) {
        let PointProjection { normal, distance, .. } = self.walls[wall].nearest(point, self.start);
        (normal, distance)
    }

    fn surface_velocity(&self, wall: usize, point: Point3<f64>) -> Vec3<f64> {
        if self.at_rest {
            return Vec3::zero();
        }
        let wall = &self.walls[wall];
        wall.surface_velocity(wall.nearest(point, self.end).normal, point, self.end)
    }

    fn material(&self, wall: usize) -> Option<Material<f64>> {
        let material = self.walls[wall].material?;
        // What happens at once to a cluster is a collision without restitution.
        Some(if self.start == self.end { material.without_restitution() } else { material })
    }
}
