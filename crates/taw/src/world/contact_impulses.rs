//! Impulses of the contacts that [`SoftStep`](crate::response::Response::SoftStep) lists.

use cgmath::{InnerSpace, Zero};

use super::World;
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
    /// the whole step, those of bounces included, from the next step on. It is off by default, since adding up
    /// the impulses of all substeps takes time; `Impulse` and `Penalty` list theirs in any case.
    pub fn set_records_impulses(&mut self, records_impulses: bool) {
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
        fill_in(&mut self.contacts.mm, pairs.collect());
        let at_walls = recorded.with_walls.into_list().into_iter();
        let at_walls = at_walls.filter_map(|([wall, part, slot], impulse)| {
            Some(([wall, marble(slot)?, part], impulse))
        });
        fill_in(&mut self.contacts.wm, at_walls.collect());
    }
}

/// Fills contacts with the sums of impulses, each given by both rows and the sub-shape.
fn fill_in<S: Scalar>(contacts: &mut [Contact<S>], mut impulses: Vec<([u32; 3], Vec3<S>)>) {
    impulses.sort_by_key(|(key, _)| *key);
    for contact in contacts {
        let key = [contact.a, contact.b, contact.part];
        let first = impulses.partition_point(|(other, _)| *other < key);
        let its = impulses[first..].iter().take_while(|(other, _)| *other == key);
        let impulse = its.fold(Vec3::zero(), |sum, (_, impulse)| sum + *impulse);
        let normal = contact.normal;
        contact.set_impulse(impulse.dot(normal), impulse.reject_from(normal));
    }
}
