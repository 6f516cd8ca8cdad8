//! The panels: everything that can be changed while the game runs, and what it
//! costs.

use bevy::diagnostic::DiagnosticsStore;
use bevy::prelude::*;
use bevy_egui::egui::{self, Align2, Context, Ui};
use bevy_egui::{EguiContexts, EguiPrimaryContextPass};
use bevy_taw::debug_ui;
use bevy_taw::governor::Governor;
use bevy_taw::prelude::*;
use bevy_taw::trade::TawTrade;

use crate::Options;
use crate::board::{MadeOfBoxes, Tilt};
use crate::controls::{Action, HELP, just_pressed};
use crate::goals::Score;
use crate::inspect::Inspector;
use crate::marbles::{Bag, Order};
use crate::time::SingleStep;

/// Which panels are open.
#[derive(Resource)]
struct Open {
    panels: bool,
    help: bool,
    /// Number of marbles that the button drops.
    drop: u32,
    trade: bool,
}

pub fn plugin(app: &mut App) {
    if app.world().resource::<Options>().gizmos {
        app.add_systems(Startup, |mut store: ResMut<GizmoConfigStore>| {
            let (_, draw) = store.config_mut::<TawGizmos>();
            (draw.contacts, draw.normals, draw.velocities, draw.grid) = (true, true, true, true);
        });
    }
    let measures = app.world().resource::<Options>().trade;
    if measures {
        app.add_systems(Update, measure.run_if(once_after(1.0)));
    }
    app.insert_resource(Open { panels: true, help: false, drop: 100, trade: measures })
        .add_systems(
            Update,
            (
                (|mut open: ResMut<Open>| open.panels = !open.panels)
                    .run_if(just_pressed(Action::Panels)),
                (|mut open: ResMut<Open>| open.help = !open.help)
                    .run_if(just_pressed(Action::Help)),
            ),
        )
        .add_systems(
            EguiPrimaryContextPass,
            (panels, trade, scoreboard, help, give_back_keys).chain(),
        );
}

/// Once, when the game has gone on for so many seconds.
fn once_after(seconds: f32) -> impl FnMut(Res<Time<Virtual>>, Local<bool>) -> bool + Clone {
    move |time, mut done| {
        let now = !*done && time.elapsed_secs() >= seconds;
        *done |= now;
        now
    }
}

fn measure(mut trade: ResMut<TawTrade>, mut world: ResMut<TawWorld>, fixed: Res<Time<Fixed>>) {
    trade.measure(&mut world, fixed.timestep());
}

#[expect(clippy::too_many_arguments, reason = "a Bevy system")]
fn panels(
    mut contexts: EguiContexts,
    (mut open, mut inspector): (ResMut<Open>, ResMut<Inspector>),
    mut bag: ResMut<Bag>,
    mut tilt: ResMut<Tilt>,
    mut score: ResMut<Score>,
    mut physics: (ResMut<TawModel>, ResMut<Gravity>, ResMut<MadeOfBoxes>, Res<IgnoredComponents>),
    mut time: ResMut<Time<Virtual>>,
    mut orders: MessageWriter<Order>,
    mut steps: MessageWriter<SingleStep>,
    mut gizmos: ResMut<GizmoConfigStore>,
    mut diagnostics: ResMut<DiagnosticsStore>,
) -> Result {
    if !open.panels {
        return Ok(());
    }
    let window = egui::Window::new("Marble Madness").default_pos([10.0, 10.0]).default_width(270.0);
    window.vscroll(true).default_height(660.0).show(contexts.ctx_mut()?, |ui| {
        section(ui, "Marbles", true, |ui| marbles(ui, &mut open, &mut bag, &mut orders));
        section(ui, "Time", true, |ui| game_time(ui, &mut time, &mut orders, &mut steps));
        section(ui, "Physics", true, |ui| {
            debug_ui::model(ui, &mut physics.0);
            debug_ui::ignored(ui, &physics.3);
            debug_ui::gravity(ui, &mut physics.1);
            let mut degrees = tilt.limit.to_degrees();
            let slider = egui::Slider::new(&mut degrees, 0.0..=45.0).suffix("°").text("Tilt limit");
            if ui.add(slider).changed() {
                tilt.limit = degrees.to_radians();
            }
            let mut boxes = physics.2.0;
            if ui.checkbox(&mut boxes, "The board is made of boxes").changed() {
                physics.2.0 = boxes;
            }
            let mut plays = !score.paused;
            if ui.checkbox(&mut plays, "Pads take marbles of their colour").changed() {
                score.paused = !plays;
            }
        });
        ui.toggle_value(&mut open.trade, "What each model costs and buys…");
        ui.toggle_value(&mut inspector.is_open, "A marble, sensors, layers…");
        section(ui, "Step", true, |ui| {
            debug_ui::counts(ui, &diagnostics);
            debug_ui::step_time(ui, &diagnostics);
        });
        let energy = section(ui, "Energy", false, |ui| debug_ui::energy(ui, &mut diagnostics));
        bevy_taw::diagnostics::enable_energy(&mut diagnostics, energy);
        let account = section(ui, "Accuracy", false, |ui| debug_ui::accuracy(ui, &mut diagnostics));
        bevy_taw::diagnostics::enable_energy_audit(&mut diagnostics, account);
        section(ui, "Draw", false, |ui| debug_ui::gizmos(ui, &mut gizmos));
        ui.separator();
        ui.weak("F1 lists all keys, Tab hides the panels");
    });
    Ok(())
}

