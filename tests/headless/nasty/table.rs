//! Table of the numbers that every field of every component takes, and entities with all of them.

use bevy::prelude::*;
use bevy::reflect::ReflectRef;
use bevy_taw::prelude::*;

pub const NUMBERS: [f32; 10] =
    [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, -1.0, 1e-40, 1e-30, 1e30, f32::MAX];

/// Numbers that a field takes.
#[derive(Clone, Copy, Debug)]
pub enum Takes {
    Finite,
    Positive,
    AtLeastZero,
    Within(f32, f32),
    /// All numbers: the physics does not read it.
    All,
    /// Finite ones, of which those are refused, too, that no other field agrees with: a part of a rotation
    /// or of a shape.
    Some,
}

impl Takes {
    /// Returns true for a number that must be refused, if that depends on the number alone.
    pub fn refuses(self, x: f32) -> Option<bool> {
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
pub const TABLE: &[(&str, &str, Takes)] = &[
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
    ("ColliderDisabled", ".time_left", Takes::AtLeastZero),
    ("Transform", ".translation", Takes::Finite),
    ("Transform", ".rotation", Takes::Some),
    ("Transform", ".scale", Takes::All),
    ("Wall", "", Takes::Some),
    ("OneWay", ".0", Takes::Some),
    ("ContactForce", ".total", Takes::All),
    ("ContactForce", ".pressure", Takes::All),
    ("Grounded", ".max_slope", Takes::Within(0.0, std::f32::consts::PI)),
    ("MarbleController", ".direction", Takes::Finite),
    ("MarbleController", ".jump_speed", Takes::Finite),
    ("MarbleController", "", Takes::AtLeastZero),
    ("GravityZone", ".0", Takes::Finite),
    ("WindZone", ".velocity", Takes::Finite),
    ("WindZone", ".drag", Takes::AtLeastZero),
    ("Body", "", Takes::Some),
    ("Joint", "", Takes::Some),
    ("Swarm", ".tint", Takes::All), // drawn only
    ("Gravity", ".0", Takes::Finite),
    ("SubstepDelta", ".0", Takes::All), // set before each step
];

pub fn takes(kind: &str, path: &str) -> Takes {
    let row = TABLE.iter().find(|(of, begins, _)| *of == kind && path.starts_with(begins));
    row.unwrap_or_else(|| panic!("the table says nothing of {kind}{path}")).2
}

/// The paths of all numbers in a value.
pub fn numbers(value: &dyn PartialReflect, path: &str, found: &mut Vec<String>) {
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
pub type Sample = (fn(&mut EntityWorldMut), &'static [&'static str]);

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
        (Grounded::default(), ContactForce::default(), MarbleController::default()),
        Transform::from_xyz(0.0, 1.0, 0.0),
    );
    entity.insert(all);
}

fn wall(entity: &mut EntityWorldMut, wall: Wall) {
    let optional = (SurfaceMaterial::default(), SurfaceVelocity(Vec3::ZERO), OneWay::default());
    entity.insert((wall, optional, BELOW));
}

fn zone(entity: &mut EntityWorldMut, zone: GravityZone) {
    entity.insert((Wall::from(Sphere::new(1.0)), zone, WindZone::default(), BELOW));
}

fn tinted(entity: &mut EntityWorldMut, tint: Tint) {
    entity.insert((Swarm::default().with_tint(tint), BELOW));
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
    "Grounded",
    "ContactForce",
    "MarbleController",
    "Transform",
];
const BELOW: Transform = Transform::from_xyz(0.0, -5.0, 0.0);
pub const OF_WALLS: &[&str] =
    &["Wall", "SurfaceMaterial", "SurfaceVelocity", "OneWay", "Transform"];

/// Known by `SoftStep` alone.
pub const OF_BODIES: &[&str] = &["Body"];
pub const OF_JOINTS: &[&str] = &["Joint"];

pub fn samples() -> Vec<Sample> {
    let mut samples: Vec<Sample> = vec![
        (marble, OF_MARBLES),
        (
            |it| {
                marble(it);
                it.insert(MarbleMass::Kilograms(2.0));
            },
            &["MarbleMass"],
        ),
        (
            |it| {
                marble(it);
                it.insert(ColliderDisabled::for_seconds(1.0));
            },
            &["ColliderDisabled"],
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
    samples.extend([
        (|it| zone(it, GravityZone::default()), &["GravityZone", "WindZone"]),
        (|it| zone(it, GravityZone::Toward(1.0)), &["GravityZone"]),
        (|it| zone(it, GravityZone::Add(Vec3::X)), &["GravityZone"]),
        (|it| tinted(it, Tint::Speed(1.0)), &["Swarm"]),
        (|it| tinted(it, Tint::Size(0.1, 1.0)), &["Swarm"]),
        (|it| tinted(it, Tint::Plain([0.5; 3])), &["Swarm"]),
    ] as [Sample; 6]);
    samples.extend(samples_of_bodies());
    samples
}

fn samples_of_bodies() -> [Sample; 3] {
    [
        (
            |it| {
                let ball = BodyShape::Sphere(Sphere::new(0.5));
                let body = Body::from(Cuboid::new(1.0, 2.0, 3.0));
                it.insert((body.with_part(ball, Vec3::X, Quat::IDENTITY), BELOW));
            },
            OF_BODIES,
        ),
        (
            |it| {
                let points = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
                let body = Body::from(Capsule3d::new(0.5, 1.0));
                it.insert((
                    body.with_part(BodyShape::Hull(points), Vec3::X, Quat::IDENTITY),
                    BELOW,
                ));
            },
            OF_BODIES,
        ),
        (
            |it| {
                it.insert((Joint::default(), BELOW));
            },
            OF_JOINTS,
        ),
    ]
}
