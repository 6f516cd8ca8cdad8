//! Masses, forces, integrators and rotation through components and resources.

use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene::{self, STEP};

/// The velocity that each bundle has after a second of a pull of 12 N along x and
/// gravity 8 m/s².
fn velocity_with(bundle: impl Bundle) -> Vec3 {
    let mut app = scene::app();
    app.insert_resource(Gravity(Vec3::NEG_Y * 8.0));
    app.insert_resource(Forces(vec![ForceField::Custom(|_, _| [12.0, 0.0, 0.0].into())]));
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
    app.insert_resource(Forces(vec![ForceField::Custom(|_, _| [64.0, 0.0, 0.0].into())]));
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
    assert!((speed(&app) - 1.25).abs() < 1e-3, "glass weighs 1,309 kg at this size");
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
    let rolling = (Marble::new(0.25), start, Velocity(Vec3::X * 2.0), AngularVelocity::default());
    let marble = app.world_mut().spawn(rolling).id();
    app.update(); // from here on it spins
    let before = *app.world().get::<Transform>(marble).unwrap();
    scene::frames(&mut app, 16);
    let after = *app.world().get::<Transform>(marble).unwrap();
    let way = after.translation.x - before.translation.x;
    let turned = after.rotation * before.rotation.inverse();
    let exact = Quat::from_rotation_z(-way / 0.25);
    assert!(turned.angle_between(exact) < 1e-3, "{turned}, not {exact}");
    assert_eq!(**app.world().get::<AngularVelocity>(marble).unwrap(), Vec3::NEG_Z * 8.0);

    // Turned by hand, it rolls on from there.
    app.world_mut().get_mut::<Transform>(marble).unwrap().rotation = Quat::IDENTITY;
    app.update();
    let turned = app.world().get::<Transform>(marble).unwrap().rotation;
    assert!(turned.angle_between(Quat::from_rotation_z(-8.0 * STEP)) < 1e-3, "{turned}");
}

#[test]
fn rotation_that_is_switched_on_begins_where_marbles_are() {
    let mut app = scene::app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let parent = app.world_mut().spawn(Transform::from_rotation(Quat::from_rotation_x(0.5))).id();
    let turned = Quat::from_rotation_y(1.0);
    let bundle =
        (Marble::default(), Transform::from_rotation(turned), AngularVelocity(Vec3::Y * 2.0));
    let root = app.world_mut().spawn(bundle).id();
    let child = app.world_mut().spawn((bundle, ChildOf(parent))).id();
    let rotation = |app: &App, marble| app.world().get::<Transform>(marble).unwrap().rotation;
    scene::frames(&mut app, 4);
    app.world_mut().resource_mut::<TawModel>().rotation = Rotation::Dynamic;
    app.update();
    let exact = Quat::from_rotation_y(1.0 + 2.0 * STEP);
    assert!(rotation(&app, root).angle_between(exact) < 1e-3, "{}", rotation(&app, root));
    // The angular velocity is in world space, so the child's own frame is turned against it.
    let angle = rotation(&app, child).angle_between(turned);
    assert!((angle - 2.0 * STEP).abs() < 1e-3, "it turned by {angle}");
}

/// Switches to impulses and spin.
fn dynamic(app: &mut App) {
    let mut model = app.world_mut().resource_mut::<TawModel>();
    (model.response, model.rotation) = (Response::Impulse, Rotation::Dynamic);
}

#[test]
fn a_sliding_marble_comes_to_roll() {
    let mut app = scene::app();
    dynamic(&mut app);
    scene::floor(&mut app);
    let start = Transform::from_xyz(0.0, 0.5, 0.0);
    let sliding = (Marble::new(0.5), start, Velocity(Vec3::X * 5.0), AngularVelocity::default());
    let marble = app.world_mut().spawn(sliding).id();
    scene::frames(&mut app, 128);
    let speed = app.world().get::<Velocity>(marble).unwrap().x;
    assert!((speed - 25.0 / 7.0).abs() < 1e-4, "{speed} m/s");
    assert!((app.world().get::<AngularVelocity>(marble).unwrap().z * 0.5 + speed).abs() < 1e-4);
}

