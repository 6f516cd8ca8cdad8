//! Contacts of a step, collected and compared with those of the last one.

use bevy::ecs::message::Messages;
use bevy::ecs::observer::CachedObservers;
use bevy::prelude::*;
use taw::contact::Contact;
use taw::math::{Vec3 as TawVec3, length};
use taw::response::{Impact, Response};

use crate::SubstepDelta;
use crate::body_touches::body_touches;
use crate::components::{MarbleState, WallState};
use crate::contact_force::{impulse_of, step_of};
use crate::convert::{from_point, from_vector};
use crate::gap::{fall, gap};
use crate::messages::{
    ContactEnded, ContactEvent, ContactHit, ContactOngoing, ContactPair, ContactStarted,
};
use crate::resources::TawWorld;

/// Slowest hit, in m/s.
const SLOWEST_HIT: f32 = 1e-3;

/// Cosine of the angle up to which two normals are one direction: 18 degrees.
const ONE_DIRECTION: f32 = 0.95;

/// Contacts of this step and of the last.
#[derive(Resource, Default)]
pub(crate) struct Touches {
    /// In the order found, several to a pair if there are substeps.
    now: Vec<ContactStarted>,
    /// Pairs and the normals of their contacts, sorted, one to a pair.
    before: Vec<(ContactPair, Vec3)>,
    /// Hits in the order found.
    hits: Vec<ContactHit>,
    /// Number of this step's impacts already noted.
    impacts: usize,
    /// Events of this step for observers.
    events: Events,
}

/// Events of a step, by kind.
#[derive(Default)]
struct Events {
    started: Vec<ContactStarted>,
    hits: Vec<ContactHit>,
    ongoing: Vec<ContactOngoing>,
    ended: Vec<ContactEnded>,
}

type Readers<'w> = (
    Option<ResMut<'w, Messages<ContactStarted>>>,
    Option<ResMut<'w, Messages<ContactHit>>>,
    Option<ResMut<'w, Messages<ContactOngoing>>>,
    Option<ResMut<'w, Messages<ContactEnded>>>,
);

/// Run condition: somebody reads or observes contacts.
pub(crate) fn are_read(world: &World) -> bool {
    is_read::<ContactStarted>(world)
        || is_read::<ContactHit>(world)
        || is_read::<ContactOngoing>(world)
        || is_read::<ContactEnded>(world)
        || are_observed(world)
}

pub(crate) fn is_read<M: Message>(world: &World) -> bool {
    world.contains_resource::<Messages<M>>()
}

/// Run condition: somebody observes contacts.
pub(crate) fn are_observed(world: &World) -> bool {
    observers::<ContactStarted>(world).is_some()
        || observers::<ContactHit>(world).is_some()
        || observers::<ContactOngoing>(world).is_some()
        || observers::<ContactEnded>(world).is_some()
}

/// Observers of an event, if there are any.
pub(crate) fn observers<E: Event>(world: &World) -> Option<&CachedObservers> {
    let observers = world.observers().try_get_observers(world.event_key::<E>()?)?;
    let nobody = observers.global_observers().is_empty() && observers.entity_observers().is_empty();
    (!nobody).then_some(observers)
}

/// Triggers this step's events where they are observed.
pub(crate) fn trigger(world: &mut World) {
    let mut events = std::mem::take(&mut world.resource_mut::<Touches>().events);
    trigger_observed(world, &mut events.started);
    trigger_observed(world, &mut events.hits);
    trigger_observed(world, &mut events.ongoing);
    trigger_observed(world, &mut events.ended);
    world.resource_mut::<Touches>().events = events; // for their memory
}

pub(crate) fn trigger_observed<E: ContactEvent>(world: &mut World, events: &mut Vec<E>) {
    for event in events.drain(..).flat_map(|event| [event, event.swapped()]) {
        let is_observed = observers::<E>(world).is_some_and(|observers| {
            !observers.global_observers().is_empty()
                || observers.entity_observers().contains_key(&event.event_target())
        });
        if is_observed {
            world.trigger(event);
        }
    }
}

impl Touches {
    /// Notes a touch, and a hit if it is faster than `slowest`, in m/s.
    fn add(&mut self, touch: ContactStarted, slowest: f32) {
        let ContactStarted { pair, normal, point, part, approach_speed, slip_speed, impulse } =
            touch;
        if approach_speed > slowest.max(SLOWEST_HIT) {
            let hit = ContactHit { pair, normal, point, part, approach_speed, slip_speed, impulse };
            self.hits.push(hit);
        }
        self.now.push(touch);
    }
}

