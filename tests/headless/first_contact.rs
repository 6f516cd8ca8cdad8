//! Games that set no model.

use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene;

/// An app as it is when nothing but the plugin is added.
fn app() -> App {
    let mut app = scene::app();
    app.insert_resource(TawModel::default());
    app
}

#[test]
fn the_default_knows_mass_friction_bounce_and_rotation() {
    let mut app = app();
    scene::floor(&mut app);
    let bouncy = SurfaceMaterial { restitution: 0.8, ..default() };
    let high = scene::drop_marble(&mut app, 0.1, Vec3::new(0.0, 1.1, 0.0));
    let rough = SurfaceMaterial { friction: 0.5, restitution: 0.0, ..default() };
    let slider = scene::drop_marble(&mut app, 0.1, Vec3::new(3.0, 0.1, 0.0));
    let (light, heavy) = (MarbleMass::Kilograms(1.0), MarbleMass::Kilograms(9.0));
    let hits = scene::drop_marble(&mut app, 0.1, Vec3::new(0.0, 0.1, 5.0));
    let hit = scene::drop_marble(&mut app, 0.1, Vec3::new(1.0, 0.1, 5.0));
    let smooth = SurfaceMaterial { friction: 0.0, restitution: 1.0, ..default() };
    let mut insert = |entity: Entity, bundle: (SurfaceMaterial, Velocity, MarbleMass)| {
        app.world_mut().entity_mut(entity).insert((bundle, AngularVelocity::default()));
    };
    insert(high, (bouncy, Velocity::default(), light));
    insert(slider, (rough, Velocity(Vec3::Z), light));
    insert(hits, (smooth, Velocity(Vec3::X * 2.0), heavy));
    insert(hit, (smooth, Velocity::default(), light));
    let mut highest = 0.0_f32;
    for frame in 0..120 {
        app.update();
        // The first bounce is after .45 s.
        if frame > 35 {
            highest = highest.max(scene::position(&app, high).y - 0.1);
        }
    }
    assert!((highest - 0.64).abs() < 0.02, "bounces {highest} m high");
    // Five sevenths of the speed are left when friction has made it roll.
    let velocity = |entity| **app.world().get::<Velocity>(entity).unwrap();
    let spin = **app.world().get::<AngularVelocity>(slider).unwrap();
    assert!((velocity(slider).z - 5.0 / 7.0).abs() < 0.01, "rolls at {}", velocity(slider));
    assert!((spin.x - velocity(slider).z / 0.1).abs() < 0.1, "turns at {spin}");
    let momentum = velocity(hits) * 9.0 + velocity(hit);
    assert!((momentum.x - 18.0).abs() < 0.01, "momentum {momentum}");
    assert!((velocity(hits).x - 1.6).abs() < 0.02 && (velocity(hit).x - 3.6).abs() < 0.02);
}

#[test]
fn by_default_nothing_tunnels_and_a_tilting_board_keeps_its_marbles() {
    let mut app = app();
    let board = scene::board(&mut app);
    let plate = Wall::from(Cuboid::new(0.02, 2.0, 2.0));
    app.world_mut().spawn((plate, Transform::from_xyz(30.0, 1.0, 0.0)));
    let fast = scene::drop_marble(&mut app, 0.1, Vec3::new(29.0, 1.0, 0.0));
    app.world_mut().entity_mut(fast).insert((Velocity(Vec3::X * 300.0), GravityScale(0.0)));
    let marbles = scene::drop_marbles(&mut app, 60);
    let tilt = move |time: Res<Time>, mut transforms: Query<&mut Transform>| {
        let angle = 0.2 * (time.elapsed_secs() * 1.5).sin();
        transforms.get_mut(board).unwrap().rotation = Quat::from_rotation_z(angle);
    };
    app.add_systems(Update, tilt);
    scene::frames(&mut app, 640);
    assert!(scene::position(&app, fast).x < 30.0);
    let frame = *app.world().get::<Transform>(board).unwrap();
    for marble in marbles {
        let place = frame.rotation.inverse() * scene::position(&app, marble);
        assert!(place.x.abs() < scene::HALF && place.z.abs() < scene::HALF, "{place}");
        assert!((0.1..4.0).contains(&place.y), "{place}");
    }
}

#[test]
fn components_that_the_model_ignores_are_named() {
    let mut app = app();
    let ignored = |app: &App| app.world().resource::<IgnoredComponents>().to_vec();
    let marble = scene::drop_marble(&mut app, 0.1, Vec3::ZERO);
    let optional =
        (SurfaceMaterial::default(), MarbleMass::Kilograms(2.0), AngularVelocity::default());
    app.world_mut().entity_mut(marble).insert((optional, MarbleRotation::default()));
    app.update();
    assert_eq!(ignored(&app), [""; 0]);
    app.world_mut().entity_mut(marble).insert(MarbleIntegrator::default());
    app.update();
    assert_eq!(ignored(&app), ["MarbleIntegrator"]);
    app.insert_resource(TawModel(Model::default()));
    app.update();
    assert_eq!(
        ignored(&app),
        ["SurfaceMaterial", "MarbleMass", "AngularVelocity", "MarbleRotation"]
    );
    app.insert_resource(TawModel(Model::EXACT));
    app.update();
    assert_eq!(ignored(&app), [""; 0]);
}

