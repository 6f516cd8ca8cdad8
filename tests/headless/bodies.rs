//! Rigid bodies and joints as components.

use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;
use bevy_taw::prelude::*;
use bevy_taw::refusal::InputRefused;
use bevy_taw::snapshot::RowRemoved;

use crate::scene;

pub fn app() -> App {
    let mut app = scene::app();
    app.insert_resource(TawModel(Model::GAME));
    app.world_mut().spawn(Wall::HalfSpace(Dir3::Y));
    app
}

fn transform(app: &App, entity: Entity) -> Transform {
    *app.world().get::<Transform>(entity).unwrap()
}

#[test]
fn a_crate_falls_stands_and_sleeps_and_wakes_when_it_is_hit() {
    let mut app = app();
    let at = Transform::from_xyz(0.0, 1.0, 0.0);
    let cuboid = (Body::from(Cuboid::new(0.4, 0.2, 0.6)), Velocity::default(), at);
    let cuboid = app.world_mut().spawn(cuboid).id();
    scene::frames(&mut app, 4 * 64);
    let place = transform(&app, cuboid);
    assert!((place.translation - Vec3::Y * 0.1).length() < 2e-3, "{place:?}");
    assert!(app.world().entity(cuboid).contains::<Sleeping>());
    let hit = ExternalImpulse { impulse: Vec3::X * 200.0, angular: Vec3::ZERO };
    app.world_mut().entity_mut(cuboid).insert(hit);
    scene::frames(&mut app, 2);
    assert!(!app.world().entity(cuboid).contains::<Sleeping>());
    assert!(app.world().get::<Velocity>(cuboid).unwrap().x > 1.0);
    assert_eq!(app.world().get::<ExternalImpulse>(cuboid), Some(&ExternalImpulse::default()));
    app.world_mut().despawn(cuboid);
    scene::frames(&mut app, 2);
    assert!(app.world().resource::<TawWorld>().bodies.is_empty());
}

#[test]
fn a_body_goes_where_its_transform_is_written_and_turns_as_it_is_told() {
    let mut app = app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let body = (
        Body::from(Capsule3d::new(0.1, 0.5)),
        Transform::from_xyz(0.0, 5.0, 0.0),
        AngularVelocity(Vec3::Z),
        Velocity(Vec3::X),
    );
    let body = app.world_mut().spawn(body).id();
    scene::frames(&mut app, 64);
    let place = transform(&app, body);
    assert!((place.translation - Vec3::new(1.0, 5.0, 0.0)).length() < 1e-4, "{place:?}");
    assert!(place.rotation.angle_between(Quat::from_rotation_z(1.0)) < 1e-4, "{place:?}");
    *app.world_mut().get_mut::<Transform>(body).unwrap() = Transform::from_xyz(-3.0, 5.0, 0.0);
    scene::frames(&mut app, 64);
    let place = transform(&app, body);
    assert!((place.translation - Vec3::new(-2.0, 5.0, 0.0)).length() < 1e-4, "{place:?}");
}

#[test]
fn a_marble_rolls_off_a_plank_and_a_kinematic_body_carries_on() {
    let mut app = app();
    let lift = (
        Body::from(Cuboid::new(1.0, 0.1, 1.0)),
        MarbleMass::Infinite,
        Velocity(Vec3::Y * 0.5),
        Transform::from_xyz(0.0, 0.5, 0.0),
    );
    let lift = app.world_mut().spawn(lift).id();
    let marble = scene::drop_marble(&mut app, 0.1, Vec3::new(0.0, 0.65, 0.0));
    scene::frames(&mut app, 128);
    let lifted = transform(&app, lift).translation.y;
    assert!((lifted - 1.5).abs() < 1e-3, "{lifted}");
    let height = scene::position(&app, marble).y;
    assert!((height - (lifted + 0.15)).abs() < 5e-3, "{height}");
}

