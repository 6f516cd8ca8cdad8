//! Forces of contacts: on components, and in messages.

use bevy::ecs::message::Messages;
use bevy::prelude::*;
use bevy_taw::prelude::*;
use taw::response::{ContactLaw, Response};

use crate::scene;

/// Weight of a marble of glass, in N.
fn weight(app: &App, marble: Entity) -> f32 {
    let radius = app.world().get::<Marble>(marble).unwrap().radius;
    taw::world::Mass::<f32>::default().of(radius) * 9.81
}

fn force(app: &App, entity: Entity) -> ContactForce {
    *app.world().get::<ContactForce>(entity).unwrap()
}

/// A scale reads the weight of what lies on it, awake and asleep, and nothing when it is gone.
#[test]
fn a_floor_bears_the_weight_of_a_stack() {
    let penalty = Response::Penalty(ContactLaw::SpringDashpot);
    for response in [Response::SoftStep, Response::Impulse, penalty] {
        let mut app = scene::app();
        let detection = taw::world::Detection::Discrete;
        *app.world_mut().resource_mut::<TawModel>() =
            TawModel(Model { response, detection, ..Model::GAME });
        let floor = scene::floor(&mut app);
        app.world_mut().entity_mut(floor).insert(ContactForce::default());
        let lower = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
        let upper = scene::drop_marble(&mut app, 0.25, Vec3::Y * 1.25);
        app.world_mut().entity_mut(lower).insert(ContactForce::default());
        // Springs swing for a while.
        scene::frames(&mut app, if response == penalty { 300 } else { 20 });
        for frames in [0, 100] {
            scene::frames(&mut app, frames);
            let both = weight(&app, lower) + weight(&app, upper);
            let ContactForce { total, pressure } = force(&app, floor);
            assert!((total.y / -both - 1.0).abs() < 0.02, "{response:?}: {total} {both}");
            assert!((pressure / both - 1.0).abs() < 0.02, "{response:?}: {pressure} {both}");
            // From below by both weights, from above by one.
            let of_lower = force(&app, lower);
            assert!((of_lower.total.y / weight(&app, lower) - 1.0).abs() < 0.05, "{of_lower:?}");
            let squeezed = both + weight(&app, upper);
            assert!((of_lower.pressure / squeezed - 1.0).abs() < 0.02, "{of_lower:?}");
        }
        if response != penalty {
            assert!(app.world().get::<Sleeping>(lower).is_some(), "{response:?}");
        }
        app.world_mut().despawn(lower);
        app.world_mut().despawn(upper);
        scene::frames(&mut app, 2);
        assert_eq!(force(&app, floor), ContactForce::default(), "{response:?}");
    }
}

#[derive(Resource, Default)]
struct Forces(Vec<f32>);

/// Messages tell the force of what goes on, and the impulse of a hit: momentum before and after.
#[test]
fn messages_have_impulses_and_forces() {
    for response in [Response::SoftStep, Response::Impulse, Response::EventDriven] {
        let mut app = scene::app();
        let keep = |ongoing: On<ContactOngoing>, mut forces: ResMut<Forces>| {
            forces.0.push(ongoing.force.y);
        };
        app.add_message::<ContactHit>().init_resource::<Forces>();
        *app.world_mut().resource_mut::<TawModel>() = TawModel(Model { response, ..Model::GAME });
        let floor = scene::floor(&mut app);
        let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 2.5);
        let bouncy = SurfaceMaterial { restitution: 0.5, ..default() };
        app.world_mut().entity_mut(marble).insert(bouncy);
        app.world_mut().entity_mut(floor).observe(keep);
        let mut hits = Vec::new();
        for _ in 0..60 {
            app.update();
            let mut messages = app.world_mut().resource_mut::<Messages<ContactHit>>();
            hits.extend(messages.drain());
        }
        let mass = weight(&app, marble) / 9.81;
        let first = hits.first().unwrap_or_else(|| panic!("{response:?}: no hit"));
        let expected = mass * first.approach_speed * 1.5;
        let (normal, part) = (first.impulse.dot(first.normal), first.part);
        assert!((normal / expected - 1.0).abs() < 0.05, "{response:?}: {normal} {expected}");
        assert!(first.slip_speed < 1e-3 && part == 0, "{first:?}");
        scene::frames(&mut app, 200);
        let forces = &app.world().resource::<Forces>().0;
        if response != Response::EventDriven {
            let last = forces.last().unwrap() / weight(&app, marble); // on the marble
            assert!((last - 1.0).abs() < 0.02, "{response:?}: {last}");
        }
    }
}

/// Impulses are recorded only while somebody reads them.
#[test]
fn nothing_is_recorded_for_nobody() {
    let mut app = scene::app();
    let floor = scene::floor(&mut app);
    let records = |app: &App| app.world().resource::<TawWorld>().records_impulses();
    scene::frames(&mut app, 2);
    assert!(!records(&app));
    app.world_mut().entity_mut(floor).insert(ContactForce::default());
    scene::frames(&mut app, 2);
    assert!(records(&app));
    app.world_mut().entity_mut(floor).remove::<ContactForce>();
    scene::frames(&mut app, 2);
    assert!(!records(&app));
}

