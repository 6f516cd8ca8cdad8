use std::sync::Arc;

use cgmath::{EuclideanSpace, InnerSpace};

use crate::Error;
use crate::contact::{ClosestPoints, closest_points, sub_shapes};
use crate::error::{finite_point, finite_vector};
use crate::frame::Pose;
use crate::math::{Point3, Scalar, Vec3, cast_point, cast_vector, length};
use crate::response::event::{Solid, WallCollider};
use crate::shape::{
    Aabb3, BoundedShape, Capsule, Compound, HeightField, Hull, Mesh, Obb, Plane, PointProjection,
    Shape, Sphere, Surface, Triangle,
};

/// Place just before a nearest point, as a fraction of the way from there to the point projected.
const BEFORE: f64 = 1.0 / 64.0;

/// Shape of a wall.
#[derive(Clone, Debug, PartialEq)]
pub enum WallShape<S> {
    /// A half-space.
    Plane(Plane<S>),
    /// Any bounded shape, or a compound of such.
    Solid(Shape<S>),
    /// Triangle mesh: two-sided and hollow. Copies share it.
    Mesh(Arc<Mesh<S>>, Pose<S>),
    /// Height field, the top of a solid with vertical sides and a bottom. Copies share it.
    HeightField(Arc<HeightField<S>>, Pose<S>),
}

impl<S: Scalar> WallShape<S> {
    /// Validates the shape and flattens nested compounds.
    pub(super) fn validated(self) -> Result<Self, Error> {
        Ok(match self {
            Self::Plane(_) => self,
            Self::Solid(shape) => Self::Solid(shape.validated()?),
            Self::Mesh(mesh, pose) => {
                let pose = pose.validated()?;
                check_bounds(&mesh.bounds(), pose)?;
                Self::Mesh(mesh, pose)
            }
            Self::HeightField(field, pose) => {
                let pose = pose.validated()?;
                check_bounds(&field.bounds(), pose)?;
                Self::HeightField(field, pose)
            }
        })
    }

    /// Visits the bounding boxes: one per sub-shape of a compound, none for a half-space.
    pub(super) fn for_each_box(&self, mut visit: impl FnMut(u32, Aabb3<S>)) {
        match self {
            Self::Plane(_) => {}
            Self::Solid(Shape::Compound(compound)) => {
                for (part, shape) in (0..).zip(compound.parts()) {
                    visit(part, shape.bounding_box());
                }
            }
            Self::Solid(shape) => visit(0, shape.bounding_box()),
            Self::Mesh(mesh, pose) => visit(0, transformed_box(&mesh.bounds(), *pose)),
            Self::HeightField(field, pose) => {
                visit(0, transformed_box(&field.bounds(), *pose));
            }
        }
    }

    /// Bounding box; none of a half-space.
    pub(super) fn bounding_box(&self) -> Option<Aabb3<S>> {
        let mut bounds: Option<Aabb3<S>> = None;
        self.for_each_box(|_, part| {
            bounds = Some(bounds.map_or(part, |bounds| bounds.union(&part)));
        });
        bounds
    }

    /// Visits the sub-shapes that may overlap a box, within one of its bounding boxes.
    pub(super) fn for_each_in_box(&self, part: u32, bounds: &Aabb3<S>, visit: impl FnMut(u32)) {
        let mut visit = visit;
        match self {
            Self::Plane(_) | Self::Solid(_) => visit(part),
            Self::Mesh(mesh, pose) => {
                mesh.for_each_in_box(&transformed_box(bounds, pose.inverse()), visit);
            }
            Self::HeightField(field, pose) => {
                // A ball below the surface touches the triangles above it.
                let mut bounds = transformed_box(bounds, pose.inverse());
                bounds.max.y = bounds.max.y.max(field.bounds().max.y);
                field.for_each_in_box(&bounds, visit);
            }
        }
    }

