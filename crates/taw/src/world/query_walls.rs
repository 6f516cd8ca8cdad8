//! Rays and shapes cast on single walls, for [`Queries`](super::Queries) and [`Sensors`](super::Sensors).

use std::borrow::Cow;

use cgmath::InnerSpace;

use super::WallShape;
use super::walls::SubShape;
use crate::contact::{
    Convex, RayCast, RayHit, ShapeCastHit, TriangleResult, closest_points_of_plane,
    closest_points_of_shapes, closest_points_of_surface, ray_cast_on_surface, shape_cast_of_shapes,
    shape_cast_on_surface, sub_shapes,
};
use crate::frame::{Pose, Ray};
use crate::math::{Scalar, Vec3};
use crate::shape::{HeightField, Plane, PointProjection, Shape, Surface};

/// Turns a result in the frame of a surface into one of the world.
trait ToWorld<S> {
    fn to_world(self, pose: Pose<S>) -> Self;
}

impl<S: Scalar> ToWorld<S> for RayHit<S> {
    fn to_world(self, pose: Pose<S>) -> Self {
        Self {
            point: pose.transform_point(self.point),
            normal: pose.transform_vector(self.normal),
            ..self
        }
    }
}

impl<S: Scalar> ToWorld<S> for ShapeCastHit<S> {
    fn to_world(self, pose: Pose<S>) -> Self {
        Self {
            point: pose.transform_point(self.point),
            normal: pose.transform_vector(self.normal),
            ..self
        }
    }
}

pub(super) fn cast_ray_on_wall<S: Scalar>(
    wall: &WallShape<S>,
    SubShape { index: part, .. }: SubShape,
    ray: &Ray<S>,
    max_distance: S,
) -> Option<RayHit<S>> {
    let local = |pose: &Pose<S>| Ray {
        origin: pose.inverse_transform_point(ray.origin),
        direction: pose.inverse_transform_vector(ray.direction),
    };
    let to_world = |hit: Option<TriangleResult<RayHit<S>>>, pose: &Pose<S>| {
        hit.map(|hit| hit.result.to_world(*pose))
    };
    match wall {
        WallShape::Plane(plane) => plane.cast_ray(ray, max_distance),
        WallShape::Solid(_) => wall.sub_shape(part)?.cast_ray(ray, max_distance),
        WallShape::Mesh(mesh, pose) => {
            to_world(ray_cast_on_surface(&**mesh, &local(pose), max_distance), pose)
        }
        WallShape::HeightField(field, pose) => {
            if wall.is_in_height_field(ray.origin) {
                let normal = wall.project_point(ray.origin).normal;
                return Some(RayHit { distance: S::zero(), point: ray.origin, normal });
            }
            to_world(ray_cast_on_surface(&**field, &local(pose), max_distance), pose)
        }
    }
}

pub(super) fn cast_shape_on_wall<S: Scalar>(
    wall: &WallShape<S>,
    part: u32,
    shape: &Shape<S>,
    translation: Vec3<S>,
) -> Option<ShapeCastHit<S>> {
    let still = Vec3::new(S::zero(), S::zero(), S::zero());
    match wall {
        WallShape::Plane(_) => None,
        WallShape::Solid(_) => {
            let hit = shape_cast_of_shapes(wall.sub_shape(part)?, still, shape, translation);
            hit.map(|hit| hit.result)
        }
        WallShape::Mesh(mesh, pose) => shape_cast_transformed(&**mesh, *pose, shape, translation),
        WallShape::HeightField(field, pose) => {
            shape_cast_on_field(wall, (field, *pose), shape, translation)
        }
    }
}

/// First contact of a translating shape with a half-space.
pub(super) fn cast_shape_on_half_space<S: Scalar>(
    plane: &Plane<S>,
    shape: &Shape<S>,
    translation: Vec3<S>,
) -> Option<ShapeCastHit<S>> {
    min_by_time(shape, |part| shape_cast_half_space(plane, part, translation))
}

/// Tests if a shape overlaps a half-space.
pub(super) fn overlaps_half_space<S: Scalar>(plane: &Plane<S>, shape: &Shape<S>) -> bool {
    closest_points_of_plane(plane, shape).touching()
}

/// Tests if a shape overlaps a sub-shape of a wall that is no half-space: its surface, or the solid.
pub(super) fn overlaps_on_wall<S: Scalar>(
    wall: &WallShape<S>,
    part: u32,
    shape: &Shape<S>,
) -> bool {
    match wall {
        WallShape::Plane(_) => false,
        WallShape::Solid(_) => {
            let near = wall.sub_shape(part).and_then(|wall| closest_points_of_shapes(wall, shape));
            near.is_some_and(|near| near.result.touching())
        }
        WallShape::Mesh(mesh, pose) => overlaps_transformed(&**mesh, *pose, shape),
        WallShape::HeightField(field, pose) => {
            let inside = |part: &dyn Convex<S>| wall.is_in_height_field(part.center());
            overlaps_transformed(&**field, *pose, shape)
                || sub_shapes(shape).into_iter().any(inside)
        }
    }
}

