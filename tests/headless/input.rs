//! Bad input is refused, told once, and changes nothing else.

use bevy::ecs::message::Messages;
use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene;

/// Refusals of the last frames, as "whose: why".
fn refused(app: &mut App, frames: u32) -> Vec<(Option<Entity>, String)> {
    let mut told = Vec::new();
    for _ in 0..frames {
        app.update();
        let messages = app.world().resource::<Messages<InputRefused>>();
        told.extend(
            messages.iter_current_update_messages().map(|m| (m.entity, m.error.to_string())),
        );
    }
    told
}

#[test]
fn a_bad_marble_is_refused_once_and_accepted_when_mended() {
    let mut app = scene::app();
    let marble = scene::drop_marble(&mut app, -0.5, Vec3::ZERO);
    let why = "radius must be finite and above zero, but is -0.5".to_string();
    assert_eq!(refused(&mut app, 5), [(Some(marble), why)]);
    assert_eq!(scene::position(&app, marble), Vec3::ZERO);
    app.world_mut().get_mut::<Marble>(marble).unwrap().radius = 0.5;
    assert_eq!(refused(&mut app, 5), []);
    assert!(scene::position(&app, marble).y < 0.0);
}

#[test]
fn a_bad_change_is_refused_once_and_put_right() {
    let mut app = scene::app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::ONE);
    app.world_mut().entity_mut(marble).insert(Velocity(Vec3::ZERO));
    assert_eq!(refused(&mut app, 2), []);
    app.world_mut().get_mut::<Transform>(marble).unwrap().translation.z = f32::NAN;
    app.world_mut().get_mut::<Velocity>(marble).unwrap().x = f32::INFINITY;
    app.world_mut().get_mut::<Marble>(marble).unwrap().radius = 0.0;
    let why = |text: &str| (Some(marble), text.to_string());
    assert_eq!(
        refused(&mut app, 5),
        [
            why("position.z must be finite, but is NaN"),
            why("radius must be finite and above zero, but is 0"),
            why("velocity.x must be finite, but is inf"),
        ]
    );
    assert_eq!(scene::position(&app, marble), Vec3::ONE);
    assert_eq!(**app.world().get::<Velocity>(marble).unwrap(), Vec3::ZERO);
}

#[test]
fn a_bad_wall_is_refused_once() {
    let mut app = scene::app();
    let flat = Transform::from_scale(Vec3::new(1.0, 0.0, 1.0));
    let wall = app.world_mut().spawn((Wall::default(), flat)).id();
    let told = refused(&mut app, 3);
    assert_eq!(told.len(), 1, "{told:?}");
    assert_eq!(told[0].0, Some(wall));
    assert!(app.world().resource::<TawWorld>().walls.is_empty());
}

#[test]
fn a_bad_setting_is_refused_once_and_the_last_good_one_stays() {
    let mut app = scene::app();
    scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 5.0);
    app.world_mut().resource_mut::<TawModel>().substeps = 0;
    app.world_mut().resource_mut::<Gravity>().x = f32::NAN;
    assert_eq!(
        refused(&mut app, 3),
        [
            (None, "substeps must be in [1, 1000], but is 0".to_string()),
            (None, "gravity.x must be finite, but is NaN".to_string()),
        ]
    );
    assert!(scene::position(&app, marble).y < 5.0, "it falls as before");
}

#[test]
fn an_overflowing_marble_is_stopped_told_and_alone() {
    let mut app = scene::app();
    app.insert_resource(Gravity(Vec3::ZERO));
    app.world_mut().spawn((Marble::default(), Velocity(Vec3::X)));
    let far = Transform::from_xyz(3e38, 0.0, 0.0);
    let sick = app.world_mut().spawn((Marble::default(), far, Velocity(Vec3::X * 3e38))).id();
    let mut stopped = Vec::new();
    for _ in 0..64 {
        app.update();
        let messages = app.world().resource::<Messages<MarbleStopped>>();
        stopped.extend(messages.iter_current_update_messages().copied());
    }
    assert_eq!(stopped, [MarbleStopped { entity: sick, reason: StopReason::NotFinite }]);
    assert_eq!(**app.world().get::<Velocity>(sick).unwrap(), Vec3::ZERO);
    let world = app.world().resource::<TawWorld>();
    assert_eq!(world.marbles.position()[0].x, 1.0, "the other one went on for a second");
}