#[test]
fn a_material_says_how_high_a_marble_bounces() {
    for restitution in [0.0, 0.9] {
        let mut app = scene::app();
        dynamic(&mut app);
        app.world_mut().resource_mut::<TawModel>().substeps = 16;
        scene::floor(&mut app);
        let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 1.5);
        let material = SurfaceMaterial { restitution, ..default() };
        app.world_mut().entity_mut(marble).insert(material);
        scene::frames(&mut app, 32);
        let mut highest = 0.5_f32;
        for _ in 0..32 {
            app.update();
            highest = highest.max(scene::position(&app, marble).y);
        }
        let exact = 0.5 + restitution * restitution;
        assert!((highest - exact).abs() < 0.02, "{restitution}: up to {highest}, not {exact}");
    }
}

#[test]
fn a_moving_wall_carries_what_lies_on_it_and_a_moving_parent_does_too() {
    for parent in [false, true] {
        let mut app = scene::app();
        dynamic(&mut app);
        let floor = scene::floor(&mut app);
        let mover = if parent { app.world_mut().spawn(Transform::default()).id() } else { floor };
        if parent {
            app.world_mut().entity_mut(floor).insert(ChildOf(mover));
        }
        let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
        app.world_mut().entity_mut(marble).insert(Velocity::default());
        app.update();
        for _ in 0..64 {
            app.world_mut().get_mut::<Transform>(mover).unwrap().translation.y += STEP;
            app.update();
        }
        let speed = app.world().get::<Velocity>(marble).unwrap().y;
        assert!((speed - 1.0).abs() < 1e-3, "it rises at {speed} m/s");
        assert!((scene::position(&app, marble).y - 1.5).abs() < 3e-3);
        scene::frames(&mut app, 64);
        // The floor stopped; the marble flew on for a bit, and lies on it again.
        assert!((scene::position(&app, marble).y - 1.5).abs() < 3e-3);
    }
}

#[test]
fn an_external_force_lasts_as_long_as_its_component() {
    let mut app = scene::app();
    dynamic(&mut app);
    app.insert_resource(Gravity(Vec3::ZERO));
    // At the top of the ball: it pushes and turns.
    let force = ExternalForce::at(Vec3::X * 64.0, Vec3::Y * 0.5);
    let ball = (
        Marble::new(0.5),
        MarbleMass::Kilograms(2.0),
        Velocity::default(),
        AngularVelocity::default(),
    );
    let marble = app.world_mut().spawn((ball, force)).id();
    scene::frames(&mut app, 2);
    let velocity = |app: &App| **app.world().get::<Velocity>(marble).unwrap();
    assert_eq!(velocity(&app), Vec3::X);
    // τ / I = 32 / (2/5 · 2 · 0.25) = 160 rad/s², clockwise.
    assert!((app.world().get::<AngularVelocity>(marble).unwrap().z + 5.0).abs() < 1e-5);
    app.world_mut().entity_mut(marble).remove::<ExternalForce>();
    scene::frames(&mut app, 8);
    assert_eq!(velocity(&app), Vec3::X);
}

#[test]
fn an_external_impulse_hits_once() {
    let mut app = scene::app();
    dynamic(&mut app);
    app.insert_resource(Gravity(Vec3::ZERO));
    let hit = ExternalImpulse::at(Vec3::X * 2.0, Vec3::Y * 0.2);
    let ball = (
        Marble::new(0.5),
        MarbleMass::Kilograms(2.0),
        Velocity::default(),
        AngularVelocity::default(),
    );
    let marble = app.world_mut().spawn((ball, hit)).id();
    scene::frames(&mut app, 8);
    assert_eq!(**app.world().get::<Velocity>(marble).unwrap(), Vec3::X);
    assert!(
        (app.world().get::<AngularVelocity>(marble).unwrap().z + 2.0).abs() < 1e-6,
        "0.4 / (2/5 · 2 · 0.25)"
    );
    assert_eq!(*app.world().get::<ExternalImpulse>(marble).unwrap(), ExternalImpulse::default());
}

