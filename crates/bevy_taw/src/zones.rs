//! Zones of another gravity, and of wind: sensors in which marbles and balls of swarms are pulled and
//! blown.

use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use taw::swarm::BallId;
use taw::world::MarbleId;

use crate::components::WallState;
use crate::convert::{all_finite, at_least_zero, from_point, from_vector, to_vector};
use crate::refusal::Refusals;
use crate::resources::TawWorld;
use crate::sensor::Sensor;

/// Gravity of its own inside of a [`Sensor`]'s shape, its `Wall`, in m/s² in world space. A marble's
/// [`GravityScale`](crate::components::GravityScale) counts for it, as does a ball's. Marbles do not sleep in
/// a world without a gravity of its own.
///
/// Acts in each step on the marbles and the balls of swarms that were inside after the last one. Where zones overlap, what they
/// add is summed up; of those that replace gravity, that of the highest entity counts.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// fn spawn(mut commands: Commands) {
///     // Marbles rise in a lift shaft, and a planet holds those near it.
///     commands.spawn((Wall::from(Cuboid::new(1.0, 5.0, 1.0)), GravityZone::Replace(Vec3::Y * 3.0)));
///     commands.spawn((Wall::from(Sphere::new(20.0)), GravityZone::Toward(9.81)));
/// }
/// ```
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
#[require(Sensor)]
pub enum GravityZone {
    /// This gravity instead of the world's.
    Replace(Vec3),
    /// A gravity of this size toward the zone's place, instead of the world's.
    Toward(f32),
    /// This gravity besides all others.
    Add(Vec3),
}

impl Default for GravityZone {
    /// Weightlessness.
    fn default() -> Self {
        Self::Replace(Vec3::ZERO)
    }
}

/// Wind inside of a [`Sensor`]'s shape, its `Wall`: marbles and balls of swarms are dragged along. Acts in
/// each step on those that were inside after the last one; winds that overlap all drag.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// fn spawn(mut commands: Commands) {
///     let fan = WindZone { velocity: Vec3::X * 8.0, drag: 2.0 };
///     commands.spawn((Wall::from(Cuboid::new(4.0, 1.0, 1.0)), fan));
/// }
/// ```
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
#[require(Sensor)]
pub struct WindZone {
    /// Velocity of the air, in m/s in world space.
    pub velocity: Vec3,
    /// Rate at which marbles take it over, in 1/s, at least zero: after `1 / drag` seconds, `1 / e` of
    /// the difference is left.
    pub drag: f32,
}

/// Marble, or ball of a swarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Body {
    Marble(MarbleId),
    Ball(BallId),
}

/// State of a body in a zone.
struct BodyState {
    position: Vec3,
    velocity: Vec3,
    gravity_scale: f32,
}

impl Body {
    /// State of it, if it is still there.
    fn state(self, world: &TawWorld) -> Option<BodyState> {
        let (position, velocity, gravity_scale) = match self {
            Self::Marble(id) => {
                let marble = world.marbles.get(id).ok()?;
                (marble.position, marble.velocity, marble.gravity_scale)
            }
            Self::Ball(id) => {
                let ball = world.swarm.get(id).ok()?;
                (ball.position, ball.velocity, world.swarm.gravity_scale(id).ok()?)
            }
        };
        let (position, velocity) = (from_point(position), from_vector(velocity));
        Some(BodyState { position, velocity, gravity_scale })
    }
}

/// Pull of zones on a body, in m/s².
#[derive(Clone, Copy, Debug, Default)]
struct Pull {
    instead: Option<Vec3>,
    besides: Vec3,
}

/// Gravity inside of zones.
#[derive(Resource, Default)]
pub(crate) struct ZoneGravity(HashMap<Body, Pull>);

impl ZoneGravity {
    /// Gravity that acts on a marble, its gravity scale included, in m/s².
    pub fn on(&self, world: &TawWorld, marble: Option<MarbleId>) -> Vec3 {
        let body = marble.map(Body::Marble);
        let Some((body, state)) = body.and_then(|body| Some((body, body.state(world)?))) else {
            return Vec3::ZERO;
        };
        let elsewhere = from_vector(world.gravity());
        let Pull { instead, besides } = self.0.get(&body).copied().unwrap_or_default();
        (instead.unwrap_or(elsewhere) + besides) * state.gravity_scale
    }
}

