//! Marbles that a player rolls.

use std::ops::DerefMut;

use bevy::prelude::*;
use taw::motion::Rotation;

use crate::components::{AngularVelocity, Marble, MarbleRotation, MarbleState, Velocity};
use crate::convert::{all_finite, at_least_zero};
use crate::grounded::{Ground, Grounded};
use crate::refusal::Refusals;
use crate::resources::{TawModel, TawWorld};
use crate::zones::ZoneGravity;

/// Lets a player roll a marble: write [`direction`](Self::direction) and [`jump`](Self::jump), in any
/// schedule, and the plugin turns, pushes and lifts it, before each step, in
/// [`TawSystems::Control`](crate::TawSystems::Control).
///
/// By default it rolls at up to 6 m/s, gains and loses 2.5 m/s² on the ground and gains 3 m/s² in the air, jumps with
/// 4.9 m/s (1.2 m high), up to a tenth of a second after it left the ground, or asked before it reaches it.
///
/// The ground carries it along, and is not pushed back by a jump. Snapshots do not remember jumps.
///
/// # What the ground can transmit
/// Friction times gravity is the greatest acceleration and deceleration of a ball that is driven by
/// [torque](Drive::Torque): 0.3 × 9.81 m/s² = 2.9 m/s² for marbles and walls without a
/// [`SurfaceMaterial`](crate::components::SurfaceMaterial). With more than that in
/// [`acceleration`](Self::acceleration) or [`braking`](Self::braking), the ball spins in place or slides. By a
/// [force](Drive::Force), it rolls without slip up to 3.5 times as much, and 5/7 of the force's
/// acceleration is that of the center. A nimble hero has friction:
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// fn spawn(mut commands: Commands) {
///     let controller = MarbleController { acceleration: 9.0, braking: 9.0, ..default() };
///     let rubber = SurfaceMaterial { friction: 1.0, restitution: 0.2, ..default() }; // up to 9.8 m/s²
///     commands.spawn((controller, rubber, Marble::new(0.25)));
/// }
/// ```
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// fn steer(
///     keys: Res<ButtonInput<KeyCode>>,
///     camera: Single<&GlobalTransform, With<Camera>>,
///     mut hero: Single<&mut MarbleController>,
/// ) {
///     let pressed = |key| f32::from(keys.pressed(key));
///     let input = Vec2::new(
///         pressed(KeyCode::KeyD) - pressed(KeyCode::KeyA),
///         pressed(KeyCode::KeyW) - pressed(KeyCode::KeyS),
///     );
///     hero.direction = MarbleController::seen_from(&camera, input, Dir3::Y);
///     if keys.just_pressed(KeyCode::Space) {
///         hero.jump = true;
///     }
/// }
/// ```
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
#[require(Marble, Velocity, AngularVelocity, Grounded, ControllerState)]
pub struct MarbleController {
    /// Direction to roll in, in world space; of length 1 for the whole speed, and shortened to it.
    pub direction: Vec3,
    /// Asks for a jump: now, or once it is on the ground within [`jump_buffer`](Self::jump_buffer). The
    /// next step takes it back.
    pub jump: bool,
    /// Drive on the ground.
    pub drive: Drive,
    /// Speed that it is driven to, in m/s.
    pub max_speed: f32,
    /// Acceleration on the ground, in m/s², as far as friction
    /// [transmits it](Self#what-the-ground-can-transmit).
    pub acceleration: f32,
    /// Acceleration in the air, in m/s².
    pub air_acceleration: f32,
    /// Deceleration on the ground without a direction, in m/s², as far as friction transmits it; zero lets
    /// it roll on.
    pub braking: f32,
    /// Speed of a jump, in m/s, against gravity and relative to the ground.
    pub jump_speed: f32,
    /// Time in which it may still jump after it has left the ground, in seconds.
    pub coyote_time: f32,
    /// Time for which a jump that was asked for in the air waits for the ground, in seconds.
    pub jump_buffer: f32,
}

