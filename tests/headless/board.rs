//! The game in short: marbles on a board that tilts.

use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene::{self, HALF, STEP};

#[test]
fn a_marble_falls_and_rests_on_the_floor() {
    let mut app = scene::app();
    scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::new(1.0, 3.0, 2.0));
    scene::frames(&mut app, 10);
    // Semi-implicit Euler after n steps of h: g h² n (n + 1) / 2.
    let fallen = 9.81 * STEP * STEP * 55.0;
    assert!((scene::position(&app, marble).y - (3.0 - fallen)).abs() < 1e-5);
    scene::frames(&mut app, 300);
    let rest = scene::position(&app, marble);
    // The floor of f32 for a height of 0.5 that gravity disturbs in every step.
    assert!((rest - Vec3::new(1.0, 0.5, 2.0)).length() < 1e-6, "it rests at {rest}");
}

/// Tilts the board about both axes, by up to 15 degrees, as a player might.
fn tilt(app: &mut App, board: Entity, seconds: f32) {
    let (x, z) = ((0.7 * seconds).sin() * 0.26, (1.1 * seconds).sin() * 0.26);
    app.world_mut().get_mut::<Transform>(board).unwrap().rotation =
        Quat::from_rotation_x(x) * Quat::from_rotation_z(z);
}

#[test]
fn marbles_stay_on_the_board_while_it_tilts_for_60_seconds() {
    let displacement = Model { substeps: 4, ..default() };
    // Walls come before marbles in a pass, so a crowd may push one into a wall; with
    // its center behind the wall it would be lost.
    let deepest = deepest_while_tilting(displacement);
    assert!(deepest < 0.2, "a marble was {deepest} m deep in a wall");
    let impulse =
        Model { response: Response::Impulse, rotation: Rotation::Dynamic, ..displacement };
    // For a few steps, a small one may be pinched between a rail and one that weighs up
    // to 27 times as much; its center stays well in front of the wall.
    let deepest = deepest_while_tilting(impulse);
    assert!(deepest < 0.1, "a marble was {deepest} m deep in a wall");
    let events = Model { response: Response::EventDriven, substeps: 1, ..impulse };
    let deepest = deepest_while_tilting(events);
    assert!(deepest < 0.05, "a marble was {deepest} m deep in a wall");
}

/// Largest penetration of 60 marbles into walls of a tilting board, in metres.
fn deepest_while_tilting(model: Model) -> f32 {
    let mut app = scene::app();
    let board = scene::board(&mut app);
    let marbles = scene::drop_marbles(&mut app, 60);
    app.insert_resource(TawModel(model));
    let (mut deepest, mut travelled) = (0.0_f32, 0.0_f32);
    let mut last = scene::position(&app, marbles[0]);
    for step in 0..3840_u16 {
        tilt(&mut app, board, f32::from(step) * STEP);
        app.update();
        let to_board = app.world().get::<Transform>(board).unwrap().to_matrix().inverse();
        for marble in &marbles {
            let at = to_board.transform_point3(scene::position(&app, *marble));
            let radius = app.world().get::<Marble>(*marble).unwrap().radius;
            assert!(at.is_finite(), "{marble} is at {at} after {step} steps");
            let inside = (at.y - radius).min(HALF - radius - at.x.abs().max(at.z.abs()));
            deepest = deepest.max(-inside);
        }
        let now = scene::position(&app, marbles[0]);
        travelled += now.distance(last);
        last = now;
    }
    assert!(travelled > 20.0, "the marbles rolled about, the first one {travelled} m");
    deepest
}

#[test]
fn two_runs_give_the_same_bits() {
    let run = |response| {
        let mut app = scene::app();
        app.insert_resource(TawModel(Model { response, ..default() }));
        let board = scene::board(&mut app);
        let marbles = scene::drop_marbles(&mut app, 150);
        for step in 0..600_u16 {
            tilt(&mut app, board, f32::from(step) * STEP);
            app.update();
        }
        marbles.iter().map(|m| scene::position(&app, *m).to_array().map(f32::to_bits)).collect()
    };
    for response in [Response::Displacement, Response::Impulse, Response::EventDriven] {
        let (first, second): (Vec<_>, Vec<_>) = (run(response), run(response));
        assert_eq!(first, second);
    }
}
