//! Backend for Bevy's picking: pointers hover, click and drag marbles, walls and bodies.
//!
//! ```no_run
//! # use bevy::prelude::*;
//! # use bevy::picking::events::{Click, Pointer};
//! # use bevy_taw::prelude::*;
//! # use bevy_taw::picking::TawPickingPlugin;
//! # let mut app = App::new();
//! app.add_plugins((DefaultPlugins, TawPlugins, TawPickingPlugin));
//!
//! fn spawn(mut commands: Commands) {
//!     let kick = |click: On<Pointer<Click>>, mut marbles: Query<&mut Velocity>| {
//!         if let Ok(mut velocity) = marbles.get_mut(click.entity) {
//!             velocity.y += 3.0;
//!         }
//!     };
//!     commands.spawn(Marble::new(0.5)).observe(kick);
//! }
//! ```

use bevy::camera::Camera;
use bevy::camera::visibility::RenderLayers;
use bevy::picking::backend::ray::RayMap;
use bevy::picking::backend::{HitData, PointerHits};
use bevy::picking::{Pickable, PickingSystems};
use bevy::prelude::*;

use crate::spatial_query::{SpatialQuery, SpatialQueryFilter};

/// Reports what is below each pointer to Bevy's picking, whose plugins the game adds (they are in
/// `DefaultPlugins`).
///
/// All marbles, walls and [bodies](crate::body::Body) count, where they were after the last step, drawn or not, except those with a
/// [`Pickable`] that is not hoverable, as `Pickable::IGNORE` of a wall that nobody sees, those in no
/// [`RenderLayers`] of the camera, and those that the camera is in. Positions and normals
/// of hits are those of the surface, in world space. Balls of swarms and sensors are not found:
/// a [`SpatialQuery`] with the ray of the pointer finds balls.
#[derive(Debug, Default)]
pub struct TawPickingPlugin;

impl Plugin for TawPickingPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(PreUpdate, report_hits.in_set(PickingSystems::Backend));
    }
}

/// Casts the ray of each pointer in each camera, and reports what it hits, nearest first.
fn report_hits(
    rays: Res<RayMap>,
    cameras: Query<(&Camera, Option<&RenderLayers>)>,
    (pickables, layers): (Query<&Pickable>, Query<&RenderLayers>),
    spatial: SpatialQuery,
    mut hits: MessageWriter<PointerHits>,
) {
    for (id, ray) in rays.iter() {
        let Ok((camera, drawn)) = cameras.get(id.camera) else { continue };
        let drawn = drawn.unwrap_or_default();
        let is_picked = |entity| {
            drawn.intersects(layers.get(entity).unwrap_or_default())
                && pickables.get(entity).map_or(true, |it| it.is_hoverable)
        };
        let filter = SpatialQueryFilter::default().without_balls().with_predicate(&is_picked);
        let of_ray = spatial.cast_ray_all(*ray, f32::INFINITY, &filter);
        let picks = of_ray.into_iter().filter(|hit| hit.distance > 0.0).map(|hit| {
            let (point, normal) = (Some(hit.point), Some(hit.normal));
            (hit.entity, HitData::new(id.camera, hit.distance, point, normal))
        });
        let picks: Vec<_> = picks.collect();
        if !picks.is_empty() {
            hits.write(PointerHits::new(id.pointer, picks, camera.order as f32));
        }
    }
}
