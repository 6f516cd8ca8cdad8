//! Preview of a shot: a copy of the physics that runs ahead of the app.
//!
//! ```
//! # use bevy::prelude::*;
//! # use bevy_taw::prelude::*;
//! #[derive(Component)]
//! struct Cue;
//!
//! /// Draws where the ball would go.
//! fn aim(cue: Single<Entity, With<Cue>>, world: Res<TawWorld>, time: Res<Time<Fixed>>) -> Result {
//!     let shot = ExternalImpulse { impulse: Vec3::X * 0.5, ..default() };
//!     let path = world.predict_shot(*cue, shot, 120, time.timestep().as_secs_f32())?;
//!     for ends in path.windows(2) {
//!         println!("from {} to {}", ends[0], ends[1]);
//!     }
//!     Ok(())
//! }
//! # let mut app = App::new();
//! # app.add_plugins((MinimalPlugins, TawPlugins)).add_systems(Update, aim);
//! # app.update();
//! ```

use bevy::ecs::entity::EntityHashMap;
use bevy::prelude::*;
use taw::world::MarbleId;

use crate::components::ExternalImpulse;
use crate::convert::{from_point, from_vector, to_point, to_vector};
use crate::resources::TawWorld;

/// Copy of the physics of an app, created by [`TawWorld::preview`], that steps ahead and changes nothing
/// of the app.
///
/// It begins with the state after the last step, and steps as the app would, bit by bit, if nothing comes in
/// from outside: components that are written meanwhile. Walls stay where they are: one that moved in the last
/// step is at rest, a conveyor belt runs on. An [`ExternalForce`](crate::components::ExternalForce), a zone
/// and a [`MarbleController`](crate::controller::MarbleController) act from step to step, and so not here.
///
/// A copy of all marbles, walls and balls of swarms is made, and a step costs as much as one of the app, so
/// in a large world a preview of a second is too much for one frame. What sleeps costs next to nothing.
#[derive(Clone, Debug)]
pub struct Preview {
    world: taw::world::World<f32>,
    marbles: EntityHashMap<MarbleId>,
}

/// Reason for which nothing is predicted.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PreviewError {
    /// An entity is no marble of the world: not yet, no longer, or refused.
    #[error("entity {0} is no marble of the world")]
    NoMarble(Entity),
    /// The world refuses a number.
    #[error(transparent)]
    Refused(#[from] taw::Error),
}

impl TawWorld {
    /// Copy of the physics to step ahead.
    #[must_use]
    pub fn preview(&self) -> Preview {
        let mut world = self.world.clone();
        for wall in &self.moving_walls {
            let _ = world.walls.set_motion(*wall, None); // it may have been taken out since
        }
        let marbles = self.marble_entities.iter().map(|(id, entity)| (*entity, *id)).collect();
        Preview { world, marbles }
    }

    /// Path of a marble: its centers in metres now and after each of so many steps of `dt` seconds, those of
    /// the app if it is `Time<Fixed>`'s timestep.
    ///
    /// # Errors
    /// [`PreviewError`].
    pub fn predict(&self, marble: Entity, steps: u32, dt: f32) -> Result<Vec<Vec3>, PreviewError> {
        self.predict_shot(marble, ExternalImpulse::default(), steps, dt)
    }

    /// Path of a marble that is hit first, as [`predict`](Self::predict): the one that it would take if it had
    /// this component.
    ///
    /// # Errors
    /// [`PreviewError`].
    pub fn predict_shot(
        &self,
        marble: Entity,
        shot: ExternalImpulse,
        steps: u32,
        dt: f32,
    ) -> Result<Vec<Vec3>, PreviewError> {
        let mut preview = self.preview();
        preview.hit(marble, shot)?;
        preview.paths(&[marble], steps, dt).map(|mut paths| paths.swap_remove(0))
    }
}

impl Preview {
    /// Steps by `dt` seconds.
    ///
    /// # Errors
    /// [`PreviewError::Refused`] for `dt`; then nothing has changed.
    pub fn step(&mut self, dt: f32) -> Result<(), PreviewError> {
        Ok(self.world.step(dt)?)
    }

    /// Hits a marble.
    ///
    /// # Errors
    /// [`PreviewError`].
    pub fn hit(&mut self, marble: Entity, shot: ExternalImpulse) -> Result<(), PreviewError> {
        let id = self.id(marble)?;
        if shot != ExternalImpulse::default() {
            self.world.marbles.apply_impulse(id, to_vector(shot.impulse))?;
            self.world.marbles.apply_angular_impulse(id, to_vector(shot.angular))?;
        }
        Ok(())
    }

    /// Sets the velocity of a marble, in m/s.
    ///
    /// # Errors
    /// [`PreviewError`].
    pub fn set_velocity(&mut self, marble: Entity, velocity: Vec3) -> Result<(), PreviewError> {
        let id = self.id(marble)?;
        Ok(self.world.marbles.set_velocity(id, to_vector(velocity))?)
    }

    /// Puts a marble elsewhere, in metres in world space.
    ///
    /// # Errors
    /// [`PreviewError`].
    pub fn set_position(&mut self, marble: Entity, position: Vec3) -> Result<(), PreviewError> {
        let id = self.id(marble)?;
        Ok(self.world.marbles.set_position(id, to_point(position))?)
    }

    /// Center of a marble, in metres in world space.
    ///
    /// # Errors
    /// [`PreviewError::NoMarble`].
    pub fn position(&self, marble: Entity) -> Result<Vec3, PreviewError> {
        let row = self.world.marbles.row(self.id(marble)?)?;
        Ok(from_point(self.world.marbles.position()[row]))
    }

    /// Velocity of a marble, in m/s.
    ///
    /// # Errors
    /// [`PreviewError::NoMarble`].
    pub fn velocity(&self, marble: Entity) -> Result<Vec3, PreviewError> {
        let row = self.world.marbles.row(self.id(marble)?)?;
        Ok(from_vector(self.world.marbles.velocity()[row]))
    }

    /// Steps so many times by `dt` seconds. Returns the path of each of these marbles: its centers in metres
    /// now and after each step.
    ///
    /// # Errors
    /// [`PreviewError`].
    pub fn paths(
        &mut self,
        marbles: &[Entity],
        steps: u32,
        dt: f32,
    ) -> Result<Vec<Vec<Vec3>>, PreviewError> {
        let now = |preview: &Self| -> Result<Vec<Vec3>, _> {
            marbles.iter().map(|marble| preview.position(*marble)).collect()
        };
        let mut paths: Vec<_> = now(self)?.into_iter().map(|at| vec![at]).collect();
        for _ in 0..steps {
            self.step(dt)?;
            for (path, at) in paths.iter_mut().zip(now(self)?) {
                path.push(at);
            }
        }
        Ok(paths)
    }

    /// World of the copy: contacts, sensors, balls of swarms.
    #[must_use]
    pub fn world(&self) -> &taw::world::World<f32> {
        &self.world
    }

    fn id(&self, marble: Entity) -> Result<MarbleId, PreviewError> {
        let id = self.marbles.get(&marble).copied();
        id.filter(|id| self.world.marbles.row(*id).is_ok()).ok_or(PreviewError::NoMarble(marble))
    }
}
