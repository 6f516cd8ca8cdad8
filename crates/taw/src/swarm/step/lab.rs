//! A step in the lab's tier: *predict*, *displace*, *update velocities*.

use super::row;
use crate::broad::{CollisionFilter, CollisionLayers, IgnoredPairs};
use crate::math::{Row, Scalar, SimdLevel, Vec3};
use crate::swarm::chunk::Chunk;
use crate::swarm::kernels::{
    Displace, DisplaceFromPlanes, DisplaceNeighbours, Predict, UpdateVelocities,
};
use crate::swarm::proxies::Proxy;
use crate::swarm::walls::HalfSpace;
use crate::swarm::{Stage, StaticGeometry, Swarm};
use crate::workers::{DisjointSlice, parallel_filter, parallel_for_rows};

impl<S: Scalar> Swarm<S> {
    pub(in crate::swarm) fn step_lab(
        &mut self,
        dt: S,
        gravity: Vec3<S>,
        walls: &dyn StaticGeometry<S>,
        walls_changed: bool,
        observe: &mut dyn FnMut(Stage),
    ) {
        observe(Stage::Integrate);
        self.apply_velocity_changes(S::one(), gravity * dt);
        self.predict(dt, gravity);
        self.reset_proxies_in_lab();
        self.find_pairs_after_prediction(dt, walls, walls_changed, observe);
        observe(Stage::Restitute);
        self.list_proxy_rows();
        self.update_wall_contacts(walls, S::zero(), [dt; 2], |_| true, false);
        self.displace();
        observe(Stage::Integrate);
        self.update_velocities(dt);
        self.update_proxy_velocities_in_lab(dt);
    }

    /// Moves all balls on by their velocities, which make room for the positions before, and lists
    /// those that leave their skin.
    fn predict(&mut self, dt: S, gravity: Vec3<S>) {
        let (change, time) = (row(gravity * dt), [dt, dt, dt, S::zero()]);
        let (simd_level, threads) = (*self.simd_level, self.scratch.threads);
        let mut leaving = std::mem::take(&mut self.scratch.leaving);
        leaving.clear();
        // More than this are too many.
        let most = self.fast_movers.remaining(self.at.len()) + 1;
        let at = DisjointSlice::new(&mut self.at);
        let velocity = DisjointSlice::new(&mut self.velocity);
        let displacement = DisjointSlice::new(&mut self.displacement);
        let skin_left = &self.skin_left[..];
        let all_stopped = std::sync::Mutex::new(&mut self.stopped);
        parallel_filter(
            threads,
            at.len(),
            &mut self.scratch.lists,
            &mut leaving,
            |rows, leaving| {
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
                let predict =
                    Predict { at, velocity, displacement, change, time, stopped: stop, first };
                simd_level.run(predict);
                let both = displacement.iter().zip(&skin_left[rows]);
                let leaves =
                    (first..).zip(both).filter(|(_, (displacement, skin))| displacement > skin);
                leaving.extend(leaves.map(|(row, _)| row).take(most));
                if !stopped.is_empty()
                    && let Ok(mut all) = all_stopped.lock()
                {
                    all.append(&mut stopped);
                }
            },
        );
        self.stopped.sort_unstable();
        self.scratch.leaving = leaving;
    }

    /// Finds pairs and walls for the balls that leave their skin, where these are known for others.
    fn find_pairs_after_prediction(
        &mut self,
        dt: S,
        walls: &dyn StaticGeometry<S>,
        walls_changed: bool,
        observe: &mut dyn FnMut(Stage),
    ) {
        let mut leaving = std::mem::take(&mut self.scratch.leaving);
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
        self.scratch.leaving = leaving;
    }

    /// Moves balls out of each other and out of walls.
    fn displace(&mut self) {
        let simd_level = *self.simd_level;
        let rows = std::mem::take(&mut self.scratch.proxy_rows);
        let proxies = std::mem::take(&mut self.proxies);
        let planes = std::mem::take(&mut self.planes);
        let scratch = std::mem::take(&mut self.neighbours.0);
        let neighbours: &[u16] = bytemuck::cast_slice(&scratch);
        let (layers, passing) = (self.layers_by_row(&planes), self.passed_walls_by_row());
        let walls = WallDisplacement {
            simd_level,
            rows: &rows,
            proxies: &proxies,
            planes: &planes,
            layers: &layers,
            passing: &passing,
        };
        for _ in 0..self.model.substeps {
            self.for_each_chunk(|_, columns, chunk| {
                // SAFETY: the job has the balls of the chunk.
                unsafe { walls.apply(chunk, columns.at) };
                let (at, lists) = (columns.at, chunk.neighbours(neighbours));
                simd_level.run(DisplaceNeighbours { at, lists });
                simd_level.run(Displace { at, batches: &chunk.batches });
            });
            let (at, batches) = (DisjointSlice::new(&mut self.at), &self.fast_movers.batches);
            simd_level.run(Displace { at, batches });
        }
        // Walls come last: whatever else moves balls apart, nothing is pressed through one.
        self.for_each_chunk(|_, columns, chunk| {
            // SAFETY: as above.
            unsafe { walls.apply(chunk, columns.at) };
        });
        (self.scratch.proxy_rows, self.proxies) = (rows, proxies);
        (self.planes, self.neighbours.0) = (planes, scratch);
    }

