//! Marbles by `Response::SoftStep`: many, asleep, woken, heard, and beside a swarm.

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::message::Messages;
use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene;

fn app() -> App {
    let mut app = scene::app();
    let (response, rotation) = (Response::SoftStep, Rotation::Dynamic);
    app.insert_resource(TawModel(Model { response, rotation, substeps: 2, ..Model::default() }));
    app
}

/// A box without a lid, of half-spaces, and so many marbles in it.
fn heap(app: &mut App, count: u16) -> Vec<Entity> {
    scene::floor(app);
    for turn in [(0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0)] {
        let (x, z) = turn;
        let up = Quat::from_rotation_arc(Vec3::Y, Vec3::new(x, 0.0, z));
        let place = Transform::from_xyz(-x, 0.0, -z).with_rotation(up);
        app.world_mut().spawn((Wall::default(), place));
    }
    let place = |i: u16| {
        let [x, y, z] = [i % 4, i / 16, i / 4 % 4].map(f32::from);
        Vec3::new(x * 0.45 - 0.7 + 0.01 * y, 0.3 + y * 0.5, z * 0.45 - 0.7 + 0.013 * y)
    };
    (0..count).map(|i| scene::drop_marble(app, 0.2, place(i))).collect()
}

#[test]
fn a_heap_of_entities_comes_to_rest_sleeps_and_wakes_by_a_push() {
    let mut app = app();
    let marbles = heap(&mut app, 48);
    for marble in &marbles {
        app.world_mut().entity_mut(*marble).insert(Velocity::default());
    }
    scene::frames(&mut app, 640);
    let world = app.world().resource::<TawWorld>();
    assert_eq!(world.swarm.asleep(), 48);
    assert_eq!(count_sleeping(&mut app), 48);
    let heights: Vec<_> = marbles.iter().map(|marble| scene::position(&app, *marble).y).collect();
    assert!(heights.iter().all(|height| (0.19..2.0).contains(height)), "{heights:?}");
    scene::frames(&mut app, 10);
    for (marble, height) in marbles.iter().zip(heights) {
        assert_eq!(scene::position(&app, *marble).y, height, "it sleeps");
    }
    let push = ExternalImpulse { impulse: Vec3::Y * 800.0, ..default() };
    app.world_mut().entity_mut(marbles[40]).insert(push);
    scene::frames(&mut app, 2);
    assert_eq!(count_sleeping(&mut app), 0);
    assert!(app.world().get::<Velocity>(marbles[40]).unwrap().y > 1.0);
}

fn count_sleeping(app: &mut App) -> usize {
    app.world_mut().query_filtered::<(), (With<Marble>, With<Sleeping>)>().iter(app.world()).count()
}

#[test]
fn a_marble_that_must_not_sleep_keeps_those_about_it_awake() {
    let mut app = app();
    let marbles = heap(&mut app, 32);
    app.world_mut().entity_mut(marbles[5]).insert(SleepingDisabled);
    scene::frames(&mut app, 500);
    assert_eq!(count_sleeping(&mut app), 0);
    app.world_mut().entity_mut(marbles[5]).remove::<SleepingDisabled>();
    scene::frames(&mut app, 120);
    assert_eq!(count_sleeping(&mut app), 32);
    // The marker follows the physics: back in time, into other models, and out of it.
    let saved = app.world().resource::<TawWorld>().snapshot();
    app.world_mut().entity_mut(marbles[7]).get_mut::<Transform>().unwrap().translation.y += 9.0;
    scene::frames(&mut app, 2);
    assert_eq!(count_sleeping(&mut app), 0);
    app.world_mut().resource_mut::<TawWorld>().restore(&saved);
    scene::frames(&mut app, 60);
    assert_eq!(count_sleeping(&mut app), 32);
    app.world_mut().entity_mut(marbles[0]).remove::<Marble>();
    assert!(app.world().get::<Sleeping>(marbles[0]).is_none());
    scene::frames(&mut app, 600);
    assert_eq!(count_sleeping(&mut app), 31);
    app.world_mut().resource_mut::<TawModel>().response = Response::Impulse;
    scene::frames(&mut app, 2);
    assert_eq!(count_sleeping(&mut app), 0);
}

/// A game that spawns and despawns marbles all the time has sleepers.
#[test]
fn a_marble_that_comes_or_goes_wakes_no_other_one() {
    let mut app = app();
    scene::floor(&mut app);
    let place = |i: u16| Vec3::new(f32::from(i % 6), 0.2, f32::from(i / 6));
    let mut marbles: Vec<_> =
        (0..36).map(|i| scene::drop_marble(&mut app, 0.2, place(i))).collect();
    scene::frames(&mut app, 120);
    assert_eq!(count_sleeping(&mut app), 36);
    let rubber = SurfaceMaterial { restitution: 0.3, ..default() };
    let layers = CollisionLayers::new(2, u32::MAX);
    for round in 0..5_u16 {
        // It lands where no other one lies.
        let new = scene::drop_marble(&mut app, 0.1, place(7 * round) + Vec3::new(0.5, 0.5, 0.5));
        app.world_mut().entity_mut(new).insert((rubber, layers));
        app.world_mut().despawn(marbles.pop().unwrap());
        for _ in 0..20 {
            scene::frames(&mut app, 1);
            let asleep = |marble: &&Entity| app.world().get::<Sleeping>(**marble).is_some();
            assert_eq!(marbles.iter().filter(asleep).count(), marbles.len(), "round {round}");
        }
    }
}

