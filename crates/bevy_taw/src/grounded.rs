//! Ground under marbles.

use std::f32::consts::PI;

use bevy::prelude::*;
use taw::body::ContactPartner;
use taw::contact::Contact;
use taw::math::{Point3, Vec3 as TawVec3};
use taw::world::{ColliderId, QueryTree};

use crate::SubstepDelta;
use crate::components::{MarbleState, Sleeping, WallState};
use crate::convert::{from_point, from_vector, within};
use crate::gap::{Gap, fall, gap};
use crate::messages::ContactPair;
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
    /// Ground after the last step: the most level of what touches the marble from below. What sleeps keeps
    /// its ground.
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
    /// The wall, marble or body.
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
    /// Ground after the step before.
    before: Option<Ground>,
    /// The most level ground so far.
    ground: Option<Ground>,
    /// True if a contact with the ground of before is listed, whatever its slope.
    listed: bool,
}

impl Seeker {
    fn level(&self, ground: &Ground) -> f32 {
        ground.normal.dot(self.up)
    }

    /// Takes what a contact touches, if it is better ground. Open contacts are no ground.
    fn offer(&mut self, ground: Ground, is_closed: bool) {
        self.listed |= self.before.is_some_and(|before| before.entity == ground.entity);
        let level = self.level(&ground);
        let best = self.ground.map_or(self.least, |best| self.level(&best));
        if is_closed && level >= best {
            self.ground = Some(ground);
        }
    }
}

/// Marbles that seek their ground.
type Seekers<'w, 's> =
    Query<'w, 's, (Entity, &'static mut Grounded, &'static MarbleState, Has<Sleeping>)>;

/// Finds the ground of all marbles that ask for it.
pub(crate) fn find(
    world: Res<TawWorld>,
    (delta, zones): (Res<SubstepDelta>, Res<ZoneGravity>),
    mut marbles: Seekers,
    (states, walls): (Query<&MarbleState>, Query<&WallState>),
    (mut tree, mut restored): (Local<QueryTree<f32>>, Local<u32>),
    mut refusals: Refusals,
) {
    let just_restored = std::mem::replace(&mut *restored, world.restored) != world.restored;
    let mut seekers = Vec::new();
    for (entity, grounded, state, _) in &marbles {
        refusals.check(Some(entity), within("max_slope", grounded.max_slope, 0.0, PI));
        let row = state.id.and_then(|id| world.marbles.row(id).ok());
        let up = (-zones.on(&world, state.id)).normalize_or_zero();
        if let Some(row) = row.filter(|_| up != Vec3::ZERO) {
            let (row, least) = (row as u32, grounded.max_slope.cos() - f32::EPSILON);
            let before = grounded.ground;
            seekers.push(Seeker { row, up, least, before, ground: None, listed: false });
        }
    }
    seekers.sort_unstable_by_key(|seeker| seeker.row);
    look_below(&world, &walls, &mut seekers, delta.0);
    let still_touches = |marble: Entity, ground: &Ground| {
        let pair = ContactPair { a: ground.entity, b: marble };
        let gap = gap(pair, &world, &states, &walls);
        gap.is_some_and(|gap| gap.is_closed(fall(&world, delta.0)))
    };
    for (entity, grounded, state, is_asleep) in &mut marbles {
        let row = state.id.and_then(|id| world.marbles.row(id).ok());
        let seeker = row.and_then(|row| seeker_of(&seekers, row as u32)).map(|i| &seekers[i]);
        let ground = seeker.and_then(|seeker| {
            // Contacts of what sleeps are not listed.
            let is_new = is_asleep && (grounded.is_added() || just_restored);
            let mut below = || nearest(&world, &walls, &mut tree, seeker);
            // A ball that rests touches in one step and hovers in the next.
            let is_kept = |before: &Ground| {
                !seeker.listed
                    && seeker.level(before) >= seeker.least
                    && still_touches(entity, before)
            };
            let found = if is_new { below() } else { seeker.ground };
            found.or_else(|| seeker.before.filter(is_kept))
        });
        grounded.map_unchanged(|grounded| &mut grounded.ground).set_if_neq(ground);
    }
}

/// Index of the seeker of a row; they are sorted.
fn seeker_of(seekers: &[Seeker], row: u32) -> Option<usize> {
    seekers.binary_search_by_key(&row, |seeker| seeker.row).ok()
}

