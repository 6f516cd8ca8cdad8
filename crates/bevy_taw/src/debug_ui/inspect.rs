//! Panels of what is in the world: layers, sensors, and a collider that was picked.

use std::collections::BTreeMap;
use std::fmt::Display;

use bevy::ecs::name::NameOrEntity;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy_egui::egui::{self, Ui};
use taw::response::Material;
use taw::shape::Shape;
use taw::world::{Mass, WallShape};

use crate::components::{Marble, MarbleState, WallState};
use crate::convert::{from_point, from_vector};
use crate::layers::{CollisionLayers, LayerMask};
use crate::resources::TawWorld;
use crate::sensor::{CollidingBalls, CollidingEntities, Sensor};
use crate::swarm::Swarm;
use crate::wall::Wall;

/// Most groups, and most marbles and bodies of a sensor, that are listed; of the others, the number is.
const MOST: usize = 12;

/// World and components that the panels [`layers`], [`sensors`] and [`collider`] read.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::debug_ui::{self, Inspected};
/// # use bevy_egui::{EguiContexts, EguiPrimaryContextPass, egui};
/// # fn main() {
/// fn panel(mut contexts: EguiContexts, inspected: Inspected) -> Result {
///     egui::Window::new("Layers").show(contexts.ctx_mut()?, |ui| {
///         debug_ui::layers(ui, &inspected, &["floor", "player", "ghost"]);
///         debug_ui::sensors(ui, &inspected);
///     });
///     Ok(())
/// }
/// # App::new().add_systems(EguiPrimaryContextPass, panel);
/// # }
/// ```
#[derive(SystemParam)]
pub struct Inspected<'w, 's> {
    world: Res<'w, TawWorld>,
    names: Query<'w, 's, NameOrEntity>,
    users: Query<'w, 's, LayerUser, Or<(With<Marble>, With<Wall>, With<Swarm>)>>,
    sensors: Query<'w, 's, SensorContent, With<Sensor>>,
    marbles: Query<'w, 's, &'static MarbleState>,
    walls: Query<'w, 's, &'static WallState>,
}

