//! Walls of every shape, as components.

use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene;

/// Floors at zero under the origin, each of another kind.
fn floors() -> Vec<(Wall, Transform)> {
    let corners = |low: f32| {
        let square = [[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]];
        square.map(|[x, z]| Vec3::new(x, low, z))
    };
    let below = |y: f32| Transform::from_xyz(0.0, y, 0.0);
    let turned =
        |wall: Wall, place: Transform| (wall, place.with_rotation(Quat::from_rotation_y(0.7)));
    vec![
        (Wall::HalfSpace(Dir3::Y), Transform::default()),
        (Wall::HalfSpace(Dir3::X), Transform::from_rotation(Quat::from_rotation_z(1.570_796_4))),
        turned(Cuboid::new(2.0, 0.5, 2.0).into(), below(-0.5).with_scale(Vec3::new(2.0, 2.0, 2.0))),
        (Sphere::new(100.0).into(), below(-200.0).with_scale(Vec3::splat(2.0))),
        turned(Capsule3d::new(50.0, 8.0).into(), below(-54.0)),
        (Wall::Hull([corners(-1.0), corners(0.0)].concat()), Transform::default()),
        (
            Wall::Mesh { points: corners(0.0).to_vec(), triangles: vec![[0, 2, 1], [0, 3, 2]] },
            Transform::default(),
        ),
        turned(
            Wall::HeightField { cell: Vec2::new(1.0, 2.0), columns: 5, heights: vec![0.25; 15] },
            below(-0.5).with_scale(Vec3::new(1.0, 2.0, 1.0)),
        ),
    ]
}

#[test]
fn a_marble_lies_on_every_kind_of_wall() {
    for response in
        [Response::Displacement, Response::Impulse, Response::EventDriven, Response::SoftStep]
    {
        for (wall, place) in floors() {
            let mut app = scene::app();
            app.insert_resource(TawModel(Model { response, ..Model::default() }));
            let what = format!("{wall:?} {response:?}");
            app.world_mut().spawn((wall, place));
            let marble = Marble::new(0.5);
            let place = Transform::from_xyz(0.1, 1.0, 0.2);
            let marble = app.world_mut().spawn((marble, place)).id();
            scene::frames(&mut app, 300);
            let y = app.world().get::<Transform>(marble).unwrap().translation.y;
            assert!((y - 0.5).abs() < 0.02, "{what}: at {y}");
        }
    }
}

#[test]
fn a_wall_that_moves_and_grows_takes_marbles_along() {
    let mut app = scene::app();
    // The displacement would throw it up when the wall grows under it.
    let response = Response::Impulse;
    app.insert_resource(TawModel(Model { response, ..Model::default() }));
    let lift =
        app.world_mut().spawn((Wall::from(Cuboid::new(4.0, 1.0, 4.0)), Transform::default()));
    let lift = lift.id();
    let place = Transform::from_xyz(0.0, 1.0, 0.0);
    let marble = app.world_mut().spawn((Marble::new(0.5), place)).id();
    let height = |app: &App| app.world().get::<Transform>(marble).unwrap().translation.y;
    for i in 0..60 {
        app.world_mut().get_mut::<Transform>(lift).unwrap().translation.y = i as f32 / 60.0;
        scene::frames(&mut app, 1);
    }
    scene::frames(&mut app, 60);
    assert!((height(&app) - (59.0 / 60.0 + 1.0)).abs() < 0.02, "{}", height(&app));
    app.world_mut().get_mut::<Transform>(lift).unwrap().scale = Vec3::new(1.0, 2.0, 1.0);
    scene::frames(&mut app, 120);
    assert!((height(&app) - (59.0 / 60.0 + 1.5)).abs() < 0.02, "{}", height(&app));
    // It may become something else while it is there.
    *app.world_mut().get_mut::<Wall>(lift).unwrap() = Wall::HalfSpace(Dir3::Y);
    scene::frames(&mut app, 240);
    assert!((height(&app) - (59.0 / 60.0 + 0.5)).abs() < 0.02, "{}", height(&app));
}

#[test]
fn what_can_be_no_wall_is_refused_by_name() {
    let cases = [
        (Wall::Sphere(Sphere::new(-1.0)), Vec3::ONE, "radius must be finite and above zero"),
        (Wall::Sphere(Sphere::new(1.0)), Vec3::new(1.0, 2.0, 1.0), "scale.y must be 1, "),
        (Wall::Hull(vec![Vec3::ZERO; 3]), Vec3::ONE, "points.len() must be in [4"),
        (Wall::Mesh { points: vec![], triangles: vec![] }, Vec3::ONE, "triangles.len() must be in"),
    ];
    for (wall, scale, why) in cases {
        let mut app = scene::app();
        let what = format!("{wall:?}");
        let id = app.world_mut().spawn((wall, Transform::from_scale(scale))).id();
        scene::frames(&mut app, 1);
        let refused = app.world().resource::<Messages<InputRefused>>();
        let refused: Vec<_> = refused.iter_current_update_messages().collect();
        assert_eq!(refused.len(), 1, "{what}");
        assert_eq!(refused[0].entity, Some(id));
        assert!(refused[0].error.to_string().starts_with(why), "{what}: {}", refused[0].error);
        assert!(app.world().resource::<TawWorld>().walls.is_empty());
    }
}

/// A wave of triangles, `side` squares wide.
fn wave(side: u32) -> Wall {
    let corner = |x: u32, z: u32| x + z * (side + 1);
    let points = (0..=side).flat_map(|z| (0..=side).map(move |x| (x as f32, z as f32)));
    let points = points.map(|(x, z)| Vec3::new(x, (x * 0.3).sin() + (z * 0.4).cos(), z) * 0.1);
    let triangles = (0..side).flat_map(|z| (0..side).map(move |x| (x, z))).flat_map(|(x, z)| {
        let [a, b, c, d] = [corner(x, z), corner(x + 1, z), corner(x, z + 1), corner(x + 1, z + 1)];
        [[a, c, b], [b, c, d]]
    });
    Wall::Mesh { points: points.collect(), triangles: triangles.collect() }
}

