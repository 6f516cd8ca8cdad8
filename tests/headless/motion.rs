//! Masses, forces, integrators and rotation through components and resources.

use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene::{self, STEP};

/// The velocity that each bundle has after a second of a pull of 12 N along x and
/// gravity 8 m/s².
fn velocity_with(bundle: impl Bundle) -> Vec3 {
    let mut app = scene::app();
    app.insert_resource(Gravity(Vec3::NEG_Y * 8.0));
    app.insert_resource(Forces(vec![Force::Custom(|_, _| [12.0, 0.0, 0.0].into())]));
    let marble = app.world_mut().spawn((Marble::default(), Velocity::default(), bundle)).id();
    scene::frames(&mut app, 64);
    **app.world().get::<Velocity>(marble).unwrap()
}

#[test]
fn mass_and_gravity_scale_say_what_forces_do() {
    let three = MarbleMass::Kilograms(3.0);
    assert_eq!(velocity_with(three), Vec3::new(4.0, -8.0, 0.0));
    assert_eq!(velocity_with((three, GravityScale(-0.5))), Vec3::new(4.0, 4.0, 0.0));
    assert_eq!(velocity_with(MarbleMass::Infinite), Vec3::ZERO);
    // A ball of half a metre has π / 6 m³.
    let dense = velocity_with(MarbleMass::Density(3.0));
    assert!((dense.x - 12.0 / (3.0 * std::f32::consts::PI / 6.0)).abs() < 1e-4, "{dense}");
}

#[test]
fn a_mass_may_change_and_go() {
    let mut app = scene::app();
    app.insert_resource(Gravity(Vec3::ZERO));
    app.insert_resource(Forces(vec![Force::Custom(|_, _| [64.0, 0.0, 0.0].into())]));
    let heavy = (Marble::default(), Velocity::default(), MarbleMass::Kilograms(4.0));
    let marble = app.world_mut().spawn(heavy).id();
    let speed = |app: &App| app.world().get::<Velocity>(marble).unwrap().x;
    app.update();
    assert_eq!(speed(&app), 0.25);
    *app.world_mut().get_mut::<MarbleMass>(marble).unwrap() = MarbleMass::Kilograms(1.0);
    app.update();
    assert_eq!(speed(&app), 1.25);
    app.world_mut().entity_mut(marble).remove::<MarbleMass>();
    app.update();
    assert!(speed(&app) - 1.25 < 1e-3, "glass weighs 1,309 kg at this size");
}

#[test]
fn every_integrator_can_be_chosen() {
    let fallen = |integrator| {
        let mut app = scene::app();
        app.insert_resource(Gravity(Vec3::NEG_Y * 8.0));
        app.world_mut().resource_mut::<TawModel>().integrator = integrator;
        let marble = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
        scene::frames(&mut app, 64);
        -scene::position(&app, marble).y
    };
    let late = 8.0 * STEP / 2.0;
    let expected = [4.0 - late, 4.0 + late, 4.0, 4.0, 4.0];
    for (integrator, exact) in Integrator::ALL.into_iter().zip(expected) {
        let fallen = fallen(integrator);
        assert!((fallen - exact).abs() < 1e-5, "{integrator:?}: {fallen}, not {exact}");
    }
}

#[test]
fn a_marble_rolls_as_far_as_it_turns() {
    let mut app = scene::app();
    app.world_mut().resource_mut::<TawModel>().rotation = Rotation::Rolling;
    scene::floor(&mut app);
    let start = Transform::from_xyz(0.0, 0.25, 0.0);
    let rolling = (Marble::new(0.25), start, Velocity(Vec3::X * 2.0), Spin::default());
    let marble = app.world_mut().spawn(rolling).id();
    app.update(); // from here on it spins
    let before = *app.world().get::<Transform>(marble).unwrap();
    scene::frames(&mut app, 16);
    let after = *app.world().get::<Transform>(marble).unwrap();
    let way = after.translation.x - before.translation.x;
    let turned = after.rotation * before.rotation.inverse();
    let exact = Quat::from_rotation_z(-way / 0.25);
    assert!(turned.angle_between(exact) < 1e-3, "{turned}, not {exact}");
    assert_eq!(**app.world().get::<Spin>(marble).unwrap(), Vec3::NEG_Z * 8.0);

    // Turned by hand, it rolls on from there.
    app.world_mut().get_mut::<Transform>(marble).unwrap().rotation = Quat::IDENTITY;
    app.update();
    let turned = app.world().get::<Transform>(marble).unwrap().rotation;
    assert!(turned.angle_between(Quat::from_rotation_z(-8.0 * STEP)) < 1e-3, "{turned}");
}
