//! Impulses of the contacts that [`SoftStep`](crate::response::Response::SoftStep) lists.

use cgmath::InnerSpace;

use super::World;
use super::narrow_phase::marble_contact;
use super::walls::SubShape;
use crate::contact::Contact;
use crate::handle::NO_ROW;
use crate::math::{RealVector, Scalar, Vec3};

impl<S: Scalar> World<S> {
    /// True if contacts of [`SoftStep`](crate::response::Response::SoftStep) are filled with impulses.
    #[must_use]
    pub fn records_impulses(&self) -> bool {
        self.settings.records_impulses
    }

    /// Fills the contacts that [`SoftStep`](crate::response::Response::SoftStep) lists with the impulses of
    /// the whole step, those of bounces included, from the next step on; contacts that nobody could foresee at
    /// its begin are listed then, too. Contacts of what sleeps are not listed, so switching this on wakes all. It
    /// is off by default, since adding up the impulses of all substeps takes time; `Impulse` and `Penalty` list
    /// theirs in any case.
    pub fn set_records_impulses(&mut self, records_impulses: bool) {
        if records_impulses && !self.settings.records_impulses {
            self.marbles.sleep.wake_all();
            self.swarm.wake_all();
        }
        self.settings.records_impulses = records_impulses;
    }

    /// Fills the listed contacts with the impulses that the swarm has recorded.
    pub(super) fn fill_in_impulses(&mut self) {
        let Some(mut recorded) = self.swarm.take_recorded_impulses() else { return };
        for impact in self.swarm.noted_impacts() {
            if impact.on_wall {
                recorded.with_walls.add([impact.a, impact.part, impact.b], impact.impulse);
            } else {
                recorded.pairs.add([impact.a, impact.b], impact.impulse);
            }
        }
        let slots = &self.scratch.soft_step.marble_of_slot;
        let marble = |slot: u32| slots.get(slot as usize).copied().filter(|row| *row != NO_ROW);
        let pairs = recorded.pairs.into_list().into_iter().filter_map(|([a, b], impulse)| {
            let (a, b) = (marble(a)?, marble(b)?);
            Some(if a < b { ([a, b, 0], impulse) } else { ([b, a, 0], -impulse) })
        });
        let met = fill_in(&mut self.contacts.mm, pairs.collect());
        let at_walls = recorded.with_walls.into_list().into_iter();
        let at_walls = at_walls.filter_map(|([wall, part, slot], impulse)| {
            Some(([wall, marble(slot)?, part], impulse))
        });
        let met_walls = fill_in(&mut self.contacts.wm, at_walls.collect());
        let (zero, any) = (S::zero(), S::max_value());
        for ([a, b, _], impulse) in met {
            let contact = marble_contact(&self.marbles, [a, b], [zero; 2], any);
            self.contacts.mm.extend(contact.map(|contact| with_impulse(contact, impulse)));
        }
        for ([wall, b, index], impulse) in met_walls {
            let row = b as usize;
            let part = SubShape { wall, index };
            let nearest = self.walls.project_point(part, self.marbles.position()[row]);
            let place = (nearest.normal, nearest.distance);
            let contact = self.wall_contact(part, row, zero, place);
            self.contacts.wm.push(with_impulse(contact, impulse));
        }
    }
}

/// Contact with this impulse on the second body.
fn with_impulse<S: Scalar>(mut contact: Contact<S>, impulse: Vec3<S>) -> Contact<S> {
    let normal = contact.normal;
    contact.set_impulse(impulse.dot(normal), impulse.reject_from(normal));
    contact
}

/// Impulse of a contact, which is given by both rows and the sub-shape.
type KeyedImpulse<S> = ([u32; 3], Vec3<S>);

/// Fills contacts with the sums of their impulses. Returns the impulses of those that are not listed: who
/// came together within the step by what others did.
fn fill_in<S: Scalar>(
    contacts: &mut [Contact<S>],
    mut impulses: Vec<KeyedImpulse<S>>,
) -> Vec<KeyedImpulse<S>> {
    impulses.sort_by_key(|(key, _)| *key);
    impulses.dedup_by(|(key, impulse), (kept, sum)| {
        let same = key == kept;
        if same {
            *sum += *impulse;
        }
        same
    });
    let mut is_listed = vec![false; impulses.len()];
    for contact in contacts {
        let key = [contact.a, contact.b, contact.part];
        if let Ok(at) = impulses.binary_search_by_key(&key, |(key, _)| *key) {
            *contact = with_impulse(*contact, impulses[at].1);
            is_listed[at] = true;
        }
    }
    let mut at = 0;
    impulses.retain(|_| {
        at += 1;
        !is_listed[at - 1]
    });
    impulses
}
