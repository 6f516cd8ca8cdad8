//! Marbles that pass through those whom they name, through all for a time, and through one-way walls.

use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene::{self, STEP, frames, position};

const RESPONSES: [Response; 5] = [
    Response::Displacement,
    Response::Impulse,
    Response::Penalty(ContactLaw::HertzMindlin),
    Response::EventDriven,
    Response::SoftStep,
];

fn app(response: Response) -> App {
    let mut app = scene::app();
    let substeps = if response == Response::EventDriven { 1 } else { 4 };
    let rotation = Rotation::Dynamic;
    app.insert_resource(TawModel(Model { response, rotation, substeps, ..Model::default() }));
    app
}

fn height(app: &App, entity: Entity) -> f32 {
    position(app, entity).y
}

fn name(app: &mut App, entity: Entity, others: &[Entity]) {
    app.world_mut().entity_mut(entity).insert(IgnoreCollisions(others.to_vec()));
}

#[test]
fn a_marble_passes_through_the_entities_that_it_names() {
    for response in RESPONSES {
        let mut app = app(response);
        let floor = scene::floor(&mut app);
        let [lies, passes, lands] =
            [0.5, 1.6, 2.7].map(|y| scene::drop_marble(&mut app, 0.5, Vec3::Y * y));
        name(&mut app, passes, &[floor, lies]);
        name(&mut app, lands, &[passes]);
        frames(&mut app, 128);
        assert!(height(&app, passes) < -5.0, "{response:?}");
        assert!(height(&app, lies) > 0.4 && height(&app, lands) > 1.2, "{response:?}");
        // What lies there, asleep, falls as soon as it names the floor, and no longer.
        name(&mut app, lies, &[floor]);
        frames(&mut app, 16);
        let fell = height(&app, lies);
        assert!(fell < 0.4, "{response:?}: {fell}");
        app.world_mut().entity_mut(lies).remove::<IgnoreCollisions>();
        frames(&mut app, 64);
        assert!(height(&app, lies) > fell - 0.2, "{response:?}: {}", height(&app, lies));
    }
}

#[test]
fn those_that_are_named_may_come_later_and_go() {
    let mut app = app(Response::SoftStep);
    let nobody = app.world_mut().spawn_empty().id();
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 3.0);
    name(&mut app, marble, &[nobody]);
    frames(&mut app, 2);
    app.world_mut().entity_mut(nobody).insert(Wall::default());
    frames(&mut app, 128);
    assert!(height(&app, marble) < -5.0, "it is a wall now");
    // Another floor in its place.
    app.world_mut().entity_mut(nobody).despawn();
    scene::floor(&mut app);
    let next = scene::drop_marble(&mut app, 0.5, Vec3::Y);
    frames(&mut app, 64);
    assert!(height(&app, next) > 0.4);
    app.world_mut().entity_mut(marble).despawn();
    frames(&mut app, 2);
    assert_eq!(app.world().resource::<TawWorld>().marbles.ignoring().count(), 0);
}

#[test]
fn a_world_that_was_restored_passes_as_its_components_say() {
    let mut app = app(Response::Impulse);
    let floor = scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y);
    frames(&mut app, 32);
    let saved = app.world().resource::<TawWorld>().snapshot();
    name(&mut app, marble, &[floor]);
    let run = |app: &mut App| {
        frames(app, 32);
        position(app, marble)
    };
    let first = run(&mut app);
    assert!(first.y < 0.0);
    app.world_mut().resource_mut::<TawWorld>().restore(&saved);
    assert_eq!(run(&mut app), first);
}

#[test]
fn a_marble_meets_nothing_until_its_time_is_over() {
    for response in RESPONSES {
        let mut app = app(response);
        scene::floor(&mut app);
        let sensor = Wall::from(Cuboid::new(4.0, 4.0, 4.0));
        let sensor = app.world_mut().spawn((sensor, Sensor)).id();
        let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
        frames(&mut app, 64);
        let inside = |app: &App| app.world().get::<CollidingEntities>(sensor).unwrap().len();
        assert_eq!(inside(&app), 1, "{response:?}");
        let time = 12.0 * STEP;
        app.world_mut().entity_mut(marble).insert(ColliderDisabled::for_seconds(time));
        frames(&mut app, 12);
        assert!(app.world().get::<ColliderDisabled>(marble).is_some());
        assert_eq!(inside(&app), 0, "{response:?}");
        let fallen = 0.5 - height(&app, marble);
        let free = 0.5 * 9.81 * time * time;
        assert!((fallen - free).abs() < 0.1 * free, "{response:?}: {fallen} m, free {free} m");
        frames(&mut app, 1);
        assert!(app.world().get::<ColliderDisabled>(marble).is_none());
        frames(&mut app, 1);
        assert_eq!(inside(&app), 1, "{response:?}");
    }
}

