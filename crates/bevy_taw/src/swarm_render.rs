//! Swarms on the screen: one draw call, 16 bytes for each marble and frame.

use bevy::asset::{RenderAssetUsages, embedded_asset};
use bevy::camera::visibility::NoFrustumCulling;
use bevy::mesh::{Indices, MeshTag, PrimitiveTopology};
use bevy::pbr::{Material, MaterialPlugin};
use bevy::prelude::*;
use bevy::render::render_resource::AsBindGroup;
use bevy::render::storage::ShaderBuffer;
use bevy::shader::ShaderRef;
use bevy::tasks::ComputeTaskPool;

use crate::resources::TawWorld;
use crate::schedule::TawSchedule;
use crate::swarm::{Swarm, Tint, heat};

/// Draws all [swarms](Swarm): lit, shadowed and casting shadows as meshes are.
///
/// Does nothing in an app that does not render.
#[derive(Debug, Default)]
pub struct TawSwarmRenderPlugin;

/// Marbles in a block, which is a mesh that is drawn as often as there are blocks. The shader
/// knows it, too.
const BLOCK: usize = 4096;
/// Bytes for each marble.
const BYTES: usize = 16;

impl Plugin for TawSwarmRenderPlugin {
    fn build(&self, app: &mut App) {
        // Without a renderer there are no materials.
        if !app.is_plugin_added::<bevy::pbr::PbrPlugin>() {
            return;
        }
        let between_steps = TawSchedule::of(app).is_fixed(app.world());
        embedded_asset!(app, "swarm.wgsl");
        app.add_plugins(MaterialPlugin::<SwarmMaterial>::default())
            .insert_resource(Drawn { between_steps, ..default() })
            .add_systems(PostUpdate, draw);
    }
}

/// All marbles of all swarms.
#[derive(Asset, TypePath, AsBindGroup, Clone, Debug)]
struct SwarmMaterial {
    #[storage(0, read_only)]
    marbles: Handle<ShaderBuffer>,
}

const SHADER: &str = "embedded://bevy_taw/swarm.wgsl";

impl Material for SwarmMaterial {
    fn vertex_shader() -> ShaderRef {
        SHADER.into()
    }

    fn fragment_shader() -> ShaderRef {
        SHADER.into()
    }

    fn prepass_vertex_shader() -> ShaderRef {
        SHADER.into()
    }

    fn prepass_fragment_shader() -> ShaderRef {
        SHADER.into()
    }

    fn enable_prepass() -> bool {
        false // it would draw discs; shadows are something else
    }

    fn alpha_mode(&self) -> AlphaMode {
        AlphaMode::Mask(0.5) // the corners of the quads are left out
    }
}

/// GPU resources to draw them with.
#[derive(Resource, Default)]
struct Drawn {
    mesh: Handle<Mesh>,
    buffer: Handle<ShaderBuffer>,
    material: Handle<SwarmMaterial>,
    blocks: Vec<Entity>,
    /// True where steps run at a rate of their own.
    between_steps: bool,
}

/// A block of quads: two coordinates of a corner, and the number of the quad.
fn block() -> Mesh {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let quads = 0..BLOCK as u32;
    let points = quads.clone().flat_map(|quad| corners.map(|[x, y]| [x, y, quad as f32]));
    let indices = quads.flat_map(|quad| [0, 1, 2, 0, 2, 3].map(|corner| 4 * quad + corner));
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, points.collect::<Vec<[f32; 3]>>())
        .with_inserted_indices(Indices::U32(indices.collect()))
}

/// Hands the marbles over, as far as they are between the last two steps.
#[expect(clippy::too_many_arguments, reason = "a Bevy system")]
fn draw(
    mut commands: Commands,
    mut drawn: ResMut<Drawn>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut buffers: ResMut<Assets<ShaderBuffer>>,
    mut materials: ResMut<Assets<SwarmMaterial>>,
    (world, fixed): (Res<TawWorld>, Res<Time<Fixed>>),
    swarms: Query<(Entity, Ref<Swarm>)>,
    mut was: Local<(usize, bool)>,
) {
    let swarm = &world.swarm;
    if swarm.is_empty() && drawn.blocks.is_empty() {
        return;
    }
    let still =
        swarm.asleep() == swarm.len() && !swarms.iter().any(|(_, swarm)| swarm.is_changed());
    let now = (swarm.len(), still);
    if *was == now && still {
        return; // as in the last frame
    }
    *was = now;
    let blocks = swarm.len().div_ceil(BLOCK).max(drawn.blocks.len()).max(1);
    let tints: Vec<_> = swarms.iter().map(|(entity, swarm)| (entity, swarm.tint)).collect();
    let tint_of = |slot: u32| {
        let owner = world.entity_of_slot(slot);
        let tint = tints.iter().find(|(entity, _)| Some(*entity) == owner);
        tint.map_or(Tint::Id, |(_, tint)| *tint)
    };
    // A step behind, on the way to where they are.
    let ago = if drawn.between_steps {
        fixed.timestep().as_secs_f32() * (1.0 - fixed.overstep_fraction())
    } else {
        0.0
    };
    let data = quads(swarm, blocks, ago, &tint_of);
    // A buffer of the same size is written, not created again.
    let buffer = drawn.buffer.clone();
    if drawn.blocks.len() == blocks
        && let Some(mut buffer) = buffers.get_mut(&buffer)
    {
        buffer.data = Some(data);
        return;
    }
    if drawn.blocks.is_empty() {
        drawn.mesh = meshes.add(block());
    }
    drawn.buffer = buffers.add(ShaderBuffer::new(&data, RenderAssetUsages::default()));
    drawn.material = materials.add(SwarmMaterial { marbles: drawn.buffer.clone() });
    for entity in drawn.blocks.drain(..) {
        commands.entity(entity).despawn();
    }
    let Drawn { mesh, material, blocks: entities, .. } = &mut *drawn;
    let block = |number: usize| {
        let parts = (Mesh3d(mesh.clone()), MeshMaterial3d(material.clone()));
        (Name::new("swarm"), parts, MeshTag(number as u32), NoFrustumCulling, Transform::default())
    };
    entities.extend((0..blocks).map(|number| commands.spawn(block(number)).id()));
}

