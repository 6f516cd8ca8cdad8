//! taw's core: the swarm, and marbles by each response.

use bevy::math::{Quat, Vec3};
use taw::prelude as core;
use taw::swarm::{Ball, BallId, SwarmModel, Tier};

use crate::scene::Scene;
use crate::{DT, Engine, FRICTION, RESTITUTION};

pub fn material() -> core::Material<f32> {
    core::Material { friction: FRICTION, restitution: RESTITUTION, ..Default::default() }
}

/// Model of the solver, which works for marbles too.
pub fn swarm_model(tier: Tier, substeps: u32, threads: usize, sleeps: bool) -> SwarmModel {
    let threads = u32::try_from(threads).expect("few threads");
    SwarmModel { tier, substeps, threads, material: material(), sleeps }
}

/// Friction and spin; two substeps where the response solves once in each, else one.
pub fn model(response: core::Response) -> core::Model {
    let substeps = if response == core::Response::SoftStep { 2 } else { 1 };
    let rotation = core::Rotation::Dynamic;
    core::Model { response, rotation, substeps, ..core::Model::default() }
}

enum Balls {
    Swarm(Vec<BallId>),
    Marbles(Vec<core::MarbleId>),
}

pub struct Taw {
    world: core::World<f32>,
    balls: Balls,
    planes: Vec<(core::WallId, Vec3, Vec3)>,
    boxes: Vec<(core::WallId, Vec3, Vec3, Quat)>,
}

fn vector(v: Vec3) -> core::Vec3<f32> {
    core::Vec3::new(v.x, v.y, v.z)
}

fn point(v: Vec3) -> core::Point3<f32> {
    core::Point3::new(v.x, v.y, v.z)
}

fn plane(up: Vec3, point: Vec3) -> core::Plane<f32> {
    core::Plane::new(vector(up.normalize()), up.normalize().dot(point)).expect("a unit vector")
}

fn cuboid(center: Vec3, half: Vec3, turn: Quat) -> core::WallShape<f32> {
    let turn = taw::math::Quat::new(turn.w, turn.x, turn.y, turn.z);
    let shape = taw::shape::Obb::new(point(center), turn, vector(half)).expect("a box");
    core::WallShape::Solid(taw::shape::Shape::Obb(shape))
}

impl Taw {
    fn empty(scene: &Scene, swarm: SwarmModel) -> Self {
        let mut world = core::World::default();
        world.swarm.set_model(swarm).expect("a model");
        let mut place = |shape: core::WallShape<f32>| world.walls.insert(shape).expect("a wall");
        let planes = scene.planes.iter().map(|(up, at)| (place(plane(*up, *at).into()), *up, *at));
        let planes = planes.collect();
        let boxes = scene.boxes.iter().map(|(c, h, q)| (place(cuboid(*c, *h, *q)), *c, *h, *q));
        let boxes = boxes.collect();
        Self { world, balls: Balls::Swarm(Vec::new()), planes, boxes }
    }

    pub fn swarm(scene: &Scene, tier: Tier, substeps: u32, threads: usize) -> Self {
        let mut taw = Self::empty(scene, swarm_model(tier, substeps, threads, scene.sleeps));
        let ball = |(at, radius): &(Vec3, f32)| Ball {
            mass: core::Mass::Density(1.0),
            ..Ball::new(point(*at), *radius)
        };
        let balls: Vec<_> = scene.balls.iter().map(ball).collect();
        taw.balls = Balls::Swarm(taw.world.swarm.insert(&balls).expect("balls"));
        taw
    }

    pub fn marbles(scene: &Scene, response: core::Response, threads: usize) -> Self {
        let mut taw = Self::empty(scene, swarm_model(Tier::Full, 2, threads, scene.sleeps));
        taw.world.set_model(model(response)).expect("a model");
        let marbles = scene.balls.iter().map(|(at, radius)| {
            let marble = taw::world::Marble {
                mass: core::Mass::Density(1.0),
                material: Some(material()),
                ..taw::world::Marble::new(point(*at), *radius)
            };
            taw.world.marbles.insert(marble).expect("a marble")
        });
        taw.balls = Balls::Marbles(marbles.collect());
        taw
    }
}

impl Engine for Taw {
    fn step(&mut self, from: Quat, to: Quat) {
        if from != to {
            let spin = vector((to * from.inverse()).to_scaled_axis() / DT);
            let motion = taw::motion::WallMotion {
                velocity: vector(Vec3::ZERO),
                angular_velocity: spin,
                pivot: point(Vec3::ZERO),
            };
            for (id, up, at) in &self.planes {
                self.world.walls.set(*id, plane(to * *up, to * *at)).expect("a wall");
                self.world.walls.set_motion(*id, Some(motion)).expect("a wall");
            }
            for (id, center, half, turn) in &self.boxes {
                let shape = cuboid(to * *center, *half, to * *turn);
                self.world.walls.set(*id, shape).expect("a wall");
                self.world.walls.set_motion(*id, Some(motion)).expect("a wall");
            }
        }
        self.world.step(DT).expect("a step");
    }

    fn state(&self) -> Vec<[Vec3; 2]> {
        let swarm = &self.world.swarm;
        let of_ball = |id: &BallId| {
            let row = swarm.row(*id).expect("a ball");
            [swarm.balls()[row], swarm.velocities()[row]].map(|r| Vec3::from_slice(&r[..3]))
        };
        let of_marble = |id: &core::MarbleId| {
            let marble = self.world.marbles.get(*id).expect("a marble");
            let (at, velocity) = (marble.position, marble.velocity);
            [Vec3::new(at.x, at.y, at.z), Vec3::new(velocity.x, velocity.y, velocity.z)]
        };
        match &self.balls {
            Balls::Swarm(ids) => ids.iter().map(of_ball).collect(),
            Balls::Marbles(ids) => ids.iter().map(of_marble).collect(),
        }
    }
}
