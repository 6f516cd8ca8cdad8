//! Contacts around balls that sink, and the balls that they are between.

use std::collections::VecDeque;

use cgmath::{EuclideanSpace, InnerSpace, Zero};

use crate::broad::Period;
use crate::constraint::ContactImpulse;
use crate::math::{Point3, Row, Scalar, Vec3, cast_vector};
use crate::motion::LockedAxes;
use crate::response::SolverBodies;
use crate::response::impulse::VelocityContact;
use crate::swarm::batches::Batch;
use crate::swarm::bit_set::BitSet;
use crate::swarm::kernels::{ContactImpulses, Sinking, SolverParams};
use crate::swarm::wall_contact::xyz;
use crate::swarm::{INFINITE_MASS, Swarm};

/// Number of balls, and of pairs, with which a cluster is full: as many as a game has time for in a substep.
/// Clusters of a thousand take longer and leave as many overlaps.
const MAX_COUNT: usize = 256;

/// Contact of a cluster in the lists of the swarm.
#[derive(Clone, Copy, Debug)]
pub(super) enum ContactLocation<S> {
    Pair(PairPlace),
    /// Chunk and number; and the impulse that it has borne for others, if it is the one behind the ball.
    Wall([usize; 2], Option<S>),
}

/// Place of a pair: its chunk, or one more than the last for those of fast movers; batch and lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct PairPlace {
    pub list: usize,
    pub batch: usize,
    pub lane: usize,
}

/// Contacts that are solved together, and their balls in the order of rows.
#[derive(Debug, Default)]
pub(super) struct UnconvergedCluster<S> {
    /// Those with walls come first.
    pub contacts: Vec<VelocityContact<f64>>,
    pub locations: Vec<ContactLocation<S>>,
    pub rows: Vec<u32>,
    pub position: Vec<Point3<f64>>,
    pub velocity: Vec<Vec3<f64>>,
    pub radius: Vec<f64>,
    pub inverse_mass: Vec<f64>,
    pub spin: Vec<Vec3<f64>>,
    pub locked: Vec<bool>,
    pub locked_axes: Vec<LockedAxes>,
}

/// Pairs of some rows: batch and lane.
struct PairsByRow {
    first_row: u32,
    /// Beginning of each row's pairs, and the end.
    start: Vec<u32>,
    pairs: Vec<[u32; 2]>,
}

impl PairsByRow {
    fn new(batches: &[Batch], [first_row, end]: [u32; 2]) -> Self {
        let mut start = vec![0; (end - first_row) as usize + 2];
        let place = |row: u32| (row - first_row) as usize + 1;
        for row in batches.iter().flat_map(Batch::pairs).flatten() {
            start[place(row) + 1] += 1;
        }
        let mut sum = 0;
        for start in &mut start {
            sum += *start;
            *start = sum;
        }
        // As pairs are placed, each start grows to the one after it.
        let mut pairs = vec![[0; 2]; sum as usize];
        for (batch, of_batch) in (0..).zip(batches) {
            for (lane, rows) in (0..).zip(of_batch.pairs()) {
                for row in rows {
                    pairs[start[place(row)] as usize] = [batch, lane];
                    start[place(row)] += 1;
                }
            }
        }
        Self { first_row, start, pairs }
    }

    fn of(&self, row: u32) -> &[[u32; 2]] {
        let place = (row - self.first_row) as usize;
        &self.pairs[self.start[place] as usize..self.start[place + 1] as usize]
    }
}

impl<S: Scalar> UnconvergedCluster<S> {
    /// Collects the contacts around some balls that sink: those that bear something, or may close within a
    /// substep. Pairs that then bounce are left out.
    pub fn new(swarm: &Swarm<S>, sinking: &[Sinking<S>], params: &SolverParams<S>) -> Self {
        let (balls, pairs) = swarm.pairs_around(sinking, params);
        let mut cluster = Self::default();
        cluster.rows.extend(balls.iter().map(|ball| ball.row));
        cluster.rows.extend(pairs.iter().flat_map(|(_, rows)| rows));
        cluster.rows.sort_unstable();
        cluster.rows.dedup();
        cluster.add_balls(swarm);
        for ball in balls {
            cluster.add_walls(swarm, ball, params);
        }
        for (place, rows) in pairs {
            cluster.add_pair(swarm, place, rows, params);
        }
        cluster
    }

