//! Contact messages.

use bevy::ecs::message::Messages;
use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene;

/// Messages in order: the step, the kind, the pair.
#[derive(Resource, Default)]
struct Told(Vec<(char, Entity, Entity)>);

fn listen(
    mut told: ResMut<Told>,
    mut started: MessageReader<ContactStarted>,
    mut ongoing: MessageReader<ContactOngoing>,
    mut ended: MessageReader<ContactEnded>,
) {
    let mut tell = |kind, pair: ContactPair| told.0.push((kind, pair.a, pair.b));
    started.read().for_each(|m| tell('s', m.pair));
    ongoing.read().for_each(|m| tell('o', m.pair));
    ended.read().for_each(|m| tell('e', m.pair));
}

fn listening_app() -> App {
    let mut app = scene::app();
    app.init_resource::<Told>()
        .add_message::<ContactStarted>()
        .add_message::<ContactOngoing>()
        .add_message::<ContactEnded>()
        .add_systems(FixedUpdate, listen.after(TawSystems::Scatter));
    app
}

fn told(app: &mut App) -> Vec<(char, Entity, Entity)> {
    std::mem::take(&mut app.world_mut().resource_mut::<Told>().0)
}

#[test]
fn a_contact_starts_goes_on_and_ends_once_a_step() {
    let mut app = listening_app();
    app.world_mut().resource_mut::<TawModel>().substeps = 5;
    let floor = scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    scene::frames(&mut app, 3);
    assert_eq!(told(&mut app), [('s', floor, marble), ('o', floor, marble), ('o', floor, marble)]);
    app.world_mut().get_mut::<Transform>(marble).unwrap().translation.y = 9.0;
    scene::frames(&mut app, 2);
    assert_eq!(told(&mut app), [('e', floor, marble)]);
}

#[test]
fn a_start_says_how_hard_and_where_from() {
    let mut app = scene::app();
    app.add_message::<ContactStarted>().insert_resource(Gravity(Vec3::ZERO));
    let left = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
    let right = scene::drop_marble(&mut app, 0.5, Vec3::X * 1.05);
    app.world_mut().entity_mut(left).insert(Velocity(Vec3::X * 8.0));
    app.update();
    let messages = app.world().resource::<Messages<ContactStarted>>();
    let started: Vec<_> = messages.iter_current_update_messages().collect();
    assert_eq!(started.len(), 1);
    let pair = started[0].pair;
    assert_eq!((pair.other(left), pair.other(right)), (Some(right), Some(left)));
    let toward_right = if pair.a == left { Vec3::X } else { Vec3::NEG_X };
    assert_eq!((started[0].normal, started[0].approach_speed), (toward_right, 8.0));
}

#[test]
fn a_fall_is_heard_at_its_speed_by_every_response() {
    let responses =
        [Response::Displacement, Response::Impulse, Response::EventDriven, Response::SoftStep];
    for response in responses {
        for tenths in 5..25_u8 {
            let mut app = scene::app();
            app.add_message::<ContactStarted>();
            app.world_mut().resource_mut::<TawModel>().response = response;
            scene::floor(&mut app);
            let height = f32::from(tenths) / 10.0;
            scene::drop_marble(&mut app, 0.2, Vec3::Y * (0.2 + height));
            let mut heard = None;
            for _ in 0..64 {
                app.update();
                let messages = app.world().resource::<Messages<ContactStarted>>();
                heard = heard.or(messages.iter_current_update_messages().next().copied());
            }
            let heard = heard.expect("it fell for a second");
            let exact = (2.0 * 9.81 * height).sqrt();
            // Semi-implicit Euler is slower by g h / 2 at the same height, and it is heard
            // at the end of the step, which adds up to g h.
            let off = heard.approach_speed - exact;
            assert!(off.abs() < 0.51 * 9.81 * scene::STEP, "{response:?}, {height} m: {off}");
            assert_eq!(heard.normal, Vec3::Y);
        }
    }
}

#[test]
fn a_despawned_marble_ends_its_contacts() {
    let mut app = listening_app();
    let floor = scene::floor(&mut app);
    let below = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    let above = scene::drop_marble(&mut app, 0.5, Vec3::Y * 1.5);
    scene::frames(&mut app, 5);
    told(&mut app);
    app.world_mut().despawn(below);
    app.update();
    let mut ended = told(&mut app);
    ended.sort_unstable();
    let (low, high) = (below.min(above), below.max(above));
    let mut expected = [('e', floor, below), ('e', low, high)];
    expected.sort_unstable();
    assert_eq!(ended, expected);
}

