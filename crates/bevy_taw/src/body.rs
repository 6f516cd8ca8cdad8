//! Rigid bodies: boxes, capsules, hulls and compounds that move and turn.

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::QueryData;
use bevy::ecs::world::DeferredWorld;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use taw::body as core;
use taw::body::BodyId;
use taw::frame::Pose;
use taw::shape::{Compound, Shape};

use crate::components::{
    AngularVelocity, ExternalForce, ExternalImpulse, GravityScale, MarbleDamping, MarbleMass,
    Sleeping, SleepingDisabled, SurfaceMaterial, Velocity, bits, rotation_bits,
};
use crate::convert::{from_point, from_rotation, from_vector, to_point, to_rotation, to_vector};
use crate::layers::CollisionLayers;
use crate::refusal::{Refusal, Refusals};
use crate::resources::TawWorld;
use crate::scatter::Frame;
use crate::snapshot::RowRemoved;

/// Rigid body: a solid of any shape that moves, turns and collides.
///
/// It lies in the entity's own frame, and its [`Transform`] is its place: whoever writes one puts it there at once,
/// with its velocity. It takes the components of a marble: [`Velocity`] (of the center of mass), [`AngularVelocity`],
/// [`MarbleMass`] ([`MarbleMass::Infinite`] for a body that moves by its velocity alone), [`GravityScale`],
/// [`MarbleDamping`], [`SurfaceMaterial`], [`CollisionLayers`], [`ExternalForce`] and [`ExternalImpulse`] (at the
/// center of mass), [`SleepingDisabled`], and [`Sleeping`] to read. Its scale does not count.
///
/// Bodies need [`Response::SoftStep`](taw::response::Response::SoftStep), the default. They are in no message of
/// contacts, sensor or query yet, and [`LockedAxes`](crate::locked_axes::LockedAxes) does not hold them; force fields and
/// zones do not act on them.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_taw::prelude::*;
///
/// fn spawn(mut commands: Commands) {
///     commands.spawn((Body::from(Cuboid::new(0.4, 0.2, 0.6)), Transform::from_xyz(0.0, 2.0, 0.0)));
/// }
/// ```
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
#[require(Transform, BodyState)]
pub struct Body {
    /// Convex parts. Parts that overlap count twice in its mass.
    pub parts: Vec<BodyPart>,
}

/// Convex part of a body.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct BodyPart {
    /// Shape about the place of the part.
    pub shape: BodyShape,
    /// Place in the entity's frame, in metres.
    pub translation: Vec3,
    /// Rotation in the entity's frame.
    pub rotation: Quat,
}

/// Convex shape.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq)]
pub enum BodyShape {
    /// Ball.
    Sphere(Sphere),
    /// Box.
    Cuboid(Cuboid),
    /// All points near a line along y.
    Capsule(Capsule3d),
    /// Convex hull of these points, in metres: at least four that are in no plane.
    Hull(Vec<Vec3>),
}

impl Default for Body {
    /// Cube of a metre, like Bevy's `Cuboid`.
    fn default() -> Self {
        Self::from(Cuboid::default())
    }
}

impl Body {
    /// Body of one convex shape.
    #[must_use]
    pub fn new(shape: BodyShape) -> Self {
        Self { parts: Vec::new() }.with_part(shape, Vec3::ZERO, Quat::IDENTITY)
    }

    /// Adds a convex part at a place in the entity's frame, in metres.
    #[must_use]
    pub fn with_part(mut self, shape: BodyShape, translation: Vec3, rotation: Quat) -> Self {
        self.parts.push(BodyPart { shape, translation, rotation });
        self
    }

    fn shape(&self) -> Result<Shape<f32>, taw::Error> {
        let mut parts = self.parts.iter().map(BodyPart::shape).collect::<Result<Vec<_>, _>>()?;
        match parts.len() {
            1 => Ok(parts.swap_remove(0)),
            _ => Ok(Shape::Compound(Compound::new(parts)?)),
        }
    }
}

impl From<Sphere> for Body {
    fn from(sphere: Sphere) -> Self {
        Self::new(BodyShape::Sphere(sphere))
    }
}

