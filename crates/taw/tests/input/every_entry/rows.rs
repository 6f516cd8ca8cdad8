//! The table: what is called or filled in, with which number where.

use std::sync::Arc;

use taw::frame::{AxisAngle, Camera, LookAt, Pose, Tree};
use taw::math::Quat;
use taw::motion::{Medium, WallMotion};
use taw::prelude::*;
use taw::response::Elasticity;
use taw::scene::{KinematicMotion, Simulation};
use taw::shape::{Aabb, Aabb3, Capsule, Compound, HeightField, Hull, Mesh, Obb, Shape};
use taw::world::{Damping, SpeedLimits};
use taw::{Error, swarm};

use super::{Place, Row, Scope};

type Outcome = Result<(), Error>;

fn zero<S: Scalar>() -> S {
    S::zero()
}

fn one<S: Scalar>() -> S {
    S::one()
}

fn point<S: Scalar>(x: S, y: S, z: S) -> Point3<S> {
    Point3::new(x, y, z)
}

fn vector<S: Scalar>(x: S, y: S, z: S) -> Vec3<S> {
    Vec3::new(x, y, z)
}

/// The number on one axis, or on all.
fn on_axis<S: Scalar>(case: usize, x: S) -> Vec3<S> {
    let mut v = vector(zero(), one(), zero());
    match case {
        0..3 => v[case] = x,
        _ => v = vector(x, x, x),
    }
    v
}

fn insert<S: Scalar>(place: &mut Place<S>, change: impl Fn(&mut Marble<S>)) -> Outcome {
    let mut marble = Marble::new(point(one(), S::from_f64(1.4), zero()), S::from_f64(0.5));
    change(&mut marble);
    place.subject = place.world.marbles.insert(marble)?;
    Ok(())
}

/// The number as one of a material, of the ball, of the floor and of the swarm.
fn material<S: Scalar>(place: &mut Place<S>, x: S, set: impl Fn(&mut Material<S>, S)) -> Outcome {
    let mut material = Material::default();
    set(&mut material, x);
    match place.case {
        0 => place.world.marbles.set_material(place.subject, Some(material)),
        1 => place.world.walls.set_material(place.wall, Some(material)),
        _ => material.validated().map(|_| ()),
    }
}

fn wall<S: Scalar>(place: &mut Place<S>, wall: impl Into<WallShape<S>>) -> Outcome {
    match place.case % 2 {
        0 => place.world.walls.insert(wall).map(|_| ()),
        _ => place.world.walls.set(place.wall, wall),
    }
}

/// As it is, or in a compound.
fn solid<S: Scalar>(place: &mut Place<S>, shape: Shape<S>) -> Outcome {
    if place.case < 2 { wall(place, shape) } else { wall(place, Compound::new(vec![shape])?) }
}

fn pose<S: Scalar>(rotation: Quat<S>, translation: Vec3<S>) -> Pose<S> {
    Pose { rotation, translation }
}

fn quaternions<S: Scalar>(x: S) -> [Quat<S>; 3] {
    [
        Quat::new(x, zero(), zero(), zero()),
        Quat::new(zero(), x, zero(), zero()),
        Quat::new(one(), x, x, x),
    ]
}

fn surfaces<S: Scalar>() -> (Arc<Mesh<S>>, Arc<HeightField<S>>) {
    let corners = vec![
        point(zero(), zero(), zero()),
        point(one(), zero(), zero()),
        point(zero(), zero(), one()),
    ];
    let mesh = Mesh::new(corners, vec![[0, 1, 2]]).unwrap();
    let corner = point(zero(), zero(), zero());
    let field = HeightField::new(corner, [one(), one()], 2, vec![zero(); 4]).unwrap();
    (Arc::new(mesh), Arc::new(field))
}

fn with_pose<S: Scalar>(place: &mut Place<S>, pose: Pose<S>) -> Outcome {
    let (mesh, field) = surfaces();
    if place.case < 3 {
        wall(place, WallShape::Mesh(mesh, pose))
    } else {
        wall(place, WallShape::HeightField(field, pose))
    }
}

