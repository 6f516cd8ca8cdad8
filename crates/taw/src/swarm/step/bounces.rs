//! Rounds of bounces at the begin of a substep.

use cgmath::InnerSpace;

use super::{ROUNDS, leaves};
use crate::math::{Row, Scalar, Vec3};
use crate::response::Impact;
use crate::swarm::batches::Batch;
use crate::swarm::chunk::Chunk;
use crate::swarm::fast_movers::FastMovers;
use crate::swarm::kernels::{Pass, SolverParams, squared};
use crate::swarm::surfaces::{SurfaceOf, WallNumbers};
use crate::swarm::wall_contact::{WallContact, xyz};
use crate::swarm::walls::find;
use crate::swarm::{Stage, StaticGeometry, Swarm};
use crate::workers::{DisjointSlice, parallel_for};

/// Part of both radii that another ball has to be in the way: balls that lie on each other overlap by
/// less.
const IN_THE_WAY: f64 = 0.9;
/// Way in radii up to which a ball goes through no other one: two that touch, and come as near to each
/// other as [`IN_THE_WAY`] says, are apart by √(1 − .9²) of both radii along the way.
const SHORT: f64 = 0.43;

impl<S: Scalar> Swarm<S> {
    /// Lets bounce what meets in a substep: again where a ball had to wait for another one, and where
    /// one that was struck may reach what is not listed with it yet, a wall say. Given are the seconds of
    /// the step, of a substep, and what is left.
    pub(super) fn bounce(
        &mut self,
        substep: u32,
        times: [S; 3],
        params: SolverParams<S>,
        walls: &dyn StaticGeometry<S>,
        observe: &mut dyn FnMut(Stage),
    ) {
        let speed = params.restitution_threshold;
        let faster = |chunk: &Chunk<S>, next: S| {
            S::from_f64(2.0) * chunk.speed.max(next) + chunk.wall_speed > speed
        };
        let mut all = true;
        for _ in 0..ROUNDS {
            let first =
                |chunk: &mut Chunk<S>| chunk.again = all || std::mem::take(&mut chunk.struck);
            self.chunks.iter_mut().for_each(first);
            let (waits, rebuilds) =
                (self.apply_restitution(params, (walls, times[2]), faster), self.rebuilds);
            let found = self.find_pairs_after_bounces(substep, times, walls, observe);
            if found {
                self.look_ahead_to_shapes(&params, (walls, times[2]), &faster, |_| true);
            }
            if !waits && !found {
                break;
            }
            all = waits || self.rebuilds != rebuilds;
        }
    }

    /// Lets bounce what meets, again where a bounce may have sent a ball on to the next one. Returns
    /// true if one waits for another; pairs have to be found before the next call. Given is how long before
    /// the end of the step the substep begins, in seconds.
    fn apply_restitution(
        &mut self,
        params: SolverParams<S>,
        (walls, left): (&dyn StaticGeometry<S>, S),
        faster: impl Fn(&Chunk<S>, S) -> bool + Sync,
    ) -> bool {
        self.chunks.iter_mut().for_each(|chunk| chunk.struck = false);
        self.scratch.held.clear();
        for _ in 0..ROUNDS {
            self.look_ahead_to_shapes(&params, (walls, left), &faster, |chunk| chunk.again);
            self.list_ways_to_walls(&params, &faster);
            self.hold_obstructed();
            self.pass(Pass::Restitution(params), |chunk, next| chunk.again && faster(chunk, next));
            let all = self.fast_movers.impulses.bounced;
            let bounced =
                |chunk: Option<&Chunk<S>>| chunk.is_some_and(|chunk| chunk.impulses.bounced);
            let mut any = all;
            for i in 0..self.chunks.len() {
                let before = i.checked_sub(1).and_then(|i| self.chunks.get(i));
                let [own, next] = [self.chunks.get(i), self.chunks.get(i + 1)];
                let again = bounced(before) || bounced(own) || bounced(next);
                any |= again;
                self.chunks[i].again = all || again;
                self.chunks[i].struck |= all || again;
            }
            self.note_speeds();
            self.note_impacts();
            self.fast_movers.impulses.bounced = false;
            self.chunks.iter_mut().for_each(|chunk| chunk.impulses.bounced = false);
            if !any {
                break;
            }
        }
        !self.scratch.held.is_empty()
    }

    /// Finds pairs and walls for balls that bounced, and along paths that may have changed since the begin
    /// of the step. Given are its seconds, those of a substep, and what is left. Returns
    /// true if there were such balls.
    fn find_pairs_after_bounces(
        &mut self,
        substep: u32,
        [dt, h, left]: [S; 3],
        walls: &dyn StaticGeometry<S>,
        observe: &mut dyn FnMut(Stage),
    ) -> bool {
        let reach = self.reach_of_skins();
        let leaves = |row: u32, velocity: &Row<S>, skin_left: S, movers: &FastMovers<S>| {
            leaves(velocity, skin_left, left) || skin_left > reach || movers.is_by_path(row)
        };
        let later = substep > 0 && !self.fast_movers.crowded;
        let turns = |chunk: &Chunk<S>| chunk.struck || later && chunk.speed * dt > reach;
        let found = self.find_pairs_within_step(turns, leaves, dt, walls, observe);
        if found {
            self.update_wall_contacts(walls, left, [dt, h], |_| true, false);
        }
        found
    }