impl From<Cuboid> for Body {
    fn from(cuboid: Cuboid) -> Self {
        Self::new(BodyShape::Cuboid(cuboid))
    }
}

impl From<Capsule3d> for Body {
    fn from(capsule: Capsule3d) -> Self {
        Self::new(BodyShape::Capsule(capsule))
    }
}

impl BodyPart {
    fn shape(&self) -> Result<Shape<f32>, taw::Error> {
        let origin = to_point(Vec3::ZERO);
        let shape = match &self.shape {
            BodyShape::Sphere(ball) => Shape::Sphere(taw::shape::Sphere::new(origin, ball.radius)?),
            BodyShape::Cuboid(cuboid) => {
                let turn = to_rotation(Quat::IDENTITY);
                Shape::Obb(taw::shape::Obb::new(origin, turn, to_vector(cuboid.half_size))?)
            }
            BodyShape::Capsule(Capsule3d { radius, half_length }) => {
                let end = to_vector(Vec3::Y * *half_length);
                Shape::Capsule(taw::shape::Capsule::new(origin - end, origin + end, *radius)?)
            }
            BodyShape::Hull(points) => {
                let points: Vec<_> = points.iter().map(|point| to_point(*point)).collect();
                Shape::Hull(taw::shape::Hull::new(&points)?)
            }
        };
        Ok(shape.transformed(pose(self.translation, self.rotation).validated()?))
    }
}

fn pose(translation: Vec3, rotation: Quat) -> Pose<f32> {
    Pose { rotation: to_rotation(rotation), translation: to_vector(translation) }
}

impl TawWorld {
    /// Handle of an entity's body in [`World::bodies`](taw::world::World::bodies).
    #[must_use]
    pub fn body_id(&self, body: Entity) -> Option<BodyId> {
        self.body_entities.iter().find_map(|(id, entity)| (*entity == body).then_some(*id))
    }
}

/// State of a body entity in the physics.
#[derive(Component, Clone, Debug, Default)]
pub(crate) struct BodyState {
    /// `None` before the first gather, while it is out of the world, and when the input was refused.
    pub id: Option<BodyId>,
    /// Components as gather or scatter last left them.
    seen: SeenBody,
    /// True if they could be no body: that is tried again when they change.
    refused: bool,
    /// Body as it left the world, for when it comes back: its entity is disabled, or the response knows none.
    away: Option<Box<core::Body<f32>>>,
}

/// Components of a body to the bit, so that even a NaN is seen only once.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct SeenBody {
    place: ([u32; 3], [u32; 4]),
    velocity: [Option<[u32; 3]>; 2],
    settings: Settings,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Settings {
    mass: Option<(u8, u32)>,
    gravity_scale: Option<u32>,
    damping: Option<[u32; 2]>,
    material: Option<([u32; 7], taw::response::Combine)>,
    layers: CollisionLayers,
    sleeping_disabled: bool,
}

/// Optional components of a body that are settings.
type BodySettings<'a> = (
    Option<&'a MarbleMass>,
    Option<&'a GravityScale>,
    Option<&'a MarbleDamping>,
    Option<&'a SurfaceMaterial>,
    Option<&'a CollisionLayers>,
    Has<SleepingDisabled>,
);

/// Components of a body entity.
#[derive(QueryData)]
#[query_data(mutable)]
pub(crate) struct BodyComponents {
    entity: Entity,
    body: Ref<'static, Body>,
    transform: &'static Transform,
    is_child: Has<ChildOf>,
    velocity: Option<&'static Velocity>,
    spin: Option<&'static AngularVelocity>,
    settings: BodySettings<'static>,
    is_disabled: Has<Disabled>,
    state: &'static mut BodyState,
}

