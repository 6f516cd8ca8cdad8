//! Avian 0.7.

use std::time::Duration;

use avian3d::dynamics::solver::SolverConfig;
use avian3d::prelude::*;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;

use crate::{Ball, Engine, Setup};

pub struct Avian {
    app: App,
    balls: Vec<Entity>,
    ccd: bool,
}

impl Engine for Avian {
    fn new(setup: &Setup, gravity: f32, dt: f32) -> Self {
        let mut app = App::new();
        let physics = PhysicsPlugins::new(Update).with_length_unit(setup.unit);
        app.add_plugins((MinimalPlugins, TransformPlugin, physics));
        app.insert_resource(Gravity(Vec3::NEG_Y * gravity));
        app.insert_resource(SubstepCount(6 * setup.finer as u32));
        if setup.bouncy {
            app.world_mut().resource_mut::<SolverConfig>().restitution_threshold = 0.0;
        }
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f32(dt)));
        app.finish();
        // Bevy makes no frame longer than this, however long it was.
        app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(Duration::from_secs(60));
        app.update();
        Self { app, balls: Vec::new(), ccd: setup.ccd }
    }

    fn floor(&mut self, up: [f32; 3]) {
        let shape = Collider::half_space(up.into());
        let (grip, bounce) = (Friction::new(0.0), Restitution::new(0.0));
        self.app.world_mut().spawn((RigidBody::Static, shape, grip, bounce));
    }

    fn insert(&mut self, ball: &Ball) {
        let max = CoefficientCombine::Max;
        let mut entity = self.app.world_mut().spawn((
            RigidBody::Dynamic,
            Collider::sphere(ball.radius),
            Transform::from_translation(ball.at.into()),
            LinearVelocity(ball.velocity.into()),
            Mass(ball.mass),
            Friction::new(ball.mu).with_combine_rule(max),
            Restitution::new(ball.e).with_combine_rule(max),
            SleepingDisabled,
        ));
        if self.ccd {
            entity.insert(SweptCcd::default());
        }
        self.balls.push(entity.id());
    }

    fn step(&mut self) {
        self.app.update();
    }

    fn place_and_velocity(&self, ball: usize) -> [[f32; 3]; 2] {
        let entity = self.app.world().entity(self.balls[ball]);
        let at = entity.get::<Position>().map_or(Vec3::NAN, |at| at.0);
        let velocity = entity.get::<LinearVelocity>().map_or(Vec3::NAN, |v| v.0);
        [at.to_array(), velocity.to_array()]
    }
}
