//! egui panels for any game: put these into a window of your own. They read and
//! change the resources of the plugin, and know nothing of the game.
//!
//! ```
//! # use bevy::prelude::*;
//! # use bevy_taw::prelude::*;
//! # use bevy_egui::{EguiContexts, EguiPrimaryContextPass, egui};
//! # fn main() {
//! fn panel(mut contexts: EguiContexts, mut model: ResMut<TawModel>) -> Result {
//!     egui::Window::new("Physics").show(contexts.ctx_mut()?, |ui| {
//!         bevy_taw::debug_ui::model(ui, &mut model);
//!     });
//!     Ok(())
//! }
//! # App::new().add_systems(EguiPrimaryContextPass, panel);
//! # }
//! ```

mod inspect;
#[cfg(feature = "trade")]
mod trade;

pub use inspect::{Inspected, collider, layers, sensors};
#[cfg(feature = "trade")]
pub use trade::trade;

use bevy::diagnostic::{Diagnostic, DiagnosticPath, DiagnosticsStore};
use bevy::prelude::*;
use bevy_egui::egui::{self, Ui};
use egui_plot::{Legend, Line, Plot, PlotPoints};
use taw::motion::{Integrator, Rotation};
use taw::response::{ContactLaw, Response};
use taw::swarm::{SwarmModel, Tier};
use taw::world::{Detection, Precision};

use crate::diagnostics as paths;
use crate::ignored::IgnoredComponents;
use crate::resources::{Gravity, TawModel};
use crate::swarm::TawSwarmModel;

/// The choice of methods. Marks the resource as changed only if the user changes
/// something.
pub fn model(ui: &mut Ui, model: &mut ResMut<TawModel>) {
    let mut chosen = ***model;
    egui::Grid::new("taw model").num_columns(2).show(ui, |ui| {
        choice(ui, "Integrator", &mut chosen.integrator, &Integrator::ALL, integrator_name);
        let responses = [
            Response::Displacement,
            Response::Impulse,
            Response::Penalty(ContactLaw::SpringDashpot),
            Response::Penalty(ContactLaw::HertzMindlin),
            Response::EventDriven,
            Response::SoftStep,
        ];
        choice(ui, "Response", &mut chosen.response, &responses, response_name);
        let rotations = [Rotation::None, Rotation::Rolling, Rotation::Dynamic];
        choice(ui, "Rotation", &mut chosen.rotation, &rotations, rotation_name);
        let precisions = [Precision::Plain, Precision::Compensated];
        choice(ui, "Precision", &mut chosen.precision, &precisions, precision_name);
        let detections = [Detection::Discrete, Detection::Swept];
        choice(ui, "Detection", &mut chosen.detection, &detections, detection_name);
        ui.label("Substeps");
        ui.add(egui::Slider::new(&mut chosen.substeps, 1..=16));
        ui.end_row();
        ui.label("Iterations");
        let used = match chosen.response {
            Response::SoftStep => false,
            Response::Penalty(_) => chosen.detection == Detection::Swept,
            Response::Displacement | Response::Impulse | Response::EventDriven => true,
        };
        ui.add_enabled(used, egui::Slider::new(&mut chosen.iterations, 1..=64));
        ui.end_row();
    });
    model.set_if_neq(TawModel(chosen));
}

/// Components and settings that have no effect, if there are any.
pub fn ignored(ui: &mut Ui, ignored: &IgnoredComponents) {
    if !ignored.is_empty() {
        let names = ignored.join(", ");
        ui.colored_label(ui.visuals().warn_fg_color, format!("Without effect: {names}"));
    }
}

/// A row with a name and a box to choose from.
fn choice<T: Copy + PartialEq>(
    ui: &mut Ui,
    name: &str,
    chosen: &mut T,
    all: &[T],
    label: fn(T) -> &'static str,
) {
    ui.label(name);
    egui::ComboBox::from_id_salt(name).selected_text(label(*chosen)).show_ui(ui, |ui| {
        for value in all {
            ui.selectable_value(chosen, *value, label(*value));
        }
    });
    ui.end_row();
}

