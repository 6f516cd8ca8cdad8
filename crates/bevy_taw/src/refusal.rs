//! Refused input, and marbles that the physics had to stop.

use std::collections::HashSet;

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use taw::response::Response;
use taw::world::StopReason;

use crate::components::MarbleState;
use crate::reflect::StopReasonReflect;
use crate::resources::TawWorld;

/// A value that cannot be right was not taken over; what was there before stays.
/// Also logged as a warning. Told once, and again after it was right or another wrong one.
#[derive(Message, Clone, Copy, Debug, PartialEq)]
pub struct InputRefused {
    /// Whose, or `None` for a resource, and for the world as a whole: then it stands still.
    pub entity: Option<Entity>,
    /// Which field, and what was in it.
    pub error: Refusal,
}

/// Why an input was refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// A field and a value that the core refuses.
    #[error(transparent)]
    Value(#[from] taw::Error),
    /// A capsule in a model that knows balls only: a new one is left out of the world until
    /// the model changes, a ball stays a ball.
    #[error("HalfLength must be 0 for this response, which knows balls only, but is {0}")]
    Capsule(f32),
    /// A [`TawModel`](crate::resources::TawModel) whose response knows balls only, because of this
    /// capsule: the model before stays.
    #[error("TawModel is not taken over: this is a capsule, and {0:?} knows balls only")]
    ModelOfBalls(Response),
    /// An entity that would push itself: it is a marble, and no wall.
    #[error("an entity is both a Marble and a Wall; it is a marble only")]
    MarbleAndWall,
    /// A body that is a marble, too: it is a marble, and no body.
    #[error("an entity is both a Body and a Marble; it is a marble only")]
    BodyAndMarble,
    /// A body that is a wall, too: it is a wall, and no body.
    #[error("an entity is both a Body and a Wall; it is a wall only")]
    BodyAndWall,
    /// A body that a marble is to [ignore](crate::ignore::IgnoreCollisions): the two collide.
    #[error("IgnoreCollisions names {0}, which is a Body; only marbles and walls can be ignored")]
    IgnoredBody(Entity),
    /// An end of a [`Joint`](crate::joint::Joint), as a wall: the joint waits until that is a marble or a body.
    #[error("an end of the Joint is on {0}, which is neither a Marble nor a Body")]
    JointEnd(Entity),
    /// A place that nobody can tell, because an ancestor has no `Transform` or is disabled.
    #[error("an ancestor has no Transform, or is disabled, so nobody can say where this is")]
    NoPlace,
    /// A place or rotation that is not finite, as below an ancestor of scale zero.
    #[error("the place in the world is not finite: the scale along it is {0}, {1}, {2}")]
    NoFrame(f32, f32, f32),
    /// A [`PairFilter`](crate::pair_filter::PairFilter) whose system does not run: the pairs collide.
    #[error(
        "the system of PairFilter, {0}, cannot be run: it is not registered, or lacks a parameter"
    )]
    PairFilter(Entity),
}

/// Refusals of this step and of the one before.
#[derive(Resource, Default)]
pub(crate) struct Told {
    now: HashSet<(Option<Entity>, String)>,
    before: HashSet<(Option<Entity>, String)>,
}

/// Reports refusals, each once for as long as it lasts.
#[derive(SystemParam)]
pub(crate) struct Refusals<'w> {
    messages: MessageWriter<'w, InputRefused>,
    told: ResMut<'w, Told>,
}

impl Refusals<'_> {
    /// Begins a step.
    pub fn begin_step(&mut self) {
        let Told { now, before } = &mut *self.told;
        std::mem::swap(now, before);
        now.clear();
    }

    /// Reports an error, if there is one. Returns true if there is none.
    pub fn check<E: Into<Refusal>>(
        &mut self,
        entity: Option<Entity>,
        result: Result<(), E>,
    ) -> bool {
        let Err(error) = result else { return true };
        let error = error.into();
        // As text, because a NaN is not equal to itself.
        let this = (entity, error.to_string());
        if !self.told.before.contains(&this) && !self.told.now.contains(&this) {
            match entity {
                Some(entity) => log::warn!("taw refused a value of {entity}: {error}"),
                None => log::warn!("taw refused an input: {error}"),
            }
            self.messages.write(InputRefused { entity, error });
        }
        self.told.now.insert(this);
        false
    }
}

/// A marble's motion overflowed, or by `EventDriven` the step's budget of events was spent with it.
/// It keeps its last place and has lost its velocity. An overflow affects no other marble; at the end
/// of the budget, all that still have events are stopped. Also logged as a warning.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct MarbleStopped {
    /// Which.
    pub entity: Entity,
    /// Why.
    #[reflect(remote = StopReasonReflect)]
    pub reason: StopReason,
}

/// Reports the marbles that were stopped in this step.
pub(crate) fn report_stopped(world: Res<TawWorld>, mut stopped: MessageWriter<MarbleStopped>) {
    for id in world.stopped() {
        let (entity, reason) = (world.marble_entities.get(&id), world.stop_reason(id));
        if let (Some(&entity), Some(reason)) = (entity, reason) {
            let cause = match reason {
                StopReason::EventBudget => "it had more events than a step may have",
                StopReason::NotFinite => "its motion is no longer finite",
            };
            log::warn!("taw stopped {entity}: {cause}");
            stopped.write(MarbleStopped { entity, reason });
        }
    }
}

/// Leaves marbles out of the world by which it would refuse to step, until they change.
pub(crate) fn leave_out(
    mut world: ResMut<TawWorld>,
    mut states: Query<&mut MarbleState>,
    mut refusals: Refusals,
) {
    for (id, error) in world.unsupported_marbles() {
        let _ = world.marbles.remove(id); // it is there: the world named it
        let Some(entity) = world.marble_entities.remove(&id) else { continue };
        if let Ok(mut state) = states.get_mut(entity) {
            (state.id, state.refused) = (None, true);
        }
        refusals.check(Some(entity), Err(error));
    }
}

/// Logs an error that gather would have refused, had it come through components.
pub(crate) fn report(verb: &str, result: Result<(), taw::Error>) {
    if let Err(error) = result {
        log::error!("taw cannot {verb}: {error}");
    }
}