/// A scale that comes late weighs what sleeps on it already.
#[test]
fn a_scale_that_is_added_late_reads_what_lies_on_it() {
    for response in [Response::SoftStep, Response::Impulse] {
        let mut app = scene::app();
        *app.world_mut().resource_mut::<TawModel>() = TawModel(Model { response, ..Model::GAME });
        let floor = scene::floor(&mut app);
        let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
        scene::frames(&mut app, 100);
        assert!(app.world().get::<Sleeping>(marble).is_some());
        for _ in 0..2 {
            app.world_mut().entity_mut(floor).insert(ContactForce::default());
            scene::frames(&mut app, 3);
            let off = force(&app, floor).pressure / weight(&app, marble) - 1.0;
            assert!(off.abs() < 0.02, "{response:?}: {off}");
            app.world_mut().entity_mut(floor).remove::<ContactForce>();
            scene::frames(&mut app, 100);
        }
    }
}

/// Two scales read what lay on them at the time that is restored.
#[test]
fn a_restored_world_weighs_what_it_did() {
    let mut app = scene::app();
    *app.world_mut().resource_mut::<TawModel>() = TawModel(Model::GAME);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::new(-3.0, 0.5, 0.0));
    let scales = [-3.0, 3.0].map(|x| {
        let plate = Wall::from(Cuboid::new(4.0, 1.0, 4.0));
        let at = Transform::from_xyz(x, -0.5, 0.0);
        app.world_mut().spawn((plate, at, ContactForce::default())).id()
    });
    let reads = |app: &App| scales.map(|scale| force(app, scale).pressure / weight(app, marble));
    let near = |[a, b]: [f32; 2], [c, d]: [f32; 2]| (a - c).abs() < 0.02 && (b - d).abs() < 0.02;
    scene::frames(&mut app, 150);
    assert!(near(reads(&app), [1.0, 0.0]), "{:?}", reads(&app));
    let saved = app.world().resource::<TawWorld>().snapshot();
    app.world_mut().get_mut::<Transform>(marble).unwrap().translation.x = 3.0;
    scene::frames(&mut app, 150);
    assert!(near(reads(&app), [0.0, 1.0]), "{:?}", reads(&app));
    app.world_mut().resource_mut::<TawWorld>().restore(&saved);
    scene::frames(&mut app, 3);
    assert!(near(reads(&app), [1.0, 0.0]), "{:?}", reads(&app));
}

/// Two marbles that hit each other change their momentum by the impulses on them, whoever is asked.
#[test]
fn each_of_two_has_its_impulse_with_its_sign() {
    #[derive(Resource, Default)]
    struct Told(Vec<(ContactPair, [Vec3; 3])>);
    for response in [Response::SoftStep, Response::Impulse, Response::EventDriven] {
        let mut app = scene::app();
        *app.world_mut().resource_mut::<TawModel>() = TawModel(Model { response, ..Model::GAME });
        app.insert_resource(Gravity(Vec3::ZERO)).init_resource::<Told>();
        let marbles = [-1.0, 1.0].map(|x| {
            let marble = scene::drop_marble(&mut app, 0.5, Vec3::X * 1.03 * x);
            let towards = (MarbleMass::Kilograms(2.0 + x), Velocity(Vec3::NEG_X * 4.0 * x));
            app.world_mut().entity_mut(marble).insert(towards);
            marble
        });
        let nobody = app.world_mut().spawn_empty().id();
        app.add_observer(move |hit: On<ContactHit>, mut told: ResMut<Told>| {
            told.0.push((hit.pair, [marbles[0], marbles[1], nobody].map(|it| hit.impulse_on(it))));
        });
        app.add_observer(move |start: On<ContactStarted>, mut told: ResMut<Told>| {
            let impulses = [marbles[0], marbles[1], nobody].map(|it| start.impulse_on(it));
            told.0.push((start.pair, impulses));
        });
        scene::frames(&mut app, 30);
        let momentum = |i: usize| {
            let x = [-1.0, 1.0][i];
            let velocity = **app.world().get::<Velocity>(marbles[i]).unwrap();
            (velocity - Vec3::NEG_X * 4.0 * x) * (2.0 + x)
        };
        let changes = [momentum(0), momentum(1)];
        assert!(changes[0].x < -1.0 && changes[1].x > 1.0, "{response:?}: {changes:?}");
        let told = &app.world().resource::<Told>().0;
        assert_eq!(told.len(), 4, "{response:?}: {told:#?}");
        for (pair, [a, b, other]) in told {
            assert!(pair.other(marbles[0]) == Some(marbles[1]));
            assert!((a - changes[0]).length() < 1e-3, "{response:?}: {a} {changes:?}");
            assert!((b - changes[1]).length() < 1e-3, "{response:?}: {b} {changes:?}");
            assert_eq!(*other, Vec3::ZERO);
        }
    }
}

/// A contact that goes on pushes the floor down by the weight, and the marble up.
#[test]
fn each_of_two_has_its_force_with_its_sign() {
    #[derive(Resource, Default)]
    struct Told([Vec3; 2]);
    let mut app = scene::app();
    app.insert_resource(TawModel::default()).init_resource::<Told>();
    let floor = scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    app.world_mut().entity_mut(marble).insert(SleepingDisabled);
    app.add_observer(move |goes: On<ContactOngoing>, mut told: ResMut<Told>| {
        told.0 = [floor, marble].map(|it| goes.force_on(it));
    });
    scene::frames(&mut app, 60);
    let [on_floor, on_marble] = app.world().resource::<Told>().0;
    assert_eq!(on_floor, -on_marble);
    assert!((on_marble.y / weight(&app, marble) - 1.0).abs() < 0.01, "{on_marble}");
}
