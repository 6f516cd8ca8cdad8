//! Passages through walls: whatever moved a ball in a substep, its core stays on the side of each surface
//! on which it was.

use cgmath::Zero;

use crate::math::{Row, Scalar, Vec3};
use crate::swarm::Swarm;
use crate::swarm::kernels::squared;
use crate::swarm::surfaces::SurfaceOf;
use crate::swarm::wall_contact::WallContact;
use crate::swarm::wall_paths::FAST;
use crate::swarm::walls::{StaticGeometry, plane_contacts_within};
use crate::workers::{DisjointSlice, parallel_for};

/// Place of a ball at the begin of a substep.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::swarm) struct SavedPlace<S> {
    /// Number of the substep.
    substep: u32,
    center: [S; 3],
}

impl<S: Scalar> SavedPlace<S> {
    /// Center at the begin of this substep, if it was saved then.
    pub fn of(&self, substep: u32) -> Option<[S; 3]> {
        (self.substep == substep).then_some(self.center)
    }
}

impl<S: Scalar> Swarm<S> {
    /// Saves where the balls near shapes are, by slot, since rows may change within a substep.
    pub(super) fn save_places(&mut self, walls: &dyn StaticGeometry<S>) {
        if !walls.has_shapes() {
            return;
        }
        self.scratch.places.resize(self.ids.rows().len(), SavedPlace::default());
        self.scratch.substep = self.scratch.substep.wrapping_add(1);
        let (substep, slots, at) = (self.scratch.substep, self.ids.slots(), &self.at[..]);
        let (chunks, places) = (&self.chunks, DisjointSlice::new(&mut self.scratch.places));
        parallel_for(self.scratch.threads, chunks.len(), |_, chunk| {
            let chunk = &chunks[chunk];
            for row in chunk.near_shapes.iter().filter(|_| !chunk.asleep) {
                let [x, y, z, _] = at[*row as usize];
                let slot = slots[*row as usize] as usize;
                // SAFETY: the slot of a ball of the chunk.
                unsafe { *places.row(slot) = SavedPlace { substep, center: [x, y, z] } };
            }
        });
    }

    /// Moves out of walls what is in them, and back what passed one: so long before the end of the step, in
    /// seconds, the substep began, and is now. That comes last: whatever else moves balls apart, nothing is
    /// pressed through a wall.
    pub(super) fn keep_out(&mut self, walls: &dyn StaticGeometry<S>, before_end: [S; 2]) {
        let (at, skin_left) =
            (DisjointSlice::new(&mut self.at), DisjointSlice::new(&mut self.skin_left));
        let (chunks, slots, velocity) = (&self.chunks, self.ids.slots(), &self.velocity[..]);
        let surfaces = SurfaceOf { model: self.model.material, surfaces: &self.surfaces, slots };
        let planes = &self.planes[..];
        let (proxies, proxy_rows) = (&self.proxies[..], &self.scratch.proxy_rows[..]);
        let work = DisjointSlice::new(&mut self.scratch.outside_work);
        let (gravity, h) = (self.gravity.unwrap_or_else(Vec3::zero), before_end[0] - before_end[1]);
        parallel_for(self.scratch.threads, chunks.len(), |_, chunk| {
            let chunk = &chunks[chunk];
            if chunk.asleep {
                return;
            }
            let is_asleep = |row: usize| velocity[row][3].is_sign_negative();
            let keep_out = |contact: &WallContact<S>| {
                let row = contact.row as usize;
                if is_asleep(row) {
                    return;
                }
                // SAFETY: a ball of the chunk, and nobody works on others meanwhile.
                unsafe {
                    let push = contact.keep_out(&mut *at.row(row));
                    *skin_left.row(row) -= push;
                    if work.len() > 0 && !contact.bears_proxy {
                        let work = &mut *work.row(slots[row] as usize);
                        work.record_push(contact, [push, h], velocity[row][3], gravity);
                    }
                }
            };
            chunk.wall_contacts.iter().for_each(keep_out);
            for row in chunk.own_rows() {
                // SAFETY: as above.
                if unsafe { *skin_left.row(row) } < S::zero()
                    && !is_asleep(row)
                    && Self::proxy_at(proxies, proxy_rows, row as u32).is_none()
                {
                    // It was pushed to where nobody looked for walls.
                    // SAFETY: as above.
                    let at = unsafe { *at.row(row) };
                    let visit = |mut contact: WallContact<S>| {
                        contact.set_time(walls, &at, before_end[1]);
                        keep_out(&contact);
                    };
                    plane_contacts_within(S::zero(), row as u32, &at, surfaces, planes, visit);
                }
            }
        });
        self.stop_passages(walls, before_end);
    }

    /// Puts each ball that passed through a surface since places were saved back to it, from where it
    /// slides along it. So long before the end of the step, in seconds, places were saved and balls
    /// are here.
    fn stop_passages(&mut self, walls: &dyn StaticGeometry<S>, before_end: [S; 2]) {
        if !walls.has_shapes() {
            return;
        }
        let (chunks, slots, velocity) = (&self.chunks, self.ids.slots(), &self.velocity[..]);
        let (places, substep) = (&self.scratch.places, self.scratch.substep);
        let (proxies, proxy_rows) = (&self.proxies[..], &self.scratch.proxy_rows[..]);
        let surfaces = SurfaceOf { model: self.model.material, surfaces: &self.surfaces, slots };
        let (at, skin_left) =
            (DisjointSlice::new(&mut self.at), DisjointSlice::new(&mut self.skin_left));
        parallel_for(self.scratch.threads, chunks.len(), |_, chunk| {
            let chunk = &chunks[chunk];
            for row in chunk.near_shapes.iter().filter(|_| !chunk.asleep) {
                let row = *row as usize;
                if velocity[row][3].is_sign_negative() {
                    continue;
                }
                let saved = places.get(slots[row] as usize);
                let Some([x, y, z]) = saved.and_then(|place| place.of(substep)) else {
                    continue; // nobody knew that it is near
                };
                if Self::proxy_at(proxies, proxy_rows, row as u32).is_some() {
                    continue; // the world moves it
                }
                // SAFETY: a ball of the chunk, and nobody works on others meanwhile.
                let (at, skin_left) = unsafe { (&mut *at.row(row), &mut *skin_left.row(row)) };
                let place = [x, y, z, at[3]];
                let gone = distance(at, &place);
                let (far, filter) = (S::from_f64(FAST) * at[3], surfaces.filter(row as u32));
                if gone <= far && !walls.is_outrun(at, gone, filter) {
                    continue;
                }
                if let Some([x, y, z]) = walls.stop_passage([&place, at], filter, before_end) {
                    let slides = surfaces.locked_axes(row as u32).moves_freely();
                    // What has locked axes may not slide as the wall says.
                    let end = if slides { [x, y, z, at[3]] } else { place };
                    *skin_left -= distance(at, &end);
                    *at = end;
                }
            }
        });
    }
}

/// Distance between the centers of two balls, in metres.
fn distance<S: Scalar>(a: &Row<S>, b: &Row<S>) -> S {
    squared([0, 1, 2, 0].map(|axis| b[axis] - a[axis])).sqrt()
}
