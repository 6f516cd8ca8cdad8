//! Components as other programs see them, which know their names only: inspectors, and Bevy's remote protocol.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use bevy::ecs::reflect::ReflectComponent;
use bevy::prelude::*;
use bevy::reflect::serde::{TypedReflectDeserializer, TypedReflectSerializer};
use bevy::reflect::{FromReflect, TypeRegistration, TypeRegistry};
use bevy_taw::prelude::*;
use serde::de::DeserializeSeed;
use serde_json::{Value, json};

use crate::scene;

/// Names of the public components that the sources of the plugin define.
fn components(folder: &Path, found: &mut BTreeSet<String>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            components(&path, found);
            continue;
        }
        let source = fs::read_to_string(&path).unwrap();
        let mut is_component = false;
        for line in source.lines() {
            if line.starts_with("#[derive(") {
                is_component = line.contains("(Component,");
            }
            let item = ["pub struct ", "pub enum "].iter().find_map(|head| line.strip_prefix(head));
            if let Some(item) = item.filter(|_| std::mem::take(&mut is_component)) {
                let name = item.split(|c: char| !c.is_alphanumeric()).next().unwrap();
                found.insert(name.to_owned());
            }
        }
    }
}

/// Registrations of all public components.
fn registrations(registry: &TypeRegistry) -> Vec<&TypeRegistration> {
    let mut names = BTreeSet::new();
    components(Path::new("crates/bevy_taw/src"), &mut names);
    assert!(names.len() > 30, "only {names:?} were found");
    let of = |name: &String| {
        let registration = registry.get_with_short_type_path(name);
        registration.unwrap_or_else(|| panic!("{name} is not registered"))
    };
    names.iter().map(of).collect()
}

/// A component of an entity, as `world.get_components` sends it.
fn get(app: &App, entity: Entity, registration: &TypeRegistration) -> Value {
    let registry = app.world().resource::<AppTypeRegistry>().read();
    let component = registration.data::<ReflectComponent>().unwrap();
    let value = component.reflect(app.world().entity(entity)).unwrap();
    let value = TypedReflectSerializer::new(value.as_partial_reflect(), &registry);
    serde_json::to_value(value).unwrap()
}

/// Inserts a component into an entity, as `world.insert_components` does.
fn insert(app: &mut App, entity: Entity, registration: &TypeRegistration, value: Value) {
    let registry = app.world().resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    let value = TypedReflectDeserializer::new(registration, &registry).deserialize(value).unwrap();
    let component = registration.data::<ReflectComponent>().unwrap();
    component.insert(&mut app.world_mut().entity_mut(entity), &*value, &registry);
}

#[test]
fn every_component_is_read_and_written_by_its_name() {
    let mut app = scene::smooth_app();
    let registry = app.world().resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    for registration in registrations(&registry) {
        let name = registration.type_info().type_path_table().short_path();
        let new = registration.data::<ReflectDefault>();
        let new = new.unwrap_or_else(|| panic!("{name} has no default")).default();
        let component = registration.data::<ReflectComponent>();
        let component = component.unwrap_or_else(|| panic!("{name} reflects no component"));
        let [first, second] = [(); 2].map(|()| app.world_mut().spawn_empty().id());
        component.insert(
            &mut app.world_mut().entity_mut(first),
            new.as_partial_reflect(),
            &registry,
        );
        let sent = get(&app, first, registration);
        insert(&mut app, second, registration, sent.clone());
        assert_eq!(get(&app, second, registration), sent, "{name}");
        component.remove(&mut app.world_mut().entity_mut(first));
        assert!(component.reflect(app.world().entity(first)).is_none(), "{name}");
        app.world_mut().despawn(second);
    }
    app.update();
}

#[test]
fn what_is_written_by_name_acts() {
    let mut app = scene::app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::ZERO);
    app.update();
    let registry = app.world().resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    let of = |name: &str| registry.get_with_short_type_path(name).unwrap();
    insert(&mut app, marble, of("Marble"), json!({ "radius": 0.25 }));
    insert(&mut app, marble, of("Velocity"), json!([0.0, 64.0, 0.0]));
    insert(&mut app, marble, of("MarbleMass"), json!({ "Kilograms": 3.0 }));
    // One field by its path, as `world.mutate_components` does.
    app.world_mut().entity_mut(marble).insert(SurfaceMaterial::default());
    let component = of("SurfaceMaterial").data::<ReflectComponent>().unwrap();
    let mut entity = app.world_mut().entity_mut(marble);
    let mut material = component.reflect_mut(&mut entity).unwrap();
    *material.path_mut::<f32>(".friction").unwrap() = 0.875;
    app.update();
    let world = app.world().resource::<TawWorld>();
    let id = world.marbles.id(0).unwrap();
    let found = world.marbles.get(id).unwrap();
    assert_eq!((found.radius, found.velocity.y, found.position.y), (0.25, 64.0, 1.0));
    assert_eq!(found.mass, taw::world::Mass::Kilograms(3.0));
    assert_eq!(found.material.unwrap().friction, 0.875);
    assert_eq!(get(&app, marble, of("Velocity")), json!([0.0, 64.0, 0.0]));
}

#[test]
fn what_only_the_plugin_writes_is_read_by_name() {
    let mut app = scene::app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let hole = app.world_mut().spawn((Wall::from(Cuboid::from_length(3.0)), Sensor)).id();
    let swarm = app.world_mut().spawn(Swarm::new(vec![Ball::new(Vec3::ZERO, 0.1); 1])).id();
    app.update();
    let registry = app.world().resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    let of = |name: &str| registry.get_with_short_type_path(name).unwrap();
    let balls = app.world().get::<CollidingBalls>(hole).unwrap().clone();
    assert_eq!(balls.len(), 1);
    let sent = get(&app, hole, of("CollidingBalls"));
    assert_eq!(sent, json!([balls[0].to_bits()]));
    assert_eq!(BallId::from_bits(sent[0].as_u64().unwrap()), balls[0]);
    let back = CollidingBalls::from_reflect(&balls).unwrap();
    assert_eq!(back, balls);
    // A tint that is written in place leaves the balls; a swarm in the place of another one takes them out.
    let component = of("Swarm").data::<ReflectComponent>().unwrap();
    let tint = Swarm::default().with_tint(Tint::Speed(2.0));
    component.apply(app.world_mut().entity_mut(swarm), &tint);
    app.update();
    let swarms = app.world().get::<Swarm>(swarm).unwrap();
    assert_eq!((swarms.tint, swarms.len()), (Tint::Speed(2.0), 1));
    insert(&mut app, swarm, of("Swarm"), json!({ "tint": "Id" }));
    app.update();
    assert!(app.world().resource::<TawWorld>().swarm.is_empty());
}
