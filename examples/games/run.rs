//! **Run**: marbles race down a spiral track.
//!
//! Shows a track that is made of the mesh that is drawn, a finish, and the order of arrival.

use std::f32::consts::{PI, TAU};

use bevy::asset::RenderAssetUsages;
use bevy::color::palettes::tailwind;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy_taw::prelude::*;

use super::paint::{Paint, Said, look};

const RADIUS: f32 = 0.12;
const COLOURS: [(&str, Srgba); 5] = [
    ("Rose", tailwind::ROSE_500),
    ("Sky", tailwind::SKY_400),
    ("Lime", tailwind::LIME_400),
    ("Amber", tailwind::AMBER_400),
    ("Violet", tailwind::VIOLET_500),
];

/// Names of those that arrived, in order.
#[derive(Resource, Default)]
pub struct Arrived(pub Vec<String>);

pub fn plugin(app: &mut App) {
    app.init_resource::<Said>()
        .init_resource::<Arrived>()
        .add_systems(Startup, (track, racers))
        .add_systems(Update, show);
}

/// Middle of the track after so many turns.
fn middle(turns: f32) -> Vec3 {
    let (sin, cos) = (turns * TAU).sin_cos();
    Vec3::new(2.5 * cos, 3.0 - 0.9 * turns, 2.5 * sin)
}

/// A half-pipe of 40 cm along the spiral.
fn half_pipe() -> Mesh {
    const ALONG: u32 = 240;
    const ACROSS: u32 = 16;
    let mut points = Vec::new();
    for i in 0..=ALONG {
        let turns = 2.0 * i as f32 / ALONG as f32;
        let outward = middle(turns).with_y(0.0).normalize();
        for j in 0..=ACROSS {
            let (up, out) = (PI * j as f32 / ACROSS as f32).sin_cos();
            points.push(middle(turns) + 0.4 * (outward * out - Vec3::Y * up));
        }
    }
    let mut corners = Vec::new();
    for i in 0..ALONG {
        for j in 0..ACROSS {
            let at = |i: u32, j: u32| i * (ACROSS + 1) + j;
            corners.extend([at(i, j), at(i + 1, j), at(i, j + 1)]);
            corners.extend([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, points)
        .with_inserted_indices(Indices::U32(corners))
        .with_computed_smooth_normals()
}

fn track(mut commands: Commands, mut paint: Paint) {
    look(&mut commands, Vec3::new(0.0, 6.0, 7.0), Vec3::new(0.0, 1.5, 0.0));
    commands.spawn((MeshWalls::default(), paint.shape(half_pipe(), tailwind::SLATE_400)));
    commands.spawn((
        Wall::default(),
        paint.shape(Plane3d::default().mesh().size(16.0, 16.0), tailwind::EMERALD_800),
    ));
    let arrive = |entered: On<SensorEntered>, names: Query<&Name>, mut arrived: ResMut<Arrived>| {
        let name = names.get(entered.collider).map(ToString::to_string).unwrap_or_default();
        if !arrived.0.contains(&name) {
            arrived.0.push(name);
        }
    };
    let finish = Wall::from(Cuboid::new(1.0, 1.0, 0.02));
    commands.spawn((finish, Sensor, Transform::from_translation(middle(1.99)))).observe(arrive);
}

fn racers(mut commands: Commands, mut paint: Paint) {
    for (i, (name, colour)) in COLOURS.into_iter().enumerate() {
        let place = middle(0.02 + 0.02 * i as f32) - Vec3::Y * (0.4 - RADIUS - 0.01);
        commands.spawn((
            Name::new(name),
            Marble::new(RADIUS),
            Transform::from_translation(place),
            paint.shape(Sphere::new(RADIUS), colour),
        ));
    }
}

fn show(arrived: Res<Arrived>, mut said: ResMut<Said>) {
    let places = arrived.0.iter().enumerate().map(|(i, name)| format!("{}. {name}", i + 1));
    said.0 = places.collect::<Vec<_>>().join("\n");
}