impl BodyComponentsItem<'_, '_> {
    fn seen(&self) -> SeenBody {
        let (mass, gravity_scale, damping, material, layers, sleeping_disabled) = self.settings;
        SeenBody {
            place: (bits(self.transform.translation), rotation_bits(self.transform.rotation)),
            velocity: [self.velocity.map(|v| bits(**v)), self.spin.map(|spin| bits(**spin))],
            settings: Settings {
                mass: mass.map(|mass| mass.bits()),
                gravity_scale: gravity_scale.map(|scale| scale.to_bits()),
                damping: damping.map(|d| [d.linear, d.angular].map(f32::to_bits)),
                material: material.map(SurfaceMaterial::bits),
                layers: layers.copied().unwrap_or_default(),
                sleeping_disabled,
            },
        }
    }

    /// Writes the shape and the settings to a body.
    fn set(&self, body: &mut core::Body<f32>) -> Result<(), taw::Error> {
        let (mass, gravity_scale, damping, material, layers, sleeping_disabled) = self.settings;
        body.shape = self.body.shape()?;
        body.mass = core::BodyMass::Uniform(mass.copied().unwrap_or_default().into());
        body.gravity_scale = *gravity_scale.copied().unwrap_or_default();
        body.damping = damping.map_or([0.0; 2], |d| [d.linear, d.angular]);
        body.material = material.map(|m| (*m).into()).unwrap_or_default();
        body.layers = layers.copied().unwrap_or_default().into();
        body.sleeping_disabled = sleeping_disabled;
        Ok(())
    }

    /// Takes the body out of the world until it comes back.
    fn leave(&mut self, world: &mut TawWorld) {
        if let Some(id) = self.state.id.take() {
            world.body_entities.remove(&id);
            // It can only be gone already if the game took it out by itself.
            self.state.away = world.bodies.remove(id).ok().map(Box::new);
        }
    }

    /// Puts a body in, or takes over what somebody wrote; of one in a restored world, `all` that is set.
    fn take_over(
        &mut self,
        world: &mut TawWorld,
        (place, rotation): (Vec3, Quat),
        (last, seen): (&SeenBody, &SeenBody),
        all: bool,
    ) -> Result<BodyId, taw::Error> {
        let id = self.state.id;
        let is_new = id.is_none() && self.state.away.is_none();
        let was_placed = is_new || last.place != seen.place;
        let was_pushed = is_new || last.velocity != seen.velocity;
        if let Some(id) = id
            && !all
            && last.settings == seen.settings
            && !self.body.is_changed()
        {
            if was_placed {
                world.bodies.set_pose(id, pose(place, rotation))?;
            }
            if was_pushed {
                let now = world.bodies.motion(id)?;
                let velocity = self.velocity.map_or(now.velocity, |v| to_vector(**v));
                let spin = self.spin.map_or(now.angular_velocity, |spin| to_vector(**spin));
                world.bodies.set_velocity(id, velocity, spin)?;
            }
            return Ok(id);
        }
        let before = match (id, &self.state.away) {
            (Some(id), _) => world.bodies.get(id)?,
            (None, Some(away)) => (**away).clone(),
            (None, None) => core::Body::cuboid(to_vector(Vec3::ONE), to_point(place)),
        };
        let mut now = before.clone();
        self.set(&mut now)?;
        if was_placed {
            (now.position, now.rotation) = (to_point(place), to_rotation(rotation));
        }
        if let Some(velocity) = self.velocity.filter(|_| was_pushed) {
            now.velocity = to_vector(**velocity);
        }
        if let Some(spin) = self.spin.filter(|_| was_pushed) {
            now.angular_velocity = to_vector(**spin);
        }
        match id {
            Some(id) if now == before => Ok(id),
            Some(id) => world.bodies.set(id, now).map(|()| id),
            None => world.bodies.insert(now),
        }
    }
}

/// Run condition: there are bodies, also disabled ones.
pub(crate) fn any(bodies: Query<(), (With<Body>, Allow<Disabled>)>) -> bool {
    !bodies.is_empty()
}