#[test]
fn a_joint_holds_breaks_and_goes_with_its_bodies() {
    let mut app = app();
    let bodies = [0.5, 1.5].map(|x| {
        let at = Transform::from_xyz(x, 5.0, 0.0);
        app.world_mut().spawn((Body::from(Cuboid::new(1.0, 0.1, 0.1)), at)).id()
    });
    let first = JointEnd::on(bodies[0], Vec3::X * -0.5);
    let hinge = JointKind::Hinge(JointDrive::default());
    let wall = Joint::new(hinge, JointEnd::world(Vec3::Y * 5.0), first);
    let links = [
        wall,
        Joint {
            breaking_force: Some(1e9),
            ..Joint::new(
                hinge,
                JointEnd::on(bodies[0], Vec3::X * 0.5),
                JointEnd::on(bodies[1], Vec3::X * -0.5),
            )
        },
    ];
    let joints = links.map(|joint| app.world_mut().spawn(joint).id());
    for _ in 0..128 {
        scene::frames(&mut app, 1);
        let far = transform(&app, bodies[1]).translation.distance(Vec3::Y * 5.0);
        assert!(far < 1.501, "{far}");
    }
    app.world_mut().get_mut::<Joint>(joints[1]).unwrap().breaking_force = Some(1.0);
    scene::frames(&mut app, 2);
    assert!(!app.world().entity(joints[1]).contains::<Joint>(), "it broke");
    app.world_mut().despawn(bodies[0]);
    scene::frames(&mut app, 2);
    assert!(!app.world().entity(joints[0]).contains::<Joint>(), "its body is gone");
    assert!(app.world().resource::<TawWorld>().joints.is_empty());
}

#[test]
fn other_responses_leave_bodies_out_by_name_and_take_them_in_again() {
    let mut app = app();
    let at = Transform::from_xyz(0.0, 1.0, 0.0);
    let body = app.world_mut().spawn((Body::from(Sphere::new(0.2)), at)).id();
    scene::frames(&mut app, 2);
    app.insert_resource(TawModel(Model { response: Response::Impulse, ..Model::GAME }));
    let mut told = 0;
    for _ in 0..4 {
        app.update();
        let refused = app.world().resource::<Messages<InputRefused>>();
        let of_body = refused.iter_current_update_messages().filter(|it| it.entity == Some(body));
        told += of_body.filter(|it| it.error.to_string().contains("rigid bodies")).count();
    }
    assert_eq!(told, 1);
    assert!(app.world().resource::<TawWorld>().bodies.is_empty());
    app.insert_resource(TawModel(Model::GAME));
    scene::frames(&mut app, 128);
    assert!((transform(&app, body).translation.y - 0.2).abs() < 2e-3);
}

/// Bodies and joints go on from where they were; those that came since stay, and those that went are told.
#[test]
fn a_restored_world_has_its_bodies_and_joints_again() {
    let mut app = app();
    let boxes = [0.0, 0.25].map(|height| {
        let at = Transform::from_xyz(0.1 * height, 1.0 + height, 0.0);
        app.world_mut().spawn((Body::from(Cuboid::new(0.4, 0.2, 0.4)), at)).id()
    });
    let bob = (Body::from(Sphere::new(0.1)), Transform::from_xyz(3.5, 2.0, 0.0));
    let bob = app.world_mut().spawn(bob).id();
    let rope = JointKind::Distance([0.0, 0.5]);
    let rope =
        Joint::new(rope, JointEnd::world(Vec3::new(3.0, 2.0, 0.0)), JointEnd::on(bob, Vec3::ZERO));
    let rope = app.world_mut().spawn(rope).id();
    scene::frames(&mut app, 20);
    let saved = app.world().resource::<TawWorld>().snapshot();
    let places = |app: &App| [boxes[0], boxes[1], bob].map(|it| transform(app, it));
    scene::frames(&mut app, 60);
    let first = places(&app);
    scene::frames(&mut app, 77);
    for _ in 0..2 {
        app.world_mut().resource_mut::<TawWorld>().restore(&saved);
        scene::frames(&mut app, 60);
        assert_eq!(places(&app), first);
        assert!(app.world().resource::<Messages<RowRemoved>>().is_empty());
    }
    let at = Transform::from_xyz(-3.0, 0.1, 0.0);
    let late = app.world_mut().spawn((Body::from(Cuboid::new(0.4, 0.2, 0.4)), at)).id();
    app.world_mut().despawn(rope);
    app.world_mut().despawn(boxes[1]);
    scene::frames(&mut app, 10);
    app.world_mut().resource_mut::<TawWorld>().restore(&saved);
    app.update();
    let told = app.world().resource::<Messages<RowRemoved>>();
    let told: Vec<_> = told.iter_current_update_messages().copied().collect();
    assert!(matches!(told[..], [RowRemoved::Body(_), RowRemoved::Joint(_)]), "{told:?}");
    scene::frames(&mut app, 60);
    let world = app.world().resource::<TawWorld>();
    assert_eq!((world.bodies.len(), world.joints.len()), (3, 0));
    assert!(transform(&app, bob).translation.y < 0.2, "its rope is gone");
    assert!((transform(&app, late).translation - at.translation).length() < 2e-3);
}

