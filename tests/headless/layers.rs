//! The component `CollisionLayers`, on marbles, walls and swarms, changed while running.

use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene;

#[derive(PhysicsLayer)]
enum Layer {
    Floor,
    Ghost,
}

const FLOOR: Layer = Layer::Floor;
const GHOST: Layer = Layer::Ghost;

fn app(response: Response) -> App {
    let mut app = scene::app();
    let rotation = Rotation::Dynamic;
    app.insert_resource(TawModel(Model { response, rotation, ..Model::default() }));
    app
}

fn height(app: &App, entity: Entity) -> f32 {
    scene::position(app, entity).y
}

#[test]
fn ghosts_meet_the_floor_and_not_each_other() {
    for response in [Response::Displacement, Response::Impulse, Response::SoftStep] {
        let mut app = app(response);
        let floor = scene::floor(&mut app);
        let ghost = CollisionLayers::new(GHOST, FLOOR);
        let places = [Vec3::new(5.0, 1.0, 0.0), Vec3::Y, Vec3::Y * 2.5];
        let marbles = places.map(|at| scene::drop_marble(&mut app, 0.5, at));
        for entity in &marbles[1..] {
            app.world_mut().entity_mut(*entity).insert(ghost);
        }
        app.world_mut().entity_mut(floor).insert(CollisionLayers::new(FLOOR, [FLOOR, GHOST]));
        scene::frames(&mut app, 120);
        // They meet the floor, and are in the same place.
        let apart = height(&app, marbles[1]) - height(&app, marbles[2]);
        assert!(apart.abs() < 0.1, "{response:?}: {apart}");
        let below = |app: &App, entity| height(app, entity) < -1.0;
        assert!(marbles.iter().all(|entity| !below(&app, *entity)), "{response:?}");
        app.world_mut().entity_mut(floor).insert(CollisionLayers::new(FLOOR, FLOOR));
        scene::frames(&mut app, 120);
        assert!(below(&app, marbles[1]) && below(&app, marbles[2]), "{response:?}");
        assert!(!below(&app, marbles[0]), "{response:?}");
        // Without the component, it is as it was; and the one that rests is let through.
        app.world_mut().entity_mut(floor).remove::<CollisionLayers>();
        scene::frames(&mut app, 60);
        assert!(!below(&app, marbles[0]), "{response:?}");
        app.world_mut().entity_mut(marbles[0]).insert(CollisionLayers::new(GHOST, GHOST));
        app.world_mut().entity_mut(floor).insert(CollisionLayers::new(FLOOR, FLOOR));
        scene::frames(&mut app, 120);
        assert!(below(&app, marbles[0]), "{response:?}");
    }
}

#[test]
fn a_sleeping_marble_wakes_when_its_layers_change() {
    let mut app = app(Response::SoftStep);
    scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    scene::frames(&mut app, 300);
    assert!(app.world().get::<Sleeping>(marble).is_some());
    app.world_mut().entity_mut(marble).insert(CollisionLayers::NONE);
    scene::frames(&mut app, 60);
    assert!(height(&app, marble) < -1.0);
    let lower = height(&app, marble);
    // Losing the component counts, too: it is pushed out of the floor.
    app.world_mut().entity_mut(marble).remove::<CollisionLayers>();
    scene::frames(&mut app, 60);
    assert!(height(&app, marble) > lower);
}

#[test]
fn the_layers_of_a_swarm_are_those_of_its_balls() {
    let mut app = app(Response::Impulse);
    let floor = scene::floor(&mut app);
    app.world_mut().entity_mut(floor).insert(CollisionLayers::new(FLOOR, !LayerMask::from(GHOST)));
    let balls = |x: f32| vec![Ball::new([x, 1.0, 0.0].into(), 0.5)];
    let solid = app.world_mut().spawn(Swarm::new(balls(0.0))).id();
    let ghosts =
        app.world_mut().spawn((Swarm::new(balls(5.0)), CollisionLayers::new(GHOST, GHOST))).id();
    let lowest = |app: &App, swarm| {
        let world = app.world().resource::<TawWorld>();
        let positions = app.world().get::<Swarm>(swarm).unwrap().positions(world);
        positions.fold(f32::MAX, |least, at| least.min(at.y))
    };
    scene::frames(&mut app, 90);
    assert!(lowest(&app, solid) > 0.4);
    assert!(lowest(&app, ghosts) < -1.0);
    // Balls that come later have them, too; and all change with the component.
    app.world_mut().get_mut::<Swarm>(ghosts).unwrap().extend(balls(9.0));
    app.world_mut().entity_mut(solid).insert(CollisionLayers::new(GHOST, GHOST));
    scene::frames(&mut app, 90);
    let world = app.world().resource::<TawWorld>();
    let heights: Vec<_> = [solid, ghosts]
        .into_iter()
        .flat_map(|swarm| app.world().get::<Swarm>(swarm).unwrap().positions(world))
        .collect();
    assert!(heights.len() == 3 && heights.iter().all(|at| at.y < -1.0), "{heights:?}");
}

#[test]
fn masks_are_made_of_layers_arrays_and_bits() {
    assert_eq!(LayerMask::from(GHOST), LayerMask(2));
    assert_eq!(LayerMask::from([FLOOR, GHOST]), LayerMask(3));
    assert_eq!(LayerMask::from(&[FLOOR][..]) | GHOST.into(), LayerMask::from(3));
    assert_eq!(!LayerMask::NONE, LayerMask::ALL);
    let ghost = CollisionLayers::new(GHOST, FLOOR);
    assert!(ghost.interacts_with(CollisionLayers::default()) && !ghost.interacts_with(ghost));
}
