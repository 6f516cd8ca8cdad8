//! **Billiards**, event-driven: a rack, a cue ball, and a cue.
//!
//! `cargo run --example billiards` (`-- --help` for options)
//!
//! Aim with the left and right arrow keys, choose the power with up and down, where the
//! cue hits the ball with W A S D (low for backspin), shoot with Space. R racks up anew.
//! Worth a look: the first break, straight on, comes out as its own mirror image, to
//! the bit. Balls slide before they roll, and backspin brings the cue ball back.

use bevy::color::palettes::tailwind;
use bevy::prelude::*;
use bevy_egui::{EguiContexts, EguiPlugin, EguiPrimaryContextPass, egui};
use bevy_taw::prelude::*;
use clap::Parser;
use taw_examples::{ExamplePlugins, OrbitCameraPlugin, Picture, orbit_camera};

/// A pool ball and a nine-foot table, in metres.
const RADIUS: f32 = 0.028_575;
const HALF: Vec2 = Vec2::new(1.27, 0.635);
const COLOURS: [Srgba; 5] = [
    tailwind::RED_500,
    tailwind::AMBER_400,
    tailwind::BLUE_500,
    tailwind::GREEN_500,
    tailwind::PURPLE_500,
];

#[derive(Parser)]
struct Options {
    /// Breaks at once, as for a picture
    #[arg(long)]
    shoot: bool,
    #[command(flatten)]
    picture: Picture,
}

/// Aim of the cue: direction in radians from +x, speed of the ball in m/s, and
/// where on it, as parts of its radius to the right and up.
#[derive(Resource)]
struct Cue {
    angle: f32,
    speed: f32,
    at: Vec2,
    shoot: bool,
}

#[derive(Component)]
struct CueBall;

fn main() -> AppExit {
    let options = Options::parse();
    App::new()
        .add_plugins(ExamplePlugins { title: "Billiards", picture: options.picture })
        .add_plugins((EguiPlugin::default(), OrbitCameraPlugin, TawPlugins))
        .insert_resource(TawModel(Model {
            response: Response::EventDriven,
            rotation: Rotation::Dynamic,
            precision: Precision::Compensated,
            ..default()
        }))
        .insert_resource(Cue { angle: 0.0, speed: 8.0, at: Vec2::ZERO, shoot: options.shoot })
        .insert_resource(ClearColor(tailwind::STONE_900.into()))
        .add_systems(Startup, (spawn_table, rack).chain())
        .add_systems(
            Update,
            (
                aim,
                rack.run_if(|keys: Res<ButtonInput<KeyCode>>| keys.just_pressed(KeyCode::KeyR)),
                draw,
            ),
        )
        .add_systems(FixedUpdate, shoot.before(TawSystems::Gather))
        .add_systems(EguiPrimaryContextPass, panel)
        .run()
}

