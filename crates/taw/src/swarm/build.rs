//! Order of the rows, and the search for pairs.

use super::batches::{pairs_in, take_out};
use super::bit_set::BitSet;
use super::chunk::Chunk;
use super::fast_movers::{FastMovers, SortedBalls};
use super::grid::{SortedGrid, reorder, reorder_rows};
use super::impulse_cache::{ImpulseCache, shrink_slack};
use super::kernels::squared;
use super::neighbours::{FindPairs, NeighbourLists, NeighbourSearch};
use super::step::{inverse_masses, listed_planes};
use super::surfaces::SurfaceOf;
use super::sweeps::{BallPaths, CrowdSweep};
use super::{Stage, StaticGeometry, Swarm, walls};
use crate::math::{Scalar, SimdLevel, length};
use crate::workers::{DisjointSlice, parallel_filter, parallel_for, parallel_for_rows};

/// Balls in a chunk at least.
const MIN_CHUNK_ROWS: u32 = 512;
/// Largest displacement between two searches for pairs: as far as a ball goes in this number of steps at
/// its speed,
const STEPS: f64 = 12.0;
/// or this multiple of the skin at most, if it is a fast mover.
const FAR: f64 = 16.0;

/// Where a ball has fewer pairs than this, and pairs are searched again after fewer steps than
/// this, the skin becomes wider by up to this factor.
const SPARSE: f64 = 2.0;
pub(super) const SOON: u32 = 6;
const WIDEST: f64 = 6.0;
/// Largest skin of balls that are no fast movers, in radii: pairs that meet beyond it are looked for
/// along their paths.
const WIDE: f64 = 2.0;

impl<S: Scalar> Swarm<S> {
    /// Sorts the rows and finds all pairs.
    pub(super) fn build(
        &mut self,
        dt: S,
        walls: &dyn StaticGeometry<S>,
        observe: &mut dyn FnMut(Stage),
    ) {
        self.scratch.threads = self.model().threads_for(self.at.len());
        let threads = self.threads();
        self.rebuilds += 1;
        observe(Stage::Pairs);
        let lab = !self.has_friction();
        self.cache_impulses(); // if there are any
        observe(Stage::Order);
        if self.pairs_valid {
            self.adapt_skin();
        }
        self.skin = self.choose_skin(dt);
        let skin = self.skin;
        // The remaining skins lend their column to the order: they are set after that.
        let order = &mut bytemuck::cast_slice_mut(&mut self.skin_left)[..self.at.len()];
        let column = if lab { &mut self.neighbours.0 } else { &mut self.scratch.column };
        self.grid.sort(&self.at, S::from_f64(2.0) * skin, threads, order, column);
        self.reorder();
        self.reset_skins(dt, skin);
        observe(Stage::Pairs);
        self.cut_chunks();
        self.find_pairs(skin, dt, walls);
        self.impulse_cache.shrink_slack();
        self.pairs_valid = true;
        self.forget_cache();
        self.scratch.idle_marked_at = None;
    }

    /// Skin at the usual speed, in metres: displacement of most balls until pairs are searched
    /// again. In the lab's tier a heap is livelier, and a pair more costs less.
    fn margin(&self) -> S {
        self.mean_radius
            * (S::one() + self.skin_scale)
            * if self.has_friction() { S::from_f64(0.2) } else { S::from_f64(0.3) }
    }

    /// Widest skin of a ball that is searched for all around, in metres.
    pub(super) fn reach_of_skins(&self) -> S {
        self.skin * S::from_f64(FAR)
    }

