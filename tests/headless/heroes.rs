//! Ground under marbles, and marbles that a player rolls.

use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene::{self, random};

const RESPONSES: [Response; 5] = [
    Response::SoftStep,
    Response::Impulse,
    Response::EventDriven,
    Response::Displacement,
    Response::Penalty(ContactLaw::SpringDashpot),
];

pub fn app(response: Response) -> App {
    let mut app = scene::app();
    let substeps = if response == Response::EventDriven { 1 } else { 4 };
    app.insert_resource(TawModel(Model { response, substeps, ..Model::GAME }));
    app
}

pub fn ground(app: &App, marble: Entity) -> Option<Ground> {
    app.world().get::<Grounded>(marble).unwrap().ground
}

pub fn grounded(app: &mut App, radius: f32, at: Vec3) -> Entity {
    let marble = scene::drop_marble(app, radius, at);
    app.world_mut().entity_mut(marble).insert(Grounded::default());
    marble
}

#[test]
fn what_lies_is_grounded_and_what_flies_is_not() {
    for response in RESPONSES {
        let mut app = app(response);
        let floor = scene::floor(&mut app);
        let marble = grounded(&mut app, 0.25, Vec3::new(1.0, 1.0, 2.0));
        scene::frames(&mut app, 10);
        assert_eq!(ground(&app, marble), None, "{response:?}");
        scene::frames(&mut app, 300);
        for frame in 0..30 {
            app.update();
            let found = ground(&app, marble);
            let found = found.unwrap_or_else(|| panic!("{response:?}: none in frame {frame}"));
            assert_eq!((found.entity, found.normal), (floor, Vec3::Y), "{response:?}");
            let below = scene::position(&app, marble) - Vec3::Y * 0.25;
            assert!(found.point.distance(below) < 0.01, "{response:?}: {found:?}, not {below}");
            assert_eq!(found.velocity, Vec3::ZERO, "{response:?}");
        }
        app.world_mut().get_mut::<Transform>(marble).unwrap().translation.y = 1.0;
        app.update();
        assert_eq!(ground(&app, marble), None, "{response:?}");
    }
}

#[test]
fn slopes_are_ground_up_to_their_limit() {
    for case in 0..200 {
        let number = |i: u64| random(case * 16 + i);
        let response = RESPONSES[case as usize % RESPONSES.len()];
        let mut app = app(response);
        let (slope, turn) = (number(0) * 1.4, number(1) * 6.3);
        let limit = 0.2 + number(2) * 1.2;
        let rotation = Quat::from_rotation_y(turn) * Quat::from_rotation_x(slope);
        app.world_mut().spawn((Wall::default(), Transform::from_rotation(rotation)));
        let radius = 0.05 + number(3);
        let marble = grounded(&mut app, radius, rotation * Vec3::Y * (radius * 0.999));
        app.world_mut().get_mut::<Grounded>(marble).unwrap().max_slope = limit;
        app.update();
        let expected = slope <= limit;
        let close = (slope - limit).abs() < 1e-3;
        let is = ground(&app, marble);
        let case = format!("{response:?}: slope {slope}, limit {limit}, radius {radius}: {is:?}");
        assert!(close || is.is_some() == expected, "{case}");
        assert!(is.is_none_or(|it| it.normal.angle_between(rotation * Vec3::Y) < 1e-3), "{case}");
    }
}

/// The wall and the floor of a mesh, whose corner is at the origin.
fn corner(app: &mut App) {
    let x = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let points = vec![
        x(0.0, 0.0, -9.0),
        x(9.0, 0.0, -9.0),
        x(9.0, 0.0, 9.0),
        x(0.0, 0.0, 9.0),
        x(0.0, 9.0, -9.0),
        x(0.0, 9.0, 9.0),
    ];
    let triangles = vec![[0, 2, 1], [0, 3, 2], [0, 4, 5], [0, 5, 3]];
    app.world_mut().spawn(Wall::Mesh { points, triangles });
}

