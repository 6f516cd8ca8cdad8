//! Drawn transforms between fixed steps.

use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::bodies::{are_true, carry, truth};
use crate::scene::{self, STEP};

/// A marble that moves 1 m per step along x, drawn four times per step.
fn app() -> (App, Entity) {
    let mut app = scene::smooth_app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
    app.world_mut().entity_mut(marble).insert(Velocity(Vec3::X / STEP));
    scene::frames(&mut app, 2);
    scene::frame_length(&mut app, STEP / 4.0);
    (app, marble)
}

#[test]
fn motion_is_even_between_steps() {
    let (mut app, marble) = app();
    let mut last = scene::position(&app, marble).x;
    for frame in 0..20 {
        app.update();
        let now = scene::position(&app, marble).x;
        assert!((now - last - 0.25).abs() < 1e-5, "frame {frame} moved it by {}", now - last);
        last = now;
    }
}

/// A body is drawn on its way as a marble is, and goes where it is put between two steps.
#[test]
fn a_body_is_drawn_evenly_and_keeps_what_is_written_between_steps() {
    let (mut app, _) = app();
    app.insert_resource(TawModel(Model::GAME));
    let body = (
        Body::from(Cuboid::new(0.2, 0.2, 0.2)),
        Velocity(Vec3::X / STEP),
        AngularVelocity(Vec3::Z * 8.0),
        Transform::from_xyz(0.0, 5.0, 0.0),
    );
    let body = app.world_mut().spawn(body).id();
    scene::frames(&mut app, 8);
    let mut last = scene::position(&app, body).x;
    for frame in 0..20 {
        app.update();
        let now = scene::position(&app, body).x;
        assert!((now - last - 0.25).abs() < 1e-4, "frame {frame} moved it by {}", now - last);
        last = now;
    }
    for wait in 0..4 {
        scene::frames(&mut app, wait);
        let put = Transform::from_xyz(100.0, 7.0, f32::from(wait as u8));
        *app.world_mut().get_mut::<Transform>(body).unwrap() = put;
        scene::frames(&mut app, 4);
        let drawn = scene::position(&app, body);
        assert!((100.0..=101.01).contains(&drawn.x), "after {wait}: {drawn}");
        assert_eq!((drawn.y, drawn.z), (7.0, put.translation.z), "after {wait}");
        let turned = app.world().get::<Transform>(body).unwrap().rotation;
        assert!(turned.angle_between(Quat::IDENTITY) < 8.0 * STEP + 1e-3, "after {wait}");
    }
}

#[test]
fn what_crosses_a_side_of_a_periodic_box_is_drawn_on_its_way() {
    let (mut app, marble) = app();
    let period = [Some(4.25), None, None];
    app.world_mut().resource_mut::<TawWorld>().set_period(period).unwrap();
    let mut last = scene::position(&app, marble).x;
    for frame in 0..60 {
        app.update();
        let now = scene::position(&app, marble).x;
        let way = (now - last).rem_euclid(4.25);
        assert!((way - 0.25).abs() < 1e-5, "frame {frame} moved it by {way}");
        assert!(now.abs() <= 3.0, "frame {frame} drew it at {now}");
        last = now;
    }
}

#[test]
fn a_teleport_between_steps_is_neither_undone_nor_smeared() {
    // At each of the four frames within a step, and exactly onto the ends of the
    // step that is being drawn. (Where it is drawn already, nobody can teleport it.)
    let cases = (0..4).flat_map(|wait| [(wait, 100.0), (wait, 1.0), (wait, 2.0)]);
    for (wait, to) in cases.filter(|case| *case != (0, 1.0)) {
        let (mut app, marble) = app();
        scene::frames(&mut app, wait);
        app.world_mut().get_mut::<Transform>(marble).unwrap().translation = Vec3::X * to;
        scene::frames(&mut app, 4);
        let x = app.world().resource::<TawWorld>().marbles.position()[0].x;
        assert_eq!(x, to + 1.0, "teleported to {to} after {wait} frames, one step ago");
        let drawn = scene::position(&app, marble).x;
        assert!((to..=to + 1.0).contains(&drawn), "teleported to {to}, drawn at {drawn}");
    }
}