/// A slider for how strong gravity is, from none to that of Jupiter. Its direction
/// stays.
pub fn gravity(ui: &mut Ui, gravity: &mut ResMut<Gravity>) {
    let direction = gravity.try_normalize().unwrap_or(Vec3::NEG_Y);
    let mut strength = gravity.length();
    let slider = egui::Slider::new(&mut strength, 0.0..=25.0).suffix(" m/s²").text("Gravity");
    if ui.add(slider).changed() {
        gravity.0 = direction * strength;
    }
}

/// Numbers of marbles and contacts.
pub fn counts(ui: &mut Ui, diagnostics: &DiagnosticsStore) {
    egui::Grid::new("taw counts").num_columns(2).show(ui, |ui| {
        for (name, path) in [
            ("Marbles", paths::MARBLES),
            ("Wall contacts", paths::WALL_CONTACTS),
            ("Marble contacts", paths::MARBLE_CONTACTS),
        ] {
            ui.label(name);
            ui.monospace(format!("{:.0}", value(diagnostics, &path)));
            ui.end_row();
        }
    });
}

/// The time of a step and its parts, now and over the last steps.
pub fn step_time(ui: &mut Ui, diagnostics: &DiagnosticsStore) {
    let parts = [
        ("Step", paths::STEP_TIME),
        ("Gather", paths::GATHER_TIME),
        ("Integrate", paths::INTEGRATE_TIME),
        ("Contacts", paths::CONTACTS_TIME),
        ("Restitute", paths::RESTITUTE_TIME),
    ];
    egui::Grid::new("taw times").num_columns(2).show(ui, |ui| {
        for (name, path) in parts {
            let smoothed = diagnostics.get(&path).and_then(Diagnostic::smoothed).unwrap_or(0.0);
            ui.label(name);
            ui.monospace(format!("{smoothed:.3} ms"));
            ui.end_row();
        }
    });
    time_plot(ui, "taw step time", "ms", |plot| {
        for (name, path) in [("Step", paths::STEP_TIME), ("Contacts", paths::CONTACTS_TIME)] {
            if let Some(diagnostic) = diagnostics.get(&path) {
                plot.line(Line::new(name, points(diagnostic.values())));
            }
        }
    });
}

/// Energy and momentum over the last ten seconds. Measures them while it is shown.
pub fn energy(ui: &mut Ui, diagnostics: &mut DiagnosticsStore) {
    paths::enable_energy(diagnostics, true);
    let lines = [
        ("Potential", paths::POTENTIAL_ENERGY),
        ("Kinetic", paths::KINETIC_ENERGY),
        ("Rotational", paths::ROTATIONAL_ENERGY),
    ];
    time_plot(ui, "taw energy", "J", |plot| {
        let history = |path| diagnostics.get(path).map(Diagnostic::values);
        for (name, path) in &lines {
            if let Some(values) = history(path) {
                plot.line(Line::new(*name, points(values)));
            }
        }
        let [potential, kinetic, spin] = lines.each_ref().map(|(_, path)| history(path));
        if let (Some(potential), Some(kinetic), Some(spin)) = (potential, kinetic, spin) {
            let sums = potential.zip(kinetic).zip(spin).map(|((p, k), s)| p + k + s);
            let sums: Vec<f64> = sums.collect();
            plot.line(Line::new("Total", points(sums.iter())));
        }
    });
    time_plot(ui, "taw momentum", "kg m/s", |plot| {
        if let Some(momentum) = diagnostics.get(&paths::MOMENTUM) {
            plot.line(Line::new("Momentum", points(momentum.values())));
        }
    });
}

