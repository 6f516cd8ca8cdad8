//! Sensors: who enters, who leaves, who is inside.

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::message::Messages;
use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene;

const RESPONSES: [Response; 4] =
    [Response::Displacement, Response::Impulse, Response::EventDriven, Response::SoftStep];

/// Sensor events, in order.
#[derive(Resource, Default)]
struct Told(Vec<(bool, Entity, Entity)>);

fn listen(
    mut told: ResMut<Told>,
    mut entered: MessageReader<SensorEntered>,
    mut left: MessageReader<SensorLeft>,
) {
    // Of one step: who passed through entered first.
    told.0.extend(entered.read().map(|it| (true, it.sensor, it.collider)));
    told.0.extend(left.read().map(|it| (false, it.sensor, it.collider)));
}

fn app(response: Response) -> App {
    let mut app = scene::app();
    app.world_mut().resource_mut::<TawModel>().response = response;
    app.insert_resource(Gravity(Vec3::ZERO))
        .init_resource::<Told>()
        .add_systems(FixedUpdate, listen.after(TawSystems::Scatter));
    app
}

fn told(app: &mut App) -> Vec<(bool, Entity, Entity)> {
    std::mem::take(&mut app.world_mut().resource_mut::<Told>().0)
}

fn gate(app: &mut App, size: Vec3, at: Vec3) -> Entity {
    let wall = Wall::from(Cuboid::from_size(size));
    app.world_mut().spawn((wall, Sensor, Transform::from_translation(at))).id()
}

fn shoot(app: &mut App, radius: f32, at: Vec3, velocity: Vec3) -> Entity {
    let marble = scene::drop_marble(app, radius, at);
    app.world_mut().entity_mut(marble).insert(Velocity(velocity));
    marble
}

fn throw(app: &mut App, at: Vec3, velocity: Vec3) -> Entity {
    let body = Body::from(Cuboid::from_length(0.1));
    app.world_mut().spawn((body, Velocity(velocity), Transform::from_translation(at))).id()
}

fn inside(app: &App, sensor: Entity) -> Vec<Entity> {
    app.world().get::<CollidingEntities>(sensor).unwrap().to_vec()
}

#[test]
fn a_gate_notices_marbles_of_any_speed_and_stops_none() {
    for response in RESPONSES {
        for rate in [10.0, 60.0, 1000.0] {
            for speed in [0.5, 5.0, 100.0, 300.0_f32] {
                let mut app = app(response);
                app.insert_resource(Time::<Fixed>::from_hz(rate));
                let gate = gate(&mut app, Vec3::new(0.002, 2.0, 2.0), Vec3::ZERO);
                let start = -0.3 - 0.1 * speed.sqrt();
                let marble = shoot(&mut app, 0.05, Vec3::X * start, Vec3::X * speed);
                scene::frames(&mut app, (64.0 * (1.0 - start) / speed) as u32 + 20);
                let case = format!("{response:?} at {rate} Hz, {speed} m/s");
                assert_eq!(told(&mut app), [(true, gate, marble), (false, gate, marble)], "{case}");
                let velocity = app.world().get::<Velocity>(marble).unwrap();
                assert_eq!(**velocity, Vec3::X * speed, "{case}");
                assert!(inside(&app, gate).is_empty(), "{case}");
            }
        }
    }
}

#[test]
fn a_gate_notices_bodies_of_any_speed_and_stops_none() {
    for speed in [0.5, 5.0, 100.0, 300.0_f32] {
        let mut app = app(Response::SoftStep);
        let gate = gate(&mut app, Vec3::new(0.002, 2.0, 2.0), Vec3::ZERO);
        let start = -0.3 - 0.1 * speed.sqrt();
        let body = throw(&mut app, Vec3::X * start, Vec3::X * speed);
        scene::frames(&mut app, (64.0 * (1.0 - start) / speed) as u32 + 20);
        assert_eq!(told(&mut app), [(true, gate, body), (false, gate, body)], "{speed} m/s");
        let velocity = app.world().get::<Velocity>(body).unwrap();
        assert_eq!(**velocity, Vec3::X * speed, "{speed} m/s");
        assert!(inside(&app, gate).is_empty(), "{speed} m/s");
    }
}