/// A body whose entity is disabled is out of the world, and so are its joints, until it comes back as it was.
#[test]
fn a_disabled_body_is_away_with_its_joints() {
    let mut app = app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let flyer = (Body::from(Cuboid::new(0.4, 0.2, 0.6)), Transform::from_xyz(0.0, 5.0, 0.0));
    let flyer = app.world_mut().spawn(flyer).id();
    let push = ExternalImpulse { impulse: Vec3::X * 120.0, angular: Vec3::ZERO };
    app.world_mut().entity_mut(flyer).insert((MarbleMass::Kilograms(120.0), push));
    let partner = (Body::from(Sphere::new(0.1)), Transform::from_xyz(0.0, 8.0, 0.0));
    let partner = app.world_mut().spawn(partner).id();
    let string = Joint::new(
        JointKind::Distance([0.0, 100.0]),
        JointEnd::on(flyer, Vec3::ZERO),
        JointEnd::on(partner, Vec3::ZERO),
    );
    let string = app.world_mut().spawn(string).id();
    scene::frames(&mut app, 16);
    let before = transform(&app, flyer).translation.x;
    app.world_mut().entity_mut(flyer).insert(Disabled);
    scene::frames(&mut app, 16);
    let count = |app: &App| {
        let world = app.world().resource::<TawWorld>();
        (world.bodies.len(), world.joints.len())
    };
    assert_eq!(count(&app), (1, 0));
    // A joint that is written meanwhile waits for its end.
    app.world_mut().get_mut::<Joint>(string).unwrap().kind = JointKind::Distance([0.0, 90.0]);
    app.insert_resource(TawModel(Model { response: Response::Impulse, ..Model::GAME }));
    let mut told = Vec::new();
    for _ in 0..4 {
        app.update();
        let refused = app.world().resource::<Messages<InputRefused>>();
        told.extend(refused.iter_current_update_messages().map(|it| it.entity));
    }
    assert_eq!(told, [Some(partner)], "of the one that is there");
    app.insert_resource(TawModel(Model::GAME));
    scene::frames(&mut app, 4);
    app.world_mut().entity_mut(flyer).remove::<Disabled>();
    scene::frames(&mut app, 16);
    assert_eq!(count(&app), (2, 1));
    assert!(app.world().entity(string).contains::<Joint>());
    let way = transform(&app, flyer).translation.x - before;
    assert!((way - 0.25).abs() < 1e-3, "{way}");
    app.world_mut().entity_mut(string).insert(Disabled);
    scene::frames(&mut app, 2);
    assert_eq!(count(&app), (2, 0));
    app.world_mut().entity_mut(flyer).insert(Disabled);
    app.world_mut().despawn(flyer);
    scene::frames(&mut app, 2);
    assert_eq!(count(&app), (1, 0));
    assert!(!app.world().entity(string).contains::<Joint>(), "its end is gone");
}

/// A crate on a tray that carries it along is drawn where it is, whatever its parent does between two steps.
#[test]
fn a_child_body_stays_where_it_is_while_its_parent_moves() {
    let mut app = app();
    let parent = app.world_mut().spawn(Transform::from_xyz(1.0, 0.0, 0.0)).id();
    let at = Transform::from_xyz(-1.0, 0.1, 0.0);
    let child = (Body::from(Cuboid::new(0.4, 0.2, 0.6)), at, ChildOf(parent));
    let child = app.world_mut().spawn(child).id();
    scene::frames(&mut app, 4);
    scene::frame_length(&mut app, scene::STEP / 4.0); // most frames have no step
    for step in 0..8 {
        app.world_mut().get_mut::<Transform>(parent).unwrap().translation.x += 0.3;
        scene::frames(&mut app, 1);
        let place = app.world().get::<GlobalTransform>(child).unwrap().translation();
        assert!((place - Vec3::Y * 0.1).length() < 2e-3, "{step}: {place}");
    }
}