#[test]
fn a_wall_is_no_ground_though_it_is_one_mesh_with_the_floor() {
    let mut app = app(Response::SoftStep);
    corner(&mut app);
    let marble = grounded(&mut app, 0.25, Vec3::new(0.25, 0.25, 0.0));
    app.world_mut()
        .entity_mut(marble)
        .insert(ExternalForce { force: Vec3::NEG_X * 500.0, ..default() });
    scene::frames(&mut app, 30);
    assert!(ground(&app, marble).is_some());
    app.world_mut().entity_mut(marble).insert(Velocity(Vec3::Y * 5.0));
    app.update();
    for frame in 0..15 {
        app.update();
        assert_eq!(ground(&app, marble), None, "in frame {frame}");
    }
}

#[test]
fn the_side_of_a_ball_is_no_ground() {
    for response in [Response::SoftStep, Response::Impulse, Response::EventDriven] {
        let mut app = app(response);
        app.world_mut().spawn(Wall::from(Sphere::new(2.0)));
        let marble = grounded(&mut app, 0.25, Vec3::new(0.0, 2.25, 0.0));
        app.world_mut().entity_mut(marble).insert(Velocity(Vec3::X));
        for _ in 0..200 {
            app.update();
            let at = scene::position(&app, marble);
            let slope = at.angle_between(Vec3::Y).to_degrees();
            if let Some(found) = ground(&app, marble) {
                assert!(slope < 53.0 && at.y > 0.0, "{response:?}: {slope}: {found:?}");
            }
        }
    }
}

#[test]
fn capsules_stand_on_ground() {
    for response in [Response::Impulse, Response::Displacement] {
        let mut app = app(response);
        scene::floor(&mut app);
        for turn in [0.0, 0.7, std::f32::consts::FRAC_PI_2] {
            let height = 0.25 + 0.5 * turn.cos().abs();
            let place =
                Transform::from_xyz(0.0, height, 0.0).with_rotation(Quat::from_rotation_z(turn));
            let capsule = (Marble::new(0.25), HalfLength(0.5), Grounded::default(), place);
            let capsule = app.world_mut().spawn(capsule).id();
            scene::frames(&mut app, 2);
            assert!(ground(&app, capsule).is_some(), "{response:?}, {turn}");
            app.world_mut().despawn(capsule);
        }
    }
}

#[test]
fn what_asks_asleep_is_answered() {
    let mut app = app(Response::SoftStep);
    let floor = scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.1, Vec3::Y * 0.1);
    scene::frames(&mut app, 200);
    assert!(app.world().get::<Sleeping>(marble).is_some());
    app.world_mut().entity_mut(marble).insert(MarbleController::default());
    scene::frames(&mut app, 3);
    assert_eq!(ground(&app, marble).map(|ground| ground.entity), Some(floor));
    control(&mut app, marble).jump = true;
    assert!(apex(&mut app, marble, 60) + 0.15 > 1.0);
}

#[test]
fn what_sleeps_keeps_its_ground() {
    let mut app = app(Response::SoftStep);
    let floor = scene::floor(&mut app);
    let marble = grounded(&mut app, 0.1, Vec3::Y * 0.1);
    scene::frames(&mut app, 200);
    assert!(app.world().get::<Sleeping>(marble).is_some());
    assert_eq!(ground(&app, marble).map(|ground| ground.entity), Some(floor));
}

/// A hero of 25 cm on a floor.
fn hero(app: &mut App, controller: MarbleController, friction: f32) -> Entity {
    scene::floor(app);
    let surface = SurfaceMaterial { friction, restitution: 0.0, ..default() };
    let place = Transform::from_xyz(0.0, 0.25, 0.0);
    let hero = app.world_mut().spawn((controller, Marble::new(0.25), surface, place)).id();
    scene::frames(app, 2);
    hero
}

pub fn control(app: &mut App, hero: Entity) -> Mut<'_, MarbleController> {
    app.world_mut().get_mut::<MarbleController>(hero).unwrap()
}

pub fn velocity(app: &App, marble: Entity) -> Vec3 {
    **app.world().get::<Velocity>(marble).unwrap()
}