/// In a periodic box, each cell that a marble crosses is an event: there are too many at 1e8 m/s.
#[test]
fn a_marble_with_too_many_events_is_told_to_have_them() {
    let mut app = scene::app();
    app.insert_resource(TawModel(Model::EXACT)).insert_resource(Gravity(Vec3::ZERO));
    let box_of = [Some(8.0), None, Some(8.0)];
    app.world_mut().resource_mut::<TawWorld>().set_period(box_of).unwrap();
    let at = Transform::from_xyz(0.0, 1.0, 0.0);
    let sped = Velocity(Vec3::new(1e8, 0.0, 3e7));
    let marble = app.world_mut().spawn((Marble::new(0.2), at, sped)).id();
    app.update();
    let messages = app.world().resource::<Messages<MarbleStopped>>();
    let stopped: Vec<_> = messages.iter_current_update_messages().copied().collect();
    assert_eq!(stopped, [MarbleStopped { entity: marble, reason: StopReason::EventBudget }]);
}

#[test]
fn settings_and_components_are_open_to_reflection() {
    let mut app = scene::app();
    let registry = app.world().resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    for name in [
        "bevy_taw::components::Marble",
        "bevy_taw::wall::Wall",
        "bevy_taw::components::Velocity",
        "bevy_taw::components::AngularVelocity",
        "bevy_taw::components::MarbleMass",
        "bevy_taw::components::GravityScale",
        "bevy_taw::components::SurfaceMaterial",
        "bevy_taw::components::MarbleIntegrator",
        "bevy_taw::resources::TawModel",
        "bevy_taw::swarm::TawSwarmModel",
        "bevy_taw::resources::Forces",
        "bevy_taw::ignored::IgnoredComponents",
        "bevy_taw::resources::Gravity",
    ] {
        assert!(registry.get_with_type_path(name).is_some(), "{name} is not registered");
    }
    let mut swarms = app.world_mut().resource_mut::<TawSwarmModel>();
    *swarms.path_mut::<f32>(".0.material.elasticity.poissons_ratio").unwrap() = 0.5;
    assert_eq!(swarms.material.elasticity.poissons_ratio, 0.5);
    let fields = Forces(vec![ForceField::attraction(Vec3::ZERO, 1.0)]);
    assert_eq!(fields.reflect_partial_eq(&*fields.to_dynamic()), Some(true));
    // An inspector changes the model by path; the next step uses it.
    let mut model = app.world_mut().resource_mut::<TawModel>();
    *model.path_mut::<u32>(".0.substeps").unwrap() = 7;
    drop(registry);
    app.update();
    assert_eq!(app.world().resource::<TawWorld>().model().substeps, 7);
}

#[test]
fn what_stays_wrong_is_told_once_and_again_when_it_is_wrong_anew() {
    let mut app = scene::app();
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
    let push = |x: f32| ExternalForce { force: Vec3::X * x, torque: Vec3::ZERO };
    let why = |what: &str| (Some(marble), format!("force.x must be finite, but is {what}"));
    app.world_mut().entity_mut(marble).insert(push(f32::NAN));
    let told = refused(&mut app, 5);
    assert_eq!(told.iter().filter(|it| **it == why("NaN")).count(), 1, "{told:?}");
    *app.world_mut().get_mut::<ExternalForce>(marble).unwrap() = push(1.0);
    assert_eq!(refused(&mut app, 5), []);
    *app.world_mut().get_mut::<ExternalForce>(marble).unwrap() = push(f32::INFINITY);
    assert!(refused(&mut app, 5).contains(&why("inf")));
}

#[test]
fn a_bad_setting_that_is_marked_in_every_frame_is_told_once() {
    let mut app = scene::app();
    app.world_mut().resource_mut::<TawModel>().substeps = 0;
    app.world_mut().resource_mut::<Gravity>().x = f32::NAN;
    let mut told = refused(&mut app, 1);
    for _ in 0..4 {
        app.world_mut().resource_mut::<TawModel>().set_changed();
        app.world_mut().resource_mut::<Gravity>().set_changed();
        told.extend(refused(&mut app, 1));
    }
    assert_eq!(told.len(), 2, "{told:?}");
}

#[test]
fn a_model_that_is_marked_as_changed_changes_nothing() {
    let heap = |marked: bool| {
        let mut app = scene::app();
        let (response, rotation) = (Response::Impulse, Rotation::Dynamic);
        app.insert_resource(TawModel(Model { response, rotation, ..Model::default() }));
        scene::board(&mut app);
        let marbles = scene::drop_marbles(&mut app, 60);
        for _ in 0..300 {
            if marked {
                app.world_mut().resource_mut::<TawModel>().set_changed();
                app.world_mut().resource_mut::<Gravity>().set_changed();
            }
            app.update();
        }
        marbles.iter().map(|it| scene::position(&app, *it)).collect::<Vec<_>>()
    };
    assert_eq!(heap(true), heap(false));
}
