//! Parts that the tests share: the app, its clock, a board, a way to drop marbles.

use bevy::app::Plugins;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_taw::prelude::*;

/// The length of a fixed step. A power of two, so that frames add up exactly.
pub const STEP: f32 = 1.0 / 64.0;

/// An app with the lecture's model whose frames are one fixed step long each, and whose
/// `Transform`s are those of the last step.
pub fn app() -> App {
    app_with(TawPlugin)
}

/// That app with everything that one with a window would have.
pub fn smooth_app() -> App {
    app_with(TawPlugins)
}

pub fn app_with<M>(physics: impl Plugins<M>) -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin));
    app.add_plugins(physics);
    app.insert_resource(TawModel(Model::default()));
    app.insert_resource(Time::<Fixed>::from_seconds(f64::from(STEP)));
    frame_length(&mut app, STEP);
    app.finish();
    app.cleanup();
    app.update(); // Bevy's first frame takes no time.
    app
}

/// Sets the time of a frame from now on, in seconds.
pub fn frame_length(app: &mut App, seconds: f32) {
    let duration = std::time::Duration::from_secs_f32(seconds);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(duration));
}

pub fn frames(app: &mut App, count: u32) {
    (0..count).for_each(|_| app.update());
}

pub fn drop_marble(app: &mut App, radius: f32, at: Vec3) -> Entity {
    app.world_mut().spawn((Marble::new(radius), Transform::from_translation(at))).id()
}

pub fn floor(app: &mut App) -> Entity {
    app.world_mut().spawn(Wall::default()).id()
}

pub fn position(app: &App, entity: Entity) -> Vec3 {
    app.world().get::<Transform>(entity).unwrap().translation
}

/// The inner half width of the [`board`], in metres.
pub const HALF: f32 = 5.0;

/// A board that turns about the origin: a floor and four sides as its children.
pub fn board(app: &mut App) -> Entity {
    let side = |x: f32, z: f32| {
        let normal = Dir3::new(Vec3::new(-x, 0.0, -z)).unwrap();
        (Wall::HalfSpace(normal), Transform::from_xyz(x * HALF, 0.0, z * HALF))
    };
    let board = app.world_mut().spawn(Transform::default()).id();
    app.world_mut().entity_mut(board).with_children(|children| {
        children.spawn(Wall::default());
        for (x, z) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
            children.spawn(side(x, z));
        }
    });
    board
}

/// A pseudo-random number in [0, 1) for each `seed` (`SplitMix64`, Steele 2014).
pub fn random(seed: u64) -> f32 {
    let mut z = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 40) as f32 / (1_u32 << 24) as f32
}

/// Drops marbles with radii in [0.2, 0.6] in layers above the board.
pub fn drop_marbles(app: &mut App, count: u64) -> Vec<Entity> {
    (0..count)
        .map(|i| {
            let at = Vec3::new(
                (i % 6) as f32 * 1.5 - 3.75 + random(3 * i) * 0.2,
                1.0 + (i / 36) as f32 * 1.3,
                (i / 6 % 6) as f32 * 1.5 - 3.75 + random(3 * i + 1) * 0.2,
            );
            drop_marble(app, 0.2 + 0.4 * random(3 * i + 2), at)
        })
        .collect()
}