fn swarm_ball<S: Scalar>() -> swarm::Ball<S> {
    let [x, y, z, radius] = [3.0, 2.0, 0.0, 0.1].map(S::from_f64);
    swarm::Ball::new(Point3::new(x, y, z), radius)
}

fn into_swarm<S: Scalar>(place: &mut Place<S>, change: impl Fn(&mut swarm::Ball<S>)) -> Outcome {
    let mut ball = swarm_ball();
    change(&mut ball);
    place.world.swarm.insert(&[ball]).map(|_| ())
}

fn model<S: Scalar>(place: &mut Place<S>, substeps: u32, iterations: u32) -> Outcome {
    let model = Model { substeps, iterations, ..place.world.model() };
    place.world.set_model(model)
}

/// A number of parts, or one too many.
fn count<S: Scalar>(x: S) -> u32 {
    if x.is_nan() { 0 } else { x.as_f64().abs().min(1100.0) as u32 }
}

macro_rules! table {
    ($($scope:ident $cases:literal $names:literal: $act:expr;)*) => {
        vec![$(Row { names: $names, scope: Scope::$scope, cases: $cases, act: $act }),*]
    };
}

pub fn rows<S: Scalar>() -> Vec<Row<S>> {
    let mut rows = marbles();
    rows.extend(forces());
    rows.extend(worlds());
    rows.extend(materials());
    rows.extend(swarms());
    rows.extend(walls().into_iter().chain(super::joint_rows::joints()));
    rows.extend(super::body_rows::bodies());
    rows.extend(constructors());
    rows.extend(planes_and_frames());
    rows
}

