//! Shapes as plain values in world coordinates. Overlap tests between two shapes are in
//! [`contact`](crate::contact); queries of a single shape are in [`BoundedShape`].

mod aabb;
mod ball;
mod bvh;
mod capsule;
mod compound;
mod convex_hull;
mod hull;
mod mass_properties;
mod obb;
mod plane;
pub(crate) mod polygon;
mod surface;
mod triangle;

pub use aabb::{Aabb, Aabb2, Aabb3};
pub use ball::{Circle, NBall, Sphere};
pub use bvh::Bvh;
pub use capsule::Capsule;
pub(crate) use capsule::any_perpendicular;
pub use compound::{Compound, Shape};
pub(crate) use hull::farthest_of;
pub use hull::{Face, Hull};
pub use mass_properties::MassProperties;
pub(crate) use mass_properties::{BALL_INERTIA, capsule_unit_inertia};
pub use obb::Obb;
pub use plane::Plane;
pub use surface::{HeightField, Mesh, Surface};
pub use triangle::Triangle;

use crate::math::{Point3, Scalar, Vec3};

/// Projection of a point onto the surface of a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointProjection<S> {
    /// The projected point, on the surface.
    pub point: Point3<S>,
    /// Outward unit normal there: for an inside point, the direction of least penetration. Among
    /// equally near surfaces the choice is deterministic.
    pub normal: Vec3<S>,
    /// Signed distance of the point in metres; negative inside.
    pub distance: S,
}

impl<S: Scalar> PointProjection<S> {
    /// Flips inside and outside.
    pub(crate) fn flipped(self) -> Self {
        Self { normal: -self.normal, distance: -self.distance, ..self }
    }
}

/// Queries of a bounded shape: support mapping, bounding box, volume and point projection.
pub trait BoundedShape<S: Scalar> {
    /// Support point: the point farthest along a direction of any length except zero. Deterministic
    /// among several.
    #[must_use]
    fn support(&self, direction: Vec3<S>) -> Point3<S>;

    /// The smallest axis-aligned bounding box.
    #[must_use]
    fn bounding_box(&self) -> Aabb3<S>;

    /// Volume in m³. Overlapping parts of a compound count twice.
    #[must_use]
    fn volume(&self) -> S;

    /// Projects a point onto the surface.
    #[must_use]
    fn project_point(&self, point: Point3<S>) -> PointProjection<S>;

    /// Nesting depth of compounds; zero for a simple shape.
    #[must_use]
    fn levels(&self) -> u32 {
        0
    }

    /// Returns true for a point inside or on the surface.
    #[must_use]
    fn contains(&self, point: Point3<S>) -> bool {
        self.project_point(point).distance <= S::zero()
    }

    /// The nearest point of the solid: the given point itself, if it is inside.
    #[must_use]
    fn closest_point(&self, point: Point3<S>) -> Point3<S> {
        let nearest = self.project_point(point);
        if nearest.distance <= S::zero() { point } else { nearest.point }
    }
}
