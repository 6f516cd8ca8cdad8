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
    let bad = Ball::new(Vec3::new(0.0, f32::NAN, 0.0), 0.5);
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

#[test]
fn single_balls_are_read_set_and_removed() {
    let mut app = app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let tint = Tint::Plain([1.0, 0.0, 0.0]);
    let at = |i: u8| Vec3::new(f32::from(i), 1.0, 0.0);
    let balls = |from: u8| (from..from + 5).map(|i| Ball::new(at(i), 0.1)).collect();
    let first = app.world_mut().spawn(Swarm::new(balls(0)).with_tint(tint)).id();
    let second = app.world_mut().spawn(Swarm::new(balls(10))).id();
    app.update();
    let swarm = |app: &App, entity| app.world().get::<Swarm>(entity).unwrap().clone();
    let ids = swarm(&app, first).balls().to_vec();
    let other = swarm(&app, second).balls()[0];
    let mut of_first = app.world_mut().get_mut::<Swarm>(first).unwrap();
    assert!(of_first.remove(ids[1]) && !of_first.remove(ids[1]) && !of_first.remove(other));
    of_first.extend([Ball { velocity: Vec3::Y, ..Ball::new(at(7), 0.2) }]);
    assert_eq!((of_first.len(), of_first.balls().len()), (5, 4));
    app.update();
    let left = swarm(&app, first).balls().to_vec();
    assert_eq!(left[..4], [ids[0], ids[2], ids[3], ids[4]]);
    app.world_mut()
        .get_mut::<Swarm>(first)
        .unwrap()
        .retain(|ball| ball != ids[3] && ball != ids[0]);
    app.update();
    let left = swarm(&app, first);
    assert_eq!((left.len(), left.tint), (3, tint));
    let mut world = app.world_mut().resource_mut::<TawWorld>();
    let read = world.ball(left.balls()[2]).unwrap();
    assert_eq!((read.velocity, read.radius), (Vec3::Y, 0.2));
    assert_eq!(world.ball(ids[2]).unwrap().position, at(2));
    assert_eq!(world.swarm.len(), 8);
    assert!(world.ball(ids[1]).is_err() && world.set_ball_velocity(ids[1], Vec3::X).is_err());
    world.set_ball_position(ids[2], at(40)).unwrap();
    world.set_ball_velocity(ids[2], Vec3::X * 64.0).unwrap();
    app.update();
    let world = app.world().resource::<TawWorld>();
    assert_eq!(world.ball(ids[2]).unwrap().position, at(41));
    assert_eq!(swarm(&app, second).len(), 5);
}

#[test]
fn who_is_removed_through_the_world_is_gone_from_the_component() {
    let mut app = app();
    let entity = app.world_mut().spawn(Swarm::filling(region(), 9, 0.1..=0.1, 1)).id();
    app.update();
    let ids = swarm_of(&mut app).1.balls().to_vec();
    let mut world = app.world_mut().resource_mut::<TawWorld>();
    world.swarm.remove(&ids[2..4]).unwrap();
    // One of them twice.
    app.world_mut()
        .get_mut::<Swarm>(entity)
        .unwrap()
        .retain(|ball| ball != ids[2] && ball != ids[8]);
    app.update();
    let (_, swarm) = swarm_of(&mut app);
    assert_eq!(swarm.balls(), [&ids[..2], &ids[4..8]].concat());
    let world = app.world().resource::<TawWorld>();
    assert_eq!((swarm.len(), world.swarm.len(), swarm.positions(world).count()), (6, 6, 6));
    assert!(app.world().resource::<Messages<InputRefused>>().is_empty());
    app.world_mut().get_mut::<Swarm>(entity).unwrap().truncate(5);
    app.update();
    assert_eq!(app.world().resource::<TawWorld>().swarm.len(), 5);
}

