//! The shapes of the gallery, and what the core says of two of them.

use bevy::prelude::*;
use bevy_taw::taw::contact::{
    ClosestPoints, ManifoldPoint, closest_points_of_plane, closest_points_of_shapes,
    closest_points_of_surface, manifolds_of_shapes, manifolds_of_surface, shape_cast_of_shapes,
    shape_cast_on_surface, sub_shapes,
};
use bevy_taw::taw::frame::Pose;
use bevy_taw::taw::math::{Point3, Quat as TawQuat, Vec3 as TawVec3};
use bevy_taw::taw::shape::{
    Aabb, Capsule, Compound, HeightField, Hull, Mesh as TawMesh, Obb, Plane, Shape, Sphere, Surface,
};
use clap::ValueEnum;

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    Sphere,
    Aabb,
    Box,
    Capsule,
    Hull,
    Compound,
    /// These three can only be the first
    Plane,
    Mesh,
    HeightField,
}

/// Shapes on show, and the place of the second one.
#[derive(Resource)]
pub struct Scene {
    pub kinds: [Kind; 2],
    pub place: Transform,
    /// Distance from the eye at which it was grabbed, and its place from there.
    pub held: Option<(f32, Vec3)>,
    /// Direction in which it would go.
    pub way: Vec3,
}

fn taw_vector(v: Vec3) -> TawVec3<f32> {
    TawVec3::new(v.x, v.y, v.z)
}

pub fn bevy_point(p: Point3<f32>) -> Vec3 {
    Vec3::new(p.x, p.y, p.z)
}

pub fn bevy_vector(v: TawVec3<f32>) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}

/// A bounded shape of a kind about the origin.
pub fn shape(kind: Kind) -> Option<Shape<f32>> {
    let at = |x: f32, y: f32, z: f32| Point3::new(x, y, z);
    let turn = TawQuat::new(1.0, 0.0, 0.0, 0.0);
    let block = |x: f32, half: [f32; 3]| Obb::new(at(x, 0.0, 0.0), turn, half.into()).ok();
    Some(match kind {
        Kind::Sphere => Shape::Sphere(Sphere::new(at(0.0, 0.0, 0.0), 0.7).ok()?),
        Kind::Aabb => Shape::Aabb(Aabb::new(at(-0.8, -0.5, -0.6), at(0.8, 0.5, 0.6)).ok()?),
        Kind::Box => Shape::Obb(block(0.0, [0.8, 0.5, 0.6])?),
        Kind::Capsule => {
            Shape::Capsule(Capsule::new(at(0.0, -0.6, 0.0), at(0.0, 0.6, 0.0), 0.4).ok()?)
        }
        Kind::Hull => {
            let corners = [[0.9, 0.0, 0.0], [-0.6, 0.7, 0.1], [-0.5, -0.7, 0.3], [0.0, 0.1, 0.9]];
            let more = [[0.1, -0.3, -0.8], [0.5, 0.6, 0.4]];
            let corners: Vec<_> = corners.into_iter().chain(more).map(Point3::from).collect();
            Shape::Hull(Hull::new(&corners).ok()?)
        }
        Kind::Compound => {
            let ball = |x: f32| Sphere::new(at(x, 0.0, 0.0), 0.45).map(Shape::Sphere).ok();
            let bar = Shape::Obb(block(0.0, [0.8, 0.15, 0.15])?);
            Shape::Compound(Compound::new(vec![ball(-0.8)?, bar, ball(0.8)?]).ok()?)
        }
        Kind::Plane | Kind::Mesh | Kind::HeightField => return None,
    })
}

/// Shapes that only the first one can be.
pub enum Ground {
    Plane(Plane<f32>),
    Mesh(TawMesh<f32>),
    HeightField(HeightField<f32>),
}

