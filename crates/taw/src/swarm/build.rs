//! Putting rows in order, and seeking pairs.

use super::batches::{pairs_in, take_out};
use super::grid::{reorder, reorder_rows};
use super::kernels::squared;
use super::memory::fit;
use super::pairs::{Fans, FindPairs, Search};
use super::slab::Slab;
use super::step::listed;
use super::strays::Strays;
use super::surfaces::SurfaceOf;
use super::team::{Shared, each, each_rows, list_rows};
use super::{Stage, Surroundings, Swarm, walls};

/// Balls in a slab at least.
const SLAB: u32 = 512;
/// Way of a ball between two searches at most: as far as it goes in so many steps at its speed,
const STEPS: f32 = 12.0;
/// or so many times as far as the margin at most if it is sought for alone.
const FAR: f32 = 16.0;

/// Where a ball has fewer pairs than this and they are sought again after fewer steps than this,
/// the margin becomes up to so much wider.
const SPARSE: f32 = 2.0;
pub(super) const SOON: u32 = 6;
const WIDEST: f32 = 6.0;
/// Way at most of balls that are not sought for alone, in radii: further they pass through each
/// other.
const WIDE: f32 = 2.0;

impl Swarm {
    /// Seeks pairs anew.
    pub(super) fn build(
        &mut self,
        dt: f32,
        walls: &dyn Surroundings,
        observe: &mut dyn FnMut(Stage),
    ) {
        let threads = self.model.threads as usize;
        self.rebuilds += 1;
        observe(Stage::Pairs);
        if self.rough() {
            self.remember();
        }
        observe(Stage::Order);
        if self.paired {
            self.adapt_margin();
        }
        self.cap = self.find_cap(dt);
        let cap = self.cap;
        // The budgets make room for the order: they are set anew after that.
        let order = bytemuck::cast_slice_mut(&mut self.budget);
        self.grid.sort(&self.at, 2.0 * cap, threads, order, &mut self.spare);
        self.reorder();
        self.set_budgets(dt, cap);
        observe(Stage::Pairs);
        self.cut_slabs();
        self.find_pairs(cap, dt, walls);
        self.memory.fit();
        self.paired = true;
        self.remembers = false;
    }

    /// Way that most balls may go until pairs are sought again, in metres. In the lab's
    /// tier a heap is livelier, and a pair more costs less.
    fn margin(&self) -> f32 {
        self.mean * (1.0 + self.spread) * if self.rough() { 0.2 } else { 0.3 }
    }

    /// The margin, or as far as all but the fastest go in two steps, who are sought for alone: a
    /// ball that goes further than others look for it would be found inside of them.
    fn find_cap(&mut self, dt: f32) -> f32 {
        let margin = self.margin();
        if !self.rough() {
            return margin;
        }
        let mut ways = std::mem::take(&mut self.ways);
        ways.clear();
        let way = |velocity: &[f32; 4]| 2.0 * squared(*velocity).sqrt() * dt;
        ways.extend(self.velocity.iter().map(way).filter(|way| *way > margin));
        let alone = super::strays::room(self.at.len());
        let mut cap = margin;
        if ways.len() > alone {
            let nth = ways.len() - 1 - alone;
            cap = *ways.select_nth_unstable_by(nth, f32::total_cmp).1;
        }
        self.ways = ways;
        cap.min(WIDE * self.mean).max(margin)
    }

    /// Widens the margin where balls leave it soon although few are beside each other.
    fn adapt_margin(&mut self) {
        let sparse = (self.pairs() as f32) < SPARSE * self.len() as f32;
        let wish = if sparse && self.steps_since_build < SOON { WIDEST } else { 0.0 };
        self.spread += (wish - self.spread) * 0.3;
        self.steps_since_build = 0;
    }

    /// Says how far each ball may go: more than the cap only if it is sought for alone.
    fn set_budgets(&mut self, dt: f32, cap: f32) {
        let (threads, lab) = (self.model.threads as usize, !self.rough());
        let (at, velocity, way) = (&self.at[..], &self.velocity[..], &self.way[..]);
        let least = if lab { 0.12 } else { 0.08 };
        self.strays.clear(self.at.len());
        // More than this are too many.
        let most = self.strays.room(self.at.len()) + 1;
        let budgets = Shared::new(&mut self.budget);
        let mut fast = std::mem::take(&mut self.leaving);
        fast.clear();
        list_rows(threads, at.len(), &mut self.lists, &mut fast, |rows, fast| {
            // SAFETY: each job has its own rows.
            let budgets = unsafe { budgets.part(rows.clone()) };
            for (row, budget) in rows.zip(budgets) {
                let way = if lab { way[row] } else { squared(velocity[row]).sqrt() * dt };
                *budget = (way * STEPS).clamp(cap.min(least * at[row][3]), cap * FAR);
                if *budget > cap && fast.len() < most {
                    fast.push(row as u32);
                }
            }
        });
        if self.strays.full(fast.len(), self.at.len()) {
            each_rows(threads, self.at.len(), |rows| {
                // SAFETY: as above.
                let budgets = unsafe { budgets.part(rows) };
                for budget in budgets {
                    *budget = budget.min(cap);
                }
            });
        } else {
            for row in &fast {
                self.strays.add(*row);
            }
        }
        self.leaving = fast;
    }

