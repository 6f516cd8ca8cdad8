//! taw's entities in a Bevy app without a window: a whole frame with one `FixedUpdate`.

use std::time::Duration;

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_taw::components::SurfaceMaterial;
use bevy_taw::prelude::*;

use crate::scene::Scene;
use crate::taw::{model, swarm_model};
use crate::{AUTOMATIC, DT, Engine, FRICTION, RESTITUTION, THREADS};

pub struct Entities {
    app: App,
    /// Walls, and where they are while nothing has turned.
    frame: Vec<(Entity, Transform)>,
    balls: Vec<Entity>,
}

impl Entities {
    pub fn new(scene: &Scene) -> Self {
        let mut app = App::new();
        app.add_plugins((
            MinimalPlugins.set(TaskPoolPlugin {
                task_pool_options: TaskPoolOptions::with_num_threads(THREADS),
            }),
            TransformPlugin,
            TawPlugin,
        ));
        let step = Duration::from_secs_f32(DT);
        app.insert_resource(Time::<Fixed>::from_duration(step));
        app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
        app.insert_resource(TawModel(model(Response::SoftStep)));
        app.insert_resource(TawSwarmModel(swarm_model(Tier::Full, 2, AUTOMATIC, scene.sleeps)));
        app.finish();
        app.update();
        let world = app.world_mut();
        let surface = SurfaceMaterial {
            friction: FRICTION,
            restitution: RESTITUTION,
            ..SurfaceMaterial::default()
        };
        let mut frame = Vec::new();
        for (up, at) in &scene.planes {
            let place = Transform::from_translation(*at)
                .with_rotation(Quat::from_rotation_arc(Vec3::Y, up.normalize()));
            frame.push((world.spawn((Wall::default(), place)).id(), place));
        }
        for (center, half, turn) in &scene.boxes {
            let place = Transform::from_translation(*center).with_rotation(*turn);
            let wall = Wall::Cuboid(Cuboid { half_size: *half });
            frame.push((world.spawn((wall, place)).id(), place));
        }
        let balls = scene.balls.iter().map(|(at, radius)| {
            let place = Transform::from_translation(*at);
            let mass = MarbleMass::Density(1.0);
            let motion = (Velocity::default(), AngularVelocity::default());
            world.spawn((Marble::new(*radius), place, mass, motion, surface)).id()
        });
        let balls = balls.collect();
        Self { app, frame, balls }
    }
}

impl Engine for Entities {
    fn step(&mut self, from: Quat, to: Quat) {
        if from != to {
            for (entity, place) in &self.frame {
                let mut wall = self.app.world_mut().entity_mut(*entity);
                let turned = Transform::from_rotation(to) * *place;
                *wall.get_mut::<Transform>().expect("a transform") = turned;
            }
        }
        self.app.update();
    }

    fn state(&self) -> Vec<[Vec3; 2]> {
        let of = |ball: &Entity| {
            let ball = self.app.world().entity(*ball);
            let at = ball.get::<Transform>().map_or(Vec3::NAN, |at| at.translation);
            [at, ball.get::<Velocity>().map_or(Vec3::NAN, |v| v.0)]
        };
        self.balls.iter().map(of).collect()
    }
}