fn spawn_table(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let cloth = SurfaceMaterial {
        friction: 0.2,
        rolling_resistance: 0.01,
        spinning_resistance: 0.01,
        restitution: 0.5,
        ..default()
    };
    commands.spawn((
        Wall::default(),
        cloth,
        Transform::default(),
        Visibility::default(),
        children![(
            Mesh3d(meshes.add(Plane3d::default().mesh().size(2.0 * HALF.x, 2.0 * HALF.y))),
            MeshMaterial3d(materials.add(StandardMaterial {
                base_color: tailwind::EMERALD_700.into(),
                perceptual_roughness: 1.0,
                ..default()
            })),
        )],
    ));
    let cushion = SurfaceMaterial { restitution: 0.85, ..cloth };
    let wood = materials.add(Color::from(tailwind::AMBER_900));
    for (normal, size) in [
        (Vec3::X, Vec3::new(0.08, 0.06, 2.0 * HALF.y + 0.16)),
        (Vec3::NEG_X, Vec3::new(0.08, 0.06, 2.0 * HALF.y + 0.16)),
        (Vec3::Z, Vec3::new(2.0 * HALF.x, 0.06, 0.08)),
        (Vec3::NEG_Z, Vec3::new(2.0 * HALF.x, 0.06, 0.08)),
    ] {
        let at = -normal * Vec3::new(HALF.x, 0.0, HALF.y);
        commands.spawn((
            Wall::HalfSpace(Dir3::new(normal).expect("an axis")),
            cushion,
            Transform::from_translation(at),
            Visibility::default(),
            children![(
                Mesh3d(meshes.add(Cuboid::from_size(size))),
                MeshMaterial3d(wood.clone()),
                Transform::from_translation(-normal * 0.04 + Vec3::Y * 0.02)
            )],
        ));
    }
    commands.spawn((
        DirectionalLight { illuminance: 7000.0, shadow_maps_enabled: true, ..default() },
        Transform::from_xyz(0.5, 2.0, 0.7).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.insert_resource(GlobalAmbientLight { brightness: 350.0, ..default() });
    commands.spawn(orbit_camera(Vec3::ZERO, 2.6));
}

/// Fifteen balls that all but touch, in a triangle, and the cue ball.
fn rack(
    mut commands: Commands,
    old: Query<Entity, With<Marble>>,
    assets: Res<AssetServer>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    old.iter().for_each(|ball| commands.entity(ball).despawn());
    let mesh = meshes.add(Sphere::new(RADIUS).mesh().uv(32, 18));
    let mut ball = |at: Vec2, colour: Srgba| {
        (
            Marble::new(RADIUS),
            MarbleMass::Kilograms(0.17),
            SurfaceMaterial {
                restitution: 0.95,
                friction: 0.06,
                combine: Combine::Average,
                ..default()
            },
            Velocity::default(),
            AngularVelocity::default(),
            Transform::from_xyz(at.x, RADIUS, at.y),
            Mesh3d(mesh.clone()),
            MeshMaterial3d(materials.add(StandardMaterial {
                base_color: colour.into(),
                base_color_texture: Some(assets.load("textures/marble.png")),
                perceptual_roughness: 0.15,
                ..default()
            })),
        )
    };
    for i in 0..15_u8 {
        let row = (1..6).find(|row| i < row * (row + 1) / 2).unwrap_or(5) - 1;
        let place = f32::from(i - row * (row + 1) / 2);
        let pitch = 2.0001 * RADIUS;
        let at = Vec2::new(
            0.6 + f32::from(row) * pitch * 0.75_f32.sqrt(),
            (place - f32::from(row) / 2.0) * pitch,
        );
        commands.spawn(ball(at, COLOURS[usize::from(i) % COLOURS.len()]));
    }
    commands.spawn((CueBall, ExternalImpulse::default(), ball(Vec2::new(-0.6, 0.0), Srgba::WHITE)));
}

fn aim(keys: Res<ButtonInput<KeyCode>>, mut cue: ResMut<Cue>, time: Res<Time>) {
    let both = |minus, plus| {
        f32::from(u8::from(keys.pressed(plus))) - f32::from(u8::from(keys.pressed(minus)))
    };
    let dt = time.delta_secs();
    cue.angle += both(KeyCode::ArrowLeft, KeyCode::ArrowRight) * 0.6 * dt;
    cue.speed =
        (cue.speed + both(KeyCode::ArrowDown, KeyCode::ArrowUp) * 4.0 * dt).clamp(0.2, 12.0);
    let at = cue.at
        + Vec2::new(both(KeyCode::KeyA, KeyCode::KeyD), both(KeyCode::KeyS, KeyCode::KeyW)) * dt;
    cue.at = at.clamp_length_max(0.5); // further out the tip would slip
    cue.shoot |= keys.just_pressed(KeyCode::Space);
}

fn shoot(mut cue: ResMut<Cue>, mut ball: Single<&mut ExternalImpulse, With<CueBall>>) {
    if std::mem::take(&mut cue.shoot) {
        let along = Quat::from_rotation_y(-cue.angle) * Vec3::X;
        let lever = along.cross(Vec3::Y) * cue.at.x + Vec3::Y * cue.at.y - along;
        **ball = ExternalImpulse::at(along * (0.17 * cue.speed), lever * RADIUS);
    }
}

fn draw(mut gizmos: Gizmos, cue: Res<Cue>, ball: Single<&Transform, With<CueBall>>) {
    let along = Quat::from_rotation_y(-cue.angle) * Vec3::X;
    gizmos.line(
        ball.translation + along * RADIUS,
        ball.translation + along * (0.1 + 0.05 * cue.speed),
        tailwind::AMBER_200,
    );
}

fn panel(mut contexts: EguiContexts, mut cue: ResMut<Cue>) -> Result {
    egui::Window::new("Cue").default_pos([10.0, 10.0]).show(contexts.ctx_mut()?, |ui| {
        ui.add(egui::Slider::new(&mut cue.speed, 0.2..=12.0).suffix(" m/s").text("Power"));
        ui.add(egui::Slider::new(&mut cue.at.y, -0.5..=0.5).text("Low or high"));
        ui.add(egui::Slider::new(&mut cue.at.x, -0.5..=0.5).text("Left or right"));
        cue.shoot |= ui.button("Shoot").clicked();
        ui.weak("Arrows aim, Space shoots, R racks up");
    });
    Ok(())
}
