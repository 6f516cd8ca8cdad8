//! Plays the games of `examples/games`, and looks whether they show what they say.

#[path = "../../examples/games/hero.rs"]
mod hero;
#[path = "../../examples/games/pachinko.rs"]
mod pachinko;
#[path = "../../examples/games/paint.rs"]
mod paint;
#[path = "../../examples/games/pinball.rs"]
mod pinball;
#[path = "../../examples/games/pit.rs"]
mod pit;
#[path = "../../examples/games/run.rs"]
mod run;
#[path = "../../examples/games/sounds.rs"]
mod sounds;

use bevy::asset::AssetPlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_taw::prelude::*;

use crate::scene;

pub fn play<M>(game: impl bevy::app::Plugins<M>) -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin, AssetPlugin::default(), MeshPlugin));
    app.init_asset::<StandardMaterial>();
    app.add_plugins(TawPlugins).add_plugins(game);
    scene::frame_length(&mut app, scene::STEP);
    app.finish();
    app.cleanup();
    app.update();
    app
}

fn all<C: Component>(app: &mut App) -> Vec<Entity> {
    let world = app.world_mut();
    world.query_filtered::<Entity, With<C>>().iter(world).collect()
}

fn position(app: &App, entity: Entity) -> Vec3 {
    app.world().get::<Transform>(entity).unwrap().translation
}

#[test]
fn pachinko_fills_all_its_bins() {
    let mut app = play(pachinko::plugin);
    scene::frames(&mut app, 64 * 30);
    let marbles = all::<Marble>(&mut app);
    assert_eq!(marbles.len(), pachinko::MARBLES);
    let places = marbles.iter().map(|it| position(&app, *it));
    let hanging: Vec<_> = places.filter(|at| at.y >= 1.0).collect();
    assert!(hanging.is_empty(), "some hang in the pins: {hanging:?}");
    let counts = all::<pachinko::Bin>(&mut app)
        .into_iter()
        .map(|bin| app.world().get::<pachinko::Bin>(bin).unwrap().0 as usize);
    let counts: Vec<_> = counts.collect();
    // Who bounces in the mouth of a bin is counted twice.
    let sum: usize = counts.iter().sum();
    assert!((pachinko::MARBLES..pachinko::MARBLES * 5 / 4).contains(&sum), "{counts:?}");
    assert!(counts.iter().all(|count| (1..sum / 2).contains(count)), "{counts:?}");
}

#[test]
fn all_racers_arrive() {
    let mut app = play(run::plugin);
    scene::frames(&mut app, 64 * 20);
    let arrived = &app.world().resource::<run::Arrived>().0;
    assert_eq!(arrived.len(), 5, "{arrived:?}");
}

#[test]
fn the_ball_wades_and_none_leaves_the_pit() {
    let mut app = play(pit::plugin);
    scene::frames(&mut app, 64 * 6);
    let wader = all::<pit::Wader>(&mut app)[0];
    let begin = position(&app, wader);
    app.world_mut().resource_mut::<pit::Push>().0 = Vec2::X;
    scene::frames(&mut app, 64 * 3);
    let way = position(&app, wader) - begin;
    assert!(way.x > 0.5, "{way}");
    let world = app.world().resource::<TawWorld>();
    assert_eq!(world.swarm.len(), 4001); // the big one is a row, too
    for [x, y, z, _] in world.swarm.balls() {
        let inside = x.abs() < pit::HALF && z.abs() < pit::HALF && *y > 0.0;
        assert!(inside, "{x}, {y}, {z}");
    }
}

#[test]
fn the_hero_rides_the_ferry_and_takes_all_coins() {
    let mut app = play(hero::plugin);
    scene::frames(&mut app, 64);
    let hero = all::<MarbleController>(&mut app)[0];
    let ferry = all::<hero::Ferry>(&mut app)[0];
    let mut falls = 0;
    for _ in 0..64 * 60 {
        app.update();
        let (at, boat) = (position(&app, hero), position(&app, ferry));
        let ground = app.world().get::<Grounded>(hero).unwrap().ground;
        let on_boat = ground.is_some_and(|ground| ground.entity == ferry);
        // As a player would: to the shore, over when the ferry is there, on its middle till the other.
        let goal = match at.x {
            _ if on_boat && boat.x < 9.6 => boat.x,
            x if x < 3.0 && boat.x > 4.4 => 1.8,
            _ => 16.0,
        };
        let velocity = **app.world().get::<Velocity>(hero).unwrap();
        let frame = ground.map_or(0.0, |ground| ground.velocity.x);
        let wish = ((goal - at.x) * 2.0 - (velocity.x - frame)).clamp(-1.0, 1.0);
        let sideways = (-at.z * 2.0 - velocity.z).clamp(-1.0, 1.0);
        let mut controller = app.world_mut().get_mut::<MarbleController>(hero).unwrap();
        controller.direction = Vec3::new(wish, 0.0, sideways) * 0.5;
        falls = app.world().resource::<hero::Tally>().falls;
        if app.world().resource::<hero::Tally>().coins == 4 {
            break;
        }
    }
    assert_eq!(
        (app.world().resource::<hero::Tally>().coins, falls),
        (4, 0),
        "{}",
        position(&app, hero)
    );
}

#[test]
fn who_falls_begins_again() {
    let mut app = play(hero::plugin);
    let hero = all::<MarbleController>(&mut app)[0];
    app.world_mut().get_mut::<MarbleController>(hero).unwrap().direction = Vec3::Z;
    scene::frames(&mut app, 64 * 4);
    app.world_mut().get_mut::<MarbleController>(hero).unwrap().direction = Vec3::ZERO;
    scene::frames(&mut app, 64 * 2);
    assert!(app.world().resource::<hero::Tally>().falls >= 1);
    assert!(position(&app, hero).y > 0.0);
}

#[derive(Resource, Default)]
struct Heard(Vec<sounds::Note>);

#[test]
fn every_bar_is_heard_and_harder_hits_are_louder() {
    let mut app = play(sounds::plugin);
    app.init_resource::<Heard>().add_systems(
        Update,
        |mut notes: MessageReader<sounds::Note>, mut heard: ResMut<Heard>| {
            heard.0.extend(notes.read().copied());
        },
    );
    scene::frames(&mut app, 64 * 20);
    let heard = &app.world().resource::<Heard>().0;
    for step in 0..8 {
        assert!(heard.iter().any(|note| note.step == step), "bar {step} is not heard");
    }
    let loudest = heard.iter().map(|note| note.volume).fold(0.0, f32::max);
    // From 3 m: 7.3 m/s.
    assert!((0.75..0.95).contains(&loudest), "{loudest}");
    assert!(heard.iter().any(|note| note.volume < 0.2));
}

#[test]
fn pinball_scores_and_the_ball_stays_on_the_table() {
    let mut app = play(pinball::plugin);
    let ball = all::<pinball::Ball>(&mut app)[0];
    let flippers = all::<pinball::Flipper>(&mut app);
    for frame in 0..64 * 60 {
        let at = position(&app, ball);
        for flipper in &flippers {
            let mut flipper = app.world_mut().get_mut::<pinball::Flipper>(*flipper).unwrap();
            flipper.pressed = at.z > 2.1 && at.x * flipper.side > -0.2;
        }
        app.update();
        let at = position(&app, ball);
        let inside = at.x.abs() < 2.2 && at.z.abs() < 3.8 && at.y > 0.0 && at.y < 0.4;
        assert!(inside, "at {at} in frame {frame}");
    }
    let score = app.world().resource::<pinball::Score>();
    assert!(score.hits > 5, "{} hits", score.hits);
}
