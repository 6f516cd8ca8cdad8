//! Box3D through the crate `boxddd`, with its own threads and four substeps, its default. It has no
//! half-spaces: boxes a metre thick stand for them.

use bevy::math::{Quat, Vec3};
use boxddd::{BodyId, BodyType, BoxHull, Foundation, Sphere, Transform, WorldTransform};

use crate::scene::Scene;
use crate::{DT, Engine, FRICTION, RESTITUTION, THREADS};

const SUBSTEPS: i32 = 4;

pub struct Box3d {
    world: boxddd::World,
    frame: BodyId,
    balls: Vec<BodyId>,
}

fn vector(v: Vec3) -> boxddd::Vec3 {
    boxddd::Vec3::new(v.x, v.y, v.z)
}

fn rotation(q: Quat) -> boxddd::Quat {
    boxddd::Quat { v: boxddd::Vec3::new(q.x, q.y, q.z), s: q.w }
}

impl Box3d {
    pub fn new(scene: &Scene) -> boxddd::Result<Self> {
        let foundation = Foundation::initialize_default()?;
        let threads = u32::try_from(THREADS).expect("few threads");
        let world = foundation
            .world_def_builder()
            .gravity([0.0, -9.81, 0.0])
            .enable_sleep(false)
            .worker_count(threads);
        let mut world = foundation.create_world(world.build()?)?;
        let body = foundation.body_def_builder().body_type(BodyType::Kinematic);
        let frame = world.create_body(body.build()?)?;
        let surface = || {
            let shape = foundation.shape_def_builder().density(1.0);
            shape.friction(FRICTION).restitution(RESTITUTION).build()
        };
        let place = |at: Vec3, turn: Quat| Transform { p: vector(at), q: rotation(turn) };
        let slab = Vec3::new(100.0, 0.5, 100.0);
        let planes = scene.planes.iter().map(|(up, at)| {
            let up = up.normalize();
            (*at - up * slab.y, slab, Quat::from_rotation_arc(Vec3::Y, up))
        });
        for (center, half, turn) in planes.chain(scene.boxes.iter().copied()) {
            let hull = BoxHull::transformed(half.x, half.y, half.z, place(center, turn))?;
            world.create_hull_shape(frame, &surface()?, &hull)?;
        }
        let mut balls = Vec::new();
        for (at, radius) in &scene.balls {
            let body = foundation.body_def_builder().body_type(BodyType::Dynamic);
            let body = body.position([at.x, at.y, at.z]).enable_sleep(false);
            let body = world.create_body(body.build()?)?;
            world.create_sphere_shape(body, &surface()?, &Sphere::new([0.0; 3], *radius))?;
            balls.push(body);
        }
        Ok(Self { world, frame, balls })
    }

    fn try_step(&mut self, from: Quat, to: Quat) -> boxddd::Result<()> {
        if from != to {
            let target = WorldTransform { p: [0.0; 3].into(), q: rotation(to) };
            self.world.set_body_target_transform(self.frame, target, DT, true)?;
        }
        self.world.step(DT, SUBSTEPS)
    }
}

impl Engine for Box3d {
    fn step(&mut self, from: Quat, to: Quat) {
        self.try_step(from, to).expect("a step");
    }

    fn state(&self) -> Vec<[Vec3; 2]> {
        let of = |ball: &BodyId| {
            let at = self.world.body_position(*ball).expect("a body");
            let velocity = self.world.body_linear_velocity(*ball).expect("a body");
            [Vec3::new(at.x, at.y, at.z), Vec3::new(velocity.x, velocity.y, velocity.z)]
        };
        self.balls.iter().map(of).collect()
    }
}
