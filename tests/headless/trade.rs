//! Models measured beside the game, and the governor that chooses among them.

use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_taw::governor::{Governor, ModelGoverned, WINDOW};
use bevy_taw::prelude::*;
use bevy_taw::trade::{TawTrade, TawTradePlugin, TradeMeasured};

use crate::scene::{STEP, app_with, drop_marble, floor, frame_length, frames, position};

/// Some marbles that fall on a floor.
fn game() -> (App, Vec<Entity>) {
    let mut app = app_with((TawPlugin, TawTradePlugin));
    floor(&mut app);
    let marbles = (0..12).map(|i| {
        let at = Vec3::new(0.9 * (i % 4) as f32, 1.0 + 0.3 * i as f32, 0.7 * (i / 4) as f32);
        drop_marble(&mut app, 0.4, at)
    });
    let marbles = marbles.collect();
    frames(&mut app, 1);
    (app, marbles)
}

fn measure(app: &mut App) {
    let step = Duration::from_secs_f32(STEP);
    app.world_mut().resource_scope(|world, mut trade: Mut<TawTrade>| {
        trade.patience = 0.02;
        trade.measure(&mut world.resource_mut::<TawWorld>(), step);
    });
}

/// Lets the game go on until the measurement is done.
fn wait(app: &mut App) {
    let begin = Instant::now();
    while app.world().resource::<TawTrade>().progress().is_some() {
        frames(app, 1);
        assert!(begin.elapsed() < Duration::from_mins(2), "it never ends");
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn told<M: Message>(app: &App) -> usize {
    app.world().resource::<Messages<M>>().len()
}

#[test]
fn models_are_measured_beside_the_game_and_do_not_disturb_it() {
    let (mut app, marbles) = game();
    measure(&mut app);
    assert!(app.world().resource::<TawTrade>().progress().is_some());
    frames(&mut app, 60);
    let (mut alone, same) = game();
    frames(&mut alone, 60);
    for (a, b) in marbles.iter().zip(&same) {
        assert_eq!(position(&app, *a), position(&alone, *b));
    }
    wait(&mut app);
    assert_eq!(told::<TradeMeasured>(&app), 1);
    let trade = app.world().resource::<TawTrade>();
    let front: Vec<_> = trade.front().collect();
    assert!(front.len() > 1);
    assert!(front.windows(2).all(|two| two[0].cost < two[1].cost));
    assert!(front.windows(2).all(|two| two[0].total_error() > two[1].total_error()));
    let all = &trade.advice().candidates;
    let worst = all.iter().max_by(|a, b| a.total_error().total_cmp(&b.total_error())).unwrap();
    assert_ne!(worst.setting.model.response, Response::EventDriven);
}

#[test]
fn a_measurement_can_be_given_up() {
    let (mut app, _) = game();
    measure(&mut app);
    frames(&mut app, 3);
    app.world_mut().resource_mut::<TawTrade>().cancel();
    frames(&mut app, 10);
    assert!(app.world().resource::<TawTrade>().progress().is_none());
    assert_eq!(told::<TradeMeasured>(&app), 0);
    // One after it gives all.
    measure(&mut app);
    measure(&mut app);
    wait(&mut app);
    assert!(!app.world().resource::<TawTrade>().advice().candidates.is_empty());
}

#[test]
fn without_marbles_there_is_nothing_to_measure() {
    let mut app = app_with((TawPlugin, TawTradePlugin));
    floor(&mut app);
    frames(&mut app, 2);
    measure(&mut app);
    assert!(app.world().resource::<TawTrade>().progress().is_none());
}

#[test]
fn the_governor_goes_down_when_steps_run_over_and_up_when_there_is_room() {
    let (mut app, _) = game();
    app.world_mut().resource_mut::<TawTrade>().patience = 0.02;
    let before = **app.world().resource::<TawModel>();
    frames(&mut app, 3 * WINDOW);
    assert_eq!(**app.world().resource::<TawModel>(), before, "off by default");
    assert!(app.world().resource::<TawTrade>().progress().is_none());

    // No step takes so little: the cheapest it is, at once. It measures by itself.
    app.world_mut().resource_mut::<Governor>().budget = Some(Duration::from_nanos(1));
    frames(&mut app, 2);
    wait(&mut app);
    frames(&mut app, 2 * WINDOW);
    let front: Vec<Model> = {
        let trade = app.world().resource::<TawTrade>();
        trade.front().map(|choice| choice.setting.model).collect()
    };
    assert_eq!(**app.world().resource::<TawModel>(), front[0]);
    // And no step takes so long: the most exact one, rung by rung.
    app.world_mut().resource_mut::<Governor>().budget = Some(Duration::from_hours(1));
    let mut now = 0;
    for _ in 0..200 * front.len() {
        frames(&mut app, WINDOW);
        let model = **app.world().resource::<TawModel>();
        let at = front.iter().position(|known| *known == model).unwrap();
        assert!(at == now || at == now + 1, "from {now} to {at}");
        if at == now + 1 {
            assert!(told::<ModelGoverned>(&app) <= 2);
        }
        now = at;
        if now + 1 == front.len() {
            return;
        }
    }
    panic!("it stays at {now} of {}", front.len());
}

/// As a game does that pauses before anything was measured.
#[test]
fn the_governor_measures_when_time_passes() {
    let mut app = app_with((TawPlugins::in_schedule(Update), TawTradePlugin));
    drop_marble(&mut app, 0.4, Vec3::Y);
    frames(&mut app, 1);
    frame_length(&mut app, 0.0);
    app.world_mut().resource_mut::<Governor>().budget = Some(Duration::from_millis(5));
    frames(&mut app, 3);
    assert!(app.world().resource::<TawTrade>().progress().is_none());
    frame_length(&mut app, STEP);
    frames(&mut app, 2);
    let trade = app.world().resource::<TawTrade>();
    assert!(trade.progress().is_some() || !trade.advice().candidates.is_empty());
}

/// Prints the time of frames while models are measured, and while they are not.
#[test]
#[ignore = "measures: cargo test --test headless -- --ignored --nocapture hitch"]
fn hitch() {
    let (mut app, _) = game();
    let mut frame_times = |measured: bool| {
        let mut times = Vec::new();
        for _ in 0..600 {
            if measured && app.world().resource::<TawTrade>().progress().is_none() {
                measure(&mut app);
            }
            let begin = Instant::now();
            frames(&mut app, 1);
            let took = begin.elapsed();
            times.push(took);
            std::thread::sleep(Duration::from_secs_f32(STEP).saturating_sub(took));
        }
        times.sort_unstable();
        println!(
            "measuring: {measured}: median {:?}, 99 of 100 below {:?}, longest {:?}",
            times[300], times[594], times[599]
        );
    };
    frame_times(false);
    frame_times(true);
    frame_times(false);
    frame_times(true);
}
