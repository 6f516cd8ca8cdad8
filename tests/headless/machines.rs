//! Runs the example `machines`, and looks whether it shows what it says.

#[path = "../../examples/machines.rs"]
#[allow(dead_code, clippy::duplicate_mod, reason = "its window; its paint is that of the games")]
mod example;

use std::collections::HashMap;
use std::f32::consts::TAU;

use bevy::prelude::*;
use bevy_taw::prelude::*;
use example::{LINK, LINKS, Part, Tally};

use crate::games::play;
use crate::scene;

fn run() -> App {
    play(example::plugin)
}

fn places(app: &mut App, part: Part) -> Vec<Transform> {
    let world = app.world_mut();
    let mut parts = world.query::<(&Part, &Transform)>();
    parts.iter(world).filter(|(it, _)| **it == part).map(|(_, place)| *place).collect()
}

/// Angle about z, in radians.
fn turn(place: Transform) -> f32 {
    let [x, y] = place.right().truncate().to_array();
    y.atan2(x)
}

/// Fails if something is outside, or faster than it can have become by falling from where marbles begin, by more than
/// the launcher gives.
fn check(app: &mut App, before: &mut HashMap<Entity, Vec3>) {
    let world = app.world_mut();
    let mut moving = world.query_filtered::<(Entity, &Transform), Or<(With<Body>, With<Marble>)>>();
    for (entity, place) in moving.iter(world) {
        let at = place.translation;
        assert!(at.x.abs() < 4.2 && (0.0..5.0).contains(&at.y) && at.z.abs() < 0.3, "at {at}");
        assert!(place.rotation.is_normalized(), "turned by {}", place.rotation);
        let speed =
            before.insert(entity, at).map_or(0.0, |before| before.distance(at)) / scene::STEP;
        let fall = (2.0 * 9.81 * (5.0 - at.y)).sqrt();
        assert!(speed < fall + 2.0, "{speed} m/s at {at}");
    }
}

/// Largest distance of two places that a hinge of the bridge holds together.
fn gap(links: &[Transform]) -> f32 {
    let reach = Vec3::X * LINK / 2.0;
    let ends =
        |pair: &[Transform]| [pair[0].transform_point(reach), pair[1].transform_point(-reach)];
    let gaps = links.windows(2).map(|pair| ends(pair)[0].distance(ends(pair)[1]));
    let [first, last] = [links[0].transform_point(-reach), links[LINKS - 1].transform_point(reach)];
    let (first, last) = (first.distance(example::BRIDGE[0]), last.distance(example::BRIDGE[1]));
    gaps.fold(first.max(last), f32::max)
}

#[test]
fn marbles_move_all_machines_for_half_a_minute() {
    let mut app = run();
    let (mut before, mut wheel, mut turned) = (HashMap::default(), 0.0_f32, 0.0);
    let (mut gate, mut left, mut right, mut passed) = (0.0_f32, 0.0_f32, 0.0_f32, 0);
    for _ in 0..64 * 30 {
        app.update();
        check(&mut app, &mut before);
        let angle = turn(places(&mut app, Part::Wheel)[0]);
        turned += (angle - wheel + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0;
        wheel = angle;
        gate = gate.max(turn(places(&mut app, Part::Gate)[0]));
        let tip = turn(places(&mut app, Part::SeeSaw)[0]);
        (left, right) = (left.max(tip), right.min(tip));
        let links = places(&mut app, Part::Link);
        assert!(gap(&links) < LINK * 0.01, "the bridge is torn by {} m", gap(&links));
        passed += u32::from(tip < -0.2);
    }
    assert!(turned < -TAU, "the wheel turned by {turned}");
    assert!(gate > 0.5 && left > 0.29 && right < -0.25, "gate {gate}, see-saw {left}, {right}");
    assert!(passed > 64, "the see-saw was down for {passed} steps");
    let Tally(dropped, broken) = app.world().resource();
    assert_eq!((*dropped, *broken), (20, 1));
    assert!(places(&mut app, Part::Bucket)[0].translation.y < 0.1, "the bucket lies below");
}

#[test]
fn the_launched_marble_knocks_over_all_dominoes() {
    let mut app = run();
    let standing = |app: &mut App| {
        let dominoes = places(app, Part::Domino);
        dominoes.iter().filter(|place| place.up().y > 0.99).count()
    };
    scene::frames(&mut app, 64 * 2);
    assert_eq!(standing(&mut app), 7);
    app.world_mut().resource_mut::<ButtonInput<KeyCode>>().press(KeyCode::Space);
    scene::frames(&mut app, 64 * 4);
    let fallen = places(&mut app, Part::Domino);
    assert!(fallen.iter().all(|place| place.up().y < 0.5), "{fallen:?}");
}

#[test]
fn all_is_built_anew() {
    let mut app = run();
    let begin = |app: &mut App| {
        let parts = [Part::Wheel, Part::SeeSaw, Part::Bucket, Part::Plunger];
        let joints = app.world().resource::<TawWorld>().joints.len();
        (parts.map(|part| places(app, part)[0].translation), joints)
    };
    scene::frames(&mut app, 1);
    let first = begin(&mut app);
    scene::frames(&mut app, 64 * 15);
    assert_ne!(begin(&mut app), first);
    app.world_mut().resource_mut::<ButtonInput<KeyCode>>().press(KeyCode::KeyR);
    app.update();
    app.world_mut().resource_mut::<ButtonInput<KeyCode>>().clear(); // as Bevy's plugin of keys does
    scene::frames(&mut app, 1);
    let again = begin(&mut app);
    assert_eq!(again.1, first.1);
    for (again, first) in again.0.into_iter().zip(first.0) {
        assert!(again.distance(first) < 0.01, "{again} was {first}");
    }
    assert_eq!(app.world().resource::<Tally>().1, 0);
}
