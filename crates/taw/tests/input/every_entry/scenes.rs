//! The table for the numbers of scenes.

use taw::scene::{
    Build, ForceFieldDesc, GravityKeyframe, KinematicMotion, Lattice, MarbleDesc, MaterialDesc,
    RotationDesc, Scene, SensorPlane, ShapeDesc, Structure, WallDesc,
};

/// A scene with one of each.
pub fn one_of_each() -> Scene {
    let on_floor =
        |x: f64| MarbleDesc { position: [x, 0.5, 0.0], radius: 0.5, ..MarbleDesc::default() };
    let material = Some(MaterialDesc::default());
    let rotation = RotationDesc { axis: [0.0, 0.0, 1.0], degrees: 10.0 };
    let turns = KinematicMotion::Rotate {
        pivot: [1.0, 0.0, 0.0],
        axis: [0.0, 1.0, 0.0],
        degrees_per_second: 30.0,
    };
    let swings = KinematicMotion::Oscillate {
        amplitude: [0.0, 0.2, 0.0],
        pivot: [0.0; 3],
        axis: [1.0, 0.0, 0.0],
        degrees: 5.0,
        period: 2.0,
    };
    let wall = |shape, motion| WallDesc { shape, material, motion };
    Scene {
        gravity_keyframes: vec![
            GravityKeyframe { time: 0.0, gravity: [0.0, -9.0, 0.0] },
            GravityKeyframe { time: 0.1, gravity: [1.0, -9.0, 0.0] },
        ],
        force_fields: vec![
            ForceFieldDesc::Drag { velocity: [1.0, 0.0, 0.0], linear: 0.1, quadratic: 0.1 },
            ForceFieldDesc::Spring { anchor: [0.0, 9.0, 0.0], rest_length: 1.0, stiffness: 1.0 },
            ForceFieldDesc::Attraction { center: [0.0, -99.0, 0.0], strength: 1.0 },
        ],
        walls: vec![
            wall(ShapeDesc::HalfSpace { normal: [0.0, 1.0, 0.0], point: [0.0; 3] }, Some(swings)),
            wall(
                ShapeDesc::Box { center: [5.0, 0.0, 0.0], size: [1.0, 2.0, 3.0], rotation },
                Some(turns),
            ),
            wall(
                ShapeDesc::Ball { center: [0.0, 0.0, 5.0], radius: 1.0 },
                Some(KinematicMotion::Conveyor { velocity: [1.0, 0.0, 0.0] }),
            ),
            wall(ShapeDesc::Capsule { from: [0.0; 3], to: [0.0, 1.0, 0.0], radius: 0.2 }, None),
        ],
        structures: vec![Structure {
            shape: Build::Compound {
                parts: vec![ShapeDesc::Ball { center: [9.0; 3], radius: 1.0 }],
            },
            material,
            motion: None,
        }],
        sensor_planes: vec![SensorPlane { normal: [0.0, 1.0, 0.0], point: [0.0; 3] }],
        marbles: vec![on_floor(3.0), on_floor(3.9)],
        lattices: vec![Lattice {
            first: MarbleDesc { position: [-3.0, 0.5, 0.0], radius: 0.4, ..MarbleDesc::default() },
            count: [2, 2, 1],
            pitch: [-1.0, 1.0, 1.0],
            jitter: 0.1,
        }],
        ..Scene::default()
    }
}

type Set = fn(&mut Scene, f64);

/// Into the first wall of the form.
fn form(scene: &mut Scene, mut set: impl FnMut(&mut ShapeDesc)) {
    scene.walls.iter_mut().for_each(|wall| set(&mut wall.shape));
}

fn motion(scene: &mut Scene, set: impl FnMut(&mut KinematicMotion)) {
    scene.walls.iter_mut().filter_map(|wall| wall.motion.as_mut()).for_each(set);
}

fn material(scene: &mut Scene, set: impl Fn(&mut MaterialDesc)) {
    set(&mut scene.material);
    scene.walls.iter_mut().filter_map(|wall| wall.material.as_mut()).for_each(set);
}

macro_rules! into {
    ($of:ident, $scene:expr, $pattern:pat => $set:expr) => {
        $of($scene, |it| {
            if let $pattern = it {
                $set
            }
        })
    };
}

