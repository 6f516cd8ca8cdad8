//! Components that were set in Blender: a glTF file has them in the extras of its nodes, as the add-on Skein
//! writes them, and `bevy_skein` 0.6 inserts them by their type paths (`ReflectDeserializer`, `insert_reflect`).
//! Here the same is done to the nodes of a file, without Bevy's glTF loader, which the workspace does without.

use bevy::asset::AssetPlugin;
use bevy::ecs::reflect::ReflectCommandExt;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::reflect::serde::ReflectDeserializer;
use bevy_taw::prelude::*;
use serde::de::DeserializeSeed;
use serde_json::Value;

use crate::scene;

/// Nodes of a glTF file: a floor and a pin that are walls, a board of which the mesh is a wall, and marbles.
const NODES: &str = r#"[
    {
        "name": "Floor",
        "translation": [0, -2, 0],
        "extras": { "skein": [
            { "bevy_taw::wall::Wall": { "HalfSpace": [0, 1, 0] } },
            { "bevy_taw::components::SurfaceMaterial": {
                "restitution": 0.0, "friction": 0.5, "tangential_restitution": 0.0,
                "rolling_resistance": 0.01, "spinning_resistance": 0.01,
                "elasticity": [1e7, 0.25], "combine": "Average"
            } }
        ] }
    },
    {
        "name": "Board",
        "mesh": 0,
        "scale": [4, 1, 4],
        "translation": [10, 0, 0],
        "extras": { "skein": [
            { "bevy_taw::mesh_walls::MeshWalls": { "shape": "Triangles", "names": [] } }
        ] }
    },
    {
        "name": "Heavy",
        "translation": [0, 0, 0],
        "extras": { "skein": [
            { "bevy_taw::components::Marble": { "radius": 0.25 } },
            { "bevy_taw::components::MarbleMass": { "Kilograms": 3.0 } },
            { "bevy_taw::components::Velocity": [0.5, 0, 0] }
        ] }
    },
    {
        "name": "On the board",
        "translation": [10, 2, 0],
        "extras": { "skein": [ { "bevy_taw::components::Marble": { "radius": 0.5 } } ] }
    }
]"#;

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin, AssetPlugin::default(), MeshPlugin));
    app.add_plugins(TawPlugins);
    app.insert_resource(Time::<Fixed>::from_seconds(f64::from(scene::STEP)));
    scene::frame_length(&mut app, scene::STEP);
    app.finish();
    app.cleanup();
    app.update();
    app
}

/// Three numbers of a node.
fn vector(node: &Value, field: &str, otherwise: Vec3) -> Vec3 {
    let of =
        |array: &Vec<Value>| Vec3::from_array([0, 1, 2].map(|i| array[i].as_f64().unwrap() as f32));
    node.get(field).and_then(Value::as_array).map_or(otherwise, of)
}

/// Spawns a node with the components that its extras name.
fn spawn(app: &mut App, node: &Value) -> Entity {
    let registry = app.world().resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    let place = Transform::from_translation(vector(node, "translation", Vec3::ZERO));
    let place = place.with_scale(vector(node, "scale", Vec3::ONE));
    let name = Name::new(node["name"].as_str().unwrap().to_owned());
    let entity = app.world_mut().spawn((place, name)).id();
    if node.get("mesh").is_some() {
        let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::from_length(1.0));
        app.world_mut().entity_mut(entity).insert(Mesh3d(mesh));
    }
    for component in node["extras"]["skein"].as_array().unwrap() {
        let value = ReflectDeserializer::new(&registry).deserialize(component);
        let value = value.unwrap_or_else(|error| panic!("{component}: {error}"));
        app.world_mut().commands().entity(entity).insert_reflect(value);
    }
    app.world_mut().flush();
    entity
}

#[test]
fn components_of_a_blender_scene_collide() {
    let mut app = app();
    let nodes: Vec<Value> = serde_json::from_str(NODES).unwrap();
    let [_, board, heavy, upon] = [0, 1, 2, 3].map(|i| spawn(&mut app, &nodes[i]));
    scene::frames(&mut app, 200);
    assert!(app.world().get::<Wall>(board).is_some(), "its mesh is its wall");
    let lies = scene::position(&app, heavy);
    assert!((lies.y + 1.75).abs() < 0.01 && lies.x > 0.2, "on the floor, rolled there: {lies}");
    let lies = scene::position(&app, upon);
    assert!((lies.y - 1.0).abs() < 0.01, "on the board: {lies}");
    let world = app.world().resource::<TawWorld>();
    let rows = (0..world.marbles.len()).map(|row| world.marbles.id(row).unwrap());
    let masses: Vec<_> = rows.map(|id| world.marbles.get(id).unwrap().mass).collect();
    assert!(masses.contains(&taw::world::Mass::Kilograms(3.0)), "{masses:?}");
}
