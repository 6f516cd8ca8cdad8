//! Error against cost of the running scene, to look at and to choose from.

use std::time::Duration;

use bevy::prelude::*;
use bevy_egui::egui::{self, Color32, Ui};
use egui_plot::{HoverPosition, Line, MarkerShape, Plot, PlotPoint, Points};
use taw::world::Model;
use taw_lab::advise::Advice;

use crate::governor::Governor;
use crate::resources::{TawModel, TawWorld};
use crate::trade::{Candidate, TawTrade};

/// Largest distance of a click from a point of the chart, in points of the screen.
const REACH: f32 = 12.0;

/// Measures all models on the scene as it is (for a game with so long a `step`), and draws what
/// came of it: how far marbles are from where they should be, against what a step takes, with the
/// best in the upper right corner. A click on a point adopts its model. Below it, the governor.
pub fn trade(
    ui: &mut Ui,
    trade: &mut ResMut<TawTrade>,
    world: &mut ResMut<TawWorld>,
    model: &mut ResMut<TawModel>,
    governor: &mut ResMut<Governor>,
    step: Duration,
) {
    ui.horizontal(|ui| {
        if let Some(part) = trade.progress() {
            if ui.button("Stop").clicked() {
                trade.cancel();
            }
            ui.add(egui::ProgressBar::new(part).show_percentage());
        } else {
            let button = ui.button("Measure the models");
            if button.on_hover_text("On the marbles as they are now, beside the game").clicked() {
                let trade = trade.bypass_change_detection();
                trade.measure(world.bypass_change_detection(), step);
            }
        }
    });
    if !trade.advice().candidates.is_empty() {
        if let Some(chosen) = chart(ui, trade.advice(), model.0) {
            model.set_if_neq(TawModel(chosen));
        }
        ui.weak(sure(trade.advice()));
        current(ui, trade.advice(), model.0);
    }
    govern(ui, governor, model.0, trade.advice());
}

/// Confidence of the advice, in words.
fn sure(advice: &Advice) -> String {
    let Advice { horizon, seconds, sure, .. } = advice;
    let sure = sure * 1e3;
    if *horizon >= seconds - 1e-9 {
        format!("Places compared for all of {seconds:.1} s, known to {sure:.1e} mm.")
    } else {
        format!(
            "Places compared for the {horizon:.1} of {seconds:.1} s that can be told (to {sure:.1e} \
             mm), heights and overlaps for all of it."
        )
    }
}

/// Error and cost of the model in use, if it was measured.
fn current(ui: &mut Ui, advice: &Advice, model: Model) {
    match advice.candidates.iter().find(|choice| choice.setting.model == model) {
        Some(choice) => ui.label(format!("Now: {}", describe(choice))),
        None => ui.label("Now: a model that was not measured"),
    };
}

fn govern(ui: &mut Ui, governor: &mut ResMut<Governor>, model: Model, advice: &Advice) {
    let mut on = governor.budget.is_some();
    let mut budget = governor.budget.unwrap_or(Duration::from_millis(2)).as_secs_f64() * 1e3;
    let mut changed = false;
    ui.horizontal(|ui| {
        let help = "Goes down the front when steps run over, and up when there is room";
        changed |= ui.checkbox(&mut on, "Govern").on_hover_text(help).changed();
        let slider = egui::Slider::new(&mut budget, 0.05..=20.0).logarithmic(true);
        changed |= ui.add_enabled(on, slider.suffix(" ms a step")).changed();
    });
    if changed {
        governor.budget = on.then(|| Duration::from_secs_f64(budget * 1e-3));
    }
    if on && let Some(at) = advice.front().iter().position(|c| c.setting.model == model) {
        ui.weak(format!("rung {} of {}", at + 1, advice.front().len()));
    }
}

/// The choices of a name.
fn of<'a>(advice: &'a Advice, name: &'a str) -> impl Iterator<Item = &'a Candidate> {
    advice.candidates.iter().filter(move |choice| choice.name == name)
}

/// Upward and to the right is better; what is below a nanometre or a nanosecond is as good as that.
fn place(choice: &Candidate) -> [f64; 2] {
    [-choice.cost.max(1e-9).log10(), -choice.total_error().max(1e-9).log10()]
}

fn describe(choice: &Candidate) -> String {
    let Model { substeps, iterations, .. } = choice.setting.model;
    format!(
        "{}, {substeps} substeps, {iterations} iterations: {}, {} a step",
        choice.name,
        metres(choice.total_error()),
        seconds(choice.cost)
    )
}