    pub fn bodies(&mut self) -> SolverBodies<'_, f64> {
        SolverBodies {
            period: Period::default(),
            position: &mut self.position,
            velocity: &mut self.velocity,
            radius: &self.radius,
            inverse_mass: &self.inverse_mass,
            spin: &mut self.spin,
            rotation_locked: &self.locked,
            locked_axes: &self.locked_axes,
            capsules: &[],
        }
    }

    /// Index of a ball in the cluster.
    fn local_index(&self, row: u32) -> u32 {
        self.rows.partition_point(|other| *other < row) as u32
    }

    fn add_balls(&mut self, swarm: &Swarm<S>) {
        let (vector, surfaces) =
            (|row: &Row<S>| cast_vector::<S, f64>(xyz(row)), swarm.surface_of());
        for row in &self.rows {
            let (at, spin) = (swarm.at[*row as usize], swarm.spin[*row as usize]);
            let radius = at[3].as_f64();
            self.position.push(Point3::from_vec(vector(&at)));
            self.radius.push(radius);
            self.velocity.push(vector(&swarm.velocity[*row as usize]));
            self.inverse_mass.push(swarm.free_inverse_mass(*row).as_f64());
            self.spin.push(vector(&spin) / radius);
            self.locked.push(surfaces.row(*row).rotation_locked);
            self.locked_axes.push(surfaces.locked_axes(*row));
        }
    }

    fn add_walls(&mut self, swarm: &Swarm<S>, ball: Sinking<S>, params: &SolverParams<S>) {
        let chunk = swarm.chunk_of(ball.row);
        let all = &swarm.chunks[chunk].wall_contacts;
        let first = all.partition_point(|contact| contact.row < ball.row);
        let at = &swarm.at[ball.row as usize];
        let mut backing = swarm.scratch.backing[ball.row as usize];
        for (i, contact) in all.iter().enumerate().skip(first) {
            if contact.row != ball.row {
                break;
            }
            // The first one with this normal bears it all.
            let is_behind = backing != [S::zero(); 4] && xyz(&backing) == contact.normal;
            let share = is_behind.then(|| std::mem::take(&mut backing)[3].max(S::zero()));
            if contact.share() == S::zero() {
                continue; // a lock bears it
            }
            let normal_impulse = contact.impulse.normal + share.unwrap_or_default();
            let separation = contact.separation(at);
            if normal_impulse == S::zero()
                && separation > S::from_f64(2.0) * ball.approach_speed * params.time
            {
                continue;
            }
            self.locations.push(ContactLocation::Wall([chunk, i], share));
            self.contacts.push(VelocityContact {
                a: None,
                b: self.local_index(ball.row),
                normal: cast_vector(contact.normal),
                surface_velocity: cast_vector(contact.surface),
                target_normal_velocity: (-separation.max(S::zero()) / params.time).as_f64(),
                friction: contact.numbers.friction.as_f64(),
                impulse: ContactImpulse {
                    normal: normal_impulse.as_f64(),
                    tangent: cast_vector(contact.impulse.tangent),
                },
            });
        }
    }

    fn add_pair(
        &mut self,
        swarm: &Swarm<S>,
        place: PairPlace,
        rows: [u32; 2],
        params: &SolverParams<S>,
    ) {
        let [a, b] = rows.map(|row| self.local_index(row));
        let displacement = self.position[b as usize] - self.position[a as usize];
        let distance = displacement.magnitude();
        let gives = |i: u32| {
            let share: f64 = self.locked_axes[i as usize].share(displacement / distance);
            share * self.inverse_mass[i as usize]
        };
        if gives(a) + gives(b) == 0.0 {
            return; // locks bear it
        }
        let separation = distance - self.radius[a as usize] - self.radius[b as usize];
        self.locations.push(ContactLocation::Pair(place));
        self.contacts.push(VelocityContact {
            a: Some(a),
            b,
            normal: displacement / distance,
            surface_velocity: Vec3::zero(),
            target_normal_velocity: -separation.max(0.0) / params.time.as_f64(),
            friction: swarm.pair_friction(place),
            impulse: swarm.pair_impulse(place),
        });
    }
}