fn trade(
    mut contexts: EguiContexts,
    mut open: ResMut<Open>,
    mut trade: ResMut<TawTrade>,
    mut world: ResMut<TawWorld>,
    mut model: ResMut<TawModel>,
    mut governor: ResMut<Governor>,
    fixed: Res<Time<Fixed>>,
) -> Result {
    let mut shown = open.trade;
    egui::Window::new("Trade")
        .open(&mut shown)
        .default_pos([860.0, 60.0])
        .default_width(390.0)
        .show(contexts.ctx_mut()?, |ui| {
            let step = fixed.timestep();
            debug_ui::trade(ui, &mut trade, &mut world, &mut model, &mut governor, step);
        });
    open.trade = shown;
    Ok(())
}

/// A part of the panel that can be folded, and whether it is open at first; gives whether it is
/// now.
fn section(ui: &mut Ui, title: &str, open: bool, content: impl FnOnce(&mut Ui)) -> bool {
    egui::CollapsingHeader::new(title).default_open(open).show(ui, content).body_returned.is_some()
}

fn marbles(ui: &mut Ui, open: &mut Open, bag: &mut Bag, orders: &mut MessageWriter<Order>) {
    let count = egui::Slider::new(&mut open.drop, 1..=10_000).logarithmic(true);
    ui.add(count.text("marbles"));
    let sizes = 0.05..=1.5;
    ui.add(egui::Slider::new(&mut bag.smallest, sizes.clone()).suffix(" m").text("smallest"));
    ui.add(egui::Slider::new(&mut bag.largest, sizes).suffix(" m").text("largest"));
    bag.largest = bag.largest.max(bag.smallest);
    ui.checkbox(&mut bag.capsules, "Capsules")
        .on_hover_text("Every response but the event-driven one knows them");
    ui.horizontal(|ui| {
        if ui.button("Drop").clicked() {
            orders.write(Order::Drop(open.drop));
        }
        if ui.button("Clear").clicked() {
            orders.write(Order::Clear);
        }
    });
}

fn game_time(
    ui: &mut Ui,
    time: &mut Time<Virtual>,
    orders: &mut MessageWriter<Order>,
    steps: &mut MessageWriter<SingleStep>,
) {
    ui.horizontal(|ui| {
        let mut paused = time.is_paused();
        if ui.toggle_value(&mut paused, "Pause").changed() {
            crate::time::set_paused(time, paused);
        }
        if ui.add_enabled(time.is_paused(), egui::Button::new("Step")).clicked() {
            steps.write(SingleStep);
        }
        let mut slow = crate::time::is_slow(time);
        if ui.toggle_value(&mut slow, "Slow motion").changed() {
            crate::time::set_slow(time, slow);
        }
        if ui.button("Reset").clicked() {
            orders.write(Order::Reset);
        }
    });
}

/// Always in sight: how the game stands.
fn scoreboard(
    mut contexts: EguiContexts,
    score: Res<Score>,
    marbles: Query<(), With<Marble>>,
) -> Result {
    if score.paused {
        return Ok(());
    }
    let left = marbles.iter().count();
    let clock = format!("{}:{:04.1}", score.seconds as u32 / 60, score.seconds % 60.0);
    let text = if left == 0 && score.home > 0 {
        format!("All {} home in {clock}!", score.home)
    } else {
        format!("{} home   {left} to go   {clock}", score.home)
    };
    egui::Area::new("score".into())
        .anchor(Align2::CENTER_TOP, [0.0, 12.0])
        .interactable(false)
        .show(contexts.ctx_mut()?, |ui| {
            egui::Frame::popup(ui.style()).show(ui, |ui| {
                ui.add(egui::Label::new(egui::RichText::new(text).heading()).extend());
            });
        });
    Ok(())
}

fn help(mut contexts: EguiContexts, mut open: ResMut<Open>) -> Result {
    let mut shown = open.help;
    egui::Window::new("Keys")
        .open(&mut shown)
        .anchor(Align2::RIGHT_TOP, [-10.0, 10.0])
        .resizable(false)
        .show(contexts.ctx_mut()?, |ui| {
            egui::Grid::new("keys").striped(true).show(ui, |ui| {
                for (keys, does) in HELP {
                    ui.strong(keys);
                    ui.label(does);
                    ui.end_row();
                }
            });
        });
    open.help = shown;
    Ok(())
}

/// A slider that was clicked would keep the arrow keys for itself; once the mouse
/// has left the panels, they are the game's again.
fn give_back_keys(mut contexts: EguiContexts) -> Result {
    let context: &Context = contexts.ctx_mut()?;
    if !context.is_pointer_over_egui() && !context.egui_is_using_pointer() {
        context.memory_mut(|memory| {
            if let Some(focused) = memory.focused() {
                memory.surrender_focus(focused);
            }
        });
    }
    Ok(())
}
