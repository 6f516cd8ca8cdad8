//! Outlines of walls, sensors and sleepers.

use bevy::color::palettes::tailwind;
use bevy::gizmos::gizmos::GizmoBuffer;
use bevy::math::Isometry3d;
use bevy::prelude::*;
use taw::shape::{Plane, Shape, Surface};
use taw::world::WallShape;

use crate::convert::{from_point, from_rotation, from_vector, to_point};
use crate::gizmos::TawGizmos;
use crate::resources::TawWorld;

/// Sensors without a marble or ball inside.
const EMPTY: Srgba = tailwind::VIOLET_300;
/// Sensors with one.
const OCCUPIED: Srgba = tailwind::LIME_400;
/// Walls.
const WALL: Srgba = tailwind::TEAL_300;
/// Marbles that sleep.
const SLEEPER: Srgba = tailwind::SLATE_400;
/// Cells on each side of the grid that stands for a half-space, a metre each.
const CELLS: u32 = 10;

type Buffer = GizmoBuffer<TawGizmos, ()>;

/// Draws all sensors as the last step had them.
pub(crate) fn sensors(world: &TawWorld, places: &Query<&GlobalTransform>, gizmos: &mut Buffer) {
    for (id, entity) in &world.sensor_entities {
        let sensors = &world.sensors;
        let (Ok(shape), Ok(marbles)) = (sensors.shape(*id), sensors.inside(*id)) else { continue };
        let has_bodies = sensors.bodies_inside(*id).is_ok_and(|bodies| !bodies.is_empty());
        let has_balls = sensors.balls_inside(*id).is_ok_and(|balls| !balls.is_empty());
        let is_empty = marbles.is_empty() && !has_bodies && !has_balls;
        let color = if is_empty { EMPTY } else { OCCUPIED };
        let place = places.get(*entity).map_or(Vec3::ZERO, GlobalTransform::translation);
        outline(shape, place, gizmos, color);
    }
}

/// Draws all walls as the last step had them.
pub(crate) fn walls(world: &TawWorld, places: &Query<&GlobalTransform>, gizmos: &mut Buffer) {
    for (id, entity) in &world.wall_entities {
        if let Ok(shape) = world.walls.get(*id) {
            let place = places.get(*entity).map_or(Vec3::ZERO, GlobalTransform::translation);
            outline(shape, place, gizmos, WALL);
        }
    }
}

/// Draws a sphere around each marble that sleeps.
pub(crate) fn sleepers(world: &TawWorld, gizmos: &mut Buffer) {
    for row in 0..world.marbles.len() {
        let id = world.marbles.id(row);
        if id.is_some_and(|id| world.is_asleep(id) == Ok(true)) {
            let center = from_point(world.marbles.position()[row]);
            gizmos.sphere(center, world.marbles.radius()[row], SLEEPER);
        }
    }
}

/// Draws a shape; of a half-space, a part of it around a place.
fn outline(shape: &WallShape<f32>, place: Vec3, gizmos: &mut Buffer, color: Srgba) {
    match shape {
        WallShape::Plane(plane) => half_space(plane, place, gizmos, color),
        WallShape::Solid(shape) => solid(shape, gizmos, color),
        WallShape::Mesh(mesh, pose) => {
            surface(&**mesh, |point| from_point(pose.transform_point(point)), gizmos, color);
        }
        WallShape::HeightField(field, pose) => {
            surface(&**field, |point| from_point(pose.transform_point(point)), gizmos, color);
        }
    }
}

/// Draws a part of a half-space's surface around a place, and its normal.
fn half_space(plane: &Plane<f32>, place: Vec3, gizmos: &mut Buffer, color: Srgba) {
    let normal = from_vector(plane.normal());
    let center = place - normal * plane.signed_distance(to_point(place));
    let place = Isometry3d::new(center, Quat::from_rotation_arc(Vec3::Z, normal));
    gizmos.grid(place, UVec2::splat(CELLS), Vec2::ONE, color);
    gizmos.arrow(center, center + normal, color);
}

fn solid(shape: &Shape<f32>, gizmos: &mut Buffer, color: Srgba) {
    match shape {
        Shape::Sphere(sphere) => {
            gizmos.sphere(from_point(sphere.center), sphere.radius, color);
        }
        Shape::Aabb(it) => solid(&Shape::Obb(it.obb()), gizmos, color),
        Shape::Obb(it) => {
            let place = Transform {
                translation: from_point(it.center),
                rotation: from_rotation(it.rotation),
                scale: 2.0 * from_vector(it.half_extents),
            };
            gizmos.cube(place, color);
        }
        Shape::Capsule(it) => {
            let (a, b) = (from_point(it.a), from_point(it.b));
            let turn = Quat::from_rotation_arc(Vec3::Y, (b - a).normalize_or(Vec3::Y));
            let capsule = Capsule3d::new(it.radius, a.distance(b));
            gizmos.primitive_3d(&capsule, Isometry3d::new((a + b) / 2.0, turn), color);
        }
        Shape::Hull(hull) => {
            let corners: Vec<_> = hull.points().map(from_point).collect();
            for [a, b] in hull.edges() {
                gizmos.line(corners[*a as usize], corners[*b as usize], color);
            }
        }
        Shape::Compound(it) => it.parts().iter().for_each(|part| solid(part, gizmos, color)),
    }
}