impl<S: Scalar> WallShape<S> {
    /// Tests if a shape overlaps the wall.
    pub(super) fn overlaps(&self, shape: &Shape<S>) -> bool {
        if let Self::Plane(plane) = self {
            return overlaps_half_space(plane, shape);
        }
        let mut found = false;
        self.for_each_box(|part, _| found = found || overlaps_on_wall(self, part, shape));
        found
    }

    /// Time of the first contact of a translating shape with the wall, as a fraction of the motion.
    /// Ignores a contact that separates at the start.
    pub(super) fn cast_shape(&self, shape: &Shape<S>, translation: Vec3<S>) -> Option<S> {
        if let Self::Plane(plane) = self {
            return cast_shape_on_half_space(plane, shape, translation).map(|hit| hit.time);
        }
        let mut first: Option<S> = None;
        self.for_each_box(|part, _| {
            if let Some(hit) = cast_shape_on_wall(self, part, shape, translation) {
                first = Some(first.map_or(hit.time, |first| first.min(hit.time)));
            }
        });
        first
    }
}

/// Earliest hit among the sub-shapes of a shape.
fn min_by_time<S: Scalar>(
    shape: &Shape<S>,
    query: impl Fn(&dyn Convex<S>) -> Option<ShapeCastHit<S>>,
) -> Option<ShapeCastHit<S>> {
    let touches = sub_shapes(shape).into_iter().filter_map(query);
    touches.reduce(|x, y| if y.time < x.time { y } else { x })
}

/// Transforms a shape into a local frame.
fn to_local<S: Scalar>(shape: &Shape<S>, pose: Pose<S>) -> Cow<'_, Shape<S>> {
    if pose == Pose::identity() {
        Cow::Borrowed(shape)
    } else {
        Cow::Owned(shape.transformed(pose.inverse()))
    }
}

fn shape_cast_transformed<S: Scalar>(
    surface: &impl Surface<S>,
    pose: Pose<S>,
    shape: &Shape<S>,
    translation: Vec3<S>,
) -> Option<ShapeCastHit<S>> {
    let translation = pose.inverse_transform_vector(translation);
    let touch =
        |part: &dyn Convex<S>| Some(shape_cast_on_surface(surface, part, translation)?.result);
    Some(min_by_time(&to_local(shape, pose), touch)?.to_world(pose))
}

/// First contact of a translating shape with the solid of a transformed height field. A convex part
/// whose center is inside at the start hits at once if it approaches the surface nearest to that.
fn shape_cast_on_field<S: Scalar>(
    wall: &WallShape<S>,
    (field, pose): (&HeightField<S>, Pose<S>),
    shape: &Shape<S>,
    translation: Vec3<S>,
) -> Option<ShapeCastHit<S>> {
    let at_once = min_by_time(shape, |part| {
        let inside = Some(part.center()).filter(|center| wall.is_in_height_field(*center))?;
        let PointProjection { point, normal, .. } = wall.project_point(inside);
        let approaches = translation.dot(normal) < S::zero();
        approaches.then(|| ShapeCastHit { time: S::zero(), normal, point })
    });
    let along = pose.inverse_transform_vector(translation);
    let later = || {
        min_by_time(&to_local(shape, pose), |part| {
            let outside = !field.has_inside(part.center());
            outside.then(|| shape_cast_on_surface(field, part, along))?.map(|hit| hit.result)
        })
    };
    at_once.or_else(|| Some(later()?.to_world(pose)))
}

fn overlaps_transformed<S: Scalar>(
    surface: &impl Surface<S>,
    pose: Pose<S>,
    shape: &Shape<S>,
) -> bool {
    let touches = |part| closest_points_of_surface(surface, part, S::zero()).is_some();
    sub_shapes(&to_local(shape, pose)).into_iter().any(touches)
}

/// First contact of a translating convex shape with a half-space.
fn shape_cast_half_space<S: Scalar>(
    plane: &Plane<S>,
    shape: &dyn Convex<S>,
    translation: Vec3<S>,
) -> Option<ShapeCastHit<S>> {
    let normal = plane.normal();
    let lowest = shape.support(-normal);
    let (gap, closing) = (plane.signed_distance(lowest), -translation.dot(normal));
    let time = (gap / closing).max(S::zero());
    let meets = closing > S::zero() && time <= S::one();
    meets.then(|| ShapeCastHit { time, normal, point: lowest + translation * time })
}