#[test]
fn contacts_of_what_rests_do_not_flicker() {
    // Where gravity moves a marble by less than a fiftieth of its radius in a step,
    // and where it moves it by a quarter. (There, higher piles really do jump.)
    for (radius, layers) in [(0.5, 4), (0.01, 2)] {
        let mut app = listening_app();
        scene::floor(&mut app);
        for layer in 0..layers {
            let height = radius * (1.0 + 2.0 * f32::from(layer as u8));
            scene::drop_marble(&mut app, radius, Vec3::Y * height);
        }
        scene::frames(&mut app, 100);
        let all = told(&mut app);
        let count = |kind| all.iter().filter(|told| told.0 == kind).count();
        assert_eq!((count('s'), count('e')), (layers, 0), "radius {radius}");
        assert!(count('o') > 95 * layers, "radius {radius}: {} ongoing", count('o'));
    }
}

#[test]
fn nobody_listens_and_nothing_is_written() {
    let mut app = scene::app();
    scene::floor(&mut app);
    scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    scene::frames(&mut app, 5);
    assert!(!app.world().resource::<TawWorld>().contacts.wm.is_empty());
    assert!(!app.world().contains_resource::<Messages<ContactStarted>>());
    assert!(!app.world().contains_resource::<Messages<ContactOngoing>>());
}

#[test]
fn a_system_between_the_verbs_can_take_contacts_out() {
    let mut app = listening_app();
    let ghosts = |mut world: ResMut<TawWorld>| world.contacts.wm.clear();
    app.add_systems(
        Substep,
        ghosts.after(TawSystems::GenerateContacts).before(TawSystems::Restitute),
    );
    scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    scene::frames(&mut app, 60);
    assert!(scene::position(&app, marble).y < -3.0);
    assert_eq!(told(&mut app), []);
}

