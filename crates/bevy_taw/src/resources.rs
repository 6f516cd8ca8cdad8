//! Resources: the model, gravity, the world.

use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use taw::body::BodyId;
use taw::joint::JointId;
use taw::motion::ForceField;
use taw::swarm::BallId;
use taw::world::{ColliderId, Marble, MarbleId, Model, SensorId, WallId};

use crate::ball_sensor::SensedBall;
use crate::contact_force::PairImpulse;
use crate::contact_points::ContactKey;
use crate::messages::{ContactPair, ContactPoint};
use crate::reflect::ModelReflect;

/// Simulation settings: by default [`Model::GAME`].
///
/// They may change at any time; what cannot be right is refused with an
/// [`InputRefused`](crate::refusal::InputRefused), and the last good one stays. Components that a
/// model does not read are listed in [`IgnoredComponents`](crate::ignored::IgnoredComponents).
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// # let mut app = App::new();
/// app.insert_resource(TawModel(Model { substeps: 8, ..Model::GAME })) // finer than by default
///     .insert_resource(TawModel(Model::EXACT)) // few marbles: each collision at its time of impact
///     .insert_resource(TawModel(Model::default())); // the lecture's: positions only
/// ```
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq, Deref, DerefMut, Reflect)]
#[reflect(Resource, Debug, Default, PartialEq)]
pub struct TawModel(#[reflect(remote = ModelReflect)] pub Model);

impl Default for TawModel {
    /// [`Model::GAME`].
    fn default() -> Self {
        Self(Model::GAME)
    }
}

/// The gravity on every marble, in m/s² in world space. A gravity that is not
/// finite is refused like a wrong [`TawModel`].
#[derive(Resource, Clone, Copy, Debug, PartialEq, Deref, DerefMut, Reflect)]
#[reflect(Resource, Debug, Default, PartialEq)]
pub struct Gravity(pub Vec3);

impl Default for Gravity {
    /// 9.81 m/s² downward.
    fn default() -> Self {
        Self(Vec3::NEG_Y * 9.81)
    }
}

/// The force fields that act on every marble besides gravity. A field whose numbers
/// cannot be right is refused like a wrong [`TawModel`], with all the others.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// # let mut app = App::new();
/// let wind = Medium::new(Vec3::X * 8.0, 0.01, 0.0);
/// let planet = ForceField::attraction(Vec3::NEG_Y * 50.0, 2.5e4);
/// app.insert_resource(Forces(vec![ForceField::Drag(wind), planet]));
/// ```
///
/// Reflection sees it as one opaque value, since functions are among the fields: it is copied and compared as a
/// whole.
#[derive(Resource, Clone, Debug, Default, PartialEq, Deref, DerefMut, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone, Debug, Default, PartialEq)]
pub struct Forces(pub Vec<ForceField<f32>>);

/// The physics of this app: a [`taw::world::World`], and which of its rows are
/// which entities.
///
/// Reading it costs nothing. Between gather and scatter it may be changed too, for
/// example its contacts between `GenerateContacts` and `Restitute`; at other times
/// change components instead: components and resources are the truth. With the next
/// step its model, gravity, forces and walls are again what they say, entities that
/// lost their rows have new ones, and rows that no entity stands behind are taken out
/// and told as [`RowRemoved`](crate::snapshot::RowRemoved): marbles, walls, bodies and balls. Joints that the game
/// puts in by itself stay until one of their ends goes.
///
/// To go back in time, take a [`TawWorld::snapshot`] and [`TawWorld::restore`] it.
#[derive(Resource, Debug, Default, Deref, DerefMut)]
pub struct TawWorld {
    #[deref]
    pub(crate) world: taw::world::World<f32>,
    pub(crate) marble_entities: HashMap<MarbleId, Entity>,
    pub(crate) wall_entities: HashMap<WallId, Entity>,
    pub(crate) body_entities: HashMap<BodyId, Entity>,
    pub(crate) joint_entities: HashMap<JointId, Entity>,
    pub(crate) sensor_entities: HashMap<SensorId, Entity>,
    /// Entity of the swarm of each slot of balls, also of those that are gone.
    pub(crate) ball_entities: Vec<Option<Entity>>,
    /// Marbles and bodies inside of sensors, also those that are gone.
    pub(crate) sensed: HashMap<(SensorId, ColliderId), Entity>,
    /// Balls of swarms inside of sensors, sorted; none while nobody listens.
    pub(crate) sensed_balls: Vec<SensedBall>,
    /// Sensors and who was inside of them before a restore that is not told yet.
    pub(crate) sensed_before: Option<HashSet<(Entity, Entity)>>,
    /// Events [`SensorLeft`](crate::sensor::SensorLeft) that are not sent yet: sensor and collider.
    pub(crate) left_sensors: Vec<(Entity, Entity)>,
    /// Sensor entities whose list of who is inside is out of date.
    pub(crate) stale_sensors: Vec<Entity>,
    /// Impulses of the contacts of the last step, sorted, one to a pair.
    pub(crate) pair_impulses: Vec<(ContactPair, PairImpulse)>,
    /// Single contacts of the last step, sorted; none while nobody reads them.
    pub(crate) contact_points: Vec<(ContactKey, ContactPoint)>,
    /// Marbles whose entities are disabled, as they were when they left.
    pub(crate) away: HashMap<Entity, Marble<f32>>,
    /// Number of restores, and true if there was one since the last gather.
    pub(crate) restored: u32,
    pub(crate) just_restored: bool,
    /// Walls that move in this step, or did in the last one.
    pub(crate) moving_walls: Vec<WallId>,
    /// The walls' version when they were last gathered.
    pub(crate) walls_gathered: u64,
    /// True if the world refused to integrate, and the rest of the substep is left out.
    pub(crate) refused: bool,
}

impl TawWorld {
    /// The entity of the marble in a row, if there is one.
    #[must_use]
    pub fn marble_entity(&self, row: u32) -> Option<Entity> {
        let id = self.world.marbles.id(row as usize)?;
        self.marble_entities.get(&id).copied()
    }

    /// The entity of the wall in a row, if there is one.
    #[must_use]
    pub fn wall_entity(&self, row: u32) -> Option<Entity> {
        let id = self.world.walls.id(row as usize)?;
        self.wall_entities.get(&id).copied()
    }

    /// The entity of the [`Swarm`](crate::swarm::Swarm) that a ball is one of, if there is one.
    #[must_use]
    pub fn swarm_of(&self, ball: BallId) -> Option<Entity> {
        let row = self.world.swarm.row(ball).ok()?;
        let is_own = !self.world.swarm.is_marble(row);
        is_own.then(|| self.entity_of_slot(self.world.swarm.slots()[row])).flatten()
    }

    /// The entity of the swarm of a slot.
    pub(crate) fn entity_of_slot(&self, slot: u32) -> Option<Entity> {
        self.ball_entities.get(slot as usize).copied().flatten()
    }

    /// Notes that balls are a swarm's.
    pub(crate) fn note_balls(&mut self, swarm: Entity, balls: &[BallId]) {
        for ball in balls {
            let Ok(row) = self.world.swarm.row(*ball) else { continue };
            let slot = self.world.swarm.slots()[row] as usize;
            if self.ball_entities.len() <= slot {
                self.ball_entities.resize(slot + 1, None);
            }
            self.ball_entities[slot] = Some(swarm);
        }
    }
}
