//! **Turntable**: a ball that rolls on a turning disc neither flies off nor stays. It
//! circles, at two sevenths of the disc's rate (Weltner 1979), wherever it began.
//!
//! `cargo run --example turntable` (`-- --help` for options)
//!
//! Worth a look: each ball's trail closes on itself, turn after turn; most engines
//! let it spiral out. The slider turns the disc faster; the circles change with it. R
//! starts anew.

use std::collections::VecDeque;

use bevy::color::palettes::tailwind;
use bevy::prelude::*;
use bevy_egui::{EguiContexts, EguiPlugin, EguiPrimaryContextPass, egui};
use bevy_taw::prelude::*;
use clap::Parser;
use taw_examples::{ExamplePlugins, OrbitCameraPlugin, Picture, orbit_camera};

const RADIUS: f32 = 0.25;
/// Start of each ball and its velocity along z, and its colour.
const BALLS: [(f32, f32, Srgba); 3] = [
    (2.0, 0.5, tailwind::ROSE_500),
    (-3.4, 0.4, tailwind::AMBER_400),
    (-1.0, 0.7, tailwind::SKY_400),
];

#[derive(Parser)]
struct Options {
    #[command(flatten)]
    picture: Picture,
}

/// In rad/s, about +y.
#[derive(Resource)]
struct Rate(f32);

#[derive(Component)]
struct Disc;

#[derive(Component)]
struct Trail(VecDeque<Vec3>, Srgba);

fn main() -> AppExit {
    let picture = Options::parse().picture;
    App::new()
        .add_plugins(ExamplePlugins { title: "Turntable", picture })
        .add_plugins((EguiPlugin::default(), OrbitCameraPlugin, TawPlugins))
        .insert_resource(TawModel(Model {
            response: Response::EventDriven,
            rotation: Rotation::Dynamic,
            precision: Precision::Compensated,
            ..default()
        }))
        .insert_resource(Rate(2.0))
        .insert_resource(ClearColor(tailwind::SLATE_900.into()))
        .add_systems(Startup, (spawn, start).chain())
        .add_systems(
            Update,
            (
                start.run_if(|keys: Res<ButtonInput<KeyCode>>| keys.just_pressed(KeyCode::KeyR)),
                draw,
            ),
        )
        .add_systems(
            FixedUpdate,
            (turn.before(TawSystems::Gather), leave_trails.after(TawSystems::Scatter)),
        )
        .add_systems(EguiPrimaryContextPass, panel)
        .run()
}

fn spawn(
    mut commands: Commands,
    assets: Res<AssetServer>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    commands.spawn((
        Disc,
        Wall::default(),
        Transform::default(),
        Visibility::default(),
        children![(
            Mesh3d(meshes.add(Cylinder::new(6.0, 0.2).mesh().resolution(96))),
            MeshMaterial3d(materials.add(StandardMaterial {
                base_color_texture: Some(assets.load("textures/wood.png")),
                perceptual_roughness: 0.7,
                ..default()
            })),
            Transform::from_xyz(0.0, -0.1, 0.0),
        )],
    ));
    commands.spawn((
        DirectionalLight { illuminance: 8000.0, shadow_maps_enabled: true, ..default() },
        Transform::from_xyz(3.0, 8.0, 4.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.insert_resource(GlobalAmbientLight { brightness: 300.0, ..default() });
    commands.spawn(orbit_camera(Vec3::ZERO, 14.0));
}

/// Puts the balls at their places, each rolling without slip.
fn start(
    mut commands: Commands,
    old: Query<Entity, With<Marble>>,
    rate: Res<Rate>,
    assets: Res<AssetServer>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    old.iter().for_each(|ball| commands.entity(ball).despawn());
    for (x, speed, colour) in BALLS {
        let velocity = Vec3::Z * speed;
        let under = (Vec3::Y * rate.0).cross(Vec3::X * x);
        commands.spawn((
            Marble::new(RADIUS),
            Velocity(velocity),
            AngularVelocity((under - velocity).cross(Vec3::Y) / RADIUS),
            SurfaceMaterial { friction: 2.0, restitution: 0.3, ..default() },
            Trail(VecDeque::new(), colour),
            Transform::from_xyz(x, RADIUS, 0.0),
            Mesh3d(meshes.add(Sphere::new(RADIUS).mesh().uv(32, 18))),
            MeshMaterial3d(materials.add(StandardMaterial {
                base_color: colour.into(),
                base_color_texture: Some(assets.load("textures/marble.png")),
                perceptual_roughness: 0.3,
                ..default()
            })),
        ));
    }
}

fn turn(mut disc: Single<&mut Transform, With<Disc>>, rate: Res<Rate>, time: Res<Time>) {
    disc.rotate_y(rate.0 * time.delta_secs());
}

fn leave_trails(mut balls: Query<(&Transform, &mut Trail)>) {
    for (at, mut trail) in &mut balls {
        trail.0.push_back(at.translation - Vec3::Y * (RADIUS - 0.01));
        if trail.0.len() > 3000 {
            trail.0.pop_front();
        }
    }
}

fn draw(mut gizmos: Gizmos, trails: Query<&Trail>) {
    for Trail(points, colour) in &trails {
        gizmos.linestrip(points.iter().copied(), *colour);
    }
}

fn panel(mut contexts: EguiContexts, mut rate: ResMut<Rate>) -> Result {
    egui::Window::new("Turntable").default_pos([10.0, 10.0]).show(contexts.ctx_mut()?, |ui| {
        ui.add(egui::Slider::new(&mut rate.0, -6.0..=6.0).suffix(" rad/s").text("Disc"));
        ui.label(format!("Circles take {:.2} s", 3.5 * std::f32::consts::TAU / rate.0.abs()));
        ui.weak("R: start anew");
    });
    Ok(())
}