impl Events {
    fn clear(&mut self) {
        self.started.clear();
        self.hits.clear();
        self.ongoing.clear();
        self.ended.clear();
    }
}

/// Forgets contacts while nobody reads or observes them: who listens later hears of those that start
/// then.
pub(crate) fn forget(mut touches: ResMut<Touches>) {
    touches.now.clear();
    touches.hits.clear();
    touches.before.clear();
    touches.impacts = 0;
    touches.events.clear();
}

/// Contact of two entities as it is before it is solved: without an impulse.
pub(crate) fn touch_of(
    world: &TawWorld,
    contact: &Contact<f32>,
    on_wall: bool,
) -> Option<ContactStarted> {
    let first = if on_wall { TawWorld::wall_entity } else { TawWorld::marble_entity };
    let (a, b) = (first(world, contact.a)?, world.marble_entity(contact.b)?);
    let velocity = |row: u32| world.marbles.velocity()[row as usize];
    let spin = |row: u32| world.marbles.angular_velocity().get(row as usize).copied();
    let turning = |row: u32, arm: TawVec3<f32>| {
        spin(row).map_or(Vec3::ZERO, |spin| from_vector(spin).cross(from_vector(arm)))
    };
    let point = world.marbles.position()[contact.b as usize] + contact.arms[1];
    let of_first = if on_wall {
        let row = contact.a as usize;
        from_vector(world.walls.surface_velocity_of_row(row, point, contact.normal))
    } else {
        from_vector(velocity(contact.a)) + turning(contact.a, contact.arms[0])
    };
    let relative =
        from_vector(velocity(contact.b)) + turning(contact.b, contact.arms[1]) - of_first;
    let normal = from_vector(contact.normal);
    let touch = ContactStarted {
        pair: ContactPair { a, b },
        normal,
        point: from_point(point),
        part: contact.part,
        approach_speed: -relative.dot(normal),
        slip_speed: relative.reject_from_normalized(normal).length(),
        impulse: Vec3::ZERO,
    };
    // Rows move about; the order of entities does not.
    Some(if !on_wall && b < a { touch.swapped() } else { touch })
}

/// Contact of two entities in an impact.
pub(crate) fn touch_of_impact(world: &TawWorld, impact: &Impact<f32>) -> Option<ContactStarted> {
    let first = if impact.on_wall { TawWorld::wall_entity } else { TawWorld::marble_entity };
    let (a, b) = (first(world, impact.a)?, world.marble_entity(impact.b)?);
    let touch = ContactStarted {
        pair: ContactPair { a, b },
        normal: from_vector(impact.normal),
        point: from_point(impact.point),
        part: impact.part,
        approach_speed: impact.approach_speed,
        slip_speed: length(impact.slip),
        impulse: from_vector(impact.impulse),
    };
    Some(if !impact.on_wall && b < a { touch.swapped() } else { touch })
}

/// Notes who touches in this substep, before anything is restituted.
pub(crate) fn collect(
    world: Res<TawWorld>,
    delta: Res<SubstepDelta>,
    mut touches: ResMut<Touches>,
) {
    let event_driven = world.model().response == Response::EventDriven;
    // It lists who may rest on each other, and impacts of its own.
    let slowest = if event_driven { f32::INFINITY } else { fastest_rest(&world, delta.0) };
    for (contacts, on_wall) in [(&world.contacts.wm, true), (&world.contacts.mm, false)] {
        for contact in contacts.iter().filter(|contact| contact.is_touching()) {
            if let Some(touch) = touch_of(&world, contact, on_wall) {
                touches.add(touch, slowest);
            }
        }
    }
}

/// Notes the collisions that the response went through by itself, and the contacts of bodies.
pub(crate) fn collect_impacts(
    world: Res<TawWorld>,
    delta: Res<SubstepDelta>,
    mut touches: ResMut<Touches>,
) {
    let model = world.model();
    let slowest = match model.response {
        Response::EventDriven => 0.0, // what rests has no impacts
        _ => fastest_rest(&world, delta.0 * model.passes() as f32 / model.substeps as f32),
    };
    // The list grows from substep to substep.
    for impact in world.impacts().iter().skip(touches.impacts) {
        if let Some(touch) = touch_of_impact(&world, impact) {
            touches.add(touch, slowest);
        }
    }
    touches.impacts = world.impacts().len();
    let mut points: Vec<_> = body_touches(&world).map(|(_, point)| point).collect();
    // The point that bears most stands for its pair.
    points.sort_by(|a, b| b.normal_impulse.total_cmp(&a.normal_impulse));
    for point in points {
        let bears = point.normal_impulse > 0.0;
        let slowest = if bears { fastest_rest(&world, delta.0) } else { f32::INFINITY };
        touches.add(ContactStarted::of(&point), slowest);
    }
}