    /// Visits the sub-shapes that may be within `reach` metres of a point, within one of its
    /// bounding boxes.
    pub(super) fn for_each_near(
        &self,
        part: u32,
        point: Point3<S>,
        reach: S,
        mut visit: impl FnMut(u32),
    ) {
        let mut each = |part| {
            visit(part);
            reach
        };
        match self {
            Self::Plane(_) | Self::Solid(_) => visit(part),
            Self::Mesh(mesh, pose) => {
                mesh.for_each_near(pose.inverse_transform_point(point), reach, &mut each);
            }
            Self::HeightField(field, pose) => {
                // A point below the surface is at most this far from it.
                let local = pose.inverse_transform_point(point);
                let far = field.signed_height(local).map_or(reach, |height| reach.max(height));
                field.for_each_near(local, far, |part| {
                    each(part);
                    far
                });
            }
        }
    }

    /// Tests for equal shapes in one place; that of large ones is asked first.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Mesh(one, pose), Self::Mesh(two, at)) => {
                pose == at && (Arc::ptr_eq(one, two) || one == two)
            }
            (Self::HeightField(one, pose), Self::HeightField(two, at)) => {
                pose == at && (Arc::ptr_eq(one, two) || one == two)
            }
            _ => self == other,
        }
    }

    /// Transforms the wall by `pose`.
    ///
    /// # Errors
    /// [`Error::NotFinite`] for a pose that a half-space cannot have. Other shapes are validated
    /// when they become a wall.
    pub fn transformed(&self, pose: Pose<S>) -> Result<Self, Error> {
        Ok(match self {
            Self::Plane(plane) => {
                let normal = pose.transform_vector(plane.normal()).normalize();
                let on = pose.transform_point(Point3::from_vec(plane.normal() * plane.offset()));
                Self::Plane(Plane::through(on, normal)?)
            }
            Self::Solid(shape) => Self::Solid(shape.transformed(pose)),
            Self::Mesh(mesh, before) => Self::Mesh(Arc::clone(mesh), pose * *before),
            Self::HeightField(field, before) => {
                Self::HeightField(Arc::clone(field), pose * *before)
            }
        })
    }

    /// Projects a point onto the surface.
    #[must_use]
    pub fn project_point(&self, point: Point3<S>) -> PointProjection<S> {
        match self {
            Self::Plane(_) => self.project_point_on(0, point),
            Self::Solid(shape) => shape.project_point(point),
            Self::Mesh(..) | Self::HeightField(..) => self.nearest_triangle(point).1,
        }
    }

    /// Nearest triangle of a surface, and the projection of the point onto it.
    pub(super) fn nearest_triangle(&self, point: Point3<S>) -> (u32, PointProjection<S>) {
        let mut best = (0, no_projection(point));
        let visit = |part: u32| {
            let next = (part, self.project_point_on(part, point));
            let order = |(part, it): &(u32, PointProjection<S>)| (it.distance.abs(), *part);
            if order(&next) < order(&best) {
                best = next;
            }
            best.1.distance.abs()
        };
        match self {
            Self::Plane(_) | Self::Solid(_) => {}
            Self::Mesh(mesh, pose) => {
                mesh.for_each_near(pose.inverse_transform_point(point), S::infinity(), visit);
            }
            Self::HeightField(field, pose) => {
                field.for_each_near(pose.inverse_transform_point(point), S::infinity(), visit);
            }
        }
        best
    }

    /// Projects a point onto a sub-shape.
    pub(super) fn project_point_on(&self, part: u32, point: Point3<S>) -> PointProjection<S> {
        match self {
            Self::Plane(plane) => {
                let (normal, distance) = (plane.normal(), plane.signed_distance(point));
                PointProjection { point: point - normal * distance, normal, distance }
            }
            Self::Solid(_) => match self.sub_shape(part) {
                Some(shape) => shape.project_point(point),
                None => no_projection(point),
            },
            Self::Mesh(mesh, pose) => project_transformed(*pose, point, |point| {
                mesh.triangle(part).map(|triangle| triangle.project_point(point))
            }),
            Self::HeightField(field, pose) => project_transformed(*pose, point, |point| {
                let near = field.triangle(part)?.project_point(point);
                let inside = near.distance > S::zero() && field.has_inside(point);
                Some(if inside { near.flipped() } else { near })
            }),
        }
    }

    /// Unit normal of a triangle on the side of a point; none for another shape, or from within a
    /// height field.
    pub(super) fn face_normal(&self, part: u32, from: Point3<S>) -> Option<Vec3<S>> {
        let (triangle, pose) = match self {
            Self::Mesh(mesh, pose) => (mesh.triangle(part)?, pose),
            Self::HeightField(field, pose) => (field.triangle(part)?, pose),
            Self::Plane(_) | Self::Solid(_) => return None,
        };
        let normal = pose.transform_vector(triangle.normal()?);
        let is_outside =
            (from - pose.transform_point(triangle.corners[0])).dot(normal) >= S::zero();
        let is_two_sided = matches!(self, Self::Mesh(..));
        (is_outside || is_two_sided).then_some(if is_outside { normal } else { -normal })
    }

    /// Tests if the straight way from a point outside to the nearest one of this sub-shape leads
    /// through the solid below a height field: another sub-shape is nearer, and in between.
    pub(super) fn is_behind_solid(&self, part: u32, nearest: &PointProjection<S>) -> bool {
        let Self::HeightField(field, pose) = self else { return false };
        let normal = pose.inverse_transform_vector(nearest.normal);
        let outward = field.triangle(part).and_then(|triangle| triangle.normal());
        if nearest.distance <= S::zero() || outward.is_none_or(|n| n.dot(normal) >= S::zero()) {
            return false;
        }
        let before = nearest.distance * S::from_f64(BEFORE);
        self.is_in_height_field(nearest.point + nearest.normal * before)
    }

    /// Tests if this is a height field, with a point in its solid.
    pub(super) fn is_in_height_field(&self, point: Point3<S>) -> bool {
        let Self::HeightField(field, pose) = self else { return false };
        field.has_inside(pose.inverse_transform_point(point))
    }

    /// Closest points of a sub-shape and a capsule, except for half-spaces.
    pub(super) fn closest_points(
        &self,
        part: u32,
        capsule: &Capsule<S>,
    ) -> Option<ClosestPoints<S>> {
        let triangle = |triangle: Triangle<S>, pose: &Pose<S>| {
            let corners = triangle.corners.map(|corner| pose.transform_point(corner));
            closest_points(&Triangle { corners }, capsule)
        };
        match self {
            Self::Plane(_) => None,
            Self::Solid(_) => {
                let parts = sub_shapes(self.sub_shape(part)?).into_iter();
                parts.map(|part| closest_points(part, capsule)).next()
            }
            Self::Mesh(mesh, pose) => mesh.triangle(part).map(|it| triangle(it, pose)),
            Self::HeightField(field, pose) => field.triangle(part).map(|it| triangle(it, pose)),
        }
    }

    /// Sub-shape in `f64`.
    pub(super) fn sub_shape_f64(&self, part: u32) -> Option<WallCollider> {
        let triangle = |triangle: Option<Triangle<S>>, pose: &Pose<S>| {
            let corners = triangle?.corners;
            Some(Triangle {
                corners: corners.map(|corner| cast_point(pose.transform_point(corner))),
            })
        };
        match self {
            Self::Plane(plane) => {
                // Normalized in `f64`: the rounded length would add energy.
                let normal = cast_vector::<S, f64>(plane.normal());
                let length = normal.magnitude();
                let (normal, offset) = (normal / length, plane.offset().as_f64() / length);
                Some(WallCollider::Plane { normal, offset })
            }
            Self::Solid(_) => self.sub_shape(part).map(|shape| WallCollider::Solid(shape.cast())),
            Self::Mesh(mesh, pose) => {
                triangle(mesh.triangle(part), pose).map(WallCollider::Triangle)
            }
            Self::HeightField(field, pose) => {
                let surface = triangle(field.triangle(part), pose)?;
                if !field.is_top(part) {
                    return Some(WallCollider::Triangle(surface));
                }
                Some(WallCollider::OneSidedTriangle(surface, Arc::new(self.clone())))
            }
        }
    }

    /// Bounding box of a sub-shape; none of a half-space.
    pub(super) fn sub_shape_box(&self, part: u32) -> Option<Aabb3<S>> {
        let of_triangle = |triangle: Option<Triangle<S>>, pose: &Pose<S>| {
            let corners = triangle?.corners.map(|corner| pose.transform_point(corner));
            Some(Triangle { corners }.bounding_box())
        };
        match self {
            Self::Plane(_) => None,
            Self::Solid(_) => self.sub_shape(part).map(BoundedShape::bounding_box),
            Self::Mesh(mesh, pose) => of_triangle(mesh.triangle(part), pose),
            Self::HeightField(field, pose) => of_triangle(field.triangle(part), pose),
        }
    }

    /// Convex sub-shape.
    pub(super) fn sub_shape(&self, part: u32) -> Option<&Shape<S>> {
        match self {
            Self::Solid(Shape::Compound(compound)) => compound.parts().get(part as usize),
            Self::Solid(shape) => Some(shape),
            Self::Plane(_) | Self::Mesh(..) | Self::HeightField(..) => None,
        }
    }
}