    /// Seeks pairs for balls that leave their budget, or for all, if these are too many.
    pub(super) fn seek_for(
        &mut self,
        rows: &[u32],
        dt: f32,
        walls: &dyn Surroundings,
        observe: &mut dyn FnMut(Stage),
    ) {
        if self.strays.full(rows.len(), self.at.len()) {
            return self.build(dt, walls, observe);
        }
        observe(Stage::Pairs);
        let cap = self.cap;
        for row in rows {
            self.strays.add(*row);
            let at = *row as usize;
            let way =
                if self.rough() { squared(self.velocity[at]).sqrt() * dt } else { self.way[at] };
            self.budget[at] = (way * STEPS).clamp(cap, cap * FAR);
        }
        self.find_strays(cap);
        self.seek_walls_for(rows, dt, walls);
    }

    fn find_strays(&mut self, cap: f32) {
        let (rough, search) = (self.rough(), &mut self.searches[0]);
        let sizes = [self.largest, cap];
        let (slots, guests) = (self.ids.slots(), &self.guest_slots[..]);
        // Bodies that are hosted meet like all others.
        let apart = rough && !self.guests.is_empty();
        let guest = |row: u32| apart && Self::has_guest_slot(slots[row as usize], guests);
        self.strays.find(&self.grid, &self.at, &self.budget, sizes, search, &guest, rough);
        if rough {
            let surfaces =
                SurfaceOf { model: self.model.material, surfaces: &self.surfaces, slots };
            let Strays { batches, pushes, .. } = &mut self.strays;
            pushes.set_numbers(batches, surfaces);
        }
    }

    fn reorder(&mut self) {
        let (threads, rough) = (self.model.threads as usize, self.rough());
        let (order, spare) = (bytemuck::cast_slice(&self.budget), &mut self.spare);
        reorder_rows(&mut self.at, spare, order, threads);
        reorder_rows(&mut self.velocity, spare, order, threads);
        if rough {
            reorder_rows(&mut self.spin, spare, order, threads);
            reorder(&mut self.before, spare, order, threads);
        } else {
            reorder(&mut self.way, spare, order, threads);
        }
        let (slots, rows) = self.ids.columns();
        reorder(slots, spare, order, threads);
        let (rows, slots) = (Shared::new(rows), &slots[..]);
        each_rows(threads, slots.len(), |part| {
            for row in part {
                // SAFETY: a slot is that of one row.
                unsafe { *rows.row(slots[row] as usize) = row as u32 };
            }
        });
    }

    fn cut_slabs(&mut self) {
        let layers = self.grid.layers();
        let (mut layer, mut count) = (0, 0);
        while layer < layers {
            let begin = layer;
            let first = self.grid.first_of_layer(begin);
            while layer < layers && self.grid.first_of_layer(layer) - first < SLAB {
                layer += 1;
            }
            let next = self.grid.first_of_layer(layer);
            if self.slabs.len() == count {
                self.slabs.push(Slab::default());
            }
            let slab = &mut self.slabs[count];
            slab.layers = [begin, layer];
            slab.rows = [first, next, next];
            slab.slow = 0.0;
            slab.fastest_own = None;
            slab.read_asleep = false;
            let asleep = |row: &[f32; 4]| row[3].is_sign_negative();
            let velocities = &mut self.velocity[first as usize..next as usize];
            slab.asleep = !velocities.is_empty() && velocities.iter().all(asleep);
            if !slab.asleep {
                for velocity in velocities {
                    velocity[3] = velocity[3].abs();
                }
            }
            if count > 0 {
                self.slabs[count - 1].rows[2] = next;
            }
            count += 1;
        }
        self.slabs.truncate(count);
    }

