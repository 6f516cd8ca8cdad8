//! Pause, single step, slow motion.

use bevy::prelude::*;

use crate::controls::{Action, just_pressed};

/// The speed of slow motion, as a part of the normal one.
const SLOW: f32 = 0.15;

/// Asks for one fixed step while the game is paused.
#[derive(Message, Default)]
pub struct SingleStep;

pub fn plugin(app: &mut App) {
    app.add_message::<SingleStep>().add_systems(
        Update,
        (
            toggle_pause.run_if(just_pressed(Action::Pause)),
            toggle_slow_motion.run_if(just_pressed(Action::SlowMotion)),
            (|mut steps: MessageWriter<SingleStep>| {
                steps.write(SingleStep);
            })
            .run_if(just_pressed(Action::SingleStep)),
            single_step,
        )
            .chain(),
    );
}

fn toggle_pause(mut time: ResMut<Time<Virtual>>) {
    let paused = time.is_paused();
    set_paused(&mut time, !paused);
}

pub fn set_paused(time: &mut Time<Virtual>, paused: bool) {
    if paused { time.pause() } else { time.unpause() }
}

fn toggle_slow_motion(mut time: ResMut<Time<Virtual>>) {
    let slow = is_slow(&time);
    set_slow(&mut time, !slow);
}

pub fn is_slow(time: &Time<Virtual>) -> bool {
    time.relative_speed() < 1.0
}

pub fn set_slow(time: &mut Time<Virtual>, slow: bool) {
    time.set_relative_speed(if slow { SLOW } else { 1.0 });
}

/// The next frame runs one fixed step more.
fn single_step(
    mut steps: MessageReader<SingleStep>,
    virtual_time: Res<Time<Virtual>>,
    mut fixed: ResMut<Time<Fixed>>,
) {
    if virtual_time.is_paused() {
        let step = fixed.timestep();
        steps.read().for_each(|_| fixed.accumulate_overstep(step));
    } else {
        steps.clear();
    }
}
