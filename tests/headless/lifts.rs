//! Lifts: ground that moves, and jumps from it.

use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::heroes::{app, control, ground, grounded, velocity};
use crate::scene;

#[derive(Component)]
struct Lift(Vec3);

fn lift(mut lifts: Query<(&Lift, &mut Transform)>, time: Res<Time>) {
    for (Lift(velocity), mut place) in &mut lifts {
        place.translation += *velocity * time.delta_secs();
    }
}

#[test]
fn ground_that_moves_says_how_fast_and_marbles_are_ground_too() {
    for response in [Response::SoftStep, Response::Impulse, Response::EventDriven] {
        let mut app = app(response);
        app.add_systems(FixedUpdate, lift.before(TawSystems::Gather));
        let velocity = Vec3::new(0.5, 0.25, 0.0);
        let slab = Wall::from(Cuboid::new(8.0, 1.0, 8.0));
        let slab = app.world_mut().spawn((slab, Lift(velocity), Transform::default())).id();
        let below = scene::drop_marble(&mut app, 0.5, Vec3::Y);
        app.world_mut().entity_mut(below).insert((MarbleMass::Kilograms(1e3), Velocity(velocity)));
        let above = grounded(&mut app, 0.25, Vec3::Y * 1.75);
        app.world_mut().entity_mut(above).insert(Velocity(velocity));
        app.world_mut().entity_mut(below).insert(Grounded::default());
        scene::frames(&mut app, 20);
        let (low, high) = (ground(&app, below).unwrap(), ground(&app, above).unwrap());
        assert_eq!((low.entity, high.entity), (slab, below), "{response:?}");
        assert!(low.velocity.distance(velocity) < 1e-4, "{response:?}: {low:?}");
        assert!(high.velocity.distance(velocity) < 0.05, "{response:?}: {high:?}");
    }
}

#[test]
fn who_lands_on_a_lift_stays_grounded_up_and_down() {
    for response in [Response::SoftStep, Response::Impulse, Response::EventDriven] {
        for (substeps, speed) in [(1, -2.0), (4, -2.0), (1, -0.3), (1, 0.3), (4, 2.0)] {
            let mut app = app(response);
            app.world_mut().resource_mut::<TawModel>().substeps = substeps;
            app.add_systems(FixedUpdate, lift.before(TawSystems::Gather));
            let slab = Wall::from(Cuboid::new(8.0, 1.0, 8.0));
            let slab = (slab, Lift(Vec3::Y * speed), Transform::default());
            let slab = app.world_mut().spawn(slab).id();
            let marble = grounded(&mut app, 0.25, Vec3::Y * 0.8);
            let surface = SurfaceMaterial { restitution: 0.0, ..default() };
            app.world_mut().entity_mut(marble).insert((surface, Velocity(Vec3::Y * speed)));
            scene::frames(&mut app, 40);
            let case = format!("{response:?} in {substeps} substeps, lift at {speed} m/s");
            for frame in 0..40 {
                app.update();
                let found = ground(&app, marble).unwrap_or_else(|| panic!("{case}: frame {frame}"));
                assert_eq!((found.entity, found.normal), (slab, Vec3::Y), "{case}");
                assert!((found.velocity.y - speed).abs() < 1e-3, "{case}: {found:?}");
            }
        }
    }
}

#[test]
fn a_jump_from_a_lift_is_relative_to_it() {
    let mut app = app(Response::SoftStep);
    app.add_systems(FixedUpdate, lift.before(TawSystems::Gather));
    let slab = Wall::from(Cuboid::new(8.0, 1.0, 8.0));
    app.world_mut().spawn((slab, Lift(Vec3::new(0.5, 1.0, 0.0)), Transform::default()));
    let place = Transform::from_xyz(0.0, 0.75, 0.0);
    let controller = MarbleController { jump_speed: 4.0, ..default() };
    let hero = app.world_mut().spawn((controller, Marble::new(0.25), place)).id();
    scene::frames(&mut app, 64);
    control(&mut app, hero).jump = true;
    app.update();
    let rises = velocity(&app, hero).y;
    assert!((rises - 5.0).abs() < 0.25, "{rises}");
}