/// However a body goes, it leaves the sensor, and those beside it stay.
#[test]
fn a_body_that_goes_leaves_the_sensor() {
    type Deed = fn(&mut App, Entity);
    let deeds: [(&str, Deed); 5] = [
        ("despawned", |app, body| {
            app.world_mut().despawn(body);
        }),
        ("disabled", |app, body| {
            app.world_mut().entity_mut(body).insert(Disabled);
        }),
        ("no body", |app, body| {
            app.world_mut().entity_mut(body).remove::<Body>();
        }),
        ("elsewhere", |app, body| {
            app.world_mut().get_mut::<Transform>(body).unwrap().translation = Vec3::X * 9.0;
        }),
        ("no layers", |app, body| {
            app.world_mut().entity_mut(body).insert(CollisionLayers::NONE);
        }),
    ];
    for (name, deed) in deeds {
        let mut app = app(Response::SoftStep);
        let zone = gate(&mut app, Vec3::splat(2.0), Vec3::ZERO);
        let marble = scene::drop_marble(&mut app, 0.1, Vec3::X * -0.5);
        let body = throw(&mut app, Vec3::X * 0.5, Vec3::ZERO);
        app.update();
        assert_eq!(told(&mut app), [(true, zone, marble), (true, zone, body)], "{name}");
        let mut both = [marble, body];
        both.sort_unstable();
        assert_eq!(inside(&app, zone), both, "{name}");
        deed(&mut app, body);
        scene::frames(&mut app, 3);
        assert_eq!(told(&mut app), [(false, zone, body)], "{name}");
        assert_eq!(inside(&app, zone), [marble], "{name}");
        if name == "disabled" {
            app.world_mut().entity_mut(body).remove::<Disabled>();
            scene::frames(&mut app, 3);
            assert_eq!(told(&mut app), [(true, zone, body)], "enabled again");
            assert_eq!(inside(&app, zone), both);
        }
    }
}

#[test]
fn who_is_inside_is_listed_until_it_leaves_or_is_gone() {
    let mut app = app(Response::Impulse);
    let zone = gate(&mut app, Vec3::splat(2.0), Vec3::ZERO);
    let stays = scene::drop_marble(&mut app, 0.1, Vec3::ZERO);
    let goes = shoot(&mut app, 0.1, Vec3::Y * 0.5, Vec3::Y * 4.0);
    let dies = scene::drop_marble(&mut app, 0.1, Vec3::Z * 0.5);
    app.update();
    let mut all = vec![stays, goes, dies];
    all.sort_unstable();
    assert_eq!(inside(&app, zone), all);
    told(&mut app);
    scene::frames(&mut app, 20);
    assert_eq!(told(&mut app), [(false, zone, goes)]);
    app.world_mut().despawn(dies);
    app.update();
    assert_eq!(told(&mut app), [(false, zone, dies)]);
    assert_eq!(inside(&app, zone), [stays]);
    // A jump across meets nothing; one into it enters.
    app.world_mut().get_mut::<Transform>(stays).unwrap().translation = Vec3::X * -9.0;
    app.update();
    assert_eq!(told(&mut app), [(false, zone, stays)]);
    app.world_mut().get_mut::<Transform>(stays).unwrap().translation = Vec3::X * 9.0;
    app.update();
    assert_eq!(told(&mut app), []);
    app.world_mut().get_mut::<Transform>(stays).unwrap().translation = Vec3::ZERO;
    app.update();
    assert_eq!(told(&mut app), [(true, zone, stays)]);
}

#[test]
fn a_sensor_moves_with_what_carries_it() {
    for response in RESPONSES {
        let mut app = app(response);
        let marble = scene::drop_marble(&mut app, 0.1, Vec3::ZERO);
        let cart = app.world_mut().spawn(Transform::from_xyz(-2.0, 0.0, 0.0)).id();
        let wall = Wall::from(Cuboid::new(0.01, 1.0, 1.0));
        let gate = app.world_mut().spawn((wall, Sensor, ChildOf(cart))).id();
        app.add_systems(
            FixedUpdate,
            (move |mut places: Query<&mut Transform>, time: Res<Time>| {
                places.get_mut(cart).unwrap().translation.x += 9.0 * time.delta_secs();
            })
            .before(TawSystems::Gather),
        );
        scene::frames(&mut app, 32);
        assert_eq!(told(&mut app), [(true, gate, marble), (false, gate, marble)], "{response:?}");
        assert_eq!(scene::position(&app, marble), Vec3::ZERO);
    }
}

