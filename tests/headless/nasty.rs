//! Every number of every component and resource, by table, times every number that hurts: it is
//! refused once by its value and nothing changes, or it is taken and nothing else breaks.

use bevy::ecs::reflect::{ReflectComponent, ReflectResource};
use bevy::prelude::*;
use bevy::reflect::TypePath;
use bevy_taw::prelude::*;

use crate::scene;

mod table;

use table::{NUMBERS, OF_BODIES, OF_JOINTS, OF_WALLS, TABLE, Takes, numbers, samples, takes};

/// An app with a floor far below and a witness far away, which moves.
fn app(model: Model) -> (App, Entity) {
    let mut app = scene::smooth_app();
    app.register_type::<Transform>();
    app.insert_resource(TawModel(model)).insert_resource(Gravity(Vec3::ZERO));
    app.world_mut().spawn((Wall::default(), Transform::from_xyz(0.0, -50.0, 0.0)));
    let witness = (Marble::new(0.5), Velocity(Vec3::X), Transform::from_xyz(900.0, 7.0, 0.0));
    let witness = app.world_mut().spawn(witness).id();
    scene::frames(&mut app, 2);
    (app, witness)
}

fn component(app: &App, name: &str) -> ReflectComponent {
    let registry = app.world().resource::<AppTypeRegistry>().read();
    let it = registry.get_with_short_type_path(name).expect(name);
    it.data::<ReflectComponent>().expect(name).clone()
}

fn models() -> [Model; 5] {
    let of = |response, rotation| Model { response, rotation, ..Model::default() };
    [
        of(Response::Displacement, Rotation::None),
        of(Response::Impulse, Rotation::Dynamic),
        of(Response::Penalty(ContactLaw::SpringDashpot), Rotation::Dynamic),
        of(Response::EventDriven, Rotation::Dynamic),
        Model::GAME,
    ]
}

/// Marble of an entity in the physics.
fn row(app: &App, entity: Entity) -> Option<bevy_taw::taw::world::Marble<f32>> {
    let world = app.world().resource::<TawWorld>();
    let row = (0..world.marbles.len()).find(|row| world.marble_entity(*row as u32) == Some(entity));
    row.map(|row| world.marbles.get(world.marbles.id(row).unwrap()).unwrap())
}

fn told(app: &App) -> Vec<(Option<Entity>, String)> {
    let messages = app.world().resource::<Messages<InputRefused>>();
    let told = messages.iter_current_update_messages();
    told.map(|it| (it.entity, it.error.to_string())).collect()
}

#[test]
fn every_number_of_every_component_is_refused_once_or_harmless() {
    for model in models() {
        let (mut app, witness) = app(model);
        // Of walls, the others differ in nothing that the plugin does.
        let few = matches!(model.response, Response::Impulse | Response::EventDriven);
        for (spawn, kinds) in samples() {
            if kinds == OF_WALLS && !few {
                continue;
            }
            let of_bodies = kinds == OF_BODIES || kinds == OF_JOINTS;
            if of_bodies && !model.response.knows_bodies() {
                continue;
            }
            for kind in kinds {
                let reflect = component(&app, kind);
                let mut paths = Vec::new();
                let mut entity = app.world_mut().spawn_empty();
                spawn(&mut entity);
                numbers(reflect.reflect(&entity).unwrap().as_partial_reflect(), "", &mut paths);
                entity.despawn();
                assert!(!paths.is_empty(), "{kind} has no numbers");
                for path in paths {
                    for x in NUMBERS {
                        // A landscape wider than 1e30 m takes minutes by events, which is
                        // for the core to mend.
                        let endless = path == ".scale.z" && x >= 1e30;
                        if endless && model.response == Response::EventDriven {
                            continue;
                        }
                        try_component(&mut app, witness, spawn, (kind, &path), &reflect, x);
                    }
                }
            }
        }
    }
}