#[test]
fn forces_that_the_response_does_not_know_and_sleep_that_nobody_has_are_named() {
    let mut app = app();
    let floor = scene::floor(&mut app);
    app.world_mut().entity_mut(floor).insert(ContactForce::default());
    let marble = scene::drop_marble(&mut app, 0.1, Vec3::Y);
    app.world_mut().entity_mut(marble).insert(SleepingDisabled);
    let mut ignored = |response: Response, sleeps: bool| {
        app.insert_resource(TawModel(Model { response, ..Model::GAME }));
        app.insert_resource(TawSwarmModel(SwarmModel { sleeps, ..SwarmModel::default() }));
        scene::frames(&mut app, 2);
        app.world().resource::<IgnoredComponents>().to_vec()
    };
    assert_eq!(ignored(Response::SoftStep, true), [""; 0]);
    assert_eq!(ignored(Response::Impulse, true), [""; 0]);
    let law = ContactLaw::HertzMindlin;
    assert_eq!(ignored(Response::Penalty(law), false), ["SleepingDisabled"]);
    assert_eq!(ignored(Response::Displacement, true), ["ContactForce"]);
    assert_eq!(ignored(Response::EventDriven, true), ["ContactForce of what rests"]);
    // Those of marbles on walls.
    let of_marbles = (
        Grounded::default(),
        IgnoreCollisions::default(),
        ColliderDisabled::default(),
        SleepingDisabled,
    );
    app.world_mut().entity_mut(floor).remove::<ContactForce>().insert(of_marbles);
    scene::frames(&mut app, 2);
    let expected = ["Grounded", "IgnoreCollisions", "ColliderDisabled", "SleepingDisabled"];
    let found = app.world().resource::<IgnoredComponents>().to_vec();
    assert_eq!(found, expected.map(|name| format!("{name} of a wall")));
}

#[test]
fn settings_that_the_response_ignores_are_named() {
    let mut app = app();
    let mut ignored = |model: Model| {
        app.insert_resource(TawModel(model));
        app.update();
        app.world().resource::<IgnoredComponents>().to_vec()
    };
    let all = Model {
        integrator: Integrator::VelocityVerlet,
        precision: Precision::Compensated,
        detection: Detection::Discrete,
        ..Model::GAME
    };
    assert_eq!(ignored(Model::GAME), [""; 0]);
    assert_eq!(ignored(all), ["Model::integrator", "Model::precision", "Model::detection"]);
    let exact = Model { response: Response::EventDriven, ..all };
    assert_eq!(ignored(exact), ["Model::detection"]);
    assert_eq!(ignored(Model { response: Response::Impulse, ..all }), [""; 0]);
}

#[test]
fn an_integrator_has_an_effect_where_forces_act() {
    let mut app = app();
    let marble = scene::drop_marble(&mut app, 0.1, Vec3::ZERO);
    app.world_mut().entity_mut(marble).insert(MarbleIntegrator::default());
    let mut ignored = |forces: Vec<ForceField<f32>>| {
        app.insert_resource(Forces(forces));
        app.update();
        app.world().resource::<IgnoredComponents>().to_vec()
    };
    assert_eq!(ignored(Vec::new()), ["MarbleIntegrator"]);
    let anchor = [0.0; 3].into();
    let spring = ForceField::Spring { anchor, rest_length: 0.0, stiffness: 1.0 };
    assert_eq!(ignored(vec![spring]), [""; 0]);
}

