//! Zones of another gravity, and of wind: sensors whose marbles are pulled and blown.

use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use taw::world::MarbleId;

use crate::components::WallState;
use crate::convert::{all_finite, at_least_zero, from_point, from_vector, to_vector};
use crate::refusal::Refusals;
use crate::resources::TawWorld;
use crate::sensor::Sensor;

/// Gravity of its own inside of a [`Sensor`]'s shape, in m/s² in world space. A marble's
/// [`GravityScale`](crate::components::GravityScale) counts for it. Marbles do not sleep in a world without a
/// gravity of its own.
///
/// Acts in each step on the marbles that were inside after the last one. Where zones overlap, what they
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

/// Wind inside of a [`Sensor`]'s shape: marbles are dragged along. Acts in each step on those that were
/// inside after the last one; winds that overlap all drag.
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

/// Pull of zones on a marble, in m/s².
#[derive(Clone, Copy, Debug, Default)]
struct Pull {
    instead: Option<Vec3>,
    besides: Vec3,
}

/// Gravity inside of zones.
#[derive(Resource, Default)]
pub(crate) struct ZoneGravity(HashMap<MarbleId, Pull>);

impl ZoneGravity {
    /// Gravity that acts on a marble, its gravity scale included, in m/s².
    pub fn on(&self, world: &TawWorld, marble: Option<MarbleId>) -> Vec3 {
        let Some((id, marble)) = marble.and_then(|id| Some((id, world.marbles.get(id).ok()?)))
        else {
            return Vec3::ZERO;
        };
        let elsewhere = from_vector(world.gravity());
        let Pull { instead, besides } = self.0.get(&id).copied().unwrap_or_default();
        (instead.unwrap_or(elsewhere) + besides) * marble.gravity_scale
    }
}

/// Pulls and blows the marbles that are in zones.
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
        for &marble in inside(&world, state) {
            let pull = gravity.0.entry(marble).or_default();
            match kind {
                GravityZone::Replace(gravity) => pull.instead = Some(*gravity),
                GravityZone::Add(gravity) => pull.besides += gravity,
                GravityZone::Toward(size) => {
                    let place = world.marbles.get(marble).map(|it| from_point(it.position)).ok();
                    let way = middle.zip(place).map(|(middle, at)| middle.translation() - at);
                    pull.instead = Some(way.unwrap_or_default().normalize_or_zero() * *size);
                }
            }
        }
    }
    let elsewhere = from_vector(world.gravity());
    for (&marble, Pull { instead, besides }) in &gravity.0 {
        let scale = world.marbles.get(marble).map_or(1.0, |marble| marble.gravity_scale);
        let change = (instead.map_or(Vec3::ZERO, |it| it - elsewhere) + *besides) * scale;
        accelerate(&mut world, (marble, change), &mut refusals);
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
    let mut sums = HashMap::<MarbleId, (f32, Vec3)>::new();
    for (zone, wind, state) in in_order {
        if refusals.check(Some(zone), wind.validate()) {
            for &marble in inside(world, state) {
                let (rate, flow) = sums.entry(marble).or_default();
                *rate += wind.drag;
                *flow += wind.drag * wind.velocity;
            }
        }
    }
    for (marble, (rate, flow)) in sums.into_iter().filter(|(_, (rate, _))| *rate > 0.0 && dt > 0.0)
    {
        if let Ok(body) = world.marbles.get(marble) {
            // As much as the exact solution of dv/dt = flow - rate v does in a step.
            let part = -(-rate * dt).exp_m1() / dt;
            let change = (flow / rate - from_vector(body.velocity)) * part;
            accelerate(world, (marble, change), refusals);
        }
    }
}

/// Marbles that were inside of a sensor after the last step.
fn inside<'a>(world: &'a TawWorld, sensor: &WallState) -> &'a [MarbleId] {
    sensor.sensor.and_then(|id| world.sensors.inside(id).ok()).unwrap_or_default()
}

/// Accelerates a marble in this step, in m/s².
fn accelerate(
    world: &mut TawWorld,
    (marble, acceleration): (MarbleId, Vec3),
    refusals: &mut Refusals,
) {
    if acceleration != Vec3::ZERO && world.marbles.row(marble).is_ok() {
        let entity = world.marble_entities.get(&marble).copied();
        let applied = world.marbles.apply_acceleration(marble, to_vector(acceleration));
        refusals.check(entity, applied);
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