/// With the unit that suits it.
fn metres(length: f64) -> String {
    in_units(length, &[("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("µm", 1e-6), ("nm", 1e-9)])
}

fn seconds(time: f64) -> String {
    in_units(time, &[("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9)])
}

fn in_units(number: f64, units: &[(&str, f64)]) -> String {
    // The rounding of a power of ten must not pick the smaller unit.
    let fits = units.iter().find(|(_, worth)| number > 0.99 * worth).or(units.last());
    let (unit, worth) = fits.copied().unwrap_or(("", 1.0));
    let number = number / worth;
    if number < 9.95 { format!("{number:.1} {unit}") } else { format!("{number:.0} {unit}") }
}

/// Draws the chart; gives the model that was clicked.
fn chart(ui: &mut Ui, advice: &Advice, now: Model) -> Option<Model> {
    let mut names: Vec<&str> = advice.candidates.iter().map(|choice| choice.name).collect();
    names.sort_unstable();
    names.dedup();
    let label = |at: &HoverPosition| match at {
        HoverPosition::NearDataPoint { plot_name, index, .. } => {
            of(advice, plot_name).nth(*index).map(|choice| describe(choice).replacen(": ", "\n", 1))
        }
        HoverPosition::Elsewhere { .. } => None,
    };
    let plot = Plot::new("taw trade")
        .height(300.0)
        .allow_scroll(false)
        .allow_zoom(false)
        .allow_drag(false)
        .allow_boxed_zoom(false)
        .x_axis_label("what a step takes")
        .y_axis_label("error")
        .x_axis_formatter(|mark, _| whole(mark.value, |x| seconds(10_f64.powf(-x))))
        .y_axis_formatter(|mark, _| whole(mark.value, |y| metres(10_f64.powf(-y))))
        .label_formatter(label);
    let grey = Color32::from_gray(128).gamma_multiply(0.6);
    let response = plot.show(ui, |plot| {
        let front: Vec<_> = advice.front().into_iter().map(place).collect();
        plot.line(Line::new("the front", front).width(6.0).color(grey).allow_hover(false));
        for name in &names {
            let points: Vec<_> = of(advice, name).map(place).collect();
            plot.points(Points::new(*name, points).radius(3.5).color(color(name, &names)));
        }
        if let Some(choice) = advice.candidates.iter().find(|choice| choice.setting.model == now) {
            let ring = Points::new("now", vec![place(choice)]).shape(MarkerShape::Circle);
            plot.points(ring.filled(false).radius(9.0).color(Color32::WHITE).allow_hover(false));
        }
    });
    ui.horizontal_wrapped(|ui| {
        for name in &names {
            ui.colored_label(color(name, &names), *name);
        }
        ui.colored_label(grey, "the front");
        ui.label("ring: now");
    });
    let pointer =
        response.response.clicked().then(|| response.response.interact_pointer_pos())??;
    let distance = |choice: &Candidate| {
        response.transform.position_from_point(&PlotPoint::from(place(choice))).distance(pointer)
    };
    let nearest = advice.candidates.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    (distance(nearest) <= REACH).then_some(nearest.setting.model)
}

/// Only whole powers of ten are written.
fn whole(value: f64, text: impl Fn(f64) -> String) -> String {
    if (value - value.round()).abs() < 1e-6 { text(value.round()) } else { String::new() }
}

/// Hues that are easy to tell apart, as many as there are names.
fn color(name: &str, names: &[&str]) -> Color32 {
    let at = names.iter().position(|known| *known == name).unwrap_or(0);
    let hue = at as f32 / names.len().max(1) as f32;
    egui::ecolor::Hsva::new(hue, 0.75, if at % 2 == 0 { 1.0 } else { 0.75 }, 1.0).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{Event, PointerButton, Pos2, RawInput, Rect};
    use taw::response::Response;
    use taw_lab::advise::AggregateError;
    use taw_lab::trade::trace::{RunConfig, ScalarType};

    /// A player who clicks everywhere, eight points apart.
    #[test]
    fn a_click_on_a_point_chooses_its_model_and_one_beside_it_nothing() {
        let choice = |name, response, cost, error| {
            let model = Model { response, ..Model::default() };
            let setting = RunConfig { model, number: ScalarType::F32, step: 1.0 / 60.0 };
            Candidate { name, setting, error, whole: AggregateError::default(), cost }
        };
        let candidates = vec![
            choice("cheap", Response::Displacement, 1e-5, 0.1),
            choice("exact", Response::EventDriven, 1e-3, 1e-5),
        ];
        let advice = Advice { candidates, horizon: 1.0, seconds: 1.0, ..Advice::default() };
        let context = egui::Context::default();
        let click = |at: Pos2| {
            let mut chosen = None;
            for pressed in [None, Some(true), Some(false)] {
                let mut events = vec![Event::PointerMoved(at)];
                events.extend(pressed.map(|pressed| Event::PointerButton {
                    pos: at,
                    button: PointerButton::Primary,
                    pressed,
                    modifiers: egui::Modifiers::default(),
                }));
                let screen = Rect::from_min_size(Pos2::ZERO, egui::vec2(400.0, 500.0));
                let input = RawInput { screen_rect: Some(screen), events, ..RawInput::default() };
                let mut output = context.run_ui(input, |ui| {
                    chosen = chart(ui, &advice, Model::default()).or(chosen);
                });
                output.textures_delta.clear();
            }
            chosen
        };
        let places = (0..50 * 50).map(|i| Pos2::new((8 * (i % 50)) as f32, (8 * (i / 50)) as f32));
        let clicks: Vec<_> = places.filter_map(|at| Some((at, click(at)?.response))).collect();
        let middle = |response| {
            let hits: Vec<_> = clicks.iter().filter(|(_, hit)| *hit == response).collect();
            let sum = hits.iter().fold(egui::Vec2::ZERO, |sum, (at, _)| sum + at.to_vec2());
            let middle = (sum / hits.len() as f32).to_pos2();
            assert!((4..=12).contains(&hits.len()), "{hits:?}");
            assert!(hits.iter().all(|(at, _)| at.distance(middle) < 1.5 * REACH), "{hits:?}");
            middle
        };
        // Upper right is better.
        let (cheap, exact) = (middle(Response::Displacement), middle(Response::EventDriven));
        assert!(cheap.x > exact.x + 50.0 && exact.y < cheap.y - 50.0, "{cheap}, {exact}");
    }

    #[test]
    fn figures_have_units_that_suit_them() {
        assert_eq!(metres(0.0123), "1.2 cm");
        assert_eq!(metres(10_f64.powf(-3.0)), "1.0 mm");
        assert_eq!(metres(0.0), "0.0 nm");
        assert_eq!(seconds(0.016), "16 ms");
        assert_eq!(seconds(2.34e-6), "2.3 µs");
    }
}