pub fn ground(kind: Kind) -> Option<Ground> {
    let wave = |x: f32, z: f32| 0.4 * (1.5 * x).sin() * (1.2 * z).cos() - 0.4;
    let grid = || (0..13).flat_map(|z| (0..13).map(move |x| [x as f32 * 0.4, z as f32 * 0.4]));
    Some(match kind {
        Kind::Plane => Ground::Plane(Plane::new(TawVec3::unit_y(), 0.0).ok()?),
        Kind::HeightField => {
            let heights = grid().map(|[x, z]| wave(x, z)).collect();
            let corner = Point3::new(-2.4, 0.0, -2.4);
            Ground::HeightField(HeightField::new(corner, [0.4; 2], 13, heights).ok()?)
        }
        Kind::Mesh => {
            let point = |[x, z]: [f32; 2]| Point3::new(x - 2.4, wave(z, x), z - 2.4);
            let cells = (0..12).flat_map(|z| (0..12).map(move |x| z * 13 + x));
            let triangles = cells.flat_map(|i| [[i, i + 14, i + 1], [i, i + 13, i + 14]]);
            Ground::Mesh(TawMesh::new(grid().map(point).collect(), triangles.collect()).ok()?)
        }
        _ => return None,
    })
}

/// The second one where it is.
pub fn second(scene: &Scene) -> Option<Shape<f32>> {
    let [x, y, z, w] = scene.place.rotation.to_array();
    let translation = taw_vector(scene.place.translation);
    let moved = shape(scene.kinds[1])?
        .transformed(Pose { rotation: TawQuat::new(w, x, y, z), translation });
    // A box along the axes stays along them.
    Some(match (scene.kinds[1], &moved) {
        (Kind::Aabb, _) => shape(Kind::Aabb)?.transformed(Pose { translation, ..Pose::identity() }),
        _ => moved,
    })
}

/// All that the core says of the two.
pub struct Answers {
    pub closest: Option<ClosestPoints<f32>>,
    /// Points on both surfaces.
    pub touches: Vec<(Vec3, f32, u32)>,
    /// When, as a part of the way, and where.
    pub impact: Option<(f32, Vec3, Vec3)>,
}

pub fn ask(scene: &Scene) -> Option<Answers> {
    let (b, way) = (second(scene)?, taw_vector(scene.way));
    let still = TawVec3::new(0.0, 0.0, 0.0);
    let point = |p: &ManifoldPoint<f32>| (bevy_point(p.on_b), p.distance, p.feature);
    if let Some(a) = shape(scene.kinds[0]) {
        let touches = manifolds_of_shapes(&a, &b, 0.0);
        let impact = shape_cast_of_shapes(&a, still, &b, way).map(|found| found.result);
        return Some(Answers {
            closest: closest_points_of_shapes(&a, &b).map(|found| found.result),
            touches: touches.iter().flat_map(|it| it.result.points.iter().map(point)).collect(),
            impact: impact.map(|it| (it.time, bevy_point(it.point), bevy_vector(it.normal))),
        });
    }
    Some(match ground(scene.kinds[0])? {
        Ground::Plane(plane) => {
            let found = closest_points_of_plane(&plane, &b);
            let closing = -scene.way.dot(bevy_vector(found.normal));
            let time = (found.distance / closing).max(0.0);
            let at = bevy_point(found.on_b) + scene.way * time;
            let meets = closing > 0.0 && time <= 1.0;
            Answers {
                closest: Some(found),
                touches: found
                    .touching()
                    .then(|| (bevy_point(found.on_b), found.distance, 0))
                    .into_iter()
                    .collect(),
                impact: meets.then(|| (time, at, bevy_vector(found.normal))),
            }
        }
        Ground::Mesh(mesh) => ask_surface(&mesh, &b, way),
        Ground::HeightField(field) => ask_surface(&field, &b, way),
    })
}

fn ask_surface(surface: &impl Surface<f32>, b: &Shape<f32>, way: TawVec3<f32>) -> Answers {
    let parts = sub_shapes(b);
    let near = parts.iter().filter_map(|part| closest_points_of_surface(surface, *part, 5.0));
    let touches = parts.iter().flat_map(|part| manifolds_of_surface(surface, *part, 0.0));
    let impacts = parts.iter().filter_map(|part| shape_cast_on_surface(surface, *part, way));
    let first = impacts.reduce(|x, y| if y.result.time < x.result.time { y } else { x });
    Answers {
        closest: near
            .map(|found| found.result)
            .reduce(|x, y| if y.distance < x.distance { y } else { x }),
        touches: touches
            .flat_map(|it| it.result.points)
            .map(|p| (bevy_point(p.on_b), p.distance, p.feature))
            .collect(),
        impact: first.map(|it| {
            let touch = it.result;
            (touch.time, bevy_point(touch.point), bevy_vector(touch.normal))
        }),
    }
}