/// Looks for ground among the contacts of the last substep, of `dt` seconds.
fn look_below(world: &TawWorld, walls: &Query<&WallState>, seekers: &mut [Seeker], dt: f32) {
    if seekers.is_empty() {
        return;
    }
    let (marbles, fall) = (&world.marbles, fall(world, dt));
    // Two that part have a wider gap by the end of the substep.
    let is_closed = |contact: &Contact<f32>, parting: f32| {
        let width = contact.separation + parting.max(0.0) * dt;
        Gap { width, radius: marbles.radius()[contact.b as usize] }.is_closed(fall)
    };
    let point = |contact: &Contact<f32>| marbles.position()[contact.b as usize] + contact.arms[1];
    let velocity = |row: u32| from_vector(marbles.velocity()[row as usize]);
    // `SoftStep` lists a wall once more after a marble began to pass through it.
    let collides = |contact: &Contact<f32>| {
        let marble = world.marbles.id(contact.b as usize);
        let wall = world.walls.id(contact.a as usize).map(ColliderId::Wall);
        marble.zip(wall).is_some_and(|(marble, wall)| world.may_collide(marble, wall) == Ok(true))
    };
    for contact in &world.contacts.wm {
        if let Some(i) = seeker_of(seekers, contact.b)
            && collides(contact)
            && let Some(entity) = world.wall_entity(contact.a)
        {
            let point = point(contact);
            let surface = wall_velocity(world, walls, entity, (point, contact.normal));
            let found = ground(entity, contact.normal, point, surface);
            let parting = (velocity(contact.b) - surface).dot(found.normal);
            seekers[i].offer(found, is_closed(contact, parting));
        }
    }
    for contact in &world.contacts.mm {
        for (marble, other, normal, arm) in [
            (contact.b, contact.a, contact.normal, contact.arms[0]),
            (contact.a, contact.b, -contact.normal, contact.arms[1]),
        ] {
            if let Some(i) = seeker_of(seekers, marble)
                && let Some(entity) = world.marble_entity(other)
            {
                let surface = surface_velocity(world, other as usize, arm);
                let found = ground(entity, normal, point(contact), surface);
                let parting = (velocity(marble) - velocity(other)).dot(found.normal);
                seekers[i].offer(found, is_closed(contact, parting));
            }
        }
    }
    look_at_bodies(world, seekers);
}

/// Looks for ground among the contacts of bodies.
fn look_at_bodies(world: &TawWorld, seekers: &mut [Seeker]) {
    for contact in world.body_contacts().filter(|contact| contact.is_touching) {
        if let ContactPartner::Marble(marble) = contact.partner
            && let Ok(row) = world.marbles.row(marble)
            && let Some(i) = seeker_of(seekers, row as u32)
            && let Some(entity) = world.body_entities.get(&contact.body)
            && let Ok(surface) = world.bodies.velocity_at(contact.body, contact.point)
        {
            let found = ground(*entity, -contact.normal, contact.point, from_vector(surface));
            seekers[i].offer(found, true);
        }
    }
}

/// The nearest surface below a marble with which it collides, if it is ground.
fn nearest(
    world: &TawWorld,
    walls: &Query<&WallState>,
    tree: &mut QueryTree<f32>,
    seeker: &Seeker,
) -> Option<Ground> {
    let row = seeker.row as usize;
    let (id, position) = (world.marbles.id(row)?, world.marbles.position()[row]);
    let reach = world.marbles.radius()[row] * 1.02;
    let collides = |other| world.may_collide(id, other) == Ok(true);
    let hit = world.queries(tree).project_point(position, reach, collides)?;
    let (entity, point) = (world.collider_entity(hit.collider)?, hit.result.point);
    let surface = match hit.collider {
        ColliderId::Wall(_) => wall_velocity(world, walls, entity, (point, hit.result.normal)),
        ColliderId::Marble(id) => from_vector(world.marbles.get(id).ok()?.velocity),
        ColliderId::Body(id) => from_vector(world.bodies.velocity_at(id, point).ok()?),
    };
    let found = ground(entity, hit.result.normal, point, surface);
    (seeker.level(&found) >= seeker.least).then_some(found)
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
