//! Contacts of bodies: messages, observers, forces, and bodies as ground.

use bevy::ecs::message::Messages;
use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::bodies::app;
use crate::heroes::{ground, grounded};
use crate::scene;

/// Started, ongoing and ended contacts, and hits with their speeds, in order.
#[derive(Resource, Default)]
struct Told(Vec<(char, ContactPair, f32)>);

fn listen(
    mut told: ResMut<Told>,
    mut started: MessageReader<ContactStarted>,
    mut ongoing: MessageReader<ContactOngoing>,
    mut ended: MessageReader<ContactEnded>,
    mut hits: MessageReader<ContactHit>,
) {
    started.read().for_each(|m| told.0.push(('s', m.pair, m.approach_speed)));
    ongoing.read().for_each(|m| told.0.push(('o', m.pair, m.force.length())));
    ended.read().for_each(|m| told.0.push(('e', m.pair, 0.0)));
    hits.read().for_each(|m| told.0.push(('h', m.pair, m.impulse.length())));
}

fn listening_app() -> App {
    let mut app = app();
    app.init_resource::<Told>()
        .add_message::<ContactStarted>()
        .add_message::<ContactOngoing>()
        .add_message::<ContactEnded>()
        .add_message::<ContactHit>()
        .add_message::<ContactPoint>()
        .add_systems(FixedUpdate, listen.after(TawSystems::Scatter));
    app
}

fn of_pair(app: &App, a: Entity, b: Entity) -> Vec<(char, f32)> {
    let told = &app.world().resource::<Told>().0;
    let is_pair = |pair: &ContactPair| [pair.a, pair.b] == [a, b] || [pair.a, pair.b] == [b, a];
    told.iter().filter(|it| is_pair(&it.1)).map(|it| (it.0, it.2)).collect()
}

fn crate_at(app: &mut App, kilograms: f32, at: Vec3) -> Entity {
    let mass = MarbleMass::Kilograms(kilograms);
    let body = (Body::from(Cuboid::from_length(0.2)), mass, Transform::from_translation(at));
    app.world_mut().spawn((body, Velocity::default())).id()
}

fn floor_of(app: &mut App) -> Entity {
    app.world_mut().query_filtered::<Entity, With<Wall>>().single(app.world()).unwrap()
}

/// A crate lands on the floor, and a marble and another crate on it: each pair starts once, goes on with the weight
/// that it bears, also asleep, and ends when the lower crate goes.
#[test]
fn contacts_of_bodies_start_go_on_and_end() {
    let mut app = listening_app();
    let floor = floor_of(&mut app);
    let marble = scene::drop_marble(&mut app, 0.1, Vec3::new(0.0, 0.52, 0.0));
    app.world_mut().entity_mut(marble).insert(MarbleMass::Kilograms(1.0));
    let lower = crate_at(&mut app, 4.0, Vec3::new(0.0, 0.105, 0.0));
    let upper = crate_at(&mut app, 2.0, Vec3::new(0.0, 0.31, 0.0));
    scene::frames(&mut app, 5 * 64);
    assert!(app.world().entity(upper).contains::<Sleeping>());
    for (a, b, mass) in [(floor, lower, 7.0), (lower, upper, 3.0), (upper, marble, 1.0)] {
        let told = of_pair(&app, a, b);
        let number = |kind| told.iter().filter(|it| it.0 == kind).count();
        assert_eq!((number('s'), number('e')), (1, 0), "{mass} kg: {told:?}");
        let (kind, force) = told[told.len() - 1];
        assert_eq!(kind, 'o', "{mass} kg");
        assert!((force / (mass * 9.81) - 1.0).abs() < 0.05, "{mass} kg: {force} N");
    }
    let points = app.world().resource::<Messages<ContactPoint>>();
    let last: Vec<_> = points.iter_current_update_messages().copied().collect();
    let on_floor = last.iter().filter(|it| it.pair == ContactPair { a: floor, b: lower });
    assert_eq!((on_floor.count(), last.iter().any(|it| it.is_new)), (4, false), "{last:?}");
    app.world_mut().despawn(lower);
    app.world_mut().resource_mut::<Told>().0.clear();
    scene::frames(&mut app, 2);
    assert_eq!(of_pair(&app, floor, lower), [('e', 0.0)]);
    assert_eq!(of_pair(&app, lower, upper), [('e', 0.0)]);
}

/// Hits: the observed entity, the other one, and the impulse on the first.
#[derive(Resource, Default)]
struct Seen(Vec<(Entity, Entity, Vec3)>);