fn try_component(
    app: &mut App,
    witness: Entity,
    spawn: fn(&mut EntityWorldMut),
    (kind, path): (&str, &str),
    reflect: &ReflectComponent,
    x: f32,
) {
    let what = format!("{kind}{path} = {x:e}, {:?}", **app.world().resource::<TawModel>());
    let mut entity = app.world_mut().spawn_empty();
    spawn(&mut entity);
    let target = entity.id();
    scene::frames(app, 2);
    let (before, seen) = (row(app, target), row(app, witness).unwrap());
    let mut entity = app.world_mut().entity_mut(target);
    *reflect.reflect_mut(&mut entity).unwrap().path_mut::<f32>(path).unwrap() = x;
    let mut refused = Vec::new();
    for _ in 0..4 {
        app.update();
        refused.extend(told(app));
    }
    let is_marble = before.is_some();
    assert!(refused.len() <= 1, "{what}: {refused:?}");
    assert!(refused.iter().all(|(entity, _)| *entity == Some(target)), "{what}: {refused:?}");
    let takes = if kind == "Transform" && !is_marble { Takes::Some } else { takes(kind, path) };
    let response = app.world().resource::<TawModel>().response;
    let balls_only =
        kind == "HalfLength" && matches!(response, Response::EventDriven | Response::SoftStep);
    match takes.refuses(x) {
        Some(true) => {
            assert_eq!(refused.len(), 1, "{what}");
            let shown = refused[0].1.contains(&f64::from(x).to_string());
            assert!(shown || matches!(takes, Takes::Some), "{what}: {}", refused[0].1);
            assert_eq!(row(app, target), before, "{what}");
        }
        // What it leads to may still be refused, as a velocity that overflows.
        Some(false) if x.abs() <= 1.0 && x.abs() != 1e-40 && x.abs() != 1e-30 && !balls_only => {
            assert!(refused.is_empty(), "{what}: {refused:?}");
        }
        _ => {}
    }
    for entity in [witness, target] {
        let place = app.world().get::<Transform>(entity).unwrap();
        let finite = place.translation.is_finite() && place.rotation.is_finite();
        assert!(finite || !is_marble, "{what}: {place:?}");
    }
    // Nothing reaches the witness but what is as large as the world.
    let reaches = (x > 100.0 && matches!(kind, "Marble" | "HalfLength" | "Wall" | "Transform"))
        || (!is_marble && kind != "SurfaceMaterial");
    let now = row(app, witness).unwrap();
    assert!(now.position.x.is_finite() && now.velocity.x.is_finite(), "{what}: {now:?}");
    if reaches {
        app.world_mut().get_mut::<Velocity>(witness).unwrap().0 = Vec3::X;
    } else {
        let way = now.position.x - seen.position.x;
        assert!((way - 4.0 * scene::STEP).abs() < 1e-3, "{what}: the witness moved {way} m");
        assert_eq!(now.velocity, seen.velocity, "{what}");
    }
    app.world_mut().despawn(target);
    app.world_mut().get_mut::<Transform>(witness).unwrap().translation = Vec3::new(900.0, 7.0, 0.0);
    app.world_mut().get_mut::<Velocity>(witness).unwrap().0 = Vec3::X;
    app.update();
}