#[test]
fn damping_takes_its_part_each_second() {
    let mut app = scene::app();
    dynamic(&mut app);
    app.insert_resource(Gravity(Vec3::ZERO));
    let damping = MarbleDamping { linear: 0.5, angular: 2.0 };
    let bundle = (Marble::default(), Velocity(Vec3::X), AngularVelocity(Vec3::Y), damping);
    let marble = app.world_mut().spawn(bundle).id();
    scene::frames(&mut app, 64);
    assert!((app.world().get::<Velocity>(marble).unwrap().x - (-0.5_f32).exp()).abs() < 1e-5);
    assert!(
        (app.world().get::<AngularVelocity>(marble).unwrap().y - (-2.0_f32).exp()).abs() < 1e-5
    );
}

#[test]
fn a_wall_may_have_a_material_of_its_own() {
    let bounced = |of_wall: Option<SurfaceMaterial>| {
        let mut app = scene::app();
        app.world_mut().resource_mut::<TawModel>().response = Response::EventDriven;
        let floor = scene::floor(&mut app);
        if let Some(material) = of_wall {
            app.world_mut().entity_mut(floor).insert(material);
        }
        let steel = SurfaceMaterial { restitution: 0.8, ..default() };
        let start = Transform::from_xyz(0.0, 1.0, 0.0);
        let falling = (Marble::new(0.5), start, Velocity(Vec3::NEG_Y * 4.0), steel);
        let marble = app.world_mut().spawn(falling).id();
        app.insert_resource(Gravity(Vec3::ZERO));
        scene::frames(&mut app, 16);
        app.world().get::<Velocity>(marble).unwrap().y
    };
    assert!((bounced(None) - 3.2).abs() < 1e-6);
    let dead = SurfaceMaterial { restitution: 0.0, ..default() };
    assert!((bounced(Some(dead)) - 1.6).abs() < 1e-6, "the mean of the two");
    let deadest = SurfaceMaterial { combine: Combine::Min, ..dead };
    assert_eq!(bounced(Some(deadest)), 0.0);
}

#[test]
fn every_response_holds_a_heap() {
    for response in [
        Response::Displacement,
        Response::Impulse,
        Response::Penalty(ContactLaw::SpringDashpot),
        Response::EventDriven,
    ] {
        let mut app = scene::app();
        let mut model = app.world_mut().resource_mut::<TawModel>();
        (model.response, model.rotation, model.substeps) = (response, Rotation::Dynamic, 8);
        scene::floor(&mut app);
        for i in 0..20_u8 {
            let at =
                Vec3::new(f32::from(i % 3) * 0.9, 0.6 + f32::from(i / 3), f32::from(i % 2) * 0.4);
            scene::drop_marble(&mut app, 0.5, at);
        }
        scene::frames(&mut app, 640);
        let world = app.world().resource::<TawWorld>();
        for position in world.marbles.position() {
            assert!(position.y > 0.45 && position.y < 4.0, "{response:?}: {position:?}");
        }
    }
}

