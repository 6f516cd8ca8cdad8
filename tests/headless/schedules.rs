//! The step in another schedule: of the fixed main loop, and one that the game runs by hand.

use bevy::app::PluginGroupBuilder;
use bevy::ecs::schedule::ScheduleLabel;
use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene::{self, STEP, frame_length, frames, position, random};

/// Notes of a game in its steps.
#[derive(Resource, Default, Clone, Debug, PartialEq)]
struct Notes {
    contacts: Vec<(ContactPair, Vec3)>,
    sensed: Vec<(Entity, f32)>,
    grounded: Vec<bool>,
}

fn note(
    mut notes: ResMut<Notes>,
    mut contacts: MessageReader<ContactStarted>,
    mut sensed: MessageReader<SensorEntered>,
    grounded: Query<&Grounded>,
) {
    notes.contacts.extend(contacts.read().map(|it| (it.pair, it.point)));
    notes.sensed.extend(sensed.read().map(|it| (it.collider, it.time_left)));
    notes.grounded.extend(grounded.iter().map(|it| it.ground.is_some()));
}

/// A lift, a hero that jumps, a zone of another gravity, a gate that counts, and marbles. Returns all that is drawn.
fn game(plugins: PluginGroupBuilder, schedule: impl ScheduleLabel) -> (App, Vec<Entity>) {
    let mut app = scene::app_with(plugins);
    app.insert_resource(TawModel(Model::GAME)).init_resource::<Notes>();
    app.add_message::<ContactStarted>();
    app.add_systems(schedule, note.after(TawSystems::Scatter));
    scene::board(&mut app);
    let lift = (Wall::from(Cuboid::new(2.0, 0.2, 2.0)), Transform::from_xyz(-2.0, 0.1, 0.0));
    let lift = app.world_mut().spawn(lift).id();
    let zone = (Wall::from(Cuboid::new(2.0, 9.0, 2.0)), GravityZone::Replace(Vec3::X * 3.0));
    app.world_mut().spawn((zone, Transform::from_xyz(3.0, 4.0, 3.0)));
    let gate = (Wall::from(Cuboid::new(9.0, 0.1, 9.0)), Sensor, Transform::from_xyz(0.0, 1.5, 0.0));
    app.world_mut().spawn(gate);
    let mut marbles = scene::drop_marbles(&mut app, 20);
    let hero = scene::drop_marble(&mut app, 0.4, Vec3::new(-2.0, 3.0, 0.0));
    app.world_mut()
        .entity_mut(hero)
        .insert(MarbleController { direction: Vec3::X * 0.1, ..default() });
    app.add_systems(Update, move |mut places: Query<&mut Transform>, time: Res<Time>| {
        let mut lift = places.get_mut(lift).unwrap();
        lift.translation.y += time.delta_secs() * 0.5;
    });
    marbles.push(hero);
    (app, marbles)
}

fn places(app: &App, marbles: &[Entity]) -> Vec<Transform> {
    marbles.iter().map(|it| *app.world().get::<Transform>(*it).unwrap()).collect()
}

/// Frames of all lengths, in some of which the hero is told to jump.
fn play(app: &mut App, marbles: &[Entity], mut judge: impl FnMut(&App)) {
    for frame in 0..240 {
        frame_length(app, 3.0 * STEP * random(frame));
        if frame % 40 == 0 {
            let hero = marbles[marbles.len() - 1];
            app.world_mut().get_mut::<MarbleController>(hero).unwrap().jump = true;
        }
        app.update();
        judge(app);
    }
}

#[test]
fn a_game_in_another_schedule_of_the_fixed_loop_goes_the_same_way() {
    let (mut usual, marbles) = game(TawPlugins.build(), FixedUpdate);
    let mut drawn = Vec::new();
    play(&mut usual, &marbles, |app| drawn.push(places(app, &marbles)));
    let notes = usual.world().resource::<Notes>();
    assert!(notes.contacts.len() > 20 && notes.sensed.len() > 5);
    assert!(notes.grounded.contains(&true) && notes.grounded.contains(&false));
    let follows = |mut app: App, marbles: Vec<Entity>| {
        let mut frame = 0;
        play(&mut app, &marbles, |app| {
            assert_eq!(places(app, &marbles), drawn[frame], "frame {frame}");
            frame += 1;
        });
        assert_eq!(app.world().resource::<Notes>(), notes);
    };
    let in_schedule = TawPlugins::in_schedule(FixedPostUpdate);
    let (app, marbles) = game(in_schedule, FixedPostUpdate);
    follows(app, marbles);
    let (app, marbles) = game(TawPlugins::in_schedule(FixedFirst), FixedFirst);
    follows(app, marbles);
}

/// Ahead of a step in `FixedPostUpdate` is all of `FixedUpdate`, in whatever order it runs.
#[test]
fn what_fixed_update_writes_is_there_in_the_step_of_the_same_tick() {
    let mut app = scene::app_with(TawPlugins::in_schedule(FixedPostUpdate));
    app.insert_resource(Gravity(Vec3::ZERO));
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
    frames(&mut app, 2);
    app.add_systems(FixedUpdate, move |mut places: Query<&mut Transform>| {
        places.get_mut(marble).unwrap().translation = Vec3::X;
    });
    app.add_systems(FixedLast, move |world: Res<TawWorld>| {
        assert_eq!(world.marbles.position()[0].x.to_bits(), 1.0_f32.to_bits());
    });
    frames(&mut app, 2);
    assert_eq!(app.world().resource::<TawSchedule>().label(), FixedPostUpdate.intern());
}

#[derive(ScheduleLabel, Clone, Debug, PartialEq, Eq, Hash)]
struct ByHand;

fn by_hand() -> (App, Vec<Entity>) {
    game(TawPlugins::in_schedule(ByHand), ByHand)
}

#[test]
fn a_schedule_that_the_game_runs_steps_when_it_is_run() {
    let (mut usual, marbles) = game(
        TawPlugins.build().disable::<bevy_taw::interpolation::TawInterpolationPlugin>(),
        FixedUpdate,
    );
    let (mut app, same) = by_hand();
    assert_eq!(marbles, same);
    let before = places(&app, &marbles);
    frames(&mut app, 5);
    assert_eq!(places(&app, &marbles), before, "nobody ran it");
    let (mut app, _) = by_hand();
    // After `Update`, in which the lift moves, as the next frame's fixed steps are.
    app.add_systems(PreUpdate, |world: &mut World| world.run_schedule(ByHand));
    for frame in 0..300 {
        usual.update();
        app.update();
        assert_eq!(places(&app, &marbles), places(&usual, &marbles), "frame {frame}");
    }
    assert_eq!(app.world().resource::<Notes>(), usual.world().resource::<Notes>());
}

#[test]
fn a_step_of_no_time_is_none_and_several_in_a_frame_are_several() {
    let (mut app, marbles) = by_hand();
    frame_length(&mut app, 0.0);
    app.add_systems(Last, |world: &mut World| (0..3).for_each(|_| world.run_schedule(ByHand)));
    let before = places(&app, &marbles);
    frames(&mut app, 3);
    assert_eq!(places(&app, &marbles), before);
    assert!(app.world().resource::<Messages<InputRefused>>().is_empty());
    frame_length(&mut app, STEP);
    let hero = marbles[marbles.len() - 1];
    frames(&mut app, 4);
    let time = 12.0 * STEP;
    let fallen = 3.0 - position(&app, hero).y;
    let free = 0.5 * 9.81 * time * time;
    assert!((fallen - free).abs() < 0.1 * free, "{fallen} m, free {free} m");
}