#[test]
fn a_wall_becomes_a_sensor_and_a_wall_again() {
    let mut app = app(Response::SoftStep);
    app.insert_resource(Gravity(Vec3::NEG_Y * 9.81));
    let floor = scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    scene::frames(&mut app, 10);
    assert!((scene::position(&app, marble).y - 0.5).abs() < 0.01);
    assert_eq!(told(&mut app), []);
    app.world_mut().entity_mut(floor).insert(Sensor);
    scene::frames(&mut app, 10);
    assert!(scene::position(&app, marble).y < 0.45, "it falls through");
    assert_eq!(told(&mut app), [(true, floor, marble)]);
    assert_eq!(inside(&app, floor), [marble]);
    app.world_mut().entity_mut(floor).remove::<Sensor>();
    scene::frames(&mut app, 100);
    assert!((scene::position(&app, marble).y - 0.5).abs() < 0.01, "it is borne again");
    app.world_mut().entity_mut(floor).insert(Sensor).remove::<Wall>();
    scene::frames(&mut app, 5);
    assert!(app.world().resource::<TawWorld>().walls.is_empty());
    assert!(app.world().resource::<TawWorld>().sensors.is_empty());
    let zone = gate(&mut app, Vec3::ONE, Vec3::ZERO);
    app.update();
    assert_eq!(app.world().resource::<TawWorld>().sensors.len(), 1);
    app.world_mut().despawn(zone);
    app.update();
    assert!(app.world().resource::<TawWorld>().sensors.is_empty());
}

#[test]
fn layers_observers_and_snapshots() {
    #[derive(Resource, Default)]
    struct Seen(Vec<Entity>);
    let mut app = app(Response::Impulse);
    app.init_resource::<Seen>();
    let zone = gate(&mut app, Vec3::splat(2.0), Vec3::ZERO);
    app.world_mut()
        .entity_mut(zone)
        .insert(CollisionLayers::new(LayerMask::ALL, 1_u32))
        .observe(|it: On<SensorEntered>, mut seen: ResMut<Seen>| seen.0.push(it.collider));
    let unseen = scene::drop_marble(&mut app, 0.1, Vec3::Y * 0.4);
    app.world_mut().entity_mut(unseen).insert(CollisionLayers::new(2_u32, LayerMask::ALL));
    app.update();
    let saved = app.world().resource::<TawWorld>().snapshot();
    let marble = shoot(&mut app, 0.1, Vec3::X * 1.5, Vec3::NEG_X);
    scene::frames(&mut app, 60);
    assert_eq!(app.world().resource::<Seen>().0, [marble]);
    assert_eq!(inside(&app, zone), [marble]);
    assert_eq!(app.world().resource::<Messages<SensorLeft>>().len(), 0);
    app.world_mut().resource_mut::<TawWorld>().restore(&saved);
    scene::frames(&mut app, 1);
    assert_eq!(app.world().resource::<TawWorld>().sensors.len(), 1);
    assert!(!inside(&app, zone).contains(&unseen), "its layers are not sensed");
    // A restored marble that was inside then leaves, and is told.
    let inside_then = app.world().resource::<TawWorld>().snapshot();
    app.world_mut().get_mut::<Transform>(marble).unwrap().translation = Vec3::X * 9.0;
    scene::frames(&mut app, 2);
    assert!(inside(&app, zone).is_empty());
    app.world_mut().resource_mut::<TawWorld>().restore(&inside_then);
    scene::frames(&mut app, 1);
    assert_eq!(inside(&app, zone).contains(&marble), {
        scene::position(&app, marble).x.abs() < 1.1
    });
    app.world_mut().entity_mut(zone).remove::<CollisionLayers>();
    scene::frames(&mut app, 3);
    assert!(inside(&app, zone).contains(&unseen));
}