/// Compares this step's contacts with the last one's.
pub(crate) fn write(
    mut touches: ResMut<Touches>,
    mut readers: Readers,
    world: Res<TawWorld>,
    delta: Res<SubstepDelta>,
    marbles: Query<&MarbleState>,
    walls: Query<&WallState>,
) {
    let Touches { now, hits: found, before, impacts, events } = &mut *touches;
    *impacts = 0;
    events.clear(); // nobody observed those of the last step
    let fall = fall(&world, delta.0);
    let (started, hits, ongoing, ended) = &mut readers;
    events.hits.append(found);
    keep_fastest(&mut events.hits);
    for hit in events.hits.iter_mut().filter(|hit| hit.impulse == Vec3::ZERO) {
        hit.impulse = impulse_of(&world, hit.pair).impulse;
    }
    if let Some(messages) = hits {
        messages.write_batch(events.hits.iter().copied());
    }
    now.extend(before.iter().filter_map(|&(pair, normal)| {
        let gap = gap(pair, &world, &marbles, &walls)?;
        gap.is_closed(fall).then_some(ContactStarted::going_on(pair, normal))
    }));
    let per_second = 1.0 / step_of(&world, delta.0);
    // Stable, so that the first substep's touch stands for its pair.
    now.sort_by_key(|touch| touch.pair);
    now.dedup_by_key(|touch| touch.pair);
    let mut last = before.iter().map(|(pair, _)| *pair).peekable();
    for touch in now.iter_mut() {
        while let Some(pair) = last.next_if(|pair| *pair < touch.pair) {
            tell(ended, &mut events.ended, ContactEnded { pair });
        }
        let of_pair = impulse_of(&world, touch.pair);
        if last.next_if_eq(&touch.pair).is_some() {
            touch.normal = of_pair.normal.unwrap_or(touch.normal);
            let (pair, normal, force) = (touch.pair, touch.normal, of_pair.impulse * per_second);
            tell(ongoing, &mut events.ongoing, ContactOngoing { pair, normal, force });
        } else {
            touch.impulse = of_pair.impulse;
            tell(started, &mut events.started, *touch);
        }
    }
    last.for_each(|pair| tell(ended, &mut events.ended, ContactEnded { pair }));
    before.clear();
    before.extend(now.drain(..).map(|touch| (touch.pair, touch.normal)));
}

/// Keeps the fastest hit of each pair and direction, in the order found.
fn keep_fastest(hits: &mut Vec<ContactHit>) {
    let mut sorted: Vec<_> = hits.drain(..).enumerate().collect();
    sorted.sort_by(|(_, x), (_, y)| {
        x.pair.cmp(&y.pair).then(y.approach_speed.total_cmp(&x.approach_speed))
    });
    let mut kept: Vec<(usize, ContactHit)> = Vec::with_capacity(sorted.len());
    for (at, hit) in sorted {
        let mut of_pair = kept.iter().rev().take_while(|(_, it)| it.pair == hit.pair);
        if !of_pair.any(|(_, it)| it.normal.dot(hit.normal) > ONE_DIRECTION) {
            kept.push((at, hit));
        }
    }
    kept.sort_by_key(|(at, _)| *at);
    hits.extend(kept.into_iter().map(|(_, hit)| hit));
}

/// Speed that gravity makes in two times `dt` seconds, in m/s: the largest approach speed of resting contacts.
fn fastest_rest(world: &TawWorld, dt: f32) -> f32 {
    2.0 * from_vector(world.gravity()).length() * dt
}

/// Writes a message, and keeps it for observers.
pub(crate) fn tell<M: Message + Copy>(
    reader: &mut Option<ResMut<Messages<M>>>,
    events: &mut Vec<M>,
    message: M,
) {
    events.push(message);
    if let Some(messages) = reader {
        messages.write(message);
    }
}