/// The mesh of the only wall.
fn mesh(app: &App) -> std::sync::Arc<bevy_taw::taw::shape::Mesh<f32>> {
    match &app.world().resource::<TawWorld>().walls.shapes()[0] {
        bevy_taw::taw::world::WallShape::Mesh(mesh, _) => mesh.clone(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_wall_that_turns_is_not_built_anew() {
    // Below a parent that turns and is scaled, too; with rotations that are kept at length one,
    // and with such as drift away from it as games leave them.
    for (normalized, most) in [(true, 0), (false, 8)] {
        let mut app = scene::app();
        let parent = app.world_mut().spawn(Transform::from_scale(Vec3::splat(1.7))).id();
        let place = Transform::from_xyz(1.0, 2.0, 3.0).with_scale(Vec3::splat(0.7));
        let wall = app.world_mut().spawn((wave(4), place, ChildOf(parent))).id();
        scene::frames(&mut app, 2);
        let (mut last, mut built) = (mesh(&app), 0);
        for _ in 0..500 {
            for (entity, turn) in [(parent, 0.037), (wall, 0.011)] {
                let mut transform = app.world_mut().get_mut::<Transform>(entity).unwrap();
                transform.rotate_axis(Dir3::from_xyz(0.3, 0.5, -0.8).unwrap(), turn);
                if normalized {
                    transform.rotation = transform.rotation.normalize();
                }
            }
            app.update();
            built += usize::from(!std::sync::Arc::ptr_eq(&last, &mesh(&app)));
            last = mesh(&app);
        }
        assert!(built <= most, "built {built} times in 500 steps");
        app.world_mut().get_mut::<Transform>(wall).unwrap().scale *= 1.001;
        app.update();
        assert!(!std::sync::Arc::ptr_eq(&last, &mesh(&app)), "another scale is another shape");
    }
}

/// Prints what a step costs with a mesh of 180,000 triangles that turns:
/// `cargo test --test headless -- --ignored --nocapture turning_mesh`.
#[test]
#[ignore = "prints times"]
fn a_turning_mesh_costs_no_more_than_one_that_moves() {
    use bevy::diagnostic::{Diagnostic, DiagnosticsStore};
    use bevy_taw::diagnostics::GATHER_TIME;

    let mut app = scene::app();
    let wall = app.world_mut().spawn((wave(300), Transform::default())).id();
    app.world_mut().spawn((Marble::new(0.5), Transform::from_xyz(15.0, 3.0, 15.0)));
    scene::frames(&mut app, 3);
    for (what, moves, turns) in [("rests", 0.0, 0.0), ("moves", 1e-3, 0.0), ("turns", 0.0, 1e-3)] {
        let mut times: Vec<_> = (0..60)
            .map(|_| {
                let mut transform = app.world_mut().get_mut::<Transform>(wall).unwrap();
                transform.translation.y += moves;
                transform.rotate_axis(Dir3::from_xyz(0.3, 0.5, -0.8).unwrap(), turns);
                app.update();
                let store = app.world().resource::<DiagnosticsStore>();
                store.get(&GATHER_TIME).and_then(Diagnostic::value).unwrap_or(f64::NAN)
            })
            .collect();
        times.sort_by(f64::total_cmp);
        println!("a mesh of 180,000 triangles that {what}: gather {:.4} ms", times[30]);
    }
}

/// A belt drags what lies on it, in its own frame, and its ends push nobody.
#[test]
fn a_conveyor_belt_drags_and_pushes_nobody() {
    for response in [Response::Impulse, Response::EventDriven, Response::SoftStep] {
        let mut app = scene::app();
        let model = Model { response, rotation: Rotation::Dynamic, substeps: 4, ..Model::GAME };
        app.insert_resource(TawModel(model));
        scene::floor(&mut app);
        let turned = Transform::from_xyz(0.0, 0.5, 0.0).with_rotation(Quat::from_rotation_y(1.0));
        let along = turned.rotation * Vec3::X;
        let belt = Wall::from(Cuboid::new(4.0, 1.0, 2.0));
        let belt = app.world_mut().spawn((belt, turned, SurfaceVelocity(Vec3::X * 2.0))).id();
        let rough = SurfaceMaterial { restitution: 0.0, friction: 0.8, ..default() };
        let on_top = scene::drop_marble(&mut app, 0.1, Vec3::Y * 1.1 - along * 1.8);
        let at_end = scene::drop_marble(&mut app, 0.1, Vec3::Y * 0.1 + along * 2.1);
        for marble in [on_top, at_end] {
            app.world_mut().entity_mut(marble).insert((rough, Velocity::default()));
        }
        scene::frames(&mut app, 64);
        let velocity = |app: &App, marble| **app.world().get::<Velocity>(marble).unwrap();
        let off = velocity(&app, on_top).distance(along * 2.0 * 2.0 / 7.0);
        assert!(off < 0.02, "{response:?}: {}", velocity(&app, on_top));
        assert!(velocity(&app, at_end).length() < 0.02, "{response:?}");
        app.world_mut().entity_mut(belt).remove::<SurfaceVelocity>();
        app.update();
        let world = app.world().resource::<TawWorld>();
        let motions = (0..world.walls.len()).filter_map(|row| world.walls.id(row));
        assert!(motions.into_iter().all(|id| world.walls.motion(id) == Ok(None)), "{response:?}");
    }
}
