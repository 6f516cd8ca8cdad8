//! **Hero**: a ball that you roll over islands and a ferry to collect coins. W, A, S, D and space.
//!
//! Shows a marble controller, a platform that carries, sensors that are collected, and a fall.

use bevy::color::palettes::tailwind;
use bevy::prelude::*;
use bevy_taw::prelude::*;

use super::paint::{Paint, Said, look};

const START: Vec3 = Vec3::new(0.0, 1.0, 0.0);

/// A platform that goes to and fro along x: middle, and amplitude in metres.
#[derive(Component)]
pub struct Ferry(f32, f32);

/// Coins collected, and falls.
#[derive(Resource, Default)]
pub struct Tally {
    pub coins: u32,
    pub falls: u32,
}

pub fn plugin(app: &mut App) {
    app.init_resource::<Said>()
        .init_resource::<Tally>()
        .add_systems(Startup, spawn)
        .add_systems(Update, (steer.run_if(resource_exists::<ButtonInput<KeyCode>>), follow, show))
        .add_systems(FixedUpdate, (sail, fall).before(TawSystems::Gather));
}

fn spawn(mut commands: Commands, mut paint: Paint) {
    look(&mut commands, START + Vec3::new(0.0, 4.0, 7.0), START);
    for (x, colour) in [(0.0, tailwind::EMERALD_600), (14.0, tailwind::AMBER_600)] {
        let shape = Cuboid::new(6.0, 1.0, 6.0);
        let place = Transform::from_xyz(x, -0.5, 0.0);
        commands.spawn((Wall::from(shape), place, paint.shape(shape, colour)));
    }
    let shape = Cuboid::new(2.0, 0.4, 2.0);
    let place = Transform::from_xyz(4.2, -0.2, 0.0);
    commands.spawn((
        Ferry(7.0, 2.8),
        Wall::from(shape),
        place,
        paint.shape(shape, tailwind::SKY_600),
    ));
    for x in [2.0, 7.0, 12.5, 15.0] {
        let take = |taken: On<SensorEntered>, mut tally: ResMut<Tally>, mut commands: Commands| {
            tally.coins += 1;
            commands.entity(taken.sensor).despawn();
        };
        let coin = Sphere::new(0.3);
        let place = Transform::from_xyz(x, 0.6, 0.0)
            .with_rotation(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
        let drawn = paint.shape(Cylinder::new(0.3, 0.08), tailwind::YELLOW_300);
        commands.spawn((Wall::from(coin), Sensor, place, drawn)).observe(take);
    }
    commands.spawn((
        MarbleController { acceleration: 8.0, braking: 4.0, ..default() }, // friction: 0.9 × 9.81
        Marble::new(0.35),
        SurfaceMaterial { friction: 0.9, restitution: 0.2, ..default() },
        Transform::from_translation(START),
        paint.shape(Sphere::new(0.35), tailwind::ROSE_500),
    ));
}

fn steer(
    keys: Res<ButtonInput<KeyCode>>,
    camera: Single<&GlobalTransform, With<Camera>>,
    mut hero: Single<&mut MarbleController>,
) {
    let pressed = |key| f32::from(keys.pressed(key));
    let x = pressed(KeyCode::KeyD) - pressed(KeyCode::KeyA);
    let y = pressed(KeyCode::KeyW) - pressed(KeyCode::KeyS);
    hero.direction = MarbleController::seen_from(&camera, Vec2::new(x, y), Dir3::Y);
    hero.jump |= keys.just_pressed(KeyCode::Space);
}

fn sail(mut ferries: Query<(&Ferry, &mut Transform)>, time: Res<Time>) {
    for (Ferry(middle, amplitude), mut place) in &mut ferries {
        place.translation.x = middle - amplitude * (time.elapsed_secs() * 0.8).cos();
    }
}

/// Puts a hero who fell back to the start.
fn fall(
    mut hero: Single<(&mut Transform, &mut Velocity, &mut AngularVelocity), With<MarbleController>>,
    mut tally: ResMut<Tally>,
) {
    let (place, velocity, spin) = &mut *hero;
    if place.translation.y < -5.0 {
        place.translation = START;
        (velocity.0, spin.0) = (Vec3::ZERO, Vec3::ZERO);
        tally.falls += 1;
    }
}

fn follow(
    hero: Single<&Transform, With<MarbleController>>,
    mut camera: Single<&mut Transform, (With<Camera>, Without<MarbleController>)>,
    time: Res<Time>,
) {
    let wanted = hero.translation + Vec3::new(0.0, 3.0, 7.0);
    camera.translation.smooth_nudge(&wanted, 3.0, time.delta_secs());
}

fn show(tally: Res<Tally>, mut said: ResMut<Said>) {
    said.0 = format!("{} of 4 coins, {} falls", tally.coins, tally.falls);
}
