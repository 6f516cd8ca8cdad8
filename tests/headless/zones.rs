//! Zones of another gravity, and of wind.

use bevy::ecs::message::Messages;
use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene;

const RESPONSES: [Response; 4] =
    [Response::SoftStep, Response::Impulse, Response::EventDriven, Response::Displacement];

fn app(response: Response) -> App {
    let mut app = scene::app();
    app.insert_resource(TawModel(Model { response, substeps: 1, ..Model::GAME }));
    app
}

fn marble(app: &mut App, at: Vec3) -> Entity {
    let marble = scene::drop_marble(app, 0.1, at);
    app.world_mut().entity_mut(marble).insert(Velocity::default());
    marble
}

fn velocity(app: &App, marble: Entity) -> Vec3 {
    **app.world().get::<Velocity>(marble).unwrap()
}

fn room() -> Wall {
    Wall::from(Cuboid::from_length(4.0))
}

#[test]
fn a_zone_has_its_own_gravity() {
    for response in RESPONSES {
        let cases = [
            (vec![GravityZone::Replace(Vec3::X * 2.0)], 1.0, Vec3::X * 2.0),
            (vec![GravityZone::Replace(Vec3::X * 2.0)], -3.0, Vec3::X * -6.0),
            (vec![GravityZone::Add(Vec3::X)], 1.0, Vec3::new(1.0, -9.81, 0.0)),
            (vec![GravityZone::Add(Vec3::X), GravityZone::default()], 1.0, Vec3::X),
            (
                vec![GravityZone::Add(Vec3::X), GravityZone::Add(Vec3::Y)],
                2.0,
                Vec3::new(2.0, -17.62, 0.0),
            ),
            (vec![GravityZone::Toward(3.0)], 1.0, Vec3::X * 3.0),
        ];
        for (zones, scale, expected) in cases {
            let mut app = app(response);
            let case = format!("{response:?}: {zones:?}, scale {scale}");
            for zone in zones {
                app.world_mut().spawn((room(), zone));
            }
            let inside = marble(&mut app, Vec3::X * -1.0);
            app.world_mut().entity_mut(inside).insert(GravityScale(scale));
            let outside = marble(&mut app, Vec3::X * 9.0);
            app.update(); // it is noticed
            let before = velocity(&app, inside);
            scene::frames(&mut app, 8);
            let acceleration = (velocity(&app, inside) - before) / (8.0 * scene::STEP);
            assert!(acceleration.distance(expected) < 0.05, "{case}: {acceleration}");
            let fell = velocity(&app, outside) / (9.0 * scene::STEP);
            assert!(fell.distance(Vec3::Y * -9.81) < 0.1, "{case}: {fell} outside");
        }
    }
}

/// A swarm of one ball, which is at rest.
fn ball(app: &mut App, at: Vec3, gravity_scale: f32) -> BallId {
    let swarm = app.world_mut().spawn(Swarm::new(vec![Ball::new(at, 0.1)])).id();
    app.update();
    let ball = app.world().get::<Swarm>(swarm).unwrap().balls()[0];
    let mut world = app.world_mut().resource_mut::<TawWorld>();
    world.swarm.set_gravity_scale(ball, gravity_scale).unwrap();
    ball
}

#[test]
fn balls_of_swarms_feel_gravity_zones_and_winds_as_marbles_do() {
    let wind = WindZone { velocity: Vec3::new(1.0, 2.0, 0.0), drag: 2.0 };
    for (response, tier) in [
        (Response::SoftStep, Tier::Full),
        (Response::Impulse, Tier::Full),
        (Response::EventDriven, Tier::Lab),
    ] {
        let mut app = app(response);
        app.world_mut().resource_mut::<TawSwarmModel>().tier = tier;
        app.insert_resource(Gravity(Vec3::Y * -2.0));
        let zones = [GravityZone::Replace(Vec3::X * 2.0), GravityZone::Add(Vec3::Z)];
        for zone in zones {
            app.world_mut().spawn((room(), zone));
        }
        app.world_mut().spawn((
            room(),
            GravityZone::Toward(4.0),
            Transform::from_xyz(9.0, 0.0, 0.0),
        ));
        app.world_mut().spawn((room(), wind, Transform::from_xyz(-9.0, 0.0, 0.0)));
        let places = [0.5, 9.5, -9.0, 30.0].map(|x| Vec3::X * x);
        let scales = [-1.0, 1.0, 0.0, 1.0];
        let pairs: Vec<_> = places.into_iter().zip(scales).collect();
        let balls = pairs.iter().map(|(at, scale)| ball(&mut app, *at, *scale));
        let balls: Vec<_> = balls.collect();
        let mut world = app.world_mut().resource_mut::<TawWorld>();
        for (ball, at) in balls.iter().zip(places) {
            world.set_ball_position(*ball, at).unwrap();
            world.set_ball_velocity(*ball, Vec3::ZERO).unwrap();
        }
        let marbles = pairs.iter().map(|(at, scale)| {
            let marble = marble(&mut app, *at + Vec3::Z * 0.4);
            app.world_mut().entity_mut(marble).insert(GravityScale(*scale));
            marble
        });
        let marbles: Vec<_> = marbles.collect();
        app.update(); // they are noticed
        let speed = |app: &App| {
            let world = app.world().resource::<TawWorld>();
            let balls = balls.iter().map(|ball| world.ball(*ball).unwrap().velocity);
            balls.collect::<Vec<_>>()
        };
        let before =
            (speed(&app), marbles.iter().map(|it| velocity(&app, *it)).collect::<Vec<_>>());
        scene::frames(&mut app, 8);
        let after = speed(&app);
        let time = 8.0 * scene::STEP;
        let case = format!("{response:?}, {tier:?}");
        let expected = [Vec3::new(-2.0, 0.0, -1.0), Vec3::X * -4.0, Vec3::ZERO, Vec3::Y * -2.0];
        for i in [0, 1, 3] {
            let of_ball = (after[i] - before.0[i]) / time;
            assert!(of_ball.distance(expected[i]) < 0.05, "{case}: {of_ball} for {}", expected[i]);
        }
        let left = (-wind.drag * time).exp();
        let blown = |before: Vec3| wind.velocity + (before - wind.velocity) * left;
        for (before, after) in [(before.0[2], after[2]), (before.1[2], velocity(&app, marbles[2]))]
        {
            let expected = blown(before);
            assert!(after.distance(expected) < 1e-3, "{case}: {after} for {expected}");
        }
    }
}

