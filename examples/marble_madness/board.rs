//! The board: a floor and four rails that turn as one about its middle. How it
//! looks, what it is made of, and how it tilts.

use std::f32::consts::TAU;

use bevy::color::palettes::tailwind;
use bevy::image::{ImageAddressMode, ImageLoaderSettings, ImageSampler, ImageSamplerDescriptor};
use bevy::light::CascadeShadowConfigBuilder;
use bevy::math::Affine2;
use bevy::prelude::*;
use bevy_taw::interpolation::transform_interpolation::prelude::TransformInterpolation;
use bevy_taw::prelude::*;
use taw_examples::orbit_camera;

use crate::Options;
use crate::controls::TiltInput;
use crate::level::Level;

const RAIL_HEIGHT: f32 = 1.0;
const RAIL_WIDTH: f32 = 0.6;
const FLOOR_DEPTH: f32 = 0.5;
/// Largest acceleration of the rails, in m/s². Below gravity, or a board that
/// stops or sinks would let go of its marbles.
const EDGE_ACCELERATION: f32 = 6.0;
/// Rate at which the board settles: it covers this part of what is left to go, in 1/s.
const SETTLING_RATE: f32 = 8.0;

/// Marks the entity that turns. Floor and rails are its children.
#[derive(Component)]
pub struct Board;

/// True for a board of boxes, over whose rails marbles can fly, false for one of half-spaces.
#[derive(Resource, Clone, Copy, Default, PartialEq, Eq)]
pub struct MadeOfBoxes(pub bool);

/// Wall of a piece of the board, while it is one.
#[derive(Component, Clone)]
enum Piece {
    HalfSpace(Dir3),
    Box(Cuboid),
}

/// The size of the board: half of its inner width, in metres.
#[derive(Resource, Clone, Copy, Deref)]
pub struct HalfWidth(pub f32);

impl HalfWidth {
    /// A board on which this many marbles lie about five deep at most.
    pub fn for_marbles(count: u32) -> Self {
        Self(10.0 * (count as f32 / 1500.0).sqrt().max(1.0))
    }
}

/// Tilt of the board.
#[derive(Resource)]
pub struct Tilt {
    /// Toward where (x and z) and how far (its length), in radians.
    now: Vec2,
    /// Rate of change of `now`, in rad/s.
    speed: Vec2,
    /// The most that it tilts, in radians.
    pub limit: f32,
    /// Sways by itself, for as long.
    sway: Option<f32>,
}

impl Tilt {
    /// Moves toward `wanted` (a part of the limit, at most 1 in length) for `dt`
    /// seconds, as fast as it can still brake in time.
    fn follow(&mut self, wanted: Vec2, half_width: f32, dt: f32) {
        let acceleration = EDGE_ACCELERATION / half_width;
        let way = wanted.clamp_length_max(1.0) * self.limit - self.now;
        let braking = (2.0 * acceleration * way.length()).sqrt();
        let speed = (way * SETTLING_RATE).clamp_length_max(0.8 * braking);
        self.speed += (speed - self.speed).clamp_length_max(acceleration * dt);
        self.now = (self.now + self.speed * dt).clamp_length_max(self.limit);
    }

    /// The rotation that lowers the side toward which it tilts.
    fn rotation(&self) -> Quat {
        Quat::from_scaled_axis(Vec3::new(self.now.y, 0.0, -self.now.x))
    }

    /// Level again.
    pub fn level(&mut self) {
        (self.now, self.speed) = (Vec2::ZERO, Vec2::ZERO);
    }
}

