//! Walls within a substep, static or kinematic: shape, motion, and pose at each time.

use std::fmt::Debug;
use std::sync::Arc;

use cgmath::{InnerSpace, One, Rotation as _, Zero};

use crate::broad::CollisionLayers;
use crate::contact::ContactMaterial;
use crate::math::{Point3, Quat, Vec3, normalize_and_length};
use crate::motion::{WallMotion, integrate_rotation};
use crate::response::{Colliders, Material};
use crate::shape::{Aabb3, BoundedShape, PointProjection, Shape, Triangle};

/// Rounding error of a distance, relative to it and the coordinates: many times that of a few
/// operations.
const ROUNDING: f64 = 1e-12;

/// Smallest width of a triangle over its length for which a normal is exact to a hundredth of
/// [`ROUNDING`].
const MIN_WIDTH: f64 = 0.05;

/// Rounding error of a distance from a point, both in metres.
pub(super) fn distance_rounding(point: Point3<f64>, distance: f64) -> f64 {
    ROUNDING * (distance.abs() + point.x.abs().max(point.y.abs()).max(point.z.abs()))
}

/// Wall, or a sub-shape of one (static or kinematic collider).
#[derive(Clone, Debug)]
pub(crate) struct Wall {
    /// Shape at `arrival_time`, or at all times.
    pub collider: WallCollider,
    /// Bounding volume of the shape, if it is bounded.
    pub bounds: Option<Bounds>,
    /// Row of the wall in the world, and sub-shape.
    pub row: u32,
    pub part: u32,
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

/// Bounding volume of a [`Wall`].
#[derive(Clone, Copy, Debug)]
pub(crate) enum Bounds {
    Box(Aabb3<f64>),
    /// Disc in the plane of a triangle, which is closer around a steep one than its box.
    Disc {
        center: Point3<f64>,
        normal: Vec3<f64>,
        radius: f64,
    },
}

impl Bounds {
    /// Disc around the centroid of a triangle; the box of one so thin that rounding might tilt its
    /// normal by about [`ROUNDING`].
    fn of_triangle(triangle: &Triangle<f64>) -> Self {
        let [a, b, c] = triangle.corners;
        let longest = [b - a, c - b, a - c].map(InnerSpace::magnitude2).into_iter();
        match normalize_and_length((b - a).cross(c - a)) {
            Some((normal, twice)) if twice > MIN_WIDTH * longest.fold(0.0, f64::max) => {
                let center = a + (b - a) / 3.0 + (c - a) / 3.0;
                let radius = [a, b, c].map(|corner| (corner - center).magnitude()).into_iter();
                Self::Disc { center, normal, radius: radius.fold(0.0, f64::max) }
            }
            _ => Self::Box(triangle.bounding_box()),
        }
    }

    /// Lower bound of the distance from a point; minus infinity for one that may be in the solid
    /// behind a triangle, if `is_one_sided`.
    fn distance_lower_bound(&self, point: Point3<f64>, is_one_sided: bool) -> f64 {
        let (distance, far, size, is_in_front) = match *self {
            Self::Box(bounds) => {
                let distance = bounds.distance_to_point(point);
                (distance, distance, (bounds.max - bounds.min).magnitude(), false)
            }
            Self::Disc { center, normal, radius } => {
                let offset = point - center;
                let height = offset.dot(normal);
                let far = offset.x.abs() + offset.y.abs() + offset.z.abs(); // at least so far
                let in_plane = offset.magnitude2() - height * height;
                let distance = if in_plane <= radius * radius {
                    height.abs()
                } else {
                    let beside = in_plane.sqrt() - radius;
                    (height * height + beside * beside).sqrt()
                };
                let is_in_front = height > distance_rounding(point, far);
                (distance, far, 2.0 * radius, is_in_front)
            }
        };
        let may_be_inside = is_one_sided && !is_in_front && distance <= size * (1.0 + ROUNDING);
        let bound = distance - distance_rounding(point, far);
        // Negative if it is inside; unknown where a square overflows.
        if may_be_inside || !bound.is_finite() { f64::NEG_INFINITY } else { bound }
    }
}

/// Volume that triangles enclose.
pub(crate) trait Solid: Debug + Send + Sync {
    /// Tests if a point is in the solid.
    fn has_inside(&self, point: Point3<f64>) -> bool;
}

impl WallCollider {
    /// Bounding volume, if the shape is bounded.
    pub fn bounds(&self) -> Option<Bounds> {
        match self {
            Self::Plane { .. } => None,
            Self::Solid(shape) => Some(Bounds::Box(shape.bounding_box())),
            Self::Triangle(triangle) | Self::OneSidedTriangle(triangle, _) => {
                Some(Bounds::of_triangle(triangle))
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
    pub fn combined_with(&self, ball: Material<f64>) -> ContactMaterial<f64> {
        ball.on_wall(self.material)
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
        let is_one_sided = matches!(self.collider, WallCollider::OneSidedTriangle(..));
        bounds.distance_lower_bound(shifted, is_one_sided)
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

    fn surface_velocity(&self, wall: usize, point: Point3<f64>, normal: Vec3<f64>) -> Vec3<f64> {
        if self.at_rest {
            return Vec3::zero();
        }
        self.walls[wall].surface_velocity(normal, point, self.end)
    }
}
