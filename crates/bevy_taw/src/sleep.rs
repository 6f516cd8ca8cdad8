//! Sleep of marbles as components.

use bevy::prelude::*;

use crate::components::{MarbleState, Sleeping};
use crate::resources::TawWorld;

/// Gives marbles that fell asleep the marker [`Sleeping`], and takes it from those that woke.
pub fn mark(
    world: Res<TawWorld>,
    marbles: Query<(Entity, &MarbleState, Has<Sleeping>)>,
    mut last: Local<Option<(u32, u64)>>,
    mut commands: Commands,
) {
    let now = Some((world.restored, world.sleep_version()));
    if std::mem::replace(&mut *last, now) == now {
        return;
    }
    let mut fell_asleep = Vec::new();
    for (entity, state, was_asleep) in &marbles {
        let asleep = state.id.is_some_and(|id| world.is_asleep(id) == Ok(true));
        if asleep && !was_asleep {
            fell_asleep.push((entity, Sleeping));
        } else if was_asleep && !asleep {
            commands.entity(entity).try_remove::<Sleeping>();
        }
    }
    commands.try_insert_batch(fell_asleep);
}
