//! A window of what is in the world: a marble or wall that was picked, the sensors, the layers.

use bevy::prelude::*;
use bevy_egui::{EguiContexts, EguiPrimaryContextPass, egui};
use bevy_taw::debug_ui::{self, Inspected};
use bevy_taw::prelude::*;
use taw_examples::Pointer;

use crate::Options;
use crate::controls::{Action, just_pressed};

/// State of the window.
#[derive(Resource, Default)]
pub struct Inspector {
    pub is_open: bool,
    /// Marble or wall that is shown, from when one was picked.
    picked: Option<Entity>,
}

pub fn plugin(app: &mut App) {
    let is_open = app.world().resource::<Options>().inspect;
    app.insert_resource(Inspector { is_open, picked: None })
        .add_systems(Update, pick.run_if(just_pressed(Action::Inspect)))
        .add_systems(EguiPrimaryContextPass, window);
}

/// Picks what is under the mouse, or closes the window where nothing is.
fn pick(pointer: Pointer, spatial: SpatialQuery, mut inspector: ResMut<Inspector>) {
    let filter = SpatialQueryFilter::default();
    let hit = pointer.bevy_ray().and_then(|ray| spatial.cast_ray(ray, f32::INFINITY, &filter));
    let picked = hit.map(|hit| hit.entity);
    let is_open = picked.is_some() || !inspector.is_open;
    *inspector = Inspector { is_open, picked: picked.or(inspector.picked) };
}

fn window(
    mut contexts: EguiContexts,
    mut inspector: ResMut<Inspector>,
    inspected: Inspected,
    marbles: Query<Entity, With<Marble>>,
    colliders: Query<(), Or<(With<Marble>, With<Wall>)>>,
) -> Result {
    // One that went home is replaced by any other marble.
    let picked = inspector.picked.filter(|entity| colliders.contains(*entity));
    let shown = picked.or_else(|| marbles.iter().min());
    egui::Window::new("Inspector")
        .open(&mut inspector.is_open)
        .default_pos([1005.0, 60.0])
        .default_width(260.0)
        .show(contexts.ctx_mut()?, |ui| {
            if let Some(entity) = shown {
                debug_ui::collider(ui, &inspected, entity, &[]);
            }
            ui.weak("I picks what is under the mouse");
            ui.separator();
            ui.strong("Sensors");
            debug_ui::sensors(ui, &inspected);
            ui.separator();
            ui.strong("Layers: who meets whom");
            debug_ui::layers(ui, &inspected, &[]);
        });
    Ok(())
}
