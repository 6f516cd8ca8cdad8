//! Marbles in bulk, in an app.

use bevy::math::bounding::Aabb3d;
use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene::app;

fn region() -> Aabb3d {
    Aabb3d::new(Vec3::Y * 4.0, Vec3::new(2.0, 3.0, 2.0))
}

fn swarm_of(app: &mut App) -> (Entity, Swarm) {
    let mut swarms = app.world_mut().query::<(Entity, &Swarm)>();
    let (entity, swarm) = swarms.single(app.world()).expect("one swarm");
    (entity, swarm.clone())
}

#[test]
fn a_swarm_falls_onto_a_floor_and_rests() {
    let mut app = app();
    app.world_mut().spawn(Wall::default());
    app.world_mut().spawn(Swarm::filling(region(), 200, 0.1..=0.2, 7));
    for _ in 0..600 {
        app.update();
    }
    let (_, swarm) = swarm_of(&mut app);
    let world = app.world().resource::<TawWorld>();
    assert_eq!((swarm.len(), swarm.balls().len(), swarm.positions(world).count()), (200, 200, 200));
    assert!(swarm.positions(world).all(|at| at.y > 0.09 && at.y < 1.0));
    assert_eq!(swarm.coming().len(), 0);
}

#[test]
fn it_grows_shrinks_and_goes() {
    let mut app = app();
    let entity = app.world_mut().spawn(Swarm::filling(region(), 50, 0.1..=0.1, 1)).id();
    let more = Swarm::filling(region(), 30, 0.2..=0.2, 2);
    app.update();
    app.update();
    app.world_mut().get_mut::<Swarm>(entity).unwrap().extend(more.coming().iter().copied());
    app.update();
    assert_eq!(app.world().resource::<TawWorld>().swarm.len(), 80);
    let first: Vec<_> = swarm_of(&mut app).1.balls()[..20].to_vec();
    app.world_mut().get_mut::<Swarm>(entity).unwrap().truncate(20);
    app.update();
    assert_eq!(app.world().resource::<TawWorld>().swarm.len(), 20);
    assert_eq!(swarm_of(&mut app).1.balls(), first);
    app.world_mut().entity_mut(entity).despawn();
    app.update();
    assert!(app.world().resource::<TawWorld>().swarm.is_empty());
}

#[test]
fn marbles_that_are_entities_and_swarms_touch() {
    let mut app = app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let region = Aabb3d::new(Vec3::ZERO, Vec3::splat(0.6));
    app.world_mut().spawn(Swarm::filling(region, 1, 0.5..=0.5, 1));
    let marble = (Marble::new(0.5), Velocity(Vec3::X * 4.0), Transform::from_xyz(-4.0, 0.0, 0.0));
    let marble = app.world_mut().spawn(marble).id();
    for _ in 0..120 {
        app.update();
    }
    let (_, swarm) = swarm_of(&mut app);
    let world = app.world().resource::<TawWorld>();
    let at = swarm.positions(world).next().expect("one");
    assert!(at.x > 1.0, "{at}");
    let speed = app.world().get::<Velocity>(marble).expect("a marble").x;
    assert!(speed < 3.0, "{speed} m/s");
}

#[test]
fn bad_models_and_balls_are_refused() {
    let mut app = app();
    app.world_mut().resource_mut::<TawSwarmModel>().substeps = 0;
    let bad = Ball::new(bevy_taw::taw::math::Point3::new(0.0, f32::NAN, 0.0), 0.5);
    app.world_mut().spawn(Swarm::new(vec![bad]));
    app.update();
    app.update();
    let messages = app.world().resource::<Messages<InputRefused>>();
    let mut cursor = messages.get_cursor();
    let errors: Vec<_> = cursor.read(messages).map(|refused| refused.error.to_string()).collect();
    assert!(errors.iter().any(|error| error.starts_with("substeps")), "{errors:?}");
    assert!(errors.iter().any(|error| error.starts_with("position.y")), "{errors:?}");
    assert!(app.world().resource::<TawWorld>().swarm.is_empty());
}

#[test]
fn what_sleeps_is_not_woken_by_walls_that_stay() {
    let mut app = app();
    app.world_mut().spawn(Wall::default());
    app.world_mut().spawn(Swarm::filling(region(), 20, 0.2..=0.2, 7));
    for _ in 0..1_200 {
        app.update();
    }
    let world = app.world().resource::<TawWorld>();
    assert_eq!(world.swarm.asleep(), 20);
}