#[test]
fn a_planet_holds_marbles_all_around_it_and_is_their_ground() {
    let mut app = app(Response::SoftStep);
    app.insert_resource(Gravity(Vec3::ZERO));
    let planet = app.world_mut().spawn(Wall::from(Sphere::new(1.0))).id();
    app.world_mut().spawn((Wall::from(Sphere::new(10.0)), GravityZone::Toward(9.81)));
    let directions = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::ONE.normalize()];
    let marbles = directions.map(|way| (way, marble(&mut app, way * 1.4)));
    for (_, it) in marbles {
        app.world_mut().entity_mut(it).insert((Grounded::default(), SleepingDisabled));
    }
    scene::frames(&mut app, 400);
    for (way, it) in marbles {
        let at = scene::position(&app, it);
        assert!(at.distance(way * 1.1) < 0.05, "{way}: {at}");
        let ground = app.world().get::<Grounded>(it).unwrap().ground.unwrap();
        assert!(ground.entity == planet && ground.normal.distance(way) < 0.05, "{way}: {ground:?}");
    }
}

#[test]
fn wind_drags_as_its_equation_says() {
    for response in RESPONSES {
        for (drag, rate) in [(0.5, 10.0), (2.0, 64.0), (50.0, 64.0), (1e6, 64.0_f32)] {
            let mut app = app(response);
            app.insert_resource(Gravity(Vec3::ZERO));
            app.insert_resource(Time::<Fixed>::from_hz(f64::from(rate)));
            scene::frame_length(&mut app, 1.0 / rate);
            let wind = WindZone { velocity: Vec3::new(1.0, 2.0, 0.0), drag };
            app.world_mut().spawn((Wall::from(Cuboid::from_length(40.0)), wind));
            let marble = marble(&mut app, Vec3::ZERO);
            app.update();
            scene::frames(&mut app, 8);
            let expected = wind.velocity * -(-drag * 8.0 / rate).exp_m1();
            let is = velocity(&app, marble);
            assert!(is.distance(expected) < 0.01, "{response:?}, {drag}: {is}, not {expected}");
        }
    }
}

#[test]
fn winds_that_overlap_blow_together() {
    let mut app = app(Response::SoftStep);
    app.insert_resource(Gravity(Vec3::ZERO));
    for (velocity, drag) in [(Vec3::X, 1e3), (Vec3::Y, 1e3), (Vec3::Z, 2e3)] {
        let wind = WindZone { velocity, drag };
        app.world_mut().spawn((Wall::from(Cuboid::from_length(40.0)), wind));
    }
    let marble = marble(&mut app, Vec3::ZERO);
    scene::frames(&mut app, 20);
    let expected = Vec3::new(0.25, 0.25, 0.5);
    assert!(velocity(&app, marble).distance(expected) < 1e-3, "{}", velocity(&app, marble));
}

#[test]
fn wrong_numbers_are_refused_by_name_and_do_nothing() {
    for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut app = app(Response::SoftStep);
        app.insert_resource(Gravity(Vec3::ZERO));
        let marble = marble(&mut app, Vec3::ZERO);
        let zones = [
            app.world_mut().spawn((room(), GravityZone::Replace(Vec3::Z * wrong))).id(),
            app.world_mut().spawn((room(), GravityZone::Toward(wrong))).id(),
            app.world_mut().spawn((room(), WindZone { velocity: Vec3::X * wrong, drag: 1.0 })).id(),
            app.world_mut().spawn((room(), WindZone { velocity: Vec3::X, drag: -1.0 })).id(),
        ];
        app.update();
        let told: Vec<_> = app
            .world()
            .resource::<Messages<InputRefused>>()
            .get_cursor()
            .read(app.world().resource::<Messages<InputRefused>>())
            .filter_map(|it| it.entity)
            .collect();
        for zone in zones {
            assert!(told.contains(&zone), "{wrong}: {told:?}");
        }
        scene::frames(&mut app, 3);
        assert_eq!(scene::position(&app, marble), Vec3::ZERO, "{wrong}");
    }
}
