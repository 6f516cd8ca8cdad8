//! Balls at walls: who is near one, and where it is touched.

use cgmath::Zero;

use crate::math::Vec3;
use crate::swarm::slab::Slab;
use crate::swarm::surfaces::SurfaceOf;
use crate::swarm::team::{Shared, each};
use crate::swarm::walls::{Balls, HalfSpace, Look, find, near_shapes, shapes_of};
use crate::swarm::{Stage, Surroundings, Swarm, Tier};

impl Swarm {
    /// Time before a ball can be at a wall from which on it is sought, in seconds; in the lab's
    /// tier, it has moved already.
    pub(in crate::swarm) fn ahead(&self, dt: f32) -> Option<f32> {
        self.rough().then_some(2.0 * dt)
    }

    /// Seeks the balls at walls anew, if one of these changed.
    pub(in crate::swarm) fn seek_walls_that_moved(
        &mut self,
        changed: bool,
        dt: f32,
        walls: &dyn Surroundings,
        observe: &mut dyn FnMut(Stage),
    ) {
        if changed {
            observe(Stage::Walls);
            self.seek_walls(dt, walls);
        }
    }

    /// Seeks the balls at walls anew, where pairs are still known.
    pub(in crate::swarm) fn seek_walls(&mut self, dt: f32, walls: &dyn Surroundings) {
        let (instructions, shapes) = (self.instructions, walls.has_shapes());
        let (planes, ahead) = (listed(&self.planes, self.tier()), self.ahead(dt));
        let (at, budget) = (&self.at[..], &self.budget[..]);
        let balls = Balls {
            at,
            velocity: &self.velocity,
            budget,
            ahead,
            surfaces: SurfaceOf {
                model: self.model.material,
                surfaces: &self.surfaces,
                slots: self.ids.slots(),
            },
        };
        let slabs = Shared::new(&mut self.slabs);
        each(self.model.threads as usize, slabs.len(), |_, slab| {
            // SAFETY: its own.
            let slab = unsafe { &mut *slabs.row(slab) };
            let old = std::mem::take(&mut slab.touches);
            slab.touches = std::mem::take(&mut slab.old_touches);
            slab.seek_walls(instructions, balls, planes, |touch| find(&old, touch).copied());
            slab.near_shapes.clear();
            if shapes {
                near_shapes(walls, balls, slab.own_rows(), &mut slab.near_shapes);
            }
            slab.recall_shapes(|row| shapes_of(&old, row).copied());
            slab.old_touches = old;
        });
    }

    /// Seeks the walls of some more balls, in order of their rows.
    pub(in crate::swarm) fn seek_walls_for(
        &mut self,
        rows: &[u32],
        dt: f32,
        walls: &dyn Surroundings,
    ) {
        let ahead = self.ahead(dt);
        let planes = listed(&self.planes, self.tier());
        let (at, budget) = (&self.at[..], &self.budget[..]);
        let surfaces = SurfaceOf {
            model: self.model.material,
            surfaces: &self.surfaces,
            slots: self.ids.slots(),
        };
        let balls = Balls { at, velocity: &self.velocity, budget, ahead, surfaces };
        for slab in &mut self.slabs {
            let mine = slab.own_rows();
            let mine = rows.partition_point(|row| (*row as usize) < mine.start)
                ..rows.partition_point(|row| (*row as usize) < mine.end);
            if mine.is_empty() {
                continue;
            }
            slab.seek_walls_for(&rows[mine.clone()], balls, planes);
            if walls.has_shapes() {
                for row in &rows[mine] {
                    let row = *row as usize;
                    near_shapes(walls, balls, row..row + 1, &mut slab.near_shapes);
                }
                slab.near_shapes.sort_unstable();
                slab.near_shapes.dedup();
            }
        }
    }

    /// Brings the touches of some slabs up to date. Walls are where they will be at the end; so long
    /// `before`, in seconds, they were elsewhere.
    pub(in crate::swarm) fn look_at_walls(
        &mut self,
        walls: &dyn Surroundings,
        before: f32,
        times: [f32; 2],
        which: impl Fn(&Slab) -> bool + Sync,
        only_fast: bool,
    ) {
        let (guests, rows) = (&self.guests[..], &self.guest_rows[..]);
        let look = Look {
            tier: self.tier(),
            at: &self.at,
            velocity: &self.velocity,
            budget: &self.budget,
            surfaces: SurfaceOf {
                model: self.model.material,
                surfaces: &self.surfaces,
                slots: self.ids.slots(),
            },
            before,
            times,
            gravity: self.gravity.unwrap_or_else(Vec3::zero),
        };
        let slabs = Shared::new(&mut self.slabs);
        each(self.model.threads as usize, slabs.len(), |_, slab| {
            // SAFETY: its own.
            let slab = unsafe { &mut *slabs.row(slab) };
            if slab.asleep || !which(slab) {
                return;
            }
            slab.look_at_walls(walls, &look, only_fast);
            if !rows.is_empty() {
                for touch in &mut slab.touches {
                    if let Some(guest) = Self::guest_at(guests, rows, touch.row) {
                        touch.bear(guest, before);
                    }
                }
            }
        });
    }
}

/// The half-spaces of which the balls near them are listed. The lab's tier looks at all balls.
pub(in crate::swarm) fn listed(planes: &[HalfSpace], tier: Tier) -> &[HalfSpace] {
    if tier == Tier::Full { planes } else { &[] }
}
