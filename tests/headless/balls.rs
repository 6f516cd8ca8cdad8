//! Balls of swarms, asked for and heard of.

use bevy::ecs::message::Messages;
use bevy::ecs::system::RunSystemOnce;
use bevy::math::Isometry3d;
use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene;

#[derive(PhysicsLayer)]
enum Layer {
    Seen,
    Unseen,
}

/// An app without gravity by a response, with a floor 3 m below, a marble at x = 4, and two swarms: balls
/// at x = 2, and at 6 and 8.
fn app(response: Response) -> (App, [Entity; 4], [BallId; 3]) {
    let mut app = scene::app();
    app.insert_resource(TawModel(Model { response, ..Model::GAME }))
        .insert_resource(Gravity(Vec3::ZERO));
    let floor = app.world_mut().spawn((Wall::default(), Transform::from_xyz(0.0, -3.0, 0.0))).id();
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::X * 4.0);
    let balls = |xs: &[f32]| xs.iter().map(|x| Ball::new(Vec3::X * x, 0.5)).collect();
    let seen = CollisionLayers::new(Layer::Seen, LayerMask::ALL);
    let near = app.world_mut().spawn((Swarm::new(balls(&[2.0])), seen)).id();
    let unseen = CollisionLayers::new(Layer::Unseen, LayerMask::ALL);
    let far = app.world_mut().spawn((Swarm::new(balls(&[6.0, 8.0])), unseen)).id();
    app.update();
    let of = |swarm| app.world().get::<Swarm>(swarm).unwrap().balls().to_vec();
    let ids = [of(near)[0], of(far)[0], of(far)[1]];
    (app, [floor, marble, near, far], ids)
}

fn ask<R: 'static>(
    app: &mut App,
    mut question: impl FnMut(&SpatialQuery) -> R + Send + Sync + 'static,
) -> R {
    app.world_mut().run_system_once(move |spatial: SpatialQuery| question(&spatial)).unwrap()
}

#[test]
fn rays_find_balls_among_the_others_and_filters_choose_them() {
    for response in [Response::SoftStep, Response::Impulse] {
        let (mut app, [_, marble, near, far], [a, b, c]) = app(response);
        let found = ask(&mut app, move |spatial| {
            let along = Ray3d::new(Vec3::ZERO, Dir3::X);
            let through = |filter: SpatialQueryFilter| -> Vec<_> {
                let hits = spatial.cast_ray_all(along, 20.0, &filter);
                let first = spatial.cast_ray(along, 20.0, &filter);
                assert_eq!(first, hits.first().copied());
                hits.iter().map(|hit| (hit.entity, hit.ball, hit.distance)).collect()
            };
            let all = SpatialQueryFilter::default;
            let is_far = |entity| entity == far;
            [
                through(all()),
                through(SpatialQueryFilter::balls()),
                through(SpatialQueryFilter::marbles()),
                through(SpatialQueryFilter::walls()),
                through(all().without_balls()),
                through(all().with_excluded_entities([marble, far])),
                through(SpatialQueryFilter::balls().with_mask(Layer::Unseen)),
                through(all().with_predicate(&is_far)),
            ]
        });
        let on_marble = (marble, None, 3.5);
        let on = [(near, Some(a), 1.5), (far, Some(b), 5.5), (far, Some(c), 7.5)];
        let expected = [
            vec![on[0], on_marble, on[1], on[2]],
            on.to_vec(),
            vec![on_marble],
            vec![],
            vec![on_marble],
            vec![on[0]],
            vec![on[1], on[2]],
            vec![on[1], on[2]],
        ];
        assert_eq!(found, expected, "{response:?}");
    }
}

