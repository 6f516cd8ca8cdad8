//! Several worlds in one app: each further one is a Bevy `World` with the plugin, stepped with that of the app.

use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_taw::prelude::*;

use crate::scene::{self, STEP, frames, position};

/// A world of its own beside that of the app, as the docs of the crate have it.
#[derive(Resource)]
struct Second(World);

/// Entity of the second world that is drawn at the place of this one.
#[derive(Component)]
struct Shows(Entity);

/// Exclusive, since one schedule does not run in a thread of another.
fn step_second(app: &mut World) {
    let second = &mut app.resource_mut::<Second>().into_inner().0;
    second.run_schedule(Main);
    second.clear_trackers();
}

fn show_second(second: Res<Second>, mut shown: Query<(&Shows, &mut Transform)>) {
    for (Shows(entity), mut drawn) in &mut shown {
        if let Some(place) = second.0.get::<Transform>(*entity) {
            *drawn = *place;
        }
    }
}

/// App with two worlds: the second has gravity along x and the event-driven model.
fn app() -> App {
    let mut second = App::new();
    second.add_plugins((MinimalPlugins, TransformPlugin, TawPlugin));
    let step = std::time::Duration::from_secs_f32(STEP);
    second
        .insert_resource(Time::<Fixed>::from_duration(step))
        .insert_resource(TimeUpdateStrategy::ManualDuration(step))
        .insert_resource(TawModel(Model::EXACT))
        .insert_resource(Gravity(Vec3::X * 4.0))
        .add_message::<ContactStarted>();
    second.finish();
    second.cleanup();
    second.update(); // Bevy's first frame takes no time
    let mut app = scene::app();
    app.insert_resource(TawModel(Model::GAME)).add_message::<ContactStarted>();
    app.insert_resource(Second(std::mem::take(second.world_mut())));
    let systems = (step_second, show_second).chain();
    app.add_systems(FixedUpdate, systems.after(TawSystems::Scatter));
    app
}

fn second(app: &mut App) -> &mut World {
    &mut app.world_mut().resource_mut::<Second>().into_inner().0
}

/// Marble of the second world, and the entity that shows it.
fn spawn_in_second(app: &mut App, marble: impl Bundle) -> [Entity; 2] {
    let there = second(app).spawn(marble).id();
    [there, app.world_mut().spawn((Shows(there), Transform::default())).id()]
}

fn started(world: &World) -> Vec<ContactPair> {
    let messages = world.resource::<Messages<ContactStarted>>();
    messages.iter_current_update_messages().map(|it| it.pair).collect()
}

#[test]
fn two_worlds_at_one_place_do_not_meet_and_have_their_own_gravity_and_model() {
    let mut app = app();
    let here = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
    let marble = (Marble::new(0.5), Transform::default());
    let [there, shown] = spawn_in_second(&mut app, marble);
    frames(&mut app, 64);
    let fallen = position(&app, here);
    assert!(fallen.x == 0.0 && fallen.z == 0.0 && (fallen.y + 4.905).abs() < 0.1, "{fallen}");
    let fallen = position(&app, shown);
    assert!(fallen.y == 0.0 && fallen.z == 0.0 && (fallen.x - 2.0).abs() < 0.05, "{fallen}");
    let model = |world: &World| world.resource::<TawWorld>().model();
    assert_eq!(model(app.world()), Model::GAME);
    assert_eq!(model(second(&mut app)), Model::EXACT);
    second(&mut app).despawn(there);
    frames(&mut app, 2);
    assert!(second(&mut app).resource::<TawWorld>().marbles.is_empty());
    assert_eq!(app.world().resource::<TawWorld>().marbles.len(), 1);
}

#[test]
fn messages_and_queries_are_those_of_their_world() {
    let mut app = app();
    scene::floor(&mut app);
    let here = scene::drop_marble(&mut app, 0.5, Vec3::Y * 0.5);
    let wall = (Wall::HalfSpace(Dir3::NEG_X), Transform::from_xyz(5.0, 0.0, 0.0));
    let wall = second(&mut app).spawn(wall).id();
    let marble = (Marble::new(0.25), Transform::from_xyz(4.5, 0.0, 0.0));
    let [there, _] = spawn_in_second(&mut app, marble);
    let [mut of_here, mut of_there] = [Vec::new(), Vec::new()];
    for _ in 0..64 {
        app.update();
        of_here.extend(started(app.world()));
        of_there.extend(started(second(&mut app)));
    }
    assert!(of_here.len() == 1 && of_here[0].b == here, "{of_here:?}");
    assert!(
        !of_there.is_empty() && of_there.iter().all(|it| *it == ContactPair { a: wall, b: there })
    );
    let ray = Ray3d::new(Vec3::new(4.75, 9.0, 0.0), Dir3::NEG_Y);
    let hit = move |spatial: SpatialQuery| {
        let hit = spatial.cast_ray(ray, 20.0, &SpatialQueryFilter::marbles());
        hit.map(|hit| hit.entity)
    };
    assert_eq!(app.world_mut().run_system_once(hit).unwrap(), None);
    assert_eq!(second(&mut app).run_system_once(hit).unwrap(), Some(there));
}

/// A marble goes through a portal: what it is and how it moves goes along.
#[test]
fn a_marble_moves_from_one_world_to_the_other() {
    let mut app = app();
    let here = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
    app.world_mut().entity_mut(here).insert(Velocity(Vec3::Z));
    frames(&mut app, 32);
    let mut leaves = app.world_mut().entity_mut(here);
    let marble = leaves.take::<(Marble, Velocity)>();
    let (marble, place) = (marble.unwrap(), *leaves.get::<Transform>().unwrap());
    let there = second(&mut app).spawn((marble, place)).id();
    app.world_mut().entity_mut(here).insert(Shows(there));
    frames(&mut app, 32);
    assert!(app.world().resource::<TawWorld>().marbles.is_empty());
    let now = position(&app, here);
    assert!((now.z - 1.0).abs() < 1e-3 && now.x > 0.4, "{now}");
    let speed = second(&mut app).get::<Velocity>(there).unwrap().0;
    assert!((speed - Vec3::new(2.0, -4.905, 1.0)).length() < 0.1, "{speed}");
}
