//! Rapier, with `parallel` and `simd8`, otherwise by default.

use bevy::math::{Quat, Vec3};
use rapier3d::prelude as rapier;

use crate::scene::Scene;
use crate::{DT, Engine, FRICTION, RESTITUTION};

/// Rapier has another glam.
fn theirs(v: Vec3) -> rapier::Vector {
    rapier::Vector::new(v.x, v.y, v.z)
}

fn their_turn(q: Quat) -> rapier::Rotation {
    rapier::Rotation::from_xyzw(q.x, q.y, q.z, q.w)
}

pub struct Rapier {
    world: rapier::PhysicsWorld,
    frame: rapier::RigidBodyHandle,
    balls: Vec<rapier::RigidBodyHandle>,
}

impl Rapier {
    pub fn new(scene: &Scene) -> Self {
        let mut world = rapier::PhysicsWorld {
            gravity: rapier::Vector::new(0.0, -9.81, 0.0),
            ..Default::default()
        };
        world.integration_parameters.dt = DT;
        let frame = world.bodies.insert(rapier::RigidBodyBuilder::kinematic_position_based());
        let with = |collider: rapier::ColliderBuilder| {
            collider.friction(FRICTION).restitution(RESTITUTION).build()
        };
        for (up, at) in &scene.planes {
            let shape = rapier::SharedShape::halfspace(theirs(*up));
            let collider = rapier::ColliderBuilder::new(shape).translation(theirs(*at));
            world.colliders.insert_with_parent(with(collider), frame, &mut world.bodies);
        }
        for (center, half, turn) in &scene.boxes {
            let collider = rapier::ColliderBuilder::cuboid(half.x, half.y, half.z)
                .position(rapier::Pose::from_parts(theirs(*center), their_turn(*turn)));
            world.colliders.insert_with_parent(with(collider), frame, &mut world.bodies);
        }
        let mut balls = Vec::new();
        for (at, radius) in &scene.balls {
            let body =
                rapier::RigidBodyBuilder::dynamic().translation(theirs(*at)).can_sleep(false);
            let collider = with(rapier::ColliderBuilder::ball(*radius).density(1.0));
            balls.push(world.insert(body, collider).0);
        }
        Self { world, frame, balls }
    }
}

impl Engine for Rapier {
    fn step(&mut self, from: Quat, to: Quat) {
        if from != to {
            self.world.bodies[self.frame].set_next_kinematic_rotation(their_turn(to));
        }
        self.world.step();
    }

    fn state(&self) -> Vec<[Vec3; 2]> {
        let of = |ball: &rapier::RigidBodyHandle| {
            let body = &self.world.bodies[*ball];
            [body.translation(), body.linvel()].map(|v| Vec3::new(v.x, v.y, v.z))
        };
        self.balls.iter().map(of).collect()
    }
}