#[test]
fn shapes_and_points_find_balls() {
    let (mut app, [floor, marble, near, far], [a, b, c]) = app(Response::SoftStep);
    ask(&mut app, move |spatial| {
        let all = SpatialQueryFilter::default();
        let balls = SpatialQueryFilter::balls();
        let at = |x: f32, y: f32| Isometry3d::from_translation(Vec3::new(x, y, 0.0));
        let ball = Sphere::new(0.5);
        let hit = |x: f32, way: Vec3, filter: &SpatialQueryFilter| {
            let hit = spatial.cast_shape(&ball, at(x, 0.0), way, filter).unwrap().unwrap();
            (hit.entity, hit.ball, (hit.fraction * 100.0).round(), hit.normal.round())
        };
        assert_eq!(hit(0.0, Vec3::X * 10.0, &all), (near, Some(a), 10.0, Vec3::NEG_X));
        assert_eq!(hit(3.0, Vec3::X * 10.0, &all).0, marble, "it touches and approaches");
        assert_eq!(hit(2.9, Vec3::X * 10.0, &balls), (far, Some(b), 21.0, Vec3::NEG_X));
        assert_eq!(hit(9.5, Vec3::NEG_X, &all), (far, Some(c), 50.0, Vec3::X));
        assert_eq!(hit(12.0, Vec3::NEG_Y * 5.0, &all).0, floor);
        let slab = Cuboid::new(5.0, 1.0, 1.0);
        let over = |x: f32, filter: &SpatialQueryFilter| {
            let found = spatial.overlaps(&slab, at(x, 0.0), filter).unwrap();
            (found, spatial.overlapping_balls(&slab, at(x, 0.0), filter).unwrap())
        };
        let mut sorted = [b, c];
        sorted.sort_unstable();
        assert_eq!(over(7.2, &all), (vec![far], sorted.to_vec()));
        assert_eq!(
            over(3.6, &all),
            (vec![marble, near.min(far), near.max(far)], {
                let mut sorted = vec![a, b];
                sorted.sort_unstable();
                sorted
            })
        );
        assert_eq!(over(7.2, &SpatialQueryFilter::marbles()), (vec![], vec![]));
        let nearest = |at: Vec3, most: f32, filter: &SpatialQueryFilter| {
            spatial.project_point(at, most, filter).map(|it| (it.entity, it.ball, it.distance))
        };
        assert_eq!(nearest(Vec3::X * 9.5, 9.0, &all), Some((far, Some(c), 1.0)));
        assert_eq!(nearest(Vec3::X * 5.0 + Vec3::X * 0.25, 9.0, &all), Some((far, Some(b), 0.25)));
        assert_eq!(nearest(Vec3::X * 4.75, 9.0, &all), Some((marble, None, 0.25)));
        assert_eq!(nearest(Vec3::X * 12.0, 1.0, &balls), None);
        let bad = Sphere { radius: f32::NAN };
        let refused = spatial.overlapping_balls(&bad, at(0.0, 0.0), &balls).unwrap_err();
        assert!(refused.to_string().contains("radius"), "{refused}");
    });
}

#[test]
fn who_moves_or_goes_is_found_where_it_is() {
    let (mut app, [_, _, near, far], [a, b, _]) = app(Response::SoftStep);
    let world = &mut *app.world_mut().resource_mut::<TawWorld>();
    assert_eq!([a, b].map(|ball| world.swarm_of(ball)), [Some(near), Some(far)]);
    world.set_ball_position(a, Vec3::new(0.0, 2.0, 0.0)).unwrap();
    let up = |spatial: &SpatialQuery| {
        let ray = Ray3d::new(Vec3::ZERO, Dir3::Y);
        spatial
            .cast_ray(ray, 10.0, &SpatialQueryFilter::default())
            .map(|hit| (hit.ball, hit.distance))
    };
    assert_eq!(ask(&mut app, up), Some((Some(a), 1.5)));
    app.world_mut().despawn(near);
    assert_eq!(ask(&mut app, up), None);
    assert_eq!(app.world().resource::<TawWorld>().swarm_of(a), None);
    // Slots are used again.
    let other = app.world_mut().spawn(Swarm::new(vec![Ball::new(Vec3::Y * 3.0, 0.5)])).id();
    app.update();
    let world = app.world().resource::<TawWorld>();
    let ball = app.world().get::<Swarm>(other).unwrap().balls()[0];
    assert_eq!((world.swarm_of(ball), world.swarm_of(a)), (Some(other), None));
    assert_eq!(ask(&mut app, up), Some((Some(ball), 2.5)));
}

/// Events of balls, in order: whether it entered, the sensor, the swarm and the ball.
#[derive(Resource, Default)]
struct Told(Vec<BallEvent>);

type BallEvent = (bool, Entity, Entity, BallId);

fn told(app: &mut App) -> Vec<BallEvent> {
    sorted(std::mem::take(&mut app.world_mut().resource_mut::<Told>().0))
}

fn sorted(events: impl Into<Vec<BallEvent>>) -> Vec<BallEvent> {
    let mut events = events.into();
    events.sort_unstable();
    events
}

fn gate(app: &mut App, x: f32) -> Entity {
    let wall = Wall::from(Cuboid::from_length(1.0));
    app.world_mut().spawn((wall, Sensor, Transform::from_xyz(x, 0.0, 0.0))).id()
}

