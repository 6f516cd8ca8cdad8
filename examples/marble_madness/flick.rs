//! The marble under the mouse can be flicked: found by a ray through the world.

use bevy::prelude::*;
use bevy_taw::prelude::*;
use bevy_taw::taw::prelude::{ColliderId, QueryTree};
use taw_examples::Pointer;

use crate::controls::{Action, just_pressed};

/// How fast a flicked marble is, in m/s.
const SPEED: f32 = 5.0;

pub fn plugin(app: &mut App) {
    app.add_systems(Update, flick.run_if(just_pressed(Action::Flick)));
}

fn flick(
    pointer: Pointer,
    world: Res<TawWorld>,
    mut tree: Local<QueryTree<f32>>,
    mut marbles: Query<&mut Velocity, With<Marble>>,
) {
    let Some(ray) = pointer.ray() else { return };
    let queries = world.queries(&mut tree);
    let hit = queries.cast_ray(&ray, f32::INFINITY, |thing| matches!(thing, ColliderId::Marble(_)));
    let Some(ColliderId::Marble(id)) = hit.map(|found| found.collider) else { return };
    let entity = world.marbles.row(id).ok().and_then(|row| world.marble_entity(row as u32));
    if let Some(mut velocity) = entity.and_then(|entity| marbles.get_mut(entity).ok()) {
        // Up, and away from the eye.
        let away = Vec3::new(ray.direction.x, 0.0, ray.direction.z);
        **velocity = (Vec3::Y + away.normalize_or_zero()).normalize() * SPEED;
    }
}