#[rustfmt::skip] // one row a line
pub fn rows() -> Vec<(&'static str, Set)> {
    vec![
        ("scene::Scene.description scene::Scene.duration", |s, x| s.duration = x),
        ("scene::Scene.gravity", |s, x| { s.gravity_keyframes.clear(); s.gravity = [x, x, 0.0]; }),
        ("scene::Scene.gravity_keyframes scene::GravityKeyframe.time", |s, x| s.gravity_keyframes[1].time = x),
        ("scene::GravityKeyframe.gravity", |s, x| s.gravity_keyframes[1].gravity = [0.0, x, x]),
        ("scene::Scene.force_fields scene::ForceFieldDesc::Drag.velocity", |s, x| into!(field, s, ForceFieldDesc::Drag { velocity, .. } => velocity[1] = x)),
        ("scene::ForceFieldDesc::Drag.linear", |s, x| into!(field, s, ForceFieldDesc::Drag { linear, .. } => *linear = x)),
        ("scene::ForceFieldDesc::Drag.quadratic", |s, x| into!(field, s, ForceFieldDesc::Drag { quadratic, .. } => *quadratic = x)),
        ("scene::ForceFieldDesc::Spring.anchor", |s, x| into!(field, s, ForceFieldDesc::Spring { anchor, .. } => anchor[2] = x)),
        ("scene::ForceFieldDesc::Spring.rest_length", |s, x| into!(field, s, ForceFieldDesc::Spring { rest_length, .. } => *rest_length = x)),
        ("scene::ForceFieldDesc::Spring.stiffness", |s, x| into!(field, s, ForceFieldDesc::Spring { stiffness, .. } => *stiffness = x)),
        ("scene::ForceFieldDesc::Attraction.center", |s, x| into!(field, s, ForceFieldDesc::Attraction { center, .. } => center[0] = x)),
        ("scene::ForceFieldDesc::Attraction.strength", |s, x| into!(field, s, ForceFieldDesc::Attraction { strength, .. } => *strength = x)),
        ("scene::Scene.material scene::WallDesc.material scene::MaterialDesc.restitution", |s, x| material(s, |it| it.restitution = x)),
        ("scene::MaterialDesc.friction", |s, x| material(s, |it| it.friction = x)),
        ("scene::MaterialDesc.tangential_restitution", |s, x| material(s, |it| it.tangential_restitution = x)),
        ("scene::MaterialDesc.rolling_resistance", |s, x| material(s, |it| it.rolling_resistance = x)),
        ("scene::MaterialDesc.spinning_resistance", |s, x| material(s, |it| it.spinning_resistance = x)),
        ("scene::MaterialDesc.youngs_modulus", |s, x| material(s, |it| it.youngs_modulus = x)),
        ("scene::MaterialDesc.poissons_ratio", |s, x| material(s, |it| it.poissons_ratio = x)),
        ("scene::Scene.walls scene::WallDesc.shape scene::ShapeDesc::HalfSpace.normal", |s, x| into!(form, s, ShapeDesc::HalfSpace { normal, .. } => *normal = [0.0, x, 0.0])),
        ("scene::ShapeDesc::HalfSpace.point", |s, x| into!(form, s, ShapeDesc::HalfSpace { point, .. } => *point = [x, x, 0.0])),
        ("scene::ShapeDesc::Box.center", |s, x| into!(form, s, ShapeDesc::Box { center, .. } => *center = [x, x, 0.0])),
        ("scene::ShapeDesc::Box.size", |s, x| into!(form, s, ShapeDesc::Box { size, .. } => size[1] = x)),
        ("scene::ShapeDesc::Box.rotation scene::RotationDesc.axis", |s, x| into!(form, s, ShapeDesc::Box { rotation, .. } => rotation.axis = [x, 0.0, 0.0])),
        ("scene::RotationDesc.degrees", |s, x| into!(form, s, ShapeDesc::Box { rotation, .. } => rotation.degrees = x)),
        ("scene::ShapeDesc::Ball.center", |s, x| into!(form, s, ShapeDesc::Ball { center, .. } => *center = [x, x, x])),
        ("scene::ShapeDesc::Ball.radius", |s, x| into!(form, s, ShapeDesc::Ball { radius, .. } => *radius = x)),
        ("scene::ShapeDesc::Capsule.from", |s, x| into!(form, s, ShapeDesc::Capsule { from, .. } => *from = [x, x, x])),
        ("scene::ShapeDesc::Capsule.to", |s, x| into!(form, s, ShapeDesc::Capsule { to, .. } => to[0] = x)),
        ("scene::ShapeDesc::Capsule.radius", |s, x| into!(form, s, ShapeDesc::Capsule { radius, .. } => *radius = x)),
        ("scene::WallDesc.motion scene::KinematicMotion::Conveyor.velocity", |s, x| into!(motion, s, KinematicMotion::Conveyor { velocity } => velocity[2] = x)),
        ("scene::KinematicMotion::Rotate.pivot", |s, x| into!(motion, s, KinematicMotion::Rotate { pivot, .. } => *pivot = [x, 0.0, x])),
        ("scene::KinematicMotion::Rotate.axis", |s, x| into!(motion, s, KinematicMotion::Rotate { axis, .. } => *axis = [x, x, 0.0])),
        ("scene::KinematicMotion::Rotate.degrees_per_second", |s, x| into!(motion, s, KinematicMotion::Rotate { degrees_per_second, .. } => *degrees_per_second = x)),
        ("scene::KinematicMotion::Oscillate.amplitude", |s, x| into!(motion, s, KinematicMotion::Oscillate { amplitude, .. } => amplitude[1] = x)),
        ("scene::KinematicMotion::Oscillate.pivot", |s, x| into!(motion, s, KinematicMotion::Oscillate { pivot, .. } => *pivot = [x, x, x])),
        ("scene::KinematicMotion::Oscillate.axis", |s, x| into!(motion, s, KinematicMotion::Oscillate { axis, .. } => *axis = [0.0, 0.0, x])),
        ("scene::KinematicMotion::Oscillate.degrees", |s, x| into!(motion, s, KinematicMotion::Oscillate { degrees, .. } => *degrees = x)),
        ("scene::KinematicMotion::Oscillate.period", |s, x| into!(motion, s, KinematicMotion::Oscillate { period, .. } => *period = x)),
        ("scene::Scene.sensor_planes scene::SensorPlane.normal", |s, x| s.sensor_planes[0].normal = [x, 0.0, x]),
        ("scene::SensorPlane.point", |s, x| s.sensor_planes[0].point[1] = x),
        ("scene::Scene.marbles scene::MarbleDesc.position", |s, x| s.marbles[0].position = [x, x, x]),
        ("scene::MarbleDesc.radius", |s, x| s.marbles[0].radius = x),
        ("scene::MarbleDesc.velocity", |s, x| s.marbles[0].velocity[1] = x),
        ("scene::MarbleDesc.angular_velocity", |s, x| s.marbles[0].angular_velocity = [x, x, x]),
        ("scene::MarbleDesc.density", |s, x| s.marbles[0].density = x),
        ("scene::MarbleDesc.half_length", |s, x| s.marbles[0].half_length = x),
        ("scene::MarbleDesc.rotation", |s, x| s.marbles[0].rotation = RotationDesc { axis: [0.0, x, x], degrees: x }),
        ("scene::Scene.structures", |s, x| s.structures[0].shape = Build::Mesh { points: vec![[0.0; 3], [x, 0.0, 0.0], [0.0, x, 1.0]], triangles: vec![[0, 1, 2]] }),
        ("scene::Scene.structures", |s, x| s.structures[0].shape = Build::HeightField { corner: [x, 0.0, 0.0], cell: [1.0; 2], columns: 2, heights: vec![0.0, x, 0.0, 0.0] }),
        ("scene::Scene.structures", |s, x| s.structures[0].shape = Build::Compound { parts: vec![ShapeDesc::Ball { center: [0.0; 3], radius: x }] }),
        ("scene::MarbleDesc.material", |s, x| s.marbles[0].material = Some(MaterialDesc { friction: x, ..MaterialDesc::default() })),
        ("scene::Scene.lattices scene::Lattice.first", |s, x| s.lattices[0].first.radius = x),
        ("scene::Lattice.count", |s, x| s.lattices[0].count = [x.abs().min(65535.0) as u16; 3]),
        ("scene::Lattice.pitch", |s, x| s.lattices[0].pitch[0] = x),
        ("scene::Lattice.jitter", |s, x| s.lattices[0].jitter = x),
    ]
}

/// Into each field of force of the kind.
fn field(scene: &mut Scene, set: impl FnMut(&mut ForceFieldDesc)) {
    scene.force_fields.iter_mut().for_each(set);
}