pub fn plugin(app: &mut App) {
    let options = app.world().resource::<Options>();
    let (marbles, boxes) = (options.marbles, options.boxes);
    let sway = options.sway.then_some(0.0);
    let half_width = crate::level::board_width(app.world().resource::<Level>(), marbles);
    let model = model_for(marbles);
    app.insert_resource(TawModel(model))
        .insert_resource(half_width)
        .insert_resource(MadeOfBoxes(boxes))
        .insert_resource(Tilt {
            now: Vec2::ZERO,
            speed: Vec2::ZERO,
            limit: 12_f32.to_radians(),
            sway,
        })
        .insert_resource(ClearColor(tailwind::SKY_950.into()))
        .insert_resource(GlobalAmbientLight {
            color: tailwind::SKY_100.into(),
            brightness: 260.0,
            ..default()
        })
        .add_systems(Startup, (spawn_board, spawn_surroundings))
        .add_systems(
            FixedUpdate,
            (tilt, build.run_if(resource_changed::<MadeOfBoxes>)).before(TawSystems::Gather),
        );
}

/// All that there is for a handful of marbles; for a crowd, what keeps up with it.
fn model_for(marbles: u32) -> Model {
    let integrator = Integrator::VelocityVerlet;
    if marbles <= 1500 {
        let (response, rotation) = (Response::Impulse, Rotation::Dynamic);
        Model { integrator, response, rotation, substeps: 2, ..default() }
    } else {
        Model { integrator, rotation: Rotation::Rolling, ..default() }
    }
}

fn tilt(
    mut tilt: ResMut<Tilt>,
    input: Res<TiltInput>,
    time: Res<Time>,
    half_width: Res<HalfWidth>,
    mut board: Single<&mut Transform, With<Board>>,
) {
    let mut wanted = **input;
    if wanted != Vec2::ZERO {
        tilt.sway = None;
    } else if let Some(seconds) = &mut tilt.sway {
        *seconds += time.delta_secs();
        wanted = Vec2::from_angle(*seconds * TAU / 7.0) * 0.9;
    }
    tilt.follow(wanted, **half_width, time.delta_secs());
    board.rotation = tilt.rotation();
}

/// Makes walls of the half-spaces or of the boxes.
fn build(mut commands: Commands, boxes: Res<MadeOfBoxes>, pieces: Query<(Entity, &Piece)>) {
    for (entity, piece) in &pieces {
        let wall = match piece {
            Piece::HalfSpace(normal) => (!boxes.0).then_some(Wall::HalfSpace(*normal)),
            Piece::Box(cuboid) => boxes.0.then_some(Wall::from(*cuboid)),
        };
        match wall {
            Some(wall) => commands.entity(entity).insert(wall),
            None => commands.entity(entity).remove::<Wall>(),
        };
    }
}

pub fn spawn_board(
    mut commands: Commands,
    half_width: Res<HalfWidth>,
    assets: Res<AssetServer>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let half = **half_width;
    let wood: Handle<Image> = assets
        .load_builder()
        .with_settings(|settings: &mut ImageLoaderSettings| {
            settings.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
                address_mode_u: ImageAddressMode::Repeat,
                address_mode_v: ImageAddressMode::Repeat,
                ..ImageSamplerDescriptor::linear()
            });
        })
        .load("textures/wood.png");
    let mut planks = |tint: Srgba, repeat: Vec2| {
        materials.add(StandardMaterial {
            base_color: tint.into(),
            base_color_texture: Some(wood.clone()),
            uv_transform: Affine2::from_scale(repeat),
            perceptual_roughness: 0.65,
            reflectance: 0.3,
            ..default()
        })
    };
    let floor_look = planks(tailwind::AMBER_50, Vec2::splat(half / 5.0));
    let rail_look = planks(tailwind::AMBER_700, Vec2::new(half / 2.5, 0.25));

    let board = commands
        .spawn((Board, Transform::default(), Visibility::default(), TransformInterpolation))
        .id();
    let outer = 2.0 * (half + RAIL_WIDTH);
    let floor = Cuboid::new(outer, FLOOR_DEPTH, outer);
    commands.spawn((
        ChildOf(board),
        (Piece::HalfSpace(Dir3::Y), Name::new("floor")),
        Transform::default(),
        Visibility::default(),
        children![(
            (Piece::Box(floor), Name::new("floor")),
            Mesh3d(meshes.add(floor)),
            MeshMaterial3d(floor_look),
            Transform::from_xyz(0.0, -FLOOR_DEPTH / 2.0, 0.0),
        )],
    ));
    let cuboid = Cuboid::new(outer, RAIL_HEIGHT, RAIL_WIDTH);
    let rail = meshes.add(cuboid);
    for quarter in 0..4_u8 {
        // A wall's surface is at its origin; the rail's box lies behind that.
        let turn = Quat::from_rotation_y(f32::from(quarter) * TAU / 4.0);
        commands.spawn((
            ChildOf(board),
            (Piece::HalfSpace(Dir3::Z), Name::new("rail")),
            Transform::from_translation(turn * Vec3::NEG_Z * half).with_rotation(turn),
            Visibility::default(),
            children![(
                (Piece::Box(cuboid), Name::new("rail")),
                Mesh3d(rail.clone()),
                MeshMaterial3d(rail_look.clone()),
                Transform::from_xyz(0.0, RAIL_HEIGHT / 2.0, -RAIL_WIDTH / 2.0),
            )],
        ));
    }
}

