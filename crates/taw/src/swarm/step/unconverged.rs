//! Contacts that one pass leaves unconverged: heavy balls that sink into light ones below them.
//!
//! A pass gives a heavy ball on a light one no more than what stops the light one, so it would need as many
//! passes as the one weighs times the other. [`SolverColumns::backing`](crate::swarm::kernels::SolverColumns)
//! solves that for a light ball on one wall. Those on several walls and on other balls are solved here, with
//! up to 256 balls next to them, as by [`Response::Impulse`](crate::response::Response::Impulse).

use cgmath::{InnerSpace, Zero};

use super::cluster::{ContactLocation, PairPlace, UnconvergedCluster};
use crate::constraint::ContactImpulse;
use crate::math::{Scalar, Vec3, cast_vector};
use crate::response::impulse::{ImpulseScratch, SolverSettings, solve_velocities};
use crate::swarm::Swarm;
use crate::swarm::batches::Batch;
use crate::swarm::kernels::{
    ContactImpulses, FindSinking, Sinking, SolverParams, StruckContact, WALL_SLOP,
};
use crate::swarm::wall_contact::xyz;
use crate::workers::{DisjointSlice, parallel_for};

/// Most iterations over a cluster. It converges in some more than there are contacts above each other, so a
/// higher column does not within a substep.
const ITERATIONS: u32 = 50;
/// Change of velocities in an iteration with which they end, as a part of the speed at which the smallest ball
/// may sink.
const TOLERANCE: f64 = 0.1;

impl<S: Scalar> Swarm<S> {
    /// Solves the contacts of balls that still sink after a pass, where masses differ.
    pub(super) fn solve_unconverged(&mut self, params: &SolverParams<S>) {
        if self.scratch.backing.is_empty() {
            return;
        }
        let sinking = self.find_sinking(params);
        if sinking.is_empty() {
            return;
        }
        let mut cluster = UnconvergedCluster::new(self, &sinking, params);
        let smallest = cluster.radius.iter().copied().fold(f64::INFINITY, f64::min);
        let h = params.time.as_f64();
        let settings = SolverSettings {
            iterations: ITERATIONS,
            dt: h,
            restitution_threshold: params.restitution_threshold.as_f64(),
            tolerance: params.max_sinking.as_f64() * smallest / h * TOLERANCE,
            slop: 0.0,
            max_relative_slop: 0.0,
            max_relative_push: 0.0,
            gravity: Vec3::zero(), // what rests does not tip
            threads: self.threads(),
            resolve_jams: true,
        };
        let mut contacts = std::mem::take(&mut cluster.contacts);
        solve_velocities(
            &mut cluster.bodies(),
            &mut contacts,
            &settings,
            &mut ImpulseScratch::default(),
        );
        let mut velocities = cluster.velocity.iter().chain(&cluster.spin);
        if velocities.all(|velocity| velocity.magnitude2().is_finite()) {
            self.store_velocities(&cluster);
            for (contact, location) in contacts.iter().zip(&cluster.locations) {
                match *location {
                    ContactLocation::Pair(place) => self.store_pair(contact.impulse, place),
                    ContactLocation::Wall(place, share) => {
                        self.store_wall(contact.impulse, place, share);
                    }
                }
            }
        }
    }