#[test]
fn a_hero_rolls_to_its_speed_and_brakes() {
    for drive in [Drive::Torque, Drive::Force] {
        for response in [Response::SoftStep, Response::Impulse, Response::EventDriven] {
            let mut app = app(response);
            let controller =
                MarbleController { drive, acceleration: 4.0, max_speed: 3.0, ..default() };
            let hero = hero(&mut app, controller, 0.8);
            let ahead = Vec3::new(0.6, 0.0, -0.8);
            control(&mut app, hero).direction = ahead * 5.0;
            scene::frames(&mut app, 16);
            let case = format!("{drive:?} by {response:?}");
            // A force also turns the ball: two sevenths of it go there.
            let part = if drive == Drive::Torque { 1.0 } else { 5.0 / 7.0 };
            let speed = velocity(&app, hero).dot(ahead);
            assert!((speed - 4.0 * part * 0.25).abs() < 0.1, "{case}: {speed} m/s after 1/4 s");
            scene::frames(&mut app, 128);
            assert!(velocity(&app, hero).distance(ahead * 3.0) < 0.05, "{case}");
            control(&mut app, hero).direction = Vec3::ZERO;
            scene::frames(&mut app, 128);
            assert!(velocity(&app, hero).length() < 0.05, "{case}: {}", velocity(&app, hero));
        }
    }
}

#[test]
fn the_default_hero_rolls_without_slip_on_the_default_floor() {
    for response in [Response::SoftStep, Response::Impulse, Response::EventDriven] {
        let mut app = app(response);
        scene::floor(&mut app);
        let place = Transform::from_xyz(0.0, 0.25, 0.0);
        let hero = (MarbleController::default(), Marble::new(0.25), place);
        let hero = app.world_mut().spawn(hero).id();
        scene::frames(&mut app, 2);
        for (direction, frames) in [(Vec3::X, 64), (Vec3::X, 128), (Vec3::ZERO, 64)] {
            control(&mut app, hero).direction = direction;
            let before = velocity(&app, hero).x;
            scene::frames(&mut app, frames);
            let (speed, spin) = (velocity(&app, hero), app.world().get::<AngularVelocity>(hero));
            let slip = speed + spin.unwrap().cross(Vec3::Y * -0.25);
            assert!(slip.length() < 0.1, "{response:?} at {speed}: {slip}");
            let gained = (speed.x - before).abs() * 64.0 / frames as f32;
            let reached = (speed.x - 6.0).abs() < 0.1;
            assert!(reached || (gained - 2.5).abs() < 0.2, "{response:?}: {gained} m/s²");
        }
    }
}

#[test]
fn torque_slips_on_ice_and_a_force_does_not() {
    for (drive, moves) in [(Drive::Torque, false), (Drive::Force, true)] {
        let mut app = app(Response::SoftStep);
        let hero = hero(&mut app, MarbleController { drive, ..default() }, 0.0);
        control(&mut app, hero).direction = Vec3::X;
        scene::frames(&mut app, 64);
        assert_eq!(velocity(&app, hero).x > 1.0, moves, "{drive:?}");
    }
}

/// Greatest height of the hero's lowest point above the floor in so many frames.
fn apex(app: &mut App, hero: Entity, frames: u32) -> f32 {
    let mut highest = 0.0_f32;
    for _ in 0..frames {
        app.update();
        highest = highest.max(scene::position(app, hero).y - 0.25);
    }
    highest
}

#[test]
fn a_jump_is_as_high_as_its_speed() {
    for response in [Response::SoftStep, Response::Impulse, Response::EventDriven] {
        for jump_speed in [2.0, 4.9, 8.0_f32] {
            let mut app = app(response);
            let hero = hero(&mut app, MarbleController { jump_speed, ..default() }, 0.5);
            control(&mut app, hero).jump = true;
            let height = jump_speed * jump_speed / (2.0 * 9.81);
            let reached = apex(&mut app, hero, 120);
            assert!((reached - height).abs() < 0.03 * height + 0.01, "{response:?}: {reached}");
            // Once, though it is asked for in each frame of the rise.
            assert!(apex(&mut app, hero, 60) < 0.02, "{response:?} jumps again");
        }
    }
}

