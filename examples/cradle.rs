//! **Newton's cradle**, event-driven: one ball swings in, one swings out, and the
//! three between them do not stir.
//!
//! `cargo run --example cradle` (`-- --help` for options)
//!
//! Worth a look: the five balls touch, with no gap at all. Collisions are gone
//! through one by one, so the middle ones pass on what they get; the energy below
//! stays what it is. The threads are forces: each holds its ball on a circle about its
//! hook. Space lets two balls swing in, R one.

use bevy::color::palettes::tailwind;
use bevy::diagnostic::DiagnosticsStore;
use bevy::prelude::*;
use bevy_egui::{EguiContexts, EguiPlugin, EguiPrimaryContextPass, egui};
use bevy_taw::debug_ui;
use bevy_taw::prelude::*;
use clap::Parser;
use taw_examples::{ExamplePlugins, OrbitCameraPlugin, Picture, orbit_camera_at};

const BALLS: u8 = 5;
const RADIUS: f32 = 0.5;
const LENGTH: f32 = 5.0;

#[derive(Parser)]
struct Options {
    #[command(flatten)]
    picture: Picture,
}

/// The number of the hook that a ball's thread is fastened to.
#[derive(Component)]
struct Hook(u8);

fn main() -> AppExit {
    let picture = Options::parse().picture;
    App::new()
        .add_plugins(ExamplePlugins { title: "Newton's cradle", picture })
        .add_plugins((EguiPlugin::default(), OrbitCameraPlugin, TawPlugins))
        .insert_resource(TawModel(Model {
            integrator: Integrator::Rk4,
            response: Response::EventDriven,
            precision: Precision::Compensated,
            ..default()
        }))
        .insert_resource(ClearColor(tailwind::SLATE_900.into()))
        .add_systems(Startup, spawn)
        .add_systems(Update, (lift, draw_threads))
        .add_systems(FixedUpdate, pull.before(TawSystems::Gather))
        .add_systems(EguiPrimaryContextPass, panel)
        .run()
}

fn hook(i: u8) -> Vec3 {
    // Balls at rest are at the height of zero, and so is their energy.
    Vec3::new((f32::from(i) - f32::from(BALLS - 1) / 2.0) * 2.0 * RADIUS, LENGTH, 0.0)
}

/// Place of a ball when its thread is turned by this angle.
fn hanging(i: u8, angle: f32) -> Vec3 {
    hook(i) + Quat::from_rotation_z(angle) * Vec3::NEG_Y * LENGTH
}

fn spawn(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let steel = materials.add(StandardMaterial {
        base_color: tailwind::SLATE_300.into(),
        metallic: 0.6,
        perceptual_roughness: 0.25,
        ..default()
    });
    let mesh = meshes.add(Sphere::new(RADIUS).mesh().uv(40, 24));
    for i in 0..BALLS {
        let angle = if i == 0 { -0.7 } else { 0.0 };
        commands.spawn((
            Marble::new(RADIUS),
            Velocity::default(),
            ExternalForce::default(),
            MarbleMass::Kilograms(1.0),
            SurfaceMaterial { restitution: 1.0, friction: 0.0, ..default() },
            Hook(i),
            Transform::from_translation(hanging(i, angle)),
            Mesh3d(mesh.clone()),
            MeshMaterial3d(steel.clone()),
        ));
    }
    commands.spawn((
        Mesh3d(meshes.add(Cuboid::new(7.0, 0.3, 0.3))),
        MeshMaterial3d(materials.add(Color::from(tailwind::AMBER_800))),
        Transform::from_xyz(0.0, LENGTH + 0.15, 0.0),
    ));
    commands.spawn((
        DirectionalLight { illuminance: 8000.0, ..default() },
        Transform::from_xyz(2.0, 3.0, 5.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.insert_resource(GlobalAmbientLight { brightness: 400.0, ..default() });
    commands.spawn(orbit_camera_at(Vec3::Y * 2.2, 12.0, 0.15));
}

/// A thread pulls with just the force that has its ball on the circle about its hook
/// again at the end of the step.
fn pull(
    mut balls: Query<(&Transform, &Velocity, &Hook, &mut ExternalForce)>,
    gravity: Res<Gravity>,
    time: Res<Time>,
) {
    let dt = time.delta_secs();
    for (at, velocity, Hook(i), mut force) in &mut balls {
        // As the ball hangs in the middle of the step: along there, a pull does no work.
        let toward = (hook(*i) - at.translation - **velocity * (0.5 * dt)).normalize();
        // From the hook to where the ball would be without a thread.
        let free = at.translation - hook(*i) + (**velocity + **gravity * (0.5 * dt)) * dt;
        // The thread's way s along `toward`: |free + s toward| = LENGTH.
        let along = free.dot(toward);
        let root = (along * along - free.length_squared() + LENGTH * LENGTH).max(0.0).sqrt();
        force.force = toward * (2.0 * (-along - root) / (dt * dt));
    }
}

fn lift(keys: Res<ButtonInput<KeyCode>>, mut balls: Query<(&mut Transform, &mut Velocity, &Hook)>) {
    let lifted = match () {
        () if keys.just_pressed(KeyCode::Space) => 2,
        () if keys.just_pressed(KeyCode::KeyR) => 1,
        () => return,
    };
    for (mut at, mut velocity, Hook(i)) in &mut balls {
        at.translation = hanging(*i, if *i < lifted { -0.7 } else { 0.0 });
        **velocity = Vec3::ZERO;
    }
}

fn draw_threads(mut gizmos: Gizmos, balls: Query<(&Transform, &Hook)>) {
    for (at, Hook(i)) in &balls {
        gizmos.line(hook(*i), at.translation, tailwind::SLATE_200);
    }
}

fn panel(mut contexts: EguiContexts, mut diagnostics: ResMut<DiagnosticsStore>) -> Result {
    egui::Window::new("Energy").default_pos([10.0, 10.0]).show(contexts.ctx_mut()?, |ui| {
        debug_ui::energy(ui, &mut diagnostics);
        ui.weak("Space: two balls   R: one");
    });
    Ok(())
}
