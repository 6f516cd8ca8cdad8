//! Settings to change while it runs, and their cost.

use bevy::diagnostic::{Diagnostic, DiagnosticsStore, FrameTimeDiagnosticsPlugin};
use bevy::prelude::*;
use bevy_egui::{EguiContexts, EguiPrimaryContextPass, egui};
use bevy_taw::debug_ui;
use bevy_taw::prelude::*;

use crate::scene::{Pour, RADII};

pub fn plugin(app: &mut App) {
    app.add_systems(EguiPrimaryContextPass, panel);
}

fn panel(
    mut contexts: EguiContexts,
    mut pour: ResMut<Pour>,
    mut model: ResMut<TawSwarmModel>,
    diagnostics: Res<DiagnosticsStore>,
) -> Result {
    let window = egui::Window::new("A million marbles").default_pos([10.0, 10.0]);
    window.default_width(280.0).show(contexts.ctx_mut()?, |ui| {
        let mut count = pour.count;
        let slider = egui::Slider::new(&mut count, 1_000..=2_000_000).logarithmic(true);
        let changed = ui.add(slider.text("marbles").update_while_editing(false)).changed();
        if changed || ui.button("Pour anew (Space)").clicked() {
            (pour.count, pour.again) = (count, true);
        }
        ui.horizontal(|ui| {
            ui.label("Colour");
            let size = Tint::Size(*RADII.start(), *RADII.end());
            let mut tint = pour.tint;
            for (name, choice) in
                [("speed", Tint::Speed(6.0)), ("size", size), ("each its own", Tint::Id)]
            {
                ui.selectable_value(&mut tint, choice, name);
            }
            if tint != pour.tint {
                pour.tint = tint;
            }
        });
        ui.separator();
        debug_ui::swarm_model(ui, &mut model);
        ui.separator();
        let frames = diagnostics.get(&FrameTimeDiagnosticsPlugin::FPS);
        let frames = frames.and_then(Diagnostic::smoothed).unwrap_or(0.0);
        ui.label(format!("{frames:.0} frames per second"));
        debug_ui::swarm_time(ui, &diagnostics);
        ui.weak("Arrows or WASD tilt, right drag turns the view");
    });
    Ok(())
}
