//! Walls behind balls, where masses differ much.

use cgmath::InnerSpace;

use super::{row, wider};
use crate::math::Scalar;
use crate::swarm::Swarm;
use crate::swarm::chunk::Chunk;
use crate::swarm::kernels::LOST;
use crate::swarm::wall_contact::WallContact;
use crate::workers::{DisjointSlice, parallel_for};

/// Mass ratio from which on pairs look who has a wall behind it. While a contact learns what it bears, a
/// pair sinks in by the mass ratio times the fall of a substep: by less than a millimetre times this.
const UNEVEN: f64 = 8.0;

/// Least [share](WallContact::share) of a wall behind a ball with locked axes: others turn what it bears
/// out of its normal.
const UNTURNED: f64 = 0.999;

impl<S: Scalar> Swarm<S> {
    /// Finds for each ball the wall that bears most of it, where masses are so uneven that pairs
    /// need to know ([`SolverColumns::backing`]).
    pub(super) fn find_backing(&mut self) {
        self.find_walls_behind(false);
    }

    /// Finds the walls behind balls again within a substep, after rows may have changed: those that
    /// bear something for others go on bearing it.
    pub(super) fn restore_backing(&mut self) {
        self.find_walls_behind(true);
    }

    /// Saves what walls bear for others in their contacts, before rows change, and forgets the impacts
    /// of pairs. (Pairs of fast movers come after those of walls, so contacts do not know it yet.)
    pub(super) fn save_backing(&mut self) {
        if self.scratch.backing.is_empty() {
            return;
        }
        self.forget_impacts_of_pairs();
        let awake = self.chunks.iter_mut().filter(|chunk| !chunk.asleep);
        for contact in awake.flat_map(|chunk| &mut chunk.wall_contacts) {
            contact.borne_for_others =
                contact.share_of(&self.scratch.backing[contact.row as usize]);
        }
    }

    /// Forgets the impulses that stopped balls in this substep, but not the loads.
    pub(super) fn forget_impacts(&mut self) {
        if self.scratch.backing.is_empty() {
            return;
        }
        self.forget_impacts_of_pairs();
        let awake = self.chunks.iter_mut().filter(|chunk| !chunk.asleep);
        awake.flat_map(|chunk| &mut chunk.wall_contacts).for_each(WallContact::forget_impact);
    }

    /// Forgets the impacts of pairs, in chunks asleep too: these hold pairs with the next one.
    fn forget_impacts_of_pairs(&mut self) {
        self.fast_movers.impulses.forget_impacts();
        self.chunks.iter_mut().for_each(|chunk| chunk.impulses.forget_impacts());
    }

    fn find_walls_behind(&mut self, again: bool) {
        let inverse = |chunk: &Chunk<S>| chunk.inverse_masses;
        let [least, most] =
            self.chunks.iter().map(inverse).fold([S::max_value(), S::zero()], wider);
        let rows = if most > S::from_f64(UNEVEN) * least { self.at.len() } else { 0 };
        self.scratch.backing.clear();
        self.scratch.backing.resize(rows, [S::zero(); 4]);
        self.scratch.backing_speed.clear();
        if self.chunks.iter().any(|chunk| chunk.wall_speed > S::zero()) {
            self.scratch.backing_speed.resize(rows, S::zero());
        }
        if rows == 0 {
            self.scratch.backing.shrink_to_fit();
            self.scratch.backing_speed.shrink_to_fit();
            // A heavy ball may have gone that a wall bore.
            let contacts = self.chunks.iter_mut().flat_map(|chunk| &mut chunk.wall_contacts);
            contacts.for_each(|contact| contact.borne_for_others = S::zero());
            return;
        }
        let (chunks, at) = (&self.chunks, &self.at[..]);
        let backing = DisjointSlice::new(&mut self.scratch.backing);
        let backing_speed = DisjointSlice::new(&mut self.scratch.backing_speed);
        parallel_for(self.scratch.threads, chunks.len(), |_, chunk| {
            // Those of a ball follow each other.
            for of_ball in chunks[chunk].wall_contacts.chunk_by(|a, b| a.row == b.row) {
                let (mut most, mut behind, mut last) = (S::zero(), [S::zero(); 4], &of_ball[0]);
                let mut speed = S::zero();
                let along = |contact: &WallContact<S>| contact.surface.dot(contact.normal);
                for contact in of_ball {
                    let bears = contact.bears(&at[contact.row as usize]);
                    if contact.share() < S::from_f64(UNTURNED) {
                        continue;
                    }
                    // A wall that bears a proxy gives way to it.
                    if bears > most && !(contact.bears_proxy && along(contact) != S::zero()) {
                        (most, behind, speed) = (bears, row(contact.normal), along(contact));
                    }
                    if contact.borne_for_others > last.borne_for_others {
                        last = contact;
                    }
                }
                let bears = last.borne_for_others > S::zero();
                if again && bears {
                    (behind, speed) = (row(last.normal), along(last));
                    behind[3] = last.borne_for_others;
                } else if bears && behind[..3] != row(last.normal)[..3] {
                    behind = [S::zero(), S::zero(), S::zero(), S::from_f64(LOST)];
                }
                // SAFETY: a row of the chunk.
                unsafe {
                    *backing.row(last.row as usize) = behind;
                    if backing_speed.len() > 0 {
                        *backing_speed.row(last.row as usize) = speed;
                    }
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use crate::math::Point3;
    use crate::swarm::{Ball, SwarmModel};
    use crate::world::World;

    /// However chunks come and go as balls are poured.
    #[test]
    fn balls_of_one_mass_need_no_backing() {
        for sleeps in [false, true] {
            let mut world = World::<f32>::default();
            world.swarm.set_model(SwarmModel { sleeps, ..SwarmModel::default() }).unwrap();
            let floor = crate::shape::Plane::new(crate::math::Vec3::unit_y(), 0.0).unwrap();
            world.walls.insert(floor).unwrap();
            let balls = (0..3_000_u16).map(|i| {
                let [x, y, z] = [i % 16, i / 256, i / 16 % 16].map(f32::from);
                let aside = 0.1 * (x * 0.618).fract();
                Ball::new(Point3::new(x * 1.2 + aside * y, 1.0 + y * 1.2, z * 1.2 + aside), 0.5)
            });
            world.swarm.insert(&balls.collect::<Vec<_>>()).unwrap();
            for step in 0..150 {
                world.step(1.0 / 60.0).unwrap();
                assert!(world.swarm.scratch.backing.is_empty(), "step {step}, sleeps: {sleeps}");
            }
            assert!(world.swarm.rebuilds() > 5 && world.swarm.chunks.len() > 3);
        }
    }
}
