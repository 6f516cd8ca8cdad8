//! **Pachinko**: marbles fall through rows of pins into bins, which count them.
//!
//! Shows walls of Bevy's shapes, two panes of glass as half-spaces, sensors and an observer.

use bevy::color::palettes::tailwind;
use bevy::prelude::*;
use bevy_taw::prelude::*;

use super::paint::{Paint, Said, look};

const RADIUS: f32 = 0.09;
const ROWS: i32 = 9;
pub const BINS: i32 = 9;
pub const MARBLES: usize = 50;

/// A bin, and how many marbles fell into it.
#[derive(Component)]
pub struct Bin(pub u32);

pub fn plugin(app: &mut App) {
    app.init_resource::<Said>()
        .add_systems(Startup, (board, bins))
        .add_systems(FixedUpdate, drop_marble.before(TawSystems::Gather))
        .add_systems(Update, show);
}

fn board(mut commands: Commands, mut paint: Paint) {
    look(&mut commands, Vec3::new(0.0, 3.0, 9.0), Vec3::new(0.0, 2.6, 0.0));
    // Slippery glass before and behind, a hair more than a marble apart.
    let glass = SurfaceMaterial { friction: 0.02, ..default() };
    for z in [-1.0, 1.0] {
        let place = Transform::from_xyz(0.0, 0.0, z * (RADIUS + 0.01));
        let inward = Dir3::new(Vec3::Z * -z).unwrap_or(Dir3::Z);
        commands.spawn((Wall::HalfSpace(inward), glass, place));
    }
    let pin = Capsule3d::new(0.04, 2.0 * RADIUS);
    for row in 0..ROWS {
        for column in 0..BINS - row % 2 {
            let x = (column - BINS / 2) as f32 + 0.5 * (row % 2) as f32;
            let place = Transform::from_xyz(x * 0.5, 1.4 + 0.45 * row as f32, 0.0)
                .with_rotation(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
            commands.spawn((Wall::from(pin), place, paint.shape(pin, tailwind::AMBER_300)));
        }
    }
}

fn bins(mut commands: Commands, mut paint: Paint) {
    let floor = Cuboid::new(6.0, 0.1, 1.0);
    commands.spawn((
        Wall::from(floor),
        paint.shape(floor, tailwind::SLATE_600),
        Transform::from_xyz(0.0, -0.05, 0.0),
    ));
    let board = Cuboid::new(0.04, 1.0, 2.0 * RADIUS);
    let side = Cuboid::new(0.04, 7.0, 2.0 * RADIUS);
    for i in 0..=BINS {
        let x = 0.5 * (i as f32 - 0.5 * BINS as f32);
        let (shape, y) = if i % BINS == 0 { (side, 3.5) } else { (board, 0.5) };
        let drawn = paint.shape(shape, tailwind::SLATE_400);
        commands.spawn((Wall::from(shape), drawn, Transform::from_xyz(x, y, 0.0)));
    }
    for i in 0..BINS {
        let mouth = Wall::from(Cuboid::new(0.44, 0.05, 2.0 * RADIUS));
        let place = Transform::from_xyz(0.5 * (i - BINS / 2) as f32, 1.0 - RADIUS, 0.0);
        let count = |fallen: On<SensorEntered>, mut bins: Query<&mut Bin>| {
            if let Ok(mut bin) = bins.get_mut(fallen.sensor) {
                bin.0 += 1;
            }
        };
        commands.spawn((Bin(0), mouth, Sensor, place)).observe(count);
    }
}

/// One every eighth of a second, not exactly in the middle.
fn drop_marble(mut commands: Commands, mut paint: Paint, mut steps: Local<usize>) {
    *steps += 1;
    if !steps.is_multiple_of(8) || *steps / 8 > MARBLES {
        return;
    }
    let colour = [tailwind::ROSE_500, tailwind::SKY_400, tailwind::LIME_400][*steps / 8 % 3];
    let side = ((*steps as f32 * 0.618).fract() - 0.5) * 0.2;
    commands.spawn((
        Marble::new(RADIUS),
        SurfaceMaterial { restitution: 0.4, friction: 0.1, ..default() },
        Transform::from_xyz(side, 6.0, 0.0),
        paint.shape(Sphere::new(RADIUS), colour),
    ));
}

fn show(bins: Query<(&Bin, &Transform)>, mut said: ResMut<Said>) {
    let mut counts: Vec<_> = bins.iter().map(|(bin, at)| (at.translation.x, bin.0)).collect();
    counts.sort_by(|a, b| a.0.total_cmp(&b.0));
    said.0 = counts.iter().map(|(_, count)| format!("{count:3}")).collect::<Vec<_>>().join("  ");
}