#[test]
fn a_marble_that_is_scaled_for_show_keeps_its_way() {
    let heights = [false, true].map(|scaled| {
        let mut app = scene::smooth_app();
        // Frames shorter than steps, so that what is drawn lies between two steps.
        scene::frame_length(&mut app, STEP * 0.7);
        let marble = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
        for frame in 0..50_u16 {
            if scaled {
                let scale = Vec3::splat(1.0 + f32::from(frame) / 100.0);
                app.world_mut().get_mut::<Transform>(marble).unwrap().scale = scale;
            }
            app.update();
        }
        app.world().resource::<TawWorld>().marbles.position()[0].y
    });
    assert_eq!(heights[0], heights[1]);
}

#[test]
fn turning_is_even_between_steps_once_it_is_modelled() {
    let (mut app, marble) = app();
    let turned = |app: &App| app.world().get::<Transform>(marble).unwrap().rotation;
    app.world_mut().entity_mut(marble).insert(AngularVelocity(Vec3::Y * 0.25 / STEP));
    scene::frames(&mut app, 8);
    assert_eq!(turned(&app), Quat::IDENTITY, "the model has no rotation yet");
    app.world_mut().resource_mut::<TawModel>().rotation = Rotation::Rolling;
    scene::frames(&mut app, 4);
    app.world_mut().get_mut::<AngularVelocity>(marble).unwrap().y = 0.25 / STEP;
    scene::frames(&mut app, 12);
    let mut last = turned(&app);
    for frame in 0..20 {
        app.update();
        let angle = last.angle_between(turned(&app));
        assert!((angle - 0.25 / 4.0).abs() < 1e-3, "frame {frame} turned it by {angle}");
        last = turned(&app);
    }
    app.world_mut().resource_mut::<TawModel>().rotation = Rotation::None;
    scene::frames(&mut app, 12);
    let last = turned(&app);
    scene::frames(&mut app, 12);
    assert_eq!(turned(&app), last);
}

#[test]
fn a_refused_place_is_not_drawn_and_not_tried_again() {
    let (mut app, marble) = app();
    app.world_mut().get_mut::<Transform>(marble).unwrap().translation.y = f32::NAN;
    let mut refused = 0;
    for _ in 0..20 {
        app.update();
        let messages = app.world().resource::<bevy::ecs::message::Messages<InputRefused>>();
        refused += messages.iter_current_update_messages().count();
    }
    assert_eq!(refused, 1);
    assert!(scene::position(&app, marble).is_finite());
}

#[test]
fn a_teleport_within_a_step_is_not_drawn_as_a_way() {
    let (mut app, marble) = app();
    let jump = move |mut transforms: Query<&mut Transform>, mut steps: Local<u32>| {
        *steps += 1;
        if *steps == 3 {
            transforms.get_mut(marble).unwrap().translation.x = 100.0;
        }
    };
    app.add_systems(FixedUpdate, jump.before(TawSystems::Gather));
    for _ in 0..30 {
        app.update();
        let x = scene::position(&app, marble).x;
        assert!(!(6.0..100.0).contains(&x), "drawn at {x}, on the way to 100");
    }
    assert!(scene::position(&app, marble).x > 100.0);
}

#[test]
fn a_nudge_in_every_frame_moves_the_marble_and_freezes_nothing() {
    // A lift of 1 mm a frame in y, of a marble that moves 1 m a step along x and falls.
    for (along, frame) in [(Vec3::Y, STEP / 4.0), (Vec3::Y, STEP * 2.5), (Vec3::ONE, STEP / 4.0)] {
        let places = [0.0, 1e-3].map(|lift| {
            let (mut app, marble) = app();
            app.insert_resource(Gravity(Vec3::NEG_Y * 9.81));
            scene::frame_length(&mut app, frame);
            let nudge = move |mut transforms: Query<&mut Transform>| {
                transforms.get_mut(marble).unwrap().translation += along * lift;
            };
            app.add_systems(Update, nudge);
            scene::frames(&mut app, 64);
            scene::position(&app, marble)
        });
        let moved = places[1] - places[0];
        assert!((moved - along * 0.064).length() < 2e-3, "{frame} s: moved by {moved}");
    }
}