/// Energy audit of the last steps, and the error of the method. Measured while it is shown.
pub fn accuracy(ui: &mut Ui, diagnostics: &mut DiagnosticsStore) {
    paths::enable_energy_audit(diagnostics, true);
    // Of a second at the usual sixty steps, for one step shows next to nothing.
    let sum = |path: &DiagnosticPath| {
        let recent = diagnostics.get(path).map(|figure| {
            let skipped = figure.values().count().saturating_sub(60);
            figure.values().skip(skipped).copied()
        });
        recent.into_iter().flatten()
    };
    egui::Grid::new("taw accuracy").num_columns(2).show(ui, |ui| {
        for (name, path, help) in [
            ("Friction took", paths::FRICTION_LOSS, "What sliding turned into heat"),
            ("Restitution took", paths::RESTITUTION_LOSS, "What collisions took"),
            ("Resistance took", paths::RESISTANCE_LOSS, "Rolling and spinning resistance"),
            ("The solver took", paths::SOLVER_LOSS, "What no law of physics asked for"),
            ("Walls brought", paths::WALL_WORK, "What moving walls did"),
            ("Forces brought", paths::FORCE_WORK, "Force fields, pushes and damping"),
        ] {
            ui.label(name).on_hover_text(help);
            ui.monospace(format!("{:+.2e} J", sum(&path).sum::<f64>()));
            ui.end_row();
        }
        for (name, path, unit) in [
            ("Momentum from nowhere", paths::MOMENTUM_RESIDUAL, " kg m/s"),
            ("Deepest contact", paths::MAX_PENETRATION, " m"),
        ] {
            ui.label(name);
            ui.monospace(format!("{:.2e}{unit}", sum(&path).fold(0.0, f64::max)));
            ui.end_row();
        }
        ui.label("Collisions");
        ui.monospace(format!("{:.0}", sum(&paths::COLLISIONS).sum::<f64>()));
        ui.end_row();
    });
    ui.weak("Over the last 60 steps");
    time_plot(ui, "taw losses", "J a step", |plot| {
        for (name, path) in [
            ("Friction", &paths::FRICTION_LOSS),
            ("Restitution", &paths::RESTITUTION_LOSS),
            ("Solver", &paths::SOLVER_LOSS),
        ] {
            if let Some(figure) = diagnostics.get(path) {
                plot.line(Line::new(name, points(figure.values())));
            }
        }
    });
}

/// Values one after the other.
fn points<'a>(values: impl Iterator<Item = &'a f64>) -> PlotPoints<'static> {
    (0_u32..).zip(values).map(|(i, value)| [f64::from(i), *value]).collect()
}

/// A plot over the last steps.
fn time_plot(ui: &mut Ui, id: &str, unit: &str, draw: impl FnOnce(&mut egui_plot::PlotUi)) {
    Plot::new(id)
        .height(120.0)
        .include_y(0.0)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .y_axis_label(unit)
        .show_x(false)
        .legend(Legend::default())
        .show(ui, draw);
}

/// Settings of the model of swarms.
pub fn swarm_model(ui: &mut Ui, model: &mut ResMut<TawSwarmModel>) {
    let mut chosen = model.0;
    ui.horizontal(|ui| {
        ui.label("Tier");
        let lab = "Lines and displacement only";
        ui.selectable_value(&mut chosen.tier, Tier::Lab, "Lab").on_hover_text(lab);
        let full = "Masses, friction, restitution and spin";
        ui.selectable_value(&mut chosen.tier, Tier::Full, "Full").on_hover_text(full);
    });
    ui.add(egui::Slider::new(&mut chosen.substeps, 1..=8).text("substeps"));
    let machine = std::thread::available_parallelism().map_or(1, |count| count.get() as u32);
    let most = machine.min(SwarmModel::MAX_THREADS).max(chosen.threads);
    let threads = egui::Slider::new(&mut chosen.threads, 0..=most).text("threads");
    ui.add(threads).on_hover_text("0: as many as pay");
    if chosen.tier == Tier::Full {
        ui.add(egui::Slider::new(&mut chosen.material.friction, 0.0..=1.0).text("friction"));
        let restitution = egui::Slider::new(&mut chosen.material.restitution, 0.0..=1.0);
        ui.add(restitution.text("restitution"));
        ui.checkbox(&mut chosen.sleeps, "What lies still falls asleep");
    }
    if chosen != model.0 {
        model.0 = chosen;
    }
}

