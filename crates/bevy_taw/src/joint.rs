//! Joints between marbles, bodies and places in the world.

use bevy::ecs::entity::Entities;
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::QueryData;
use bevy::ecs::world::DeferredWorld;
use bevy::prelude::*;
use taw::body::BodyId;
use taw::frame::Pose;
use taw::joint as core;
use taw::joint::JointId;
use taw::world::MarbleId;

use crate::body::{Body, BodyState};
use crate::components::{Marble, MarbleState};
use crate::convert::{to_rotation, to_vector};
use crate::refusal::{Refusal, Refusals};
use crate::resources::TawWorld;
use crate::snapshot::RowRemoved;

/// Joint: an entity of its own that holds two others, or one and a place in the world. When one of them goes, this
/// component does, and its entity stays; while one is disabled, it waits.
///
/// In the four substeps of [`Model::GAME`](taw::world::Model::GAME), long chains that bear heavy marbles, or have brakes
/// in their hinges, make energy or open: take sixteen, light loads, or `MarbleDamping` on the links. Links that are
/// placed on a line between ends too close for them float there: place them folded, so that their anchors meet.
///
/// Hinges and wheels turn about z of the joint's frame, sliders and suspensions go along x. Joints need
/// [`Response::SoftStep`](taw::response::Response::SoftStep), the default.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_taw::prelude::*;
///
/// fn spawn_door(mut commands: Commands) {
///     let door = commands.spawn(Body::from(Cuboid::new(1.0, 2.0, 0.1))).id();
///     let upright = Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2); // z points upward
///     commands.spawn(Joint::new(
///         JointKind::Hinge(JointDrive { limits: Some([-1.5, 1.5]), motor: None }),
///         JointEnd::world(Vec3::new(-0.5, 0.0, 0.0)).with_rotation(upright),
///         JointEnd::on(door, Vec3::new(-0.5, 0.0, 0.0)).with_rotation(upright),
///     ));
/// }
/// ```
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
#[require(JointState)]
pub struct Joint {
    /// Motions that it leaves free.
    pub kind: JointKind,
    /// Its ends.
    pub ends: [JointEnd; 2],
    /// True if the two that it holds collide with each other.
    pub collide_connected: bool,
    /// Force in N beyond which it breaks, as a mean over a substep: a blow counts whole, and the shorter a substep, the
    /// larger is its force. None for never.
    pub breaking_force: Option<f32>,
    /// Torque in N m beyond which it breaks; none for never.
    pub breaking_torque: Option<f32>,
}

/// End of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct JointEnd {
    /// Marble or body, and no wall, which is [refused](Refusal::JointEnd) by name; none for a place in the world. One that
    /// is written elsewhere moves there within the next step, and carries on what hangs on it: so a joint hangs on a wall
    /// that moves, which is no end itself.
    pub entity: Option<Entity>,
    /// Anchor in the frame of the entity, or in the world, in metres.
    pub anchor: Vec3,
    /// Rotation of the joint's frame there.
    pub rotation: Quat,
}

/// Spring and damper.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct JointSpring {
    /// Oscillations per second without damping, above zero, of the two ends if nothing else held them: of an arm that
    /// hangs on a hinge at its end, whose center has to move with it, it is half as much.
    pub frequency: f32,
    /// Damping over critical damping; at least zero.
    pub damping_ratio: f32,
}

/// Motor of the free axis of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq)]
pub enum JointMotor {
    /// Holds a speed; one of zero is a brake.
    Speed {
        /// Target, in rad/s, or m/s along a slider.
        target: f32,
        /// Largest torque in N m, or force in N.
        max: f32,
    },
    /// Holds a position by a spring.
    Position {
        /// Target, in rad within ±.99 π, or m along a slider.
        target: f32,
        /// The spring.
        spring: JointSpring,
        /// Largest torque in N m, or force in N.
        max: f32,
    },
}

/// Limits and motor of the free axis of a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Debug, Default, PartialEq)]
pub struct JointDrive {
    /// Least and largest position, in rad within ±.99 π, or m along a slider.
    pub limits: Option<[f32; 2]>,
    /// Its motor.
    pub motor: Option<JointMotor>,
}

