//! Previews: the copy goes where the app will go, and the app does not notice.

use bevy::prelude::*;
use bevy_taw::prelude::*;
use bevy_taw::preview::PreviewError;

use crate::scene;

const RESPONSES: [Response; 5] = [
    Response::Displacement,
    Response::Impulse,
    Response::SoftStep,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::EventDriven,
];

/// A board with marbles that fall and collide, a swarm, and a conveyor belt beneath.
fn app(response: Response) -> (App, Vec<Entity>) {
    let mut app = scene::app();
    let model = Model { response, ..Model::GAME };
    app.insert_resource(TawModel(model));
    scene::board(&mut app);
    let belt = (
        Wall::from(Cuboid::new(4.0, 0.2, 4.0)),
        SurfaceVelocity(Vec3::X),
        Transform::from_xyz(0.0, 0.1, 0.0),
    );
    app.world_mut().spawn(belt);
    let marbles = scene::drop_marbles(&mut app, 12);
    let balls = (0..4_u8).map(|i| Ball::new(Vec3::new(f32::from(i) - 2.0, 4.0, 0.3), 0.2));
    app.world_mut().spawn(Swarm::new(balls.collect()));
    scene::frames(&mut app, 20);
    (app, marbles)
}

/// Places of marbles in the next frames, and now.
fn paths(app: &mut App, marbles: &[Entity], count: usize) -> Vec<Vec<Vec3>> {
    let mut paths = vec![Vec::new(); marbles.len()];
    for frame in 0..=count {
        if frame > 0 {
            app.update();
        }
        for (path, marble) in paths.iter_mut().zip(marbles) {
            path.push(scene::position(app, *marble));
        }
    }
    paths
}

#[test]
fn a_preview_is_what_happens_then() {
    for response in RESPONSES {
        let (mut app, marbles) = app(response);
        let world = app.world().resource::<TawWorld>();
        let predicted = world.preview().paths(&marbles, 90, scene::STEP).unwrap();
        assert_eq!(world.predict(marbles[3], 90, scene::STEP).unwrap(), predicted[3]);
        let happened = paths(&mut app, &marbles, 90);
        assert_eq!(predicted, happened, "{response:?}");
        let ways = happened.iter().map(|path| path[0].distance(path[90]));
        assert!(ways.fold(0.0, f32::max) > 0.5, "{response:?}: nothing happened");
    }
}

#[test]
fn a_preview_of_a_shot_is_what_the_shot_does() {
    for response in RESPONSES {
        let (mut app, marbles) = app(response);
        let shot = ExternalImpulse::at(Vec3::new(900.0, 300.0, -500.0), Vec3::Y * 0.1);
        let world = app.world().resource::<TawWorld>();
        let predicted = world.predict_shot(marbles[5], shot, 60, scene::STEP).unwrap();
        let unhit = world.predict(marbles[5], 60, scene::STEP).unwrap();
        app.world_mut().entity_mut(marbles[5]).insert(shot);
        let happened = paths(&mut app, &marbles[5..6], 60).swap_remove(0);
        assert_eq!(predicted, happened, "{response:?}");
        assert!(unhit[60].distance(happened[60]) > 0.2, "{response:?}");
    }
}

#[test]
fn the_app_does_not_notice_a_preview() {
    let run = |previews: bool| {
        let (mut app, marbles) = app(Response::SoftStep);
        for _ in 0..30 {
            if previews {
                let world = app.world().resource::<TawWorld>();
                let mut preview = world.preview();
                preview.set_position(marbles[0], Vec3::Y * 5.0).unwrap();
                preview.set_velocity(marbles[1], Vec3::Y * 5.0).unwrap();
                preview.step(scene::STEP).unwrap();
                assert!((preview.position(marbles[0]).unwrap().y - 5.0).abs() < 0.1);
                assert!(preview.velocity(marbles[1]).unwrap().y > 4.0);
                assert_eq!(preview.world().swarm.len(), world.swarm.len());
            }
            app.update();
        }
        marbles.iter().map(|marble| scene::position(&app, *marble)).collect::<Vec<_>>()
    };
    assert_eq!(run(true), run(false));
}

#[test]
fn a_wall_that_moves_is_at_rest_in_a_preview() {
    let mut app = scene::app();
    app.insert_resource(TawModel::default());
    let lift = app.world_mut().spawn(Wall::default()).id();
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    app.add_systems(
        FixedUpdate,
        (move |mut places: Query<&mut Transform>, time: Res<Time>| {
            places.get_mut(lift).unwrap().translation.x += time.delta_secs();
        })
        .before(TawSystems::Gather),
    );
    // Friction gives no angular momentum about the line of contact, so 2/7 of the speed of the wall.
    scene::frames(&mut app, 60);
    let mut preview = app.world().resource::<TawWorld>().preview();
    let carried = preview.velocity(marble).unwrap();
    assert!((carried.x - 2.0 / 7.0).abs() < 0.01, "{carried}");
    (0..120).for_each(|_| preview.step(scene::STEP).unwrap());
    let then = preview.velocity(marble).unwrap();
    assert!(then.x.abs() < 0.01, "the wall at rest brakes it: {then}");
}

#[test]
fn who_is_no_marble_and_what_is_no_number_is_refused() {
    let (mut app, marbles) = app(Response::SoftStep);
    let nobody = app.world_mut().spawn_empty().id();
    let newcomer = scene::drop_marble(&mut app, 0.5, Vec3::Y * 9.0);
    let world = app.world().resource::<TawWorld>();
    for entity in [nobody, newcomer] {
        assert_eq!(world.predict(entity, 1, scene::STEP), Err(PreviewError::NoMarble(entity)));
    }
    let text = |error: PreviewError| error.to_string();
    assert_eq!(
        text(PreviewError::NoMarble(nobody)),
        format!("entity {nobody} is no marble of the world")
    );
    for dt in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let refused = text(world.predict(marbles[0], 1, dt).unwrap_err());
        assert!(refused.starts_with("dt"), "{dt}: {refused}");
    }
    let mut preview = world.preview();
    let nan = ExternalImpulse { impulse: Vec3::X * f32::NAN, ..default() };
    assert!(text(preview.hit(marbles[0], nan).unwrap_err()).contains("impulse.x"));
    assert!(text(preview.set_velocity(marbles[0], Vec3::NAN).unwrap_err()).contains("velocity.x"));
    assert!(text(preview.set_position(marbles[0], Vec3::NAN).unwrap_err()).contains("position.x"));
    assert_eq!(preview.paths(&[], 2, scene::STEP), Ok(vec![]));
}
