//! Back in time: a copy of the world, and how entities and rows find each other again.

use bevy::ecs::entity::Entities;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use taw::body::BodyId;
use taw::joint::JointId;
use taw::swarm::BallId;
use taw::world::{ColliderId, MarbleId, SensorId, WallId};

use crate::ball_sensor::SensedBall;
use crate::components::{MarbleState, Sleeping, WallState};
use crate::contact_force::PairImpulse;
use crate::contact_points::ContactKey;
use crate::messages::{ContactPair, ContactPoint};
use crate::resources::TawWorld;
use crate::sensor::SensorEntered;

/// The physics of an app as it was: see [`TawWorld::snapshot`].
#[derive(Clone, Debug)]
pub struct TawSnapshot {
    world: taw::world::World<f32>,
    marble_entities: HashMap<MarbleId, Entity>,
    wall_entities: HashMap<WallId, Entity>,
    body_entities: HashMap<BodyId, Entity>,
    joint_entities: HashMap<JointId, Entity>,
    sensor_entities: HashMap<SensorId, Entity>,
    ball_entities: Vec<Option<Entity>>,
    sensed_balls: Vec<SensedBall>,
    moving_walls: Vec<WallId>,
    sensed: HashMap<(SensorId, ColliderId), Entity>,
    pair_impulses: Vec<(ContactPair, PairImpulse)>,
    contact_points: Vec<(ContactKey, ContactPoint)>,
}

/// A row of the world that no entity stood behind was taken out, as after a
/// [`TawWorld::restore`] to a time when its entity still was. Also logged as a warning.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub enum RowRemoved {
    /// A marble.
    Marble(MarbleId),
    /// A wall.
    Wall(WallId),
    /// A ball of a swarm.
    Ball(BallId),
    /// A rigid body.
    Body(BodyId),
    /// A joint.
    Joint(JointId),
}

impl TawWorld {
    /// The physics as it is, to be [restored](Self::restore) later: where all marbles and balls
    /// of swarms are, how they move, and what their contacts remember.
    #[must_use]
    pub fn snapshot(&self) -> TawSnapshot {
        TawSnapshot {
            world: self.world.clone(),
            marble_entities: self.marble_entities.clone(),
            wall_entities: self.wall_entities.clone(),
            body_entities: self.body_entities.clone(),
            joint_entities: self.joint_entities.clone(),
            sensor_entities: self.sensor_entities.clone(),
            ball_entities: self.ball_entities.clone(),
            sensed_balls: self.sensed_balls.clone(),
            moving_walls: self.moving_walls.clone(),
            sensed: self.sensed.clone(),
            pair_impulses: self.pair_impulses.clone(),
            contact_points: self.contact_points.clone(),
        }
    }