/// Events that observers heard: by whom, of which pair.
#[derive(Resource, Default)]
struct Heard(Vec<(&'static str, ContactStarted)>);

#[test]
fn observers_hear_contacts_as_their_entity_sees_them() {
    for response in [Response::Impulse, Response::EventDriven, Response::SoftStep] {
        let mut app = scene::app();
        app.world_mut().resource_mut::<TawModel>().response = response;
        app.init_resource::<Heard>();
        let floor = scene::floor(&mut app);
        let marble = scene::drop_marble(&mut app, 0.5, Vec3::new(1.0, 1.0, 0.0));
        let other = scene::drop_marble(&mut app, 0.5, Vec3::new(9.0, 40.0, 0.0));
        let hear = |who| {
            move |hit: On<ContactStarted>, mut heard: ResMut<Heard>| heard.0.push((who, *hit))
        };
        app.world_mut().entity_mut(floor).observe(hear("floor"));
        app.world_mut().entity_mut(marble).observe(hear("marble"));
        app.world_mut().entity_mut(other).observe(hear("other"));
        scene::frames(&mut app, 32);
        assert!(!app.world().contains_resource::<Messages<ContactStarted>>());
        let heard = std::mem::take(&mut app.world_mut().resource_mut::<Heard>().0);
        assert!(heard.len() >= 2, "{response:?}: {heard:?}");
        let [floors, marbles] = ["floor", "marble"].map(|who| {
            let first = heard.iter().find(|(by, _)| *by == who).expect("it heard nothing");
            first.1
        });
        assert_eq!((floors.pair.a, floors.pair.b, floors.normal), (floor, marble, Vec3::Y));
        assert_eq!((marbles.pair.a, marbles.pair.b, marbles.normal), (marble, floor, -Vec3::Y));
        assert_eq!(floors.approach_speed, marbles.approach_speed);
        assert!((floors.approach_speed - (2.0 * 9.81 * 0.5_f32).sqrt()).abs() < 0.1, "{floors:?}");
        let off = floors.point.distance(Vec3::X);
        assert!(off < 4.0 * scene::STEP, "{response:?}: {floors:?}");
        assert!(heard.iter().all(|(by, _)| *by != "other"), "{heard:?}");
    }
}

#[test]
fn a_global_observer_hears_both_sides_and_one_that_comes_late_hears_the_rest() {
    let mut app = scene::app();
    app.init_resource::<Heard>();
    scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.75);
    scene::frames(&mut app, 30); // it fell while nobody listened
    app.add_observer(|hit: On<ContactStarted>, mut heard: ResMut<Heard>| {
        heard.0.push(("all", *hit));
    });
    app.world_mut().get_mut::<Transform>(marble).unwrap().translation.y = 2.0;
    scene::frames(&mut app, 60);
    let heard = &app.world().resource::<Heard>().0;
    assert_eq!(heard.len(), 2, "{heard:?}");
    assert_eq!(heard[0].1.pair.a, heard[1].1.pair.b);
    assert_eq!(heard[0].1.normal, -heard[1].1.normal);
}

/// An observer may do what it likes to the world, also to those of whom it hears.
#[test]
fn what_an_observer_despawns_is_gone_and_ends_its_contacts() {
    #[derive(Resource, Default)]
    struct Ended(Vec<ContactEnded>);
    let mut app = scene::app();
    app.init_resource::<Ended>();
    let floor = scene::floor(&mut app);
    app.world_mut()
        .entity_mut(floor)
        .observe(|hit: On<ContactStarted>, mut commands: Commands| {
            commands.entity(hit.pair.b).despawn();
        })
        .observe(|end: On<ContactEnded>, mut ended: ResMut<Ended>| ended.0.push(*end));
    let marbles: Vec<_> = (0..10_u8)
        .map(|i| scene::drop_marble(&mut app, 0.5, Vec3::new(f32::from(i) * 0.9, 1.0, 0.0)))
        .collect();
    scene::frames(&mut app, 60);
    for marble in &marbles {
        assert!(app.world().get_entity(*marble).is_err());
    }
    let ended = &app.world().resource::<Ended>().0;
    let mut of: Vec<_> = ended.iter().map(|end| end.pair.b).collect();
    of.sort_unstable();
    of.dedup();
    assert_eq!(of.len(), marbles.len(), "{ended:?}");
    assert!(app.world().resource::<TawWorld>().marbles.is_empty());
}

/// A track of one mesh: what rolls along it touches it all the time, and hits the wall at its end.
#[test]
fn the_end_of_a_track_is_hit() {
    for response in [Response::Impulse, Response::EventDriven, Response::SoftStep] {
        let mut app = scene::app();
        let model = Model { response, rotation: Rotation::Dynamic, substeps: 4, ..Model::GAME };
        app.insert_resource(TawModel(model)).add_message::<ContactHit>();
        let corner = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
        let points = vec![
            corner(-5.0, 0.0, -1.0),
            corner(-5.0, 0.0, 1.0),
            corner(2.0, 0.0, -1.0),
            corner(2.0, 0.0, 1.0),
            corner(2.0, 2.0, -1.0),
            corner(2.0, 2.0, 1.0),
        ];
        let triangles = vec![[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]];
        let track = app.world_mut().spawn(Wall::Mesh { points, triangles }).id();
        let marble = scene::drop_marble(&mut app, 0.2, Vec3::new(-1.0, 0.2, 0.0));
        let rolling = AngularVelocity(Vec3::NEG_Z * 15.0);
        app.world_mut().entity_mut(marble).insert((Velocity(Vec3::X * 3.0), rolling));
        let mut hits = Vec::new();
        for _ in 0..64 {
            app.update();
            let messages = app.world().resource::<Messages<ContactHit>>();
            hits.extend(messages.iter_current_update_messages().copied());
        }
        let ends: Vec<_> = hits.iter().filter(|hit| hit.normal.x < -0.9).collect();
        let case = format!("{response:?}: {hits:?}");
        assert_eq!(ends.len(), 1, "{case}");
        assert_eq!((ends[0].pair.a, ends[0].pair.b), (track, marble), "{case}");
        assert!((ends[0].approach_speed - 3.0).abs() < 0.1, "{case}");
        assert!(ends[0].point.distance(Vec3::new(2.0, 0.2, 0.0)) < 0.1, "{case}");
        // It may hop a little at the end, and is heard by no more than that.
        assert!(hits.iter().all(|hit| hit.normal.x < -0.9 || hit.approach_speed < 1.5), "{case}");
    }
}

/// A flipper that strikes a marble at rest is heard as hard as it strikes.
#[test]
fn what_a_wall_strikes_is_heard_at_its_speed() {
    for response in [Response::Impulse, Response::EventDriven, Response::SoftStep] {
        let mut app = scene::app();
        app.world_mut().resource_mut::<TawModel>().response = response;
        app.insert_resource(Gravity(Vec3::ZERO)).add_message::<ContactHit>();
        let plate = Wall::from(Cuboid::new(0.1, 1.0, 1.0));
        let plate = app.world_mut().spawn((plate, Transform::from_xyz(-1.02, 0.0, 0.0))).id();
        scene::drop_marble(&mut app, 0.2, Vec3::ZERO);
        app.add_systems(
            FixedUpdate,
            (move |mut places: Query<&mut Transform>, time: Res<Time>| {
                places.get_mut(plate).unwrap().translation.x += 4.0 * time.delta_secs();
            })
            .before(TawSystems::Gather),
        );
        let mut hits = Vec::new();
        for _ in 0..20 {
            app.update();
            let messages = app.world().resource::<Messages<ContactHit>>();
            hits.extend(messages.iter_current_update_messages().map(|hit| hit.approach_speed));
        }
        assert!((hits[0] - 4.0).abs() < 0.05, "{response:?}: {hits:?}");
    }
}

/// Whoever plays a sound for each hit hears all bounces, however slow.
#[test]
fn every_bounce_off_a_rail_is_heard_at_its_speed() {
    for (response, substeps) in
        [(Response::Impulse, 4), (Response::EventDriven, 1), (Response::SoftStep, 4)]
    {
        let mut bounced = 0;
        for case in 0..60 {
            let speed = 0.02 + scene::random(case);
            let mut app = scene::app();
            let model = Model { response, substeps, ..Model::GAME };
            app.insert_resource(TawModel(model)).add_message::<ContactHit>();
            scene::floor(&mut app);
            let rail = Wall::HalfSpace(Dir3::NEG_X);
            let rail = app.world_mut().spawn((rail, Transform::from_xyz(0.2, 0.0, 0.0))).id();
            let marble = scene::drop_marble(&mut app, 0.1, Vec3::new(0.05, 0.1, 0.0));
            let surface = SurfaceMaterial { restitution: 0.7, friction: 0.0, ..default() };
            app.world_mut().entity_mut(marble).insert((Velocity(Vec3::X * speed), surface));
            let mut hits = Vec::new();
            for _ in 0..200 {
                app.update();
                let messages = app.world().resource::<Messages<ContactHit>>();
                hits.extend(messages.iter_current_update_messages().copied());
            }
            let after = app.world().get::<Velocity>(marble).unwrap().x;
            let case = format!("{response:?}, {speed} m/s, {after} m/s after it: {hits:?}");
            assert!(hits.iter().all(|hit| hit.pair.a == rail), "{case}");
            if after < -0.01 * speed {
                bounced += 1;
                assert_eq!(hits.len(), 1, "{case}");
                assert!((hits[0].approach_speed / speed - 1.0).abs() < 0.02, "{case}");
            }
        }
        assert!(bounced > 50, "{response:?}: {bounced}");
    }
}

#[test]
fn what_lies_is_not_heard() {
    for response in [Response::Impulse, Response::EventDriven, Response::SoftStep] {
        for restitution in [0.0, 0.5] {
            let mut app = scene::app();
            let substeps = if response == Response::EventDriven { 1 } else { 4 };
            let model = Model { response, substeps, ..Model::GAME };
            app.insert_resource(TawModel(model)).add_message::<ContactHit>();
            scene::floor(&mut app);
            for side in [Dir3::X, Dir3::NEG_X, Dir3::Z, Dir3::NEG_Z] {
                let place = Transform::from_translation(side * -0.3);
                app.world_mut().spawn((Wall::HalfSpace(side), place));
            }
            let marbles = scene::drop_marbles(&mut app, 30);
            for (i, marble) in (0_u8..).zip(&marbles) {
                let at = Vec3::new(0.1 * f32::from(i % 3) - 0.1, 0.2 * f32::from(i), 0.01);
                let surface =
                    SurfaceMaterial { restitution, rolling_resistance: 0.05, ..default() };
                let place = Transform::from_translation(at + Vec3::Y * 0.1);
                app.world_mut().entity_mut(*marble).insert((Marble::new(0.09), surface, place));
            }
            scene::frames(&mut app, 1_000);
            let mut hits = Vec::new();
            for _ in 0..64 {
                app.update();
                let messages = app.world().resource::<Messages<ContactHit>>();
                hits.extend(messages.iter_current_update_messages().map(|hit| hit.approach_speed));
            }
            assert!(hits.is_empty(), "{response:?}, restitution {restitution}: {hits:?}");
        }
    }
}

/// It goes up and down by .2 m with 2 m/s² at most.
#[test]
fn what_rides_on_a_lift_is_not_heard() {
    for (response, substeps) in
        [(Response::Impulse, 4), (Response::EventDriven, 1), (Response::SoftStep, 4)]
    {
        let mut app = scene::app();
        let model = Model { response, substeps, ..Model::GAME };
        app.insert_resource(TawModel(model)).add_message::<ContactHit>();
        let lift = app.world_mut().spawn((Wall::from(Cuboid::new(2.0, 0.2, 2.0)), Kinematic)).id();
        scene::drop_marble(&mut app, 0.1, Vec3::new(-0.3, 0.2, 0.0));
        scene::drop_marble(&mut app, 0.1, Vec3::new(0.3, 0.2, 0.0));
        app.add_systems(
            FixedUpdate,
            (move |mut places: Query<&mut Transform>, time: Res<Time>| {
                let phase = std::f32::consts::PI * time.elapsed_secs();
                places.get_mut(lift).unwrap().translation.y = 0.2 * (1.0 - phase.cos());
            })
            .before(TawSystems::Gather),
        );
        scene::frames(&mut app, 64);
        let mut hits = Vec::new();
        for _ in 0..256 {
            app.update();
            let messages = app.world().resource::<Messages<ContactHit>>();
            hits.extend(messages.iter_current_update_messages().map(|hit| hit.approach_speed));
        }
        assert!(hits.is_empty(), "{response:?}: {hits:?}");
    }
}

/// An observer that goes and comes back hears of no contact that ended meanwhile.
#[test]
fn who_listens_again_hears_nothing_stale() {
    #[derive(Resource, Default)]
    struct Ended(u32);
    let mut app = scene::app();
    app.init_resource::<Ended>();
    scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    let count = |_: On<ContactEnded>, mut ended: ResMut<Ended>| ended.0 += 1;
    app.add_observer(count);
    let observers: Vec<_> = app
        .world_mut()
        .query_filtered::<Entity, With<bevy::ecs::observer::Observer>>()
        .iter(app.world())
        .collect();
    scene::frames(&mut app, 5);
    // Away while nobody listens, and back.
    let ours = *observers.last().expect("it was added");
    app.world_mut().despawn(ours);
    app.world_mut().get_mut::<Transform>(marble).unwrap().translation.y = 9.0;
    scene::frames(&mut app, 3);
    app.add_observer(count);
    scene::frames(&mut app, 3);
    assert_eq!(app.world().resource::<Ended>().0, 0);
}

/// The end face of a belt pushes nobody, so what stands at it is not hit.
#[test]
fn the_end_of_a_belt_hits_nobody() {
    let mut app = scene::app();
    let model = Model { response: Response::Impulse, ..Model::GAME };
    app.insert_resource(TawModel(model)).add_message::<ContactHit>();
    scene::floor(&mut app);
    let belt = (Wall::from(Cuboid::new(2.0, 1.0, 2.0)), SurfaceVelocity(Vec3::X * 2.0));
    app.world_mut().spawn((belt, Transform::from_xyz(0.0, 0.5, 0.0)));
    scene::drop_marble(&mut app, 0.1, Vec3::new(1.1, 0.1, 0.0));
    for _ in 0..30 {
        app.update();
        let messages = app.world().resource::<Messages<ContactHit>>();
        assert_eq!(messages.iter_current_update_messages().count(), 0);
    }
}

/// Though its place is still that of one that touches: it has fallen two millimetres.
#[test]
fn a_pair_that_passes_through_each_other_touches_no_longer() {
    let ways: [fn(&mut App, [Entity; 2]); 4] = [
        |app, [wall, marble]| {
            app.world_mut().entity_mut(marble).insert(IgnoreCollisions(vec![wall]));
        },
        |app, [_, marble]| {
            app.world_mut().entity_mut(marble).insert(ColliderDisabled::default());
        },
        |app, [wall, _]| {
            app.world_mut().entity_mut(wall).insert(CollisionLayers::NONE);
        },
        |app, [wall, _]| {
            app.world_mut().entity_mut(wall).insert(OneWay(Dir3::NEG_Y));
        },
    ];
    for (case, pass) in ways.into_iter().enumerate() {
        for response in [Response::Impulse, Response::EventDriven, Response::SoftStep] {
            let mut app = listening_app();
            app.world_mut().resource_mut::<TawModel>().response = response;
            let floor = scene::floor(&mut app);
            let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
            scene::frames(&mut app, 64);
            assert_eq!(told(&mut app).last(), Some(&('o', floor, marble)), "{case}, {response:?}");
            pass(&mut app, [floor, marble]);
            scene::frames(&mut app, 3);
            assert_eq!(told(&mut app), [('e', floor, marble)], "{case}, {response:?}");
        }
    }
}

#[test]
fn two_marbles_of_which_one_names_the_other_touch_no_longer() {
    let mut app = listening_app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let [a, b] = [0.0, 1.0].map(|x| scene::drop_marble(&mut app, 0.5, Vec3::X * x));
    scene::frames(&mut app, 3);
    assert_eq!(told(&mut app).last(), Some(&('o', a.min(b), a.max(b))));
    app.world_mut().entity_mut(a).insert(IgnoreCollisions(vec![b]));
    scene::frames(&mut app, 3);
    assert_eq!(told(&mut app), [('e', a.min(b), a.max(b))]);
}
