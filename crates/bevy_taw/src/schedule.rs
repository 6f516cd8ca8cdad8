//! Schedule in which the physics runs.

use bevy::app::FixedMainScheduleOrder;
use bevy::ecs::schedule::{InternedScheduleLabel, ScheduleLabel};
use bevy::prelude::*;

/// Schedule of the step: [`FixedUpdate`], unless
/// [`TawPlugins::in_schedule`](crate::TawPlugins::in_schedule) chose another one. A plugin that adds systems
/// beside the step reads it.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq)]
pub struct TawSchedule(InternedScheduleLabel);

impl Default for TawSchedule {
    fn default() -> Self {
        Self(FixedUpdate.intern())
    }
}

impl TawSchedule {
    /// Label of the schedule.
    #[must_use]
    pub fn label(self) -> InternedScheduleLabel {
        self.0
    }

    /// Schedule of an app.
    pub(crate) fn of(app: &mut App) -> Self {
        *app.world_mut().get_resource_or_init::<Self>()
    }

    /// Returns true if the fixed main loop runs it.
    pub(crate) fn is_fixed(self, world: &World) -> bool {
        let order = world.get_resource::<FixedMainScheduleOrder>();
        order.is_some_and(|order| order.labels.contains(&self.0))
    }
}

/// Plugin that chooses the schedule, before others look at it.
#[derive(Debug)]
pub(crate) struct SchedulePlugin(TawSchedule);

impl SchedulePlugin {
    pub fn new(label: impl ScheduleLabel) -> Self {
        Self(TawSchedule(label.intern()))
    }
}

impl Plugin for SchedulePlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(self.0);
    }
}
