//! A step in the lab's tier.

use super::row;
use crate::math::Vec3;
use crate::swarm::kernels::{Displace, DisplaceFans, DisplaceFromPlanes, Follow, Predict};
use crate::swarm::lanes::Row;
use crate::swarm::slab::Slab;
use crate::swarm::team::{Shared, each_rows, list_rows};
use crate::swarm::{Stage, Surroundings, Swarm};

impl Swarm {
    pub(in crate::swarm) fn step_lab(
        &mut self,
        dt: f32,
        gravity: Vec3<f32>,
        walls: &dyn Surroundings,
        walls_changed: bool,
        observe: &mut dyn FnMut(Stage),
    ) {
        let threads = self.model.threads as usize;
        observe(Stage::Integrate);
        let (change, time) = (row(gravity * dt), [dt, dt, dt, 0.0]);
        let instructions = self.instructions;
        let mut leaving = std::mem::take(&mut self.leaving);
        leaving.clear();
        // More than this are too many.
        let most = self.strays.room(self.at.len()) + 1;
        {
            let (at, velocity) = (Shared::new(&mut self.at), Shared::new(&mut self.velocity));
            let (way, budget) = (Shared::new(&mut self.way), &self.budget[..]);
            let all_stopped = std::sync::Mutex::new(&mut self.stopped);
            list_rows(threads, at.len(), &mut self.lists, &mut leaving, |rows, leaving| {
                let mut stopped = Vec::new();
                // SAFETY: each job has its own rows.
                let (at, velocity, way) = unsafe {
                    (at.part(rows.clone()), velocity.part(rows.clone()), way.part(rows.clone()))
                };
                let (stop, first) = (&mut stopped, rows.start as u32);
                instructions.run(Predict { at, velocity, way, change, time, stopped: stop, first });
                let both = way.iter().zip(&budget[rows]);
                let leaves = (first..).zip(both).filter(|(_, (way, budget))| way > budget);
                leaving.extend(leaves.map(|(row, _)| row).take(most));
                if !stopped.is_empty()
                    && let Ok(mut all) = all_stopped.lock()
                {
                    all.append(&mut stopped);
                }
            });
            self.stopped.sort_unstable();
        }
        self.hold_guests_in_lab();
        leaving.retain(|row| self.way[*row as usize] > self.budget[*row as usize]);
        if !self.paired || !leaving.is_empty() {
            self.stopped = self.stopped.iter().map(|row| self.ids.slots()[*row as usize]).collect();
            if self.paired {
                let rebuilds = self.rebuilds;
                self.seek_for(&leaving, dt, walls, observe);
                let moved = walls_changed && self.rebuilds == rebuilds;
                self.seek_walls_that_moved(moved, dt, walls, observe);
            } else {
                self.build(dt, walls, observe);
            }
            let rows = self.ids.columns().1;
            self.stopped.iter_mut().for_each(|slot| *slot = rows[*slot as usize]);
        } else {
            self.seek_walls_that_moved(walls_changed, dt, walls, observe);
        }
        self.leaving = leaving;
        observe(Stage::Restitute);
        self.find_guests();
        self.look_at_walls(walls, 0.0, [dt; 2], |_| true, false);
        let (guests, planes) =
            (std::mem::take(&mut self.guest_rows), std::mem::take(&mut self.planes));
        let named = std::mem::take(&mut self.guests);
        let spare = std::mem::take(&mut self.spare);
        let fans: &[u16] = bytemuck::cast_slice(&spare);
        // SAFETY: the caller has the balls of the slab.
        let displace_from_walls = |slab: &Slab, all: Shared<Row>| unsafe {
            // Others move the guests, as deep in walls as they like: a wall only bears what the
            // swarm presses on it.
            let mut from = slab.rows[0];
            let its = guests.partition_point(|(row, _)| *row < slab.rows[0])
                ..guests.partition_point(|(row, _)| *row < slab.rows[1]);
            for (to, guest) in guests[its].iter().chain([&(slab.rows[1], u32::MAX)]) {
                let at = all.part(from as usize..*to as usize);
                instructions.run(DisplaceFromPlanes { at, planes: &planes });
                from = to + 1;
                let Some(guest) = named.get(*guest as usize) else { continue };
                for plane in &planes {
                    plane.bear(guest, &mut *all.row(*to as usize));
                }
            }
            for touch in &slab.touches {
                touch.displace(&mut *all.row(touch.row as usize));
            }
        };
        for _ in 0..self.model.substeps {
            self.each_slab(|_, columns, slab| {
                displace_from_walls(slab, columns.at);
                let (at, fans) = (columns.at, slab.fans(fans));
                instructions.run(DisplaceFans { at, fans });
                instructions.run(Displace { at, batches: &slab.batches });
            });
            let (at, batches) = (Shared::new(&mut self.at), &self.strays.batches);
            instructions.run(Displace { at, batches });
        }
        // Walls have the last word: whoever else moves balls apart, nothing is pressed through one.
        self.each_slab(|_, columns, slab| {
            displace_from_walls(slab, columns.at);
        });
        (self.guest_rows, self.planes, self.spare) = (guests, planes, spare);
        self.guests = named;
        observe(Stage::Integrate);
        let per_second = [1.0 / dt, 1.0 / dt, 1.0 / dt, 0.0];
        let (velocity, budget) = (Shared::new(&mut self.velocity), Shared::new(&mut self.budget));
        let (at, way) = (&self.at[..], &self.way[..]);
        each_rows(threads, at.len(), |rows| {
            // SAFETY: each job has its own rows.
            let (velocity, budget) =
                unsafe { (velocity.part(rows.clone()), budget.part(rows.clone())) };
            let (at, way) = (&at[rows.clone()], &way[rows]);
            instructions.run(Follow { at, velocity, way, budget, per_second });
        });
        self.part_with_guests_in_lab(dt);
    }
}