/// That app, which hears by messages or by observers.
fn listening(by_message: bool) -> (App, [Entity; 4], [BallId; 3]) {
    let (mut app, entities, balls) = app(Response::SoftStep);
    app.init_resource::<Told>();
    if by_message {
        let listen = |mut told: ResMut<Told>,
                      mut entered: MessageReader<BallEntered>,
                      mut left: MessageReader<BallLeft>| {
            told.0.extend(entered.read().map(|it| (true, it.sensor, it.swarm, it.ball)));
            told.0.extend(left.read().map(|it| (false, it.sensor, it.swarm, it.ball)));
        };
        app.add_message::<BallEntered>()
            .add_message::<BallLeft>()
            .add_systems(FixedUpdate, listen.after(TawSystems::Scatter));
    } else {
        app.add_observer(|it: On<BallEntered>, mut told: ResMut<Told>| {
            told.0.push((true, it.sensor, it.swarm, it.ball));
        });
        app.add_observer(|it: On<BallLeft>, mut told: ResMut<Told>| {
            told.0.push((false, it.sensor, it.swarm, it.ball));
        });
    }
    (app, entities, balls)
}

#[test]
fn sensors_tell_which_balls_enter_and_leave() {
    for by_message in [true, false] {
        let (mut app, [_, _, near, far], [a, b, c]) = listening(by_message);
        let first = gate(&mut app, 2.0);
        let second = gate(&mut app, 10.0);
        app.update();
        assert_eq!(told(&mut app), [(true, first, near, a)]);
        let mut world = app.world_mut().resource_mut::<TawWorld>();
        world.set_ball_velocity(a, Vec3::Z * 8.0).unwrap();
        world.set_ball_velocity(c, Vec3::X * 8.0).unwrap();
        scene::frames(&mut app, 32);
        scene::frames(&mut app, 32);
        let expected = [(false, first, near, a), (true, second, far, c), (false, second, far, c)];
        assert_eq!(told(&mut app), sorted(expected));
        // A ball, a sensor or a swarm that goes leaves.
        let mut world = app.world_mut().resource_mut::<TawWorld>();
        world.set_ball_position(a, Vec3::X * 2.0).unwrap();
        world.set_ball_position(b, Vec3::X * 10.0).unwrap();
        world.set_ball_velocity(a, Vec3::ZERO).unwrap();
        app.update();
        assert_eq!(told(&mut app), sorted([(true, first, near, a), (true, second, far, b)]));
        app.world_mut().get_mut::<Swarm>(far).unwrap().remove(b);
        app.world_mut().despawn(near);
        app.world_mut().spawn(Swarm::new(vec![Ball::new(Vec3::X * 30.0, 0.5); 2]));
        app.update();
        assert_eq!(told(&mut app), sorted([(false, first, near, a), (false, second, far, b)]));
        let newcomer = Swarm::new(vec![Ball::new(Vec3::X * 2.0, 0.5)]);
        let newcomer = app.world_mut().spawn(newcomer).id();
        app.update();
        let ball = app.world().get::<Swarm>(newcomer).unwrap().balls()[0];
        assert_eq!(told(&mut app), [(true, first, newcomer, ball)]);
        app.world_mut().despawn(first);
        app.update();
        assert_eq!(told(&mut app), [(false, first, newcomer, ball)]);
        app.update();
        assert_eq!(told(&mut app), []);
    }
}

#[test]
fn an_observer_of_a_sensor_hears_of_its_own_balls_and_back_in_time_nothing_is_told_twice() {
    let (mut app, [_, _, near, _], [a, ..]) = app(Response::SoftStep);
    app.init_resource::<Told>();
    let hole = gate(&mut app, 2.0);
    let other = gate(&mut app, 6.0);
    scene::frames(&mut app, 2);
    assert!(!app.world().contains_resource::<Messages<BallEntered>>());
    let hear = |it: On<BallEntered>, mut told: ResMut<Told>| {
        told.0.push((true, it.sensor, it.swarm, it.ball));
    };
    app.world_mut().entity_mut(hole).observe(hear);
    app.update();
    assert_eq!(
        told(&mut app),
        [(true, hole, near, a)],
        "it is inside when somebody begins to listen"
    );
    assert_ne!(hole, other);
    let saved = app.world().resource::<TawWorld>().snapshot();
    app.world_mut().resource_mut::<TawWorld>().set_ball_position(a, Vec3::Y * 9.0).unwrap();
    scene::frames(&mut app, 2);
    app.world_mut().resource_mut::<TawWorld>().restore(&saved);
    scene::frames(&mut app, 2);
    assert_eq!(told(&mut app), [], "it never left");
    app.world_mut().resource_mut::<TawWorld>().set_ball_position(a, Vec3::Y * 9.0).unwrap();
    app.update();
    app.world_mut().resource_mut::<TawWorld>().set_ball_position(a, Vec3::X * 2.0).unwrap();
    app.update();
    assert_eq!(told(&mut app), [(true, hole, near, a)]);
}
