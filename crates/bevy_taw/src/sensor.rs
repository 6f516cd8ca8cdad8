//! Sensors: shapes that marbles and bodies pass through, and that report which of them enter and leave.
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

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::world::DeferredWorld;
use bevy::prelude::*;
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use taw::swarm::BallId;
use taw::world::{ColliderId, SensorId};

pub use crate::ball_sensor::{BallEntered, BallLeft};
use crate::components::WallState;
use crate::resources::TawWorld;

/// Makes a sensor of a [`Wall`]: marbles and [bodies](crate::body::Body) pass through it, and it reports which of
/// them enter and leave, by [`SensorEntered`] and [`SensorLeft`], and which are inside, by [`CollidingEntities`]; of the balls of
/// swarms, which are inside after each step, by [`CollidingBalls`], [`BallEntered`] and [`BallLeft`]. Without a wall it has no shape and
/// notices nobody, as [`IgnoredComponents`](crate::ignored::IgnoredComponents) says.
///
/// It may be moved as a wall, by itself or by what carries it, and has [`CollisionLayers`]. A marble
/// or body that passes through within a step enters and leaves in it, at any speed; one that is put elsewhere
/// meets nothing on the way. Within a substep (of `SoftStep` within a step), paths are taken to be
/// straight, in the orientation at the end. A compound is inside if one of its parts is. Of a mesh, inside is what touches its surface.
///
/// [`CollisionLayers`]: crate::layers::CollisionLayers
/// [`Wall`]: crate::wall::Wall
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
#[require(CollidingEntities, CollidingBalls)]
pub struct Sensor;

/// Marbles and bodies inside of a sensor after the last step, sorted.
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Deref, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct CollidingEntities(Vec<Entity>);

/// Balls of swarms inside of a sensor after the last step, sorted. One that passes through within a step is
/// not noticed.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// /// Whoever falls into a hole is gone.
/// fn swallow(holes: Query<&CollidingBalls, Changed<CollidingBalls>>, mut swarm: Single<&mut Swarm>) {
///     for hole in holes {
///         swarm.retain(|ball| !hole.contains(&ball));
///     }
/// }
/// ```
///
/// As a value for other programs, the list of the [bits](BallId::to_bits).
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Deref, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CollidingBalls(Vec<BallId>);

impl Serialize for CollidingBalls {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.iter().map(|ball| ball.to_bits()))
    }
}

impl<'de> Deserialize<'de> for CollidingBalls {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let bits = Vec::<u64>::deserialize(deserializer)?;
        Ok(Self(bits.into_iter().map(BallId::from_bits).collect()))
    }
}

/// Message, and event of the sensor's entity: a marble or [body](crate::body::Body) entered a sensor.
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct SensorEntered {
    /// The sensor.
    #[event_target]
    pub sensor: Entity,
    /// The marble or body.
    pub collider: Entity,
    /// Time from then to the end of the step, in seconds.
    pub time_left: f32,
}

/// Message, and event of the sensor's entity: a marble or [body](crate::body::Body) left a sensor, or either was
/// despawned, disabled, or lost its component.
#[derive(Message, EntityEvent, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct SensorLeft {
    /// The sensor, which may be gone.
    #[event_target]
    pub sensor: Entity,
    /// The marble or body, which may be gone.
    pub collider: Entity,
    /// Time from then to the end of the step, in seconds.
    pub time_left: f32,
}

pub(crate) fn register(app: &mut App) {
    app.add_message::<SensorEntered>()
        .add_message::<SensorLeft>()
        .register_type::<(Sensor, CollidingEntities, CollidingBalls, SensorEntered, SensorLeft)>()
        .add_observer(forget);
}

/// Takes a sensor out of the world when its component or its entity goes, also of an entity that
/// queries do not see. Its `Wall` is solid from the next step on.
fn forget(removed: On<Remove, Sensor>, mut app: DeferredWorld) {
    let sensor = app.get::<WallState>(removed.entity).and_then(|state| state.sensor);
    if let Some(id) = sensor {
        app.resource_mut::<TawWorld>().remove_sensor(id, removed.entity);
    }
}

impl TawWorld {
    /// Takes the sensor of an entity out, if it is there. Who was inside leaves in the next step.
    pub(crate) fn remove_sensor(&mut self, id: SensorId, entity: Entity) {
        if self.sensor_entities.get(&id) == Some(&entity) {
            self.sensor_entities.remove(&id);
            let left = self.sensed.extract_if(|(sensor, _), _| *sensor == id);
            self.left_sensors.extend(left.map(|(_, collider)| (entity, collider)));
            self.stale_sensors.push(entity);
            let _ = self.world.sensors.remove(id); // a restored world may not have it
        }
    }
}

/// Writes the sensor events of the step, and updates [`CollidingEntities`].
pub(crate) fn scatter(
    mut world: ResMut<TawWorld>,
    time: Res<Time>,
    states: Query<&WallState>,
    mut colliding: Query<(&mut CollidingEntities, &mut CollidingBalls), Allow<Disabled>>,
    mut entered: MessageWriter<SensorEntered>,
    mut left: MessageWriter<SensorLeft>,
    mut commands: Commands,
) {
    if world.sensors.is_empty() && world.stale_sensors.is_empty() {
        return;
    }
    let world = &mut *world;
    world.left_sensors.sort_unstable(); // maps have no order
    for (sensor, collider) in world.left_sensors.drain(..) {
        let event = SensorLeft { sensor, collider, time_left: time.delta_secs() };
        left.write(event);
        commands.trigger(event);
    }
    for event in world.world.sensors.events() {
        let time_left = event.time_left;
        let Some(sensor) = world.sensor_entities.get(&event.sensor).copied() else { continue };
        let key = (event.sensor, event.collider);
        world.stale_sensors.push(sensor);
        if event.entered {
            let Some(collider) = world.collider_entity(event.collider) else { continue };
            world.sensed.insert(key, collider);
            let event = SensorEntered { sensor, collider, time_left };
            entered.write(event);
            commands.trigger(event);
        } else if let Some(collider) = world.sensed.remove(&key) {
            let event = SensorLeft { sensor, collider, time_left };
            left.write(event);
            commands.trigger(event);
        }
    }
    world.stale_sensors.sort_unstable();
    world.stale_sensors.dedup();
    for entity in world.stale_sensors.drain(..) {
        let Ok((mut colliding, mut balls)) = colliding.get_mut(entity) else { continue };
        let id = states.get(entity).ok().and_then(|state| state.sensor);
        let sensors = &world.world.sensors;
        let marbles = id.and_then(|id| sensors.inside(id).ok()).unwrap_or_default();
        let bodies = id.and_then(|id| sensors.bodies_inside(id).ok()).unwrap_or_default();
        let marbles = marbles.iter().map(|id| ColliderId::Marble(*id));
        let inside = marbles.chain(bodies.iter().map(|id| ColliderId::Body(*id)));
        colliding.0.clear();
        colliding.0.extend(inside.filter_map(|collider| world.sensed.get(&(id?, collider))));
        colliding.0.sort_unstable();
        if id.is_none() {
            balls.0.clear();
        }
    }
}

/// Updates [`CollidingBalls`].
pub(crate) fn scatter_balls(
    world: Res<TawWorld>,
    mut sensors: Query<(&WallState, &mut CollidingBalls)>,
) {
    for (state, mut colliding) in &mut sensors {
        let inside = state.sensor.and_then(|id| world.sensors.balls_inside(id).ok());
        let inside = inside.unwrap_or_default();
        if colliding.0 != inside {
            colliding.0.clear();
            colliding.0.extend_from_slice(inside);
        }
    }
}
