//! **Pit**: a big ball wades through thousands of small ones.
//!
//! Shows a swarm, whose balls are no entities, and a marble among them that is one.

use bevy::color::palettes::tailwind;
use bevy::math::bounding::Aabb3d;
use bevy::prelude::*;
use bevy_taw::prelude::*;
use bevy_taw::taw::world::Mass;

use super::paint::{Paint, Said, look};

/// Half of the inner size of the pit, in metres.
pub const HALF: f32 = 2.0;

/// The big ball, which follows the arrow keys.
#[derive(Component)]
pub struct Wader;

/// Direction in which it is pushed.
#[derive(Resource, Default)]
pub struct Push(pub Vec2);

pub fn plugin(app: &mut App) {
    app.init_resource::<Said>()
        .init_resource::<Push>()
        .add_systems(Startup, (pit, balls))
        .add_systems(Update, (read_keys.run_if(resource_exists::<ButtonInput<KeyCode>>), show))
        .add_systems(FixedUpdate, wade.before(TawSystems::Gather));
}

fn pit(mut commands: Commands, mut paint: Paint) {
    look(&mut commands, Vec3::new(0.0, 6.0, 6.5), Vec3::new(0.0, 0.5, 0.0));
    commands.spawn((
        Wall::default(),
        paint.shape(Plane3d::default().mesh().size(2.0 * HALF, 2.0 * HALF), tailwind::SLATE_500),
    ));
    for (x, z) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
        let out = Vec3::new(x, 0.0, z);
        let inward = Dir3::new(-out).unwrap_or(Dir3::X);
        commands.spawn((Wall::HalfSpace(inward), Transform::from_translation(out * HALF)));
    }
}

fn balls(mut commands: Commands, mut paint: Paint) {
    let region = Aabb3d::new(Vec3::Y * 1.5, Vec3::new(0.95 * HALF, 1.4, 0.95 * HALF));
    let plastic = Mass::Density(100.0);
    commands.spawn(Swarm::filling(region, 4000, 0.06..=0.09, 7).with_mass(plastic));
    commands.spawn((
        Wader,
        Marble::new(0.4),
        MarbleMass::Density(600.0),
        Velocity::default(),
        ExternalForce::default(),
        Transform::from_xyz(0.0, 4.0, 0.0),
        paint.shape(Sphere::new(0.4), tailwind::ROSE_500),
    ));
}

fn read_keys(keys: Res<ButtonInput<KeyCode>>, mut push: ResMut<Push>) {
    let pressed = |key| f32::from(keys.pressed(key));
    push.0 = Vec2::new(
        pressed(KeyCode::ArrowRight) - pressed(KeyCode::ArrowLeft),
        pressed(KeyCode::ArrowDown) - pressed(KeyCode::ArrowUp),
    );
}

fn wade(push: Res<Push>, mut wader: Single<&mut ExternalForce, With<Wader>>) {
    let force = Vec3::new(push.0.x, 0.0, push.0.y) * 2000.0;
    if wader.force != force {
        wader.force = force;
    }
}

fn show(velocity: Single<&Velocity, With<Wader>>, mut said: ResMut<Said>) {
    said.0 = format!("{:.1} m/s", velocity.length());
}
