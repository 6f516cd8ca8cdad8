//! Entities that are disabled are out of the world, and come back.

use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;
use bevy_taw::prelude::*;
use bevy_taw::snapshot::RowRemoved;

use crate::scene;

#[test]
fn a_disabled_wall_holds_nothing_until_it_comes_back() {
    let mut app = scene::app();
    let (response, rotation) = (Response::Impulse, Rotation::Dynamic);
    app.insert_resource(TawModel(Model { response, rotation, ..Model::default() }));
    let floor = scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    scene::frames(&mut app, 10);
    app.world_mut().entity_mut(floor).insert(Disabled);
    scene::frames(&mut app, 20);
    let fallen = scene::position(&app, marble).y;
    assert!(fallen < 0.4, "{fallen}");
    assert!(app.world().resource::<TawWorld>().walls.is_empty());
    app.world_mut().entity_mut(floor).remove::<Disabled>();
    scene::frames(&mut app, 400);
    let lies = scene::position(&app, marble).y;
    assert!((lies - 0.5).abs() < 1e-3, "{lies}");
    assert!(app.world().resource::<Messages<RowRemoved>>().is_empty(), "that is no loss");
}

#[test]
fn a_disabled_marble_is_no_obstacle_and_comes_back_as_fast_as_it_was() {
    for (smooth, app) in [(false, scene::app()), (true, scene::smooth_app())] {
        let mut app = app;
        app.insert_resource(Gravity(Vec3::ZERO));
        scene::frame_length(&mut app, scene::STEP * if smooth { 0.7 } else { 1.0 });
        let flying = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
        let push = ExternalImpulse { impulse: Vec3::X * 8.0, ..default() };
        app.world_mut().entity_mut(flying).insert((MarbleMass::Kilograms(1.0), push));
        scene::frames(&mut app, 4);
        let x =
            |app: &App, row: usize| app.world().resource::<TawWorld>().marbles.position()[row].x;
        let before = x(&app, 0);
        app.world_mut().entity_mut(flying).insert(Disabled);
        let through =
            (Marble::new(0.5), Velocity(Vec3::X * 64.0), Transform::from_xyz(-3.0, 0.0, 0.0));
        let through = app.world_mut().spawn(through).id();
        scene::frames(&mut app, 60);
        assert_eq!(app.world().resource::<TawWorld>().marbles.len(), 1);
        assert_eq!(app.world().get::<Velocity>(through).unwrap().0, Vec3::X * 64.0);
        app.world_mut().entity_mut(flying).remove::<Disabled>();
        scene::frame_length(&mut app, scene::STEP);
        scene::frames(&mut app, 8);
        assert_eq!(app.world().resource::<TawWorld>().marbles.len(), 2);
        let moved = x(&app, 1) - before;
        assert!((moved - 1.0).abs() < 1e-4, "in 8 steps at 8 m/s: {moved} m");
    }
}

#[test]
fn what_is_despawned_while_disabled_leaves_nothing_behind() {
    let mut app = scene::app();
    let floor = scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y);
    scene::frames(&mut app, 3);
    for (entity, wait) in [(floor, 0), (marble, 3)] {
        app.world_mut().entity_mut(entity).insert(Disabled);
        scene::frames(&mut app, wait);
        app.world_mut().despawn(entity);
    }
    scene::frames(&mut app, 3);
    let world = app.world().resource::<TawWorld>();
    assert!(world.marbles.is_empty() && world.walls.is_empty());
}

#[test]
fn what_the_game_calls_disabled_is_disabled() {
    #[derive(Component, Clone)]
    struct Asleep;
    let mut app = scene::app();
    app.world_mut().register_disabling_component::<Asleep>();
    let floor = scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y);
    scene::frames(&mut app, 3);
    let rows = |app: &App| {
        let world = app.world().resource::<TawWorld>();
        (world.marbles.len(), world.walls.len())
    };
    assert_eq!(rows(&app), (1, 1));
    for entity in [floor, marble] {
        app.world_mut().entity_mut(entity).insert(Asleep);
    }
    scene::frames(&mut app, 1);
    assert_eq!(rows(&app), (0, 0));
    for entity in [floor, marble] {
        app.world_mut().entity_mut(entity).remove::<Asleep>();
    }
    scene::frames(&mut app, 1);
    assert_eq!(rows(&app), (1, 1));
}

#[test]
fn a_marble_is_no_wall() {
    let mut app = scene::app();
    let ball = (Marble::new(0.5), Wall::Sphere(Sphere::new(0.5)), Velocity::default());
    let ball = (ball, Transform::from_xyz(0.0, 9.0, 0.0));
    let both = app.world_mut().spawn(ball).id();
    let late = scene::floor(&mut app);
    scene::frames(&mut app, 2);
    app.world_mut().entity_mut(late).insert((Marble::new(0.5), Transform::from_xyz(9.0, 0.0, 0.0)));
    let mut told = Vec::new();
    for _ in 0..30 {
        app.update();
        let refused = app.world().resource::<Messages<InputRefused>>();
        told.extend(refused.iter_current_update_messages().map(|it| (it.entity, it.error)));
        let speed = app.world().get::<Velocity>(both).unwrap().length();
        assert!(speed < 9.81 * 0.6, "{speed} m/s");
    }
    assert_eq!(told, [(Some(late), Refusal::MarbleAndWall)], "the other one was told before");
    assert!(app.world().resource::<TawWorld>().walls.is_empty());
    // Once it is no marble any more, it is a wall.
    app.world_mut().entity_mut(late).remove::<Marble>();
    scene::frames(&mut app, 2);
    assert_eq!(app.world().resource::<TawWorld>().walls.len(), 1);
}