fn surface(
    surface: &impl Surface<f32>,
    place: impl Fn(taw::math::Point3<f32>) -> Vec3,
    gizmos: &mut Buffer,
    color: Srgba,
) {
    surface.for_each_in_box(&surface.bounds(), |number| {
        if let Some(triangle) = surface.triangle(number) {
            gizmos.lineloop(triangle.corners.map(&place), color);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TawPlugin;
    use crate::components::Marble;
    use crate::sensor::Sensor;
    use crate::swarm::{Ball, Swarm};
    use crate::wall::Wall;
    use bevy::ecs::system::RunSystemOnce;
    use bevy::time::TimeUpdateStrategy;

    /// Each kind of shape, two metres wide about its place.
    fn kinds() -> [Wall; 7] {
        let corners = [-1.0, 1.0].map(|x| [-1.0, 1.0].map(|y| [-1.0, 1.0].map(|z| vec3(x, y, z))));
        [
            Wall::HalfSpace(Dir3::Y),
            Sphere::new(1.0).into(),
            Cuboid::new(2.0, 2.0, 2.0).into(),
            Capsule3d::new(0.5, 1.0).into(),
            Wall::Hull(corners.into_iter().flatten().flatten().collect()),
            Wall::Mesh {
                points: vec![vec3(-1.0, 0.0, -1.0), vec3(1.0, 0.0, -1.0), Vec3::Z],
                triangles: vec![[0, 2, 1]],
            },
            Wall::HeightField { cell: Vec2::ONE, columns: 3, heights: vec![0.0; 9] },
        ]
    }

    /// Points and colors of what is drawn of a sensor that is moved and turned.
    fn drawn(sensor: Wall, marble: Option<Vec3>) -> (Vec<Vec3>, Vec<LinearRgba>) {
        let marble = marble.map(|at| (Marble::new(0.4), Transform::from_translation(at)));
        drawn_with(sensor, marble)
    }

    fn drawn_with(sensor: Wall, other: Option<impl Bundle>) -> (Vec<Vec3>, Vec<LinearRgba>) {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, TransformPlugin, TawPlugin));
        app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
        let place = Transform::from_xyz(5.0, 0.0, 0.0).with_rotation(Quat::from_rotation_y(1.0));
        app.world_mut().spawn((sensor, Sensor, place));
        if let Some(other) = other {
            app.world_mut().spawn(other);
        }
        app.update();
        app.update();
        let draw = |world: Res<TawWorld>, places: Query<&GlobalTransform>| {
            let mut buffer = Buffer::default();
            sensors(&world, &places, &mut buffer);
            let points = [buffer.list_positions, buffer.strip_positions].concat();
            (points, [buffer.list_colors, buffer.strip_colors].concat())
        };
        app.world_mut().run_system_once(draw).unwrap()
    }

    #[test]
    fn sensors_of_all_shapes_are_drawn_where_they_are() {
        for wall in kinds() {
            let (points, _) = drawn(wall.clone(), None);
            let points: Vec<_> = points.into_iter().filter(|point| point.is_finite()).collect();
            assert!(points.len() >= 3, "{wall:?}");
            let reach = match wall {
                Wall::HalfSpace(_) => 7.1,
                Wall::HeightField { .. } => 3.2, // with its sides and its bottom
                _ => 1.74,
            };
            let center = vec3(5.0, 0.0, 0.0);
            let far = points.iter().map(|point| point.distance(center)).fold(0.0, f32::max);
            assert!(far <= reach && far >= 0.9, "{wall:?}: {far} m");
        }
    }

    #[test]
    fn walls_and_sleepers_are_drawn_where_they_are() {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, TransformPlugin, TawPlugin));
        app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
        app.world_mut()
            .spawn((Wall::from(Cuboid::from_length(2.0)), Transform::from_xyz(5.0, -1.0, 0.0)));
        for x in [5.0, 50.0] {
            app.world_mut().spawn((Marble::new(0.5), Transform::from_xyz(x, 0.5, 0.0)));
        }
        (0..90).for_each(|_| app.update());
        let draw = |world: Res<TawWorld>, places: Query<&GlobalTransform>| {
            let (mut boxes, mut spheres) = (Buffer::default(), Buffer::default());
            walls(&world, &places, &mut boxes);
            sleepers(&world, &mut spheres);
            [boxes, spheres].map(|it| [it.list_positions, it.strip_positions].concat())
        };
        let drawn = app.world_mut().run_system_once(draw).unwrap();
        for (points, center, reach) in
            [(&drawn[0], vec3(5.0, -1.0, 0.0), 1.74), (&drawn[1], vec3(5.0, 0.5, 0.0), 0.52)]
        {
            let points = points.iter().filter(|point| point.is_finite());
            let far: Vec<_> = points.map(|point| point.distance(center)).collect();
            assert!(far.len() > 10 && far.iter().all(|it| *it < reach), "{far:?}");
        }
    }

    #[test]
    fn a_sensor_with_a_marble_inside_has_another_color() {
        for wall in kinds() {
            let is = |color: Srgba, marble: Option<Vec3>| {
                let (_, colors) = drawn(wall.clone(), marble);
                let drawn = colors.into_iter().filter(|it| !it.red.is_nan());
                drawn.into_iter().all(|it| it == LinearRgba::from(color))
            };
            assert!(is(EMPTY, None), "{wall:?}");
            assert!(is(EMPTY, Some(vec3(0.0, 50.0, 0.0))), "{wall:?}");
            assert!(is(OCCUPIED, Some(vec3(5.0, 0.1, 0.0))), "{wall:?}");
        }
    }

    #[test]
    fn a_sensor_with_a_ball_inside_has_it_too() {
        let swarm = Swarm::new(vec![Ball::new(vec3(5.0, 0.1, 0.0), 0.4)]);
        let (_, colors) = drawn_with(Sphere::new(1.0).into(), Some(swarm));
        let mut colors = colors.into_iter().filter(|it| !it.red.is_nan());
        assert!(colors.all(|it| it == LinearRgba::from(OCCUPIED)));
    }
}