#[test]
fn a_nudged_marble_is_drawn_evenly() {
    let (mut app, marble) = app();
    let nudge = move |mut transforms: Query<&mut Transform>| {
        transforms.get_mut(marble).unwrap().translation.y += 0.01;
    };
    app.add_systems(Update, nudge);
    scene::frames(&mut app, 4);
    let mut last = scene::position(&app, marble);
    for frame in 0..20 {
        app.update();
        let now = scene::position(&app, marble);
        let way = now - last;
        assert!((way - Vec3::new(0.25, 0.01, 0.0)).length() < 1e-4, "frame {frame}: {way}");
        last = now;
    }
}

#[test]
fn a_height_that_is_written_in_every_frame_holds() {
    let (mut app, marble) = app();
    app.insert_resource(Gravity(Vec3::NEG_Y * 9.81));
    let pin = move |mut transforms: Query<&mut Transform>| {
        transforms.get_mut(marble).unwrap().translation.y = 5.0;
    };
    app.add_systems(Update, pin);
    let before = scene::position(&app, marble).x;
    scene::frames(&mut app, 40);
    let world = app.world().resource::<TawWorld>().marbles.position()[0];
    // Gravity moves it by less than that in the last step.
    assert!((world.y - 5.0).abs() < 0.05, "{world:?}");
    assert!((world.x - before - 10.0).abs() < 1.5, "{world:?}");
}

#[test]
fn a_marked_write_is_a_place_however_near() {
    let (mut app, marble) = app();
    scene::frames(&mut app, 2);
    let drawn = scene::position(&app, marble);
    let to = drawn + Vec3::new(0.1, 0.2, 0.0);
    app.world_mut().get_mut::<Transform>(marble).unwrap().translation = to;
    app.world_mut().entity_mut(marble).insert(Teleport);
    scene::frames(&mut app, 4);
    let x = app.world().resource::<TawWorld>().marbles.position()[0];
    assert_eq!((x.x, x.y), (to.x + 1.0, to.y));
    assert!(!app.world().entity(marble).contains::<Teleport>());
}

#[test]
fn a_child_of_what_moves_in_every_frame_is_drawn_where_it_is() {
    // One that floats, and one that moves 1 m a step, below a parent that moves and turns.
    for speed in [0.0, 1.0] {
        let mut app = scene::smooth_app();
        app.insert_resource(Gravity(Vec3::ZERO));
        scene::frame_length(&mut app, STEP / 4.0);
        let parent = app.world_mut().spawn(Transform::default()).id();
        let marble = scene::drop_marble(&mut app, 0.5, Vec3::new(0.0, 3.0, 0.0));
        app.world_mut()
            .entity_mut(marble)
            .insert((ChildOf(parent), Velocity(Vec3::X * speed / STEP)));
        let carry = move |mut transforms: Query<&mut Transform>| {
            let mut carrier = transforms.get_mut(parent).unwrap();
            carrier.translation.z += 0.4;
            carrier.rotate_y(0.03);
        };
        scene::frames(&mut app, 8);
        app.add_systems(Update, carry);
        let drawn = |app: &App| app.world().get::<GlobalTransform>(marble).unwrap().translation();
        let mut last = drawn(&app);
        for frame in 0..40 {
            app.update();
            let now = drawn(&app);
            let way = now - last;
            assert!((way - Vec3::X * speed / 4.0).length() < 1e-4, "frame {frame}: {way}");
            last = now;
        }
    }
}

/// In the fixed schedules, all of them are where they truly are.
#[test]
fn what_marbles_and_bodies_carry_is_drawn_on_its_own_way() {
    for kinds in 0..8 {
        let mut app = scene::smooth_app();
        app.insert_resource(TawModel(Model::GAME)).insert_resource(Gravity(Vec3::ZERO));
        scene::frame_length(&mut app, STEP / 4.0);
        let root = app.world_mut().spawn(Transform::default()).id();
        let chain = carry(&mut app, root, kinds);
        let turn = move |mut transforms: Query<&mut Transform>| {
            let mut carrier = transforms.get_mut(root).unwrap();
            carrier.translation.z += 0.2;
            carrier.rotate_y(0.03);
        };
        scene::frames(&mut app, 8);
        app.add_systems(FixedUpdate, are_true.before(TawSystems::Gather)).add_systems(Update, turn);
        let places = |app: &App| {
            let place = |it| app.world().get::<GlobalTransform>(it).unwrap().translation();
            [chain[0], chain[1], chain[2]].map(place)
        };
        let mut last = places(&app);
        for frame in 0..40 {
            app.update();
            let now = places(&app);
            for (i, speed) in [0.1, 0.2, 0.3].into_iter().enumerate() {
                let off = now[i] - last[i] - Vec3::X * speed / 4.0;
                assert!(off.length() < 1e-3, "bodies {kinds:b}, frame {frame}, {i}: {off}");
            }
            last = now;
        }
    }
}