/// Memory of a [`MarbleController`].
#[derive(Component, Clone, Copy, Debug)]
pub(crate) struct ControllerState {
    /// Rest of the jump buffer, in seconds; negative if no jump waits.
    waits: f32,
    /// Time since it was on the ground, in seconds.
    in_air: f32,
    /// Last ground that it was on.
    last_ground: Option<Ground>,
    /// True from a jump on until it has left the ground, or rises no more.
    leaves: bool,
}

impl Default for ControllerState {
    fn default() -> Self {
        Self { waits: -1.0, in_air: f32::INFINITY, last_ground: None, leaves: false }
    }
}

/// Means by which a [`MarbleController`] drives its marble on the ground.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Debug, Default, PartialEq)]
pub enum Drive {
    /// Torque: friction makes speed of spin, and on ice it slips. By models without rotation, as
    /// [`Force`](Self::Force).
    #[default]
    Torque,
    /// Force at the center, along the ground.
    Force,
}

impl Default for MarbleController {
    /// Rolls at up to 6 m/s without slip on surfaces of the default friction, jumps 1.2 m high.
    fn default() -> Self {
        Self {
            direction: Vec3::ZERO,
            jump: false,
            drive: Drive::Torque,
            max_speed: 6.0,
            acceleration: 2.5,
            air_acceleration: 3.0,
            braking: 2.5,
            jump_speed: 4.9,
            coyote_time: 0.1,
            jump_buffer: 0.1,
        }
    }
}

/// Surface acceleration of a solid ball over the acceleration of its center while it rolls without
/// slip: `1 + m r² / I`.
const SPIN_UP: f32 = 3.5;

/// Speed against gravity that a marble on the ground may have, in m/s.
const STILL: f32 = 0.01;

impl MarbleController {
    /// Direction in the plane across `up` for an input as seen from a camera: y away from it, x to its
    /// right. At most of length 1.
    #[must_use]
    pub fn seen_from(camera: &GlobalTransform, input: Vec2, up: Dir3) -> Vec3 {
        let level = |direction: Dir3| direction.reject_from_normalized(*up).normalize_or_zero();
        // Seen straight from above, away is the top of the picture.
        let ahead = match level(camera.forward()) {
            Vec3::ZERO => level(camera.up()),
            ahead => ahead,
        };
        (level(camera.right()) * input.x + ahead * input.y).clamp_length_max(1.0)
    }

    /// Velocity of the drive along a plane, in m/s.
    fn wish(&self, normal: Vec3) -> Vec3 {
        let direction = self.direction - normal * self.direction.dot(normal);
        direction.clamp_length_max(1.0) * self.max_speed
    }

    /// Change of the surface velocity of its spin, in m/s, by a torque in a step.
    fn torque(&self, ground: &Ground, surface: Vec3, dt: f32) -> Vec3 {
        let along = surface.reject_from_normalized(ground.normal);
        let change = ground.normal.cross(self.wish(ground.normal)) - along;
        change.clamp_length_max(SPIN_UP * self.ground_acceleration() * dt)
    }

    /// Change of its velocity, in m/s, by a force along the ground in a step.
    fn force(&self, ground: &Ground, velocity: Vec3, dt: f32) -> Vec3 {
        let along = (velocity - ground.velocity).reject_from_normalized(ground.normal);
        let change = self.wish(ground.normal) - along;
        change.clamp_length_max(self.ground_acceleration() * dt)
    }

    fn ground_acceleration(&self) -> f32 {
        if self.direction == Vec3::ZERO { self.braking } else { self.acceleration }
    }

    /// Checks that a drive can be made of its numbers.
    fn validate(&self) -> Result<(), taw::Error> {
        let Vec3 { x, y, z } = self.direction;
        all_finite([("direction.x", x), ("direction.y", y), ("direction.z", z)])?;
        all_finite([("jump_speed", self.jump_speed)])?;
        at_least_zero("max_speed", self.max_speed)?;
        at_least_zero("acceleration", self.acceleration)?;
        at_least_zero("air_acceleration", self.air_acceleration)?;
        at_least_zero("braking", self.braking)?;
        at_least_zero("coyote_time", self.coyote_time)?;
        at_least_zero("jump_buffer", self.jump_buffer)
    }
}

