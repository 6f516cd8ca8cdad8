//! Rigid bodies: boxes, capsules, hulls and compounds that move and turn.

use bevy::ecs::world::DeferredWorld;
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
use crate::refusal::Refusals;
use crate::resources::TawWorld;
use crate::scatter::Frame;

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
    /// `None` before the first gather, and when the input was refused.
    pub id: Option<BodyId>,
    /// Components as gather or scatter last left them.
    seen: SeenBody,
    /// True if they could be no body: that is tried again when they change.
    refused: bool,
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

/// Components of a body entity.
type BodyComponents<'a> = (
    Entity,
    Ref<'a, Body>,
    &'a Transform,
    Option<&'a ChildOf>,
    (Option<&'a Velocity>, Option<&'a AngularVelocity>),
    (
        Option<&'a MarbleMass>,
        Option<&'a GravityScale>,
        Option<&'a MarbleDamping>,
        Option<&'a SurfaceMaterial>,
        Option<&'a CollisionLayers>,
        Has<SleepingDisabled>,
    ),
    &'a mut BodyState,
);

/// Puts new bodies in, and takes over what somebody else wrote since the last scatter.
#[allow(clippy::too_many_lines, reason = "to be split: it reads, compares and sets")]
pub(crate) fn gather(
    mut world: ResMut<TawWorld>,
    mut bodies: Query<BodyComponents>,
    transforms: TransformHelper,
    mut refusals: Refusals,
    mut was_known: Local<bool>,
) {
    let is_known = world.model().response.knows_bodies();
    let again = !std::mem::replace(&mut *was_known, is_known) && is_known;
    for (entity, body, transform, parent, (velocity, spin), settings, mut state) in &mut bodies {
        if !is_known {
            if let Some(id) = state.id.take() {
                let _ = world.bodies.remove(id); // or the game took it out by itself
                world.body_entities.remove(&id);
            }
            if !std::mem::replace(&mut state.refused, true) {
                let response = "a response other than SoftStep";
                let error = taw::Error::Unsupported { response, feature: "rigid bodies" };
                refusals.check(Some(entity), Err::<(), _>(error));
            }
            continue;
        }
        let (mass, gravity_scale, damping, material, layers, sleeping_disabled) = settings;
        let seen = SeenBody {
            place: (bits(transform.translation), rotation_bits(transform.rotation)),
            velocity: [velocity.map(|v| bits(**v)), spin.map(|s| bits(**s))],
            settings: Settings {
                mass: mass.map(|mass| mass.bits()),
                gravity_scale: gravity_scale.map(|scale| scale.to_bits()),
                damping: damping.map(|d| [d.linear, d.angular].map(f32::to_bits)),
                material: material.map(SurfaceMaterial::bits),
                layers: layers.copied().unwrap_or_default(),
                sleeping_disabled,
            },
        };
        state.refused &= !again;
        let id = state.id.filter(|id| world.bodies.pose(*id).is_ok());
        let last = std::mem::replace(&mut state.seen, seen);
        if (id.is_some() || state.refused) && last == seen && !body.is_changed() {
            continue;
        }
        let is_new = id.is_none();
        let (place, rotation) = match parent {
            None => (transform.translation, transform.rotation),
            Some(_) => match transforms.compute_global_transform(entity) {
                Ok(global) => (global.translation(), global.rotation()),
                Err(_) => continue, // it has no parent's place
            },
        };
        let set = |world: &mut TawWorld| {
            let shape = body.shape()?;
            let mut now = match id {
                Some(id) => core::Body { shape, ..world.bodies.get(id)? },
                None => core::Body::new(shape, to_point(place)),
            };
            if is_new || last.place != seen.place {
                (now.position, now.rotation) = (to_point(place), to_rotation(rotation));
            }
            if let Some(velocity) = velocity.filter(|_| is_new || last.velocity != seen.velocity) {
                now.velocity = to_vector(**velocity);
            }
            if let Some(spin) = spin.filter(|_| is_new || last.velocity != seen.velocity) {
                now.angular_velocity = to_vector(**spin);
            }
            let mass = mass.copied().unwrap_or_default();
            now.mass = core::BodyMass::Uniform(mass.into());
            now.gravity_scale = *gravity_scale.copied().unwrap_or_default();
            now.damping = damping.map_or([0.0; 2], |d| [d.linear, d.angular]);
            now.material = material.map(|m| (*m).into()).unwrap_or_default();
            now.layers = layers.copied().unwrap_or_default().into();
            now.sleeping_disabled = sleeping_disabled;
            match id {
                Some(id) => world.bodies.set(id, now).map(|()| id),
                None => world.bodies.insert(now),
            }
        };
        match set(&mut world) {
            Ok(id) => {
                (state.id, state.refused) = (Some(id), false);
                world.body_entities.insert(id, entity);
            }
            Err(error) => {
                state.refused = true;
                refusals.check(Some(entity), Err::<(), _>(error));
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

/// Writes `Transform`, `Velocity` and `AngularVelocity` of the bodies that moved, and who sleeps.
pub(crate) fn scatter(
    world: Res<TawWorld>,
    mut transforms: ParamSet<(TransformHelper, Query<MovedBody, With<Body>>)>,
    children: Query<(Entity, &ChildOf), With<Body>>,
    mut commands: Commands,
) {
    let helper = transforms.p0();
    let frames: Vec<_> = children
        .iter()
        .filter_map(|(entity, child_of)| {
            let parent = helper.compute_global_transform(child_of.parent()).ok()?;
            Some((entity, Frame::new(&parent)))
        })
        .collect();
    for (entity, mut transform, velocity, spin, sleeping, mut state) in &mut transforms.p1() {
        let Some(body) = state.id.and_then(|id| world.bodies.motion(id).ok()) else { continue };
        let frame = match frames.iter().find(|(child, _)| *child == entity) {
            None => Frame::WORLD,
            Some((_, Some(frame))) => *frame,
            Some((_, None)) => continue, // there is no way back from a scale of zero
        };
        let place = frame.local(from_point(body.position));
        let rotation = frame.turned(from_rotation(body.rotation));
        let now = (bits(place), rotation_bits(rotation));
        if now != (bits(transform.translation), rotation_bits(transform.rotation)) {
            (transform.translation, transform.rotation) = (place, rotation);
        }
        state.seen.place = now;
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
