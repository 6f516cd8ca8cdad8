//! Every number of every component and resource, by table, times every number that hurts: it is
//! refused once by its value and nothing changes, or it is taken and nothing else breaks.

use bevy::ecs::reflect::{ReflectComponent, ReflectResource};
use bevy::prelude::*;
use bevy::reflect::{ReflectRef, TypePath};
use bevy_taw::prelude::*;

use crate::scene;

const NUMBERS: [f32; 10] =
    [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, -1.0, 1e-40, 1e-30, 1e30, f32::MAX];

/// Which numbers a field takes.
#[derive(Clone, Copy, Debug)]
enum Takes {
    Finite,
    Positive,
    AtLeastZero,
    Within(f32, f32),
    /// Whatever the physics does not read.
    All,
    /// What no other field agrees with is refused, too: a part of a rotation or of a shape.
    Some,
}

impl Takes {
    /// Whether it must be refused, if that depends on the number alone.
    fn refuses(self, x: f32) -> Option<bool> {
        match self {
            Self::Finite => Some(!x.is_finite()),
            Self::Positive => Some(!(x.is_finite() && x > 0.0)),
            Self::AtLeastZero => Some(!(x.is_finite() && x >= 0.0)),
            Self::Within(low, high) => Some(!(x >= low && x <= high)),
            Self::All => Some(false),
            Self::Some => (!x.is_finite()).then_some(true),
        }
    }
}

/// The table: type, path (or how it begins), and what it takes.
const TABLE: &[(&str, &str, Takes)] = &[
    ("Marble", ".radius", Takes::Positive),
    ("Velocity", ".0", Takes::Finite),
    ("AngularVelocity", ".0", Takes::Finite),
    ("MarbleMass", ".0", Takes::Positive),
    ("GravityScale", ".0", Takes::Finite),
    ("SurfaceVelocity", ".0", Takes::Finite),
    ("SurfaceMaterial", ".restitution", Takes::Within(0.0, 1.0)),
    ("SurfaceMaterial", ".friction", Takes::AtLeastZero),
    ("SurfaceMaterial", ".tangential_restitution", Takes::Within(-1.0, 1.0)),
    ("SurfaceMaterial", ".rolling_resistance", Takes::AtLeastZero),
    ("SurfaceMaterial", ".spinning_resistance", Takes::AtLeastZero),
    ("SurfaceMaterial", ".elasticity[0]", Takes::Positive),
    ("SurfaceMaterial", ".elasticity[1]", Takes::Within(0.0, 0.5)),
    ("MarbleDamping", ".linear", Takes::AtLeastZero),
    ("MarbleDamping", ".angular", Takes::AtLeastZero),
    ("ExternalForce", ".force", Takes::Finite),
    ("ExternalForce", ".torque", Takes::Finite),
    ("ExternalImpulse", ".impulse", Takes::Finite),
    ("ExternalImpulse", ".angular", Takes::Finite),
    ("HalfLength", ".0", Takes::AtLeastZero),
    ("Transform", ".translation", Takes::Finite),
    ("Transform", ".rotation", Takes::Some),
    ("Transform", ".scale", Takes::All),
    ("Wall", "", Takes::Some),
    ("Gravity", ".0", Takes::Finite),
    ("SubstepDelta", ".0", Takes::All), // set before each step
];

fn takes(kind: &str, path: &str) -> Takes {
    let row = TABLE.iter().find(|(of, begins, _)| *of == kind && path.starts_with(begins));
    row.unwrap_or_else(|| panic!("the table says nothing of {kind}{path}")).2
}