    /// Notes how fast the balls are in chunks with a bounce: some may strike what was at rest until now.
    fn note_speeds(&mut self) {
        for chunk in self.chunks.iter_mut().filter(|chunk| chunk.again && !chunk.asleep) {
            let velocities = &self.velocity[chunk.own_rows()];
            let fastest = velocities.iter().fold(S::zero(), |most, v| most.max(squared(*v)));
            chunk.speed = chunk.speed.max(fastest.sqrt());
        }
    }

    /// Moves the impacts of a round to those of the step, by slots: rows may change before it ends.
    fn note_impacts(&mut self) {
        let (slots, impacts) = (self.ids.slots(), &mut self.scratch.impacts);
        let of_chunks = self.chunks.iter_mut().map(|chunk| &mut chunk.impulses.impacts);
        for impact in
            of_chunks.chain([&mut self.fast_movers.impulses.impacts]).flat_map(|l| l.drain(..))
        {
            let slot = |row: u32| slots[row as usize];
            let a = if impact.on_wall { impact.a } else { slot(impact.a) };
            impacts.push(Impact { a, b: slot(impact.b), ..impact });
        }
    }

    /// Finds where balls of some chunks that come fast first touch shapes other than half-spaces.
    fn look_ahead_to_shapes(
        &mut self,
        params: &SolverParams<S>,
        (walls, left): (&dyn StaticGeometry<S>, S),
        faster: &(impl Fn(&Chunk<S>, S) -> bool + Sync),
        which: impl Fn(&Chunk<S>) -> bool + Sync,
    ) {
        if !walls.has_shapes() {
            return;
        }
        let (slots, model) = (self.ids.slots(), self.model.material);
        let surfaces = SurfaceOf { model, surfaces: &self.surfaces, slots };
        let (balls, velocity, count) = (&self.at[..], &self.velocity[..], self.chunks.len());
        let chunks = DisjointSlice::new(&mut self.chunks);
        parallel_for(self.scratch.threads, count, |_, i| {
            // SAFETY: its own. Nobody changes speeds meanwhile.
            let chunk = unsafe { &mut *chunks.row(i) };
            if chunk.asleep || !which(chunk) || !faster(chunk, S::zero()) {
                return;
            }
            let ball = |row: u32| {
                let at = row as usize;
                (&balls[at], &velocity[at], surfaces.filter(row))
            };
            let mut new = Vec::new();
            for contact in &mut chunk.wall_contacts {
                let row = contact.row;
                let is_asleep = velocity[row as usize][3].is_sign_negative();
                if contact.is_plane || contact.bears_proxy || is_asleep {
                    continue;
                }
                let (at, _, filter) = ball(row);
                let way = contact.look_ahead(walls, params, ball(row), left);
                // Another part may come first, which was no contact where the step began.
                let first = way.and_then(|way| walls.first_touch(at, filter, way));
                if let Some((part, normal, distance)) = first {
                    let numbers = WallNumbers::new(surfaces.row(row), walls.material(part[0]));
                    let offset = normal.dot(xyz(at)) - distance;
                    let mut touched = WallContact::new(row, part, normal, offset, numbers);
                    touched.is_plane = false;
                    touched.set_time(walls, at, left);
                    new.push(touched);
                }
            }
            new.retain(|contact| find(&chunk.wall_contacts, contact).is_none());
            if !new.is_empty() {
                chunk.wall_contacts.append(&mut new);
                chunk.wall_contacts.sort_unstable_by_key(WallContact::key);
                chunk.wall_contacts.dedup_by_key(|contact| contact.key());
            }
        });
    }

    /// Lists the balls that would bounce off a wall in this round, if one of them comes from so far away
    /// that another one may be between.
    fn list_ways_to_walls(
        &mut self,
        params: &SolverParams<S>,
        faster: &(impl Fn(&Chunk<S>, S) -> bool + Sync),
    ) {
        let ways = &mut self.scratch.ways_to_walls;
        ways.clear();
        let (at, velocity, chunks) = (&self.at, &self.velocity, &self.chunks);
        let has_ways = |i: usize| {
            let next = chunks.get(i + 1).map_or(S::zero(), |next| next.speed);
            chunks[i].again && !chunks[i].asleep && faster(&chunks[i], next)
        };
        if !(0..chunks.len()).any(has_ways) {
            return;
        }
        let lists = &mut self.scratch.ways_of_chunks;
        lists.resize_with(chunks.len(), Vec::new);
        let of_chunks = DisjointSlice::new(lists);
        parallel_for(self.scratch.threads, chunks.len(), |_, i| {
            // SAFETY: each has its own list.
            let list = unsafe { &mut *of_chunks.row(i) };
            list.clear();
            if !has_ways(i) {
                return;
            }
            list.extend(chunks[i].wall_contacts.iter().filter_map(|contact| {
                let row = contact.row as usize;
                let bounce = contact.bounce(params, &at[row], &velocity[row])?;
                Some(WayToWall::new(contact.row, &at[row], contact.way_nearer(bounce.separation)))
            }));
        });
        for list in lists {
            ways.extend_from_slice(list);
        }
        if !ways.iter().any(WayToWall::is_long) {
            ways.clear();
        }
        ways.sort_unstable_by_key(|way| way.row);
    }