impl ControllerState {
    /// Begins a step of `dt` seconds. Returns the ground that it may use.
    fn begin(
        &mut self,
        ground: Option<Ground>,
        (up, velocity): (Vec3, Vec3),
        dt: f32,
    ) -> Option<Ground> {
        let rises = |ground: Ground| (velocity - ground.velocity).dot(up) > STILL;
        self.leaves &= ground.is_some_and(rises);
        let ground = ground.filter(|_| !self.leaves);
        self.in_air = if ground.is_some() { 0.0 } else { self.in_air + dt };
        self.last_ground = ground.or(self.last_ground);
        ground
    }

    /// Change of a velocity, in m/s, by the jump that waits, if it may jump in this step of `dt` seconds.
    fn jump(&mut self, hero: &MarbleController, (up, velocity): (Vec3, Vec3), dt: f32) -> Vec3 {
        if self.waits < 0.0 || up == Vec3::ZERO {
            return Vec3::ZERO;
        }
        self.waits -= dt;
        match self.last_ground.filter(|_| self.in_air <= hero.coyote_time) {
            None => Vec3::ZERO,
            Some(ground) => {
                (self.waits, self.in_air, self.leaves) = (-1.0, f32::INFINITY, true);
                let rising = (velocity - ground.velocity).dot(up);
                up * (hero.jump_speed - rising).max(0.0)
            }
        }
    }
}

type Driven<'a> = (
    Entity,
    (&'a mut MarbleController, &'a mut ControllerState),
    &'a Grounded,
    &'a Marble,
    &'a mut Velocity,
    &'a mut AngularVelocity,
    &'a MarbleState,
    Option<&'a MarbleRotation>,
);

/// Drives all marbles with a [`MarbleController`].
pub(crate) fn drive(
    mut marbles: Query<Driven>,
    (world, gravity): (Res<TawWorld>, Res<ZoneGravity>),
    model: Res<TawModel>,
    time: Res<Time>,
    mut refusals: Refusals,
) {
    if world.just_restored {
        // Components, grounds and jumps are those of before.
        marbles.iter_mut().for_each(|(_, (_, mut state), ..)| *state = ControllerState::default());
        return;
    }
    let dt = time.delta_secs();
    for (entity, (mut hero, mut state), grounded, marble, mut velocity, mut spin, body, rotation) in
        &mut marbles
    {
        let jumps = std::mem::take(&mut hero.bypass_change_detection().jump);
        let is_valid = refusals.check(Some(entity), hero.validate());
        if !(is_valid && dt > 0.0 && marble.radius > 0.0) {
            continue;
        }
        let up = (-gravity.on(&world, body.id)).normalize_or_zero();
        let ground = state.begin(grounded.ground, (up, **velocity), dt);
        if jumps {
            state.waits = hero.jump_buffer;
        }
        let turns = model.rotation == Rotation::Dynamic
            && rotation.is_none_or(|rotation| **rotation == Rotation::Dynamic);
        match ground {
            Some(ground) if hero.drive == Drive::Torque && turns => {
                let change = hero.torque(&ground, **spin * marble.radius, dt);
                add(&mut spin, change / marble.radius);
            }
            Some(ground) => {
                let change = hero.force(&ground, **velocity, dt);
                add(&mut velocity, change);
            }
            None if hero.direction != Vec3::ZERO => {
                let level = **velocity - up * velocity.dot(up);
                let change = hero.wish(up) - level;
                add(&mut velocity, change.clamp_length_max(hero.air_acceleration * dt));
            }
            None => {}
        }
        let jump = state.jump(&hero, (up, **velocity), dt);
        add(&mut velocity, jump);
    }
}

/// Adds a change, if it is one: what does not change may sleep.
fn add<V: DerefMut<Target = Vec3>>(vector: &mut Mut<V>, change: Vec3) {
    if change != Vec3::ZERO {
        ***vector += change;
    }
}