#[test]
fn a_second_jump_in_the_air_is_none() {
    for (radius, rate) in [(0.5, 240.0), (0.25, 64.0), (2.0, 1000.0)] {
        let mut app = app(Response::SoftStep);
        app.insert_resource(Time::<Fixed>::from_hz(rate));
        scene::frame_length(&mut app, 1.0 / rate as f32);
        scene::floor(&mut app);
        let controller = MarbleController { jump_speed: 2.0, ..default() };
        let place = Transform::from_xyz(0.0, radius, 0.0);
        let hero = app.world_mut().spawn((controller, Marble::new(radius), place)).id();
        scene::frames(&mut app, 30);
        let mut highest = 0.0_f32;
        for frame in 0..(rate * 0.25) as u32 {
            // For a tenth of a second, in each frame.
            control(&mut app, hero).jump = f64::from(frame) < rate * 0.1;
            app.update();
            highest = highest.max(scene::position(&app, hero).y - radius);
        }
        assert!((highest - 0.204).abs() < 0.02, "{radius}, {rate}: {highest}");
    }
}

#[test]
fn a_jump_waits_for_the_ground_and_may_come_a_bit_late() {
    for (before, jumps) in [(5, true), (20, false)] {
        let mut app = app(Response::SoftStep);
        let hero = hero(&mut app, MarbleController::default(), 0.5);
        app.world_mut().get_mut::<Transform>(hero).unwrap().translation.y = 2.25;
        // It falls 2 m: 41 frames.
        scene::frames(&mut app, 41 - before);
        control(&mut app, hero).jump = true;
        scene::frames(&mut app, before + 2);
        assert_eq!(apex(&mut app, hero, 40) > 1.0, jumps, "asked {before} frames before");
    }
    for (late, jumps) in [(4, true), (12, false)] {
        let mut app = app(Response::SoftStep);
        let hero = hero(&mut app, MarbleController::default(), 0.5);
        app.world_mut().get_mut::<Transform>(hero).unwrap().translation.y = 3.0;
        scene::frames(&mut app, late);
        control(&mut app, hero).jump = true;
        app.update();
        assert_eq!(velocity(&app, hero).y > 4.0, jumps, "{late} frames late");
    }
}

#[test]
fn a_hero_that_nobody_steers_may_sleep_and_a_wrong_number_changes_nothing() {
    let mut app = app(Response::SoftStep);
    let hero = hero(&mut app, MarbleController::default(), 0.5);
    scene::frames(&mut app, 200);
    assert!(app.world().get::<Sleeping>(hero).is_some());
    for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let at = scene::position(&app, hero);
        control(&mut app, hero).direction = Vec3::X * wrong;
        control(&mut app, hero).jump = true;
        scene::frames(&mut app, 5);
        assert_eq!(scene::position(&app, hero), at, "direction {wrong}");
        let spoilt = [
            MarbleController { max_speed: wrong, ..default() },
            MarbleController { acceleration: -wrong.abs(), ..default() },
            MarbleController { jump_speed: wrong, ..default() },
        ];
        for controller in spoilt {
            *control(&mut app, hero) = MarbleController { direction: Vec3::X, ..controller };
            control(&mut app, hero).jump = true;
            scene::frames(&mut app, 5);
            assert_eq!(scene::position(&app, hero), at, "{controller:?}");
        }
    }
}

#[test]
fn a_camera_says_where_ahead_is() {
    let look = |at: Vec3, up: Vec3| {
        GlobalTransform::from(Transform::from_translation(at).looking_at(Vec3::ZERO, up))
    };
    let seen = |camera: &GlobalTransform, x: f32, y: f32| {
        MarbleController::seen_from(camera, Vec2::new(x, y), Dir3::Y)
    };
    let behind = look(Vec3::new(0.0, 5.0, 10.0), Vec3::Y);
    assert!(seen(&behind, 0.0, 1.0).distance(Vec3::NEG_Z) < 1e-5);
    assert!(seen(&behind, 1.0, 0.0).distance(Vec3::X) < 1e-5);
    let above = look(Vec3::Y * 10.0, Vec3::NEG_X);
    assert!(seen(&above, 0.0, 0.5).distance(Vec3::NEG_X * 0.5) < 1e-5);
    assert!((seen(&behind, 1.0, 1.0).length() - 1.0).abs() < 1e-5);
}