    fn find_pairs(&mut self, cap: f32, dt: f32, walls: &dyn Surroundings) {
        let (threads, rough, tier) = (self.model.threads as usize, self.rough(), self.tier());
        let (instructions, ahead) = (self.instructions, self.ahead(dt));
        self.searches.resize(threads, Search::default());
        let slabs = Shared::new(&mut self.slabs);
        let searches = Shared::new(&mut self.searches);
        let (grid, at, budget) = (&self.grid, &self.at[..], &self.budget[..]);
        let (memory, before, planes) = (&self.memory, &self.before[..], listed(&self.planes, tier));
        let shapes = walls.has_shapes();
        let (slots, guests) = (self.ids.slots(), &self.guest_slots[..]);
        let guest = |row: u32| Self::has_guest_slot(slots[row as usize], guests);
        let several_guests = self.guests.len() > 1;
        let fans = Shared::new(bytemuck::cast_slice_mut(&mut self.spare));
        let surfaces = SurfaceOf { model: self.model.material, surfaces: &self.surfaces, slots };
        let balls = walls::Balls { at, velocity: &self.velocity, budget, ahead, surfaces };
        each(threads, slabs.len(), |thread, slab| {
            // SAFETY: its thread's, and its own.
            let (search, slab) = unsafe { (&mut *searches.row(thread), &mut *slabs.row(slab)) };
            // SAFETY: those of its rows.
            let mut fans = (!rough).then(|| unsafe { fans.part(slab.fans_of_all()) });
            instructions.run(FindPairs {
                grid,
                at,
                budget,
                cap,
                layers: slab.layers,
                rows: slab.rows,
                search,
                unlisted: &mut slab.unlisted,
                batches: &mut slab.batches,
                fans: fans.as_deref_mut(),
            });
            let (first, rows) = (slab.rows[0], slab.rows[1] - slab.rows[0]);
            let fans = fans.map(|list| Fans { first, rows, list });
            if rough && several_guests {
                // They touch each other without the swarm.
                take_out(&mut slab.batches, |pair| pair.into_iter().all(guest));
            }
            let in_fans = fans.map_or(0, |fans| fans.of_rows().map(<[u16]>::len).sum());
            slab.pairs = in_fans + pairs_in(&slab.batches);
            fit(&mut slab.batches);
            if rough {
                slab.pushes.reset(slab.batches.len());
                slab.pushes.set_numbers(&slab.batches, surfaces);
                memory.recall(&slab.batches, before, &mut slab.pushes);
            }
            slab.seek_walls(instructions, balls, planes, |touch| {
                rough.then(|| memory.recall_touch(before, touch)).flatten()
            });
            fit(&mut slab.touches);
            slab.near_shapes.clear();
            if shapes {
                walls::near_shapes(walls, balls, slab.own_rows(), &mut slab.near_shapes);
            }
            if rough {
                slab.recall_shapes(|row| memory.shapes_of(before, row));
            }
        });
        self.find_strays(cap);
        if rough {
            let (memory, strays) = (&self.memory, &mut self.strays);
            memory.recall(&strays.batches, &self.before, &mut strays.pushes);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use crate::math::{Point3, Vec3};
    use crate::swarm::kernels::squared;
    use crate::swarm::{Ball, Swarm, SwarmModel, Tier};
    use crate::world::World;

    /// Every pair that might touch, by asking each ball about each.
    fn by_all(swarm: &Swarm) -> BTreeSet<[u32; 2]> {
        let rows = 0..swarm.at.len() as u32;
        let near = |[a, b]: &[u32; 2]| {
            let (a, b) = (*a as usize, *b as usize);
            let way = [0, 1, 2].map(|axis| swarm.at[b][axis] - swarm.at[a][axis]);
            let reach = swarm.at[a][3] + swarm.budget[a] + swarm.at[b][3] + swarm.budget[b];
            // Less what rounding may take.
            squared([way[0], way[1], way[2], 0.0]) < reach * reach * (1.0 - 1e-5)
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
                let ways = balls.iter().map(|ball| crate::math::length(ball.velocity) / 60.0);
                world.swarm.way = ways.collect();
            }
            world.swarm.build(1.0 / 60.0, &world.walls, &mut |_| ());
            let swarm = &world.swarm;
            assert!(swarm.slabs.len() > 3 && !swarm.strays.rows.is_empty());
            let all = &swarm.slabs[..];
            let slabs = all.iter().map(|slab| &slab.batches);
            let mut found = BTreeSet::new();
            let lab = tier == Tier::Lab;
            let fans = if lab { bytemuck::cast_slice(&swarm.spare) } else { &[] };
            for slab in all {
                for (row, fan) in (slab.rows[0]..).zip(slab.fans(fans).of_rows()) {
                    for after in fan {
                        let pair = [row, row + u32::from(*after)];
                        assert!(found.insert(pair), "{pair:?} comes twice");
                    }
                }
            }
            for batch in slabs.chain([&swarm.strays.batches]).flatten() {
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
