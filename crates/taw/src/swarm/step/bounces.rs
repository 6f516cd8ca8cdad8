//! Rounds of bounces at the begin of a substep.

use cgmath::InnerSpace;

use super::ROUNDS;
use crate::math::Vec3;
use crate::swarm::Swarm;
use crate::swarm::batches::Batch;
use crate::swarm::chunk::Chunk;
use crate::swarm::kernels::{Pass, SolverParams};
use crate::swarm::simd::Row;
use crate::swarm::wall_contact::xyz;

/// Part of both radii that another ball has to be in the way: balls that lie on each other overlap by
/// less.
const IN_THE_WAY: f32 = 0.9;
/// Way in radii up to which a ball goes through no other one: two that touch, and come as near to each
/// other as [`IN_THE_WAY`] says, are apart by √(1 − .9²) of both radii along the way.
const SHORT: f32 = 0.43;

impl Swarm {
    /// Lets bounce what meets, again where a bounce may have sent a ball on to the next one. Returns
    /// true if one waits for another; pairs have to be found before the next call.
    pub(super) fn apply_restitution(
        &mut self,
        params: SolverParams,
        faster: impl Fn(&Chunk, f32) -> bool + Sync,
    ) -> bool {
        self.chunks.iter_mut().for_each(|chunk| (chunk.again, chunk.struck) = (true, false));
        self.scratch.held.clear(0);
        for _ in 0..ROUNDS {
            self.list_ways_to_walls(&params, &faster);
            self.hold_obstructed();
            self.pass(Pass::Restitution(params), |chunk, next| chunk.again && faster(chunk, next));
            let all = self.fast_movers.impulses.bounced;
            let bounced = |chunk: Option<&Chunk>| chunk.is_some_and(|chunk| chunk.impulses.bounced);
            let mut any = all;
            for i in 0..self.chunks.len() {
                let before = i.checked_sub(1).and_then(|i| self.chunks.get(i));
                let [own, next] = [self.chunks.get(i), self.chunks.get(i + 1)];
                let again = bounced(before) || bounced(own) || bounced(next);
                any |= again;
                self.chunks[i].again = all || again;
                self.chunks[i].struck |= all || again;
            }
            self.fast_movers.impulses.bounced = false;
            self.chunks.iter_mut().for_each(|chunk| chunk.impulses.bounced = false);
            if !any {
                break;
            }
        }
        !self.scratch.held.is_empty()
    }

    /// Lists the balls that would bounce off a wall in this round, if one of them comes from so far away
    /// that another one may be between.
    fn list_ways_to_walls(&mut self, params: &SolverParams, faster: &impl Fn(&Chunk, f32) -> bool) {
        let ways = &mut self.scratch.ways_to_walls;
        ways.clear();
        for (i, chunk) in self.chunks.iter().enumerate() {
            let next = self.chunks.get(i + 1).map_or(0.0, |next| next.speed[0]);
            if chunk.asleep || !chunk.again || !faster(chunk, next) {
                continue;
            }
            ways.extend(chunk.wall_contacts.iter().filter_map(|contact| {
                let at = &self.at[contact.row as usize];
                let bounce = contact.bounce(params, at, &self.velocity[contact.row as usize])?;
                Some(WayToWall::new(contact.row, at, contact.normal * -bounce.separation))
            }));
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
        // Pairs are known of balls that come nearer to each other. Those of a chunk are of its rows and
        // of the next chunk's.
        let first_way = |row: u32| ways.partition_point(|way| way.row < row);
        let has_ways = |chunk: &&Chunk| first_way(chunk.rows[0]) < first_way(chunk.rows[2]);
        let of_chunks = self.chunks.iter().filter(has_ways).flat_map(|chunk| &chunk.batches);
        for [a, b] in of_chunks.chain(&self.fast_movers.batches).flat_map(Batch::pairs) {
            for [row, other] in [[a, b], [b, a]] {
                let mut of_row = ways[first_way(row)..].iter().take_while(|way| way.row == row);
                if of_row.any(|way| way.leads_through(&self.at[other as usize])) {
                    held.insert(row);
                }
            }
        }
        // Those that fly to the wall together are not listed as pairs.
        let axis = widest_axis(ways);
        let low = |way: &WayToWall| way.low[axis];
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
fn widest_axis(ways: &[WayToWall]) -> usize {
    let spread = |axis: usize| {
        let range = ways.iter().fold([f32::MAX, f32::MIN], |[low, high], way| {
            [low.min(way.low[axis]), high.max(way.high[axis])]
        });
        range[1] - range[0]
    };
    let spreads = [0, 1, 2].map(spread);
    (0..3).fold(0, |widest, axis| if spreads[axis] > spreads[widest] { axis } else { widest })
}

/// Straight way of a ball to the wall that it would bounce off.
#[derive(Clone, Copy, Debug)]
pub(in crate::swarm) struct WayToWall {
    row: u32,
    from: Vec3<f32>,
    radius: f32,
    way: Vec3<f32>,
    /// Lowest and highest coordinates of the ball on its way, in metres.
    low: Vec3<f32>,
    high: Vec3<f32>,
}

impl WayToWall {
    fn new(row: u32, at: &Row, way: Vec3<f32>) -> Self {
        let (from, radius) = (xyz(at), at[3]);
        let end = |f: fn(f32, f32) -> f32, by: f32| from + way.map(|x| f(x, 0.0) + by);
        let (low, high) = (end(f32::min, -radius), end(f32::max, radius));
        Self { row, from, radius, way, low, high }
    }

    fn is_long(&self) -> bool {
        self.way.magnitude2() > SHORT * SHORT * self.radius * self.radius
    }

    /// Returns true if the way leads through another ball.
    fn leads_through(&self, other: &Row) -> bool {
        if !self.is_long() {
            return false;
        }
        let (apart, way) = (xyz(other) - self.from, self.way);
        let fraction = (way.dot(apart) / way.magnitude2()).clamp(0.0, 1.0);
        let reach = IN_THE_WAY * (self.radius + other[3]);
        fraction > 0.0 && (apart - way * fraction).magnitude2() < reach * reach
    }
}
