//! The physics, drawn: contacts, normals, velocities, walls, sensors, sleepers and the grid.
//!
//! All of it is in one [`GizmoConfigGroup`], [`TawGizmos`], and off until switched
//! on there.

use bevy::color::palettes::tailwind;
use bevy::math::Isometry3d;
use bevy::prelude::*;
use taw::contact::Contact;

use crate::convert::{from_point, from_vector};
use crate::outline;
use crate::resources::TawWorld;

/// Settings of the gizmos: what is drawn, and its size. Change it through Bevy's [`GizmoConfigStore`].
#[expect(clippy::struct_excessive_bools, reason = "independent switches")]
#[derive(Clone, Debug, Reflect, GizmoConfigGroup)]
#[reflect(Default)]
pub struct TawGizmos {
    /// A small cross at each contact.
    pub contacts: bool,
    /// The unit normal of each contact times [`TawGizmos::normal_length`].
    pub normals: bool,
    /// Velocities times [`TawGizmos::velocity_scale`].
    pub velocities: bool,
    /// The outlines of walls as the physics has them, seen or unseen. Of a half-space, a part of its surface.
    pub walls: bool,
    /// A sphere around each marble that sleeps.
    pub sleepers: bool,
    /// The outlines of sensors, in another color while a marble or ball is inside. Of a half-space, a part of its
    /// surface.
    pub sensors: bool,
    /// The occupied cells of the grid's coarsest level.
    pub grid: bool,
    /// In metres.
    pub normal_length: f32,
    /// In metres per m/s.
    pub velocity_scale: f32,
}

impl Default for TawGizmos {
    fn default() -> Self {
        Self {
            contacts: false,
            normals: false,
            velocities: false,
            walls: false,
            sleepers: false,
            sensors: false,
            grid: false,
            normal_length: 0.5,
            velocity_scale: 0.1,
        }
    }
}

/// Draws [`TawGizmos`] after each frame's transforms are final. Does nothing in an
/// app without Bevy's `GizmoPlugin`.
#[derive(Debug, Default)]
pub struct TawGizmosPlugin;

impl Plugin for TawGizmosPlugin {
    fn build(&self, _: &mut App) {}

    fn finish(&self, app: &mut App) {
        if app.is_plugin_added::<bevy::gizmos::GizmoPlugin>() {
            // Contacts are inside of what touches, so nothing may hide them.
            let in_front = GizmoConfig { depth_bias: -1.0, ..default() };
            app.insert_gizmo_config(TawGizmos::default(), in_front).add_systems(PostUpdate, draw);
        }
    }
}

fn draw(world: Res<TawWorld>, places: Query<&GlobalTransform>, mut gizmos: Gizmos<TawGizmos>) {
    let config = gizmos.config_ext.clone();
    if config.contacts || config.normals {
        let mut contact = |contact: &Contact<f32>| {
            let Some((point, normal)) = point_and_normal(&world, contact) else {
                return;
            };
            if config.contacts {
                gizmos.cross(Isometry3d::from_translation(point), 0.1, tailwind::RED_400);
            }
            if config.normals {
                let end = point + normal * config.normal_length;
                gizmos.arrow(point, end, tailwind::AMBER_300);
            }
        };
        world.contacts.wm.iter().for_each(&mut contact);
        world.contacts.mm.iter().for_each(&mut contact);
    }
    if config.velocities {
        for (position, velocity) in world.marbles.position().iter().zip(world.marbles.velocity()) {
            let position = from_point(*position);
            let end = position + from_vector(*velocity) * config.velocity_scale;
            gizmos.arrow(position, end, tailwind::SKY_300);
        }
    }
    if config.walls {
        outline::walls(&world, &places, &mut gizmos);
    }
    if config.sleepers {
        outline::sleepers(&world, &mut gizmos);
    }
    if config.sensors {
        outline::sensors(&world, &places, &mut gizmos);
    }
    if config.grid {
        let (cells, width) = world.grid().occupied_cells();
        for corner in cells {
            let center = Vec3::from(corner.map(|x| x as f32)) + Vec3::splat(width as f32 / 2.0);
            let cell = Transform::from_translation(center).with_scale(Vec3::splat(width as f32));
            gizmos.cube(cell, tailwind::EMERALD_700.with_alpha(0.5));
        }
    }
}

/// Point of a contact, on the surface of the second body, and its normal.
fn point_and_normal(world: &TawWorld, contact: &Contact<f32>) -> Option<(Vec3, Vec3)> {
    let row = contact.b as usize;
    let normal = from_vector(contact.normal);
    let center = from_point(*world.marbles.position().get(row)?);
    Some((center + from_vector(contact.arms[1]), normal))
}