    /// Chooses the Verlet skin: the usual one, or as far as all but the fast movers go in two
    /// steps. A ball that goes further than others look for it would be found inside of them.
    fn choose_skin(&mut self, dt: S) -> S {
        let margin = self.margin();
        if !self.has_friction() {
            return margin;
        }
        let mut displacements = std::mem::take(&mut self.scratch.displacements);
        displacements.clear();
        let displacement = |velocity: &[S; 4]| S::from_f64(2.0) * squared(*velocity).sqrt() * dt;
        displacements.extend(
            self.velocity.iter().map(displacement).filter(|displacement| *displacement > margin),
        );
        let alone = super::fast_movers::max_count(self.at.len());
        let mut skin = margin;
        if displacements.len() > alone {
            let nth = displacements.len() - 1 - alone;
            skin = *displacements.select_nth_unstable_by(nth, S::total_cmp).1;
        }
        self.scratch.displacements = displacements;
        skin.min(S::from_f64(WIDE) * self.mean_radius).max(margin)
    }

    /// Widens the skin where balls leave it soon although few are beside each other.
    fn adapt_skin(&mut self) {
        let sparse = (self.pairs() as f64) < SPARSE * self.len() as f64;
        let target =
            if sparse && self.steps_since_build < SOON { S::from_f64(WIDEST) } else { S::zero() };
        self.skin_scale += (target - self.skin_scale) * S::from_f64(0.3);
        self.steps_since_build = 0;
    }

    /// Sets the remaining skin of each ball: more than the common skin only for fast movers. These
    /// are all that may leave the common skin before pairs are searched again, or, if they are too
    /// many, those that leave it in this step.
    fn reset_skins(&mut self, dt: S, skin: S) {
        self.fast_movers.clear();
        let mut fast = std::mem::take(&mut self.scratch.leaving);
        self.list_fast([dt, skin], None, &mut fast);
        if self.fast_movers.full(fast.len(), self.at.len()) {
            self.list_fast([dt, skin], Some(skin), &mut fast);
        }
        if self.fast_movers.full(fast.len(), self.at.len()) {
            self.fast_movers.crowded = self.has_friction();
            self.list_fast([dt, skin], Some(S::max_value()), &mut fast);
        }
        for row in &fast {
            self.fast_movers.add(*row, self.skin_left[*row as usize] > skin * S::from_f64(FAR));
        }
        self.scratch.leaving = fast;
    }

    /// Sets the remaining skins, and lists the balls whose skin is wider than the common one, no more
    /// than are too many. With `least`, only a ball that goes further in the step, in metres, may
    /// have one.
    fn list_fast(&mut self, [dt, skin]: [S; 2], least: Option<S>, fast: &mut Vec<u32>) {
        let (threads, lab) = (self.threads(), !self.has_friction());
        let (at, velocity, displacement) =
            (&self.at[..], &self.velocity[..], &self.displacement[..]);
        let narrow = if lab { S::from_f64(0.12) } else { S::from_f64(0.08) };
        // More than this are too many.
        let most = self.fast_movers.remaining(self.at.len()) + 1;
        let skins_left = DisjointSlice::new(&mut self.skin_left);
        fast.clear();
        parallel_filter(threads, at.len(), &mut self.scratch.lists, fast, |rows, fast| {
            // SAFETY: each job has its own rows.
            let skins_left = unsafe { skins_left.part(rows.clone()) };
            for (row, skin_left) in rows.zip(skins_left) {
                let path =
                    if lab { S::zero() } else { BallPaths::skin_of_path(&velocity[row], dt) };
                let displacement =
                    if lab { displacement[row] } else { squared(velocity[row]).sqrt() * dt };
                *skin_left = (displacement * S::from_f64(STEPS))
                    .clamp(skin.min(narrow * at[row][3]), skin * S::from_f64(FAR))
                    .max(path);
                if least.is_some_and(|least| path.max(displacement) <= least) {
                    *skin_left = skin_left.min(skin);
                }
                if *skin_left > skin && fast.len() < most {
                    fast.push(row as u32);
                }
            }
        });
    }