/// Pulls and blows what is in zones.
pub(crate) fn act(
    mut world: ResMut<TawWorld>,
    mut gravity: ResMut<ZoneGravity>,
    zones: Query<(Entity, &GravityZone, &WallState)>,
    winds: Query<(Entity, &WindZone, &WallState)>,
    (transforms, time): (TransformHelper, Res<Time>),
    mut refusals: Refusals,
) {
    gravity.0.clear();
    let mut in_order: Vec<_> = zones.iter().collect();
    in_order.sort_unstable_by_key(|(zone, ..)| *zone);
    for (zone, kind, state) in in_order {
        if !refusals.check(Some(zone), kind.validate()) {
            continue;
        }
        let middle = transforms.compute_global_transform(zone).ok();
        for body in inside(&world, state) {
            let pull = gravity.0.entry(body).or_default();
            match kind {
                GravityZone::Replace(gravity) => pull.instead = Some(*gravity),
                GravityZone::Add(gravity) => pull.besides += gravity,
                GravityZone::Toward(size) => {
                    let way = middle.zip(body.state(&world));
                    let way = way.map(|(middle, body)| middle.translation() - body.position);
                    pull.instead = Some(way.unwrap_or_default().normalize_or_zero() * *size);
                }
            }
        }
    }
    let elsewhere = from_vector(world.gravity());
    for (&body, Pull { instead, besides }) in &gravity.0 {
        let Some(BodyState { gravity_scale, .. }) = body.state(&world) else { continue };
        let change = (instead.map_or(Vec3::ZERO, |it| it - elsewhere) + *besides) * gravity_scale;
        accelerate(&mut world, (body, change), &mut refusals);
    }
    blow(&mut world, &winds, time.delta_secs(), &mut refusals);
}

/// Blows in a step of `dt` seconds.
fn blow(
    world: &mut TawWorld,
    winds: &Query<(Entity, &WindZone, &WallState)>,
    dt: f32,
    refusals: &mut Refusals,
) {
    let mut in_order: Vec<_> = winds.iter().collect();
    in_order.sort_unstable_by_key(|(zone, ..)| *zone);
    // Sums of the rates, and of velocities times rates.
    let mut sums = HashMap::<Body, (f32, Vec3)>::new();
    for (zone, wind, state) in in_order {
        if refusals.check(Some(zone), wind.validate()) {
            for body in inside(world, state) {
                let (rate, flow) = sums.entry(body).or_default();
                *rate += wind.drag;
                *flow += wind.drag * wind.velocity;
            }
        }
    }
    for (body, (rate, flow)) in sums.into_iter().filter(|(_, (rate, _))| *rate > 0.0 && dt > 0.0) {
        if let Some(BodyState { velocity, .. }) = body.state(world) {
            // As much as the exact solution of dv/dt = flow - rate v does in a step.
            let part = -(-rate * dt).exp_m1() / dt;
            let change = (flow / rate - velocity) * part;
            accelerate(world, (body, change), refusals);
        }
    }
}

/// Marbles and balls that were inside of a sensor after the last step.
fn inside(world: &TawWorld, sensor: &WallState) -> impl Iterator<Item = Body> {
    let marbles = sensor.sensor.and_then(|id| world.sensors.inside(id).ok()).unwrap_or_default();
    let balls =
        sensor.sensor.and_then(|id| world.sensors.balls_inside(id).ok()).unwrap_or_default();
    let marbles = marbles.iter().copied().map(Body::Marble);
    marbles.chain(balls.iter().copied().map(Body::Ball))
}

/// Accelerates a body in this step, in m/s².
fn accelerate(world: &mut TawWorld, (body, acceleration): (Body, Vec3), refusals: &mut Refusals) {
    if acceleration == Vec3::ZERO {
        return;
    }
    let acceleration = to_vector(acceleration);
    match body {
        Body::Marble(id) => {
            let entity = world.marble_entities.get(&id).copied();
            refusals.check(entity, world.marbles.apply_acceleration(id, acceleration));
        }
        Body::Ball(id) => {
            refusals.check(None, world.swarm.apply_acceleration(id, acceleration));
        }
    }
}

impl GravityZone {
    /// Checks that its numbers are finite.
    fn validate(&self) -> Result<(), taw::Error> {
        let finite = |Vec3 { x, y, z }: Vec3| {
            all_finite([("gravity_zone.x", x), ("gravity_zone.y", y), ("gravity_zone.z", z)])
        };
        match self {
            Self::Replace(gravity) | Self::Add(gravity) => finite(*gravity),
            Self::Toward(size) => all_finite([("gravity_zone", *size)]),
        }
    }
}

impl WindZone {
    /// Checks that its numbers are finite, and the rate not negative.
    fn validate(&self) -> Result<(), taw::Error> {
        let (Vec3 { x, y, z }, drag) = (self.velocity, self.drag);
        all_finite([("velocity.x", x), ("velocity.y", y), ("velocity.z", z)])?;
        at_least_zero("drag", drag)
    }
}
