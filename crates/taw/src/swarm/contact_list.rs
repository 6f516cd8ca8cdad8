//! Contacts of bodies as the world lists them.

use cgmath::{InnerSpace, Zero};

use super::Swarm;
use super::batches::Batch;
use super::kernels::{NearLimits, NearPairs};
use super::wall_contact::{WallContact, xyz};
use crate::contact::{Contact, Contacts};
use crate::handle::NO_ROW;
use crate::math::{Scalar, Vec3};
use crate::workers::{DisjointSlice, parallel_for};

/// Contacts with walls and pairs of a chunk, in the order of the solver's memory.
#[derive(Clone, Copy)]
pub(crate) struct ChunkPairs<'a, S> {
    with_walls: &'a [WallContact<S>],
    batches: &'a [Batch],
}

impl<S: Scalar> Swarm<S> {
    /// Gives each chunk a list to fill if it or the next one is awake, and the fast movers one, on the
    /// threads of the step. The other lists are left as they are.
    pub(crate) fn fill_lists<L: Default + Send + Sync>(
        &self,
        lists: &mut Vec<L>,
        fill: impl Fn(&mut L, ChunkPairs<S>) + Sync,
    ) {
        let chunks = self.chunks.len();
        lists.resize_with(chunks + 1, L::default);
        let lists = DisjointSlice::new(lists);
        parallel_for(self.scratch.threads, chunks + 1, |_, chunk| {
            let (with_walls, batches) = match self.chunks.get(chunk..) {
                None | Some([]) => (&[][..], &self.fast_movers.batches[..]),
                Some([chunk, ..]) if !chunk.asleep => {
                    (&chunk.wall_contacts[..], &chunk.batches[..])
                }
                Some([chunk, next, ..]) if !next.asleep => (&[][..], &chunk.batches[..]),
                Some(_) => return,
            };
            // SAFETY: each has its own list.
            fill(unsafe { &mut *lists.row(chunk) }, ChunkPairs { with_walls, batches });
        });
    }

    /// See [`Swarm::list_contacts`].
    pub(super) fn list_contacts_here(
        &self,
        ChunkPairs { with_walls, batches }: ChunkPairs<S>,
        marble_of_slot: &[u32],
        limits: NearLimits<S>,
        (contacts, meetings): (&mut Contacts<S>, &mut Vec<u32>),
    ) {
        let slots = self.ids.slots();
        let marble = |row: u32| {
            let marble = marble_of_slot.get(slots[row as usize] as usize).copied();
            marble.filter(|marble| *marble != NO_ROW)
        };
        let centers = [Zero::zero(); 2];
        for contact in with_walls {
            let (Some(b), row) = (marble(contact.row), contact.row as usize) else { continue };
            if self.velocity[row][3].is_sign_negative() {
                continue;
            }
            let separation = contact.separation(&self.at[row]);
            let approach_speed = -(xyz(&self.velocity[row]) - contact.surface);
            let closes = approach_speed.dot(contact.normal).max(S::zero()) * limits.time;
            if separation <= limits.reach + closes {
                let radii = [S::zero(), self.at[row][3]];
                let place = (contact.normal, S::zero());
                let listed = Contact::with_wall(contact.wall, contact.part, b);
                let listed = listed.placed(place, radii, centers);
                contacts.wm.push(Contact { separation, ..listed });
            }
        }
        let visit = |rows: [u32; 2], comes: bool| {
            let [Some(a), Some(b)] = rows.map(marble) else { return };
            let [p, q] = rows.map(|row| &self.at[row as usize]);
            let apart = xyz(q) - xyz(p);
            let distance = apart.magnitude();
            let normal = if distance > S::zero() { apart / distance } else { Vec3::unit_x() };
            let radii = [p[3], q[3]];
            let place = (normal, distance);
            let listed = Contact::between_marbles(a, b).placed(place, radii, centers);
            if comes {
                meetings.push(contacts.mm.len() as u32);
            }
            contacts.mm.push(if a < b { listed } else { listed.reversed() });
        };
        let (at, velocity) = (&self.at[..], &self.velocity[..]);
        self.simd_level.run(NearPairs { at, velocity, batches, limits, visit });
    }
}
