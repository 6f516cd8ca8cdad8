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
    for response in [Response::Displacement, Response::Impulse, Response::EventDriven] {
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
        (Wall::Sphere(Sphere::new(1.0)), Vec3::new(1.0, 2.0, 1.0), "scale.y must be in [1, 1]"),
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
