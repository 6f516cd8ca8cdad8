//! What the physics could not do: values that it did not take over, marbles that
//! it had to stop.

use bevy::prelude::*;

use crate::resources::TawWorld;

/// A value that cannot be right was not taken over; what was there before stays.
/// Also logged as a warning. Told once for each such value.
#[derive(Message, Clone, Copy, Debug, PartialEq)]
pub struct InputRefused {
    /// Whose, or `None` for a resource.
    pub entity: Option<Entity>,
    /// Which field, and what was in it.
    pub error: taw::Error,
}

impl InputRefused {
    pub(crate) fn write(
        writer: &mut MessageWriter<Self>,
        entity: Option<Entity>,
        error: taw::Error,
    ) {
        match entity {
            Some(entity) => log::warn!("taw refused a value of {entity}: {error}"),
            None => log::warn!("taw refused a resource: {error}"),
        }
        writer.write(Self { entity, error });
    }
}

/// A marble's motion overflowed. It keeps its last place and has lost its velocity;
/// no other marble was affected. Also logged as a warning.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct MarbleStopped {
    /// Which.
    pub entity: Entity,
}

/// Tells of the marbles that were stopped in this step.
pub(crate) fn report_stopped(world: Res<TawWorld>, mut stopped: MessageWriter<MarbleStopped>) {
    for id in world.stopped() {
        if let Some(&entity) = world.marble_entities.get(&id) {
            log::warn!("taw stopped {entity}: its motion is no longer finite");
            stopped.write(MarbleStopped { entity });
        }
    }
}

/// Logs an error that gather would have refused, had it come through components.
pub(crate) fn report(verb: &str, result: Result<(), taw::Error>) {
    if let Err(error) = result {
        log::error!("taw cannot {verb}: {error}");
    }
}