fn marbles<S: Scalar>() -> Vec<Row<S>> {
    table! {
        Marble 4 "Marbles::insert Marble.position": |p, x| { let v = on_axis(p.case, x); insert(p, |m| m.position = Point3::from_vec(v)) };
        Marble 1 "Marble.radius": |p, x| insert(p, |m| m.radius = x);
        Marble 1 "Marble.half_length": |p, x| {
            if p.knows_balls_only() { return Ok(()) }
            insert(p, |m| m.half_length = x)
        };
        Marble 4 "Marble.velocity": |p, x| { let v = on_axis(p.case, x); insert(p, |m| m.velocity = v) };
        Marble 3 "Marble.rotation": |p, x| { let q = quaternions(x)[p.case]; insert(p, |m| m.rotation = q) };
        Marble 4 "Marble.angular_velocity": |p, x| { let v = on_axis(p.case, x); insert(p, |m| m.angular_velocity = v) };
        Marble 1 "Marble.mass Mass::Density": |p, x| insert(p, |m| m.mass = Mass::Density(x));
        Marble 1 "Mass::Kilograms": |p, x| insert(p, |m| m.mass = Mass::Kilograms(x));
        Marble 1 "Marble.gravity_scale": |p, x| insert(p, |m| m.gravity_scale = x);
        Marble 1 "Marble.damping Damping.linear": |p, x| insert(p, |m| m.damping.linear = x);
        Marble 1 "Damping.angular": |p, x| insert(p, |m| m.damping.angular = x);
        Marble 1 "Marble.material Marble.integrator Marble.rotation_model Marble.sleeping_disabled": |p, x| insert(p, |m| {
            m.material = Some(Material { restitution: x, ..Material::default() });
            m.integrator = Some(Integrator::Rk4);
            m.rotation_model = Some(Rotation::Rolling);
            m.sleeping_disabled = true;
        });
        Marble 4 "Marbles::set_position": |p, x| { let v = on_axis(p.case, x); p.world.marbles.set_position(p.subject, Point3::from_vec(v)) };
        Marble 4 "Marbles::set_velocity": |p, x| { let v = on_axis(p.case, x); p.world.marbles.set_velocity(p.subject, v) };
        Marble 1 "Marbles::set_radius": |p, x| p.world.marbles.set_radius(p.subject, x);
        Marble 1 "Marbles::set_half_length": |p, x| {
            if p.knows_balls_only() && x > zero() { return Ok(()) }
            p.world.marbles.set_half_length(p.subject, x)
        };
        Marble 3 "Marbles::set_rotation": |p, x| p.world.marbles.set_rotation(p.subject, quaternions(x)[p.case]);
        Marble 4 "Marbles::set_angular_velocity": |p, x| { let v = on_axis(p.case, x); p.world.marbles.set_angular_velocity(p.subject, v) };
        Marble 1 "Marbles::set_sleeping_disabled": |p, x| p.world.marbles.set_sleeping_disabled(p.subject, x > zero());
        Marble 1 "Marbles::set_layers Marble.layers": |p, x| p.world.marbles.set_layers(p.subject, taw::broad::CollisionLayers::new(x.as_f64() as u32, !0));
        Marble 1 "Marbles::set_mass": |p, x| p.world.marbles.set_mass(p.subject, Mass::Kilograms(x));
        Marble 1 "Marbles::set_gravity_scale": |p, x| p.world.marbles.set_gravity_scale(p.subject, x);
        Marble 1 "Marbles::set_damping": |p, x| p.world.marbles.set_damping(p.subject, Damping { linear: x, angular: x });
        Marble 1 "Marbles::set_material": |p, x| {
            let material = Material { friction: x, ..Material::default() };
            p.world.marbles.set_material(p.subject, Some(material))
        };
        Marble 4 "Marbles::apply_force": |p, x| { let v = on_axis(p.case, x); p.world.marbles.apply_force(p.subject, v) };
        Marble 1 "Marbles::apply_acceleration": |p, x| { let v = on_axis(p.case, x); p.world.marbles.apply_acceleration(p.subject, v) };
        Marble 1 "Marbles::apply_force_at": |p, x| {
            let up = vector(zero(), one(), zero());
            p.world.marbles.apply_force_at(p.subject, up * x, point(one(), x, zero()))
        };
        Marble 1 "Marbles::apply_torque": |p, x| p.world.marbles.apply_torque(p.subject, vector(x, x, x));
        Marble 1 "Marbles::apply_impulse": |p, x| p.world.marbles.apply_impulse(p.subject, vector(x, x, x));
        Marble 1 "Marbles::apply_impulse_at": |p, x| {
            p.world.marbles.apply_impulse_at(p.subject, vector(x, one(), zero()), point(zero(), x, one()))
        };
        Marble 1 "Marbles::apply_angular_impulse": |p, x| p.world.marbles.apply_angular_impulse(p.subject, vector(x, x, x));
        Marble 1 "Marbles::set_momentum": |p, x| p.world.marbles.set_momentum(p.subject, vector(x, x, x));
    }
}

fn forces<S: Scalar>() -> Vec<Row<S>> {
    table! {
        World 4 "World::set_gravity": |p, x| {
            p.world.set_gravity(on_axis(p.case, x))
        };
        World 1 "World::set_forces ForceField::Drag Medium.velocity": |p, x| {
            let velocity = vector(x, zero(), zero());
            p.world.set_forces(vec![ForceField::Drag(Medium { velocity, linear: one(), quadratic: one() })])
        };
        World 1 "Medium.linear": |p, x| {
            let velocity = vector(one(), zero(), zero());
            p.world.set_forces(vec![ForceField::Drag(Medium { velocity, linear: x, quadratic: one() })])
        };
        World 1 "Medium.quadratic": |p, x| {
            let velocity = vector(one(), zero(), zero());
            p.world.set_forces(vec![ForceField::Drag(Medium { velocity, linear: one(), quadratic: x })])
        };
        World 1 "ForceField::Spring.anchor": |p, x| {
            let anchor = point(x, x, x);
            p.world.set_forces(vec![ForceField::Spring { anchor, rest_length: one(), stiffness: one() }])
        };
        World 1 "ForceField::Spring.rest_length": |p, x| {
            let anchor = point(zero(), zero(), zero());
            p.world.set_forces(vec![ForceField::Spring { anchor, rest_length: x, stiffness: one() }])
        };
        World 1 "ForceField::Spring.stiffness": |p, x| {
            let anchor = point(zero(), zero(), zero());
            p.world.set_forces(vec![ForceField::Spring { anchor, rest_length: one(), stiffness: x }])
        };
        World 1 "ForceField::Attraction.center": |p, x| {
            p.world.set_forces(vec![ForceField::Attraction { center: point(x, x, x), strength: one() }])
        };
        World 1 "ForceField::Attraction.strength": |p, x| {
            let center = point(zero(), zero(), zero());
            p.world.set_forces(vec![ForceField::Attraction { center, strength: x }])
        };
        World 1 "ForceField::Custom": |p, x| {
            if !x.is_nan() { return Ok(()) }
            p.world.set_forces(vec![ForceField::Custom(|_, mass| vector(mass / S::zero(), S::zero(), S::zero()))])
        };
    }
}

