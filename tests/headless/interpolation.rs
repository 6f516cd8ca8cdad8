//! What is drawn between fixed steps.

use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene::{self, STEP};

/// A marble that moves 1 m per step along x, drawn four times per step.
fn app() -> (App, Entity) {
    let mut app = scene::smooth_app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
    app.world_mut().entity_mut(marble).insert(Velocity(Vec3::X / STEP));
    scene::frames(&mut app, 2);
    scene::frame_length(&mut app, STEP / 4.0);
    (app, marble)
}

#[test]
fn motion_is_even_between_steps() {
    let (mut app, marble) = app();
    let mut last = scene::position(&app, marble).x;
    for frame in 0..20 {
        app.update();
        let now = scene::position(&app, marble).x;
        assert!((now - last - 0.25).abs() < 1e-5, "frame {frame} moved it by {}", now - last);
        last = now;
    }
}

#[test]
fn a_teleport_between_steps_is_neither_undone_nor_smeared() {
    // At each of the four frames within a step, and exactly onto the ends of the
    // step that is being drawn. (Where it is drawn already, nobody can teleport it.)
    let cases = (0..4).flat_map(|wait| [(wait, 100.0), (wait, 1.0), (wait, 2.0)]);
    for (wait, to) in cases.filter(|case| *case != (0, 1.0)) {
        let (mut app, marble) = app();
        scene::frames(&mut app, wait);
        app.world_mut().get_mut::<Transform>(marble).unwrap().translation = Vec3::X * to;
        scene::frames(&mut app, 4);
        let x = app.world().resource::<TawWorld>().marbles.position()[0].x;
        assert_eq!(x, to + 1.0, "teleported to {to} after {wait} frames, one step ago");
        let drawn = scene::position(&app, marble).x;
        assert!((to..=to + 1.0).contains(&drawn), "teleported to {to}, drawn at {drawn}");
    }
}

#[test]
fn a_marble_that_is_scaled_for_show_keeps_its_way() {
    let heights = [false, true].map(|scaled| {
        let mut app = scene::smooth_app();
        // Frames shorter than steps, so that what is drawn lies between two steps.
        scene::frame_length(&mut app, STEP * 0.7);
        let marble = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
        for frame in 0..50_u16 {
            if scaled {
                let scale = Vec3::splat(1.0 + f32::from(frame) / 100.0);
                app.world_mut().get_mut::<Transform>(marble).unwrap().scale = scale;
            }
            app.update();
        }
        app.world().resource::<TawWorld>().marbles.position()[0].y
    });
    assert_eq!(heights[0], heights[1]);
}

#[test]
fn turning_is_even_between_steps_once_it_is_modelled() {
    let (mut app, marble) = app();
    let turned = |app: &App| app.world().get::<Transform>(marble).unwrap().rotation;
    app.world_mut().entity_mut(marble).insert(Spin(Vec3::Y * 0.25 / STEP));
    scene::frames(&mut app, 8);
    assert_eq!(turned(&app), Quat::IDENTITY, "the model has no rotation yet");
    app.world_mut().resource_mut::<TawModel>().rotation = Rotation::Rolling;
    scene::frames(&mut app, 4);
    app.world_mut().get_mut::<Spin>(marble).unwrap().y = 0.25 / STEP;
    scene::frames(&mut app, 12);
    let mut last = turned(&app);
    for frame in 0..20 {
        app.update();
        let angle = last.angle_between(turned(&app));
        assert!((angle - 0.25 / 4.0).abs() < 1e-3, "frame {frame} turned it by {angle}");
        last = turned(&app);
    }
    app.world_mut().resource_mut::<TawModel>().rotation = Rotation::None;
    scene::frames(&mut app, 12);
    let last = turned(&app);
    scene::frames(&mut app, 12);
    assert_eq!(turned(&app), last);
}

#[test]
fn a_refused_place_is_not_drawn_and_not_tried_again() {
    let (mut app, marble) = app();
    app.world_mut().get_mut::<Transform>(marble).unwrap().translation.y = f32::NAN;
    let mut refused = 0;
    for _ in 0..20 {
        app.update();
        let messages = app.world().resource::<bevy::ecs::message::Messages<InputRefused>>();
        refused += messages.iter_current_update_messages().count();
    }
    assert_eq!(refused, 1);
    assert!(scene::position(&app, marble).is_finite());
}
