//! Single contacts of the pairs that touch: collected before and after they are solved, told after the step.

use bevy::ecs::message::Messages;
use bevy::prelude::*;
use taw::contact::{Contact, touch_goes_on};
use taw::response::Response;

use crate::SubstepDelta;
use crate::body_touches::body_touches;
use crate::components::MarbleState;
use crate::contact_force::sleeps;
use crate::convert::from_vector;
use crate::gap::fall;
use crate::messages::{ContactPair, ContactPoint};
use crate::resources::TawWorld;
use crate::touches::{is_read, observers, touch_of, touch_of_impact, trigger_observed};

/// Identity of a contact from step to step: its pair, the parts and the features that meet.
pub(crate) type ContactKey = (ContactPair, [u32; 2], u32);

/// Contact found in a substep.
struct Found {
    key: ContactKey,
    point: ContactPoint,
    /// As it was before it was solved, so that its speeds are those of the approach.
    is_unsolved: bool,
    /// Touches or has an impulse: a contact even if it was none in the last step.
    begins: bool,
}

/// Contacts of this step.
#[derive(Resource, Default)]
pub(crate) struct Points {
    /// In the order found, several to a contact: of each substep, before and after it is solved.
    now: Vec<Found>,
    /// Number of this step's impacts already noted.
    impacts: usize,
    /// Events of this step for observers.
    events: Vec<ContactPoint>,
}

/// Run condition: somebody reads or observes single contacts.
pub(crate) fn are_read(world: &World) -> bool {
    is_read::<ContactPoint>(world) || are_observed(world)
}

/// Run condition: somebody observes single contacts.
pub(crate) fn are_observed(world: &World) -> bool {
    observers::<ContactPoint>(world).is_some()
}

/// Triggers this step's events where they are observed.
pub(crate) fn trigger(world: &mut World) {
    let mut events = std::mem::take(&mut world.resource_mut::<Points>().events);
    trigger_observed(world, &mut events);
    world.resource_mut::<Points>().events = events; // for its memory
}

/// Forgets contacts while nobody reads or observes them.
pub(crate) fn forget(mut world: ResMut<TawWorld>, mut points: ResMut<Points>) {
    if !world.contact_points.is_empty() {
        world.contact_points.clear();
    }
    points.now.clear();
    points.events.clear();
    points.impacts = 0;
}

/// Notes the contacts of this substep before they are solved.
pub(crate) fn collect(world: Res<TawWorld>, delta: Res<SubstepDelta>, mut points: ResMut<Points>) {
    let fall = fall(&world, delta.0);
    let radius = |row: u32| world.marbles.radius()[row as usize];
    for contact in &world.contacts.wm {
        let goes_on = touch_goes_on(contact.separation, radius(contact.b), fall);
        points.now.extend(unsolved(&world, contact, true, goes_on));
    }
    for contact in &world.contacts.mm {
        let smaller = radius(contact.a).min(radius(contact.b));
        let goes_on = touch_goes_on(contact.separation, smaller, fall);
        points.now.extend(unsolved(&world, contact, false, goes_on));
    }
}

/// Contact before it is solved, if it touches or goes on.
fn unsolved(
    world: &TawWorld,
    contact: &Contact<f32>,
    on_wall: bool,
    goes_on: bool,
) -> Option<Found> {
    let begins = contact.is_touching();
    if !begins && !goes_on {
        return None;
    }
    let (key, point) = point_of(world, contact, on_wall)?;
    let (normal_impulse, tangent_impulse) = (0.0, Vec3::ZERO);
    let point = ContactPoint { normal_impulse, tangent_impulse, ..point };
    Some(Found { key, point, is_unsolved: true, begins })
}

/// Contact and its key. Rows move about; the order of entities does not.
fn point_of(
    world: &TawWorld,
    contact: &Contact<f32>,
    on_wall: bool,
) -> Option<(ContactKey, ContactPoint)> {
    let touch = touch_of(world, contact, on_wall)?;
    let is_swapped = world.marble_entity(contact.b) != Some(touch.pair.b);
    let tangent = from_vector(contact.tangent_impulse);
    let point = ContactPoint {
        normal_impulse: contact.normal_impulse,
        tangent_impulse: if is_swapped { -tangent } else { tangent },
        ..ContactPoint::of(touch)
    };
    // The feature of the first is in its upper half.
    let feature = if is_swapped { contact.feature.rotate_left(16) } else { contact.feature };
    Some(((touch.pair, [touch.part, 0], feature), point))
}

