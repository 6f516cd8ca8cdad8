//! Sleep of marbles as components.

use bevy::prelude::*;

use crate::components::{MarbleState, Sleeping};
use crate::resources::TawWorld;

/// Version of sleep up to which markers are up to date.
type Version = Option<(u32, u64)>;

/// Takes over the version. Returns whether it was another.
fn update(last: &mut Version, world: &TawWorld) -> bool {
    let now = Some((world.restored, world.sleep_version()));
    std::mem::replace(last, now) != now
}

fn is_asleep(world: &TawWorld, state: &MarbleState) -> bool {
    state.id.is_some_and(|id| world.is_asleep(id) == Ok(true))
}

/// Takes the marker [`Sleeping`] from marbles that woke, before others write them.
pub fn unmark(
    world: Res<TawWorld>,
    marbles: Query<(Entity, &MarbleState), With<Sleeping>>,
    mut last: Local<Version>,
    mut commands: Commands,
) {
    if update(&mut last, &world) {
        for (entity, _) in marbles.iter().filter(|(_, state)| !is_asleep(&world, state)) {
            commands.entity(entity).try_remove::<Sleeping>();
        }
    }
}

/// Gives it to those that fell asleep, once they were written for the last time.
pub fn mark(
    world: Res<TawWorld>,
    marbles: Query<(Entity, &MarbleState), Without<Sleeping>>,
    mut last: Local<Version>,
    mut commands: Commands,
) {
    if update(&mut last, &world) {
        let asleep = marbles.iter().filter(|(_, state)| is_asleep(&world, state));
        let asleep: Vec<_> = asleep.map(|(entity, _)| (entity, Sleeping)).collect();
        commands.try_insert_batch(asleep);
    }
}