/// Puts new bodies in, and takes over what somebody else wrote since the last scatter.
pub(crate) fn gather(
    mut world: ResMut<TawWorld>,
    mut bodies: Query<BodyComponents, Allow<Disabled>>,
    transforms: TransformHelper,
    (mut refusals, mut commands): (Refusals, Commands),
    mut was_known: Local<bool>,
) {
    let is_known = world.model().response.knows_bodies();
    let again = !std::mem::replace(&mut *was_known, is_known) && is_known;
    let restored = world.just_restored;
    for mut it in &mut bodies {
        let entity = it.entity;
        if !is_known || it.is_disabled {
            let was_in = it.state.id.is_some();
            it.leave(&mut world);
            if was_in {
                commands.entity(entity).try_remove::<Sleeping>(); // what is away is awake when it comes back
            }
            if !is_known && !it.is_disabled {
                let response = "a response other than SoftStep";
                let error = taw::Error::Unsupported { response, feature: "rigid bodies" };
                refusals.check(Some(entity), Err::<(), _>(error));
            }
            continue;
        }
        let seen = it.seen();
        it.state.refused &= !again;
        it.state.id = it.state.id.filter(|id| world.bodies.motion(*id).is_ok());
        let last = std::mem::replace(&mut it.state.seen, seen);
        let is_settled = it.state.id.is_some() || it.state.refused && !it.is_child;
        if is_settled && last == seen && !it.body.is_changed() && !restored {
            continue;
        }
        let place = if it.is_child {
            let global = transforms.compute_global_transform(entity);
            let Ok(global) = global else {
                refusals.check(Some(entity), Err(Refusal::NoPlace));
                continue;
            };
            (global.translation(), global.rotation())
        } else {
            (it.transform.translation, it.transform.rotation)
        };
        match it.take_over(&mut world, place, (&last, &seen), restored) {
            Ok(id) => {
                (it.state.id, it.state.refused, it.state.away) = (Some(id), false, None);
                world.body_entities.insert(id, entity);
            }
            Err(error) => {
                it.state.refused = true;
                refusals.check(Some(entity), Err::<(), _>(error));
            }
        }
    }
}

/// Gives body entities the rows that they have in a restored world, and takes out those that no entity stands behind.
pub(crate) fn name(
    mut world: ResMut<TawWorld>,
    mut bodies: Query<&mut BodyState, Allow<Disabled>>,
    mut removed: MessageWriter<RowRemoved>,
) {
    for mut state in &mut bodies {
        (state.id, state.refused) = (None, false);
    }
    let known: Vec<_> = world.body_entities.iter().map(|(id, entity)| (*id, *entity)).collect();
    for (id, entity) in known {
        match bodies.get_mut(entity) {
            Ok(mut state) => (state.id, state.away) = (Some(id), None),
            Err(_) => {
                world.body_entities.remove(&id);
                if world.bodies.remove(id).is_ok() {
                    log::warn!("taw took out {id:?}: no entity stands behind it");
                    removed.write(RowRemoved::Body(id));
                }
            }
        }
    }
}

/// Applies what pushes and hits single bodies.
pub(crate) fn forces(
    mut world: ResMut<TawWorld>,
    forces: Query<(Entity, &ExternalForce, &BodyState)>,
    mut impulses: Query<(Entity, &mut ExternalImpulse, &BodyState)>,
    mut refusals: Refusals,
) {
    for (entity, ExternalForce { force, torque }, state) in &forces {
        if let Some(id) = state.id {
            let [force, torque] = [*force, *torque].map(to_vector);
            refusals.check(Some(entity), world.bodies.apply_central_force(id, force, torque));
        }
    }
    for (entity, mut hit, state) in &mut impulses {
        if let Some(id) = state.id
            && *hit != ExternalImpulse::default()
        {
            let [impulse, angular] = [hit.impulse, hit.angular].map(to_vector);
            let applied = world.bodies.apply_central_impulse(id, impulse, angular);
            refusals.check(Some(entity), applied);
            *hit = ExternalImpulse::default();
        }
    }
}

type MovedBody<'a> = (
    Entity,
    &'a mut Transform,
    Option<&'a mut Velocity>,
    Option<&'a mut AngularVelocity>,
    Has<Sleeping>,
    &'a mut BodyState,
);

