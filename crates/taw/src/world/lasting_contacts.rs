//! Contacts that last: two that pressed each other in the last substep may meet again in this one.

use super::World;
use super::continuous::MAX_FREE_MOTION;
use super::narrow_phase::marble_contact;
use super::walls::SubShape;
use crate::contact::{Contact, Contacts};
use crate::math::Scalar;
use crate::response::{ContactKey, KeyedByContact};

/// Contacts that bore an impulse in the last substep and have opened since.
#[derive(Clone, Debug, Default)]
pub(super) struct LastingContacts {
    /// Keys of those that are listed, sorted.
    keys: Vec<ContactKey>,
    /// Kinds of bodies that each row touches.
    touched: Vec<Touched>,
}

/// Bodies that a ball touches.
#[derive(Clone, Copy, Debug, Default)]
struct Touched {
    wall: bool,
    marble: bool,
}

impl LastingContacts {
    /// Notes the kinds of bodies that each row touches.
    fn note_touched<S>(&mut self, contacts: &Contacts<S>, rows: usize) {
        self.touched.clear();
        self.touched.resize(rows, Touched::default());
        for contact in &contacts.wm {
            self.touched[contact.b as usize].wall = true;
        }
        for row in contacts.mm.iter().flat_map(|contact| [contact.a, contact.b]) {
            self.touched[row as usize].marble = true;
        }
    }

    /// Returns true if what its bodies touch may press them together again. A ball between two walls is
    /// not pressed: neither gives way to what the other one throws back.
    fn is_pressed(&self, key: ContactKey, (a, b): (u32, u32)) -> bool {
        let [a, b] = [a, b].map(|row| self.touched.get(row as usize).copied().unwrap_or_default());
        if key.is_pair() { a.wall || a.marble || b.wall || b.marble } else { b.marble && !b.wall }
    }

    fn has(&self, key: ContactKey) -> bool {
        self.keys.binary_search(&key).is_ok()
    }
}

impl<S: Scalar> World<S> {
    /// Adds contacts that bore an impulse in the last substep and have opened since, of balls that touch
    /// something else. Otherwise a light ball between a heavy one and a wall would find only one of the
    /// two in each substep, and be thrown into the other. Only of balls: the nearest points of a capsule
    /// move on.
    pub(super) fn add_lasting_contacts(&mut self) {
        let mut lasting = std::mem::take(&mut self.scratch.lasting_contacts);
        lasting.keys.clear();
        self.follow_contacts();
        if !self.memory.impulses.is_empty() {
            lasting.note_touched(&self.contacts, self.marbles.len());
        }
        for key in self.memory.impulses.iter().map(KeyedByContact::key) {
            let Some(rows) = key.balls().filter(|rows| lasting.is_pressed(key, *rows)) else {
                continue;
            };
            let Some(contact) = self.opened_contact(key, rows) else { continue };
            let list = if key.is_pair() { &mut self.contacts.mm } else { &mut self.contacts.wm };
            list.push(contact);
            lasting.keys.push(key);
        }
        self.scratch.lasting_contacts = lasting;
    }

    /// Contact of two balls, or of a wall and a ball, that is too wide to be listed.
    fn opened_contact(&self, key: ContactKey, (a, b): (u32, u32)) -> Option<Contact<S>> {
        let radius = |row: u32| self.marbles.radius()[row as usize];
        let (contact, radius) = if key.is_pair() {
            let contact = marble_contact(&self.marbles, [a, b], [S::zero(); 2], S::max_value())?;
            (contact, radius(a).min(radius(b)))
        } else {
            if !self.walls.collides(a, self.marbles.filter_of_row(b as usize)) {
                return None;
            }
            let part = SubShape { wall: a, index: key.part() };
            let nearest = self.walls.project_point(part, self.marbles.position()[b as usize]);
            let place = (nearest.normal, nearest.distance);
            (self.wall_contact(part, b as usize, S::zero(), place), radius(b))
        };
        // Beyond that, the end of a substep no longer tells what met what.
        let widest = radius * S::from_f64(MAX_FREE_MOTION);
        let is_open = contact.separation > self.scratch.reach && contact.separation <= widest;
        is_open.then_some(contact)
    }

    /// Lets lasting contacts begin from nothing: they bear an impulse only if they meet again.
    pub(super) fn forget_lasting_impulses(&mut self) {
        let lasting = &self.scratch.lasting_contacts;
        if !lasting.keys.is_empty() {
            self.memory.impulses.retain(|entry| !lasting.has(entry.key()));
        }
    }

    /// Takes lasting contacts out of the lists, which are for what touches at the end of a substep.
    pub(super) fn drop_lasting_contacts(&mut self) {
        let lasting = &self.scratch.lasting_contacts;
        if !lasting.keys.is_empty() {
            self.contacts.wm.retain(|c| !lasting.has(ContactKey::with_wall(c)));
            self.contacts.mm.retain(|c| !lasting.has(ContactKey::between_marbles(c)));
        }
    }
}