#[test]
fn energy_is_measured_only_when_asked() {
    use bevy::diagnostic::DiagnosticsStore;
    use bevy_taw::diagnostics::{KINETIC_ENERGY, enable_energy};
    let mut app = scene::app();
    let bundle = (Marble::default(), MarbleMass::Kilograms(2.0), Velocity(Vec3::X * 3.0));
    app.insert_resource(Gravity(Vec3::ZERO));
    app.world_mut().spawn(bundle);
    let kinetic = |app: &App| {
        app.world().resource::<DiagnosticsStore>().get_measurement(&KINETIC_ENERGY).map(|m| m.value)
    };
    scene::frames(&mut app, 4);
    assert_eq!(kinetic(&app), None);
    enable_energy(&mut app.world_mut().resource_mut::<DiagnosticsStore>(), true);
    scene::frames(&mut app, 4);
    assert_eq!(kinetic(&app), Some(9.0));
}

#[test]
fn where_the_energy_goes_is_told_only_when_asked() {
    use bevy::diagnostic::{DiagnosticPath, DiagnosticsStore};
    use bevy_taw::diagnostics::{
        COLLISIONS, FRICTION_LOSS, MAX_PENETRATION, RESTITUTION_LOSS, SOLVER_LOSS,
        enable_energy_audit,
    };
    let mut app = scene::app();
    app.insert_resource(TawModel(Model { response: Response::EventDriven, ..default() }));
    scene::floor(&mut app);
    // Falls half a metre, and comes back with 3/5 of its speed.
    app.world_mut().spawn((
        Marble::new(0.5),
        MarbleMass::Kilograms(2.0),
        SurfaceMaterial { restitution: 0.6, ..default() },
        Transform::from_xyz(0.0, 1.0, 0.0),
    ));
    let sum = |app: &App, path: &DiagnosticPath| {
        let store = app.world().resource::<DiagnosticsStore>();
        store.get(path).unwrap().values().sum::<f64>()
    };
    let enable = |app: &mut App, on| {
        enable_energy_audit(&mut app.world_mut().resource_mut::<DiagnosticsStore>(), on);
    };
    scene::frames(&mut app, 4);
    assert_eq!(app.world().resource::<TawWorld>().energy_audit(), None);
    assert_eq!(sum(&app, &COLLISIONS), 0.0);
    enable(&mut app, true);
    scene::frames(&mut app, 36);
    let taken = 2.0 * 9.81 * 0.5 * (1.0 - 0.36);
    let restitution = sum(&app, &RESTITUTION_LOSS);
    assert!((restitution - taken).abs() < 1e-4, "{restitution} is not {taken}");
    assert!(sum(&app, &SOLVER_LOSS).abs() < 1e-4, "{}", sum(&app, &SOLVER_LOSS));
    assert_eq!((sum(&app, &FRICTION_LOSS), sum(&app, &MAX_PENETRATION)), (0.0, 0.0));
    assert_eq!(sum(&app, &COLLISIONS), 1.0);
    enable(&mut app, false);
    scene::frames(&mut app, 4);
    assert_eq!(app.world().resource::<TawWorld>().energy_audit(), None);
}

#[test]
fn a_marble_may_turn_less_than_the_model_says() {
    let mut app = scene::app();
    dynamic(&mut app);
    scene::floor(&mut app);
    let mut slide = |z: f32| {
        let start = Transform::from_xyz(0.0, 0.5, z);
        app.world_mut()
            .spawn((Marble::new(0.5), start, Velocity(Vec3::X * 5.0), AngularVelocity::default()))
            .id()
    };
    let (free, held) = (slide(0.0), slide(3.0));
    app.world_mut().entity_mut(held).insert(MarbleRotation(Rotation::None));
    scene::frames(&mut app, 64);
    let rotation = |marble| app.world().get::<Transform>(marble).unwrap().rotation;
    assert_eq!(rotation(held), Quat::IDENTITY);
    assert_ne!(rotation(free), Quat::IDENTITY);
    let speed = |marble| app.world().get::<Velocity>(marble).unwrap().x;
    assert!((speed(held) - (5.0 - 0.3 * 9.81)).abs() < 1e-3, "it slides: {}", speed(held));
    assert!((speed(free) - 25.0 / 7.0).abs() < 1e-3, "it rolls: {}", speed(free));
}