/// Kind of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq)]
pub enum JointKind {
    /// Anchors coincide.
    BallAndSocket,
    /// Turn about z: that of the second end relative to the first, counterclockwise where z points at the viewer.
    Hinge(JointDrive),
    /// Way of the second end along x of the first.
    Slider(JointDrive),
    /// No motion.
    Fixed,
    /// Distance of the anchors within a range, in metres: a rod for two equal bounds, a rope from zero on.
    Distance([f32; 2]),
    /// Spring between the anchors.
    Spring {
        /// Length at rest, in metres.
        length: f32,
        /// Frequency and damping.
        spring: JointSpring,
    },
    /// Turn about z, and way along x of the first end on a spring.
    Wheel {
        /// Suspension.
        spring: JointSpring,
        /// Least and largest way of the suspension, in metres.
        travel: [f32; 2],
        /// Drive of the turning.
        drive: JointDrive,
    },
    /// The first end turns about its z by `−ratio` times the turn of the second.
    Gear {
        /// Ratio of the two, other than zero.
        ratio: f32,
    },
}

/// A joint broke in the last step, under more than its breaking force or torque; the component goes.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct JointBroken {
    /// Entity of the joint.
    pub joint: Entity,
}

/// State of a joint entity in the physics.
#[derive(Component, Clone, Copy, Debug, Default)]
pub(crate) struct JointState {
    id: Option<JointId>,
    /// True if it could be no joint: that is tried again when it changes.
    refused: bool,
}

impl Default for Joint {
    /// Ball-and-socket joint of nothing, to be written to.
    fn default() -> Self {
        Self::new(
            JointKind::BallAndSocket,
            JointEnd::world(Vec3::ZERO),
            JointEnd::world(Vec3::ZERO),
        )
    }
}

impl Joint {
    /// Joint that never breaks, and whose two do not collide with each other.
    #[must_use]
    pub fn new(kind: JointKind, first: JointEnd, second: JointEnd) -> Self {
        Self {
            kind,
            ends: [first, second],
            collide_connected: false,
            breaking_force: None,
            breaking_torque: None,
        }
    }
}

impl JointEnd {
    /// Anchor in the frame of a marble or a body, in metres.
    #[must_use]
    pub fn on(entity: Entity, anchor: Vec3) -> Self {
        Self { entity: Some(entity), anchor, rotation: Quat::IDENTITY }
    }

    /// Anchor in the world, in metres.
    #[must_use]
    pub fn world(anchor: Vec3) -> Self {
        Self { entity: None, anchor, rotation: Quat::IDENTITY }
    }

    /// Turns the joint's frame.
    #[must_use]
    pub fn with_rotation(self, rotation: Quat) -> Self {
        Self { rotation, ..self }
    }
}

impl From<JointSpring> for core::JointSpring<f32> {
    fn from(JointSpring { frequency, damping_ratio }: JointSpring) -> Self {
        Self { frequency, damping_ratio }
    }
}

impl From<JointDrive> for core::JointDrive<f32> {
    fn from(JointDrive { limits, motor }: JointDrive) -> Self {
        let motor = motor.map(|motor| match motor {
            JointMotor::Speed { target, max } => core::JointMotor::Speed { target, max },
            JointMotor::Position { target, spring, max } => {
                core::JointMotor::Position { target, spring: spring.into(), max }
            }
        });
        Self { limits, motor }
    }
}

impl From<JointKind> for core::JointKind<f32> {
    fn from(kind: JointKind) -> Self {
        match kind {
            JointKind::BallAndSocket => Self::BallAndSocket,
            JointKind::Hinge(drive) => Self::Hinge(drive.into()),
            JointKind::Slider(drive) => Self::Slider(drive.into()),
            JointKind::Fixed => Self::Fixed,
            JointKind::Distance(range) => Self::Distance(range),
            JointKind::Spring { length, spring } => Self::Spring { length, spring: spring.into() },
            JointKind::Wheel { spring, travel, drive } => {
                Self::Wheel { spring: spring.into(), travel, drive: drive.into() }
            }
            JointKind::Gear { ratio } => Self::Gear { ratio },
        }
    }
}

