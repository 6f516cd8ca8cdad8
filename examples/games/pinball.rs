//! **Pinball**: flippers, bumpers and a drain. Left and right arrow.
//!
//! Shows walls that are driven, hits that push back, a tilted gravity, and a teleport.

use bevy::color::palettes::tailwind;
use bevy::prelude::*;
use bevy_taw::prelude::*;

use super::paint::{Paint, Said, look};

const RADIUS: f32 = 0.12;
const START: Vec3 = Vec3::new(0.4, RADIUS, -2.0);

/// A flipper: +1 on the right, −1 on the left; and whether its key is pressed.
#[derive(Component)]
pub struct Flipper {
    pub side: f32,
    pub pressed: bool,
}

#[derive(Component)]
pub struct Ball;

/// Bumpers hit, and balls lost.
#[derive(Resource, Default)]
pub struct Score {
    pub hits: u32,
    pub lost: u32,
}

pub fn plugin(app: &mut App) {
    app.init_resource::<Said>()
        .init_resource::<Score>()
        // The table is level, and gravity tilted: 8 degrees toward the player.
        .insert_resource(Gravity(Vec3::new(0.0, -9.71, 1.37)))
        .add_systems(Startup, (table, parts))
        .add_systems(Update, (read_keys.run_if(resource_exists::<ButtonInput<KeyCode>>), show))
        .add_systems(FixedUpdate, flip.before(TawSystems::Gather));
}

fn table(mut commands: Commands, mut paint: Paint) {
    look(&mut commands, Vec3::new(0.0, 7.5, 5.5), Vec3::new(0.0, 0.0, 0.3));
    let floor = paint.shape(Cuboid::new(4.4, 0.1, 7.2), tailwind::SLATE_700);
    commands.spawn((Wall::default(), children![(floor, Transform::from_xyz(0.0, -0.05, 0.0))]));
    // A pane of glass above, which nobody sees.
    commands.spawn((Wall::HalfSpace(Dir3::NEG_Y), Transform::from_xyz(0.0, 0.3, 0.0)));
    let mut bar = |x: f32, z: f32, turn: f32, size: Vec3| {
        let place = Transform::from_xyz(x, 0.2, z).with_rotation(Quat::from_rotation_y(turn));
        let shape = Cuboid::from_size(size);
        commands.spawn((Wall::from(shape), place, paint.shape(shape, tailwind::AMBER_700)));
    };
    for side in [-1.0, 1.0] {
        bar(side * 2.1, 0.0, 0.0, Vec3::new(0.2, 0.4, 7.2));
        bar(side * 1.52, 2.13, side * 0.5, Vec3::new(1.6, 0.4, 0.1));
    }
    bar(0.0, -3.5, 0.0, Vec3::new(4.4, 0.4, 0.2));
}

fn parts(mut commands: Commands, mut paint: Paint) {
    for (x, z) in [(-0.9, -1.5), (0.9, -1.6), (0.0, -0.6)] {
        let shape = Capsule3d::new(0.3, 1.0);
        let drawn = paint.shape(Cylinder::new(0.3, 0.4), tailwind::ROSE_500);
        commands.spawn((Wall::from(shape), Transform::from_xyz(x, 0.2, z), drawn)).observe(
            |hit: On<ContactHit>, mut score: ResMut<Score>, mut balls: Query<&mut Velocity>| {
                if let Ok(mut velocity) = balls.get_mut(hit.pair.b) {
                    velocity.0 += hit.normal.with_y(0.0) * 2.5;
                    score.hits += 1;
                }
            },
        );
    }
    for side in [-1.0, 1.0] {
        let shape = Cuboid::new(0.8, 0.3, 0.14);
        let arm = Transform::from_xyz(-0.38 * side, 0.0, 0.0);
        let pivot = Transform::from_xyz(side * 0.95, 0.2, 2.5);
        let flipper = (Flipper { side, pressed: false }, Kinematic, pivot, Visibility::default());
        let drawn = paint.shape(shape, tailwind::SKY_400);
        commands.spawn((flipper, children![(Wall::from(shape), arm, drawn)]));
    }
    let drain = Wall::from(Cuboid::new(4.4, 0.6, 0.2));
    commands.spawn((drain, Sensor, Transform::from_xyz(0.0, 0.2, 3.5))).observe(
        |lost: On<SensorEntered>,
         mut balls: Query<(&mut Transform, &mut Velocity)>,
         mut score: ResMut<Score>| {
            if let Ok((mut place, mut velocity)) = balls.get_mut(lost.collider) {
                (place.translation, velocity.0) = (START, Vec3::new(-0.7, 0.0, -2.0));
                score.lost += 1;
            }
        },
    );
    let surface = SurfaceMaterial { restitution: 0.5, friction: 0.1, ..default() };
    let drawn = paint.shape(Sphere::new(RADIUS), tailwind::SLATE_200);
    let motion = (Velocity(Vec3::new(-0.7, 0.0, -2.0)), Transform::from_translation(START));
    commands.spawn((
        Ball,
        Marble::new(RADIUS),
        MarbleMass::Density(7800.0),
        surface,
        motion,
        drawn,
    ));
}

fn read_keys(keys: Res<ButtonInput<KeyCode>>, mut flippers: Query<&mut Flipper>) {
    for mut flipper in &mut flippers {
        let key = if flipper.side > 0.0 { KeyCode::ArrowRight } else { KeyCode::ArrowLeft };
        flipper.pressed = keys.pressed(key);
    }
}

/// Up at 20 rad/s, back at half of that.
fn flip(mut flippers: Query<(&Flipper, &mut Transform)>, time: Res<Time>) {
    for (flipper, mut place) in &mut flippers {
        let [down, up] = [-0.45, 0.5].map(|angle: f32| -angle * flipper.side);
        let (target, speed) = if flipper.pressed { (up, 20.0) } else { (down, 10.0) };
        place.rotation =
            place.rotation.rotate_towards(Quat::from_rotation_y(target), speed * time.delta_secs());
    }
}

fn show(score: Res<Score>, mut said: ResMut<Said>) {
    said.0 = format!("{} hits, {} balls lost", score.hits, score.lost);
}