/// Notes the impulses of the contacts of this substep, and impacts.
pub(crate) fn collect_solved(world: Res<TawWorld>, mut points: ResMut<Points>) {
    let Points { now, impacts, .. } = &mut *points;
    for (contacts, on_wall) in [(&world.contacts.wm, true), (&world.contacts.mm, false)] {
        for contact in contacts.iter().filter(|contact| contact.normal_impulse != 0.0) {
            let Some((key, point)) = point_of(&world, contact, on_wall) else { continue };
            let point = ContactPoint { approach_speed: 0.0, slip_speed: 0.0, ..point };
            now.push(Found { key, point, is_unsolved: false, begins: true });
        }
    }
    // By `SoftStep`, contacts have the impulses of impacts.
    let has_impulses = world.model().response == Response::EventDriven;
    for impact in world.impacts().iter().skip(*impacts) {
        let Some(touch) = touch_of_impact(&world, impact) else { continue };
        let mut point = ContactPoint::of(touch);
        if has_impulses {
            point.normal_impulse = touch.impulse.dot(touch.normal);
            point.tangent_impulse = touch.impulse.reject_from_normalized(touch.normal);
        }
        let key = (touch.pair, [touch.part, 0], 0); // of balls
        now.push(Found { key, point, is_unsolved: true, begins: true });
    }
    *impacts = world.impacts().len();
    now.extend(body_touches(&world).map(|(key, point)| Found {
        key,
        point,
        is_unsolved: true,
        begins: true,
    }));
}

/// Sums what was found of each contact, and tells it. Contacts of what sleeps are not listed: they stay as they are.
pub(crate) fn write(
    mut world: ResMut<TawWorld>,
    mut points: ResMut<Points>,
    mut messages: Option<ResMut<Messages<ContactPoint>>>,
    marbles: Query<&MarbleState>,
) {
    let Points { now, impacts, events } = &mut *points;
    *impacts = 0;
    events.clear(); // nobody observed those of the last step
    let mut list = std::mem::take(&mut world.contact_points);
    let position = |list: &[(ContactKey, ContactPoint)], key: &ContactKey| {
        list.binary_search_by_key(key, |(key, _)| *key)
    };
    now.sort_by_key(|found| found.key);
    now.dedup_by(|next, kept| {
        let same = next.key == kept.key;
        if same {
            kept.add(next);
        }
        same
    });
    now.retain_mut(|found| {
        found.point.is_new = position(&list, &found.key).is_err();
        found.begins || !found.point.is_new
    });
    list.retain_mut(|(key, point)| {
        point.is_new = false;
        (point.approach_speed, point.slip_speed) = (0.0, 0.0);
        sleeps(key.0, &world, &marbles)
    });
    now.retain(|found| position(&list, &found.key).is_err());
    list.extend(now.drain(..).map(|found| (found.key, found.point)));
    list.sort_by_key(|(key, _)| *key);
    events.extend(list.iter().map(|(_, point)| *point));
    if let Some(messages) = &mut messages {
        messages.write_batch(events.iter().copied());
    }
    world.contact_points = list;
}

impl Found {
    /// Adds what was found of the contact later in the step: impulses sum up, and the fastest approach counts.
    fn add(&mut self, next: &Self) {
        let speed = |it: &Self| (it.is_unsolved, it.point.approach_speed);
        let normal_impulse = self.point.normal_impulse + next.point.normal_impulse;
        let tangent_impulse = self.point.tangent_impulse + next.point.tangent_impulse;
        if speed(next) > speed(self) {
            (self.point, self.is_unsolved) = (next.point, next.is_unsolved);
        }
        self.point = ContactPoint { normal_impulse, tangent_impulse, ..self.point };
        self.begins |= next.begins;
    }
}