    /// Walls through which proxies pass, by row.
    fn passed_walls_by_row(&self) -> IgnoredPairs {
        let rows = self.ids.rows();
        let walls = self.surfaces.ignored.walls.iter();
        let by_row = walls.filter_map(|[slot, wall]| Some([*rows.get(*slot as usize)?, *wall]));
        IgnoredPairs::new(Vec::new(), by_row.collect())
    }

    /// Layers of all balls by row; none if all balls collide with all half-spaces.
    fn layers_by_row(&self, planes: &[HalfSpace<S>]) -> Vec<CollisionLayers> {
        let surfaces = self.surface_of();
        let differ = |plane: &HalfSpace<S>| plane.layers != CollisionLayers::ALL;
        if surfaces.has_layers() || planes.iter().any(differ) {
            (0..self.at.len() as u32).map(|row| surfaces.layers(row)).collect()
        } else {
            Vec::new()
        }
    }

    /// Makes velocities what positions became.
    fn update_velocities(&mut self, dt: S) {
        let (simd_level, threads) = (*self.simd_level, self.scratch.threads);
        let per_second = [S::one() / dt, S::one() / dt, S::one() / dt, S::zero()];
        let velocity = DisjointSlice::new(&mut self.velocity);
        let skin_left = DisjointSlice::new(&mut self.skin_left);
        let (at, displacement) = (&self.at[..], &self.displacement[..]);
        parallel_for_rows(threads, at.len(), |rows| {
            // SAFETY: each job has its own rows.
            let (velocity, skin_left) =
                unsafe { (velocity.part(rows.clone()), skin_left.part(rows.clone())) };
            let (at, displacement) = (&at[rows.clone()], &displacement[rows]);
            simd_level.run(UpdateVelocities { at, velocity, displacement, skin_left, per_second });
        });
    }
}

/// Displacement of the balls of a chunk out of walls.
struct WallDisplacement<'a, S> {
    simd_level: SimdLevel,
    rows: &'a [(u32, u32)],
    proxies: &'a [Proxy<S>],
    planes: &'a [HalfSpace<S>],
    /// Layers of all balls, if they matter.
    layers: &'a [CollisionLayers],
    passing: &'a IgnoredPairs,
}

impl<S: Scalar> WallDisplacement<'_, S> {
    /// Applies it. The world's solver moves proxies, as deep in walls as it likes: a wall only bears
    /// what the swarm presses on it.
    ///
    /// # Safety
    /// No other thread touches the balls of the chunk meanwhile.
    unsafe fn apply(&self, chunk: &Chunk<S>, all: DisjointSlice<Row<S>>) {
        let Self { rows, proxies, planes, layers, passing, .. } = *self;
        let mut from = chunk.rows[0];
        let its = rows.partition_point(|(row, _)| *row < chunk.rows[0])
            ..rows.partition_point(|(row, _)| *row < chunk.rows[1]);
        for (to, proxy) in rows[its].iter().chain([&(chunk.rows[1], u32::MAX)]) {
            // SAFETY: as the caller promises.
            let at = unsafe { all.part(from as usize..*to as usize) };
            self.displace_from_planes(at, from);
            from = to + 1;
            let Some(proxy) = proxies.get(*proxy as usize) else { continue };
            let layers = layers.get(*to as usize).copied().unwrap_or_default();
            let filter = CollisionFilter { layers, ignored: passing.walls_of(*to) };
            for plane in planes.iter().filter(|plane| filter.meets_wall(plane.wall, plane.layers)) {
                // SAFETY: as above.
                plane.bear(proxy, unsafe { &mut *all.row(*to as usize) });
            }
        }
        for contact in &chunk.wall_contacts {
            // SAFETY: as above.
            contact.displace(unsafe { &mut *all.row(contact.row as usize) });
        }
    }

    /// Moves balls, the first of which is in row `first`, out of the half-spaces that they collide
    /// with: all that come one after another with equal layers at a time.
    fn displace_from_planes(&self, mut at: &mut [Row<S>], first: u32) {
        let Self { simd_level, planes, layers, .. } = *self;
        if layers.is_empty() {
            return simd_level.run(DisplaceFromPlanes { at, planes });
        }
        let mut layers = &layers[first as usize..][..at.len()];
        while let Some(own) = layers.first() {
            let count = layers.iter().take_while(|other| *other == own).count();
            let (alike, more) = at.split_at_mut(count);
            let collides = |plane: &&HalfSpace<S>| plane.layers.interacts_with(*own);
            let planes: Vec<_> = planes.iter().filter(collides).copied().collect();
            simd_level.run(DisplaceFromPlanes { at: alike, planes: &planes });
            (at, layers) = (more, &layers[count..]);
        }
    }
}