fn worlds<S: Scalar>() -> Vec<Row<S>> {
    table! {
        World 1 "World::set_speed_limits SpeedLimits.linear": |p, x| {
            p.world.set_speed_limits(SpeedLimits { linear: Some(x), angular: None })
        };
        World 1 "SpeedLimits.angular": |p, x| {
            p.world.set_speed_limits(SpeedLimits { linear: None, angular: Some(x) })
        };
        World 3 "World::set_period": |p, x| {
            let mut lengths = [None; 3];
            lengths[p.case] = Some(x);
            p.world.set_period(lengths)
        };
        World 1 "World::set_model Model.integrator Model.response Model.rotation Model.precision Model.detection Model.substeps": |p, x| model(p, count(x), 8);
        World 1 "Model.iterations": |p, x| model(p, 1, count(x));
        World 1 "World::step": |p, x| p.world.step(x);
        World 1 "World::integrate": |p, x| p.world.integrate(x);
        World 1 "World::restitute": |p, x| p.world.restitute(x);
        World 1 "World::step_swarm": |p, x| p.world.step_swarm(x, &mut |_| ());
        World 1 "Simulation::step": |p, x| Simulation::from(p.world.clone()).step(x);
        World 1 "Simulation::move_walls": |p, x| Simulation::from(p.world.clone()).move_walls(x);
        World 1 "KinematicMotion::pose": |_, x| {
            let moves = KinematicMotion::Rotate { pivot: [0.0; 3], axis: [0.0, 1.0, 0.0], degrees_per_second: 1.0 };
            moves.pose(x.as_f64()).map(|_| ())
        };
    }
}

fn materials<S: Scalar>() -> Vec<Row<S>> {
    table! {
        World 3 "Material.restitution Material::validated Walls::set_material": |p, x| material(p, x, |m, x| m.restitution = x);
        World 3 "Material.friction": |p, x| material(p, x, |m, x| m.friction = x);
        World 3 "Material.tangential_restitution Material.combine": |p, x| material(p, x, |m, x| m.tangential_restitution = x);
        World 3 "Material.rolling_resistance": |p, x| material(p, x, |m, x| m.rolling_resistance = x);
        World 3 "Material.spinning_resistance": |p, x| material(p, x, |m, x| m.spinning_resistance = x);
        World 3 "Material.elasticity Elasticity.youngs_modulus": |p, x| {
            material(p, x, |m, x| m.elasticity = Elasticity { youngs_modulus: x, ..m.elasticity })
        };
        World 3 "Elasticity.poissons_ratio": |p, x| {
            material(p, x, |m, x| m.elasticity = Elasticity { poissons_ratio: x, ..m.elasticity })
        };
    }
}

