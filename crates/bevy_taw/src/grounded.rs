//! Ground under marbles.

use std::f32::consts::PI;

use bevy::prelude::*;
use taw::contact::Contact;
use taw::math::{Point3, Vec3 as TawVec3};

use crate::SubstepDelta;
use crate::components::{GravityScale, MarbleState, Sleeping, WallState};
use crate::convert::{from_point, from_vector, within};
use crate::messages::{ContactPair, gap};
use crate::refusal::Refusals;
use crate::resources::TawWorld;
use crate::zones::ZoneGravity;

/// Finds the ground that a marble lies, rolls or stands on: add it to the marbles of which you want to
/// know it. Updated after each step. Up is against gravity, also that of a
/// [`GravityZone`](crate::zones::GravityZone); without gravity there is no ground.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_taw::prelude::*;
/// fn jump(mut marbles: Query<(&Grounded, &mut Velocity)>) {
///     for (grounded, mut velocity) in &mut marbles {
///         if let Some(ground) = grounded.ground {
///             velocity.0 = ground.velocity + Vec3::Y * 5.0;
///         }
///     }
/// }
/// ```
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq)]
pub struct Grounded {
    /// Angle of the steepest ground, in radians from level, in [0, π]; what is steeper is a wall.
    pub max_slope: f32,
    /// Ground after the last step: the most level of what touches the marble from below.
    pub ground: Option<Ground>,
}

impl Default for Grounded {
    /// No ground is known yet; none is steeper than 50 degrees.
    fn default() -> Self {
        Self { max_slope: 50_f32.to_radians(), ground: None }
    }
}

/// Ground under a marble.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq)]
pub struct Ground {
    /// The wall or marble.
    pub entity: Entity,
    /// Unit normal, toward the marble.
    pub normal: Vec3,
    /// Contact point, in metres in world space.
    pub point: Vec3,
    /// Velocity of the ground's surface at that point, in m/s: of a lift, a turntable, a conveyor.
    pub velocity: Vec3,
}

/// Marble that seeks its ground.
struct Seeker {
    row: u32,
    up: Vec3,
    /// Least height of a unit normal of ground.
    least: f32,
    /// The most level ground so far.
    ground: Option<Ground>,
}

impl Seeker {
    fn level(&self, ground: &Ground) -> f32 {
        ground.normal.dot(self.up)
    }

    fn offer(&mut self, ground: Ground) {
        let level = self.level(&ground);
        if level >= self.least && self.ground.is_none_or(|best| level > self.level(&best)) {
            self.ground = Some(ground);
        }
    }
}

/// Finds the ground of all marbles that ask for it. What sleeps keeps its ground.
pub(crate) fn find(
    world: Res<TawWorld>,
    (delta, zones): (Res<SubstepDelta>, Res<ZoneGravity>),
    mut marbles: Query<
        (Entity, &mut Grounded, &MarbleState, Option<&GravityScale>),
        Without<Sleeping>,
    >,
    (states, walls): (Query<&MarbleState>, Query<&WallState>),
    mut refusals: Refusals,
) {
    for (entity, grounded, ..) in &marbles {
        refusals.check(Some(entity), within("max_slope", grounded.max_slope, 0.0, PI));
    }
    let seekers = marbles.iter().filter_map(|(entity, grounded, state, scale)| {
        let row = world.marbles.row(state.id?).ok()? as u32;
        let up = (-zones.on(entity, scale)).normalize_or_zero();
        let least = grounded.max_slope.cos() - f32::EPSILON;
        (up != Vec3::ZERO).then_some(Seeker { row, up, least, ground: None })
    });
    let mut seekers: Vec<_> = seekers.collect();
    seekers.sort_unstable_by_key(|seeker| seeker.row);
    look_below(&world, &walls, &mut seekers);
    let fall = from_vector(world.gravity()).length() * delta.0 * delta.0;
    let touches = |marble: Entity, ground: &Ground| {
        let pair = ContactPair { a: ground.entity, b: marble };
        gap(pair, &world, &states, &walls).is_some_and(|gap| gap.is_closed(fall))
    };
    for (entity, grounded, state, _) in &mut marbles {
        let row = state.id.and_then(|id| world.marbles.row(id).ok());
        let seeker = row
            .and_then(|row| seekers.binary_search_by_key(&(row as u32), |seeker| seeker.row).ok());
        // A ball that rests touches in one step and hovers in the next.
        let found = seeker.and_then(|i| seekers[i].ground.or(grounded.ground));
        let ground = found.filter(|ground| touches(entity, ground));
        grounded.map_unchanged(|grounded| &mut grounded.ground).set_if_neq(ground);
    }
}

/// Looks for ground among the contacts of the last substep.
fn look_below(world: &TawWorld, walls: &Query<&WallState>, seekers: &mut [Seeker]) {
    if seekers.is_empty() {
        return;
    }
    let find =
        |seekers: &[Seeker], row: u32| seekers.binary_search_by_key(&row, |seeker| seeker.row).ok();
    let point =
        |contact: &Contact<f32>| world.marbles.position()[contact.b as usize] + contact.arms[1];
    for contact in &world.contacts.wm {
        if let Some(i) = find(seekers, contact.b)
            && let Some(entity) = world.wall_entity(contact.a)
        {
            let point = point(contact);
            let velocity = wall_velocity(world, walls, entity, (point, contact.normal));
            seekers[i].offer(ground(entity, contact.normal, point, velocity));
        }
    }
    for contact in &world.contacts.mm {
        for (marble, other, normal, arm) in [
            (contact.b, contact.a, contact.normal, contact.arms[0]),
            (contact.a, contact.b, -contact.normal, contact.arms[1]),
        ] {
            if let Some(i) = find(seekers, marble)
                && let Some(entity) = world.marble_entity(other)
            {
                let velocity = surface_velocity(world, other as usize, arm);
                seekers[i].offer(ground(entity, normal, point(contact), velocity));
            }
        }
    }
}

fn ground(entity: Entity, normal: TawVec3<f32>, point: Point3<f32>, velocity: Vec3) -> Ground {
    Ground { entity, normal: from_vector(normal), point: from_point(point), velocity }
}

/// Velocity of a wall's surface at a point with this normal, in m/s.
fn wall_velocity(
    world: &TawWorld,
    walls: &Query<&WallState>,
    wall: Entity,
    (point, normal): (Point3<f32>, TawVec3<f32>),
) -> Vec3 {
    let Ok(state) = walls.get(wall) else { return Vec3::ZERO };
    let motion = state.id.and_then(|id| world.walls.motion(id).ok().flatten());
    let velocity = motion.map_or(Vec3::ZERO, |motion| from_vector(motion.velocity_at(point)));
    // A belt drags along its surface, and pushes nobody.
    if state.is_belt { velocity.reject_from(from_vector(normal)) } else { velocity }
}

/// Velocity of a marble's surface at the end of a lever arm, in m/s.
fn surface_velocity(world: &TawWorld, row: usize, arm: TawVec3<f32>) -> Vec3 {
    let velocity = from_vector(world.marbles.velocity()[row]);
    let spin = world.marbles.angular_velocity().get(row).copied().map(from_vector);
    velocity + spin.map_or(Vec3::ZERO, |spin| spin.cross(from_vector(arm)))
}
