//! The marble under the mouse can be flicked: found by a ray through the world.

use bevy::prelude::*;
use bevy_taw::prelude::*;
use taw_examples::Pointer;

use crate::controls::{Action, just_pressed};

/// Speed of a flicked marble, in m/s.
const SPEED: f32 = 5.0;

pub fn plugin(app: &mut App) {
    app.add_systems(Update, flick.run_if(just_pressed(Action::Flick)));
}

fn flick(pointer: Pointer, spatial: SpatialQuery, mut marbles: Query<&mut Velocity, With<Marble>>) {
    let Some(ray) = pointer.bevy_ray() else { return };
    let hit = spatial.cast_ray(ray, f32::INFINITY, &SpatialQueryFilter::marbles());
    if let Some(mut velocity) = hit.and_then(|hit| marbles.get_mut(hit.entity).ok()) {
        // Up, and away from the eye.
        let away = Vec3::new(ray.direction.x, 0.0, ray.direction.z);
        **velocity = (Vec3::Y + away.normalize_or_zero()).normalize() * SPEED;
    }
}