#[test]
fn a_sensor_that_comes_back_lists_nobody_who_is_gone() {
    let mut app = app(Response::Impulse);
    let zone = gate(&mut app, Vec3::splat(2.0), Vec3::ZERO);
    let marble = scene::drop_marble(&mut app, 0.1, Vec3::ZERO);
    app.update();
    assert_eq!(inside(&app, zone), [marble]);
    // Removed and inserted before anybody looks.
    app.world_mut().entity_mut(zone).remove::<Sensor>();
    app.world_mut().entity_mut(zone).insert(Sensor);
    scene::frames(&mut app, 2);
    assert_eq!(inside(&app, zone), [marble]);
    app.world_mut().entity_mut(zone).remove::<Wall>();
    app.world_mut().despawn(marble);
    scene::frames(&mut app, 2);
    assert!(inside(&app, zone).is_empty());
    app.world_mut().entity_mut(zone).insert(Wall::from(Cuboid::from_length(2.0)));
    scene::frames(&mut app, 2);
    assert!(inside(&app, zone).is_empty());
    let other = scene::drop_marble(&mut app, 0.1, Vec3::ZERO);
    scene::frames(&mut app, 2);
    assert_eq!(inside(&app, zone), [other]);
}

/// However a sensor goes, who was inside leaves, so that entered minus left is who is inside.
#[test]
fn who_is_in_a_sensor_that_goes_leaves_it() {
    type Deed = fn(&mut App, Entity);
    let deeds: [(&str, Deed); 5] = [
        ("despawned", |app, zone| {
            app.world_mut().despawn(zone);
        }),
        ("disabled", |app, zone| {
            app.world_mut().entity_mut(zone).insert(Disabled);
        }),
        ("no wall", |app, zone| {
            app.world_mut().entity_mut(zone).remove::<Wall>();
        }),
        ("no sensor", |app, zone| {
            app.world_mut().entity_mut(zone).remove::<Sensor>();
        }),
        ("no layers", |app, zone| {
            app.world_mut().entity_mut(zone).insert(CollisionLayers::NONE);
        }),
    ];
    for (name, deed) in deeds {
        let mut app = app(Response::SoftStep);
        let zone = gate(&mut app, Vec3::splat(2.0), Vec3::ZERO);
        let [a, b] = [-0.5, 0.5].map(|x| scene::drop_marble(&mut app, 0.1, Vec3::X * x));
        let mut all = [a, b, throw(&mut app, Vec3::Y * 0.5, Vec3::ZERO)];
        all.sort_unstable();
        let sorted = |app: &mut App| {
            let mut told = told(app);
            told.sort_unstable();
            told
        };
        app.update();
        assert_eq!(sorted(&mut app), all.map(|it| (true, zone, it)), "{name}");
        deed(&mut app, zone);
        scene::frames(&mut app, 3);
        assert_eq!(sorted(&mut app), all.map(|it| (false, zone, it)), "{name}");
        if name == "disabled" {
            assert!(inside(&app, zone).is_empty(), "{name}");
            app.world_mut().entity_mut(zone).remove::<Disabled>();
            scene::frames(&mut app, 3);
            assert_eq!(sorted(&mut app), all.map(|it| (true, zone, it)), "enabled again");
            assert_eq!(inside(&app, zone), all);
        }
    }
}

/// A sensor that went in a step that never was.
#[test]
fn who_went_back_in_time_left_no_sensor() {
    let mut app = app(Response::SoftStep);
    let zone = gate(&mut app, Vec3::splat(2.0), Vec3::ZERO);
    let marble = scene::drop_marble(&mut app, 0.1, Vec3::ZERO);
    app.update();
    assert_eq!(told(&mut app), [(true, zone, marble)]);
    let snapshot = app.world().resource::<TawWorld>().snapshot();
    app.world_mut().despawn(zone);
    app.world_mut().resource_mut::<TawWorld>().restore(&snapshot);
    scene::frames(&mut app, 2);
    assert_eq!(told(&mut app), [(false, zone, marble)]);
}
