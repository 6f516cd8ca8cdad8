//! Gaps between two that touched: which of them still do.

use bevy::prelude::*;
use taw::contact::touch_goes_on;
use taw::math::length;
use taw::world::ColliderId;

use crate::components::{MarbleState, WallState};
use crate::convert::from_vector;
use crate::messages::ContactPair;
use crate::resources::TawWorld;

/// Distance that gravity closes in a substep of `dt` seconds, in metres.
pub(crate) fn fall(world: &TawWorld, dt: f32) -> f32 {
    from_vector(world.gravity()).length() * dt * dt
}

/// Separation of two surfaces, and the smaller radius, in metres.
pub(crate) struct Gap {
    pub width: f32,
    pub radius: f32,
}

impl Gap {
    /// Returns true if two that touched still do: what rests touches in one step and hovers in the
    /// next. `fall` is the distance that gravity closes in a substep, in metres.
    pub(crate) fn is_closed(&self, fall: f32) -> bool {
        touch_goes_on(self.width, self.radius, fall)
    }
}

/// The gap of a pair, or `None` if one of the two is gone or passes through the other.
pub(crate) fn gap(
    pair: ContactPair,
    world: &TawWorld,
    marbles: &Query<&MarbleState>,
    walls: &Query<&WallState>,
) -> Option<Gap> {
    let id = marbles.get(pair.b).ok()?.id?;
    let collides = |other| world.may_collide(id, other) == Ok(true);
    let b = world.marbles.get(id).ok()?;
    if let Ok(wall) = walls.get(pair.a) {
        let id = wall.id.filter(|id| collides(ColliderId::Wall(*id)))?;
        let wall = world.walls.get(id).ok()?;
        Some(Gap { width: wall.project_point(b.position).distance - b.radius, radius: b.radius })
    } else {
        let id = marbles.get(pair.a).ok()?.id;
        let id = id.filter(|id| collides(ColliderId::Marble(*id)))?;
        let a = world.marbles.get(id).ok()?;
        let width = length(b.position - a.position) - a.radius - b.radius;
        Some(Gap { width, radius: a.radius.min(b.radius) })
    }
}
