use std::sync::Arc;

use cgmath::{EuclideanSpace, InnerSpace};

use crate::Error;
use crate::contact::{Closest, closest, parts_of};
use crate::error::{finite_point, finite_vector};
use crate::frame::Pose;
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector, length};
use crate::response::event::WallCollider;
use crate::shape::{
    Box3, Capsule, Compound, HeightField, Hull, Mesh, Nearest, Obb, Plane, Shape, Solid, Sphere,
    Surface, Triangle,
};

/// Shape of a wall.
#[derive(Clone, Debug, PartialEq)]
pub enum WallShape<S> {
    /// A half-space.
    Plane(Plane<S>),
    /// Any bounded shape, or a compound of such.
    Solid(Shape<S>),
    /// Triangles, solid from both sides and hollow between. Copies share them.
    Mesh(Arc<Mesh<S>>, Pose<S>),
    /// A landscape, solid below. Copies share it.
    HeightField(Arc<HeightField<S>>, Pose<S>),
}

impl<S: Scalar> WallShape<S> {
    /// Checks the shape and lays out nested compounds flat.
    pub(super) fn checked(self) -> Result<Self, Error> {
        Ok(match self {
            Self::Plane(_) => self,
            Self::Solid(shape) => Self::Solid(shape.checked()?),
            Self::Mesh(mesh, pose) => {
                let pose = pose.checked()?;
                room_for(&mesh.bounds(), pose)?;
                Self::Mesh(mesh, pose)
            }
            Self::HeightField(field, pose) => {
                let pose = pose.checked()?;
                room_for(&ground(&field), pose)?;
                Self::HeightField(field, pose)
            }
        })
    }

    /// The boxes around it: of a compound one for each part, of a plane none.
    pub(super) fn boxes(&self, mut name: impl FnMut(u32, Box3<S>)) {
        match self {
            Self::Plane(_) => {}
            Self::Solid(Shape::Compound(compound)) => {
                for (part, shape) in (0..).zip(compound.parts()) {
                    name(part, shape.bounding_box());
                }
            }
            Self::Solid(shape) => name(0, shape.bounding_box()),
            Self::Mesh(mesh, pose) => name(0, moved(&mesh.bounds(), *pose)),
            Self::HeightField(field, pose) => name(0, moved(&ground(field), *pose)),
        }
    }

    /// Names the parts near a box, of which one of its own boxes is.
    pub(super) fn near(&self, part: u32, bounds: &Box3<S>, name: impl FnMut(u32)) {
        let mut name = name;
        match self {
            Self::Plane(_) | Self::Solid(_) => name(part),
            Self::Mesh(mesh, pose) => mesh.near(&moved(bounds, pose.inverse()), name),
            Self::HeightField(field, pose) => {
                // A ball below the surface touches the triangles above it.
                let mut bounds = moved(bounds, pose.inverse());
                bounds.max.y = bounds.max.y.max(field.bounds().max.y);
                field.near(&bounds, name);
            }
        }
    }

    /// Names the parts that may be within `reach` metres of a point, of which one of its own
    /// boxes is.
    pub(super) fn around(&self, part: u32, point: Point3<S>, reach: S, mut name: impl FnMut(u32)) {
        let mut each = |part| {
            name(part);
            reach
        };
        match self {
            Self::Plane(_) | Self::Solid(_) => name(part),
            Self::Mesh(mesh, pose) => mesh.around(pose.point_back(point), reach, &mut each),
            Self::HeightField(field, pose) => {
                // A point below the surface is at most this far from it.
                let local = pose.point_back(point);
                let far = field.height_over(local).map_or(reach, |height| reach.max(height));
                field.around(local, far, |part| {
                    each(part);
                    far
                });
            }
        }
    }

