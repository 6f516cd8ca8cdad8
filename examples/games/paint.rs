//! Looks of the games: colours, light, a camera, a line of text.

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

/// Line of text that a game shows.
#[derive(Resource, Default)]
pub struct Said(pub String);

/// Makes things visible.
#[derive(SystemParam)]
pub struct Paint<'w> {
    meshes: ResMut<'w, Assets<Mesh>>,
    materials: ResMut<'w, Assets<StandardMaterial>>,
}

impl Paint<'_> {
    /// A shape in a colour.
    pub fn shape(&mut self, shape: impl Into<Mesh>, colour: impl Into<Color>) -> impl Bundle {
        let material = StandardMaterial {
            base_color: colour.into(),
            perceptual_roughness: 0.4,
            double_sided: true,
            cull_mode: None,
            ..default()
        };
        (Mesh3d(self.meshes.add(shape)), MeshMaterial3d(self.materials.add(material)))
    }
}

/// A camera at a place that looks at another, and light.
pub fn look(commands: &mut Commands, from: Vec3, at: Vec3) -> Entity {
    commands.spawn((
        DirectionalLight { illuminance: 9000.0, shadow_maps_enabled: true, ..default() },
        Transform::from_translation(from + Vec3::new(4.0, 9.0, 3.0)).looking_at(at, Vec3::Y),
    ));
    commands.insert_resource(GlobalAmbientLight { brightness: 500.0, ..default() });
    commands
        .spawn((
            Camera3d::default(),
            Tonemapping::AcesFitted, // the default needs a look-up table
            Transform::from_translation(from).looking_at(at, Vec3::Y),
        ))
        .id()
}