    /// Finds the balls that another one hinders to reach the wall that they would bounce off: it comes
    /// first, so they wait until pairs are found by the velocities that it then has. Of two that fall
    /// one above the other, both would otherwise turn round at the wall, inside each other.
    fn hold_obstructed(&mut self) {
        let (held, ways) = (&mut self.scratch.held, &mut self.scratch.ways_to_walls);
        if ways.is_empty() {
            return;
        }
        let with_ways = &mut self.scratch.with_ways;
        with_ways.clear();
        for way in &*ways {
            with_ways.insert(way.row);
        }
        // Pairs are known of balls that come nearer to each other. Those of a chunk are of its rows and
        // of the next chunk's.
        let first_way = |row: u32| ways.partition_point(|way| way.row < row);
        let has_ways = |chunk: &&Chunk<S>| first_way(chunk.rows[0]) < first_way(chunk.rows[2]);
        let of_chunks = self.chunks.iter().filter(has_ways).flat_map(|chunk| &chunk.batches);
        for [a, b] in of_chunks.chain(&self.fast_movers.batches).flat_map(Batch::pairs) {
            for [row, other] in [[a, b], [b, a]] {
                if !with_ways.contains(row) {
                    continue;
                }
                let mut of_row = ways[first_way(row)..].iter().take_while(|way| way.row == row);
                if of_row.any(|way| way.leads_through(&self.at[other as usize])) {
                    held.insert(row);
                }
            }
        }
        // Those that fly to the wall together are not listed as pairs.
        let axis = widest_axis(ways);
        let low = |way: &WayToWall<S>| way.low[axis];
        ways.sort_unstable_by(|a, b| low(a).total_cmp(&low(b)).then(a.row.cmp(&b.row)));
        for (i, a) in ways.iter().enumerate() {
            for b in ways[i + 1..].iter().take_while(|b| low(b) <= a.high[axis]) {
                for (way, other) in [(a, b), (b, a)] {
                    if way.leads_through(&self.at[other.row as usize]) {
                        held.insert(way.row);
                    }
                }
            }
        }
    }
}

/// Axis along which the balls are spread most.
fn widest_axis<S: Scalar>(ways: &[WayToWall<S>]) -> usize {
    let spread = |axis: usize| {
        let range = ways.iter().fold([S::max_value(), S::min_value()], |[low, high], way| {
            [low.min(way.low[axis]), high.max(way.high[axis])]
        });
        range[1] - range[0]
    };
    let spreads = [0, 1, 2].map(spread);
    (0..3).fold(0, |widest, axis| if spreads[axis] > spreads[widest] { axis } else { widest })
}

/// Straight way of a ball to the wall that it would bounce off.
#[derive(Clone, Copy, Debug)]
pub(in crate::swarm) struct WayToWall<S> {
    row: u32,
    from: Vec3<S>,
    radius: S,
    way: Vec3<S>,
    /// Lowest and highest coordinates of the ball on its way, in metres.
    low: Vec3<S>,
    high: Vec3<S>,
}

impl<S: Scalar> WayToWall<S> {
    fn new(row: u32, at: &Row<S>, way: Vec3<S>) -> Self {
        let (from, radius) = (xyz(at), at[3]);
        let end = |f: fn(S, S) -> S, by: S| from + way.map(|x| f(x, S::zero()) + by);
        let (low, high) = (end(S::min, -radius), end(S::max, radius));
        Self { row, from, radius, way, low, high }
    }

    fn is_long(&self) -> bool {
        self.way.magnitude2() > S::from_f64(SHORT) * S::from_f64(SHORT) * self.radius * self.radius
    }

    /// Returns true if the way leads through another ball.
    fn leads_through(&self, other: &Row<S>) -> bool {
        if !self.is_long() {
            return false;
        }
        let (apart, way) = (xyz(other) - self.from, self.way);
        let fraction = (way.dot(apart) / way.magnitude2()).clamp(S::zero(), S::one());
        let reach = S::from_f64(IN_THE_WAY) * (self.radius + other[3]);
        fraction > S::zero() && (apart - way * fraction).magnitude2() < reach * reach
    }
}