/// The paths of all numbers in a value.
fn numbers(value: &dyn PartialReflect, path: &str, found: &mut Vec<String>) {
    if value.try_downcast_ref::<f32>().is_some() {
        found.push(path.to_owned());
        return;
    }
    match value.reflect_ref() {
        ReflectRef::Struct(it) => (0..it.field_len()).for_each(|i| {
            let name = it.name_at(i).unwrap();
            numbers(it.field_at(i).unwrap(), &format!("{path}.{name}"), found);
        }),
        ReflectRef::TupleStruct(it) => (0..it.field_len())
            .for_each(|i| numbers(it.field(i).unwrap(), &format!("{path}.{i}"), found)),
        ReflectRef::Enum(it) => (0..it.field_len()).for_each(|i| {
            let name = it.name_at(i).map_or_else(|| i.to_string(), str::to_owned);
            numbers(it.field_at(i).unwrap(), &format!("{path}.{name}"), found);
        }),
        ReflectRef::Array(it) => {
            (0..it.len()).for_each(|i| numbers(it.get(i).unwrap(), &format!("{path}[{i}]"), found));
        }
        ReflectRef::List(it) => (0..it.len().min(2))
            .for_each(|i| numbers(it.get(i).unwrap(), &format!("{path}[{i}]"), found)),
        _ => {}
    }
}

/// A marble or wall with a value of each component, and the names of those that are tried on it.
type Sample = (fn(&mut EntityWorldMut), &'static [&'static str]);

fn marble(entity: &mut EntityWorldMut) {
    let all = (
        (
            Marble::new(0.5),
            Velocity::default(),
            AngularVelocity::default(),
            MarbleMass::Density(1_000.0),
        ),
        (GravityScale(1.0), SurfaceMaterial::default(), MarbleDamping::default()),
        (ExternalForce::default(), ExternalImpulse::default(), HalfLength(0.0)),
        Transform::from_xyz(0.0, 1.0, 0.0),
    );
    entity.insert(all);
}

fn wall(entity: &mut EntityWorldMut, wall: Wall) {
    entity.insert((wall, SurfaceMaterial::default(), SurfaceVelocity(Vec3::ZERO), BELOW));
}

const OF_MARBLES: &[&str] = &[
    "Marble",
    "Velocity",
    "AngularVelocity",
    "MarbleMass",
    "GravityScale",
    "SurfaceMaterial",
    "MarbleDamping",
    "ExternalForce",
    "ExternalImpulse",
    "HalfLength",
    "Transform",
];
const BELOW: Transform = Transform::from_xyz(0.0, -5.0, 0.0);
const OF_WALLS: &[&str] = &["Wall", "SurfaceMaterial", "SurfaceVelocity", "Transform"];

fn samples() -> Vec<Sample> {
    let mut samples: Vec<Sample> = vec![
        (marble, OF_MARBLES),
        (
            |it| {
                marble(it);
                it.insert(MarbleMass::Kilograms(2.0));
            },
            &["MarbleMass"],
        ),
        (|it| wall(it, Wall::HalfSpace(Dir3::Y)), OF_WALLS),
    ];
    let more: [fn(&mut EntityWorldMut); 6] = [
        |it| wall(it, Sphere::new(1.0).into()),
        |it| wall(it, Cuboid::new(1.0, 2.0, 3.0).into()),
        |it| wall(it, Capsule3d::new(0.5, 1.0).into()),
        |it| wall(it, Wall::Hull(vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z])),
        |it| {
            let points = vec![Vec3::ZERO, Vec3::X, Vec3::Z];
            wall(it, Wall::Mesh { points, triangles: vec![[0, 2, 1]] });
        },
        |it| {
            let heights = vec![0.5; 9];
            wall(it, Wall::HeightField { cell: Vec2::ONE, columns: 3, heights });
        },
    ];
    samples.extend(more.into_iter().map(|it| (it, OF_WALLS)));
    samples
}

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

fn models() -> [Model; 4] {
    let of = |response, rotation| Model { response, rotation, ..Model::default() };
    [
        of(Response::Displacement, Rotation::None),
        of(Response::Impulse, Rotation::Dynamic),
        of(Response::Penalty(ContactLaw::SpringDashpot), Rotation::Dynamic),
        of(Response::EventDriven, Rotation::Dynamic),
    ]
}

/// What the physics knows of a marble.
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
    let balls_only = kind == "HalfLength"
        && app.world().resource::<TawModel>().response == Response::EventDriven;
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
    // They hold no numbers, or counts that the test above tries.
    let without = [
        "CollidingEntities",
        "CollisionLayers",
        "Kinematic",
        "MarbleIntegrator",
        "MarbleRotation",
        "Sensor",
        "Sleeping",
        "SleepingDisabled",
        "TawModel",
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
