//! Impulses of contacts over a step, for those who read them.

use cgmath::InnerSpace;

use super::Swarm;
use super::batches::Batch;
use super::fast_movers::FastMovers;
use super::kernels::ContactImpulses;
use super::state::of;
use super::wall_contact::xyz;
use crate::math::{Scalar, Vec3};

/// Impulses of contacts in a step, on the second body of each, in N s. By slots, which rows may leave
/// within a step.
#[derive(Clone, Debug, Default)]
pub(crate) struct RecordedImpulses<S> {
    /// By the slots of two balls.
    pub pairs: ImpulseSums<[u32; 2], S>,
    /// By wall, sub-shape and slot of the ball.
    pub with_walls: ImpulseSums<[u32; 3], S>,
}

/// Sums of impulses by contact.
#[derive(Clone, Debug, Default)]
pub(crate) struct ImpulseSums<K, S> {
    list: Vec<(K, Vec3<S>)>,
    /// Place of the contact that comes next if contacts come in the same order as last time.
    next: usize,
}

impl<K: PartialEq, S: Scalar> ImpulseSums<K, S> {
    /// Adds the impulse of a contact.
    pub fn add(&mut self, contact: K, impulse: Vec3<S>) {
        match self.list.get_mut(self.next) {
            Some((known, sum)) if *known == contact => {
                *sum += impulse;
                self.next += 1;
            }
            _ => {
                self.list.push((contact, impulse));
                self.next = self.list.len();
            }
        }
    }

    /// Begins to add the impulses of all contacts.
    fn begin(&mut self) {
        self.next = 0;
    }

    /// Contacts and impulses; a contact may come more than once.
    pub fn into_list(self) -> Vec<(K, Vec3<S>)> {
        self.list
    }

    fn bytes(&self) -> usize {
        of(&self.list)
    }
}

impl<S: Scalar> RecordedImpulses<S> {
    pub fn bytes(&self) -> usize {
        self.pairs.bytes() + self.with_walls.bytes()
    }
}

impl<S: Scalar> Swarm<S> {
    /// Records the impulses of contacts in the next step.
    pub(crate) fn record_impulses(&mut self) {
        self.scratch.recorded_impulses = Some(RecordedImpulses::default());
    }

    /// Impulses of the last step, if they were recorded; without those of bounces, which
    /// [noted impacts](Self::noted_impacts) have.
    pub(crate) fn take_recorded_impulses(&mut self) -> Option<RecordedImpulses<S>> {
        self.scratch.recorded_impulses.take()
    }

    /// Records the impulses that contacts have accumulated in a substep along the normals that they have
    /// now, times a factor.
    pub(super) fn record_contact_impulses(&mut self, factor: S) {
        let Some(mut recorded) = self.scratch.recorded_impulses.take() else { return };
        recorded.pairs.begin();
        recorded.with_walls.begin();
        for chunk in &self.chunks {
            self.record_pairs(&chunk.batches, &chunk.impulses, factor, &mut recorded.pairs);
        }
        let FastMovers { batches, impulses, .. } = &self.fast_movers;
        self.record_pairs(batches, impulses, factor, &mut recorded.pairs);
        let slots = self.ids.slots();
        for contact in self.chunks.iter().flat_map(|chunk| &chunk.wall_contacts) {
            let row = contact.row as usize;
            let backing = self.scratch.backing.get(row);
            let borne = backing.map_or(S::zero(), |backing| contact.share_of(backing));
            let normal = contact.impulse.normal + borne;
            let awake = self.velocity[row][3].is_sign_positive();
            if normal > S::zero() && awake {
                let impulse = contact.normal * normal + contact.impulse.tangent;
                let key = [contact.wall, contact.part, slots[row]];
                recorded.with_walls.add(key, impulse * factor);
            }
        }
        self.scratch.recorded_impulses = Some(recorded);
    }

    fn record_pairs(
        &self,
        batches: &[Batch],
        impulses: &ContactImpulses<S>,
        factor: S,
        sums: &mut ImpulseSums<[u32; 2], S>,
    ) {
        let slots = self.ids.slots();
        let of_batches =
            batches.iter().zip(&impulses.normal_impulse).zip(&impulses.tangent_impulse);
        for ((batch, normal_impulse), tangent_impulse) in of_batches.filter(|it| !it.0.0.is_idle) {
            for ([a, b], lane) in batch.pairs().zip(0..) {
                if normal_impulse[lane] > S::zero() {
                    let apart = xyz(&self.at[b as usize]) - xyz(&self.at[a as usize]);
                    let distance = apart.magnitude();
                    let along = if distance > S::zero() { apart / distance } else { apart };
                    let [x, y, z] = [0, 1, 2].map(|axis| tangent_impulse[axis][lane]);
                    let impulse = along * normal_impulse[lane] + Vec3::new(x, y, z);
                    sums.add([slots[a as usize], slots[b as usize]], impulse * factor);
                }
            }
        }
    }
}