    /// Finds pairs for balls that leave their skin, or for all, if these are too many.
    pub(super) fn find_pairs_of(
        &mut self,
        rows: &[u32],
        dt: S,
        walls: &dyn StaticGeometry<S>,
        observe: &mut dyn FnMut(Stage),
    ) {
        if self.fast_movers.full(rows.len(), self.at.len()) {
            return self.build(dt, walls, observe);
        }
        observe(Stage::Pairs);
        let skin = self.skin;
        for row in rows {
            let at = *row as usize;
            let displacement = if self.has_friction() {
                squared(self.velocity[at]).sqrt() * dt
            } else {
                self.displacement[at]
            };
            self.skin_left[at] =
                (displacement * S::from_f64(STEPS)).clamp(skin, skin * S::from_f64(FAR));
            if self.has_friction() {
                let of_path = BallPaths::skin_of_path(&self.velocity[at], dt);
                self.skin_left[at] = self.skin_left[at].max(of_path);
            }
            self.fast_movers.add(*row, self.skin_left[at] > skin * S::from_f64(FAR));
        }
        self.find_fast_movers(skin, dt);
        self.find_wall_contacts_of(rows, dt, walls);
    }

    fn find_fast_movers(&mut self, skin: S, dt: S) {
        let gravity = self.gravity.map_or(S::zero(), length);
        // Solver and gravity bring balls off their straight paths.
        let slack = self.margin() + gravity * dt * dt;
        if self.fast_movers.crowded {
            self.find_crossing_pairs(skin, dt, slack);
        }
        let reach = self.reach_of_skins();
        let (has_friction, search) = (self.has_friction(), &mut self.scratch.searches[0]);
        let (slots, proxies) = (self.ids.slots(), &self.body_slots);
        // Bodies that are rows meet like all others.
        let apart = has_friction && !self.proxies.is_empty();
        let proxy = |row: u32| apart && proxies.contains(slots[row as usize]);
        let surfaces = SurfaceOf { model: self.model.material, surfaces: &self.surfaces, slots };
        let (at, velocity, skin_left) = (&self.at[..], &self.velocity[..], &self.skin_left[..]);
        let sweep = has_friction.then_some(BallPaths { at, velocity, skin_left, dt, reach, slack });
        let balls = SortedBalls { grid: &self.grid, at, skin_left, surfaces, sweep };
        self.fast_movers.find(&balls, self.max_radius + skin, search, &proxy, has_friction);
        if has_friction {
            let FastMovers { batches, impulses, .. } = &mut self.fast_movers;
            impulses.set_numbers(batches, surfaces);
        }
    }

    /// Finds the pairs that meet beyond the reach of skins, where more balls go that far than there
    /// may be fast movers.
    fn find_crossing_pairs(&mut self, skin: S, dt: S, slack: S) {
        let (at, velocity, skin_left) = (&self.at[..], &self.velocity[..], &self.skin_left[..]);
        let axes = self.grid.axes();
        let FastMovers { crossing, .. } = &mut self.fast_movers;
        let crowd = CrowdSweep { at, velocity, dt, skin_left, skin, slack, axes };
        crowd.find(&mut self.scratch.crowd, crossing);
        let (model, slots) = (self.model.material, self.ids.slots());
        let surfaces = SurfaceOf { model, surfaces: &self.surfaces, slots };
        if surfaces.have_filters() {
            crossing.retain(|[a, b]| surfaces.may_collide(*a, *b));
        }
        if self.proxies.len() > 1 {
            let proxy = |row: &u32| self.body_slots.contains(slots[*row as usize]);
            crossing.retain(|pair| !pair.iter().all(proxy));
        }
    }