/// A hinge tells its angle.
#[test]
fn a_hinge_driven_to_an_angle_tells_it() {
    let mut app = app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let arm = (Body::from(Cuboid::new(1.0, 0.1, 0.1)), Transform::from_xyz(0.5, 3.0, 0.0));
    let arm = app.world_mut().spawn(arm).id();
    let spring = JointSpring { frequency: 4.0, damping_ratio: 1.0 };
    let motor = Some(JointMotor::Position { target: 0.7, spring, max: 1e4 });
    let hinge = Joint::new(
        JointKind::Hinge(JointDrive { limits: None, motor }),
        JointEnd::world(Vec3::Y * 3.0),
        JointEnd::on(arm, Vec3::X * -0.5),
    );
    let hinge = app.world_mut().spawn(hinge).id();
    scene::frames(&mut app, 128);
    let world = app.world().resource::<TawWorld>();
    let angle = world.joints.position(world.joint_id(hinge).unwrap()).unwrap().unwrap();
    assert!((angle - 0.7).abs() < 1e-3, "{angle}");
    let drawn = transform(&app, arm).rotation.angle_between(Quat::from_rotation_z(0.7));
    assert!(drawn < 1e-3, "{drawn}");
}

/// A write to a child whose ancestor has no `Transform` counts once that has one.
#[test]
fn a_child_body_goes_where_it_was_written_once_it_has_a_place() {
    let mut app = app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let at = Transform::from_xyz(1.0, 0.0, 0.0);
    let parent = app.world_mut().spawn(at).id();
    let child = (Body::from(Sphere::new(0.1)), Velocity::default(), ChildOf(parent));
    let child = app.world_mut().spawn((child, Transform::from_xyz(0.0, 5.0, 0.0))).id();
    scene::frames(&mut app, 2);
    app.world_mut().entity_mut(parent).remove::<Transform>();
    scene::frames(&mut app, 2);
    app.world_mut().get_mut::<Transform>(child).unwrap().translation.y = 7.0;
    **app.world_mut().get_mut::<Velocity>(child).unwrap() = Vec3::Z;
    scene::frames(&mut app, 2);
    assert_eq!(truth(&app, child), Vec3::new(1.0, 5.0, 0.0), "nobody can say where it is");
    app.world_mut().entity_mut(parent).insert(at);
    scene::frames(&mut app, 1);
    assert_eq!(truth(&app, child), Vec3::new(1.0, 7.0, scene::STEP));
    assert_eq!(transform(&app, child).translation, Vec3::new(0.0, 7.0, scene::STEP));
}

/// Place of a marble or body in the physics.
pub fn truth(app: &App, entity: Entity) -> Vec3 {
    place_in(app.world().resource(), entity)
}

fn place_in(world: &TawWorld, entity: Entity) -> Vec3 {
    let marble = (0..world.marbles.len())
        .find(|row| world.marble_entity(*row as u32) == Some(entity))
        .map(|row| world.marbles.position()[row]);
    let body = world.body_id(entity).map(|id| world.bodies.motion(id).unwrap().position);
    let place = marble.or(body).expect("it is in the world");
    Vec3::new(place.x, place.y, place.z)
}

/// Marbles and bodies, each carried by the one before.
#[derive(Resource)]
pub struct Chain(Vec<Entity>);

/// Adds three marbles or bodies above an entity, each carried by the one before. They move on by 0.1, 0.2 and 0.3 m a
/// step and turn. The bits of `kinds` say which are bodies.
pub fn carry(app: &mut App, root: Entity, kinds: u8) -> Vec<Entity> {
    let mut chain = vec![root];
    for i in 0..3_u8 {
        let velocity = Vec3::X * 0.1 * f32::from(i + 1) / scene::STEP;
        let motion = (Velocity(velocity), AngularVelocity(Vec3::ONE * 3.0));
        let at = Transform::from_xyz(0.0, 3.0, 0.0);
        let it = (motion, at, ChildOf(chain[usize::from(i)]));
        let it = if kinds & (1 << i) == 0 {
            app.world_mut().spawn((Marble::new(0.1), it)).id()
        } else {
            app.world_mut().spawn((Body::from(Cuboid::new(0.2, 0.2, 0.2)), it)).id()
        };
        chain.push(it);
    }
    chain.remove(0);
    app.insert_resource(Chain(chain.clone()));
    chain
}

