//! Balls at walls: who is near one, and where it is touched.

use cgmath::{InnerSpace, Zero};

use crate::math::{Scalar, Vec3};
use crate::swarm::bit_set::BitSet;
use crate::swarm::chunk::Chunk;
use crate::swarm::kernels::{Pass, SolverColumns};
use crate::swarm::outside_work::OutsideWork;
use crate::swarm::scratch::SwarmScratch;
use crate::swarm::surfaces::SurfaceOf;
use crate::swarm::wall_contact::{WallContact, xyz};
use crate::swarm::wall_paths::{FAST, WallQuery, is_fast, slide_along_wall};
use crate::swarm::walls::{Balls, HalfSpace, find, near_shapes, shapes_of};
use crate::swarm::{Stage, StaticGeometry, Swarm, Tier};
use crate::workers::{DisjointSlice, parallel_for};

impl<S: Scalar> Swarm<S> {
    /// Time before a ball can be at a wall from which on it is searched, in seconds; in the lab's
    /// tier, it has moved already.
    pub(in crate::swarm) fn ahead(&self, dt: S) -> Option<S> {
        self.has_friction().then_some(S::from_f64(2.0) * dt)
    }

    /// Searches the balls at walls again, if one of these changed.
    pub(in crate::swarm) fn find_wall_contacts_if_changed(
        &mut self,
        changed: bool,
        dt: S,
        walls: &dyn StaticGeometry<S>,
        observe: &mut dyn FnMut(Stage),
    ) {
        if changed {
            observe(Stage::Walls);
            self.find_wall_contacts(dt, walls);
        }
    }

    /// Takes the contacts of removed walls out, and renames the walls that moved into their rows.
    pub(super) fn follow_removed_walls(&mut self, walls: &dyn StaticGeometry<S>) {
        let mut removals = Vec::new();
        let known = self
            .rows_of_walls
            .is_some_and(|since| walls.visit_removals_since(since, &mut |it| removals.push(it)));
        let of_chunks = self.chunks.iter_mut().map(|chunk| &mut chunk.wall_contacts);
        for contacts in of_chunks.chain([self.impulse_cache.wall_contacts_mut()]) {
            if !known {
                contacts.clear();
            }
            for [row, last] in &removals {
                contacts.retain_mut(|contact| {
                    let stays = contact.wall != *row;
                    if contact.wall == *last {
                        contact.wall = *row;
                    }
                    stays
                });
                contacts.sort_unstable_by_key(WallContact::key);
            }
        }
    }

    /// Searches the balls at walls again, where pairs are still known.
    pub(in crate::swarm) fn find_wall_contacts(&mut self, dt: S, walls: &dyn StaticGeometry<S>) {
        let (simd_level, shapes) = (*self.simd_level, walls.has_shapes());
        let (planes, ahead) = (listed_planes(&self.planes, self.tier()), self.ahead(dt));
        let (at, skin_left) = (&self.at[..], &self.skin_left[..]);
        let balls = Balls {
            at,
            velocity: &self.velocity,
            skin_left,
            ahead,
            surfaces: SurfaceOf {
                model: self.model.material,
                surfaces: &self.surfaces,
                slots: self.ids.slots(),
            },
        };
        let chunks = DisjointSlice::new(&mut self.chunks);
        parallel_for(self.scratch.threads, chunks.len(), |_, chunk| {
            // SAFETY: its own.
            let chunk = unsafe { &mut *chunks.row(chunk) };
            if chunk.asleep {
                return; // what changed is elsewhere, or it were awake
            }
            let old = std::mem::take(&mut chunk.wall_contacts);
            chunk.wall_contacts = std::mem::take(&mut chunk.old_wall_contacts);
            chunk.find_wall_contacts(simd_level, balls, planes, |contact| {
                find(&old, contact).copied()
            });
            chunk.near_shapes.clear();
            chunk.shapes_are_new = shapes;
            if shapes {
                near_shapes(walls, balls, chunk.own_rows(), &mut chunk.near_shapes);
            }
            chunk.restore_shape_contacts(|row| shapes_of(&old, row).copied());
            chunk.old_wall_contacts = old;
        });
    }