    fn reorder(&mut self) {
        let (threads, has_friction) = (self.threads(), self.has_friction());
        let order = &bytemuck::cast_slice(&self.skin_left)[..self.at.len()];
        let scratch = if has_friction { &mut self.scratch.column } else { &mut self.neighbours.0 };
        reorder_rows(&mut self.at, scratch, order, threads);
        reorder_rows(&mut self.velocity, scratch, order, threads);
        if has_friction {
            reorder_rows(&mut self.spin, scratch, order, threads);
            reorder(&mut self.old_rows, scratch, order, threads);
            if !self.sleep.rest.time.is_empty() {
                reorder_rows(&mut self.sleep.rest.place, scratch, order, threads);
                reorder(&mut self.sleep.rest.time, scratch, order, threads);
            }
        } else {
            reorder(&mut self.displacement, scratch, order, threads);
        }
        let (slots, rows) = self.ids.columns();
        reorder(slots, scratch, order, threads);
        let (rows, slots) = (DisjointSlice::new(rows), &slots[..]);
        parallel_for_rows(threads, slots.len(), |part| {
            for row in part {
                // SAFETY: a slot is that of one row.
                unsafe { *rows.row(slots[row] as usize) = row as u32 };
            }
        });
    }

    fn cut_chunks(&mut self) {
        let layers = self.grid.layers();
        let (mut layer, mut count) = (0, 0);
        while layer < layers {
            let begin = layer;
            let first = self.grid.first_of_layer(begin);
            while layer < layers && self.grid.first_of_layer(layer) - first < MIN_CHUNK_ROWS {
                layer += 1;
            }
            let next = self.grid.first_of_layer(layer);
            if self.chunks.len() == count {
                self.chunks.push(Chunk::default());
            }
            let chunk = &mut self.chunks[count];
            chunk.layers = [begin, layer];
            chunk.rows = [first, next, next];
            let radii = self.at[first as usize..next as usize].iter().map(|at| at[3]);
            chunk.radii = radii
                .fold([S::max_value(), S::zero()], |[least, most], r| [least.min(r), most.max(r)]);
            chunk.fastest_own = None;
            let velocities = &self.velocity[first as usize..next as usize];
            chunk.sleepers = velocities.iter().filter(|row| row[3].is_sign_negative()).count();
            chunk.asleep = chunk.sleepers == velocities.len();
            (chunk.unread, chunk.sleep_changed) = (chunk.sleepers > 0, chunk.sleepers > 0);
            if chunk.asleep {
                // Nobody looks at it again.
                (chunk.speed, chunk.inverse_masses) = (S::zero(), inverse_masses(velocities));
                chunk.leaving.clear();
            }
            if count > 0 {
                self.chunks[count - 1].rows[2] = next;
            }
            count += 1;
        }
        self.chunks.truncate(count);
    }

    fn find_pairs(&mut self, skin: S, dt: S, walls: &dyn StaticGeometry<S>) {
        let (threads, has_friction, tier) = (self.threads(), self.has_friction(), self.tier());
        let (simd_level, ahead) = (*self.simd_level, self.ahead(dt));
        self.scratch.searches.resize(threads, NeighbourSearch::default());
        let chunks = DisjointSlice::new(&mut self.chunks);
        let searches = DisjointSlice::new(&mut self.scratch.searches);
        let (at, skin_left, slots) = (&self.at[..], &self.skin_left[..], self.ids.slots());
        let (impulse_cache, old_rows, planes) =
            (&self.impulse_cache, &self.old_rows[..], listed_planes(&self.planes, tier));
        let shapes = walls.has_shapes();
        let neighbours = DisjointSlice::new(bytemuck::cast_slice_mut(&mut self.neighbours.0));
        let surfaces = SurfaceOf { model: self.model.material, surfaces: &self.surfaces, slots };
        let balls = walls::Balls { at, velocity: &self.velocity, skin_left, ahead, surfaces };
        let pairs = PairSearch {
            simd_level,
            grid: &self.grid,
            balls,
            skin,
            proxies: (self.proxies.len() > 1).then_some(&self.body_slots),
            cache: has_friction.then_some((impulse_cache, old_rows)),
        };
        parallel_for(threads, chunks.len(), |thread, chunk| {
            // SAFETY: its thread's, and its own.
            let (search, chunk) = unsafe { (&mut *searches.row(thread), &mut *chunks.row(chunk)) };
            // SAFETY: those of its rows.
            let neighbours =
                (!has_friction).then(|| unsafe { neighbours.part(chunk.neighbour_range()) });
            pairs.run(chunk, search, neighbours);
            chunk.find_wall_contacts(simd_level, balls, planes, |contact| {
                has_friction.then(|| impulse_cache.cached_contact(old_rows, contact)).flatten()
            });
            shrink_slack(&mut chunk.wall_contacts);
            chunk.near_shapes.clear();
            chunk.shapes_are_new = shapes;
            if shapes {
                walls::near_shapes(walls, balls, chunk.own_rows(), &mut chunk.near_shapes);
            }
            if has_friction {
                chunk.restore_shape_contacts(|row| impulse_cache.shapes_of(old_rows, row));
            }
        });
        self.find_fast_movers(skin, dt);
        if has_friction {
            let (impulse_cache, fast_movers) = (&self.impulse_cache, &mut self.fast_movers);
            impulse_cache.restore(&fast_movers.batches, &self.old_rows, &mut fast_movers.impulses);
        }
    }
}

