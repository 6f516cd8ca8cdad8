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
        self == Self::default() || order.is_some_and(|order| order.labels.contains(&self.0))
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
        let before = app.world().get_resource::<TawSchedule>();
        if let Some(TawSchedule(before)) = before.filter(|before| **before != self.0) {
            let now = self.0.0;
            log::warn!(
                "plugins of taw that were added before `TawPlugins::in_schedule({now:?})` are in \
                 {before:?}: add them after it"
            );
        }
        app.insert_resource(self.0);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Mutex, PoisonError};

    use super::*;

    /// Logger that keeps what is said.
    struct Said(Mutex<String>);

    static SAID: Said = Said(Mutex::new(String::new()));

    impl Said {
        fn take(&self) -> String {
            std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
        }
    }

    impl log::Log for Said {
        fn enabled(&self, _: &log::Metadata) -> bool {
            true
        }

        fn log(&self, record: &log::Record) {
            if record.target() == module_path!().trim_end_matches("::tests") {
                let mut said = self.0.lock().unwrap_or_else(PoisonError::into_inner);
                *said += &record.args().to_string();
            }
        }

        fn flush(&self) {}
    }

    #[test]
    fn who_came_before_the_schedule_was_chosen_is_told_by_name() {
        log::set_logger(&SAID).unwrap();
        log::set_max_level(log::LevelFilter::Warn);
        let mut app = App::new();
        app.add_plugins(SchedulePlugin::new(FixedPostUpdate));
        assert_eq!(TawSchedule::of(&mut app).label(), FixedPostUpdate.intern());
        assert_eq!(SAID.take(), "");
        let mut app = App::new();
        TawSchedule::of(&mut app);
        app.add_plugins(SchedulePlugin::new(FixedUpdate));
        assert_eq!(SAID.take(), "", "it is the same one");
        let mut app = App::new();
        TawSchedule::of(&mut app);
        app.add_plugins(SchedulePlugin::new(FixedPostUpdate));
        let said = SAID.take();
        assert!(said.contains("in_schedule(FixedPostUpdate)") && said.contains(" in FixedUpdate"));
        assert_eq!(TawSchedule::of(&mut app).label(), FixedPostUpdate.intern());
    }

    #[test]
    fn fixed_update_is_fixed_before_its_loop_is_set_up() {
        let world = World::new();
        assert!(TawSchedule::default().is_fixed(&world));
        assert!(!TawSchedule(Update.intern()).is_fixed(&world));
    }
}