impl TawWorld {
    /// Handle of an entity's joint in [`World::joints`](taw::world::World::joints), by which its force, torque and
    /// position are read: that is the angle of a hinge, or the way along a slider.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_taw::prelude::*;
    /// fn creak(hinges: Query<Entity, With<Joint>>, world: Res<TawWorld>) -> Result {
    ///     for id in hinges.iter().filter_map(|hinge| world.joint_id(hinge)) {
    ///         let angle = world.joints.position(id)?.unwrap_or(0.0);
    ///         if angle > 1.0 && world.joints.force(id)? > 500.0 {
    ///             info!("creak");
    ///         }
    ///     }
    ///     Ok(())
    /// }
    /// ```
    #[must_use]
    pub fn joint_id(&self, joint: Entity) -> Option<JointId> {
        self.joint_entities.iter().find_map(|(id, entity)| (*entity == joint).then_some(*id))
    }
}

/// Components of a joint entity.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct JointComponents {
    entity: Entity,
    joint: Ref<'static, Joint>,
    is_disabled: Has<Disabled>,
    state: &'static mut JointState,
}

/// Marbles and bodies.
type Held<'w, 's> = Query<
    'w,
    's,
    (Option<&'static MarbleState>, Option<&'static BodyState>),
    (Or<(With<Marble>, With<Body>)>, Allow<Disabled>),
>;

/// End of a joint.
enum Found {
    There(core::JointEnd<f32>),
    /// Its entity is out of the world for a time: disabled, refused, or not there yet.
    Away,
    /// Its entity is neither a marble nor a body.
    Other(Entity),
    /// Its entity is none any more.
    Gone,
}

impl JointEnd {
    fn find(&self, held: &Held, entities: &Entities, world: &TawWorld) -> Found {
        let frame =
            Pose { rotation: to_rotation(self.rotation), translation: to_vector(self.anchor) };
        let Some(entity) = self.entity else {
            return Found::There(core::JointEnd::World { frame });
        };
        let Ok((marble, body)) = held.get(entity) else {
            return if entities.contains(entity) { Found::Other(entity) } else { Found::Gone };
        };
        let marble = marble.and_then(|it| it.id).filter(|id| world.marbles.row(*id).is_ok());
        match (marble, body.and_then(|it| it.id)) {
            (Some(marble), _) => Found::There(core::JointEnd::Marble { marble, frame }),
            (_, Some(body)) => Found::There(core::JointEnd::Body { body, frame }),
            _ => Found::Away,
        }
    }
}

fn held_by(end: core::JointEnd<f32>) -> (Option<MarbleId>, Option<BodyId>) {
    (end.marble_id(), end.body_id())
}

impl JointComponentsItem<'_, '_> {
    /// Takes the joint out of the world until it comes back.
    fn leave(&mut self, world: &mut TawWorld) {
        if let Some(id) = self.state.id.take() {
            let _ = world.joints.remove(id); // or one of its ends went
            world.joint_entities.remove(&id);
        }
    }

    /// Puts the joint in, or takes over what was written.
    fn take_over(
        &mut self,
        world: &mut TawWorld,
        ends: [core::JointEnd<f32>; 2],
    ) -> Result<JointId, taw::Error> {
        let joint = core::Joint {
            ends,
            kind: self.joint.kind.into(),
            collide_connected: self.joint.collide_connected,
            breaking_force: self.joint.breaking_force.unwrap_or(f32::INFINITY),
            breaking_torque: self.joint.breaking_torque.unwrap_or(f32::INFINITY),
        };
        match self.state.id {
            Some(id) => world.joints.set(id, joint).map(|()| id),
            None => world.joints.insert(joint),
        }
    }
}