fn swarms<S: Scalar>() -> Vec<Row<S>> {
    table! {
        World 4 "Swarm::insert": |p, x| {
            let case = p.case;
            into_swarm(p, |ball| match case {
                0 => ball.position.x = x,
                1 => ball.radius = x,
                2 => ball.velocity.y = x,
                _ => ball.mass = Mass::Density(x),
            })
        };
        World 1 "Swarm::set_position": |p, x| {
            let before = p.world.clone();
            let ball = p.world.swarm.insert(&[swarm_ball()])?[0];
            p.world.swarm.set_position(ball, Point3::from([x; 3])).inspect_err(|_| p.world = before)
        };
        World 1 "Swarm::set_velocity": |p, x| {
            let before = p.world.clone();
            let ball = p.world.swarm.insert(&[swarm_ball()])?[0];
            p.world.swarm.set_velocity(ball, Vec3::from([x; 3])).inspect_err(|_| p.world = before)
        };
        World 3 "Swarm::set_material": |p, x| {
            let before = p.world.clone();
            let ball = p.world.swarm.insert(&[swarm_ball()])?[0];
            let plain = Material::default();
            let material = match p.case {
                0 => Material { friction: x, ..plain },
                1 => Material { restitution: x, ..plain },
                _ => Material { rolling_resistance: x, ..plain },
            };
            p.world.swarm.set_material(ball, Some(material)).inspect_err(|_| p.world = before)
        };
        World 1 "Swarm::set_layers": |p, x| {
            let ball = p.world.swarm.insert(&[swarm_ball()])?[0];
            p.world.swarm.set_layers(&[ball], taw::broad::CollisionLayers::new(x.as_f64() as u32, !0))
        };
        World 1 "Sensors::set_layers": |p, x| p.world.sensors.set_layers(p.sensor, taw::broad::CollisionLayers::new(!0, x.as_f64() as u32));
        World 1 "Walls::set_layers": |p, x| p.world.walls.set_layers(p.wall, taw::broad::CollisionLayers::new(!0, x.as_f64() as u32));
        World 1 "Swarm::set_gravity_scale": |p, x| {
            let before = p.world.clone();
            let ball = p.world.swarm.insert(&[swarm_ball()])?[0];
            p.world.swarm.set_gravity_scale(ball, x).inspect_err(|_| p.world = before)
        };
        World 3 "Swarm::apply_acceleration": |p, x| {
            let before = p.world.clone();
            let ball = p.world.swarm.insert(&[swarm_ball()])?[0];
            p.world.swarm.apply_acceleration(ball, on_axis(p.case, x)).inspect_err(|_| p.world = before)
        };
        World 1 "Swarm::set_model": |p, x| {
            let material = Material { friction: x, ..Material::default() };
            p.world.swarm.set_model(swarm::SwarmModel { material, ..p.world.swarm.model() })
        };
    }
}