#[test]
fn a_wall_that_is_written_as_it_was_wakes_nobody() {
    let mut app = app();
    heap(&mut app, 32);
    let corners = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]];
    let corners = corners.map(|[x, z]| Vec3::new(x, 0.0, z));
    let ground = Wall::Mesh { points: corners.into(), triangles: vec![[0, 2, 1], [0, 3, 2]] };
    app.world_mut().spawn((ground, Transform::default()));
    scene::frames(&mut app, 500);
    for _ in 0..60 {
        for mut wall in app.world_mut().query::<&mut Wall>().iter_mut(app.world_mut()) {
            wall.set_changed();
        }
        app.update();
        assert_eq!(count_sleeping(&mut app), 32);
    }
    for mut wall in app.world_mut().query::<&mut Wall>().iter_mut(app.world_mut()) {
        if let Wall::Mesh { points, .. } = &mut *wall {
            points[0].y = 0.01;
        }
    }
    scene::frames(&mut app, 2);
    assert!(count_sleeping(&mut app) < 32, "another ground wakes what lies on it");
}

#[test]
fn sleepers_that_are_disabled_or_lose_a_component_or_their_parent_are_noticed() {
    let mut app = app();
    let marbles = heap(&mut app, 32);
    let parent = app.world_mut().spawn(Transform::from_xyz(3.0, 0.0, 0.0)).id();
    app.world_mut().entity_mut(marbles[9]).insert((GravityScale(1.5), ChildOf(parent)));
    app.world_mut().get_mut::<Transform>(marbles[9]).unwrap().translation.x -= 3.0;
    scene::frames(&mut app, 600);
    assert_eq!(count_sleeping(&mut app), 32);
    // Written with what it is: nothing happens.
    app.world_mut().get_mut::<Transform>(marbles[4]).unwrap().set_changed();
    scene::frames(&mut app, 3);
    assert_eq!(count_sleeping(&mut app), 32);
    // Refused: it is as it was, and sleeps on.
    let before = scene::position(&app, marbles[4]);
    app.world_mut().get_mut::<Transform>(marbles[4]).unwrap().translation.x = f32::NAN;
    scene::frames(&mut app, 1);
    assert_eq!(scene::position(&app, marbles[4]), before);
    assert_eq!(count_sleeping(&mut app), 32);
    let id = |app: &App, entity: Entity| {
        let world = app.world().resource::<TawWorld>();
        let mut rows = 0..u32::try_from(world.marbles.len()).unwrap();
        let row = rows.find(|row| world.marble_entity(*row) == Some(entity));
        row.and_then(|row| world.marbles.id(row as usize))
    };
    // Its parent goes: the place stays.
    let child = id(&app, marbles[9]).unwrap();
    app.world_mut().entity_mut(marbles[9]).remove::<ChildOf>();
    scene::frames(&mut app, 1);
    let place = app.world().resource::<TawWorld>().marbles.get(child).unwrap().position;
    assert_eq!(scene::position(&app, marbles[9]), Vec3::new(place.x, place.y, place.z));
    app.world_mut().entity_mut(marbles[9]).remove::<GravityScale>();
    scene::frames(&mut app, 1);
    let marble = app.world().resource::<TawWorld>().marbles.get(child).unwrap();
    assert_eq!(marble.gravity_scale.to_bits(), 1.0_f32.to_bits());
    scene::frames(&mut app, 300);
    assert_eq!(count_sleeping(&mut app), 32);
    // One goes as another comes.
    for [goes, comes] in [[3, 3], [5, 3], [8, 5], [8, 8]] {
        app.world_mut().entity_mut(marbles[goes]).insert(Disabled);
        app.world_mut().entity_mut(marbles[comes]).remove::<Disabled>();
        scene::frames(&mut app, 300);
    }
    app.world_mut().entity_mut(marbles[8]).remove::<Disabled>();
    scene::frames(&mut app, 600);
    assert!(marbles.iter().all(|marble| id(&app, *marble).is_some()));
    assert_eq!(count_sleeping(&mut app), 32);
}

#[test]
fn contacts_of_sleepers_go_on_and_end_when_one_is_taken_away() {
    let mut app = app();
    app.add_message::<ContactStarted>().add_message::<ContactEnded>();
    scene::floor(&mut app);
    let low = scene::drop_marble(&mut app, 0.2, Vec3::Y * 0.2);
    let count = |app: &App| {
        let started = app.world().resource::<Messages<ContactStarted>>();
        let ended = app.world().resource::<Messages<ContactEnded>>();
        [
            started.iter_current_update_messages().count(),
            ended.iter_current_update_messages().count(),
        ]
    };
    let mut sum = [0; 2];
    for _ in 0..200 {
        app.update();
        let now = count(&app);
        sum = [sum[0] + now[0], sum[1] + now[1]];
    }
    assert_eq!(sum, [1, 0], "it touched the floor once, and still does");
    app.world_mut().get_mut::<Transform>(low).unwrap().translation.y = 5.0;
    app.update();
    assert_eq!(count(&app), [0, 1]);
}

#[test]
fn a_fast_entity_meets_a_thin_wall() {
    let mut app = app();
    app.insert_resource(Gravity(Vec3::ZERO));
    app.world_mut().spawn((Wall::from(Cuboid::new(0.02, 4.0, 4.0)), Transform::default()));
    let bullet = scene::drop_marble(&mut app, 0.05, Vec3::X * -3.0);
    app.world_mut().entity_mut(bullet).insert(Velocity(Vec3::X * 200.0));
    scene::frames(&mut app, 10);
    assert!(scene::position(&app, bullet).x < 0.0);
}
