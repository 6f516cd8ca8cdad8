//! Panels, drawn without a window.

use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy_egui::egui::{self, Shape, Ui};
use bevy_taw::debug_ui::{self, Inspected};
use bevy_taw::prelude::*;

use crate::scene;

/// Texts that a panel draws, line by line.
fn texts(
    app: &mut App,
    mut panel: impl FnMut(&mut Ui, &Inspected) + Send + Sync + 'static,
) -> Vec<String> {
    fn text(shape: &Shape, found: &mut Vec<String>) {
        match shape {
            Shape::Text(it) => found.push(it.galley.text().to_owned()),
            Shape::Vec(all) => all.iter().for_each(|shape| text(shape, found)),
            _ => {}
        }
    }
    let draw = move |inspected: Inspected| {
        let context = egui::Context::default();
        let mut found = Vec::new();
        for _ in 0..2 {
            // A grid is drawn once it knows its size.
            let input = egui::RawInput {
                screen_rect: Some(egui::Rect::from_min_size(
                    egui::Pos2::ZERO,
                    egui::vec2(900.0, 900.0),
                )),
                ..default()
            };
            let mut output = context.run_ui(input, |ui| panel(ui, &inspected));
            output.textures_delta.clear(); // nobody draws
            found.clear();
            output.shapes.iter().for_each(|it| text(&it.shape, &mut found));
        }
        found
    };
    app.world_mut().run_system_once(draw).unwrap()
}

#[derive(PhysicsLayer)]
enum Layer {
    Floor,
    Player,
    Ghost,
}

const NAMES: &[&str] = &["floor", "player"];

#[test]
fn the_matrix_of_layers_says_who_meets_whom() {
    let mut app = scene::app();
    let floor = CollisionLayers::new(Layer::Floor, LayerMask::ALL);
    app.world_mut().spawn((Wall::default(), floor));
    let player = CollisionLayers::new(Layer::Player, [Layer::Floor, Layer::Player]);
    // It would meet players, who do not meet it.
    let ghost = CollisionLayers::new(Layer::Ghost, LayerMask::ALL);
    for layers in [player, player, ghost] {
        app.world_mut().spawn((Marble::new(0.1), layers));
    }
    app.update();
    let found = texts(&mut app, |ui, inspected| debug_ui::layers(ui, inspected, NAMES));
    let rows = [
        ["1", "2", "3"].as_slice(),
        &["1 floor", "x", "x", "x"],
        &["2 player", "x", "x", "–"],
        &["3 layer 2", "x", "–", "x"],
    ];
    let found: Vec<_> = found.iter().filter(|text| !text.is_empty()).collect();
    assert_eq!(found, rows.concat());
}

#[test]
fn sensors_are_listed_with_who_is_inside() {
    let mut app = scene::app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let none = texts(&mut app, debug_ui::sensors);
    assert_eq!(none, ["No sensors"]);
    let goal = (Wall::from(Cuboid::from_length(4.0)), Sensor, Name::new("Goal"));
    app.world_mut().spawn(goal);
    for (name, x) in [("Red", 0.0), ("Blue", 1.0), ("Far", 9.0)] {
        let place = Transform::from_xyz(x, 0.0, 0.0);
        app.world_mut().spawn((Marble::new(0.1), Name::new(name), place));
    }
    app.world_mut().spawn(Swarm::new(vec![Ball::new(Vec3::Y, 0.1); 1]));
    scene::frames(&mut app, 2);
    let found = texts(&mut app, debug_ui::sensors);
    assert_eq!(found[0], "Goal: 2 marbles and bodies, 1 balls");
    assert!(["Red, Blue", "Blue, Red"].contains(&found[1].as_str()), "{found:?}");
    assert_eq!(found.len(), 2);
}

#[test]
fn a_picked_marble_or_wall_says_what_it_is_made_of() {
    let mut app = scene::app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let marble = scene::drop_marble(&mut app, 0.25, Vec3::Y);
    let clay = SurfaceMaterial { restitution: 0.125, friction: 0.75, ..default() };
    app.world_mut().entity_mut(marble).insert((
        clay,
        MarbleMass::Kilograms(2.0),
        Name::new("Clay"),
        CollisionLayers::new(Layer::Player, LayerMask::ALL),
    ));
    let wall = app.world_mut().spawn(Wall::from(Cuboid::from_length(0.5))).id();
    let nobody = app.world_mut().spawn(Name::new("Nobody")).id();
    app.update();
    let mut of = |entity| {
        texts(&mut app, move |ui, inspected| debug_ui::collider(ui, inspected, entity, NAMES))
    };
    let value = |texts: &[String], name: &str| {
        let at = texts
            .iter()
            .position(|text| text == name)
            .unwrap_or_else(|| panic!("{name}: {texts:?}"));
        texts[at + 1].clone()
    };
    let of_marble = of(marble);
    assert_eq!(of_marble[0], "Clay");
    for (name, expected) in [
        ("Radius", "0.25 m"),
        ("Mass", "2 kg"),
        ("Position", "[0.000, 1.000, 0.000] m"),
        ("Sleeps", "no"),
        ("Restitution", "0.125"),
        ("Friction", "0.75"),
        ("Layers", "player"),
        ("Meets", "all"),
    ] {
        assert_eq!(value(&of_marble, name), expected, "{name}");
    }
    let of_wall = of(wall);
    assert_eq!(value(&of_wall, "Shape"), "box");
    assert_eq!(value(&of_wall, "Material"), "the marble's");
    assert_eq!(of(nobody), ["Nobody", "no marble or wall of the world"]);
}
