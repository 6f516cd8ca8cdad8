//! Gaps between two that touched: which of them still do.

use bevy::prelude::*;
use taw::contact::{closest_points, touch_goes_on};
use taw::math::length;
use taw::shape::{Capsule, Shape, Sphere};
use taw::world::{ColliderId, MarbleId};

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
    let b = capsule(id, world)?;
    if let Ok(wall) = walls.get(pair.a) {
        let id = wall.id.filter(|id| collides(ColliderId::Wall(*id)))?;
        let wall = world.walls.get(id).ok()?;
        let width = |center| wall.project_point(center).distance - b.radius;
        let width = if b.a == b.b {
            width(b.a)
        } else {
            // Exact unless it lies on an edge, beside its middle.
            width(b.a).min(width(b.b)).min(width(b.a + (b.b - b.a) * 0.5))
        };
        Some(Gap { width, radius: b.radius })
    } else {
        let id = marbles.get(pair.a).ok()?.id;
        let id = id.filter(|id| collides(ColliderId::Marble(*id)))?;
        let a = capsule(id, world)?;
        // To where it is nearest across the sides of a periodic box.
        let across = world.nearest_image(b.a, a.a) - b.a;
        let width = if a.a == a.b && b.a == b.b {
            length(b.a + across - a.a) - a.radius - b.radius
        } else {
            closest_points(&a, &Capsule { a: b.a + across, b: b.b + across, ..b }).distance
        };
        Some(Gap { width, radius: a.radius.min(b.radius) })
    }
}

/// Capsule that a marble is; of a ball, both ends are its center.
fn capsule(id: MarbleId, world: &TawWorld) -> Option<Capsule<f32>> {
    match world.marbles.shape(id).ok()? {
        Shape::Capsule(capsule) => Some(capsule),
        Shape::Sphere(Sphere { center, radius }) => Some(Capsule { a: center, b: center, radius }),
        _ => None, // marbles are no others
    }
}