#[test]
fn components_where_they_have_no_effect_are_named() {
    let mut app = app();
    let ignored = |app: &App| app.world().resource::<IgnoredComponents>().to_vec();
    let floor = scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.1, Vec3::Y);
    app.world_mut().entity_mut(floor).insert((Sensor, OneWay::default(), Kinematic));
    app.world_mut().entity_mut(marble).insert((Velocity::default(), GravityScale::default()));
    app.update();
    assert_eq!(ignored(&app), [""; 0]);
    app.world_mut().entity_mut(floor).insert((Velocity::default(), HalfLength(1.0)));
    app.world_mut().entity_mut(marble).insert(OneWay::default());
    let sensor = app.world_mut().spawn((Sensor, Transform::from_xyz(0.0, 1.0, 0.0))).id();
    app.update();
    let expected = [
        "Velocity of a wall",
        "HalfLength of a wall",
        "OneWay of a marble",
        "Sensor or zone without a Wall",
    ];
    assert_eq!(ignored(&app), expected);
    assert_eq!(app.world().resource::<TawWorld>().sensors.len(), 1, "the floor only");
    app.world_mut().entity_mut(sensor).insert(Wall::from(Cuboid::default()));
    app.world_mut().entity_mut(floor).remove::<(Velocity, HalfLength)>();
    app.world_mut().entity_mut(marble).remove::<OneWay>();
    app.update();
    assert_eq!(ignored(&app), [""; 0]);
    assert_eq!(app.world().resource::<TawWorld>().sensors.len(), 2);
    app.world_mut().entity_mut(floor).insert((Velocity::default(), Disabled));
    app.update();
    assert_eq!(ignored(&app), [""; 0], "whoever is disabled has no effect anyway");
    let other = scene::floor(&mut app);
    app.world_mut().entity_mut(other).insert(MarbleMass::default());
    app.insert_resource(TawModel(Model::default()));
    app.update();
    assert_eq!(ignored(&app), ["MarbleMass of a wall"], "no marble has a mass");
}

#[test]
fn a_spawner_at_one_point_makes_a_heap_and_no_tower() {
    let mut app = app();
    scene::floor(&mut app);
    let mut marbles = Vec::new();
    for _ in 0..60 {
        marbles.push(scene::drop_marble(&mut app, 0.1, Vec3::new(0.0, 8.0, 0.0)));
        scene::frames(&mut app, 16);
    }
    scene::frames(&mut app, 128);
    let highest = marbles.iter().map(|it| scene::position(&app, *it).y).fold(0.0, f32::max);
    assert!(highest < 1.0, "{highest} m high");
}

#[test]
fn a_marble_beyond_the_limits_is_refused_by_name_and_the_others_go_on() {
    let far = |app: &mut App, entity: Entity| {
        app.world_mut().get_mut::<Transform>(entity).unwrap().translation.x = 1e13;
    };
    let fast = |app: &mut App, entity: Entity| {
        app.world_mut().entity_mut(entity).insert(Velocity(Vec3::X * 1e13));
    };
    let hit = |app: &mut App, entity: Entity| {
        let impulse = ExternalImpulse { impulse: Vec3::X * 1e20, ..default() };
        app.world_mut().entity_mut(entity).insert(impulse);
    };
    let whirl = |app: &mut App, entity: Entity| {
        app.world_mut().entity_mut(entity).insert(AngularVelocity(Vec3::X * 1e14));
    };
    let ways: [&dyn Fn(&mut App, Entity); 4] = [&far, &fast, &hit, &whirl];
    for (i, go) in ways.iter().enumerate() {
        let mut app = app();
        let bystander = scene::drop_marble(&mut app, 0.1, Vec3::Y * 40.0);
        let bad = [1.0, 2.0].map(|x| scene::drop_marble(&mut app, 0.1, Vec3::X * x));
        scene::frames(&mut app, 3);
        for marble in bad {
            go(&mut app, marble);
        }
        let mut told = Vec::new();
        for _ in 0..64 {
            app.update();
            let messages = app.world().resource::<Messages<InputRefused>>();
            told.extend(messages.iter_current_update_messages().map(|it| it.entity));
        }
        assert!(
            told.len() == 2 && bad.iter().all(|bad| told.contains(&Some(*bad))),
            "{i}: {told:?}"
        );
        let y = scene::position(&app, bystander).y;
        assert!((y - 40.0 + 0.5 * 9.81 * 1.05_f32.powi(2)).abs() < 0.2, "{i}: at {y}");
        // Set right, it is there again.
        let right =
            (Velocity::default(), AngularVelocity::default(), Transform::from_xyz(5.0, 0.0, 0.0));
        app.world_mut().entity_mut(bad[0]).insert(right);
        scene::frames(&mut app, 32);
        assert!(scene::position(&app, bad[0]).y < -0.5, "{i}");
    }
}

#[test]
fn a_model_that_a_capsule_forbids_is_refused_each_time() {
    let mut app = app();
    app.insert_resource(TawModel(Model { response: Response::Impulse, ..Model::GAME }));
    let capsule = scene::drop_marble(&mut app, 0.1, Vec3::ZERO);
    app.world_mut().entity_mut(capsule).insert(HalfLength(0.3));
    app.update();
    for model in [Model::GAME, Model::EXACT] {
        app.insert_resource(TawModel(model));
        app.update();
        let refused = app.world().resource::<Messages<InputRefused>>();
        let refused: Vec<_> = refused.iter_current_update_messages().copied().collect();
        let error = Refusal::ModelOfBalls(model.response);
        assert_eq!(refused, [InputRefused { entity: Some(capsule), error }]);
        assert_eq!(app.world().resource::<TawWorld>().model().response, Response::Impulse);
    }
}