impl<S: Scalar> Solid for WallShape<S> {
    /// Points of the sides and of the bottom are not inside, whatever rounding says.
    fn has_inside(&self, point: Point3<f64>) -> bool {
        let Self::HeightField(field, pose) = self else { return false };
        let point = cast_point(point);
        let (local, Aabb3 { min, max }) = (pose.inverse_transform_point(point), field.bounds());
        let sizes = [point, local, min, max].map(|it| length(it.to_vec()));
        let rounding = sizes.into_iter().fold(S::zero(), S::max) * S::epsilon() * S::from_f64(32.0);
        let within = |axis: usize| (local[axis] - min[axis]).min(max[axis] - local[axis]);
        let depth = within(0).min(within(2)).min(local.y - min.y);
        depth > rounding && field.has_inside(local)
    }
}

/// Checks that a surface in this box, transformed, is finite.
fn check_bounds<S: Scalar>(bounds: &Aabb3<S>, pose: Pose<S>) -> Result<(), Error> {
    finite_vector(["size.x", "size.y", "size.z"], bounds.max - bounds.min)?;
    let Aabb3 { min, max } = transformed_box(bounds, pose);
    finite_point(["shape.x", "shape.y", "shape.z"], min)?;
    finite_point(["shape.x", "shape.y", "shape.z"], max).map(|_| ())
}

/// Bounding box of a transformed box.
fn transformed_box<S: Scalar>(bounds: &Aabb3<S>, pose: Pose<S>) -> Aabb3<S> {
    if pose == Pose::identity() { *bounds } else { bounds.obb().transformed(pose).bounding_box() }
}

/// Result for a missing part: infinitely far away.
fn no_projection<S: Scalar>(point: Point3<S>) -> PointProjection<S> {
    PointProjection { point, normal: Vec3::unit_y(), distance: S::infinity() }
}

/// Projection onto a transformed surface.
fn project_transformed<S: Scalar>(
    pose: Pose<S>,
    point: Point3<S>,
    nearest: impl FnOnce(Point3<S>) -> Option<PointProjection<S>>,
) -> PointProjection<S> {
    if pose == Pose::identity() {
        return nearest(point).unwrap_or_else(|| no_projection(point));
    }
    nearest(pose.inverse_transform_point(point)).map_or_else(
        || no_projection(point),
        |near| PointProjection {
            point: pose.transform_point(near.point),
            normal: pose.transform_vector(near.normal).normalize(),
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

impl<S> From<Aabb3<S>> for WallShape<S> {
    fn from(aabb: Aabb3<S>) -> Self {
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