/// A wall on a body is drawn with it, and a body on a wall on its own way.
#[test]
fn walls_and_bodies_on_each_other_are_drawn_where_they_are() {
    let mut app = scene::smooth_app();
    app.insert_resource(TawModel(Model::GAME)).insert_resource(Gravity(Vec3::ZERO));
    scene::frame_length(&mut app, STEP / 4.0);
    let body = |height: f32, velocity: Vec3| {
        (Body::default(), Velocity(velocity), Transform::from_xyz(0.0, height, 0.0))
    };
    let carrier = app.world_mut().spawn(body(9.0, Vec3::X * 8.0)).id();
    let wall = || (Wall::from(Cuboid::default()), Transform::from_xyz(0.0, 3.0, 0.0));
    let on_body = app.world_mut().spawn((wall(), ChildOf(carrier))).id();
    let lift = app.world_mut().spawn((Lift, wall())).id();
    let on_wall = app.world_mut().spawn((body(-3.0, Vec3::ZERO), ChildOf(lift))).id();
    let rise = |mut lifts: Query<&mut Transform, With<Lift>>| {
        lifts.iter_mut().for_each(|mut place| place.translation.z += 0.1);
    };
    app.add_systems(FixedUpdate, rise.before(TawSystems::Gather));
    scene::frames(&mut app, 8);
    for frame in 0..20 {
        app.update();
        let drawn = |it| app.world().get::<GlobalTransform>(it).unwrap().translation();
        assert_eq!(drawn(carrier), scene::position(&app, carrier), "frame {frame}");
        let above = drawn(on_body) - drawn(carrier) - Vec3::Y * 3.0;
        assert!(above.length() < 1e-4, "frame {frame}: {above}");
        let off = drawn(on_wall) - truth(&app, on_wall);
        assert!(off.length() < 1e-4, "frame {frame}: {off}");
    }
}

#[derive(Component)]
struct Lift;

/// Height at which an entity is drawn, in metres.
fn drawn(app: &App, entity: Entity) -> f32 {
    app.world().get::<GlobalTransform>(entity).unwrap().translation().y
}

/// Lift with a rider: the entities of the lift, its wall, what is drawn of it, and the rider. The wall is
/// the lift, or a child of it.
fn lift(app: &mut App, has_child: bool) -> [Entity; 4] {
    let wall = || Wall::from(Cuboid::new(8.0, 1.0, 8.0));
    let picture = app.world_mut().spawn(Transform::default()).id();
    let lift = app.world_mut().spawn((Lift, Transform::default())).add_child(picture).id();
    let wall = if has_child {
        let wall = app.world_mut().spawn((wall(), Transform::default())).id();
        app.world_mut().entity_mut(lift).add_child(wall);
        wall
    } else {
        app.world_mut().entity_mut(lift).insert(wall());
        lift
    };
    let surface = SurfaceMaterial { restitution: 0.0, ..default() };
    let rider = (Marble::new(0.25), surface, Transform::from_xyz(0.0, 0.75, 0.0));
    let rider = app.world_mut().spawn(rider).id();
    [lift, wall, picture, rider]
}