#[test]
fn sensors_tell_which_balls_are_inside() {
    let mut app = app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let balls = (0..9_u8).map(|i| Ball::new(Vec3::X * f32::from(i), 0.1)).collect();
    let swarm = app.world_mut().spawn(Swarm::new(balls)).id();
    let hole = (Wall::from(Cuboid::from_length(3.0)), Sensor, Transform::from_xyz(5.0, 0.0, 0.0));
    let hole = app.world_mut().spawn(hole).id();
    app.update();
    let ids = app.world().get::<Swarm>(swarm).unwrap().balls().to_vec();
    let inside = |app: &App| app.world().get::<CollidingBalls>(hole).unwrap().to_vec();
    assert_eq!(inside(&app), ids[4..7]);
    app.world_mut().get_mut::<Swarm>(swarm).unwrap().remove(ids[4]);
    app.update();
    assert_eq!(inside(&app), ids[5..7]);
    app.world_mut().entity_mut(hole).remove::<Sensor>();
    app.world_mut().entity_mut(swarm).despawn();
    app.update();
    assert_eq!(inside(&app), []);
}

#[test]
fn a_ray_picks_the_nearest_ball_and_no_marble() {
    let mut app = app();
    app.insert_resource(Gravity(Vec3::ZERO));
    app.insert_resource(TawModel::default()); // marbles are rows among the balls
    let balls = [1.0, 4.0, 9.0].map(|x| Ball::new(Vec3::new(x, 0.3, 0.0), 0.5)).to_vec();
    let swarm = app.world_mut().spawn(Swarm::new(balls)).id();
    crate::scene::drop_marble(&mut app, 0.5, Vec3::X * 2.5);
    app.update();
    let ids = app.world().get::<Swarm>(swarm).unwrap().balls().to_vec();
    let world = app.world().resource::<TawWorld>();
    let pick = |x: f32, toward: Dir3, most: f32| {
        let hit = world.cast_ray_on_balls(Ray3d::new(Vec3::X * x, toward), most);
        hit.map(|hit| (hit.ball, [hit.distance, hit.point.x].map(|x| (x * 100.0).round())))
    };
    assert_eq!(pick(-1.0, Dir3::X, 1.5), None); // 1.6 m
    assert_eq!(pick(-1.0, Dir3::X, f32::INFINITY), Some((ids[0], [160.0, 60.0])));
    assert_eq!(pick(2.0, Dir3::X, 9.0), Some((ids[1], [160.0, 360.0])));
    assert_eq!(pick(2.0, Dir3::NEG_X, 9.0).map(|it| it.0), Some(ids[0]));
    assert_eq!(pick(9.1, Dir3::Z, 9.0), Some((ids[2], [0.0, 910.0])));
    assert_eq!(pick(2.5, Dir3::Y, 9.0), None);
}

/// Prints what it costs: `cargo test -p taw_examples --test headless -- --ignored --nocapture ten_thousand_balls`.
#[test]
#[ignore = "a measurement"]
fn ten_thousand_balls_in_the_wind() {
    let frame = |sensor: bool, wind: Option<WindZone>| {
        let mut app = app();
        app.insert_resource(TawModel::default());
        app.world_mut().spawn(Wall::default());
        let region = Aabb3d::new(Vec3::Y * 4.0, Vec3::new(3.0, 3.0, 3.0));
        app.world_mut().spawn(Swarm::filling(region, 10_000, 0.1..=0.12, 7));
        let room = Wall::from(Cuboid::from_length(40.0));
        if sensor {
            let room = app.world_mut().spawn((room, Sensor)).id();
            wind.map(|wind| app.world_mut().entity_mut(room).insert(wind).id());
        }
        crate::scene::frames(&mut app, 60);
        let start = std::time::Instant::now();
        crate::scene::frames(&mut app, 60);
        start.elapsed() / 60
    };
    let wind = WindZone { velocity: Vec3::X, drag: 0.1 };
    println!("without a sensor: {:?} a frame", frame(false, None));
    println!("within a sensor: {:?} a frame", frame(true, None));
    println!("in the wind: {:?} a frame", frame(true, Some(wind)));
}