/// Camera, light, and a table far below.
fn spawn_surroundings(
    mut commands: Commands,
    half_width: Res<HalfWidth>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let half = **half_width;
    commands.spawn(orbit_camera(Vec3::new(-0.16 * half, 0.0, 0.04 * half), 2.9 * half));
    commands.spawn((
        DirectionalLight {
            color: tailwind::AMBER_50.into(),
            illuminance: 9000.0,
            shadow_maps_enabled: true,
            ..default()
        },
        CascadeShadowConfigBuilder {
            num_cascades: 2,
            maximum_distance: 8.0 * half,
            first_cascade_far_bound: 3.0 * half,
            ..default()
        }
        .build(),
        Transform::from_xyz(-0.7, 1.6, 0.6).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((
        Mesh3d(meshes.add(Circle::new(6.0 * half))),
        MeshMaterial3d(materials.add(StandardMaterial {
            base_color: tailwind::SKY_900.into(),
            perceptual_roughness: 0.95,
            ..default()
        })),
        Transform::from_xyz(0.0, -0.35 * half, 0.0)
            .with_rotation(Quat::from_rotation_x(-TAU / 4.0)),
    ));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level() -> Tilt {
        Tilt { now: Vec2::ZERO, speed: Vec2::ZERO, limit: 0.2, sway: None }
    }

    #[test]
    fn the_board_goes_smoothly_where_the_player_wants_and_no_further() {
        for (half_width, dt) in [(10.0, 1.0 / 64.0), (3.0, 1.0 / 30.0), (50.0, 1.0 / 240.0)] {
            let mut tilt = level();
            let mut stay = |wanted: Vec2, seconds: f32| {
                for _ in 0..(seconds / dt) as u32 {
                    let speed = tilt.speed;
                    tilt.follow(wanted, half_width, dt);
                    let change = (tilt.speed - speed).length() / dt * half_width;
                    assert!(change < EDGE_ACCELERATION * 1.001, "{change} m/s² at the rails");
                    assert!(tilt.now.length() <= tilt.limit * 1.000_001);
                }
                tilt.now
            };
            // There, to the other side, and back before that is reached.
            let there = Vec2::new(0.6, 0.8) * 0.2;
            assert!(stay(Vec2::new(3.0, 4.0), 8.0).distance(there) < 1e-4, "{half_width}");
            stay(Vec2::new(-3.0, -4.0), 0.5);
            assert!(stay(Vec2::ZERO, 8.0).length() < 1e-4, "{half_width}");
        }
    }

    #[test]
    fn the_side_toward_which_it_tilts_goes_down() {
        for angle in [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0] {
            let toward = Vec2::from_angle(angle);
            let tilt = Tilt { now: toward * 0.2, ..level() };
            let edge = tilt.rotation() * Vec3::new(toward.x, 0.0, toward.y);
            assert!((edge.y + tilt.limit.sin()).abs() < 1e-5, "toward {toward}: {edge}");
            let beside = tilt.rotation() * Vec3::new(-toward.y, 0.0, toward.x);
            assert!(beside.y.abs() < 1e-6, "and nothing else does");
        }
    }
}
