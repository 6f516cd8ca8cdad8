//! What a thing is. Shapes are plain values in the coordinates of their world; whether two
//! of them touch is a question for [`contact`](crate::contact). What each can say of
//! itself is [`Solid`].

mod aabb;
mod ball;
mod box_tree;
mod capsule;
mod compound;
mod hull;
mod obb;
mod plane;
pub(crate) mod polygon;
mod surface;
mod triangle;
mod wrap;

pub use aabb::{Aabb, Box3, Rectangle};
pub use ball::{Ball, Circle, Sphere};
pub use box_tree::BoxTree;
pub use capsule::Capsule;
pub(crate) use capsule::across;
pub use compound::{Compound, Shape};
pub(crate) use hull::farthest_of;
pub use hull::{Face, Hull};
pub use obb::Obb;
pub use plane::Plane;
pub use surface::{HeightField, Mesh, Surface};
pub use triangle::Triangle;

use crate::math::{Point3, Scalar, Vec3};

/// Where a surface is nearest to a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest<S> {
    /// On the surface.
    pub point: Point3<S>,
    /// The unit vector that points out of the shape there: the shortest way out for what
    /// is inside. Where several are as short, always the same one of them.
    pub normal: Vec3<S>,
    /// How far the point is outside, in metres; negative inside.
    pub distance: S,
}

impl<S: Scalar> Nearest<S> {
    /// The same of a surface whose inside is where the point is.
    pub(crate) fn inside_out(self) -> Self {
        Self { normal: -self.normal, distance: -self.distance, ..self }
    }
}

/// What every bounded shape can say of itself.
pub trait Solid<S: Scalar> {
    /// Its point that is farthest along a direction (of any length but zero). Of several,
    /// always the same one.
    #[must_use]
    fn support(&self, direction: Vec3<S>) -> Point3<S>;

    /// The smallest box along the axes that it is in.
    #[must_use]
    fn bounding_box(&self) -> Box3<S>;

    /// In m³. Parts of a compound that overlap count twice.
    #[must_use]
    fn volume(&self) -> S;

    /// Where its surface is nearest to a point.
    #[must_use]
    fn nearest(&self, point: Point3<S>) -> Nearest<S>;

    /// How many compounds are inside each other; none in a simple shape.
    #[must_use]
    fn levels(&self) -> u32 {
        0
    }

    /// Whether a point is in it or on its surface.
    #[must_use]
    fn contains(&self, point: Point3<S>) -> bool {
        self.nearest(point).distance <= S::zero()
    }

    /// Its point that is nearest to another one: that one itself, if it is inside.
    #[must_use]
    fn closest_point(&self, point: Point3<S>) -> Point3<S> {
        let nearest = self.nearest(point);
        if nearest.distance <= S::zero() { point } else { nearest.point }
    }
}