fn walls<S: Scalar>() -> Vec<Row<S>> {
    table! {
        World 4 "Walls::insert Walls::set NBall.center": |p, x| {
            solid(p, Shape::Sphere(Sphere { center: point(x, zero(), x), radius: one() }))
        };
        World 4 "NBall.radius": |p, x| {
            solid(p, Shape::Sphere(Sphere { center: point(zero(), -one::<S>(), zero()), radius: x }))
        };
        World 4 "Aabb.min": |p, x| solid(p, Shape::Aabb(Aabb { min: point(x, x, x), max: point(one(), zero(), one()) }));
        World 4 "Aabb.max": |p, x| solid(p, Shape::Aabb(Aabb { min: point(zero(), -one::<S>(), zero()), max: point(x, x, x) }));
        World 4 "Obb.center": |p, x| {
            let half_extents = vector(one(), one(), one());
            let rotation = Quat::new(one(), zero(), zero(), zero());
            solid(p, Shape::Obb(Obb { center: point(x, x, x), rotation, half_extents }))
        };
        World 4 "Obb.rotation": |p, x| {
            let (center, half_extents) = (point(zero(), -one::<S>(), zero()), vector(one(), one(), one()));
            solid(p, Shape::Obb(Obb { center, rotation: quaternions(x)[p.case % 3], half_extents }))
        };
        World 4 "Obb.half_extents": |p, x| {
            let rotation = Quat::new(one(), zero(), zero(), zero());
            solid(p, Shape::Obb(Obb { center: point(zero(), -one::<S>(), zero()), rotation, half_extents: vector(x, x, x) }))
        };
        World 4 "Capsule.a": |p, x| solid(p, Shape::Capsule(Capsule { a: point(x, x, x), b: point(zero(), zero(), zero()), radius: one() }));
        World 4 "Capsule.b": |p, x| solid(p, Shape::Capsule(Capsule { a: point(zero(), zero(), zero()), b: point(x, x, x), radius: one() }));
        World 4 "Capsule.radius": |p, x| solid(p, Shape::Capsule(Capsule { a: point(zero(), zero(), zero()), b: point(one(), zero(), zero()), radius: x }));
        World 6 "Pose.rotation Pose::validated": |p, x| {
            let pose = pose(quaternions(x)[p.case % 3], vector(zero(), zero(), zero()));
            pose.validated()?;
            with_pose(p, pose)
        };
        World 6 "Pose.translation": |p, x| with_pose(p, pose(Quat::new(one(), zero(), zero(), zero()), vector(x, x, x)));
        World 1 "WallShape::transformed": |p, x| {
            let pose = pose(Quat::new(one(), zero(), zero(), zero()), vector(x, x, x));
            let moved = p.world.walls.get(p.wall)?.transformed(pose)?;
            p.world.walls.set(p.wall, moved)
        };
        World 4 "Sensors::set_motion": |p, x| {
            let motion = WallMotion { velocity: on_axis(p.case, x), angular_velocity: on_axis(p.case, x), pivot: point(x, x, x) };
            p.world.sensors.set_motion(p.sensor, Some(motion))
        };
        World 4 "Sensors::set Sensors::insert": |p, x| {
            let (at, radius) = if p.case < 2 { (x, one()) } else { (zero(), x) };
            let ball = Sphere { center: point(at, at, at), radius };
            if p.case % 2 == 0 { p.world.sensors.set(p.sensor, ball) } else { p.world.sensors.insert(ball).map(|_| ()) }
        };
        World 4 "Walls::set_one_way": |p, x| p.world.walls.set_one_way(p.wall, Some(on_axis(p.case, x)));
        World 4 "Walls::set_motion WallMotion.velocity": |p, x| {
            let (none, pivot) = (vector(zero(), zero(), zero()), point(zero(), zero(), zero()));
            { let v = on_axis(p.case, x); p.world.walls.set_motion(p.wall, Some(WallMotion { velocity: v, angular_velocity: none, pivot })) }
        };
        World 1 "WallMotion.angular_velocity": |p, x| {
            let (none, pivot) = (vector(zero(), zero(), zero()), point(zero(), zero(), zero()));
            p.world.walls.set_motion(p.wall, Some(WallMotion { velocity: none, angular_velocity: vector(x, x, x), pivot }))
        };
        World 1 "WallMotion.pivot": |p, x| {
            let (none, spin) = (vector(zero(), zero(), zero()), vector(zero(), zero(), one()));
            p.world.walls.set_motion(p.wall, Some(WallMotion { velocity: none, angular_velocity: spin, pivot: point(x, x, x) }))
        };
    }
}

