//! Components of marbles and walls. Each needs nothing but its own; the rest is optional.

use bevy::math::Isometry3d;
use bevy::prelude::*;
use taw::motion::{Integrator, Rotation};
use taw::response::{Combine, Elasticity, Material};
use taw::world::{MarbleId, Mass, SensorId, WallId, WallShape};

use crate::layers::CollisionLayers;
use crate::locked_axes::LockedAxes;
use crate::reflect::{CombineReflect, IntegratorReflect, RotationReflect};
use crate::wall_motion::PoseTracker;

/// A marble: a ball that moves and collides.
///
/// Its place is its [`Transform`]: whoever writes one moves the marble there at
/// once, keeping its velocity. (How a write between steps counts while motion is
/// interpolated is told in [`interpolation`](crate::interpolation).) As a child of another
/// entity it still moves freely, in world space. Its scale does not count. While its entity
/// is [`Disabled`](bevy::ecs::entity_disabling::Disabled), it is out of the world; it comes
/// back with the velocity that it had.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
#[require(Transform, MarbleState)]
pub struct Marble {
    /// In metres, above zero. May change at any time.
    pub radius: f32,
}

impl Default for Marble {
    /// Half a metre in radius, like Bevy's `Sphere`.
    fn default() -> Self {
        Self::new(0.5)
    }
}

impl Marble {
    /// A marble of this radius, in metres.
    #[must_use]
    pub const fn new(radius: f32) -> Self {
        Self { radius }
    }
}

/// The velocity of a marble, in metres per second in world space. Without it a
/// marble starts at rest; with it, it can be read and written.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Deref, DerefMut, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct Velocity(pub Vec3);

/// Angular velocity of a marble in radians per second, an axial vector in world space. Only a
/// [`Model`](taw::world::Model) with rotation keeps it.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Deref, DerefMut, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct AngularVelocity(pub Vec3);

/// Mass of a marble. Without it, a marble is of glass.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub enum MarbleMass {
    /// As a solid ball of this density, in kg/m³, above zero. Follows the radius.
    Density(f32),
    /// This many kilograms, above zero, whatever the radius.
    Kilograms(f32),
    /// Infinite (a kinematic marble): no force, gravity, wall or marble changes its velocity, and it passes
    /// through walls and others of its kind.
    Infinite,
}

impl Default for MarbleMass {
    fn default() -> Self {
        Mass::default().into()
    }
}

/// Factor of the world's gravity for a marble: 0 floats, −1 rises.
#[derive(Component, Clone, Copy, Debug, PartialEq, Deref, DerefMut, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct GravityScale(pub f32);

impl Default for GravityScale {
    fn default() -> Self {
        Self(1.0)
    }
}

/// Surface material of a marble, a body or a wall. A wall without
/// one leaves it to what touches it; else both count, as [`combine`](Self::combine) says. The
/// response [`Displacement`](taw::response::Response::Displacement) does not read it.
///
/// By default, and of marbles and bodies without one: restitution 0.5, friction 0.3, nothing that resists rolling.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct SurfaceMaterial {
    /// Coefficient of restitution: the part of the approach speed that a bounce gives back, in `[0, 1]`.
    pub restitution: f32,
    /// Coefficient of friction (Coulomb): the largest friction force over the normal force, at least zero.
    pub friction: f32,
    /// The part of the sliding speed of the touching points that a bounce turns round,
    /// in `[-1, 1]`, as far as friction can: 0 stops them, 1 is a superball, −1 slides
    /// freely.
    pub tangential_restitution: f32,
    /// The torque that resists rolling, over normal force times radius, at least zero.
    pub rolling_resistance: f32,
    /// The torque that resists spinning on the spot, over normal force times radius, at
    /// least zero.
    pub spinning_resistance: f32,
    /// Young's modulus in pascals, above zero, and Poisson's ratio in `[0, 0.5]`, for the
    /// response of Hertz and Mindlin.
    pub elasticity: [f32; 2],
    /// Rule that combines it with another material.
    #[reflect(remote = CombineReflect)]
    pub combine: Combine,
}

impl Default for SurfaceMaterial {
    /// Somewhat bouncy, somewhat rough: 0.5 and 0.3. Nothing resists rolling.
    fn default() -> Self {
        let material = Material::default();
        let Elasticity { youngs_modulus, poissons_ratio } = material.elasticity;
        Self {
            restitution: material.restitution,
            friction: material.friction,
            tangential_restitution: material.tangential_restitution,
            rolling_resistance: material.rolling_resistance,
            spinning_resistance: material.spinning_resistance,
            elasticity: [youngs_modulus, poissons_ratio],
            combine: material.combine,
        }
    }
}

impl From<SurfaceMaterial> for Material<f32> {
    fn from(material: SurfaceMaterial) -> Self {
        let [youngs_modulus, poissons_ratio] = material.elasticity;
        Self {
            restitution: material.restitution,
            friction: material.friction,
            tangential_restitution: material.tangential_restitution,
            rolling_resistance: material.rolling_resistance,
            spinning_resistance: material.spinning_resistance,
            elasticity: Elasticity { youngs_modulus, poissons_ratio },
            combine: material.combine,
        }
    }
}