    /// Lets everything move on from a [`snapshot`](Self::snapshot). With the next step,
    ///
    /// - marbles and bodies go on from where they were then, as fast as they were; what else they are
    ///   (radius, mass, material ...) is in their components, as ever, and so are joints, the model,
    ///   gravity and forces. A component that is written between this and that step counts.
    /// - walls are where their entities' `Transform`s are, at rest until they move.
    /// - marbles, bodies, joints and walls that were spawned since are put in again, as their components say. A joint
    ///   that broke since has lost its component, and stays broken.
    /// - rows of entities that are gone by now are taken out, and each is told as a
    ///   [`RowRemoved`]. So are balls that a [`Swarm`](crate::swarm::Swarm) has lost; balls that
    ///   it got since are lost.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_taw::prelude::*;
    /// # use bevy_taw::snapshot::TawSnapshot;
    /// #[derive(Resource)]
    /// struct Saved(TawSnapshot);
    ///
    /// fn load(saved: Res<Saved>, mut world: ResMut<TawWorld>) {
    ///     world.restore(&saved.0);
    /// }
    /// ```
    ///
    /// A marble that is in a [`Sensor`](crate::sensor::Sensor) then and was not before has entered it, and one that was
    /// and is no more has left it. Of balls of swarms, nothing is told twice.
    ///
    /// [Controllers](crate::controller::MarbleController) drive nothing in the step after it: what they
    /// would go by is of the time before.
    pub fn restore(&mut self, snapshot: &TawSnapshot) {
        let told = self.sensed_pairs().chain(self.left_sensors.iter().copied()).collect();
        self.sensed_before.get_or_insert(told);
        self.world = snapshot.world.clone();
        self.marble_entities.clone_from(&snapshot.marble_entities);
        self.wall_entities.clone_from(&snapshot.wall_entities);
        self.body_entities.clone_from(&snapshot.body_entities);
        self.joint_entities.clone_from(&snapshot.joint_entities);
        self.stale_sensors.extend(self.sensor_entities.values());
        self.sensor_entities.clone_from(&snapshot.sensor_entities);
        self.ball_entities.clone_from(&snapshot.ball_entities);
        self.sensed_balls.clone_from(&snapshot.sensed_balls);
        self.moving_walls.clone_from(&snapshot.moving_walls);
        self.sensed.clone_from(&snapshot.sensed);
        self.pair_impulses.clone_from(&snapshot.pair_impulses);
        self.contact_points.clone_from(&snapshot.contact_points);
        self.left_sensors.clear();
        self.stale_sensors.extend(self.sensor_entities.values());
        self.restored = self.restored.wrapping_add(1);
        self.just_restored = true;
    }

    /// Sensors and the marbles inside of them.
    fn sensed_pairs(&self) -> impl Iterator<Item = (Entity, Entity)> {
        let sensor = |id| self.sensor_entities.get(id).copied();
        self.sensed.iter().filter_map(move |((id, _), marble)| Some((sensor(id)?, *marble)))
    }
}

/// Tells who is in sensors by a restore and was not before, and who is no more.
pub(crate) fn tell_sensed(
    mut world: ResMut<TawWorld>,
    time: Res<Time>,
    mut entered: MessageWriter<SensorEntered>,
    mut commands: Commands,
) {
    if world.sensed_before.is_none() {
        return;
    }
    let world = &mut *world;
    let before = world.sensed_before.take().unwrap_or_default();
    // Who has gone since is not told to enter, nor to leave by the event that takes it out.
    let is_here = |id: ColliderId| match id {
        ColliderId::Marble(id) => world.marble_entities.contains_key(&id),
        ColliderId::Body(id) => world.body_entities.contains_key(&id),
        ColliderId::Wall(_) => false, // senses nobody
    };
    world.sensed.retain(|(sensor, id), collider| {
        let sensor = world.sensor_entities.get(sensor);
        is_here(*id) || sensor.is_some_and(|sensor| before.contains(&(*sensor, *collider)))
    });
    let now: HashSet<_> = world.sensed_pairs().collect();
    world.left_sensors = before.difference(&now).copied().collect();
    let mut new: Vec<_> = now.difference(&before).copied().collect();
    new.sort_unstable(); // sets have no order
    for (sensor, collider) in new {
        let event = SensorEntered { sensor, collider, time_left: time.delta_secs() };
        entered.write(event);
        commands.trigger(event);
    }
}

/// Run condition: the world was restored since the last gather.
pub(crate) fn was_restored(world: Res<TawWorld>) -> bool {
    world.just_restored
}

/// Gives marble entities the rows that they have in a restored world.
pub(crate) fn name_marbles(world: &mut TawWorld, states: &mut Query<(Entity, &mut MarbleState)>) {
    for (_, mut state) in states.iter_mut() {
        (state.id, state.refused) = (None, false);
    }
    for (id, entity) in &world.marble_entities {
        if world.world.marbles.row(*id).is_ok()
            && let Ok((_, mut state)) = states.get_mut(*entity)
        {
            state.id = Some(*id);
        }
    }
}

