//! Sensors: shapes that marbles pass through, and that tell who enters and leaves.
//!
//! ```
//! # use bevy::prelude::*;
//! # use bevy_taw::prelude::*;
//! #[derive(Resource, Default)]
//! struct Score(u32);
//!
//! fn spawn(mut commands: Commands) {
//!     let count = |_: On<SensorEntered>, mut score: ResMut<Score>| score.0 += 1;
//!     commands.spawn((Wall::from(Cuboid::new(1.0, 0.1, 1.0)), Sensor)).observe(count);
//! }
//! # let mut app = App::new();
//! # app.add_plugins((MinimalPlugins, TawPlugins)).init_resource::<Score>();
//! # app.add_systems(Startup, spawn).update();
//! ```

use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use taw::world::{MarbleId, SensorId};

use crate::components::WallState;
use crate::resources::TawWorld;
use crate::wall::Wall;

/// Makes a sensor of a [`Wall`]: marbles pass through it, and it tells who enters and leaves, by
/// [`SensorEntered`] and [`SensorLeft`], and who is inside, by [`CollidingEntities`].
///
/// It may be moved as a wall, by itself or by what carries it, and has [`CollisionLayers`]. A marble
/// that passes through within a step enters and leaves in it, at any speed; one that is put elsewhere
/// meets nothing on the way. Within a substep (of `SoftStep` within a step), paths are taken to be
/// straight. Of a mesh, inside is what touches its surface. Balls of swarms are not sensed.
///
/// [`CollisionLayers`]: crate::layers::CollisionLayers
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
#[require(Wall, CollidingEntities)]
pub struct Sensor;

/// Marbles inside of a sensor after the last step, sorted.
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Deref, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct CollidingEntities(Vec<Entity>);

/// A marble entered a sensor: as a message, and as an event of the sensor's entity.
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct SensorEntered {
    /// The sensor.
    #[event_target]
    pub sensor: Entity,
    /// The marble.
    pub marble: Entity,
    /// Time from then to the end of the step, in seconds.
    pub time_left: f32,
}

/// A marble left a sensor, or is gone: as a message, and as an event of the sensor's entity.
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct SensorLeft {
    /// The sensor.
    #[event_target]
    pub sensor: Entity,
    /// The marble, which may be gone.
    pub marble: Entity,
    /// Time from then to the end of the step, in seconds.
    pub time_left: f32,
}

/// Entities of marbles inside of sensors, also of those that are gone.
#[derive(Resource, Default)]
pub(crate) struct Insiders(HashMap<(SensorId, MarbleId), Entity>);

pub(crate) fn register(app: &mut App) {
    app.init_resource::<Insiders>()
        .add_message::<SensorEntered>()
        .add_message::<SensorLeft>()
        .register_type::<(Sensor, CollidingEntities, SensorEntered, SensorLeft)>()
        .add_observer(forget);
}

/// Takes a sensor out of the world when its component, its wall or its entity goes. What is left is a
/// wall from the next step on.
fn forget(removed: On<Remove, Sensor>, states: Query<&WallState>, mut world: ResMut<TawWorld>) {
    if let Some(id) = states.get(removed.entity).ok().and_then(|state| state.sensor) {
        world.remove_sensor(id);
    }
}

impl TawWorld {
    /// Takes a sensor out, if it is there.
    pub(crate) fn remove_sensor(&mut self, id: SensorId) {
        if self.sensor_entities.remove(&id).is_some() {
            let _ = self.world.sensors.remove(id); // a restored world may not have it
        }
    }
}

/// Tells who entered and left in the step.
pub(crate) fn scatter(
    world: Res<TawWorld>,
    mut insiders: ResMut<Insiders>,
    mut colliding: Query<&mut CollidingEntities>,
    mut entered: MessageWriter<SensorEntered>,
    mut left: MessageWriter<SensorLeft>,
    mut commands: Commands,
) {
    let mut changed = Vec::new();
    for event in world.sensors.events() {
        let time_left = event.time_left;
        let Some(sensor) = world.sensor_entities.get(&event.sensor).copied() else { continue };
        let key = (event.sensor, event.marble);
        changed.push(event.sensor);
        if event.entered {
            let Some(marble) = world.marble_entities.get(&event.marble).copied() else { continue };
            insiders.0.insert(key, marble);
            let event = SensorEntered { sensor, marble, time_left };
            entered.write(event);
            commands.trigger(event);
        } else if let Some(marble) = insiders.0.remove(&key) {
            let event = SensorLeft { sensor, marble, time_left };
            left.write(event);
            commands.trigger(event);
        }
    }
    changed.dedup();
    for id in changed {
        let entity = world.sensor_entities.get(&id).copied();
        let Some(mut colliding) = entity.and_then(|it| colliding.get_mut(it).ok()) else {
            continue;
        };
        let inside = world.sensors.inside(id).unwrap_or_default();
        colliding.0.clear();
        colliding.0.extend(inside.iter().filter_map(|it| insiders.0.get(&(id, *it))));
        colliding.0.sort_unstable();
    }
}
