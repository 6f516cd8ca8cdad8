//! A step in the lab's tier.

use super::row;
use crate::math::Vec3;
use crate::swarm::chunk::Chunk;
use crate::swarm::kernels::{
    Displace, DisplaceFromPlanes, DisplaceNeighbours, Predict, UpdateVelocities,
};
use crate::swarm::simd::Row;
use crate::swarm::workers::{DisjointSlice, parallel_filter, parallel_for_rows};
use crate::swarm::{Stage, StaticGeometry, Swarm};

impl Swarm {
    pub(in crate::swarm) fn step_lab(
        &mut self,
        dt: f32,
        gravity: Vec3<f32>,
        walls: &dyn StaticGeometry,
        walls_changed: bool,
        observe: &mut dyn FnMut(Stage),
    ) {
        let threads = self.model.threads as usize;
        observe(Stage::Integrate);
        let (change, time) = (row(gravity * dt), [dt, dt, dt, 0.0]);
        let simd_level = self.simd_level;
        let mut leaving = std::mem::take(&mut self.leaving);
        leaving.clear();
        // More than this are too many.
        let most = self.fast_movers.remaining(self.at.len()) + 1;
        {
            let (at, velocity) =
                (DisjointSlice::new(&mut self.at), DisjointSlice::new(&mut self.velocity));
            let (displacement, skin_left) =
                (DisjointSlice::new(&mut self.displacement), &self.skin_left[..]);
            let all_stopped = std::sync::Mutex::new(&mut self.stopped);
            parallel_filter(threads, at.len(), &mut self.lists, &mut leaving, |rows, leaving| {
                let mut stopped = Vec::new();
                // SAFETY: each job has its own rows.
                let (at, velocity, displacement) = unsafe {
                    (
                        at.part(rows.clone()),
                        velocity.part(rows.clone()),
                        displacement.part(rows.clone()),
                    )
                };
                let (stop, first) = (&mut stopped, rows.start as u32);
                simd_level.run(Predict {
                    at,
                    velocity,
                    displacement,
                    change,
                    time,
                    stopped: stop,
                    first,
                });
                let both = displacement.iter().zip(&skin_left[rows]);
                let leaves = (first..)
                    .zip(both)
                    .filter(|(_, (displacement, skin_left))| displacement > skin_left);
                leaving.extend(leaves.map(|(row, _)| row).take(most));
                if !stopped.is_empty()
                    && let Ok(mut all) = all_stopped.lock()
                {
                    all.append(&mut stopped);
                }
            });
            self.stopped.sort_unstable();
        }
        self.reset_proxies_in_lab();
        leaving.retain(|row| self.displacement[*row as usize] > self.skin_left[*row as usize]);
        if !self.pairs_valid || !leaving.is_empty() {
            self.stopped = self.stopped.iter().map(|row| self.ids.slots()[*row as usize]).collect();
            if self.pairs_valid {
                let rebuilds = self.rebuilds;
                self.find_pairs_of(&leaving, dt, walls, observe);
                let moved = walls_changed && self.rebuilds == rebuilds;
                self.find_wall_contacts_if_changed(moved, dt, walls, observe);
            } else {
                self.build(dt, walls, observe);
            }
            let rows = self.ids.columns().1;
            self.stopped.iter_mut().for_each(|slot| *slot = rows[*slot as usize]);
        } else {
            self.find_wall_contacts_if_changed(walls_changed, dt, walls, observe);
        }
        self.leaving = leaving;
        observe(Stage::Restitute);
        self.list_proxy_rows();
        self.update_wall_contacts(walls, 0.0, [dt; 2], |_| true, false);
        let (proxies, planes) =
            (std::mem::take(&mut self.proxy_rows), std::mem::take(&mut self.planes));
        let named = std::mem::take(&mut self.proxies);
        let scratch = std::mem::take(&mut self.scratch);
        let neighbours: &[u16] = bytemuck::cast_slice(&scratch);
        // SAFETY: the caller has the balls of the chunk.
        let displace_from_walls = |chunk: &Chunk, all: DisjointSlice<Row>| unsafe {
            // Others move the proxies, as deep in walls as they like: a wall only bears what the
            // swarm presses on it.
            let mut from = chunk.rows[0];
            let its = proxies.partition_point(|(row, _)| *row < chunk.rows[0])
                ..proxies.partition_point(|(row, _)| *row < chunk.rows[1]);
            for (to, proxy) in proxies[its].iter().chain([&(chunk.rows[1], u32::MAX)]) {
                let at = all.part(from as usize..*to as usize);
                simd_level.run(DisplaceFromPlanes { at, planes: &planes });
                from = to + 1;
                let Some(proxy) = named.get(*proxy as usize) else { continue };
                for plane in &planes {
                    plane.bear(proxy, &mut *all.row(*to as usize));
                }
            }
            for contact in &chunk.wall_contacts {
                contact.displace(&mut *all.row(contact.row as usize));
            }
        };
        for _ in 0..self.model.substeps {
            self.for_each_chunk(|_, columns, chunk| {
                displace_from_walls(chunk, columns.at);
                let (at, neighbours) = (columns.at, chunk.neighbours(neighbours));
                simd_level.run(DisplaceNeighbours { at, lists: neighbours });
                simd_level.run(Displace { at, batches: &chunk.batches });
            });
            let (at, batches) = (DisjointSlice::new(&mut self.at), &self.fast_movers.batches);
            simd_level.run(Displace { at, batches });
        }
        // Walls have the last word: whoever else moves balls apart, nothing is pressed through one.
        self.for_each_chunk(|_, columns, chunk| {
            displace_from_walls(chunk, columns.at);
        });
        (self.proxy_rows, self.planes, self.scratch) = (proxies, planes, scratch);
        self.proxies = named;
        observe(Stage::Integrate);
        let per_second = [1.0 / dt, 1.0 / dt, 1.0 / dt, 0.0];
        let (velocity, skin_left) =
            (DisjointSlice::new(&mut self.velocity), DisjointSlice::new(&mut self.skin_left));
        let (at, displacement) = (&self.at[..], &self.displacement[..]);
        parallel_for_rows(threads, at.len(), |rows| {
            // SAFETY: each job has its own rows.
            let (velocity, skin_left) =
                unsafe { (velocity.part(rows.clone()), skin_left.part(rows.clone())) };
            let (at, displacement) = (&at[rows.clone()], &displacement[rows]);
            simd_level.run(UpdateVelocities { at, velocity, displacement, skin_left, per_second });
        });
        self.update_proxy_velocities_in_lab(dt);
    }
}