type Set = Box<dyn Fn(&mut World, f32)>;
/// A number of a resource: its name, how it is set, and what is refused.
type Row = (&'static str, Set, fn(f32) -> bool);

const STILL: Medium<f32> =
    Medium { velocity: bevy_taw::taw::math::Vec3::new(0.0, 0.0, 0.0), linear: 0.1, quadratic: 0.1 };

fn bad(x: f32) -> bool {
    !x.is_finite()
}

fn negative(x: f32) -> bool {
    !(x.is_finite() && x >= 0.0)
}

fn force(of: fn(f32) -> ForceField<f32>) -> Set {
    Box::new(move |world, x| world.resource_mut::<Forces>().0 = vec![of(x)])
}

fn material(set: fn(&mut bevy_taw::taw::response::Material<f32>, f32)) -> Set {
    Box::new(move |world, x| set(&mut world.resource_mut::<TawSwarmModel>().material, x))
}

fn numbers_of_resources() -> Vec<Row> {
    vec![
        ("Gravity.x", Box::new(|w, x| w.resource_mut::<Gravity>().x = x), bad),
        ("Gravity.y", Box::new(|w, x| w.resource_mut::<Gravity>().y = x), bad),
        ("Gravity.z", Box::new(|w, x| w.resource_mut::<Gravity>().z = x), bad),
        (
            "Drag.velocity",
            force(|x| ForceField::Drag(Medium { velocity: [0.0, x, 0.0].into(), ..STILL })),
            bad,
        ),
        ("Drag.linear", force(|x| ForceField::Drag(Medium { linear: x, ..STILL })), negative),
        ("Drag.quadratic", force(|x| ForceField::Drag(Medium { quadratic: x, ..STILL })), negative),
        (
            "Spring.anchor",
            force(|x| ForceField::Spring {
                anchor: [0.0, 0.0, x].into(),
                rest_length: 1.0,
                stiffness: 1.0,
            }),
            bad,
        ),
        (
            "Spring.rest_length",
            force(|x| ForceField::Spring {
                anchor: [0.0; 3].into(),
                rest_length: x,
                stiffness: 1.0,
            }),
            negative,
        ),
        (
            "Spring.stiffness",
            force(|x| ForceField::Spring {
                anchor: [0.0; 3].into(),
                rest_length: 1.0,
                stiffness: x,
            }),
            negative,
        ),
        (
            "Attraction.center",
            force(|x| ForceField::Attraction { center: [x, 0.0, 0.0].into(), strength: 1.0 }),
            bad,
        ),
        (
            "Attraction.strength",
            force(|x| ForceField::Attraction { center: [0.0; 3].into(), strength: x }),
            bad,
        ),
    ]
}

fn numbers_of_swarms() -> Vec<Row> {
    vec![
        ("SwarmModel.restitution", material(|m, x| m.restitution = x), |x| {
            !(0.0..=1.0).contains(&x)
        }),
        ("SwarmModel.friction", material(|m, x| m.friction = x), negative),
        ("SwarmModel.tangential_restitution", material(|m, x| m.tangential_restitution = x), |x| {
            !(-1.0..=1.0).contains(&x)
        }),
        ("SwarmModel.rolling_resistance", material(|m, x| m.rolling_resistance = x), negative),
        ("SwarmModel.spinning_resistance", material(|m, x| m.spinning_resistance = x), negative),
        ("SwarmModel.youngs_modulus", material(|m, x| m.elasticity.youngs_modulus = x), |x| {
            !(x.is_finite() && x > 0.0)
        }),
        ("SwarmModel.poissons_ratio", material(|m, x| m.elasticity.poissons_ratio = x), |x| {
            !(0.0..=0.5).contains(&x)
        }),
    ]
}

#[test]
fn every_number_of_every_resource_is_refused_once_or_harmless() {
    for model in models() {
        for (what, set, refuses) in numbers_of_resources().iter().chain(&numbers_of_swarms()) {
            for x in NUMBERS {
                let (mut app, witness) = app(model);
                set(app.world_mut(), x);
                let mut refused = Vec::new();
                for _ in 0..4 {
                    app.update();
                    refused.extend(told(&app));
                }
                let expected = usize::from(refuses(x));
                assert_eq!(refused.len(), expected, "{what} = {x}: {refused:?}");
                assert!(
                    refused
                        .iter()
                        .all(|(whose, why)| whose.is_none()
                            && why.contains(&f64::from(x).to_string())),
                    "{what} = {x}: {refused:?}"
                );
                let now = row(&app, witness).unwrap();
                let place = app.world().get::<Transform>(witness).unwrap();
                assert!(place.translation.is_finite() && place.rotation.is_finite());
                if refuses(x) {
                    assert_eq!((now.velocity.x, now.velocity.y), (1.0, 0.0), "{what} = {x}");
                }
            }
        }
    }
}

#[test]
fn counts_that_cannot_be_are_refused_once() {
    type Set = fn(&mut World, u32);
    let rows: [(&str, Set, u32, u32); 4] = [
        ("substeps", |w, n| w.resource_mut::<TawModel>().substeps = n, 1, 1_000),
        ("iterations", |w, n| w.resource_mut::<TawModel>().iterations = n, 1, 1_000),
        ("substeps", |w, n| w.resource_mut::<TawSwarmModel>().substeps = n, 1, 1_000),
        (
            "threads",
            |w, n| w.resource_mut::<TawSwarmModel>().threads = n,
            0,
            SwarmModel::MAX_THREADS,
        ),
    ];
    for (field, set, least, most) in rows {
        for n in [0, 1, most, most + 1, u32::MAX] {
            let (mut app, _) = app(Model::default());
            set(app.world_mut(), n);
            let mut refused = Vec::new();
            for _ in 0..3 {
                app.update();
                refused.extend(told(&app));
            }
            assert_eq!(refused.len(), usize::from(n < least || n > most), "{field} = {n}");
            assert!(
                refused
                    .iter()
                    .all(|(_, why)| why.starts_with(field) && why.ends_with(&format!("is {n}"))),
                "{refused:?}"
            );
        }
    }
}

#[test]
fn every_public_component_and_resource_has_a_row() {
    let (app, _) = app(Model::default());
    let registry = app.world().resource::<AppTypeRegistry>().read();
    // They hold no numbers, or numbers that the tests above try.
    let without = [
        "CollidingBalls",
        "CollidingEntities",
        "CollisionLayers",
        "FilterPairs",
        "Forces",
        "IgnoreCollisions",
        "IgnoredComponents",
        "Kinematic",
        "LockedAxes",
        "MarbleIntegrator",
        "MarbleRotation",
        "MeshWalls",
        "Sensor",
        "Sleeping",
        "SleepingDisabled",
        "TawModel",
        "TawSwarmModel",
        "Teleport",
    ];
    let mut count = 0;
    for it in registry.iter() {
        let info = it.type_info().type_path_table();
        let is_one =
            it.data::<ReflectComponent>().is_some() || it.data::<ReflectResource>().is_some();
        if is_one && info.path().starts_with("bevy_taw::") {
            let name = info.short_path();
            let listed = TABLE.iter().any(|(of, ..)| *of == name) || without.contains(&name);
            assert!(listed, "{name} has no row");
            count += 1;
        }
    }
    assert!(count >= 17, "{count}");
    assert_eq!(Teleport::short_type_path(), "Teleport");
}
