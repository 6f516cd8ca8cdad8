//! `Transform` is read and written as users expect.

use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene;

#[test]
fn a_written_transform_teleports_and_keeps_the_velocity() {
    let mut app = scene::app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
    app.world_mut().entity_mut(marble).insert(Velocity(Vec3::X * 64.0));
    scene::frames(&mut app, 3);
    assert_eq!(scene::position(&app, marble), Vec3::X * 3.0);
    app.world_mut().get_mut::<Transform>(marble).unwrap().translation = Vec3::new(0.0, 50.0, 0.0);
    scene::frames(&mut app, 2);
    assert_eq!(scene::position(&app, marble), Vec3::new(2.0, 50.0, 0.0));
}

#[test]
fn children_follow_their_marble() {
    let mut app = scene::app();
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
    let child = app.world_mut().spawn((Transform::from_xyz(0.0, 2.0, 0.0), ChildOf(marble))).id();
    scene::frames(&mut app, 60);
    let fallen = scene::position(&app, marble);
    assert!(fallen.y < -3.0);
    let child = app.world().get::<GlobalTransform>(child).unwrap().translation();
    assert_eq!(child, fallen + Vec3::Y * 2.0);
}

#[test]
fn a_marble_that_is_a_child_moves_in_world_space() {
    let mut app = scene::app();
    scene::floor(&mut app);
    let parent_at = Transform::from_xyz(10.0, 4.0, 0.0)
        .with_rotation(Quat::from_rotation_z(1.0))
        .with_scale(Vec3::splat(2.0));
    let parent = app.world_mut().spawn(parent_at).id();
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::X);
    app.world_mut().entity_mut(marble).insert(ChildOf(parent));
    let start = parent_at.transform_point(Vec3::X);
    scene::frames(&mut app, 300);
    let global = |app: &App| app.world().get::<GlobalTransform>(marble).unwrap().translation();
    let below = Vec3::new(start.x, 0.5, start.z);
    assert!(global(&app).distance(below) < 1e-4, "it fell straight down to {}", global(&app));

    // Moving the parent leaves the marble where it is: it is nobody's cargo.
    app.world_mut().get_mut::<Transform>(parent).unwrap().translation.x += 5.0;
    scene::frames(&mut app, 10);
    assert!(global(&app).distance(below) < 1e-4, "it stayed at {}", global(&app));

    // Writing its own transform teleports it, in its parent's frame.
    app.world_mut().get_mut::<Transform>(marble).unwrap().translation = Vec3::ZERO;
    scene::frames(&mut app, 300);
    assert!(global(&app).distance(Vec3::new(15.0, 0.5, 0.0)) < 1e-4, "{}", global(&app));
}

#[test]
fn a_resting_marble_is_not_marked_as_changed() {
    #[derive(Resource, Default)]
    struct Changes(u32);
    let mut app = scene::app();
    app.insert_resource(Gravity(Vec3::ZERO)).init_resource::<Changes>();
    app.world_mut().spawn((Marble::default(), Velocity::default()));
    scene::frames(&mut app, 3);
    app.add_systems(
        Last,
        |moved: Query<(), Or<(Changed<Transform>, Changed<Velocity>)>>, mut c: ResMut<Changes>| {
            c.0 += moved.iter().count() as u32;
        },
    );
    app.update(); // A new system sees everything as changed once.
    app.world_mut().resource_mut::<Changes>().0 = 0;
    scene::frames(&mut app, 10);
    assert_eq!(app.world().resource::<Changes>().0, 0);
}

#[test]
fn a_child_of_what_moves_between_steps_stays_where_it_is() {
    let mut app = scene::app();
    app.insert_resource(Gravity(Vec3::ZERO));
    scene::frame_length(&mut app, scene::STEP / 4.0);
    let parent = app.world_mut().spawn(Transform::default()).id();
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 2.0);
    app.world_mut().entity_mut(marble).insert(ChildOf(parent));
    scene::frames(&mut app, 8);
    for _ in 0..12 {
        app.world_mut().get_mut::<Transform>(parent).unwrap().translation.x += 1.0;
        app.update();
        let at = app.world().get::<GlobalTransform>(marble).unwrap().translation();
        assert!(at.distance(Vec3::Y * 2.0) < 1e-5, "drawn at {at}");
    }
}

#[test]
fn a_parent_of_scale_zero_leaves_transforms_finite_and_is_told_once() {
    for app in [scene::app, scene::smooth_app] {
        for flat in [Vec3::ZERO, Vec3::new(1.0, 0.0, 1.0)] {
            let mut app = app();
            let parent = app.world_mut().spawn(Transform::default()).id();
            let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y);
            app.world_mut().entity_mut(marble).insert(ChildOf(parent));
            scene::frames(&mut app, 4);
            app.world_mut().get_mut::<Transform>(parent).unwrap().scale = flat;
            let late = (Marble::new(0.2), Transform::default(), ChildOf(parent));
            let late = app.world_mut().spawn(late).id();
            let mut told = Vec::new();
            for _ in 0..8 {
                app.update();
                let messages = app.world().resource::<Messages<InputRefused>>();
                told.extend(messages.iter_current_update_messages().map(|it| it.entity));
                for entity in [marble, late] {
                    let place = app.world().get::<Transform>(entity).unwrap();
                    assert!(place.translation.is_finite() && place.rotation.is_finite());
                }
            }
            assert_eq!(told.len(), 2, "{told:?}");
            assert!(told.contains(&Some(marble)) && told.contains(&Some(late)), "{told:?}");
            let before = app.world().resource::<TawWorld>().marbles.position()[0].y;
            assert!(before < 0.99, "it falls on");
            app.world_mut().get_mut::<Transform>(parent).unwrap().scale = Vec3::ONE;
            scene::frames(&mut app, 4);
            assert_eq!(app.world().resource::<TawWorld>().marbles.len(), 2);
            assert!(scene::position(&app, marble).y < before);
        }
    }
}

#[test]
fn a_parent_of_a_scale_beyond_numbers_is_told_once_and_its_marble_tried_again() {
    for app in [scene::app, scene::smooth_app] {
        for scale in [1e20, 1e30, f32::MAX, 1e-25] {
            let mut app = app();
            let parent = app.world_mut().spawn(Transform::from_scale(Vec3::splat(scale))).id();
            let marble = (Marble::new(0.5), Transform::default(), ChildOf(parent));
            let marble = app.world_mut().spawn(marble).id();
            let mut told = Vec::new();
            for _ in 0..8 {
                app.update();
                let messages = app.world().resource::<Messages<InputRefused>>();
                told.extend(messages.iter_current_update_messages().copied());
            }
            assert_eq!(told.len(), 1, "{scale}: {told:?}");
            assert!(matches!(told[0].error, Refusal::NoFrame(..)), "{scale}: {told:?}");
            app.world_mut().get_mut::<Transform>(parent).unwrap().scale = Vec3::ONE;
            scene::frames(&mut app, 4);
            assert!(scene::position(&app, marble).y < 0.0, "{scale}: it falls");
        }
    }
}
