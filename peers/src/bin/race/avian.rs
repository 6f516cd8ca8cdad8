//! Avian in a Bevy app without a window, with `parallel` and `simd`, otherwise by default.

use std::time::Duration;

use avian3d::prelude as avian;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;

use crate::scene::Scene;
use crate::{DT, Engine, FRICTION, RESTITUTION, THREADS};

pub struct Avian {
    app: App,
    frame: Entity,
    balls: Vec<Entity>,
}

impl Avian {
    pub fn new(scene: &Scene) -> Self {
        let mut app = App::new();
        app.add_plugins((
            MinimalPlugins.set(TaskPoolPlugin {
                task_pool_options: TaskPoolOptions::with_num_threads(THREADS),
            }),
            TransformPlugin,
            avian::PhysicsPlugins::new(Update),
        ));
        app.insert_resource(avian::Gravity(Vec3::NEG_Y * 9.81));
        let step = Duration::from_secs_f32(DT);
        app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
        app.finish();
        app.update();
        let world = app.world_mut();
        let surface = || (avian::Friction::new(FRICTION), avian::Restitution::new(RESTITUTION));
        let frame = world.spawn((avian::RigidBody::Kinematic, Transform::default())).id();
        for (up, at) in &scene.planes {
            let shape = avian::Collider::half_space(*up);
            let place = Transform::from_translation(*at);
            world.spawn((shape, place, surface(), ChildOf(frame)));
        }
        for (center, half, turn) in &scene.boxes {
            let shape = avian::Collider::cuboid(2.0 * half.x, 2.0 * half.y, 2.0 * half.z);
            let place = Transform::from_translation(*center).with_rotation(*turn);
            world.spawn((shape, place, surface(), ChildOf(frame)));
        }
        let balls = scene.balls.iter().map(|(at, radius)| {
            let shape = (avian::Collider::sphere(*radius), avian::ColliderDensity(1.0));
            let place = Transform::from_translation(*at);
            let body = (avian::RigidBody::Dynamic, avian::SleepingDisabled);
            world.spawn((body, shape, place, surface())).id()
        });
        let balls = balls.collect();
        Self { app, frame, balls }
    }
}

impl Engine for Avian {
    fn step(&mut self, from: Quat, to: Quat) {
        if from != to {
            let spin = (to * from.inverse()).to_scaled_axis() / DT;
            self.app.world_mut().entity_mut(self.frame).insert(avian::AngularVelocity(spin));
        }
        self.app.update();
    }

    fn state(&self) -> Vec<[Vec3; 2]> {
        let of = |ball: &Entity| {
            let ball = self.app.world().entity(*ball);
            let at = ball.get::<avian::Position>().map_or(Vec3::NAN, |at| at.0);
            [at, ball.get::<avian::LinearVelocity>().map_or(Vec3::NAN, |v| v.0)]
        };
        self.balls.iter().map(of).collect()
    }
}