/// Position, radius and color of each ball `ago` seconds before now, for the shader.
fn quads(
    swarm: &taw::swarm::Swarm,
    blocks: usize,
    ago: f32,
    tint_of: &(impl Fn(u32) -> Tint + Sync),
) -> Vec<u8> {
    let mut data = vec![0_u8; blocks * BLOCK * BYTES];
    let rows = swarm.balls().chunks(BLOCK).zip(swarm.velocities().chunks(BLOCK));
    let rows = rows.zip(swarm.slots().chunks(BLOCK)).enumerate();
    ComputeTaskPool::get_or_init(Default::default).scope(|scope| {
        for ((number, ((balls, velocities), slots)), data) in
            rows.zip(data.chunks_mut(BLOCK * BYTES))
        {
            scope.spawn(async move {
                let rows = balls.iter().zip(velocities).zip(slots).enumerate();
                for ((row, ((ball, velocity), slot)), bytes) in
                    rows.zip(data.chunks_exact_mut(BYTES))
                {
                    if swarm.is_marble(number * BLOCK + row) {
                        continue; // an entity, which is drawn by itself
                    }
                    let at = place(ball) - place(velocity) * ago;
                    let speed = || place(velocity).length();
                    let color = pack(color(tint_of(*slot), *slot, ball[3], speed));
                    let last = u32::from(half(ball[3])) | u32::from(color) << 16;
                    let words = [at.x.to_bits(), at.y.to_bits(), at.z.to_bits(), last];
                    for (word, bytes) in words.iter().zip(bytes.chunks_exact_mut(4)) {
                        bytes.copy_from_slice(&word.to_ne_bytes());
                    }
                }
            });
        }
    });
    data
}

fn place([x, y, z, _]: &[f32; 4]) -> Vec3 {
    Vec3::new(*x, *y, *z)
}

fn color(tint: Tint, slot: u32, radius: f32, speed: impl Fn() -> f32) -> [f32; 3] {
    match tint {
        Tint::Id => {
            // Colours of glass, by the golden ratio.
            let hue = slot as f32 * 0.618_034 % 1.0;
            let light = 0.45 + 0.15 * (slot as f32 * 0.754_878 % 1.0);
            Color::hsl(hue * 360.0, 0.65, light).to_linear().to_f32_array_no_alpha()
        }
        Tint::Speed(most) => heat(speed() / most),
        Tint::Size(least, most) => heat((radius - least) / (most - least)),
        Tint::Plain(color) => color,
    }
}

/// Five bits red, six green, five blue.
fn pack([red, green, blue]: [f32; 3]) -> u16 {
    let part = |x: f32, most: f32| (x.clamp(0.0, 1.0) * most + 0.5) as u16;
    part(red, 31.0) << 11 | part(green, 63.0) << 5 | part(blue, 31.0)
}

/// The nearest half float of a number above zero.
fn half(x: f32) -> u16 {
    let bits = x.to_bits();
    let exponent = (bits >> 23 & 0xff).cast_signed() - 127;
    match exponent {
        ..-24 => 0,
        // So small that the leading bit is written out.
        -24..-14 => (((bits & 0x7f_ffff) | 0x80_0000) >> (-exponent - 1)) as u16,
        -14..16 => {
            ((((exponent + 15) as u32) << 10 | (bits >> 13 & 0x3ff)) + (bits >> 12 & 1)) as u16
        }
        _ => 0x7bff,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn back(half: u16) -> f32 {
        let (exponent, fraction) = (i32::from(half >> 10), f32::from(half & 0x3ff) / 1024.0);
        if exponent == 0 {
            fraction * 2.0_f32.powi(-14)
        } else {
            (1.0 + fraction) * 2.0_f32.powi(exponent - 15)
        }
    }

    #[test]
    fn radii_survive_sixteen_bits() {
        for i in 1..200_000_u32 {
            let x = i as f32 * 3.7e-4;
            let error = (back(half(x)) - x).abs();
            assert!(error <= x / 2048.0, "{x} becomes {}", back(half(x)));
        }
        for x in [6e-8, 1e-6, 3e-5_f32] {
            assert!((back(half(x)) - x).abs() <= 6e-8);
        }
        assert_eq!((half(1e-9), back(half(1e9))), (0, 65504.0));
    }

    #[test]
    fn colors_survive_sixteen_bits() {
        assert_eq!((pack([0.0; 3]), pack([1.0; 3])), (0, u16::MAX));
        assert_eq!(pack([1.0, 0.0, 0.0]), 31 << 11);
        assert_eq!(pack([-1.0, f32::NAN, 2.0]), 31);
    }
}