    /// Finds balls that sink into others or into walls, in the order of chunks.
    fn find_sinking(&mut self, params: &SolverParams<S>) -> Vec<Sinking<S>> {
        let mut lists = vec![Vec::new(); self.chunks.len() + 1];
        let last = self.chunks.len();
        let (at, velocity) =
            (DisjointSlice::new(&mut self.at), DisjointSlice::new(&mut self.velocity));
        let (chunks, simd_level) = (&self.chunks, *self.simd_level);
        let pairs =
            |batches: &[Batch], impulses: &ContactImpulses<S>, found: &mut Vec<Sinking<S>>| {
                simd_level.run(FindSinking { at, velocity, batches, impulses, params, found });
            };
        pairs(&self.fast_movers.batches, &self.fast_movers.impulses, &mut lists[last]);
        let found = DisjointSlice::new(&mut lists);
        parallel_for(self.scratch.threads, chunks.len(), |_, i| {
            let chunk = &chunks[i];
            if chunk.asleep && chunks.get(i + 1).is_none_or(|next| next.asleep) {
                return;
            }
            // SAFETY: each thread has its own chunks, and nobody changes rows meanwhile.
            let found = unsafe { &mut *found.row(i) };
            pairs(&chunk.batches, &chunk.impulses, found);
            for contact in chunk.wall_contacts.iter().filter(|_| !chunk.asleep) {
                let row = contact.row as usize;
                // SAFETY: as above.
                let (at, velocity) = unsafe { (*at.row(row), *velocity.row(row)) };
                let approach_speed = -(xyz(&velocity) - contact.surface).dot(contact.normal);
                if params.sinks(
                    approach_speed,
                    contact.separation(&at),
                    at[3],
                    S::from_f64(WALL_SLOP),
                ) {
                    found.push(Sinking { row: contact.row, approach_speed });
                }
            }
        });
        lists.concat()
    }

    fn store_velocities(&mut self, cluster: &UnconvergedCluster<S>) {
        for (i, row) in cluster.rows.iter().map(|row| *row as usize).enumerate() {
            if cluster.inverse_mass[i] > 0.0 {
                let velocity: [S; 3] = cast_vector(cluster.velocity[i]).into();
                self.velocity[row][..3].copy_from_slice(&velocity);
                let spin: [S; 3] = cast_vector(cluster.spin[i] * cluster.radius[i]).into();
                self.spin[row][..3].copy_from_slice(&spin);
            }
        }
    }

    /// Stores the impulse of a pair, for this substep only: once the balls lie otherwise, one pass would not
    /// take it back.
    fn store_pair(&mut self, impulse: ContactImpulse<f64>, place: PairPlace) {
        let PairPlace { list, batch, lane } = place;
        let impulses = match self.chunks.get_mut(list) {
            Some(chunk) => &mut chunk.impulses,
            None => &mut self.fast_movers.impulses,
        };
        let load = impulses.normal_impulse[batch][lane];
        impulses.struck.push(StruckContact::new([batch as u32, lane as u32], load));
        impulses.normal_impulse[batch][lane] = S::from_f64(impulse.normal);
        let tangent: [f64; 3] = impulse.tangent.into();
        for (axis, x) in impulses.tangent_impulse[batch].iter_mut().zip(tangent) {
            axis[lane] = S::from_f64(x);
        }
    }

    /// Stores the impulse of a wall, for this substep only; of the one behind the ball, what it has borne for
    /// others first, as far as it goes.
    fn store_wall(
        &mut self,
        impulse: ContactImpulse<f64>,
        [chunk, number]: [usize; 2],
        share: Option<S>,
    ) {
        let wall = &mut self.chunks[chunk].wall_contacts[number];
        let (row, before) = (wall.row as usize, wall.impulse);
        let all = S::from_f64(impulse.normal);
        wall.borne_for_others = share.map_or(S::zero(), |share| share.min(all));
        if share.is_some() {
            self.scratch.backing[row][3] = wall.borne_for_others;
        }
        wall.load = Some(wall.load.unwrap_or(S::max_value()).min(before.normal));
        let (normal, tangent) = (all - wall.borne_for_others, cast_vector(impulse.tangent));
        wall.impulse = ContactImpulse { normal, tangent };
        if self.scratch.outside_work.is_empty() || wall.bears_proxy {
            return;
        }
        let change = ContactImpulse {
            normal: wall.impulse.normal - before.normal,
            tangent: tangent - before.tangent,
        };
        let after = self.velocity[row];
        let before = xyz(&after) - change.along(wall.normal) * after[3];
        let slot = self.ids.slots()[row] as usize;
        let before = [before.x, before.y, before.z, after[3]];
        self.scratch.outside_work[slot].record_wall(wall, &before, &after);
    }
}
