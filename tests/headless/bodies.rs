//! Rigid bodies and joints as components.

use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene;

fn app() -> App {
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