/// Gives wall entities the rows that they have in a restored world, where they are at rest.
pub(crate) fn name_walls<'a>(
    world: &mut TawWorld,
    states: impl Iterator<Item = (Entity, Mut<'a, WallState>)>,
) {
    let ids: HashMap<_, _> = world.wall_entities.iter().map(|(id, wall)| (*wall, *id)).collect();
    let sensors: HashMap<_, _> = world.sensor_entities.iter().map(|(id, it)| (*it, *id)).collect();
    for (entity, mut state) in states {
        let id = ids.get(&entity).copied().filter(|id| world.walls.row(*id).is_ok());
        let sensor = sensors.get(&entity).copied();
        let sensor = sensor.filter(|id| world.sensors.shape(*id).is_ok());
        *state = WallState { id, sensor, ..state.without_row() };
    }
}

/// Takes out the rows of marbles that no entity stands behind. An entity that queries do not
/// see is disabled: its marble is kept until it comes back.
pub(crate) fn take_out_marbles(
    world: &mut TawWorld,
    visible: &Query<(Entity, &mut MarbleState)>,
    entities: &Entities,
    removed: &mut MessageWriter<RowRemoved>,
    commands: &mut Commands,
) {
    let has_row = |id| {
        let entity = world.marble_entities.get(&id)?;
        let (_, state) = visible.get(*entity).ok()?;
        (state.id == Some(id)).then_some(())
    };
    let ids = (0..world.marbles.len()).filter_map(|row| world.marbles.id(row));
    let gone: Vec<_> = ids.filter(|id| has_row(*id).is_none()).collect();
    for id in gone {
        let entity = world.marble_entities.remove(&id);
        let Ok(marble) = world.marbles.remove(id) else { continue };
        if let Some(entity) =
            entity.filter(|entity| entities.contains(*entity) && visible.get(*entity).is_err())
        {
            world.away.insert(entity, marble);
            commands.entity(entity).try_remove::<Sleeping>(); // what is away is awake when it comes back
        } else {
            log::warn!("taw took out {id:?}: no entity stands behind it");
            removed.write(RowRemoved::Marble(id));
        }
    }
    world.marble_entities.retain(|id, _| world.world.marbles.row(*id).is_ok());
}

/// Takes out the rows of walls that no entity stands behind, or one that is disabled.
pub(crate) fn take_out_walls(
    world: &mut TawWorld,
    id_of: impl Fn(Entity) -> Option<WallId>,
    entities: &Entities,
    removed: &mut MessageWriter<RowRemoved>,
) {
    let stands = |id| world.wall_entities.get(&id).is_some_and(|it| id_of(*it) == Some(id));
    let ids = (0..world.walls.len()).filter_map(|row| world.walls.id(row));
    let gone: Vec<_> = ids.filter(|id| !stands(*id)).collect();
    for id in gone {
        let _ = world.walls.remove(id); // it is there: its row named it
        let entity = world.wall_entities.remove(&id);
        if !entity.is_some_and(|entity| entities.contains(entity)) {
            log::warn!("taw took out {id:?}: no entity stands behind it");
            removed.write(RowRemoved::Wall(id));
        }
    }
    world.wall_entities.retain(|id, _| world.world.walls.row(*id).is_ok());
}

/// Takes out the sensors that no entity stands behind, or one that is disabled.
pub(crate) fn take_out_sensors(world: &mut TawWorld, id_of: impl Fn(Entity) -> Option<SensorId>) {
    let known = world.sensor_entities.iter().map(|(id, entity)| (*id, *entity));
    let gone: Vec<_> = known.filter(|(id, entity)| id_of(*entity) != Some(*id)).collect();
    for (id, entity) in gone {
        world.remove_sensor(id, entity);
    }
}

/// Balls that are neither a swarm's nor guests.
pub(crate) fn lost_balls(world: &TawWorld, owned: &HashSet<BallId>) -> Vec<BallId> {
    let swarm = &world.swarm;
    let rows = (0..swarm.slots().len()).filter(|row| !swarm.is_marble(*row));
    rows.filter_map(|row| swarm.id(row)).filter(|ball| !owned.contains(ball)).collect()
}
