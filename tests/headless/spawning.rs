//! Entities that come, change and go at any time.

use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene::{self, random};

#[test]
fn spawn_and_despawn_storms_leave_nothing_behind() {
    let mut app = scene::app();
    scene::board(&mut app);
    let mut alive: Vec<Entity> = Vec::new();
    let mut seed = 0;
    for _ in 0..400 {
        // Up to thirty come and up to thirty go, in any order, within a frame.
        for _ in 0..30 {
            seed += 5;
            if random(seed) < 0.5 {
                let at =
                    Vec3::from([1, 2, 3].map(|i| random(seed + i) * 8.0 - 4.0)) + Vec3::Y * 5.0;
                alive.push(scene::drop_marble(&mut app, 0.1 + 0.4 * random(seed + 4), at));
            } else if !alive.is_empty() {
                let marble = alive.swap_remove((random(seed + 1) * alive.len() as f32) as usize);
                app.world_mut().despawn(marble);
            }
        }
        app.update();
        let world = app.world().resource::<TawWorld>();
        assert_eq!(world.marbles.len(), alive.len());
        for row in 0..world.marbles.len() as u32 {
            let entity = world.marble_entity(row).expect("every row is an entity's");
            let radius = app.world().get::<Marble>(entity).expect("that is alive").radius;
            assert_eq!(world.marbles.radius()[row as usize], radius);
        }
    }
    assert!(alive.len() > 20, "the storm left {} marbles to check", alive.len());
    alive.drain(..).for_each(|marble| assert!(app.world_mut().despawn(marble)));
    app.update();
    assert!(app.world().resource::<TawWorld>().marbles.is_empty());
}

#[test]
fn walls_come_and_go() {
    let mut app = scene::app();
    let floor = scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y);
    scene::frames(&mut app, 100);
    assert!((scene::position(&app, marble).y - 0.5).abs() < 1e-5);
    app.world_mut().despawn(floor);
    scene::frames(&mut app, 100);
    assert!(scene::position(&app, marble).y < -5.0, "it falls without a floor");
    app.world_mut().spawn((Wall::default(), Transform::from_xyz(0.0, -20.0, 0.0)));
    scene::frames(&mut app, 300);
    assert!((scene::position(&app, marble).y + 19.5).abs() < 1e-4);
}

#[test]
fn a_removed_component_ends_the_physics_and_a_new_one_starts_it_again() {
    let mut app = scene::app();
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y);
    scene::frames(&mut app, 10);
    app.world_mut().entity_mut(marble).remove::<Marble>();
    app.update();
    let at = scene::position(&app, marble);
    scene::frames(&mut app, 10);
    assert_eq!(scene::position(&app, marble), at, "no longer a marble");
    assert!(app.world().resource::<TawWorld>().marbles.is_empty());
    app.world_mut().entity_mut(marble).insert(Marble::new(0.3));
    scene::frames(&mut app, 10);
    assert!(scene::position(&app, marble).y < at.y, "a marble again, from rest");
}

#[test]
fn a_radius_may_change_at_any_time() {
    let mut app = scene::app();
    scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    for radius in [0.8, 0.2, 0.5] {
        app.world_mut().get_mut::<Marble>(marble).unwrap().radius = radius;
        scene::frames(&mut app, 300);
        let height = scene::position(&app, marble).y;
        assert!((height - radius).abs() < 1e-5, "radius {radius} rests at {height}");
    }
}

#[test]
fn optional_components_are_taken_over_and_taken_back() {
    let mut app = scene::app();
    app.insert_resource(Gravity(Vec3::NEG_Y * 30.0));
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
    let core = |app: &App| {
        let world = app.world().resource::<TawWorld>();
        world.marbles.get(world.marbles.id(0).unwrap()).unwrap()
    };
    app.world_mut().entity_mut(marble).insert((
        Velocity(Vec3::X * 3.0),
        SurfaceMaterial { friction: 0.25, ..default() },
        MarbleIntegrator(Integrator::ExplicitEuler),
    ));
    app.update();
    assert_eq!(scene::position(&app, marble), Vec3::new(3.0 * scene::STEP, 0.0, 0.0));
    assert_eq!(app.world().get::<Velocity>(marble).unwrap().x, 3.0);
    assert_eq!(app.world().get::<Velocity>(marble).unwrap().y, -30.0 * scene::STEP);
    assert_eq!(core(&app).material.unwrap().friction, 0.25);
    app.world_mut().get_mut::<Velocity>(marble).unwrap().0 = Vec3::ZERO;
    app.world_mut().entity_mut(marble).remove::<(SurfaceMaterial, MarbleIntegrator)>();
    app.update();
    assert_eq!((core(&app).material, core(&app).integrator), (None, None));
    assert_eq!(scene::position(&app, marble).x, 3.0 * scene::STEP, "it was stopped");
    assert!(scene::position(&app, marble).y < 0.0, "the model's integrator again");
}

/// Prints what 100,000 marbles cost on their way into the world and back:
/// `cargo test --test headless -- --ignored --nocapture hundred`.
#[test]
#[ignore = "prints times"]
fn a_hundred_thousand_entities_go_in_and_out() {
    use bevy::diagnostic::{Diagnostic, DiagnosticPath, DiagnosticsStore};
    use bevy_taw::diagnostics::{GATHER_TIME, SCATTER_TIME};

    let mut app = scene::app();
    let marbles = (0..100_000_u32).map(|i| {
        let at = Vec3::new((i % 100) as f32, (i / 100 % 100) as f32, (i / 10_000) as f32) * 3.0;
        (Marble::new(0.5), Transform::from_translation(at))
    });
    let marbles: Vec<_> = marbles.collect();
    app.world_mut().spawn_batch(marbles);
    let (mut gather, mut scatter) = (Vec::new(), Vec::new());
    for step in 0..60 {
        app.update();
        let store = app.world().resource::<DiagnosticsStore>();
        let value =
            |path: DiagnosticPath| store.get(&path).and_then(Diagnostic::value).unwrap_or(f64::NAN);
        if step >= 20 {
            gather.push(value(GATHER_TIME));
            scatter.push(value(SCATTER_TIME));
        }
    }
    for times in [&mut gather, &mut scatter] {
        times.sort_by(f64::total_cmp);
    }
    let (gather, scatter) = (gather[gather.len() / 2], scatter[scatter.len() / 2]);
    println!("100,000 marbles that all move: gather {gather:.2} ms, scatter {scatter:.2} ms");
}