/// Sums of such steps are 1e-7 s off.
#[test]
fn its_time_is_over_after_as_many_steps_as_it_has() {
    for (rate, seconds, steps) in
        [(60.0, 0.1, 6), (50.0, 1.0, 50), (144.0, 2.0, 288), (60.0, 0.3, 18)]
    {
        let mut app = scene::app_with(TawPlugins::in_schedule(Update));
        scene::frame_length(&mut app, 1.0 / rate);
        let marble = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
        app.world_mut().entity_mut(marble).insert(ColliderDisabled::for_seconds(seconds));
        frames(&mut app, steps);
        assert!(app.world().get::<ColliderDisabled>(marble).is_some(), "{seconds} s at {rate} Hz");
        frames(&mut app, 1);
        assert!(app.world().get::<ColliderDisabled>(marble).is_none(), "{seconds} s at {rate} Hz");
    }
}

/// It is solid again by a third of its radius in the floor, and by less in others.
#[test]
fn a_marble_that_is_solid_again_within_others_is_not_thrown() {
    let game = Model::GAME;
    let swept = Model { response: Response::Impulse, ..game };
    for model in [game, swept, Model::EXACT] {
        let mut app = scene::app();
        app.insert_resource(TawModel(model));
        scene::floor(&mut app);
        let places = [Vec3::Y * 0.34, vec3(0.9, 0.5, 0.0), vec3(-0.9, 0.5, 0.1)];
        let marbles = places.map(|at| scene::drop_marble(&mut app, 0.5, at));
        app.world_mut().entity_mut(marbles[0]).insert((
            ColliderDisabled::for_seconds(STEP),
            Velocity::default(),
            GravityScale(0.0),
        ));
        for _ in 0..128 {
            app.update();
            let speed = app.world().get::<Velocity>(marbles[0]).unwrap().length();
            assert!(speed < 4.5, "{model:?}: {speed} m/s");
            app.world_mut().entity_mut(marbles[0]).insert(GravityScale(1.0));
        }
        let at = height(&app, marbles[0]);
        assert!((at - 0.5).abs() < 0.1, "{model:?}: {at}");
    }
}

#[test]
fn without_a_time_it_stays_until_somebody_removes_it() {
    let mut app = app(Response::SoftStep);
    scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 2.0);
    app.world_mut().entity_mut(marble).insert(ColliderDisabled::default());
    frames(&mut app, 128);
    assert!(height(&app, marble) < -5.0);
    app.world_mut().entity_mut(marble).insert(Transform::from_xyz(0.0, 2.0, 0.0));
    app.world_mut().entity_mut(marble).insert(Velocity::default());
    app.world_mut().entity_mut(marble).remove::<ColliderDisabled>();
    frames(&mut app, 128);
    assert!(height(&app, marble) > 0.4);
}

/// A platform that is turned, on a parent that is turned and moves.
#[test]
fn a_marble_jumps_through_a_one_way_wall_and_lands_on_it() {
    for response in RESPONSES {
        let mut app = app(response);
        let turn = Quat::from_rotation_z(1.0);
        let carrier = Transform::from_rotation(turn).with_translation(Vec3::Y * 3.0);
        let carrier = app.world_mut().spawn(carrier).id();
        let wall = (Wall::from(Cuboid::new(6.0, 0.3, 6.0)), OneWay::default(), ChildOf(carrier));
        let wall = app.world_mut().spawn(wall).id();
        app.world_mut().entity_mut(wall).insert(Transform::from_rotation(turn.inverse()));
        let marble = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
        app.world_mut().entity_mut(marble).insert(Velocity(Vec3::Y * 11.0));
        frames(&mut app, 64);
        assert!(height(&app, marble) > 3.6, "{response:?}: {}", height(&app, marble));
        frames(&mut app, 128);
        assert!((height(&app, marble) - 3.65).abs() < 0.1, "{response:?}");
        // It drops through as soon as it names the wall, or the wall lets it pass the other way.
        name(&mut app, marble, &[wall]);
        frames(&mut app, 128);
        assert!(height(&app, marble) < -5.0, "{response:?}");
        let next = scene::drop_marble(&mut app, 0.5, Vec3::Y * 3.7);
        frames(&mut app, 64);
        assert!((height(&app, next) - 3.65).abs() < 0.1, "{response:?}");
        app.world_mut().entity_mut(wall).insert(OneWay(Dir3::NEG_Y));
        frames(&mut app, 64);
        assert!(height(&app, next) < 0.0, "{response:?}");
    }
}

#[test]
fn without_the_component_a_wall_is_solid_from_all_sides() {
    let mut app = app(Response::SoftStep);
    let place = Transform::from_xyz(0.0, 3.0, 0.0);
    let wall = (Wall::from(Cuboid::new(6.0, 0.3, 6.0)), OneWay::default(), place);
    let wall = app.world_mut().spawn(wall).id();
    let jump = |app: &mut App| {
        let marble = scene::drop_marble(app, 0.5, Vec3::ZERO);
        app.world_mut().entity_mut(marble).insert(Velocity(Vec3::Y * 11.0));
        frames(app, 64);
        let at = height(app, marble);
        app.world_mut().entity_mut(marble).despawn();
        at
    };
    assert!(jump(&mut app) > 3.6);
    app.world_mut().entity_mut(wall).remove::<OneWay>();
    assert!(jump(&mut app) < 2.4);
    app.world_mut().entity_mut(wall).insert(OneWay(Dir3::Y));
    assert!(jump(&mut app) > 3.6);
}
