//! **Sounds**: marbles rain on bars; each hit is a note, as loud as the hit was hard.
//!
//! Shows `ContactHit`, which tells each hit and how fast it was: what an audio library would play.

use bevy::color::palettes::tailwind;
use bevy::prelude::*;
use bevy_taw::prelude::*;

use super::paint::{Paint, Said, look};

const BARS: u32 = 8;

/// A bar, and its note: steps of the scale above C.
#[derive(Component)]
pub struct Bar(pub u32);

/// A note that is to be played.
#[derive(Message, Clone, Copy, Debug)]
pub struct Note {
    pub step: u32,
    /// From 0 to 1.
    pub volume: f32,
}

pub fn plugin(app: &mut App) {
    app.init_resource::<Said>()
        .add_message::<ContactHit>()
        .add_message::<Note>()
        .add_systems(Startup, spawn)
        .add_systems(
            FixedUpdate,
            (rain.before(TawSystems::Gather), ring.after(TawSystems::Scatter)),
        )
        .add_systems(Update, (glow, show));
}

fn spawn(mut commands: Commands, mut paint: Paint) {
    look(&mut commands, Vec3::new(0.0, 4.0, 7.0), Vec3::new(0.0, 0.5, 0.0));
    for i in 0..BARS {
        let shape = Cuboid::new(0.7, 0.15, 3.0 - 0.25 * i as f32);
        // Tilted toward you, so that marbles roll off.
        let place = Transform::from_xyz(0.8 * (i as f32 - 3.5), 0.0, 0.0)
            .with_rotation(Quat::from_rotation_x(0.15));
        let colour = Hsva::hsv(i as f32 * 40.0, 0.7, 0.9);
        commands.spawn((Bar(i), Wall::from(shape), place, paint.shape(shape, colour)));
    }
}

/// One every quarter of a second, from between half a metre and three.
fn rain(
    mut commands: Commands,
    mut paint: Paint,
    mut steps: Local<u32>,
    fallen: Query<(Entity, &Transform), With<Marble>>,
) {
    *steps += 1;
    if steps.is_multiple_of(16) {
        let drop = *steps / 16;
        let (bar, height) = (drop * 5 % BARS, 0.5 + 2.5 * (drop as f32 * 0.618).fract());
        commands.spawn((
            Marble::new(0.12),
            SurfaceMaterial { restitution: 0.6, ..default() },
            Transform::from_xyz(0.8 * (bar as f32 - 3.5), height, -0.3),
            paint.shape(Sphere::new(0.12), tailwind::SLATE_200),
        ));
    }
    for (marble, _) in fallen.iter().filter(|(_, at)| at.translation.y < -4.0) {
        commands.entity(marble).despawn();
    }
}

/// Each hit of a bar is a note; what touches softly is not heard.
fn ring(mut hits: MessageReader<ContactHit>, bars: Query<&Bar>, mut notes: MessageWriter<Note>) {
    for hit in hits.read().filter(|hit| hit.approach_speed > 0.3) {
        if let Ok(Bar(step)) = bars.get(hit.pair.a) {
            let volume = (hit.approach_speed / 8.0).min(1.0);
            notes.write(Note { step: *step, volume });
        }
    }
}

fn glow(
    mut notes: MessageReader<Note>,
    mut bars: Query<(&Bar, &MeshMaterial3d<StandardMaterial>)>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let played: Vec<_> = notes.read().copied().collect();
    for (Bar(step), material) in &mut bars {
        let loudest = played.iter().filter(|note| note.step == *step).map(|note| note.volume);
        let loudest = loudest.fold(0.0, f32::max);
        if let Some(mut material) = materials.get_mut(&material.0) {
            let before = material.emissive.red;
            material.emissive = LinearRgba::gray((before * 0.9).max(3.0 * loudest));
        }
    }
}

fn show(mut notes: MessageReader<Note>, mut said: ResMut<Said>) {
    for note in notes.read() {
        let name = ["C", "D", "E", "F", "G", "A", "B", "C'"][note.step as usize % 8];
        said.0 = format!("{name}, volume {:.0} %", 100.0 * note.volume);
    }
}
