//! Rapier 0.36.

use rapier3d::prelude::*;

use crate::{Ball, Engine, Setup};

pub struct Rapier {
    world: PhysicsWorld,
    balls: Vec<RigidBodyHandle>,
    ccd: bool,
}

impl Engine for Rapier {
    fn new(setup: &Setup, gravity: f32, dt: f32) -> Self {
        let mut world =
            PhysicsWorld { gravity: Vector::new(0.0, -gravity, 0.0), ..Default::default() };
        let parameters = &mut world.integration_parameters;
        parameters.dt = dt;
        parameters.length_unit = setup.unit;
        parameters.num_solver_iterations *= setup.finer;
        if setup.coulomb {
            parameters.friction_model = FrictionModel::Coulomb;
        }
        Self { world, balls: Vec::new(), ccd: setup.ccd }
    }

    fn floor(&mut self, up: [f32; 3]) {
        let plane = ColliderBuilder::new(SharedShape::halfspace(Vector::from(up).normalize()))
            .friction(0.0)
            .restitution(0.0);
        self.world.insert(RigidBodyBuilder::fixed(), plane);
    }

    fn insert(&mut self, ball: &Ball) {
        let body = RigidBodyBuilder::dynamic()
            .translation(ball.at.into())
            .linvel(ball.velocity.into())
            .can_sleep(false)
            .ccd_enabled(self.ccd);
        let collider = ColliderBuilder::ball(ball.radius)
            .mass(ball.mass)
            .restitution(ball.e)
            .friction(ball.mu)
            .restitution_combine_rule(CoefficientCombineRule::Max)
            .friction_combine_rule(CoefficientCombineRule::Max);
        self.balls.push(self.world.insert(body, collider).0);
    }

    fn step(&mut self) {
        self.world.step();
    }

    fn place_and_velocity(&self, ball: usize) -> [[f32; 3]; 2] {
        let body = &self.world.bodies[self.balls[ball]];
        [body.translation().into(), body.linvel().into()]
    }
}