/// Run condition: there are joints, also disabled ones.
pub(crate) fn any(joints: Query<(), (With<Joint>, Allow<Disabled>)>) -> bool {
    !joints.is_empty()
}

/// Puts new joints in, changes those that were written, and takes the component of those whose ends are gone.
pub(crate) fn gather(
    mut world: ResMut<TawWorld>,
    mut joints: Query<JointComponents, Allow<Disabled>>,
    (held, entities): (Held, &Entities),
    mut refusals: Refusals,
    mut commands: Commands,
) {
    let is_known = world.model().response.knows_bodies();
    let restored = world.just_restored;
    for mut it in &mut joints {
        let entity = it.entity;
        let ends = it.joint.ends.each_ref().map(|end| end.find(&held, entities, &world));
        let ends = match ends {
            [Found::Gone, _] | [_, Found::Gone] => {
                commands.entity(entity).try_remove::<Joint>();
                continue;
            }
            [Found::Other(end), _] | [_, Found::Other(end)] => {
                if it.state.id.is_some() && !it.joint.is_changed() {
                    commands.entity(entity).try_remove::<Joint>(); // it was held until now
                } else if !it.is_disabled {
                    it.leave(&mut world);
                    refusals.check(Some(entity), Err(Refusal::JointEnd(end)));
                }
                continue;
            }
            [Found::There(first), Found::There(second)] if is_known && !it.is_disabled => {
                [first, second]
            }
            _ => {
                it.leave(&mut world); // its bodies say why, or its marbles go on without it
                continue;
            }
        };
        let known = it.state.id.and_then(|id| world.joints.get(id).ok()).map(|known| known.ends);
        if known.is_none() {
            it.leave(&mut world);
        }
        let holds = known.is_some_and(|known| known.map(held_by) == ends.map(held_by));
        if (holds || it.state.refused) && !it.joint.is_changed() && !restored {
            continue;
        }
        match it.take_over(&mut world, ends) {
            Ok(id) => {
                (it.state.id, it.state.refused) = (Some(id), false);
                world.joint_entities.insert(id, entity);
            }
            Err(error) => {
                it.state.refused = true;
                refusals.check(Some(entity), Err::<(), _>(error));
            }
        }
    }
}

/// Gives joint entities the rows that they have in a restored world, and takes out those that no entity stands behind.
pub(crate) fn name(
    mut world: ResMut<TawWorld>,
    mut joints: Query<&mut JointState, Allow<Disabled>>,
    mut removed: MessageWriter<RowRemoved>,
) {
    for mut state in &mut joints {
        *state = JointState::default();
    }
    let known: Vec<_> = world.joint_entities.iter().map(|(id, entity)| (*id, *entity)).collect();
    for (id, entity) in known {
        if let Ok(mut state) = joints.get_mut(entity) {
            state.id = Some(id);
            continue;
        }
        world.joint_entities.remove(&id);
        if world.joints.remove(id).is_ok() {
            log::warn!("taw took out {id:?}: no entity stands behind it");
            removed.write(RowRemoved::Joint(id));
        }
    }
}

/// Tells which joints broke in the last step, and takes their components.
pub(crate) fn report_broken(
    mut world: ResMut<TawWorld>,
    mut broken: MessageWriter<JointBroken>,
    mut commands: Commands,
) {
    let ids = world.joints.broken().to_vec();
    for id in ids {
        if let Some(joint) = world.joint_entities.remove(&id) {
            broken.write(JointBroken { joint });
            commands.entity(joint).try_remove::<Joint>();
        }
    }
}

/// Takes a joint out of the world when its component or entity goes.
pub(crate) fn forget(removed: On<Remove, Joint>, mut app: DeferredWorld) {
    let id = app.get::<JointState>(removed.entity).and_then(|state| state.id);
    let mut world = app.resource_mut::<TawWorld>();
    if let Some(id) = id
        && world.joint_entities.get(&id) == Some(&removed.entity)
    {
        let _ = world.joints.remove(id); // or it broke, or an end went
        world.joint_entities.remove(&id);
    }
    app.commands().entity(removed.entity).try_remove::<JointState>();
}
