//! Walls of meshes, and meshes of walls.

use bevy::asset::AssetPlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene::{self, random};

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin, AssetPlugin::default(), MeshPlugin));
    app.add_plugins(TawPlugins);
    app.insert_resource(Time::<Fixed>::from_seconds(f64::from(scene::STEP)));
    scene::frame_length(&mut app, scene::STEP);
    app.finish();
    app.cleanup();
    app.update();
    app
}

fn add(app: &mut App, mesh: impl Into<Mesh>) -> Handle<Mesh> {
    app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh)
}

fn is_wall(app: &App, entity: Entity) -> bool {
    app.world().get::<Wall>(entity).is_some()
}

/// Height at which a marble of 25 cm comes to rest.
fn rest(app: &mut App, from: Vec3) -> f32 {
    let marble = app
        .world_mut()
        .spawn((Marble::new(0.25), Transform::from_translation(from)))
        .insert(SurfaceMaterial { restitution: 0.0, ..default() })
        .id();
    scene::frames(app, 200);
    let height = scene::position(app, marble).y - 0.25;
    app.world_mut().despawn(marble);
    height
}

#[test]
fn marbles_lie_on_what_is_drawn() {
    for shape in [MeshShape::Triangles, MeshShape::ConvexHull] {
        let mut app = app();
        let mesh = add(&mut app, Cuboid::new(6.0, 1.0, 6.0));
        let place = Transform::from_xyz(0.0, -1.0, 0.0).with_scale(Vec3::new(1.0, 2.0, 1.0));
        let walls = MeshWalls { shape, ..default() };
        let floor = app.world_mut().spawn((Mesh3d(mesh), walls, place)).id();
        let lies = rest(&mut app, Vec3::new(0.3, 2.0, 0.1));
        assert!(lies.abs() < 0.005, "{shape:?}: {lies}");
        app.world_mut().entity_mut(floor).remove::<MeshWalls>();
        app.update();
        assert!(!is_wall(&app, floor));
        assert!(rest(&mut app, Vec3::new(0.3, 2.0, 0.1)) < -1.0, "{shape:?}");
    }
}

#[test]
fn of_a_scene_those_with_the_names_are_walls() {
    let mut app = app();
    let mesh = add(&mut app, Cuboid::from_length(1.0));
    let root = app.world_mut().spawn((MeshWalls::named(["Track"]), Transform::default())).id();
    let world = app.world_mut();
    let drawn = Mesh3d(mesh.clone());
    // As glTF scenes come: a node with a name, its meshes below.
    let track = world.spawn((Name::new("Track"), Transform::default(), ChildOf(root))).id();
    let part = world.spawn((drawn.clone(), Name::new("Track.0"), ChildOf(track))).id();
    let tree = world.spawn((drawn.clone(), Name::new("Tree"), ChildOf(root))).id();
    let marble = world.spawn((drawn.clone(), Marble::new(0.5), ChildOf(track))).id();
    let own = world.spawn((drawn.clone(), Wall::default(), ChildOf(track))).id();
    let other = world.spawn(drawn.clone()).id();
    scene::frames(&mut app, 2);
    assert!(is_wall(&app, part));
    assert!([tree, marble, other].iter().all(|entity| !is_wall(&app, *entity)));
    assert_eq!(app.world().get::<Wall>(own), Some(&Wall::default()));
    // One that comes later, and one that is renamed.
    let late = app.world_mut().spawn((drawn, ChildOf(track))).id();
    app.world_mut().entity_mut(tree).insert(Name::new("Track"));
    scene::frames(&mut app, 2);
    assert!(is_wall(&app, late) && is_wall(&app, tree));
    app.world_mut().entity_mut(root).insert(MeshWalls::default());
    scene::frames(&mut app, 2);
    assert!([part, tree, late].iter().all(|entity| is_wall(&app, *entity)));
    app.world_mut().entity_mut(late).insert(ChildOf(other));
    scene::frames(&mut app, 2);
    assert!(!is_wall(&app, late));
}

#[test]
fn what_is_taken_away_is_no_wall() {
    let mut app = app();
    let mesh = add(&mut app, Cuboid::from_length(1.0));
    let root = app.world_mut().spawn((MeshWalls::default(), Transform::default())).id();
    let mut part = || app.world_mut().spawn((Mesh3d(mesh.clone()), ChildOf(root))).id();
    let [erased, orphan, marble] = [part(), part(), part()];
    let zone = app.world_mut().spawn((Mesh3d(mesh), MeshWalls::default(), Sensor)).id();
    scene::frames(&mut app, 2);
    assert!([erased, orphan, marble].iter().all(|entity| is_wall(&app, *entity)));
    assert!(matches!(app.world().get::<Wall>(zone), Some(Wall::Mesh { .. })));
    app.world_mut().entity_mut(erased).remove::<Mesh3d>();
    app.world_mut().entity_mut(orphan).remove::<ChildOf>();
    app.world_mut().entity_mut(marble).insert(Marble::new(0.5));
    scene::frames(&mut app, 2);
    assert!([erased, orphan, marble].iter().all(|entity| !is_wall(&app, *entity)));
}

#[test]
fn a_mesh_that_loads_late_or_changes_is_followed() {
    let mut app = app();
    let handle = app.world().resource::<Assets<Mesh>>().reserve_handle();
    let floor = app.world_mut().spawn((Mesh3d(handle.clone()), MeshWalls::default())).id();
    scene::frames(&mut app, 5);
    assert!(!is_wall(&app, floor));
    let mut insert = |height: f32| {
        let mesh = Mesh::from(Cuboid::new(6.0, height, 6.0));
        app.world_mut().resource_mut::<Assets<Mesh>>().insert(&handle, mesh).unwrap();
        rest(&mut app, Vec3::new(0.3, 4.0, 0.1))
    };
    for height in [1.0, 3.0, 2.0] {
        let lies = insert(height);
        assert!((lies - height / 2.0).abs() < 0.005, "{lies}, not {}", height / 2.0);
    }
}