/// Slows a marble wherever it is: each second takes `1 − e^−rate` of its speed.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct MarbleDamping {
    /// Of the velocity, in 1/s, at least zero.
    pub linear: f32,
    /// Rate for the angular velocity in 1/s, at least zero; counts if the model's rotation is dynamic.
    pub angular: f32,
}

/// Pushes and turns a marble in every step for as long as it has this.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct ExternalForce {
    /// At the center, in newtons, in world space.
    pub force: Vec3,
    /// In N m, an axial vector in world space; counts if the model's rotation is dynamic.
    pub torque: Vec3,
}

impl ExternalForce {
    /// A force at a point relative to the marble's center, in metres.
    #[must_use]
    pub fn at(force: Vec3, lever: Vec3) -> Self {
        Self { force, torque: lever.cross(force) }
    }
}

/// Hits a marble in the next step, which sets it back to zero.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct ExternalImpulse {
    /// At the center, in N s, in world space.
    pub impulse: Vec3,
    /// In kg m²/s, an axial vector in world space; counts in a model with rotation.
    pub angular: Vec3,
}

impl ExternalImpulse {
    /// A hit at a point relative to the marble's center, in metres.
    #[must_use]
    pub fn at(impulse: Vec3, lever: Vec3) -> Self {
        Self { impulse, angular: lever.cross(impulse) }
    }
}

/// Integrates this marble in its own way instead of the model's.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Deref, DerefMut, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct MarbleIntegrator(#[reflect(remote = IntegratorReflect)] pub Integrator);

/// Lets this marble turn less than the model's rotation has others turn: only for show,
/// or not at all.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Deref, DerefMut, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct MarbleRotation(#[reflect(remote = RotationReflect)] pub Rotation);

/// Marker of a marble or a body that sleeps, to read: the plugin adds and removes it after each step.
///
/// Marbles that rest for half a second fall asleep with those that they touch (their island; by
/// [`SoftStep`](taw::response::Response::SoftStep), in a large heap part by part), and then cost
/// next to nothing. They wake together when one of them is struck or written, when one beside them is
/// written or despawned, when gravity changes, or a wall near them. Bodies do so, too, and sleep only together with the
/// marbles and balls that they touch; those that a joint holds or that lie on something that moves do not sleep. By
/// [`EventDriven`](taw::response::Response::EventDriven), all sleep or none.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct Sleeping;

/// Forbids a marble to sleep, and with it those that it touches.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct SleepingDisabled;

/// Makes a capsule of a marble: all points within its radius of a line along the entity's y
/// axis, which goes this far both ways, in metres; like Bevy's `Capsule3d`. Zero is a ball.
///
/// All responses but `EventDriven` and `SoftStep`, the default, know capsules. By these two a new
/// capsule is refused, and left out of the world until the model changes; and while the world has
/// capsules, a [`TawModel`](crate::resources::TawModel) with one of the two is refused.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Deref, DerefMut, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct HalfLength(pub f32);

/// Marks a new [`Transform`] as a jump: put it on a wall, or on what carries walls, together
/// with the place, and the next step takes that for where they are and not for how fast they came
/// there. The step takes this off again.
///
/// Without it, what changes the speed of a wall's surface by more than
/// [`LARGEST_CHANGE_OF_SPEED`](crate::wall_motion::LARGEST_CHANGE_OF_SPEED) within a step is a jump,
/// too, unless the wall is [`Kinematic`].
/// On a marble it makes a place of what might be a nudge; see
/// [`interpolation`](crate::interpolation).
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// fn to_the_cellar(mut lift: Single<(Entity, &mut Transform), With<Wall>>, mut commands: Commands) {
///     let (entity, transform) = &mut *lift;
///     transform.translation.y = -5.0;
///     commands.entity(*entity).insert(Teleport);
/// }
/// ```
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct Teleport;

/// Marker of a wall, or of what carries walls, that is driven: each change of its [`Transform`] is
/// motion, however sudden, unless it comes with a [`Teleport`].
///
/// A flipper needs it, or a piston: something that goes from rest to more than
/// [`LARGEST_CHANGE_OF_SPEED`](crate::wall_motion::LARGEST_CHANGE_OF_SPEED) within a step. Without it
/// that is taken for a jump, which carries nothing along, and said once in the log.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// fn spawn(mut commands: Commands) {
///     commands.spawn((Wall::from(Cuboid::new(0.3, 0.05, 0.05)), Kinematic));
/// }
/// ```
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct Kinematic;

/// Velocity of the surface of a [`Wall`](crate::wall::Wall), in m/s in the entity's own frame, as of a
/// conveyor belt: it drags what touches it along the surface, and pushes nobody. It does not count in
/// steps in which the wall itself moves.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Deref, DerefMut, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct SurfaceVelocity(pub Vec3);