    /// Finds the walls of some more balls, in order of their rows.
    pub(in crate::swarm) fn find_wall_contacts_of(
        &mut self,
        rows: &[u32],
        dt: S,
        walls: &dyn StaticGeometry<S>,
    ) {
        let ahead = self.ahead(dt);
        let planes = listed_planes(&self.planes, self.tier());
        let (at, skin_left) = (&self.at[..], &self.skin_left[..]);
        let surfaces = SurfaceOf {
            model: self.model.material,
            surfaces: &self.surfaces,
            slots: self.ids.slots(),
        };
        let balls = Balls { at, velocity: &self.velocity, skin_left, ahead, surfaces };
        for chunk in &mut self.chunks {
            let mine = chunk.own_rows();
            let mine = rows.partition_point(|row| (*row as usize) < mine.start)
                ..rows.partition_point(|row| (*row as usize) < mine.end);
            if mine.is_empty() {
                continue;
            }
            chunk.find_wall_contacts_of(&rows[mine.clone()], balls, planes);
            if walls.has_shapes() {
                for row in &rows[mine] {
                    let row = *row as usize;
                    near_shapes(walls, balls, row..row + 1, &mut chunk.near_shapes);
                }
                chunk.shapes_are_new = true;
                chunk.near_shapes.sort_unstable();
                chunk.near_shapes.dedup();
            }
        }
    }

    /// Puts back to the wall each ball that passed into one in these `h` seconds, because of a
    /// contact that sent it another way than its wall contacts were sought on, and lets it slide
    /// on. One that was far from shapes flew by its velocity, and that much lower. Returns true if there was any.
    pub(in crate::swarm) fn stop_at_walls(
        &mut self,
        walls: &dyn StaticGeometry<S>,
        h: S,
        lower: Vec3<S>,
    ) -> bool {
        if !walls.has_shapes() {
            return false;
        }
        let count = self.chunks.len();
        let (chunks, velocity) = (DisjointSlice::new(&mut self.chunks), &self.velocity);
        let SwarmScratch { path_changes, places, substep, .. } = &self.scratch;
        let surfaces = SurfaceOf {
            model: self.model.material,
            surfaces: &self.surfaces,
            slots: self.ids.slots(),
        };
        let (at, skin_left) =
            (DisjointSlice::new(&mut self.at), DisjointSlice::new(&mut self.skin_left));
        parallel_for(self.scratch.threads, count, |_, chunk| {
            // SAFETY: each thread has its own chunks, and their rows.
            let chunk = unsafe { &mut *chunks.row(chunk) };
            chunk.caught = false;
            if chunk.asleep {
                return;
            }
            let rows = chunk.own_rows();
            let (at, skin_left) = unsafe { (at.part(rows.clone()), skin_left.part(rows.clone())) };
            let columns = at.iter_mut().zip(skin_left).zip(&velocity[rows.clone()]);
            for (((at, skin_left), velocity), row) in columns.zip(rows) {
                if velocity[3].is_sign_negative() {
                    continue;
                }
                let change = path_changes.get(row).map_or_else(Vec3::zero, xyz);
                // One that lies on a wall does not fly.
                let saved = places.get(surfaces.slots[row] as usize);
                let path = saved.and_then(|place| place.of(*substep)).map_or_else(
                    || xyz(velocity) * h - lower + change,
                    |place| xyz(at) - Vec3::from(place),
                );
                let locks = surfaces.locked_axes(row as u32);
                let path = locks.free_translation(path);
                let far = S::from_f64(FAST) * at[3];
                if is_fast(velocity, h, at[3]) || !change.is_zero() || path.magnitude2() > far * far
                {
                    let filter = surfaces.filter(row as u32);
                    let back = slide_along_wall(walls, at, (filter, locks), path);
                    *skin_left -= back;
                    chunk.caught |= back > S::zero();
                }
            }
        });
        self.chunks.iter().any(|chunk| chunk.caught)
    }

    /// Finds the contacts of fast balls with all that they may meet in the step of `dt` seconds, of those
    /// that came near a shape, and of all if walls moved. (The solver finds them again in each substep, and more exactly.)
    pub(in crate::swarm) fn update_contacts_on_the_way(
        &mut self,
        walls: &dyn StaticGeometry<S>,
        walls_changed: bool,
        dt: S,
    ) {
        if walls.has_shapes() || walls_changed {
            self.update_contacts_of(walls, dt, [dt, dt], |_| true, [!walls_changed, true]);
        }
    }