/// Search for the pairs of a chunk.
struct PairSearch<'a, S> {
    simd_level: SimdLevel,
    grid: &'a SortedGrid<S>,
    balls: walls::Balls<'a, S>,
    skin: S,
    /// Slots of the proxies, if there are several: they touch each other without the swarm.
    proxies: Option<&'a BitSet>,
    /// Impulses of the last search and the rows of then; only in the full tier.
    cache: Option<(&'a ImpulseCache<S>, &'a [u32])>,
}

impl<S: Scalar> PairSearch<'_, S> {
    /// Finds them, as `neighbours` in the lab's tier, else as batches with their old impulses.
    fn run(
        &self,
        chunk: &mut Chunk<S>,
        search: &mut NeighbourSearch<S>,
        mut neighbours: Option<&mut [u16]>,
    ) {
        let walls::Balls { at, skin_left, surfaces, .. } = self.balls;
        self.simd_level.run(FindPairs {
            grid: self.grid,
            at,
            skin_left,
            skin: self.skin,
            surfaces,
            layers: chunk.layers,
            rows: chunk.rows,
            search,
            unlisted: &mut chunk.unlisted,
            batches: &mut chunk.batches,
            lists: neighbours.as_deref_mut(),
        });
        let (first, rows) = (chunk.rows[0], chunk.rows[1] - chunk.rows[0]);
        let neighbours = neighbours.map(|list| NeighbourLists { first, rows, list });
        if let (Some(_), Some(proxies)) = (self.cache, self.proxies) {
            let proxy = |row: u32| proxies.contains(surfaces.slots[row as usize]);
            take_out(&mut chunk.batches, |pair| pair.into_iter().all(proxy));
        }
        let in_lists =
            neighbours.map_or(0, |neighbours| neighbours.of_rows().map(<[u16]>::len).sum());
        chunk.pairs = in_lists + pairs_in(&chunk.batches);
        shrink_slack(&mut chunk.batches);
        if let Some((cache, old_rows)) = self.cache {
            chunk.impulses.reset(chunk.batches.len());
            chunk.impulses.set_numbers(&chunk.batches, surfaces);
            cache.restore(&chunk.batches, old_rows, &mut chunk.impulses);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use crate::math::{Point3, Vec3};
    use crate::swarm::kernels::squared;
    use crate::swarm::sweeps::BallPaths;
    use crate::swarm::{Ball, Swarm, SwarmModel, Tier};
    use crate::world::{SweptWalls, World};

    /// Every pair that might touch, by asking each ball about each.
    fn by_all(swarm: &Swarm) -> BTreeSet<[u32; 2]> {
        let rows = 0..swarm.at.len() as u32;
        let Swarm { at, velocity, skin_left, .. } = swarm;
        let (dt, reach) = (1.0 / 60.0, swarm.reach_of_skins());
        let sweep = BallPaths { at, velocity, skin_left, dt, reach, slack: 0.0 };
        let near = |[a, b]: &[u32; 2]| {
            if swarm.has_friction() && (sweep.is_swift(*a) || sweep.is_swift(*b)) {
                return sweep.meet(*a, *b); // on their paths
            }
            let (a, b) = (*a as usize, *b as usize);
            let displacement = [0, 1, 2].map(|axis| swarm.at[b][axis] - swarm.at[a][axis]);
            let reach = swarm.at[a][3] + swarm.skin_left[a] + swarm.at[b][3] + swarm.skin_left[b];
            // Less what rounding may take.
            squared([displacement[0], displacement[1], displacement[2], 0.0])
                < reach * reach * (1.0 - 1e-5)
        };
        rows.clone().flat_map(|b| (0..b).map(move |a| [a, b])).filter(near).collect()
    }

    #[test]
    fn no_pair_is_missed_and_no_ball_is_twice_in_a_batch() {
        let cases =
            [0.5_f32, 0.1, 0.01].map(|least| [Tier::Full, Tier::Lab].map(|tier| (least, tier)));
        for (least, tier) in cases.into_iter().flatten() {
            let mut world = World::<f32>::default();
            let model = SwarmModel { tier, threads: 3, ..SwarmModel::default() };
            world.swarm.set_model(model).unwrap();
            let mut seed = 7_u64;
            let mut random = || {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (seed >> 40) as f32 / (1 << 24) as f32
            };
            let mut balls = Vec::new();
            for i in 0..3_000_u16 {
                let place = [20.0, 6.0, 9.0].map(|side| side * random());
                let fast = if i % 200 == 0 { 30.0 } else { 0.02 };
                let velocity = Vec3::new(random(), random(), random()) * fast;
                let radius = 0.5 * (least / 0.5).powf(random());
                balls.push(Ball { velocity, ..Ball::new(Point3::from(place), radius) });
            }
            // And one far out.
            balls.push(Ball::new(Point3::new(1e6, 0.0, 0.0), 0.5));
            world.swarm.insert(&balls).unwrap();
            if tier == Tier::Lab {
                let displacements =
                    balls.iter().map(|ball| crate::math::length(ball.velocity) / 60.0);
                world.swarm.displacement = displacements.collect();
            }
            let walls = SweptWalls::new(&world.walls, 1.0 / 60.0);
            world.swarm.build(1.0 / 60.0, &walls, &mut |_| ());
            let swarm = &world.swarm;
            assert!(swarm.chunks.len() > 3 && !swarm.fast_movers.rows.is_empty());
            let all = &swarm.chunks[..];
            let chunks = all.iter().map(|chunk| &chunk.batches);
            let mut found = BTreeSet::new();
            let lab = tier == Tier::Lab;
            let neighbours = if lab { bytemuck::cast_slice(&swarm.neighbours.0) } else { &[] };
            for chunk in all {
                for (row, neighbours_after) in
                    (chunk.rows[0]..).zip(chunk.neighbours(neighbours).of_rows())
                {
                    for after in neighbours_after {
                        let pair = [row, row + u32::from(*after)];
                        assert!(found.insert(pair), "{pair:?} comes twice");
                    }
                }
            }
            for batch in chunks.chain([&swarm.fast_movers.batches]).flatten() {
                let pairs: Vec<_> =
                    (0..batch.count as usize).map(|lane| batch.pair(lane)).collect();
                let rows: BTreeSet<_> = pairs.iter().flatten().collect();
                assert_eq!(rows.len(), 2 * pairs.len());
                for pair in pairs {
                    assert!(pair[0] < pair[1] && found.insert(pair), "{pair:?} comes twice");
                }
            }
            assert_eq!(swarm.pairs(), found.len());
            let missed: Vec<_> = by_all(swarm).difference(&found).copied().collect();
            assert_eq!(missed, [[0; 2]; 0], "least radius {least}, {tier:?}");
        }
    }
}
