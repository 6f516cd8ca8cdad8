//! Zones of another gravity, and of wind: sensors whose marbles are pulled and blown.

use bevy::platform::collections::HashMap;
use bevy::prelude::*;

use crate::components::{GravityScale, MarbleState};
use crate::convert::{all_finite, at_least_zero, from_point, from_vector, to_vector};
use crate::refusal::Refusals;
use crate::resources::TawWorld;
use crate::sensor::{CollidingEntities, Sensor};

/// Gravity of its own inside of a [`Sensor`]'s shape, in m/s² in world space. A marble's
/// [`GravityScale`] counts for it.
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
pub(crate) struct ZoneGravity {
    pulls: HashMap<Entity, Pull>,
    /// Gravity of the world, in m/s².
    elsewhere: Vec3,
}

impl ZoneGravity {
    /// Gravity that acts on a marble, its [`GravityScale`] included, in m/s².
    pub fn on(&self, marble: Entity, scale: Option<&GravityScale>) -> Vec3 {
        let pull = self.pulls.get(&marble).copied().unwrap_or_default();
        let gravity = pull.instead.unwrap_or(self.elsewhere) + pull.besides;
        gravity * scale.map_or(1.0, |scale| **scale)
    }
}

/// Marbles, as zones see them.
type Marbles<'w, 's> = Query<'w, 's, (&'static MarbleState, Option<&'static GravityScale>)>;

/// Pulls and blows the marbles that are in zones.
pub(crate) fn act(
    mut world: ResMut<TawWorld>,
    mut gravity: ResMut<ZoneGravity>,
    zones: Query<(Entity, &GravityZone, &CollidingEntities)>,
    winds: Query<(Entity, &WindZone, &CollidingEntities)>,
    (marbles, transforms, time): (Marbles, TransformHelper, Res<Time>),
    mut refusals: Refusals,
) {
    gravity.pulls.clear();
    gravity.elsewhere = from_vector(world.gravity());
    let mut in_order: Vec<_> = zones.iter().collect();
    in_order.sort_unstable_by_key(|(zone, ..)| *zone);
    for (zone, kind, inside) in in_order {
        if !refusals.check(Some(zone), kind.validate()) {
            continue;
        }
        let middle = transforms.compute_global_transform(zone).ok();
        for &marble in inside.iter() {
            let pull = gravity.pulls.entry(marble).or_default();
            match kind {
                GravityZone::Replace(gravity) => pull.instead = Some(*gravity),
                GravityZone::Add(gravity) => pull.besides += gravity,
                GravityZone::Toward(size) => {
                    let place = place(&world, &marbles, marble);
                    let way = middle.zip(place).map(|(middle, at)| middle.translation() - at);
                    pull.instead = Some(way.unwrap_or_default().normalize_or_zero() * *size);
                }
            }
        }
    }
    for &marble in gravity.pulls.keys() {
        let scale = marbles.get(marble).ok().and_then(|(_, scale)| scale);
        let whole = gravity.elsewhere * scale.map_or(1.0, |scale| **scale);
        let change = gravity.on(marble, scale) - whole;
        accelerate(&mut world, &marbles, (marble, change), &mut refusals);
    }
    let dt = time.delta_secs();
    for (zone, wind, inside) in &winds {
        if !refusals.check(Some(zone), wind.validate()) || dt <= 0.0 {
            continue;
        }
        // As much as the exact solution of dv/dt = drag (velocity - v) does in a step.
        let rate = -(-wind.drag * dt).exp_m1() / dt;
        for &marble in inside.iter() {
            let velocity = |world: &TawWorld| {
                let id = marbles.get(marble).ok()?.0.id?;
                Some(from_vector(world.marbles.get(id).ok()?.velocity))
            };
            if let Some(velocity) = velocity(&world) {
                let change = (wind.velocity - velocity) * rate;
                accelerate(&mut world, &marbles, (marble, change), &mut refusals);
            }
        }
    }
}

/// Place of a marble in the world, in metres.
fn place(world: &TawWorld, marbles: &Marbles, marble: Entity) -> Option<Vec3> {
    let id = marbles.get(marble).ok()?.0.id?;
    Some(from_point(world.marbles.get(id).ok()?.position))
}

/// Accelerates a marble in this step, in m/s².
fn accelerate(
    world: &mut TawWorld,
    marbles: &Marbles,
    (marble, acceleration): (Entity, Vec3),
    refusals: &mut Refusals,
) {
    let id = marbles.get(marble).ok().and_then(|(state, _)| state.id);
    if let Some(id) = id.filter(|id| acceleration != Vec3::ZERO && world.marbles.get(*id).is_ok()) {
        let applied = world.marbles.apply_acceleration(id, to_vector(acceleration));
        refusals.check(Some(marble), applied);
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
