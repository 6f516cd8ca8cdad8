//! Rigid bodies: boxes, capsules, hulls and compounds that move and turn.

use bevy::ecs::world::DeferredWorld;
use bevy::prelude::*;
use taw::body as core;
use taw::body::BodyId;
use taw::frame::Pose;
use taw::shape::{Compound, Shape};

use crate::components::{AngularVelocity, Sleeping, Velocity, bits};
use crate::convert::{from_point, from_rotation, from_vector, to_point, to_rotation, to_vector};
use crate::layers::CollisionLayers;
use crate::resources::TawWorld;
use crate::scatter::{Frame, put};

/// Rigid body: a solid of any shape that moves, turns and collides.
///
/// It lies in the entity's own frame, and its [`Transform`] is its place: whoever writes one puts it there at once,
/// with its velocity. It takes the components of a marble: [`Velocity`] (of the center of mass), [`AngularVelocity`],
/// [`MarbleMass`](crate::components::MarbleMass) (infinite for a body that moves by its velocity alone), `GravityScale`,
/// `MarbleDamping`, `SurfaceMaterial`, [`CollisionLayers`], `ExternalForce` and `ExternalImpulse` (at the center of
/// mass), `SleepingDisabled`, and [`Sleeping`] to read. Its scale does not count.
///
/// While its entity is [`Disabled`](bevy::ecs::entity_disabling::Disabled), it is out of the world with its joints, and comes back as it
/// was. [`TawWorld::restore`] brings it back to where it was, too.
///
/// Bodies need [`Response::SoftStep`](taw::response::Response::SoftStep), the default. Messages of contacts and sensors tell of
/// them as of marbles, except of contacts with balls of swarms, and marbles jump off them
/// ([`Grounded`](crate::grounded::Grounded)). Force fields and zones do not act on them. On a
/// body, `LockedAxes`, `ColliderDisabled`, `IgnoreCollisions`, `SurfaceVelocity` and `OneWay` do nothing, as [`IgnoredComponents`](crate::ignored::IgnoredComponents) says. An entity that is also a
/// [`Marble`](crate::components::Marble) or a [`Wall`](crate::wall::Wall) is that only, and no body, and told as
/// [`InputRefused`](crate::refusal::InputRefused). By default it is of glass, like marbles: a box of 40 cm has 160 kg, which motors have to move.
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

    pub(crate) fn shape(&self) -> Result<Shape<f32>, taw::Error> {
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

pub(crate) fn pose(translation: Vec3, rotation: Quat) -> Pose<f32> {
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
    pub seen: SeenBody,
    /// True if they could be no body: that is tried again when they change.
    pub refused: bool,
    /// Body as it left the world, for when it comes back: its entity is disabled, or the response knows none.
    pub away: Option<Box<core::Body<f32>>>,
}

/// Components of a body to the bit, so that even a NaN is seen only once.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SeenBody {
    pub place: ([u32; 3], [u32; 4]),
    pub velocity: [Option<[u32; 3]>; 2],
    pub settings: BodySettings,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct BodySettings {
    pub mass: Option<(u8, u32)>,
    pub gravity_scale: Option<u32>,
    pub damping: Option<[u32; 2]>,
    pub material: Option<([u32; 7], taw::response::Combine)>,
    pub layers: CollisionLayers,
    pub sleeping_disabled: bool,
}

pub(crate) type MovedBody<'a> = (
    Entity,
    &'a mut Transform,
    Option<&'a mut Velocity>,
    Option<&'a mut AngularVelocity>,
    Has<Sleeping>,
    &'a mut BodyState,
);
type MovedBodyItem<'a> = (
    Entity,
    Mut<'a, Transform>,
    Option<Mut<'a, Velocity>>,
    Option<Mut<'a, AngularVelocity>>,
    bool,
    Mut<'a, BodyState>,
);

/// Writes the bodies that are no children.
pub(crate) fn scatter(
    world: Res<TawWorld>,
    mut bodies: Query<MovedBody, (With<Body>, Without<ChildOf>)>,
    mut commands: Commands,
) {
    for moved in &mut bodies {
        write(&world, moved, &Frame::WORLD, &mut commands);
    }
}

/// Writes `Transform`, `Velocity` and `AngularVelocity` of a body that moved, and whether it sleeps.
pub(crate) fn write(
    world: &TawWorld,
    (entity, mut transform, velocity, spin, sleeping, mut state): MovedBodyItem,
    frame: &Frame,
    commands: &mut Commands,
) {
    let Some(body) = state.id.and_then(|id| world.bodies.motion(id).ok()) else { return };
    let (position, rotation) = (from_point(body.position), from_rotation(body.rotation));
    put(&mut transform, &mut state, frame, Some(position), Some(rotation));
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