    /// Tests for equal shapes in one place; shared meshes and height fields compare by pointer.
    pub(super) fn is_where(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Mesh(one, pose), Self::Mesh(two, at)) => Arc::ptr_eq(one, two) && pose == at,
            (Self::HeightField(one, pose), Self::HeightField(two, at)) => {
                Arc::ptr_eq(one, two) && pose == at
            }
            (Self::Mesh(..) | Self::HeightField(..), _) => false,
            _ => self == other,
        }
    }

    /// This wall, moved by `pose`.
    ///
    /// # Errors
    /// [`Error::NotFinite`] for a place that a half-space cannot have. Others are refused
    /// when they become a wall.
    pub fn moved(&self, pose: Pose<S>) -> Result<Self, Error> {
        Ok(match self {
            Self::Plane(plane) => {
                let normal = pose.vector(plane.normal()).normalize();
                let on = pose.point(Point3::from_vec(plane.normal() * plane.offset()));
                Self::Plane(Plane::through(on, normal)?)
            }
            Self::Solid(shape) => Self::Solid(shape.moved(pose)),
            Self::Mesh(mesh, before) => Self::Mesh(Arc::clone(mesh), pose * *before),
            Self::HeightField(field, before) => {
                Self::HeightField(Arc::clone(field), pose * *before)
            }
        })
    }

    /// Where its surface is nearest to a point.
    #[must_use]
    pub fn nearest(&self, point: Point3<S>) -> Nearest<S> {
        let on = |surface: &dyn Fn(&mut dyn FnMut(u32) -> S)| {
            let mut best = nowhere(point);
            surface(&mut |part| {
                let next = self.nearest_of(part, point);
                if next.distance.abs() < best.distance.abs() {
                    best = next;
                }
                best.distance.abs()
            });
            best
        };
        match self {
            Self::Plane(_) => self.nearest_of(0, point),
            Self::Solid(shape) => shape.nearest(point),
            Self::Mesh(mesh, pose) => {
                on(&|name| mesh.around(pose.point_back(point), S::infinity(), name))
            }
            Self::HeightField(field, pose) => {
                on(&|name| field.around(pose.point_back(point), S::infinity(), name))
            }
        }
    }

    /// Where a part of it is nearest to a point.
    pub(super) fn nearest_of(&self, part: u32, point: Point3<S>) -> Nearest<S> {
        match self {
            Self::Plane(plane) => {
                let (normal, distance) = (plane.normal(), plane.signed_distance(point));
                Nearest { point: point - normal * distance, normal, distance }
            }
            Self::Solid(_) => match self.part(part) {
                Some(shape) => shape.nearest(point),
                None => nowhere(point),
            },
            Self::Mesh(mesh, pose) => placed(*pose, point, |point| {
                mesh.triangle(part).map(|triangle| triangle.nearest(point))
            }),
            Self::HeightField(field, pose) => placed(*pose, point, |point| {
                let near = field.triangle(part)?.nearest(point);
                let below = field.height_over(point).is_some_and(|height| height > S::zero());
                Some(if below { near.inside_out() } else { near })
            }),
        }
    }

    /// Where a part is nearest to a capsule, unless it is a half-space.
    pub(super) fn closest(&self, part: u32, capsule: &Capsule<S>) -> Option<Closest<S>> {
        let triangle = |triangle: Triangle<S>, pose: &Pose<S>| {
            let corners = triangle.corners.map(|corner| pose.point(corner));
            closest(&Triangle { corners }, capsule)
        };
        match self {
            Self::Plane(_) => None,
            Self::Solid(_) => {
                let parts = parts_of(self.part(part)?).into_iter();
                parts.map(|part| closest(part, capsule)).next()
            }
            Self::Mesh(mesh, pose) => mesh.triangle(part).map(|it| triangle(it, pose)),
            Self::HeightField(field, pose) => field.triangle(part).map(|it| triangle(it, pose)),
        }
    }

    /// A part in `f64`, for a response that counts so.
    pub(super) fn exact(&self, part: u32) -> Option<WallCollider> {
        let triangle = |triangle: Option<Triangle<S>>, pose: &Pose<S>| {
            let corners = triangle?.corners;
            Some(Triangle { corners: corners.map(|corner| cast_point(pose.point(corner))) })
        };
        match self {
            Self::Plane(plane) => {
                // What rounding leaves of a unit vector's length would add energy.
                let normal = cast_vector::<S, f64>(plane.normal());
                let length = normal.magnitude();
                let (normal, offset) = (normal / length, plane.offset().as_f64() / length);
                Some(WallCollider::Plane { normal, offset })
            }
            Self::Solid(_) => self.part(part).map(|shape| WallCollider::Solid(shape.in_scalar())),
            Self::Mesh(mesh, pose) => {
                triangle(mesh.triangle(part), pose).map(WallCollider::Triangle)
            }
            Self::HeightField(field, pose) => {
                triangle(field.triangle(part), pose).map(WallCollider::OneSidedTriangle)
            }
        }
    }

    /// A convex part.
    pub(super) fn part(&self, part: u32) -> Option<&Shape<S>> {
        match self {
            Self::Solid(Shape::Compound(compound)) => compound.parts().get(part as usize),
            Self::Solid(shape) => Some(shape),
            Self::Plane(_) | Self::Mesh(..) | Self::HeightField(..) => None,
        }
    }
}

