//! Back in time: entities and rows find each other again.

use bevy::prelude::*;
use bevy_taw::prelude::*;
use bevy_taw::snapshot::RowRemoved;

use crate::scene;

fn game() -> (App, Entity, Vec<Entity>) {
    let mut app = scene::app();
    let (response, rotation) = (Response::Impulse, Rotation::Dynamic);
    app.insert_resource(TawModel(Model { response, rotation, ..Model::default() }));
    let board = scene::board(&mut app);
    let marbles = scene::drop_marbles(&mut app, 20);
    scene::frames(&mut app, 60);
    (app, board, marbles)
}

fn places(app: &App, marbles: &[Entity]) -> Vec<Transform> {
    marbles.iter().map(|it| *app.world().get::<Transform>(*it).unwrap()).collect()
}

/// Every row has an entity, and every marble that can be one and every wall has a row.
pub fn agree(app: &mut App) {
    let visible = app.world_mut().query::<&Marble>().iter(app.world()).count();
    let world = app.world().resource::<TawWorld>();
    for row in 0..world.marbles.len() as u32 {
        let entity = world.marble_entity(row).expect("an entity stands behind every row");
        assert!(app.world().get::<Marble>(entity).is_some(), "that is a marble");
    }
    assert!(world.marbles.len() <= visible);
    for row in 0..world.walls.len() as u32 {
        let entity = world.wall_entity(row).expect("an entity stands behind every wall");
        assert!(app.world().get::<Wall>(entity).is_some(), "that is a wall");
    }
}

#[test]
fn a_restored_world_goes_the_same_way_again() {
    let (mut app, _, marbles) = game();
    let saved = app.world().resource::<TawWorld>().snapshot();
    scene::frames(&mut app, 60);
    let first = places(&app, &marbles);
    scene::frames(&mut app, 77);
    app.world_mut().resource_mut::<TawWorld>().restore(&saved);
    scene::frames(&mut app, 60);
    assert_eq!(places(&app, &marbles), first);
    assert!(app.world().resource::<Messages<RowRemoved>>().is_empty());
}

#[test]
fn walls_are_where_their_entities_are_after_a_restore() {
    for raw in [false, true] {
        let (mut app, board, _) = game();
        let saved = app.world().resource::<TawWorld>().snapshot();
        let clone = (**app.world().resource::<TawWorld>()).clone();
        app.world_mut().get_mut::<Transform>(board).unwrap().translation.y = -3.0;
        scene::frames(&mut app, 5);
        let mut world = app.world_mut().resource_mut::<TawWorld>();
        if raw {
            **world = clone;
        } else {
            world.restore(&saved);
        }
        scene::frames(&mut app, 300);
        let world = app.world().resource::<TawWorld>();
        let lowest = world.marbles.position().iter().fold(9.0_f32, |low, it| low.min(it.y));
        assert!((-3.0..-2.0).contains(&lowest), "they lie on the floor that is there: {lowest}");
    }
}

#[test]
fn rows_without_entities_go_and_entities_without_rows_come() {
    for raw in [false, true] {
        let (mut app, board, mut marbles) = game();
        app.init_resource::<Messages<ContactStarted>>();
        let saved = app.world().resource::<TawWorld>().snapshot();
        let clone = (**app.world().resource::<TawWorld>()).clone();
        // Five go, with a wall; three come, with another; one grows.
        let gone: Vec<_> = marbles.drain(3..8).collect();
        let walls: Vec<_> = app.world().get::<Children>(board).unwrap().iter().collect();
        gone.iter().chain(&walls[..1]).for_each(|it| {
            app.world_mut().despawn(*it);
        });
        let new =
            [1.0, 2.0, 3.0].map(|x| scene::drop_marble(&mut app, 0.1, Vec3::new(x, 9.0, 0.0)));
        app.world_mut().spawn((Wall::default(), Transform::from_xyz(0.0, -0.5, 0.0)));
        app.world_mut().get_mut::<Marble>(marbles[0]).unwrap().radius = 0.33;
        scene::frames(&mut app, 30);
        let falling = scene::position(&app, new[1]).y;
        let mut world = app.world_mut().resource_mut::<TawWorld>();
        if raw {
            **world = clone;
        } else {
            world.restore(&saved);
        }
        app.update();
        let told = app.world().resource::<Messages<RowRemoved>>();
        let told: Vec<_> = told.iter_current_update_messages().collect();
        let count = |kind: fn(&RowRemoved) -> bool| told.iter().filter(|it| kind(it)).count();
        assert_eq!(count(|it| matches!(it, RowRemoved::Marble(_))), 5, "raw {raw}");
        assert_eq!(count(|it| matches!(it, RowRemoved::Wall(_))), 1);
        let world = app.world().resource::<TawWorld>();
        assert_eq!((world.marbles.len(), world.walls.len()), (18, 5));
        if !raw {
            let radii = world.marbles.radius();
            assert!(radii.contains(&0.33), "components say what marbles are: {radii:?}");
        }
        assert!((scene::position(&app, new[1]).y - falling).abs() < 0.2);
        agree(&mut app);
        scene::frames(&mut app, 200);
        agree(&mut app);
    }
}

