//! Walls that move are as fast as they are moved, in whatever schedule, however often frames come,
//! and nothing passes through them.

use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene::{self, STEP};

/// Frames a second, from a slide show to a benchmark.
const RATES: [f32; 9] = [10.0, 24.0, 30.0, 50.0, 60.0, 64.0, 144.0, 240.0, 1_000.0];

/// An app with a response, whose balls turn.
fn app(response: Response) -> App {
    let mut app = scene::app();
    let rotation = Rotation::Dynamic;
    app.insert_resource(TawModel(Model { response, rotation, ..Model::default() }));
    app
}

/// Moves an entity along x at a speed in m/s.
fn along_x(entity: Entity, speed: f32) -> impl Fn(Res<Time>, Query<&mut Transform>) {
    move |time, mut transforms| {
        transforms.get_mut(entity).unwrap().translation.x += speed * time.delta_secs();
    }
}

/// Linear and angular velocity of the only wall in the last step.
fn wall_velocity(app: &App) -> Option<[Vec3; 2]> {
    let walls = &app.world().resource::<TawWorld>().walls;
    let id = walls.id(0).unwrap();
    walls.motion(id).unwrap().map(|motion| {
        [motion.velocity, motion.angular_velocity].map(|it| Vec3::new(it.x, it.y, it.z))
    })
}

/// Center of the only wall, a sphere, in the world.
fn wall_center(app: &App) -> Vec3 {
    use bevy_taw::taw::shape::Shape;
    use bevy_taw::taw::world::WallShape;

    let WallShape::Solid(Shape::Sphere(sphere)) =
        &app.world().resource::<TawWorld>().walls.shapes()[0]
    else {
        panic!("no sphere");
    };
    Vec3::new(sphere.center.x, sphere.center.y, sphere.center.z)
}

#[test]
fn a_thin_plate_passes_nothing_at_any_frame_rate() {
    let mut passed = Vec::new();
    for response in [Response::Impulse, Response::EventDriven, Response::SoftStep] {
        for rate in RATES {
            for part in 0..6 {
                let mut app = app(response);
                scene::floor(&mut app);
                let plate = Wall::from(Cuboid::new(0.02, 2.0, 2.0));
                let plate = app.world_mut().spawn((plate, Transform::default())).id();
                let x = 1.0 + 0.07 * part as f32;
                let ball = scene::drop_marble(&mut app, 0.1, Vec3::new(x, 0.1, 0.0));
                scene::frame_length(&mut app, 1.0 / rate);
                app.add_systems(Update, along_x(plate, 3.0));
                scene::frames(&mut app, (2.0 * rate) as u32);
                let ahead = scene::position(&app, ball).x - scene::position(&app, plate).x;
                // The entity may be a frame ahead of the wall.
                if ahead < 0.1 - 3.0 * (1.0 / rate + STEP) {
                    passed.push(format!("{response:?}, {rate} frames a second, {part}: {ahead}"));
                }
            }
        }
    }
    assert!(passed.is_empty(), "{}: {passed:#?}", passed.len());
}

#[test]
fn a_wall_is_as_fast_as_it_is_moved_in_every_schedule() {
    for rate in RATES {
        for schedule in 0..5 {
            let mut app = app(Response::SoftStep);
            let wall = app.world_mut().spawn(Wall::from(Sphere::new(0.5))).id();
            scene::frame_length(&mut app, 1.0 / rate);
            scene::frames(&mut app, 3);
            let system = along_x(wall, 3.0);
            match schedule {
                0 => app.add_systems(PreUpdate, system),
                1 => app.add_systems(Update, system),
                2 => app.add_systems(FixedPreUpdate, system),
                3 => app.add_systems(FixedUpdate, system.after(TawSystems::Scatter)),
                _ => app.add_systems(FixedPostUpdate, system),
            };
            scene::frames(&mut app, (0.5 * rate) as u32 + 2);
            for _ in 0..(rate as u32).min(100) {
                app.update();
                let [velocity, turn] = wall_velocity(&app).unwrap();
                let error = (velocity - Vec3::X * 3.0).length();
                assert!(error < 0.02, "{rate} a second, {schedule}: {velocity}");
                assert_eq!(turn, Vec3::ZERO);
                let behind = scene::position(&app, wall).x - wall_center(&app).x;
                let most = 3.0 * (1.0 / rate + STEP) * 1.01;
                assert!((-1e-4..most).contains(&behind), "{rate}, {schedule}: {behind} behind");
            }
        }
    }
}

