use bevy::ecs::schedule::ScheduleLabel;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_taw::prelude::*;
use std::time::{Duration, Instant};

fn app(taw: bool) -> App {
    let mut app = App::new();
    app.add_plugins((
        MinimalPlugins
            .set(TaskPoolPlugin { task_pool_options: TaskPoolOptions::with_num_threads(2) }),
        TransformPlugin,
    ));
    if taw {
        app.add_plugins(TawPlugin);
    }
    let step = Duration::from_secs_f32(1.0 / 60.0);
    app.insert_resource(Time::<Fixed>::from_duration(step));
    app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
    if taw {
        app.insert_resource(TawModel(Model::GAME));
    }
    app.finish();
    app.update();
    app
}
fn fill(app: &mut App, n: usize, taw: bool) {
    let world = app.world_mut();
    if taw {
        world.spawn(Wall::default());
    }
    for i in 0..n {
        let place = Transform::from_xyz((i % 100) as f32 * 1.1, 0.5 + 0.02, (i / 100) as f32 * 1.1);
        if taw {
            world.spawn((
                Marble::new(0.5),
                place,
                Velocity::default(),
                AngularVelocity::default(),
                MarbleMass::Density(1.0),
                SleepingDisabled,
            ));
        } else {
            world.spawn(place);
        }
    }
}

fn shove(mut q: Query<&mut Transform>) {
    for mut t in &mut q {
        t.translation.y += 0.001;
        t.rotation = Quat::from_xyzw(0.0, 0.0, 0.0, 1.0);
    }
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let only: Option<usize> = args.get(1).and_then(|a| a.parse().ok());
    for n in [20usize, 1000, 10000] {
        if only.is_some_and(|o| o != n) {
            continue;
        }
        for taw in [false, true] {
            if only.is_some() && !taw {
                continue;
            }
            let mut app = app(taw);
            if !taw {
                app.add_systems(FixedUpdate, shove);
            }
            fill(&mut app, n, taw);
            for _ in 0..200 {
                app.update();
            }
            let m = 2000;
            let mut t: Vec<f64> = (0..m)
                .map(|_| {
                    let s = Instant::now();
                    app.update();
                    s.elapsed().as_secs_f64() * 1e6
                })
                .collect();
            t.sort_by(f64::total_cmp);
            println!(
                "n {n} taw {taw}: median {:.1} us, p10 {:.1}, p90 {:.1}",
                t[m / 2],
                t[m / 10],
                t[m * 9 / 10]
            );
            if taw {
                let mut world = (**app.world().resource::<TawWorld>()).clone();
                let mut t: Vec<f64> = (0..m)
                    .map(|_| {
                        let s = Instant::now();
                        world.step(1.0 / 60.0).unwrap();
                        s.elapsed().as_secs_f64() * 1e6
                    })
                    .collect();
                t.sort_by(f64::total_cmp);
                println!(
                    "   world alone: median {:.1} us, p10 {:.1}, p90 {:.1}",
                    t[m / 2],
                    t[m / 10],
                    t[m * 9 / 10]
                );
            }
        }
    }
}