/// A marble that hits a crate is told once with its impulse, to observers of both, from the side of each.
#[test]
fn a_hit_on_a_body_is_told_to_both() {
    let mut app = listening_app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let elastic = SurfaceMaterial { friction: 0.0, restitution: 1.0, ..default() };
    let target = crate_at(&mut app, 3.0, Vec3::new(0.0, 2.0, 0.0));
    app.world_mut().entity_mut(target).insert(elastic);
    let marble = scene::drop_marble(&mut app, 0.1, Vec3::new(-2.0, 2.0, 0.0));
    let flight = (Velocity(Vec3::X * 8.0), MarbleMass::Kilograms(1.0), elastic);
    app.world_mut().entity_mut(marble).insert(flight);
    app.init_resource::<Seen>();
    for entity in [target, marble] {
        app.world_mut().entity_mut(entity).observe(
            |hit: On<ContactHit>, mut seen: ResMut<Seen>| {
                let impulse = hit.impulse_on(hit.pair.a);
                seen.0.push((hit.pair.a, hit.pair.b, impulse));
            },
        );
    }
    scene::frames(&mut app, 40);
    // Elastic: 2 v m M / (m + M).
    let told: Vec<_> = of_pair(&app, target, marble);
    let hits: Vec<_> = told.iter().filter(|it| it.0 == 'h').collect();
    assert_eq!(hits.len(), 1, "{told:?}");
    assert!((hits[0].1 - 12.0).abs() < 0.01, "{told:?}");
    let seen = &app.world().resource::<Seen>().0;
    assert_eq!(seen.len(), 2, "{seen:?}");
    for (a, b, impulse) in seen {
        let sign = if *a == target { 1.0 } else { -1.0 };
        assert!(*b != *a && (impulse.x - sign * 12.0).abs() < 0.01, "{seen:?}");
    }
    assert!(told.iter().any(|it| it.0 == 'e'), "it leaves: {told:?}");
}

/// A body reads what it bears, as a wall and a marble do.
#[test]
fn a_body_reads_the_force_on_it() {
    let mut app = app();
    let scale = crate_at(&mut app, 5.0, Vec3::new(0.0, 0.1, 0.0));
    app.world_mut().entity_mut(scale).insert(ContactForce::default());
    crate_at(&mut app, 3.0, Vec3::new(0.0, 0.3, 0.0));
    scene::frames(&mut app, 4 * 64);
    let ContactForce { total, pressure } = *app.world().get(scale).unwrap();
    assert!((total.y - 5.0 * 9.81).abs() < 0.5, "its weight is borne: {total}");
    assert!((pressure / (11.0 * 9.81) - 1.0).abs() < 0.02, "from both sides: {pressure} N");
}

/// A body is ground, still or as it moves, also asleep, and a hero jumps off it.
#[test]
fn a_marble_jumps_off_a_body() {
    let mut app = app();
    let raft = crate_at(&mut app, 50.0, Vec3::new(0.0, 0.1, 0.0));
    let marble = grounded(&mut app, 0.1, Vec3::new(0.0, 0.301, 0.0));
    scene::frames(&mut app, 20);
    for asleep in [false, true] {
        let found = ground(&app, marble).unwrap();
        assert_eq!(found.entity, raft, "asleep: {asleep}");
        assert!(found.normal.distance(Vec3::Y) < 1e-4, "{found:?}");
        assert!((found.point.y - 0.2).abs() < 1e-3, "{found:?}");
        assert_eq!(app.world().entity(marble).contains::<Sleeping>(), asleep);
        scene::frames(&mut app, 4 * 64);
    }
    let hero = MarbleController { jump: true, ..default() };
    app.world_mut().entity_mut(marble).insert(hero);
    scene::frames(&mut app, 3);
    assert_eq!(ground(&app, marble), None);
    let mut highest = 0.0_f32;
    for _ in 0..64 {
        app.update();
        highest = highest.max(scene::position(&app, marble).y);
    }
    assert!((1.4..1.6).contains(&highest), "jumps 1.2 m high: {highest}");
    let lift = (Velocity(Vec3::Y * 0.5), MarbleMass::Infinite);
    app.world_mut().entity_mut(raft).insert(lift);
    scene::frames(&mut app, 3 * 64);
    let found = ground(&app, marble);
    let speed = found.map(|found| (found.entity, (found.velocity.y - 0.5).abs() < 1e-4));
    assert_eq!(speed, Some((raft, true)), "{found:?}");
}
