//! taw's entities in a Bevy app without a window: a whole frame with one `FixedUpdate`; and the part of it
//! that Bevy takes when a system writes the transforms and there is no physics.

use std::time::Duration;

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_taw::components::SurfaceMaterial;
use bevy_taw::prelude::*;

use crate::scene::Scene;
use crate::taw::{model, swarm_model};
use crate::{AUTOMATIC, DT, Engine, FRICTION, RESTITUTION, THREADS};

/// App whose frames are as long as a step.
fn empty() -> App {
    let mut app = App::new();
    app.add_plugins((
        MinimalPlugins
            .set(TaskPoolPlugin { task_pool_options: TaskPoolOptions::with_num_threads(THREADS) }),
        TransformPlugin,
    ));
    let step = Duration::from_secs_f32(DT);
    app.insert_resource(Time::<Fixed>::from_duration(step));
    app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
    app
}

/// Bevy without physics: the transforms of awake balls are written in each step.
pub struct Bevy {
    app: App,
    balls: Vec<Entity>,
}

impl Bevy {
    pub fn new(scene: &Scene) -> Self {
        let mut app = empty();
        if !scene.sleeps {
            app.add_systems(FixedUpdate, |mut places: Query<&mut Transform>| {
                places.iter_mut().for_each(|mut place| place.set_changed());
            });
        }
        app.finish();
        app.update();
        let place = |(at, _): &(Vec3, f32)| Transform::from_translation(*at);
        let balls = scene.balls.iter().map(|ball| app.world_mut().spawn(place(ball)).id());
        let balls = balls.collect();
        Self { app, balls }
    }
}

impl Engine for Bevy {
    fn step(&mut self, _: Quat, _: Quat) {
        self.app.update();
    }

    fn state(&self) -> Vec<[Vec3; 2]> {
        let place = |ball: &Entity| self.app.world().entity(*ball).get::<Transform>();
        let of = |ball| [place(ball).map_or(Vec3::NAN, |at| at.translation), Vec3::ZERO];
        self.balls.iter().map(of).collect()
    }
}

pub struct Entities {
    app: App,
    /// Walls, and where they are while nothing has turned.
    frame: Vec<(Entity, Transform)>,
    balls: Vec<Entity>,
}

impl Entities {
    pub fn new(scene: &Scene) -> Self {
        let mut app = empty();
        app.add_plugins(TawPlugin);
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