fn constructors<S: Scalar>() -> Vec<Row<S>> {
    table! {
        World 4 "NBall::new": |p, x| {
            let (at, radius) = if p.case < 2 { (x, one()) } else { (zero(), x) };
            wall(p, Sphere::new(point(at, at, at), radius)?)
        };
        World 2 "Aabb::new": |p, x| wall(p, Aabb3::new(point(x, -one::<S>(), zero()), point(one(), zero(), x))?);
        World 3 "Obb::new": |p, x| {
            let straight = Quat::new(one(), zero(), zero(), zero());
            let unit = vector(one(), one(), one());
            let origin = point(zero(), zero(), zero());
            wall(p, match p.case {
                0 => Obb::new(point(x, x, x), straight, unit)?,
                1 => Obb::new(origin, Quat::new(x, zero(), zero(), zero()), unit)?,
                _ => Obb::new(origin, straight, vector(x, x, one()))?,
            })
        };
        World 4 "Capsule::new": |p, x| {
            let (at, radius) = if p.case < 2 { (x, one()) } else { (zero(), x) };
            wall(p, Capsule::new(point(at, zero(), zero()), point(one(), zero(), at), radius)?)
        };
        World 2 "Compound::new": |p, x| {
            let sphere = Sphere { center: point(x, zero(), zero()), radius: one() };
            wall(p, Compound::new(vec![Shape::Sphere(sphere)])?)
        };
        World 2 "Hull::new": |p, x| {
            let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
            let mut corners = corners.map(|c| Point3::from(c.map(S::from_f64))).to_vec();
            corners.push(point(zero(), zero(), x));
            match Hull::new(&corners) {
                Err(Error::Coplanar { field }) => Err(Error::NotUnit { field, value: 0.0 }),
                hull => wall(p, hull?),
            }
        };
        World 2 "Mesh::new": |p, x| {
            let corners = vec![point(x, zero(), zero()), point(one(), zero(), zero()), point(zero(), zero(), x)];
            wall(p, Mesh::new(corners, vec![[0, 1, 2]])?)
        };
        World 3 "HeightField::new": |p, x| {
            let corner = point(zero(), zero(), zero());
            wall(p, match p.case {
                0 => HeightField::new(corner, [one(), one()], 2, vec![x, zero(), zero(), zero()])?,
                1 => HeightField::new(corner, [x, one()], 2, vec![zero(); 4])?,
                _ => HeightField::new(point(x, x, x), [one(), one()], 2, vec![x; 4])?,
            })
        };
    }
}

fn planes_and_frames<S: Scalar>() -> Vec<Row<S>> {
    table! {
        World 4 "Plane::new": |p, x| {
            let (normal, offset) = if p.case < 2 { (x, zero()) } else { (one(), x) };
            wall(p, Plane::new(vector(zero(), normal, zero()), offset)?)
        };
        World 4 "Plane::through": |p, x| {
            let (at, along) = if p.case < 2 { (x, one()) } else { (zero(), x) };
            wall(p, Plane::through(point(at, at, at), vector(zero(), along, along))?)
        };
        World 3 "AxisAngle::new": |p, x| {
            let half_extents = vector(one(), one(), one());
            let turned = |axis, angle| AxisAngle::new(axis, angle).map(Quat::from);
            let rotation = match p.case {
                0 => turned(vector(x, x, zero()), one())?,
                _ => turned(vector(zero(), one(), zero()), x)?,
            };
            wall(p, Obb::new(point(zero(), zero(), zero()), rotation, half_extents)?)
        };
        World 2 "LookAt::new": |p, x| {
            let rotation = Quat::from(LookAt::new(vector(x, one(), zero()), vector(zero(), x, x))?);
            wall(p, Obb::new(point(zero(), zero(), zero()), rotation, vector(one(), one(), one()))?)
        };
        World 1 "Camera::new": |_, x| {
            let eye = pose(Quat::new(one(), zero(), zero(), zero()), vector(zero(), zero(), zero()));
            Camera::new(eye, x, one(), [one(), S::from_f64(9.0)])?;
            Camera::new(eye, one(), x, [one(), S::from_f64(9.0)])?;
            Camera::new(eye, one(), one(), [x, S::from_f64(9.0)])?;
            Camera::new(eye, one(), one(), [one(), x])?;
            Camera::new(pose(eye.rotation, vector(x, x, x)), one(), one(), [one(), one()]).map(|_| ())
        };
        World 1 "Tree::insert Tree::set_local": |_, x| {
            let mut tree = Tree::default();
            let root = tree.insert(None, Pose::<S>::identity())?;
            let straight = Quat::new(one(), zero(), zero(), zero());
            tree.insert(Some(root), pose(straight, vector(x, x, x)))?;
            quaternions(x).into_iter().try_for_each(|q| tree.set_local(root, pose(q, vector(zero(), zero(), zero()))))
        };
        World 1 "Scene::run": |_, x| {
            let scene = taw::scene::Scene { duration: x.as_f64(), ..taw::scene::Scene::default() };
            scene.run::<S>(Model::default()).map(|_| ())
        };
    }
}
