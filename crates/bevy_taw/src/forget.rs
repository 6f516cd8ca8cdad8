//! Marbles and walls whose components or entities go.

use bevy::ecs::world::DeferredWorld;
use bevy::prelude::*;

use crate::components::{Marble, MarbleState, Sleeping, WallState};
use crate::resources::TawWorld;
use crate::wall::Wall;

/// Takes a marble out of the world when its component or entity goes, also of an entity that
/// queries do not see.
pub fn forget_marble(removed: On<Remove, Marble>, mut app: DeferredWorld) {
    let id = app.get::<MarbleState>(removed.entity).and_then(|state| state.id);
    // Spatial queries go on with the tree that they have.
    let mut world = app.resource_mut::<TawWorld>();
    let world = world.bypass_change_detection();
    world.away.remove(&removed.entity);
    if let Some(id) = id
        && world.marble_entities.get(&id) == Some(&removed.entity)
    {
        // It can only be gone already if the game took it out by itself.
        let _ = world.marbles.remove(id);
        world.marble_entities.remove(&id);
    }
    app.commands().entity(removed.entity).try_remove::<(MarbleState, Sleeping)>();
}

/// Takes a wall out of the world when its component or entity goes, also of an entity that
/// queries do not see.
pub fn forget_wall(removed: On<Remove, Wall>, mut app: DeferredWorld) {
    let state = app.get::<WallState>(removed.entity);
    let (id, sensor) = (state.and_then(|it| it.id), state.and_then(|it| it.sensor));
    let mut world = app.resource_mut::<TawWorld>();
    if let Some(id) = id
        && world.wall_entities.get(&id) == Some(&removed.entity)
    {
        let _ = world.walls.remove(id);
        world.wall_entities.remove(&id);
    }
    if let Some(id) = sensor {
        world.remove_sensor(id, removed.entity);
    }
    app.commands().entity(removed.entity).try_remove::<WallState>();
}
