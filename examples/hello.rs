//! **Hello**: one marble falls on a floor.
//!
//! `cargo run --example hello` (`-- --help` for options)

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy_taw::prelude::*;
use clap::Parser;
use taw_examples::{ExamplePlugins, Picture};

#[derive(Parser)]
struct Options {
    #[command(flatten)]
    picture: Picture,
}

fn main() -> AppExit {
    let Options { picture } = Options::parse();
    App::new()
        .add_plugins((ExamplePlugins { title: "Hello", picture }, TawPlugins))
        .add_systems(Startup, spawn)
        .run()
}

fn spawn(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    commands.spawn((
        Wall::default(), // a half-space, solid below its +Y
        Mesh3d(meshes.add(Plane3d::default().mesh().size(8.0, 8.0))),
        MeshMaterial3d(materials.add(Color::srgb(0.5, 0.6, 0.5))),
    ));
    commands.spawn((
        Marble::new(0.5),
        Velocity(Vec3::X),
        SurfaceMaterial { restitution: 0.8, ..default() },
        Transform::from_xyz(-1.0, 3.0, 0.0),
        Mesh3d(meshes.add(Sphere::new(0.5))),
        MeshMaterial3d(materials.add(Color::srgb(0.8, 0.3, 0.2))),
    ));
    commands.spawn((
        DirectionalLight::default(),
        Transform::from_xyz(2.0, 5.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((
        Camera3d::default(),
        Tonemapping::AcesFitted, // the default needs a look-up table, which Bevy is built without here
        Transform::from_xyz(0.0, 3.0, 8.0).looking_at(Vec3::Y, Vec3::Y),
    ));
}
