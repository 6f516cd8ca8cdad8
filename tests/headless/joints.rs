//! Joints of the core between marbles of an app.

use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy_taw::prelude::*;
use bevy_taw::taw::joint::{Joint, JointEnd, JointKind};
use bevy_taw::taw::math::{Point3, Vec3 as CoreVec3};
use bevy_taw::taw::world::ColliderId;

use crate::scene;

#[test]
fn a_marble_swings_on_a_rod_and_takes_it_along_when_it_goes() {
    let mut app = scene::app();
    app.insert_resource(TawModel(Model::GAME));
    let marble = scene::drop_marble(&mut app, 0.2, Vec3::X);
    scene::frames(&mut app, 1);
    let id = app.world_mut().run_system_once(move |query: SpatialQuery| query.collider(marble));
    let Ok(Some(ColliderId::Marble(id))) = id else { panic!("{id:?}") };
    let ends = [
        JointEnd::world(Point3::new(0.0, 0.0, 0.0)),
        JointEnd::marble(id, CoreVec3::new(0.0, 0.0, 0.0)),
    ];
    let rod = Joint::new(JointKind::Distance([1.0, 1.0]), ends);
    let rod = app.world_mut().resource_mut::<TawWorld>().joints.insert(rod).unwrap();
    let mut lowest = 0.0_f32;
    for _ in 0..128 {
        scene::frames(&mut app, 1);
        let place = scene::position(&app, marble);
        assert!((place.length() - 1.0).abs() < 1e-3, "{place}");
        lowest = lowest.min(place.y);
    }
    assert!(lowest < -0.99, "{lowest}");
    assert!(app.world().resource::<TawWorld>().joints.force(rod).unwrap() > 0.0);
    app.world_mut().despawn(marble);
    scene::frames(&mut app, 2);
    assert!(app.world().resource::<TawWorld>().joints.is_empty());
}