impl<S: Scalar> Swarm<S> {
    /// Balls around some that sink, the nearest ones first, and the pairs between them. Each has the speed at
    /// which the one sinks that it is near.
    fn pairs_around(
        &self,
        sinking: &[Sinking<S>],
        params: &SolverParams<S>,
    ) -> (Vec<Sinking<S>>, Vec<(PairPlace, [u32; 2])>) {
        let (mut queue, mut queued) = (VecDeque::<Sinking<S>>::new(), BitSet::default());
        let mut is_new = |ball: &&Sinking<S>| {
            self.free_inverse_mass(ball.row) > S::zero() && queued.insert(ball.row)
        };
        // Those that need the largest impulses come first, whatever row they are in.
        let mut sinking = sinking.to_vec();
        let impulse =
            |ball: &Sinking<S>| ball.approach_speed / self.velocity[ball.row as usize][3].abs();
        sinking.sort_by(|a, b| impulse(b).total_cmp(&impulse(a)).then(a.row.cmp(&b.row)));
        queue.extend(sinking.iter().filter(&mut is_new));
        let (mut balls, mut pairs, mut done) = (Vec::new(), Vec::new(), BitSet::default());
        let mut lists: Vec<Option<PairsByRow>> = Vec::new();
        lists.resize_with(self.chunks.len() + 1, || None);
        while let Some(ball) = queue.pop_front() {
            if balls.len().max(pairs.len()) >= MAX_COUNT {
                break;
            }
            balls.push(ball);
            done.insert(ball.row);
            let own = self.chunk_of(ball.row);
            let near = [own.checked_sub(1), Some(own), Some(self.chunks.len())];
            for list in near.into_iter().flatten() {
                let batches = self.pairs_of_list(list).0;
                if batches.is_empty() {
                    continue;
                }
                let by_row = lists[list].get_or_insert_with(|| self.pairs_by_row(list));
                for [batch, lane] in by_row.of(ball.row).iter().map(|at| at.map(|x| x as usize)) {
                    let place = PairPlace { list, batch, lane };
                    let rows = batches[batch].pair(lane);
                    let other = if rows[0] == ball.row { rows[1] } else { rows[0] };
                    if done.contains(other)
                        || !self.is_active(place, rows, ball.approach_speed, params)
                    {
                        continue;
                    }
                    pairs.push((place, rows));
                    if self.free_inverse_mass(other) > S::zero() && queued.insert(other) {
                        queue.push_back(Sinking { row: other, ..ball });
                    }
                }
            }
        }
        // Balls that there was no room for would have no support: their pairs stay as the pass left them.
        let is_whole = |row: u32| done.contains(row) || self.free_inverse_mass(row) == S::zero();
        pairs.retain(|(_, rows)| rows.iter().all(|row| is_whole(*row)));
        (balls, pairs)
    }

    /// Returns true if a pair beside one that sinks at this speed, in m/s, bears something, or may before the
    /// next bounce.
    fn is_active(
        &self,
        place: PairPlace,
        rows: [u32; 2],
        speed: S,
        params: &SolverParams<S>,
    ) -> bool {
        let [a, b] = rows.map(|row| row as usize);
        let displacement = xyz(&self.at[b]) - xyz(&self.at[a]);
        let distance = displacement.magnitude();
        let moves = rows.into_iter().any(|row| self.free_inverse_mass(row) > S::zero());
        if !(moves && distance > S::zero() && distance.is_finite()) {
            return false;
        }
        let PairPlace { list, batch, lane } = place;
        let impulses = self.pairs_of_list(list).1;
        let separation = distance - self.at[a][3] - self.at[b][3];
        let relative = xyz(&self.velocity[b]) - xyz(&self.velocity[a]);
        let approach_speed = -relative.dot(displacement) / distance;
        // A light ball that is struck leaves at up to twice the speed.
        let reaches = separation <= S::from_f64(2.0) * speed * params.time;
        (impulses.normal_impulse[batch][lane] > S::zero() || reaches)
            && !impulses.bounces([batch, lane], approach_speed, params)
    }

    /// Inverse mass of a ball that contacts can move, in 1/kg; zero of one that sleeps, or has infinite mass.
    fn free_inverse_mass(&self, row: u32) -> S {
        let inverse_mass = self.velocity[row as usize][3];
        if inverse_mass > S::from_f64(INFINITE_MASS) { inverse_mass } else { S::zero() }
    }

    fn chunk_of(&self, row: u32) -> usize {
        self.chunks.partition_point(|chunk| chunk.rows[1] <= row)
    }

    /// Pairs of a chunk, or of the fast movers, and their impulses.
    fn pairs_of_list(&self, list: usize) -> (&[Batch], &ContactImpulses<S>) {
        match self.chunks.get(list) {
            Some(chunk) => (&chunk.batches, &chunk.impulses),
            None => (&self.fast_movers.batches, &self.fast_movers.impulses),
        }
    }

    fn pairs_by_row(&self, list: usize) -> PairsByRow {
        let rows = match self.chunks.get(list) {
            Some(chunk) => [chunk.rows[0], chunk.rows[2]],
            None => [0, self.at.len() as u32],
        };
        PairsByRow::new(self.pairs_of_list(list).0, rows)
    }

    fn pair_friction(&self, PairPlace { list, batch, lane }: PairPlace) -> f64 {
        let numbers = self.pairs_of_list(list).1.numbers.get(batch);
        let common = || self.common_material().friction;
        numbers.map_or_else(common, |numbers| numbers.friction[lane]).as_f64()
    }

    fn pair_impulse(&self, PairPlace { list, batch, lane }: PairPlace) -> ContactImpulse<f64> {
        let impulses = self.pairs_of_list(list).1;
        let tangent = impulses.tangent_impulse[batch].map(|axis| axis[lane].as_f64());
        let normal = impulses.normal_impulse[batch][lane].as_f64();
        ContactImpulse { normal, tangent: tangent.into() }
    }
}