#[test]
fn a_restored_marble_is_not_drawn_on_its_way_back() {
    let mut app = scene::smooth_app();
    app.insert_resource(Gravity(Vec3::ZERO));
    scene::frame_length(&mut app, scene::STEP / 4.0);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
    app.world_mut().entity_mut(marble).insert(Velocity(Vec3::X * 64.0));
    scene::frames(&mut app, 9);
    let saved = app.world().resource::<TawWorld>().snapshot();
    scene::frames(&mut app, 403);
    app.world_mut().resource_mut::<TawWorld>().restore(&saved);
    for _ in 0..20 {
        app.update();
        let x = scene::position(&app, marble).x;
        assert!(x < 10.0, "drawn at {x}");
    }
}

#[test]
fn a_swarm_keeps_what_it_had_and_loses_what_is_nobodys() {
    use bevy::math::bounding::Aabb3d;
    let mut app = scene::app();
    scene::floor(&mut app);
    scene::drop_marble(&mut app, 0.5, Vec3::Y * 9.0);
    let region = |x: f32| Aabb3d::new(Vec3::new(x, 4.0, 0.0), Vec3::splat(2.0));
    let [stays, goes] =
        [0.0, 8.0].map(|x| app.world_mut().spawn(Swarm::filling(region(x), 30, 0.1..=0.2, 7)).id());
    scene::frames(&mut app, 10);
    let saved = app.world().resource::<TawWorld>().snapshot();
    app.world_mut().get_mut::<Swarm>(stays).unwrap().truncate(10);
    app.world_mut().despawn(goes);
    scene::frames(&mut app, 10);
    app.world_mut().resource_mut::<TawWorld>().restore(&saved);
    app.update();
    assert_eq!(app.world().get::<Swarm>(stays).unwrap().len(), 10);
    let world = app.world().resource::<TawWorld>();
    assert_eq!(world.swarm.len(), 11, "and the marble is its guest");
    assert_eq!(app.world().resource::<Messages<RowRemoved>>().len(), 50);
    scene::frames(&mut app, 100);
}

/// Who listens to sensors knows who is inside, also after a restore.
#[test]
fn who_is_in_a_sensor_of_a_restored_world_is_told() {
    let mut app = scene::app();
    app.insert_resource(Gravity(Vec3::ZERO)).insert_resource(TawModel(Model::GAME));
    let zone = (Wall::from(Cuboid::from_length(2.0)), Sensor);
    let zone = app.world_mut().spawn(zone).id();
    let marbles = [0.0, 9.0, 0.5, 0.8].map(|x| scene::drop_marble(&mut app, 0.1, Vec3::X * x));
    let [goes, comes, stays, dies] = marbles;
    scene::frames(&mut app, 2);
    let saved = app.world().resource::<TawWorld>().snapshot();
    let put = |app: &mut App, marble: Entity, x: f32| {
        app.world_mut().get_mut::<Transform>(marble).unwrap().translation.x = x;
    };
    put(&mut app, goes, -9.0);
    put(&mut app, comes, 0.0);
    app.world_mut().despawn(dies);
    scene::frames(&mut app, 3);
    let there = |app: &App| app.world().get::<CollidingEntities>(zone).unwrap().to_vec();
    let sorted = |mut all: [Entity; 2]| {
        all.sort_unstable();
        all
    };
    assert_eq!(there(&app), sorted([comes, stays]));
    for (entered, left) in [(vec![goes], vec![comes]), (vec![], vec![])] {
        app.world_mut().resource_mut::<TawWorld>().restore(&saved);
        app.world_mut().resource_mut::<TawWorld>().restore(&saved);
        app.update();
        let messages = app.world().resource::<Messages<SensorEntered>>();
        let told: Vec<_> = messages.iter_current_update_messages().map(|it| it.collider).collect();
        assert_eq!(told, entered);
        let messages = app.world().resource::<Messages<SensorLeft>>();
        let told: Vec<_> = messages.iter_current_update_messages().map(|it| it.collider).collect();
        assert_eq!(told, left);
        assert_eq!(there(&app), sorted([goes, stays]));
        scene::frames(&mut app, 3);
    }
}
