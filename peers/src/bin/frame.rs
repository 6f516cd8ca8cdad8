//! Time of a whole frame of a Bevy app without a window, alone and with taw: what the plugin adds.
//!
//! `cargo run --release --bin frame` in this folder. Marbles of 20 cm on a floor, two threads, one fixed
//! step of 1/60 s a frame; medians of 300 frames after 200, in which those that may sleep fall asleep.

use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_taw::prelude::*;

const FRAMES: usize = 300;

fn app(count: usize, awake: bool, with_taw: bool) -> App {
    let mut app = App::new();
    let threads = TaskPoolOptions::with_num_threads(2);
    let pools = TaskPoolPlugin { task_pool_options: threads };
    app.add_plugins((MinimalPlugins.set(pools), TransformPlugin));
    if with_taw {
        app.add_plugins(TawPlugin);
    } else if awake {
        // As much as a marble that rolls writes.
        let roll = |mut marbles: Query<(&mut Transform, &mut Velocity)>| {
            for (mut place, mut velocity) in &mut marbles {
                place.translation.x += 1e-3;
                velocity.x *= 0.999;
            }
        };
        app.add_systems(FixedUpdate, roll);
    }
    let step = Duration::from_secs(1) / 60;
    app.insert_resource(Time::<Fixed>::from_duration(step));
    app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
    app.finish();
    app.update();
    app.world_mut().spawn(Wall::default());
    for i in 0..count {
        let place = Transform::from_xyz((i % 100) as f32 * 0.5, 0.2, (i / 100) as f32 * 0.5);
        let motion = (Velocity::default(), AngularVelocity::default());
        let mut marble = app.world_mut().spawn((Marble::new(0.2), motion, place));
        if awake {
            marble.insert((SleepingDisabled, Velocity(Vec3::X * 0.1)));
        }
    }
    app
}

/// Median of a frame's time, in microseconds.
fn median(mut app: App) -> f64 {
    (0..200).for_each(|_| app.update());
    let frame = |app: &mut App| {
        let begin = Instant::now();
        app.update();
        begin.elapsed()
    };
    let mut times: Vec<_> = (0..FRAMES).map(|_| frame(&mut app)).collect();
    times.sort_unstable();
    times[FRAMES / 2].as_secs_f64() * 1e6
}

fn main() {
    println!("| marbles | Bevy alone, µs | with taw, µs | taw, µs |");
    println!("|---|---|---|---|");
    for (count, awake) in [(0, false), (20, true), (20, false), (10_000, true), (10_000, false)] {
        let [alone, with] = [false, true].map(|with_taw| median(app(count, awake, with_taw)));
        let state = if awake { "awake" } else { "asleep" };
        println!("| {count} {state} | {alone:.0} | {with:.0} | {:.0} |", with - alone);
    }
}