/// Asserts that the `Transform`s of a chain are where the physics has it.
pub fn are_true(world: Res<TawWorld>, chain: Res<Chain>, places: TransformHelper) {
    for it in &chain.0 {
        let place = places.compute_global_transform(*it).unwrap().translation();
        let far = place.distance(place_in(&world, *it));
        assert!(far < 1e-3, "{far} m");
    }
}

#[test]
fn what_marbles_and_bodies_carry_is_written_in_the_same_step() {
    for kinds in 0..8 {
        let mut app = app();
        app.insert_resource(Gravity(Vec3::ZERO));
        let root = app.world_mut().spawn(Transform::default()).id();
        let chain = carry(&mut app, root, kinds);
        app.add_systems(FixedUpdate, are_true.after(TawSystems::Scatter));
        scene::frames(&mut app, 65);
        let way = truth(&app, chain[2]).x - 0.3;
        assert!((way - 0.3 * 64.0).abs() < 1e-2, "{kinds}: {way} m");
    }
}

#[test]
fn a_body_that_the_game_takes_out_comes_again_and_is_no_ghost() {
    let mut app = app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let at = Transform::from_xyz(0.0, 5.0, 0.0);
    let body = app.world_mut().spawn((Body::default(), at)).id();
    for _ in 0..8 {
        scene::frames(&mut app, 2);
        let mut world = app.world_mut().resource_mut::<TawWorld>();
        let id = world.body_id(body).unwrap();
        assert!(world.bodies.remove(id).is_ok(), "it is named by the row that it has");
    }
}

#[test]
fn a_body_that_no_entity_stands_behind_is_taken_out_and_told() {
    let mut app = app();
    let body = app.world_mut().spawn(Body::default()).id();
    scene::frames(&mut app, 2);
    let clone = (**app.world().resource::<TawWorld>()).clone();
    app.world_mut().despawn(body);
    scene::frames(&mut app, 2);
    **app.world_mut().resource_mut::<TawWorld>() = clone;
    app.update();
    let told = app.world().resource::<Messages<RowRemoved>>();
    let told: Vec<_> = told.iter_current_update_messages().collect();
    assert!(matches!(told[..], [RowRemoved::Body(_)]), "{told:?}");
    assert!(app.world().resource::<TawWorld>().bodies.is_empty());
}

/// A joint that goes between a restore and the next step leaves alone which joint has its row by then.
#[test]
fn a_joint_that_goes_takes_no_other_out_of_a_restored_world() {
    let mut app = app();
    let bob = (Body::from(Sphere::new(0.1)), Transform::from_xyz(0.0, 5.0, 0.0));
    let bob = app.world_mut().spawn(bob).id();
    let kind = JointKind::Distance([0.0, 1.0]);
    let rope = Joint::new(kind, JointEnd::world(Vec3::Y * 5.0), JointEnd::on(bob, Vec3::ZERO));
    scene::frames(&mut app, 2);
    let without = app.world().resource::<TawWorld>().snapshot();
    let mut spawn = || {
        app.world_mut().resource_mut::<TawWorld>().restore(&without);
        let joint = app.world_mut().spawn(rope).id();
        scene::frames(&mut app, 1);
        let world = app.world().resource::<TawWorld>();
        let (id, saved) = (world.joint_id(joint), world.snapshot());
        app.world_mut().entity_mut(joint).insert(Disabled);
        (joint, id, saved)
    };
    let [(first, id, saved), (second, same, _)] = [spawn(), spawn()];
    assert_eq!(id, same, "both had the same row, each in its time");
    app.world_mut().entity_mut(first).remove::<Disabled>();
    app.world_mut().resource_mut::<TawWorld>().restore(&saved);
    app.world_mut().despawn(second);
    let world = app.world().resource::<TawWorld>();
    assert_eq!((world.joints.len(), world.joint_id(first)), (1, id));
}