#[test]
fn who_passes_through_the_platform_does_not_stand_on_it_and_cannot_jump() {
    for response in RESPONSES {
        let mut app = app(response);
        let platform = (Wall::from(Cuboid::new(6.0, 0.2, 6.0)), Transform::from_xyz(0.0, 4.9, 0.0));
        let platform = app.world_mut().spawn(platform).id();
        let hero = grounded(&mut app, 0.5, Vec3::Y * 5.5);
        let controller = MarbleController { coyote_time: 0.0, ..default() };
        app.world_mut().entity_mut(hero).insert(controller);
        scene::frames(&mut app, 20);
        assert_eq!(ground(&app, hero).map(|it| it.entity), Some(platform), "{response:?}");
        app.world_mut().entity_mut(hero).insert(IgnoreCollisions(vec![platform]));
        app.update();
        assert_eq!(ground(&app, hero), None, "{response:?}");
        control(&mut app, hero).jump = true;
        assert!(apex(&mut app, hero, 60) < 5.51, "{response:?}");
    }
}

/// A marble sleeps on a floor, within three walls that it passes through.
#[test]
fn asleep_it_stands_on_what_it_collides_with() {
    let mut app = app(Response::SoftStep);
    let floor = scene::floor(&mut app);
    let mut wall = || {
        let wall = (Wall::from(Cuboid::new(6.0, 0.1, 6.0)), Transform::from_xyz(0.0, 0.35, 0.0));
        app.world_mut().spawn(wall).id()
    };
    let [other_layer, named, one_way] = [wall(), wall(), wall()];
    app.world_mut().entity_mut(other_layer).insert(CollisionLayers::NONE);
    app.world_mut().entity_mut(one_way).insert(OneWay::default());
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    app.world_mut().entity_mut(marble).insert(IgnoreCollisions(vec![named]));
    scene::frames(&mut app, 200);
    assert!(app.world().get::<Sleeping>(marble).is_some());
    app.world_mut().entity_mut(marble).insert(Grounded::default());
    app.update();
    assert_eq!(ground(&app, marble).map(|ground| ground.entity), Some(floor));
}

#[test]
fn a_hero_that_ran_is_at_rest_again_where_it_was_restored_at_rest() {
    for drive in [Drive::Torque, Drive::Force] {
        let mut app = app(Response::SoftStep);
        scene::floor(&mut app);
        let hero = hero(&mut app, MarbleController { drive, ..default() }, 2.0);
        scene::frames(&mut app, 60);
        let (at, saved) =
            (scene::position(&app, hero), app.world().resource::<TawWorld>().snapshot());
        control(&mut app, hero).direction = Vec3::X;
        app.world_mut().entity_mut(hero).insert(Velocity(Vec3::X * 30.0));
        scene::frames(&mut app, 30);
        assert!(scene::position(&app, hero).distance(at) > 1.0, "{drive:?}");
        control(&mut app, hero).direction = Vec3::ZERO;
        app.world_mut().resource_mut::<TawWorld>().restore(&saved);
        scene::frames(&mut app, 10);
        let moved = scene::position(&app, hero).distance(at);
        assert!(moved < 1e-3, "{drive:?}: {moved} m");
    }
}

#[test]
fn a_hero_restored_in_the_air_does_not_jump_from_the_ground_of_before() {
    let mut app = app(Response::SoftStep);
    scene::floor(&mut app);
    let hero = hero(&mut app, MarbleController::default(), 0.5);
    app.world_mut().get_mut::<Transform>(hero).unwrap().translation.y = 8.0;
    scene::frames(&mut app, 5);
    let saved = app.world().resource::<TawWorld>().snapshot();
    scene::frames(&mut app, 200);
    app.world_mut().resource_mut::<TawWorld>().restore(&saved);
    control(&mut app, hero).jump = true;
    scene::frames(&mut app, 5);
    let speed = app.world().get::<Velocity>(hero).unwrap().y;
    assert!(speed < 0.0, "{speed} m/s");
}
