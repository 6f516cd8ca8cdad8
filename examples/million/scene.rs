//! The box, the marbles in it, and how it is tilted.

use bevy::color::palettes::tailwind;
use bevy::light::CascadeShadowConfigBuilder;
use bevy::math::bounding::Aabb3d;
use bevy::prelude::*;
use bevy_egui::input::EguiWantsInput;
use bevy_taw::prelude::*;
use taw_examples::orbit_camera_at;

use crate::Options;

/// Radii, and the layers on top of each other that are poured.
pub const RADII: std::ops::RangeInclusive<f32> = 0.3..=0.5;
const LAYERS: f32 = 12.0;
/// Largest angle by which gravity turns, in radians.
const STEEPEST: f32 = 0.35;

/// The pour.
#[derive(Resource)]
pub struct Pour {
    pub count: u32,
    pub tint: Tint,
    /// True if it is to be poured anew.
    pub again: bool,
}

/// Everything that goes when it is poured anew.
#[derive(Component)]
struct Poured;

/// Half the side of a box for so many marbles, in metres.
pub fn half_side(count: u32) -> f32 {
    let cells = (count as f32 / LAYERS).sqrt().ceil().max(2.0);
    cells * RADII.end() * 1.05 + 0.05
}

/// The marbles that are poured into it.
pub fn marbles(count: u32) -> Swarm {
    let half = half_side(count);
    let region = Aabb3d::new(Vec3::Y * half, Vec3::splat(half));
    // As light as in the table that this is compared with.
    Swarm::filling(region, count as usize, RADII, 1).with_mass(MarbleMass::Density(1.0))
}

pub fn plugin(app: &mut App) {
    let count = app.world().resource::<Options>().marbles;
    let tint = Tint::Speed(6.0);
    app.insert_resource(Pour { count, tint, again: true })
        .insert_resource(ClearColor(tailwind::SLATE_300.into()))
        .insert_resource(GlobalAmbientLight { brightness: 500.0, ..default() })
        .add_systems(FixedUpdate, pour_ahead.after(TawSystems::Gather).before(TawSystems::Step))
        .add_systems(Update, (pour.run_if(|pour: Res<Pour>| pour.again), tilt, recolor).chain());
}

fn pour(
    mut commands: Commands,
    mut pour: ResMut<Pour>,
    old: Query<Entity, With<Poured>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    pour.again = false;
    old.iter().for_each(|entity| commands.entity(entity).despawn());
    let half = half_side(pour.count);
    commands.spawn((Poured, marbles(pour.count).with_tint(pour.tint)));
    let faces = [Vec3::Y, Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z];
    for up in faces {
        let place = if up == Vec3::Y { Vec3::ZERO } else { up * -half };
        let turn = Quat::from_rotation_arc(Vec3::Y, up);
        commands.spawn((
            Poured,
            Wall::default(),
            Transform::from_translation(place).with_rotation(turn),
        ));
    }
    // Low boards that one can see over; what holds the marbles is higher.
    let (high, thick) = (4.0, 0.02 * half + 0.2);
    let wood = materials.add(StandardMaterial {
        base_color: tailwind::STONE_500.into(),
        perceptual_roughness: 0.8,
        ..default()
    });
    let mut board = |size: Vec3, place: Vec3| {
        let mesh = meshes.add(Cuboid::from_size(size));
        let parts = (Mesh3d(mesh), MeshMaterial3d(wood.clone()));
        commands.spawn((Poured, parts, Transform::from_translation(place)));
    };
    let all = 2.0 * (half + thick);
    board(Vec3::new(all, thick, all), Vec3::NEG_Y * thick * 0.5);
    for sign in [-1.0, 1.0] {
        let off = sign * (half + thick * 0.5);
        board(Vec3::new(thick, high, all), Vec3::new(off, high * 0.5, 0.0));
        board(Vec3::new(all, high, thick), Vec3::new(0.0, high * 0.5, off));
    }
    commands.spawn((
        Poured,
        DirectionalLight { shadow_maps_enabled: true, illuminance: 9_000.0, ..default() },
        CascadeShadowConfigBuilder { maximum_distance: 5.0 * half, ..default() }.build(),
        Transform::from_xyz(0.5, 1.0, 0.35).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((Poured, orbit_camera_at(Vec3::Y * 2.0, 2.2 * half + 4.0, 0.5)));
}

/// Has them lie in the box when the first frame is drawn.
fn pour_ahead(mut world: ResMut<TawWorld>, options: Res<Options>, mut done: Local<bool>) {
    if *done || world.swarm.is_empty() {
        return;
    }
    *done = true;
    for _ in 0..options.poured {
        if let Err(error) = world.step_swarm(1.0 / 60.0, &mut |_| ()) {
            error!("{error}");
        }
    }
}

/// Turns gravity while a key is held, and back when none is.
fn tilt(
    keys: Res<ButtonInput<KeyCode>>,
    egui: Res<EguiWantsInput>,
    time: Res<Time>,
    mut now: Local<Vec2>,
    mut gravity: ResMut<Gravity>,
    mut pour: ResMut<Pour>,
) {
    let held = |codes: [KeyCode; 2]| !egui.wants_any_keyboard_input() && keys.any_pressed(codes);
    let axis = |minus, plus| f32::from(i8::from(held(plus)) - i8::from(held(minus)));
    let wanted = Vec2::new(
        axis([KeyCode::ArrowLeft, KeyCode::KeyA], [KeyCode::ArrowRight, KeyCode::KeyD]),
        axis([KeyCode::ArrowUp, KeyCode::KeyW], [KeyCode::ArrowDown, KeyCode::KeyS]),
    ) * STEEPEST;
    *now = now.move_towards(wanted, time.delta_secs());
    let down = Quat::from_euler(EulerRot::XZY, -now.y, now.x, 0.0) * Vec3::NEG_Y * 9.81;
    if **gravity != down {
        **gravity = down;
    }
    pour.again |= keys.just_pressed(KeyCode::Space);
}

fn recolor(pour: Res<Pour>, mut swarms: Query<&mut Swarm>) {
    for mut swarm in &mut swarms {
        if swarm.tint != pour.tint {
            swarm.tint = pour.tint;
        }
    }
}
