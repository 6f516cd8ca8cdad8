//! Walls that are put elsewhere carry nothing along, and those that move do, however often
//! frames come.

use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene::{self, STEP};

/// A ball at rest on a platform, by impulses; and the platform's parent, which moves it.
fn ball_on_a_platform(response: Response) -> (App, Entity, Entity) {
    let mut app = scene::app();
    let rotation = Rotation::Dynamic;
    app.insert_resource(TawModel(Model { response, rotation, ..Model::default() }));
    let lift = app.world_mut().spawn(Transform::default()).id();
    let platform = (Wall::from(Cuboid::new(4.0, 1.0, 4.0)), Transform::from_xyz(0.0, -0.5, 0.0));
    app.world_mut().spawn((platform, ChildOf(lift)));
    let ball = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    app.world_mut().entity_mut(ball).insert(Velocity::default());
    scene::frames(&mut app, 20);
    (app, lift, ball)
}

/// The fastest that a ball is within some frames.
fn fastest(app: &mut App, ball: Entity, frames: u32) -> f32 {
    let speeds = (0..frames).map(|_| {
        app.update();
        app.world().get::<Velocity>(ball).unwrap().length()
    });
    speeds.fold(0.0, f32::max)
}

#[test]
fn a_platform_that_is_put_elsewhere_throws_nothing() {
    for response in [Response::Impulse, Response::EventDriven, Response::SoftStep] {
        for jump in [Vec3::Y * 5.0, Vec3::Y * 0.4, Vec3::new(3.0, 0.3, 0.0), Vec3::NEG_Y * 0.5] {
            let (mut app, lift, ball) = ball_on_a_platform(response);
            app.world_mut().get_mut::<Transform>(lift).unwrap().translation += jump;
            let speed = fastest(&mut app, ball, 10);
            // It may fall for the ten steps, or be pushed out of the platform.
            assert!(speed < 3.5, "{response:?}, {jump}: {speed} m/s");
        }
        // And one that is turned over.
        let (mut app, lift, ball) = ball_on_a_platform(response);
        app.world_mut().get_mut::<Transform>(lift).unwrap().rotation = Quat::from_rotation_z(1.0);
        let speed = fastest(&mut app, ball, 10);
        assert!(speed < 3.5, "{response:?}, turned: {speed} m/s");
    }
}

#[test]
fn a_short_jump_needs_a_mark_to_be_one() {
    for (marked, most) in [(false, 10.0), (true, 2.0)] {
        let (mut app, lift, ball) = ball_on_a_platform(Response::Impulse);
        let jump = Transform::from_xyz(0.0, 0.1, 0.0);
        app.world_mut().entity_mut(lift).insert(jump);
        if marked {
            app.world_mut().entity_mut(lift).insert(Teleport);
        }
        let speed = fastest(&mut app, ball, 4);
        assert!(speed < most && (marked || speed > 3.0), "{marked}: {speed} m/s");
        assert!(!app.world().entity(lift).contains::<Teleport>());
    }
}

#[test]
fn what_goes_on_moving_fast_is_believed_from_its_second_step_on() {
    let (mut app, lift, ball) = ball_on_a_platform(Response::Impulse);
    let mut speeds = Vec::new();
    for _ in 0..4 {
        app.world_mut().get_mut::<Transform>(lift).unwrap().translation.y += 20.0 * STEP;
        app.update();
        speeds.push(app.world().get::<Velocity>(ball).unwrap().y);
    }
    assert!(speeds[0] < 10.0 && speeds[2] > 19.0, "{speeds:?}");
}

#[test]
fn a_lift_is_as_fast_as_it_is_at_any_frame_rate() {
    for rate in [10.0_f32, 24.0, 30.0, 60.0, 64.0, 144.0, 240.0, 1_000.0] {
        let mut app = scene::app();
        let (response, rotation) = (Response::Impulse, Rotation::Dynamic);
        app.insert_resource(TawModel(Model { response, rotation, ..Model::default() }));
        let lift = scene::floor(&mut app);
        let ball = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
        let soft = SurfaceMaterial { restitution: 0.0, ..default() };
        app.world_mut().entity_mut(ball).insert((Velocity::default(), soft));
        scene::frames(&mut app, 20);
        scene::frame_length(&mut app, 1.0 / rate);
        scene::frames(&mut app, (0.1 * rate) as u32);
        // At 3 m/s, moved by a system of every frame.
        let rise = move |time: Res<Time>, mut transforms: Query<&mut Transform>| {
            transforms.get_mut(lift).unwrap().translation.y += 3.0 * time.delta_secs();
        };
        app.add_systems(Update, rise);
        let mut fastest = 0.0_f32;
        for _ in 0..(2.0 * rate) as u32 {
            app.update();
            fastest = fastest.max(app.world().get::<Velocity>(ball).unwrap().y);
        }
        assert!(fastest < 3.0 * 1.1, "{rate} frames a second: {fastest} m/s");
        let height = scene::position(&app, ball).y - scene::position(&app, lift).y;
        assert!((0.1..1.2).contains(&height), "{rate} frames a second: {height} m above");
    }
}

#[test]
fn a_lift_carries_its_load_in_any_number_of_substeps() {
    for substeps in [1, 2, 4] {
        for response in [Response::Impulse, Response::EventDriven, Response::Displacement] {
            let mut app = scene::app();
            app.insert_resource(TawModel(Model { response, substeps, ..Model::default() }));
            let lift = scene::floor(&mut app);
            let ball = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
            let soft = SurfaceMaterial { restitution: 0.0, ..default() };
            app.world_mut().entity_mut(ball).insert((Velocity::default(), soft));
            scene::frames(&mut app, 20);
            for _ in 0..30 {
                app.world_mut().get_mut::<Transform>(lift).unwrap().translation.y += 1.0 * STEP;
                app.update();
            }
            let speed = app.world().get::<Velocity>(ball).unwrap().y;
            assert!((speed - 1.0).abs() < 0.01, "{response:?}, {substeps}: {speed} m/s");
            let height = scene::position(&app, ball).y - scene::position(&app, lift).y;
            assert!((height - 0.5).abs() < 2e-3, "{response:?}, {substeps}: {height} m above");
        }
    }
}