/// Cost of a swarm's step, part by part.
pub fn swarm_time(ui: &mut Ui, diagnostics: &DiagnosticsStore) {
    let marbles = value(diagnostics, &paths::SWARM_MARBLES);
    let step = diagnostics.get(&paths::SWARM_TIME).and_then(Diagnostic::average).unwrap_or(0.0);
    ui.label(format!("{marbles} marbles, {} asleep", value(diagnostics, &paths::SWARM_ASLEEP)));
    let each = step * 1e6 / marbles.max(1.0);
    ui.label(format!("a step takes {step:.2} ms, {each:.0} ns for each"));
    time_plot(ui, "taw swarm time", "ms", |plot| {
        for (name, path) in [
            ("Step", &paths::SWARM_TIME),
            ("Restitute", &paths::SWARM_RESTITUTE_TIME),
            ("Pairs", &paths::SWARM_PAIRS_TIME),
            ("Order", &paths::SWARM_ORDER_TIME),
            ("Integrate", &paths::SWARM_INTEGRATE_TIME),
        ] {
            if let Some(time) = diagnostics.get(path) {
                plot.line(Line::new(name, points(time.values())));
            }
        }
    });
}

/// Switches of the gizmos, and sizes of those that have one.
#[cfg(feature = "render")]
pub fn gizmos(ui: &mut Ui, store: &mut GizmoConfigStore) {
    let (_, config) = store.config_mut::<crate::gizmos::TawGizmos>();
    ui.checkbox(&mut config.contacts, "Contacts");
    ui.checkbox(&mut config.normals, "Normals");
    ui.checkbox(&mut config.velocities, "Velocities");
    ui.checkbox(&mut config.walls, "Walls");
    ui.checkbox(&mut config.sensors, "Sensors");
    ui.checkbox(&mut config.sleepers, "Sleepers");
    ui.checkbox(&mut config.grid, "Grid");
    ui.add_enabled(
        config.normals,
        egui::Slider::new(&mut config.normal_length, 0.01..=2.0).suffix(" m").text("normals"),
    );
    ui.add_enabled(
        config.velocities,
        egui::Slider::new(&mut config.velocity_scale, 0.01..=1.0).suffix(" s").text("velocities"),
    );
}

fn value(diagnostics: &DiagnosticsStore, path: &DiagnosticPath) -> f64 {
    diagnostics.get(path).and_then(Diagnostic::value).unwrap_or(0.0)
}

fn integrator_name(integrator: Integrator) -> &'static str {
    match integrator {
        Integrator::ExplicitEuler => "Explicit Euler",
        Integrator::SemiImplicitEuler => "Semi-implicit Euler",
        Integrator::VelocityVerlet => "Velocity Verlet",
        Integrator::Leapfrog => "Leapfrog",
        Integrator::Rk4 => "Runge–Kutta 4",
    }
}

fn rotation_name(rotation: Rotation) -> &'static str {
    match rotation {
        Rotation::None => "None",
        Rotation::Rolling => "Rolling",
        Rotation::Dynamic => "Dynamic",
    }
}

fn response_name(response: Response) -> &'static str {
    match response {
        Response::Displacement => "Displacement",
        Response::Impulse => "Impulse",
        Response::Penalty(ContactLaw::SpringDashpot) => "Penalty: spring–dashpot",
        Response::Penalty(ContactLaw::HertzMindlin) => "Penalty: Hertz–Mindlin",
        Response::EventDriven => "Event-driven",
        Response::SoftStep => "Soft step",
    }
}

fn detection_name(detection: Detection) -> &'static str {
    match detection {
        Detection::Discrete => "Discrete",
        Detection::Swept => "Swept",
    }
}

fn precision_name(precision: Precision) -> &'static str {
    match precision {
        Precision::Plain => "Plain",
        Precision::Compensated => "Compensated",
    }
}