#[test]
fn a_lift_is_drawn_under_its_rider_at_any_frame_rate_in_any_schedule() {
    for rate in [10.0, 24.0, 60.0, 64.0, 144.0, 500.0] {
        for (in_update, has_child) in [(false, false), (true, false), (false, true), (true, true)] {
            let mut app = scene::smooth_app();
            app.insert_resource(TawModel::default());
            let [lift, wall, picture, rider] = lift(&mut app, has_child);
            let rise = |mut lifts: Query<&mut Transform, With<Lift>>, time: Res<Time>| {
                for mut place in &mut lifts {
                    place.translation.y += time.delta_secs();
                }
            };
            if in_update {
                app.add_systems(Update, rise);
            } else {
                app.add_systems(FixedUpdate, rise.before(TawSystems::Gather));
            }
            scene::frame_length(&mut app, 1.0 / rate);
            scene::frames(&mut app, rate as u32);
            let case =
                format!("{rate} frames a second, in Update: {in_update}, child: {has_child}");
            let mut last = drawn(&app, wall);
            for frame in 0..(rate as u32).min(100) {
                app.update();
                let [wall, picture] = [wall, picture].map(|it| drawn(&app, it));
                let apart = drawn(&app, rider) - wall - 0.75;
                assert!(apart.abs() < 2e-3, "{case}, frame {frame}: {apart} m");
                assert!((wall - picture).abs() < 1e-5, "{case}, frame {frame}: {wall}, {picture}");
                let uneven = wall - last - 1.0 / rate;
                assert!(uneven.abs() < 1e-3, "{case}, frame {frame}: {uneven} m");
                last = wall;
            }
            // It stops, and is drawn where it is.
            app.world_mut().entity_mut(lift).remove::<Lift>();
            scene::frames(&mut app, 3 + (0.1 * rate) as u32);
            let at = scene::position(&app, lift).y;
            assert_eq!([wall, picture].map(|it| drawn(&app, it)), [at; 2], "{case}");
        }
    }
}

#[test]
fn a_wall_that_is_moved_while_time_stands_still_is_drawn_there() {
    let mut app = scene::smooth_app();
    let [lift, _, picture, _] = lift(&mut app, false);
    scene::frame_length(&mut app, STEP / 4.0);
    scene::frames(&mut app, 8);
    app.world_mut().resource_mut::<Time<Virtual>>().pause();
    app.update();
    for _ in 0..3 {
        app.world_mut().get_mut::<Transform>(lift).unwrap().translation.y += 1.0;
        app.update();
        let at = scene::position(&app, lift).y;
        assert_eq!([lift, picture].map(|it| drawn(&app, it)), [at; 2]);
    }
    app.world_mut().resource_mut::<Time<Virtual>>().unpause();
    scene::frames(&mut app, 9);
    assert_eq!([lift, picture].map(|it| drawn(&app, it)), [3.0; 2]);
}

#[test]
fn a_wall_that_is_moved_while_the_physics_is_kept_from_running_is_drawn_there() {
    let mut app = scene::smooth_app();
    let sets = (TawSystems::Gather, TawSystems::Step, TawSystems::Scatter);
    app.init_resource::<Halt>();
    app.configure_sets(FixedUpdate, sets.run_if(|halt: Res<Halt>| !halt.0));
    let [lift, _, picture, _] = lift(&mut app, true);
    scene::frame_length(&mut app, STEP);
    scene::frames(&mut app, 8);
    app.world_mut().resource_mut::<Halt>().0 = true;
    for _ in 0..3 {
        app.world_mut().get_mut::<Transform>(lift).unwrap().translation.y += 0.01;
        app.update();
        let at = scene::position(&app, lift).y;
        assert_eq!([lift, picture].map(|it| drawn(&app, it)), [at; 2]);
    }
}

#[derive(Resource, Default)]
struct Halt(bool);

/// Prints what it costs: `cargo test -p taw_examples --test headless -- --ignored --nocapture walls_that_stay`.
#[test]
#[ignore = "a measurement"]
fn ten_thousand_walls_that_stay() {
    for (name, mut app) in
        [("with drawing", scene::smooth_app()), ("without", scene::app_with(TawPlugin))]
    {
        for i in 0..10_000_u16 {
            let at = Vec3::new(f32::from(i % 100), 0.0, f32::from(i / 100)) * 2.0;
            let place = Transform::from_translation(at);
            app.world_mut().spawn((Wall::from(Cuboid::from_length(1.0)), place));
        }
        scene::frames(&mut app, 10);
        scene::frame_length(&mut app, 0.0);
        let start = std::time::Instant::now();
        scene::frames(&mut app, 200);
        println!("{name}: {:?} in a frame without a step", start.elapsed() / 200);
    }
}