/// Children with the frames of their parents; none where there is no way back from a scale of zero.
fn frames_of(
    children: &Query<(Entity, &ChildOf), With<Body>>,
    helper: &TransformHelper,
) -> HashMap<Entity, Option<Frame>> {
    let frames = children.iter().filter_map(|(entity, child_of)| {
        let parent = helper.compute_global_transform(child_of.parent()).ok()?;
        Some((entity, Frame::new(&parent)))
    });
    frames.collect()
}

/// Writes the place of a body to its `Transform`, and notes it as seen.
fn put(
    motion: &core::BodyPlace<f32>,
    frame: &Frame,
    transform: &mut Mut<Transform>,
    state: &mut Mut<BodyState>,
) {
    let place = frame.local(from_point(motion.position));
    let rotation = frame.turned(from_rotation(motion.rotation));
    let now = (bits(place), rotation_bits(rotation));
    if now != (bits(transform.translation), rotation_bits(transform.rotation)) {
        (transform.translation, transform.rotation) = (place, rotation);
    }
    state.seen.place = now;
}

/// Writes `Transform`, `Velocity` and `AngularVelocity` of the bodies that moved, and who sleeps.
pub(crate) fn scatter(
    world: Res<TawWorld>,
    mut transforms: ParamSet<(TransformHelper, Query<MovedBody, With<Body>>)>,
    children: Query<(Entity, &ChildOf), With<Body>>,
    mut commands: Commands,
) {
    let frames = frames_of(&children, &transforms.p0());
    for (entity, mut transform, velocity, spin, sleeping, mut state) in &mut transforms.p1() {
        let Some(body) = state.id.and_then(|id| world.bodies.motion(id).ok()) else { continue };
        let frame = match frames.get(&entity) {
            None => Frame::WORLD,
            Some(Some(frame)) => *frame,
            Some(None) => continue,
        };
        put(&body, &frame, &mut transform, &mut state);
        if let Some(mut velocity) = velocity {
            let now = from_vector(body.velocity);
            state.seen.velocity[0] = Some(bits(now));
            velocity.set_if_neq(Velocity(now));
        }
        if let Some(mut spin) = spin {
            let now = from_vector(body.angular_velocity);
            state.seen.velocity[1] = Some(bits(now));
            spin.set_if_neq(AngularVelocity(now));
        }
        match (body.is_asleep, sleeping) {
            (true, false) => {
                commands.entity(entity).try_insert(Sleeping);
            }
            (false, true) => {
                commands.entity(entity).try_remove::<Sleeping>();
            }
            _ => {}
        }
    }
}

/// Run condition: there are bodies that are children.
pub(crate) fn any_child(bodies: Query<(), (With<Body>, With<ChildOf>)>) -> bool {
    !bodies.is_empty()
}

/// Keeps bodies that are children where they are while their parents move between steps, unless somebody moved them,
/// too.
pub(crate) fn stay(
    world: Res<TawWorld>,
    mut transforms: ParamSet<(
        TransformHelper,
        Query<(Entity, &mut Transform, &mut BodyState), With<ChildOf>>,
    )>,
    children: Query<(Entity, &ChildOf), With<Body>>,
) {
    let frames = frames_of(&children, &transforms.p0());
    for (entity, mut transform, mut state) in &mut transforms.p1() {
        let now = (bits(transform.translation), rotation_bits(transform.rotation));
        if now == state.seen.place
            && let Some(Some(frame)) = frames.get(&entity)
            && let Some(body) = state.id.and_then(|id| world.bodies.motion(id).ok())
        {
            put(&body, frame, &mut transform, &mut state);
        }
    }
}

/// Takes a body out of the world when its component or entity goes.
pub(crate) fn forget(removed: On<Remove, Body>, mut app: DeferredWorld) {
    let id = app.get::<BodyState>(removed.entity).and_then(|state| state.id);
    let mut world = app.resource_mut::<TawWorld>();
    if let Some(id) = id
        && world.body_entities.get(&id) == Some(&removed.entity)
    {
        let _ = world.bodies.remove(id); // or the game took it out by itself
        world.body_entities.remove(&id);
    }
    app.commands().entity(removed.entity).try_remove::<(BodyState, Sleeping)>();
}