    /// Brings the contacts of some chunks up to date. Walls are where they will be at the end; so
    /// long `before`, in seconds, they were elsewhere.
    pub(in crate::swarm) fn update_wall_contacts(
        &mut self,
        walls: &dyn StaticGeometry<S>,
        before: S,
        times: [S; 2],
        which: impl Fn(&Chunk<S>) -> bool + Sync,
        only_fast: bool,
    ) {
        self.update_contacts_of(walls, before, times, which, [only_fast, false]);
    }

    fn update_contacts_of(
        &mut self,
        walls: &dyn StaticGeometry<S>,
        before: S,
        times: [S; 2],
        which: impl Fn(&Chunk<S>) -> bool + Sync,
        [only_fast, whole_way]: [bool; 2],
    ) {
        let (proxies, rows) = (&self.proxies[..], &self.scratch.proxy_rows[..]);
        let query = WallQuery {
            tier: self.tier(),
            at: &self.at,
            velocity: &self.velocity,
            skin_left: &self.skin_left,
            surfaces: SurfaceOf {
                model: self.model.material,
                surfaces: &self.surfaces,
                slots: self.ids.slots(),
            },
            before,
            times,
            whole_way,
            gravity: self.gravity.unwrap_or_else(Vec3::zero),
        };
        let chunks = DisjointSlice::new(&mut self.chunks);
        parallel_for(self.scratch.threads, chunks.len(), |_, chunk| {
            // SAFETY: its own.
            let chunk = unsafe { &mut *chunks.row(chunk) };
            if chunk.asleep || !which(chunk) {
                return;
            }
            chunk.update_wall_contacts(walls, &query, only_fast);
            if !rows.is_empty() {
                for contact in &mut chunk.wall_contacts {
                    if let Some(proxy) = Self::proxy_at(proxies, rows, contact.row) {
                        contact.bear(proxy, before);
                    }
                }
            }
        });
    }
}

/// Pass over the contacts with walls of a chunk.
pub(super) struct WallPass<'a> {
    /// Balls that another one hinders to bounce.
    pub held: &'a BitSet,
    pub notes_impacts: bool,
    /// By slot, if recorded, with the slot of each row.
    pub work: DisjointSlice<'a, OutsideWork>,
    pub slots: &'a [u32],
}

impl WallPass<'_> {
    pub fn solve<S: Scalar>(&self, pass: Pass<S>, columns: SolverColumns<S>, chunk: &mut Chunk<S>) {
        for contact in &mut chunk.wall_contacts {
            if matches!(pass, Pass::Restitution(_)) && self.held.contains(contact.row) {
                continue;
            }
            let row = contact.row as usize;
            // SAFETY: a ball of the chunk, and its slot.
            let (at, velocity, spin) = unsafe {
                (
                    &mut *columns.at.row(row),
                    &mut *columns.velocity.row(row),
                    &mut *columns.spin.row(row),
                )
            };
            if velocity[3].is_sign_negative() {
                continue;
            }
            if columns.backed() {
                contact.borne_for_others = contact.share_of(unsafe { &*columns.backing.row(row) });
                contact.note_impact(pass, velocity);
            }
            let before = [*at, *velocity, *spin];
            let bounce = contact.solve(pass, at, velocity, spin);
            if let Some(slot) = self.slots.get(row).filter(|_| !contact.bears_proxy) {
                let work = unsafe { &mut *self.work.row(*slot as usize) };
                work.record_wall(contact, &before[1], velocity);
            }
            let Some(bounce) = bounce else { continue };
            unsafe { *columns.skin_left.row(row) -= bounce.separation };
            chunk.impulses.bounced = true;
            if self.notes_impacts {
                let impact = contact.impact(&bounce, before.each_ref(), velocity);
                chunk.impulses.impacts.push(impact);
            }
        }
    }
}

/// The half-spaces of which the balls near them are listed. The lab's tier looks at all balls.
pub(in crate::swarm) fn listed_planes<S: Scalar>(
    planes: &[HalfSpace<S>],
    tier: Tier,
) -> &[HalfSpace<S>] {
    if tier == Tier::Full { planes } else { &[] }
}