/// Nothing, if a surface in this box, moved, is still finite.
fn room_for<S: Scalar>(bounds: &Box3<S>, pose: Pose<S>) -> Result<(), Error> {
    finite_vector(["size.x", "size.y", "size.z"], bounds.max - bounds.min)?;
    let Box3 { min, max } = moved(bounds, pose);
    finite_point(["shape.x", "shape.y", "shape.z"], min)?;
    finite_point(["shape.x", "shape.y", "shape.z"], max).map(|_| ())
}

/// Bounding box of a height field and of the solid below it, as deep as the field's diagonal, in
/// metres.
fn ground<S: Scalar>(field: &HeightField<S>) -> Box3<S> {
    let mut bounds = field.bounds();
    bounds.min.y -= length(bounds.max - bounds.min);
    bounds
}

/// The box around a box that was moved.
fn moved<S: Scalar>(bounds: &Box3<S>, pose: Pose<S>) -> Box3<S> {
    if pose == Pose::identity() { *bounds } else { bounds.obb().moved(pose).bounding_box() }
}

/// Result for a missing part: infinitely far away.
fn nowhere<S: Scalar>(point: Point3<S>) -> Nearest<S> {
    Nearest { point, normal: Vec3::unit_y(), distance: S::infinity() }
}

/// The answer of a surface that was moved.
fn placed<S: Scalar>(
    pose: Pose<S>,
    point: Point3<S>,
    nearest: impl FnOnce(Point3<S>) -> Option<Nearest<S>>,
) -> Nearest<S> {
    if pose == Pose::identity() {
        return nearest(point).unwrap_or_else(|| nowhere(point));
    }
    nearest(pose.point_back(point)).map_or_else(
        || nowhere(point),
        |near| Nearest {
            point: pose.point(near.point),
            normal: pose.vector(near.normal).normalize(),
            ..near
        },
    )
}

impl<S> From<Plane<S>> for WallShape<S> {
    fn from(plane: Plane<S>) -> Self {
        Self::Plane(plane)
    }
}

impl<S> From<Shape<S>> for WallShape<S> {
    fn from(shape: Shape<S>) -> Self {
        Self::Solid(shape)
    }
}

impl<S> From<Sphere<S>> for WallShape<S> {
    fn from(sphere: Sphere<S>) -> Self {
        Self::Solid(Shape::Sphere(sphere))
    }
}

impl<S> From<Box3<S>> for WallShape<S> {
    fn from(aabb: Box3<S>) -> Self {
        Self::Solid(Shape::Aabb(aabb))
    }
}

impl<S> From<Obb<S>> for WallShape<S> {
    fn from(obb: Obb<S>) -> Self {
        Self::Solid(Shape::Obb(obb))
    }
}

impl<S> From<Capsule<S>> for WallShape<S> {
    fn from(capsule: Capsule<S>) -> Self {
        Self::Solid(Shape::Capsule(capsule))
    }
}

impl<S> From<Hull<S>> for WallShape<S> {
    fn from(hull: Hull<S>) -> Self {
        Self::Solid(Shape::Hull(hull))
    }
}

impl<S> From<Compound<Shape<S>>> for WallShape<S> {
    fn from(compound: Compound<Shape<S>>) -> Self {
        Self::Solid(Shape::Compound(compound))
    }
}

impl<S: Scalar> From<Mesh<S>> for WallShape<S> {
    fn from(mesh: Mesh<S>) -> Self {
        Self::Mesh(Arc::new(mesh), Pose::identity())
    }
}

impl<S: Scalar> From<HeightField<S>> for WallShape<S> {
    fn from(field: HeightField<S>) -> Self {
        Self::HeightField(Arc::new(field), Pose::identity())
    }
}