#[test]
fn what_is_no_solid_is_no_wall() {
    let mut app = app();
    let line = Mesh::new(bevy::mesh::PrimitiveTopology::LineList, default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, vec![[0.0; 3], [1.0; 3]]);
    let lines = add(&mut app, line);
    let entity = app.world_mut().spawn((Mesh3d(lines), MeshWalls::default())).id();
    scene::frames(&mut app, 3);
    assert!(!is_wall(&app, entity));
    let nan = Mesh::from(Triangle3d::new(Vec3::NAN, Vec3::X, Vec3::Y));
    assert!(Wall::from_mesh(&nan).is_err());
    assert!(
        Wall::Mesh { points: vec![Vec3::ZERO], triangles: vec![[0, 1, 2]] }.to_mesh().is_none()
    );
    assert!(Wall::Hull(vec![Vec3::ZERO; 4]).to_mesh().is_none());
}

#[test]
fn a_wall_its_mesh_and_the_wall_of_that_are_one_shape() {
    for case in 0..12 {
        let number = move |i: u64| random(case * 1000 + i);
        let wall = match case % 3 {
            0 => Wall::HeightField {
                cell: Vec2::new(0.7, 0.4),
                columns: 5,
                heights: (0..35).map(number).collect(),
            },
            1 => Wall::Hull(
                (0..24)
                    .map(|i| {
                        let at = |j: u64| number(3 * i + j) * 2.0 - 1.0;
                        Vec3::new(at(0), at(1), at(2)) * Vec3::new(2.0, 0.5, 2.0)
                    })
                    .collect(),
            ),
            _ => Wall::from_mesh(&Mesh::from(Torus::new(0.4 + 0.4 * number(0), 1.5))).unwrap(),
        };
        let again = Wall::from_mesh(&wall.to_mesh().unwrap()).unwrap();
        let heights = |wall: &Wall| {
            let mut app = app();
            app.world_mut().spawn(wall.clone());
            app.update();
            let ray = move |at: u64| {
                let [x, z] = [number(400 + 2 * at), number(401 + 2 * at)].map(|it| it * 3.0 - 1.5);
                Ray3d::new(Vec3::new(x, 5.0, z), Dir3::NEG_Y)
            };
            let cast = move |spatial: SpatialQuery| {
                let filter = SpatialQueryFilter::default();
                let height = |at| spatial.cast_ray(ray(at), 20.0, &filter).map(|hit| hit.point.y);
                // Below the rim, a height field has sides and a bottom that its mesh lacks.
                let seen = move |height: &f32| case % 3 != 0 || *height > 0.0;
                (0..50).map(|at| height(at).filter(seen)).collect::<Vec<_>>()
            };
            bevy::ecs::system::RunSystemOnce::run_system_once(app.world_mut(), cast).unwrap()
        };
        let (first, second) = (heights(&wall), heights(&again));
        assert!(first.iter().filter(|height| height.is_some()).count() > 5, "{case}");
        for (a, b) in first.iter().zip(&second) {
            let same = match (a, b) {
                (Some(a), Some(b)) => (a - b).abs() < 1e-4,
                (a, b) => a == b,
            };
            assert!(same, "{case}: {a:?} and {b:?}");
        }
    }
}

/// Rays meet a compound body where they meet the mesh by which it is drawn.
#[test]
fn a_body_and_its_mesh_are_one_shape() {
    use bevy_taw::body::BodyShape;
    let number = |i: u64| random(77_000 + i);
    let corner = |i: u64| Vec3::new(number(3 * i), number(3 * i + 1), number(3 * i + 2));
    let hull = BodyShape::Hull((0..12).map(corner).collect());
    let turn = Quat::from_euler(EulerRot::XYZ, 0.3, 1.0, -0.4);
    let body = Body::from(Cuboid::new(0.4, 0.9, 1.6)).with_part(hull, Vec3::X * 0.3, turn);
    let wall = Wall::from_mesh(&body.to_mesh().unwrap()).unwrap();
    let place = Transform::from_xyz(0.1, 0.2, 0.3).with_rotation(turn.inverse());
    let heights = |is_body: bool| {
        let mut app = app();
        app.insert_resource(TawModel(Model::GAME)).insert_resource(Gravity(Vec3::ZERO));
        if is_body {
            app.world_mut().spawn((body.clone(), place));
        } else {
            app.world_mut().spawn((wall.clone(), place));
        }
        app.update();
        let cast = move |spatial: SpatialQuery| {
            let height = |at: u64| {
                let [x, z] = [number(900 + 2 * at), number(901 + 2 * at)].map(|it| it * 2.0 - 1.0);
                let ray = Ray3d::new(Vec3::new(x, 5.0, z), Dir3::NEG_Y);
                spatial.cast_ray(ray, 20.0, &SpatialQueryFilter::default()).map(|hit| hit.distance)
            };
            (0..200).map(height).collect::<Vec<_>>()
        };
        bevy::ecs::system::RunSystemOnce::run_system_once(app.world_mut(), cast).unwrap()
    };
    let (first, second) = (heights(true), heights(false));
    assert!(first.iter().flatten().count() > 20);
    for (a, b) in first.iter().zip(&second) {
        assert_eq!(a.is_some(), b.is_some());
        assert!(a.zip(*b).is_none_or(|(a, b)| (a - b).abs() < 1e-4), "{a:?} and {b:?}");
    }
    assert!(Body { parts: Vec::new() }.to_mesh().is_none());
    assert!(Body::from(Capsule3d::default()).to_mesh().is_some());
}
