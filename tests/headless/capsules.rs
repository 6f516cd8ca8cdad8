//! Marbles that are capsules, and become balls again.

use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene;

fn height(app: &App, marble: Entity) -> f32 {
    scene::position(app, marble).y
}

#[test]
fn a_capsule_falls_over_and_may_become_a_ball_again() {
    let mut app = scene::app();
    let (response, rotation) = (Response::Impulse, Rotation::Dynamic);
    app.insert_resource(TawModel(Model { response, rotation, ..Model::default() }));
    scene::floor(&mut app);
    let place = Transform::from_xyz(0.0, 1.2, 0.0).with_rotation(Quat::from_rotation_z(0.3));
    let marble = app.world_mut().spawn((Marble::new(0.25), HalfLength(0.75), place)).id();
    scene::frames(&mut app, 20);
    assert!(height(&app, marble) > 0.5, "it still stands, about");
    scene::frames(&mut app, 400);
    assert!((height(&app, marble) - 0.25).abs() < 0.02, "it lies");
    let turned = app.world().get::<Transform>(marble).unwrap().rotation;
    assert!((turned * Vec3::Y).y.abs() < 0.05, "{turned}");
    // Longer while it lies, then none at all.
    app.world_mut().get_mut::<HalfLength>(marble).unwrap().0 = 2.0;
    scene::frames(&mut app, 10);
    let world = app.world().resource::<TawWorld>();
    let id = world.marbles.id(0).unwrap();
    assert_eq!(world.marbles.get(id).unwrap().half_length, 2.0);
    app.world_mut().entity_mut(marble).remove::<HalfLength>();
    scene::frames(&mut app, 10);
    assert!(!app.world().resource::<TawWorld>().marbles.has_capsules());
}

#[test]
fn a_capsule_points_where_its_entity_does_in_a_model_without_rotation() {
    let mut app = scene::app();
    scene::floor(&mut app);
    let lying =
        Transform::from_xyz(0.0, 2.0, 0.0).with_rotation(Quat::from_rotation_x(1.570_796_4));
    let place = Transform::from_xyz(5.0, 2.0, 0.0);
    let [flat, upright] = [lying, place]
        .map(|place| app.world_mut().spawn((Marble::new(0.25), HalfLength(0.75), place)).id());
    scene::frames(&mut app, 200);
    assert!((height(&app, flat) - 0.25).abs() < 0.02, "{}", height(&app, flat));
    assert!((height(&app, upright) - 1.0).abs() < 0.02, "{}", height(&app, upright));
}

#[test]
fn a_capsule_and_the_event_driven_response_refuse_each_other() {
    let mut app = scene::app();
    let marble = app.world_mut().spawn((Marble::new(0.25), HalfLength(0.75))).id();
    scene::frames(&mut app, 1);
    let response = Response::EventDriven;
    app.insert_resource(TawModel(Model { response, ..Model::default() }));
    scene::frames(&mut app, 1);
    let refused = app.world().resource::<Messages<InputRefused>>();
    let why: Vec<_> =
        refused.iter_current_update_messages().map(|it| it.error.to_string()).collect();
    assert!(why.iter().any(|why| why.ends_with("EventDriven knows balls only")), "{why:?}");
    let world = app.world().resource::<TawWorld>();
    assert_eq!(world.model().response, Response::Displacement, "it stays as it was");
    assert!(world.marbles.get(world.marbles.id(0).unwrap()).is_ok(), "{marble}");
}

#[test]
fn a_capsule_among_events_is_left_out_and_told_and_the_world_goes_on() {
    let mut app = scene::app();
    let response = Response::EventDriven;
    app.insert_resource(TawModel(Model { response, ..Model::default() }));
    let ball = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
    let other = scene::drop_marble(&mut app, 0.5, Vec3::X * 5.0);
    scene::frames(&mut app, 4);
    let place = Transform::from_xyz(9.0, 0.0, 0.0);
    let capsule = app.world_mut().spawn((Marble::new(0.25), HalfLength(0.75), place)).id();
    app.world_mut().entity_mut(other).insert(HalfLength(1.0));
    let mut told = Vec::new();
    let before = height(&app, ball);
    for _ in 0..10 {
        app.update();
        let refused = app.world().resource::<Messages<InputRefused>>();
        told.extend(refused.iter_current_update_messages().map(|it| (it.entity, it.error)));
    }
    assert_eq!(told.len(), 2, "{told:?}");
    assert!(told.contains(&(Some(other), Refusal::Capsule(1.0))), "{told:?}");
    assert!(told.contains(&(Some(capsule), Refusal::Capsule(0.75))), "{told:?}");
    assert!(height(&app, ball) < before - 0.1, "the others go on");
    assert!(height(&app, other) < before - 0.1, "as a ball");
    assert_eq!(height(&app, capsule), 0.0);
    assert_eq!(app.world().resource::<TawWorld>().marbles.len(), 2);
    // A model that knows capsules takes them in.
    app.world_mut().resource_mut::<TawModel>().response = Response::Impulse;
    scene::frames(&mut app, 10);
    let world = app.world().resource::<TawWorld>();
    assert_eq!(world.marbles.len(), 3);
    let halves = (0..3).map(|row| world.marbles.get(world.marbles.id(row).unwrap()).unwrap());
    assert_eq!(halves.map(|it| it.half_length).collect::<Vec<_>>(), [0.0, 1.0, 0.75]);
    assert!(height(&app, capsule) < 0.0);
}