/// State of a marble entity in the physics.
#[derive(Component, Clone, Copy, Debug, Default)]
pub(crate) struct MarbleState {
    /// `None` before the first gather, while disabled, and when the input was refused.
    pub id: Option<MarbleId>,
    /// The components as gather, scatter or easing last left them. What differs was
    /// written by somebody else.
    pub seen: SeenMarble,
    /// True if the components are to be taken over.
    pub stale: bool,
    /// True if they could be no marble: that is tried again when they change.
    pub refused: bool,
}

/// Between which places a marble is drawn.
#[derive(Component, Clone, Copy, Debug, Default)]
pub(crate) struct Eased {
    /// Its place in world space when the last step began, after all teleports.
    pub from: Option<(Vec3, Option<Quat>)>,
    /// Number of restores of the world by then.
    pub restored: u32,
    /// The place that was written in the last frame.
    pub wrote: Option<Vec3>,
}

/// A marble's components to the bit, so that even a NaN is seen only once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SeenMarble {
    pub translation: [u32; 3],
    pub rotation: [u32; 4],
    pub radius: u32,
    pub half_length: Option<u32>,
    pub velocity: Option<[u32; 3]>,
    pub angular_velocity: Option<[u32; 3]>,
    /// Which kind of mass, and its number.
    pub mass: Option<(u8, u32)>,
    pub gravity_scale: Option<u32>,
    pub damping: Option<[u32; 2]>,
    pub material: Option<([u32; 7], Combine)>,
    pub integrator: Option<Integrator>,
    pub rotation_model: Option<Rotation>,
    pub locked_axes: LockedAxes,
    pub layers: CollisionLayers,
    pub sleeping_disabled: bool,
}

/// State of a wall entity in the physics.
#[derive(Component, Clone, Debug, Default)]
pub(crate) struct WallState {
    /// `None` before the first gather, while disabled, and when the input was refused.
    pub id: Option<WallId>,
    /// Handle of a sensor; `None` for a solid wall, and in the cases of `id`.
    pub sensor: Option<SensorId>,
    /// Shape in its own frame.
    pub shape: Option<LocalShape>,
    /// The scale that it was last built for, whether or not it could be.
    pub built: Option<Vec3>,
    /// True if it could not be built.
    pub refused: bool,
    /// Its place in world space as last gathered, to the bit: translation and rotation.
    pub posed: Option<([u32; 3], [u32; 4])>,
    /// Its poses in the physics before and after the last step, alike if it did not move.
    pub poses: Option<[Isometry3d; 2]>,
    /// Its material as last gathered, to the bit.
    pub material: Option<([u32; 7], Combine)>,
    /// Its layers as last gathered.
    pub layers: CollisionLayers,
    /// Motion of its entity.
    pub motion: PoseTracker,
    /// True while its surface moves and it does not: a conveyor belt.
    pub is_belt: bool,
    /// True once the log has said that a change of its place is taken for a jump.
    pub jumped: bool,
}

impl WallState {
    /// State with the same shape, but without a row: on its way into a world.
    pub fn without_row(&mut self) -> Self {
        let (shape, built, refused) = (self.shape.take(), self.built, self.refused);
        Self { shape, built, refused, ..Self::default() }
    }
}

/// A wall in its own frame, built at some scale.
#[derive(Clone, Debug)]
pub(crate) struct LocalShape {
    pub shape: WallShape<f32>,
    /// Distance of its farthest point from the origin, in metres.
    pub reach: f32,
}

impl SurfaceMaterial {
    /// The bits of its numbers, and its rule.
    pub(crate) fn bits(&self) -> ([u32; 7], Combine) {
        let numbers = [
            self.restitution,
            self.friction,
            self.tangential_restitution,
            self.rolling_resistance,
            self.spinning_resistance,
            self.elasticity[0],
            self.elasticity[1],
        ];
        (numbers.map(f32::to_bits), self.combine)
    }
}

impl MarbleMass {
    /// Which kind, and the bits of its number.
    pub(crate) fn bits(self) -> (u8, u32) {
        match self {
            Self::Density(density) => (0, density.to_bits()),
            Self::Kilograms(mass) => (1, mass.to_bits()),
            Self::Infinite => (2, 0),
        }
    }
}

impl From<Mass<f32>> for MarbleMass {
    fn from(mass: Mass<f32>) -> Self {
        match mass {
            Mass::Density(density) => Self::Density(density),
            Mass::Kilograms(mass) => Self::Kilograms(mass),
            Mass::Infinite => Self::Infinite,
        }
    }
}

impl From<MarbleMass> for Mass<f32> {
    fn from(mass: MarbleMass) -> Self {
        match mass {
            MarbleMass::Density(density) => Self::Density(density),
            MarbleMass::Kilograms(mass) => Self::Kilograms(mass),
            MarbleMass::Infinite => Self::Infinite,
        }
    }
}

/// The bits of a vector.
pub(crate) fn bits(v: Vec3) -> [u32; 3] {
    v.to_array().map(f32::to_bits)
}

/// The bits of a rotation.
pub(crate) fn rotation_bits(q: Quat) -> [u32; 4] {
    q.to_array().map(f32::to_bits)
}