type LayerUser = (Option<&'static CollisionLayers>, Has<Marble>, Has<Swarm>, Has<Sensor>);
type SensorContent = (Entity, &'static CollidingEntities, &'static CollidingBalls);

impl Inspected<'_, '_> {
    /// Name of an entity, or its number.
    fn name(&self, entity: Entity) -> String {
        self.names.get(entity).map_or_else(|_| entity.to_string(), |name| name.to_string())
    }

    /// Layers that are in use, with the numbers of marbles, walls, sensors and swarms that have them.
    fn groups(&self) -> Vec<(CollisionLayers, [usize; 4])> {
        let mut groups = BTreeMap::new();
        for (layers, is_marble, is_swarm, is_sensor) in &self.users {
            let layers = layers.copied().unwrap_or_default();
            let kind = match () {
                () if is_marble => 0,
                () if is_swarm => 3,
                () => 1 + usize::from(is_sensor),
            };
            let key = (layers.memberships.0, layers.filters.0);
            groups.entry(key).or_insert((layers, [0; 4])).1[kind] += 1;
        }
        groups.into_values().collect()
    }
}

/// Matrix of who meets whom: a row and a column for all that have the same [`CollisionLayers`]. Layers have
/// these names, in the order of their bits, or else numbers.
pub fn layers(ui: &mut Ui, inspected: &Inspected, names: &[&str]) {
    let mut groups = inspected.groups();
    let more = groups.len().saturating_sub(MOST);
    groups.truncate(MOST);
    egui::Grid::new("taw layers").striped(true).show(ui, |ui| {
        ui.label("");
        for number in 1..=groups.len() {
            ui.monospace(number.to_string());
        }
        ui.end_row();
        for (number, (own, counts)) in (1..).zip(&groups) {
            let label = format!("{number} {}", layer_names(own.memberships, names));
            ui.label(label).on_hover_text(counted(counts));
            for (other, _) in &groups {
                let meets = own.interacts_with(*other);
                let (with, mark) =
                    (layer_names(other.memberships, names), if meets { "x" } else { "–" });
                let verb = if meets { "meets" } else { "does not meet" };
                ui.monospace(mark).on_hover_text(format!("{verb} {with}"));
            }
            ui.end_row();
        }
    });
    if more > 0 {
        ui.weak(format!("and {more} more"));
    }
}

/// Sensors, and who is inside of each.
pub fn sensors(ui: &mut Ui, inspected: &Inspected) {
    let mut all: Vec<_> = inspected.sensors.iter().collect();
    all.sort_unstable_by_key(|(sensor, ..)| *sensor);
    if all.is_empty() {
        ui.weak("No sensors");
    }
    for (sensor, inside, balls) in all {
        let (count, ball_count) = (inside.len(), balls.len());
        let name = inspected.name(sensor);
        ui.label(format!("{name}: {count} marbles and bodies, {ball_count} balls"));
        if !inside.is_empty() {
            let listed = inside.iter().take(MOST).map(|entity| inspected.name(*entity));
            let rest = count.saturating_sub(MOST);
            let more = (rest > 0).then(|| format!("and {rest} more"));
            ui.weak(listed.chain(more).collect::<Vec<_>>().join(", "));
        }
    }
}

/// Properties of a marble or wall that was picked, as the physics has them.
pub fn collider(ui: &mut Ui, inspected: &Inspected, entity: Entity, layer_names: &[&str]) {
    let world = &*inspected.world;
    let marble = inspected.marbles.get(entity).ok().and_then(|state| state.id);
    let wall = inspected.walls.get(entity).ok().and_then(|state| state.id);
    ui.strong(inspected.name(entity));
    egui::Grid::new("taw collider").num_columns(2).striped(true).show(ui, |ui| {
        if let Some(id) = marble
            && let Ok(marble) = world.marbles.get(id)
        {
            let sleeps = world.is_asleep(id) == Ok(true);
            rows_of_marble(ui, &marble);
            row(ui, "Sleeps", if sleeps { "yes" } else { "no" });
            material(ui, marble.material, "the default");
            rows_of_layers(ui, marble.layers, layer_names);
        } else if let Some(id) = wall
            && let (Ok(shape), Ok(made_of)) = (world.walls.get(id), world.walls.material(id))
        {
            row(ui, "Shape", shape_name(shape));
            material(ui, made_of, "the marble's");
            rows_of_layers(ui, world.walls.layers(id).unwrap_or_default(), layer_names);
        } else {
            ui.weak("no marble or wall of the world");
            ui.end_row();
        }
    });
}

fn rows_of_marble(ui: &mut Ui, marble: &taw::world::Marble<f32>) {
    row(ui, "Radius", format!("{} m", marble.radius));
    if marble.half_length > 0.0 {
        row(ui, "Half length", format!("{} m", marble.half_length));
    }
    row(
        ui,
        "Mass",
        match marble.mass {
            Mass::Density(density) => format!("{density} kg/m³"),
            Mass::Kilograms(mass) => format!("{mass} kg"),
            Mass::Infinite => "infinite".into(),
        },
    );
    row(ui, "Position", format!("{:.3} m", from_point(marble.position)));
    row(ui, "Velocity", format!("{:.3} m/s", from_vector(marble.velocity)));
    row(ui, "Spin", format!("{:.3} rad/s", from_vector(marble.angular_velocity)));
    row(ui, "Gravity scale", marble.gravity_scale);
    let taw::world::Damping { linear, angular } = marble.damping;
    row(ui, "Damping", format!("{linear}, of spin {angular} 1/s"));
    row(ui, "Locked axes", format!("{:06b} (rotation, motion: z y x)", marble.locked_axes.bits()));
}

/// Rows of a material, or the name of what counts without one.
fn material(ui: &mut Ui, material: Option<Material<f32>>, without: &str) {
    let Some(it) = material else { return row(ui, "Material", without) };
    row(ui, "Restitution", it.restitution);
    row(ui, "Friction", it.friction);
    row(ui, "Rolling resistance", it.rolling_resistance);
    row(ui, "Spinning resistance", it.spinning_resistance);
}

fn rows_of_layers(ui: &mut Ui, layers: taw::broad::CollisionLayers, names: &[&str]) {
    row(ui, "Layers", layer_names(LayerMask(layers.memberships), names));
    row(ui, "Meets", layer_names(LayerMask(layers.filters), names));
}

fn row(ui: &mut Ui, name: &str, value: impl Display) {
    ui.label(name);
    ui.label(value.to_string());
    ui.end_row();
}

fn shape_name(shape: &WallShape<f32>) -> &'static str {
    match shape {
        WallShape::Plane(_) => "half-space",
        WallShape::Solid(Shape::Sphere(_)) => "sphere",
        WallShape::Solid(Shape::Aabb(_) | Shape::Obb(_)) => "box",
        WallShape::Solid(Shape::Capsule(_)) => "capsule",
        WallShape::Solid(Shape::Hull(_)) => "convex hull",
        WallShape::Solid(Shape::Compound(_)) => "compound",
        WallShape::Mesh(..) => "triangle mesh",
        WallShape::HeightField(..) => "height field",
    }
}

/// Names of the layers of a mask.
fn layer_names(mask: LayerMask, names: &[&str]) -> String {
    match mask {
        LayerMask::ALL => "all".into(),
        LayerMask::NONE => "none".into(),
        LayerMask(bits) => {
            let used = (0..32_usize).filter(|bit| bits & (1 << bit) != 0);
            let name = |bit: usize| match names.get(bit) {
                Some(name) => String::from(*name),
                None => format!("layer {bit}"),
            };
            used.map(name).collect::<Vec<_>>().join(", ")
        }
    }
}

/// Numbers of marbles, walls, sensors and swarms, of which there are some.
fn counted(counts: &[usize; 4]) -> String {
    let kinds = ["marbles", "walls", "sensors", "swarms"];
    let some = counts.iter().zip(kinds).filter(|(count, _)| **count > 0);
    some.map(|(count, kind)| format!("{count} {kind}")).collect::<Vec<_>>().join(", ")
}