#[test]
fn a_wall_that_is_no_longer_moved_gets_where_its_entity_is() {
    for rate in RATES {
        let mut app = app(Response::SoftStep);
        let wall = app.world_mut().spawn(Wall::from(Sphere::new(0.5))).id();
        scene::frame_length(&mut app, 1.0 / rate);
        let turn = move |time: Res<Time>, mut transforms: Query<&mut Transform>| {
            if time.elapsed_secs() < 1.0 {
                let mut transform = transforms.get_mut(wall).unwrap();
                transform.translation.x += 2.0 * time.delta_secs();
                transform.rotate_y(time.delta_secs());
            }
        };
        app.add_systems(Update, turn);
        scene::frames(&mut app, (1.5 * rate) as u32);
        assert_eq!(wall_velocity(&app), None, "{rate} frames a second");
        let distance = wall_center(&app).distance(scene::position(&app, wall));
        assert!(distance < 1e-6, "{rate} frames a second: {distance} m away");
    }
}

#[test]
fn a_long_frame_makes_no_wall_faster_than_half_as_fast_again() {
    for long in [0.05, 0.1, 0.25] {
        let mut app = app(Response::Impulse);
        let wall = app.world_mut().spawn(Wall::from(Sphere::new(0.5))).id();
        app.add_systems(Update, along_x(wall, 2.0));
        scene::frames(&mut app, 20);
        let mut fastest = 0.0_f32;
        for frame in 0..120 {
            scene::frame_length(&mut app, if frame % 60 == 10 { long } else { STEP });
            app.update();
            fastest = fastest.max(wall_velocity(&app).unwrap()[0].x);
        }
        assert!((2.1..3.01).contains(&fastest), "after {long} s: {fastest} m/s");
        let behind = scene::position(&app, wall).x - wall_center(&app).x;
        assert!(behind < 2.0 * 2.0 * STEP * 1.01, "after {long} s: {behind} m behind");
    }
}

#[test]
fn a_turntable_turns_evenly_round_and_round() {
    for rate in [24.0, 64.0, 240.0] {
        for schedule in 0..2 {
            let mut app = app(Response::Impulse);
            let parent = app.world_mut().spawn(Transform::from_xyz(1.0, 0.0, 0.0)).id();
            let arm = (Wall::from(Cuboid::new(2.0, 0.1, 0.1)), Transform::from_xyz(1.0, 0.0, 0.0));
            app.world_mut().spawn((arm, ChildOf(parent)));
            scene::frame_length(&mut app, 1.0 / rate);
            let turn = move |time: Res<Time>, mut transforms: Query<&mut Transform>| {
                let axis = Dir3::from_xyz(0.3, 0.9, -0.2).unwrap();
                transforms.get_mut(parent).unwrap().rotate_axis(axis, 3.0 * time.delta_secs());
            };
            match schedule {
                0 => app.add_systems(Update, turn),
                _ => app.add_systems(FixedUpdate, turn.before(TawSystems::Gather)),
            };
            scene::frames(&mut app, (0.2 * rate) as u32);
            for _ in 0..(5.0 * rate) as u32 {
                app.update();
                let turn = wall_velocity(&app).unwrap()[1].length();
                assert!((turn - 3.0).abs() < 0.02, "{rate} a second, {schedule}: {turn} rad/s");
            }
        }
    }
}

#[test]
fn a_flipper_throws_in_its_first_step_if_it_is_driven() {
    for response in [Response::Impulse, Response::EventDriven, Response::SoftStep] {
        for driven in [false, true] {
            let mut app = app(response);
            let arm = (Wall::from(Cuboid::new(1.0, 0.1, 0.3)), Transform::from_xyz(0.5, 0.0, 0.0));
            let pivot = app.world_mut().spawn(Transform::default()).id();
            app.world_mut().spawn((arm, ChildOf(pivot)));
            if driven {
                app.world_mut().entity_mut(pivot).insert(Kinematic);
            }
            let ball = scene::drop_marble(&mut app, 0.1, Vec3::new(0.9, 0.15, 0.0));
            app.world_mut().entity_mut(ball).insert(Velocity::default());
            scene::frames(&mut app, 30);
            // Its tip goes from rest to 20 m/s, for one step.
            let turn = Quat::from_rotation_z(20.0 * STEP);
            app.world_mut().get_mut::<Transform>(pivot).unwrap().rotation = turn;
            app.update();
            app.update();
            let speed = app.world().get::<Velocity>(ball).unwrap().length();
            assert_eq!(speed > 15.0, driven, "{response:?}: {speed} m/s");
        }
    }
}
