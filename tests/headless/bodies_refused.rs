//! Bodies where they cannot be, and components that do nothing on them: each is named.

use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::bodies::{app, truth};
use crate::scene;

/// Counts who was told to be refused with these words, in some frames.
fn refusals(app: &mut App, entity: Entity, words: &str) -> usize {
    let mut told = 0;
    for _ in 0..4 {
        app.update();
        let refused = app.world().resource::<Messages<InputRefused>>();
        let of_it = refused.iter_current_update_messages().filter(|it| it.entity == Some(entity));
        told += of_it.filter(|it| it.error.to_string().contains(words)).count();
    }
    told
}

#[test]
fn a_marble_or_wall_is_no_body() {
    let mut app = app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let at = Transform::from_xyz(0.0, 5.0, 0.0);
    let marble = app.world_mut().spawn((Body::from(Sphere::new(0.1)), at)).id();
    scene::frames(&mut app, 2);
    app.world_mut().entity_mut(marble).insert((Marble::new(0.1), Velocity(Vec3::X)));
    assert_eq!(refusals(&mut app, marble, "a Body and a Marble"), 1);
    let wall = (Body::default(), Wall::from(Cuboid::default()), Transform::from_xyz(9.0, 5.0, 0.0));
    let wall = app.world_mut().spawn(wall).id();
    assert_eq!(refusals(&mut app, wall, "a Body and a Wall"), 1);
    let rows = |app: &App| {
        let world = app.world().resource::<TawWorld>();
        [world.bodies.len(), world.marbles.len(), world.walls.len()]
    };
    assert_eq!(rows(&app), [0, 1, 2]);
    app.world_mut().entity_mut(marble).remove::<Marble>();
    app.world_mut().entity_mut(wall).remove::<Wall>();
    scene::frames(&mut app, 2);
    assert_eq!(rows(&app), [2, 0, 1]);
    let way = truth(&app, marble).x;
    assert!((way - 10.0 * scene::STEP).abs() < 1e-4, "it goes on: {way} m");
}

#[test]
fn what_does_nothing_on_a_body_is_named() {
    let mut app = app();
    let body = app.world_mut().spawn((Body::default(), Transform::from_xyz(0.0, 5.0, 0.0))).id();
    let ignored = |app: &App| app.world().resource::<IgnoredComponents>().to_vec();
    let all = (MarbleMass::Kilograms(3.0), MarbleDamping::default(), SurfaceMaterial::default());
    app.world_mut().entity_mut(body).insert((all, SleepingDisabled, CollisionLayers::default()));
    app.update();
    assert_eq!(ignored(&app), [""; 0]);
    let idle = (LockedAxes::default(), ColliderDisabled::default(), IgnoreCollisions::default());
    let idle = (idle, SurfaceVelocity::default(), OneWay::default());
    app.world_mut().entity_mut(body).insert(idle);
    app.update();
    let expected =
        ["LockedAxes", "ColliderDisabled", "IgnoreCollisions", "SurfaceVelocity", "OneWay"];
    assert_eq!(ignored(&app), expected.map(|name| format!("{name} of a body")));
}

#[test]
fn a_body_that_a_marble_is_to_ignore_is_refused_by_name() {
    let mut app = app();
    let body = app.world_mut().spawn((Body::default(), Transform::from_xyz(0.0, 5.0, 0.0))).id();
    let marble = scene::drop_marble(&mut app, 0.1, Vec3::Y * 9.0);
    app.world_mut().entity_mut(marble).insert(IgnoreCollisions(vec![body]));
    assert_eq!(refusals(&mut app, marble, "is a Body"), 1);
}

/// A joint on a wall is told once, and holds once that is right.
#[test]
fn a_wall_that_is_to_hold_a_joint_is_refused_by_name() {
    let mut app = app();
    let body = app.world_mut().spawn((Body::default(), Transform::from_xyz(0.0, 5.0, 0.0))).id();
    let marble = scene::drop_marble(&mut app, 0.1, Vec3::Y * 9.0);
    let wall = app.world_mut().spawn(Wall::from(Cuboid::default())).id();
    let rod = |end| {
        let kind = JointKind::Distance([0.0, 50.0]);
        Joint::new(kind, JointEnd::on(marble, Vec3::ZERO), JointEnd::on(end, Vec3::ZERO))
    };
    let joint = app.world_mut().spawn(rod(wall)).id();
    assert_eq!(refusals(&mut app, joint, "neither a Marble nor a Body"), 1);
    let count = |app: &App| app.world().resource::<TawWorld>().joints.len();
    assert_eq!(count(&app), 0);
    app.world_mut().entity_mut(joint).insert(rod(body));
    scene::frames(&mut app, 2);
    assert_eq!(count(&app), 1);
    app.world_mut().entity_mut(joint).insert(rod(wall));
    assert_eq!(refusals(&mut app, joint, "neither a Marble nor a Body"), 1);
    assert_eq!(count(&app), 0);
    app.world_mut().entity_mut(wall).insert(Marble::new(0.1));
    scene::frames(&mut app, 2);
    assert_eq!(count(&app), 1, "it holds a marble now");
    app.world_mut().entity_mut(wall).remove::<Marble>();
    scene::frames(&mut app, 2);
    assert!(!app.world().entity(joint).contains::<Joint>(), "its end is none any more");
}
