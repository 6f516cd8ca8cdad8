//! Balls in bulk: a million of them, and few features.
//!
//! A [`World`](crate::world::World) has marbles that differ in everything: shape, mass, material,
//! integrator, rotation. A [`Swarm`] has balls in `f32` of one material, and for that it is many
//! times as fast: see [`Tier`] for what it models. It lives in a world, whose walls and
//! marbles it touches.
//!
//! Parts of a step:
//! - Rows lie in the order of cells, so that neighbours in space are neighbours in memory.
//! - Layers of cells are grouped into *slabs*. Slabs that are not neighbours have no ball in
//!   common, so threads work on the even ones first and on each odd one after those beside it, and
//!   the result does not depend on how many threads there are.
//! - Pairs that might touch are put into batches of eight in which no ball is twice: a batch is
//!   solved by vector instructions, the batches of a slab one after another (Gauss and Seidel). In
//!   the lab's tier each ball and those near it after it in the order, its *fan*, are a batch.
//! - Each ball has a *budget* of how far it may go until pairs are sought again. What a pair
//!   bore is remembered across that.

#![expect(
    clippy::inline_always,
    reason = "kernels are compiled for the instructions of whoever calls them"
)]

mod batches;
mod bodies;
mod build;
mod grid;
mod guests;
mod ids;
mod kernels;
mod lanes;
mod memory;
mod model;
mod pairs;
mod slab;
mod state;
mod step;
mod strays;
mod surfaces;
mod team;
mod touch;
mod walls;

pub(crate) use bodies::{Body, BodyColumns, MarbleRow, NO_ROW, Push, SyncToken};
pub(crate) use guests::Guest;
pub use ids::BallId;
pub use lanes::Instructions;
pub use model::{Ball, Stage, SwarmModel, Tier};
pub(crate) use surfaces::Surface;
pub(crate) use walls::Surroundings;

use cgmath::{EuclideanSpace, Zero};

use crate::Error;
use crate::error::{finite_point, finite_vector, positive, within};
use crate::handle::MarbleId;
use crate::math::{Point3, Vec3};
use crate::response::Material;
use batches::pairs_in;
use grid::Grid;
use ids::Ids;
use lanes::Row;
use memory::Memory;
use pairs::Search;
use slab::Slab;
use strays::Strays;
use surfaces::{SurfaceOf, Surfaces};
use walls::HalfSpace;

/// The smallest and the largest radius, in metres: their cubes and squares of squares are
/// numbers, too.
const RADII: [f32; 2] = [1e-9, 1e9];
/// The furthest coordinate, in metres, and the largest speed, in m/s.
const FURTHEST: f32 = 1e12;

/// Balls in bulk. See the [module](self).
#[derive(Clone, Debug, Default)]
pub struct Swarm {
    model: SwarmModel,
    instructions: Instructions,
    ids: Ids,
    /// Center and radius.
    at: Vec<Row>,
    /// Velocity and inverse mass, which has a minus sign while a ball sleeps. In the lab's tier,
    /// while it steps, the place before.
    velocity: Vec<Row>,
    /// Radius times spin, and whether a wall bears it ([`GROUNDED`](kernels::GROUNDED)); only in
    /// the full tier.
    spin: Vec<Row>,
    /// See [`Columns::backing`](kernels::Columns::backing); only while it steps.
    backing: Vec<Row>,
    /// Way that each ball may still go until pairs are sought again, in metres.
    budget: Vec<f32>,
    /// Way that each ball wants to go in this step, in metres; only in the lab's tier.
    way: Vec<f32>,
    /// The largest radius, and the mean of all.
    largest: f32,
    mean: f32,
    /// Way at most, since pairs were sought, of a ball that is not sought for alone, in
    /// metres.
    cap: f32,
    grid: Grid,
    slabs: Vec<Slab>,
    /// The pairs of the fastest balls.
    strays: Strays,
    /// The rows that would leave their budget in this step.
    leaving: Vec<u32>,
    /// Ways of the fast balls; only while pairs are sought.
    ways: Vec<f32>,
    memory: Memory,
    /// For each row, the one that it was when the memory was made, if it was then.
    before: Vec<u32>,
    remembers: bool,
    /// Set while pairs and balls at walls are up to date.
    paired: bool,
    walled: Option<u64>,
    gravity: Option<Vec3<f32>>,
    planes: Vec<HalfSpace>,
    stopped: Vec<u32>,
    /// The marbles of the world that are balls here, in their order.
    pub(crate) invited: Vec<(MarbleId, BallId)>,
    /// Set if these are rows like all others, and no guests.
    hosting: bool,
    /// What moves them besides gravity.
    pushes: Vec<bodies::Push>,
    surfaces: Surfaces,
    /// Agreement of bodies with the marbles.
    pub(crate) synced: SyncToken,
    guests: Vec<Guest>,
    /// Their rows, in order, and which guest each is; only in a step.
    guest_rows: Vec<(u32, u32)>,
    /// Places and velocities of these rows before a drift.
    kept_guests: Vec<[Row; 2]>,
    /// A bit for each slot.
    guest_slots: Vec<u64>,
    /// Column to put others in order with; then, in the lab's tier, the fans of all slabs.
    spare: Vec<Row>,
    lists: Vec<Vec<u32>>,
    /// Progress of each slab, while they are worked on.
    slab_states: Vec<u32>,
    searches: Vec<Search>,
    rebuilds: u64,
    steps_since_build: u32,
    /// Width of the margin beyond the usual, as a part of that.
    spread: f32,
}

impl Swarm {
    /// Model by which it steps.
    #[must_use]
    pub fn model(&self) -> SwarmModel {
        self.model
    }

    /// Changes how it steps. All balls wake.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a number of it.
    pub fn set_model(&mut self, model: SwarmModel) -> Result<(), Error> {
        let model = model.validated()?;
        let tier = self.tier();
        let resists = self.surface_of().differ();
        self.model = model;
        if self.tier() != tier {
            (self.paired, self.remembers) = (false, false);
            self.before.clear();
        } else if resists || self.surface_of().differ() {
            self.remember();
            self.paired = false; // pairs have numbers of their own
        }
        self.shape_columns();
        self.walled = None;
        self.wake_all();
        Ok(())
    }

    /// Changes by which instructions of the processor it steps. That changes no bit of it.
    pub fn set_instructions(&mut self, instructions: Instructions) {
        self.instructions = instructions;
    }

    /// Puts balls in, all or none.
    ///
    /// # Errors
    /// [`Error::NotFinite`] or [`Error::OutOfRange`] for a number of one of them,
    /// [`Error::NotPositive`] for a mass, [`Error::Full`] at 2³² balls.
    pub fn insert(&mut self, balls: &[Ball]) -> Result<Vec<BallId>, Error> {
        for ball in balls {
            checked_place(ball.position)?;
            checked_velocity(ball.velocity)?;
            let [least, most] = RADII;
            within("radius", ball.radius, least, most)?;
            positive("mass", 1.0 / ball.mass.of(ball.radius))?;
        }
        self.add(balls)
    }

    /// Puts balls in that are known to be right.
    fn add(&mut self, balls: &[Ball]) -> Result<Vec<BallId>, Error> {
        let ids = self.ids.push(balls.len())?;
        let rows = balls.iter();
        self.at.extend(rows.clone().map(|ball| with(ball.position.to_vec(), ball.radius)));
        let moving = |ball: &Ball| with(ball.velocity, 1.0 / ball.mass.of(ball.radius));
        self.velocity.extend(rows.map(moving));
        self.budget.resize(self.at.len(), 0.0);
        if self.rough() && (self.paired || self.remembers) {
            self.remember();
            self.before.resize(self.at.len(), u32::MAX);
        }
        self.shape_columns();
        self.measure();
        self.paired = false;
        Ok(ids)
    }

    /// Takes balls out, all or none.
    ///
    /// # Errors
    /// [`Error::NoSuchBall`], also for one that is named twice, and for a marble's.
    pub fn remove(&mut self, balls: &[BallId]) -> Result<(), Error> {
        let is_marble = |id: &&BallId| self.row(**id).is_ok_and(|row| self.is_guest(row));
        if let Some(id) = balls.iter().find(is_marble).filter(|_| self.hosting) {
            return Err(Error::NoSuchBall(*id));
        }
        self.take_out(balls)
    }

    /// Takes balls out, those of marbles too.
    pub(crate) fn take_out(&mut self, balls: &[BallId]) -> Result<(), Error> {
        self.ids.check(balls)?;
        self.remember();
        for ball in balls {
            if let Some(slot) = self.slot_of(*ball) {
                self.surfaces.set(slot, None);
            }
        }
        let kept = self.ids.remove(balls);
        retain(&mut self.at, &kept);
        retain(&mut self.velocity, &kept);
        retain(&mut self.spin, &kept);
        retain(&mut self.budget, &kept);
        retain(&mut self.way, &kept);
        retain(&mut self.before, &kept);
        self.measure();
        self.wake_all();
        self.paired = false;
        Ok(())
    }

    /// Number of balls.
    #[must_use]
    pub fn len(&self) -> usize {
        self.at.len()
    }

    /// True if there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.at.is_empty()
    }

    /// The centers and radii, row by row, in metres. Steps change which ball is in which row.
    #[must_use]
    pub fn balls(&self) -> &[[f32; 4]] {
        &self.at
    }

    /// True if the ball in a row is a marble of the world, which the swarm pushes but does not
    /// move.
    #[must_use]
    pub fn is_guest(&self, row: usize) -> bool {
        row < self.len() && Self::has_guest_slot(self.ids.slots()[row], &self.guest_slots)
    }

    /// The velocities in m/s, row by row. The last number is the inverse mass in 1/kg, with a
    /// minus sign if the ball sleeps.
    #[must_use]
    pub fn velocities(&self) -> &[[f32; 4]] {
        &self.velocity
    }

    /// Radius times angular velocity in m/s, row by row, and a mark of the swarm's own; empty in the
    /// lab's tier.
    #[must_use]
    pub fn rims(&self) -> &[[f32; 4]] {
        &self.spin
    }

    /// The ball in a row.
    #[must_use]
    pub fn id(&self, row: usize) -> Option<BallId> {
        self.ids.id(row)
    }

    /// A number for the ball in each row that stays the same, and is smaller than the most balls
    /// there ever were: for tables of one's own.
    #[must_use]
    pub fn slots(&self) -> &[u32] {
        self.ids.slots()
    }

    /// The row of a ball until the next step or change.
    ///
    /// # Errors
    /// [`Error::NoSuchBall`].
    pub fn row(&self, ball: BallId) -> Result<usize, Error> {
        self.ids.row(ball).ok_or(Error::NoSuchBall(ball))
    }

    /// Moves a ball to another place at once.
    ///
    /// # Errors
    /// [`Error::NoSuchBall`], [`Error::NotFinite`], [`Error::OutOfRange`].
    pub fn set_position(&mut self, ball: BallId, position: Point3<f32>) -> Result<(), Error> {
        let (row, position) = (self.row(ball)?, checked_place(position)?);
        self.wake(row);
        self.at[row] = with(position.to_vec(), self.at[row][3]);
        self.remember();
        self.paired = false;
        Ok(())
    }

    /// Gives a ball another velocity, in m/s, and wakes it and those around.
    ///
    /// # Errors
    /// [`Error::NoSuchBall`], [`Error::NotFinite`], [`Error::OutOfRange`].
    pub fn set_velocity(&mut self, ball: BallId, velocity: Vec3<f32>) -> Result<(), Error> {
        let (row, velocity) = (self.row(ball)?, checked_velocity(velocity)?);
        self.wake(row);
        self.velocity[row] = with(velocity, self.velocity[row][3]);
        Ok(())
    }

    /// The balls that the last step stopped because their motion overflowed.
    pub fn stopped(&self) -> impl Iterator<Item = BallId> + '_ {
        self.stopped.iter().filter_map(|row| self.ids.id(*row as usize))
    }

    /// Number of balls that sleep.
    #[must_use]
    pub fn asleep(&self) -> usize {
        let slabs = self.slabs.iter().filter(|slab| slab.asleep);
        if self.paired { slabs.map(|slab| slab.own_rows().len()).sum() } else { 0 }
    }

    /// Number of pairs of balls near enough to be looked at.
    #[must_use]
    pub fn pairs(&self) -> usize {
        self.slabs.iter().map(|slab| slab.pairs).sum::<usize>() + pairs_in(&self.strays.batches)
    }

    /// Checks that all pairs near enough are looked at. Up to 64 a ball on average are, ten times as
    /// many as touch in the densest heap; where more balls than that are inside of each other, the
    /// rest wait until some have parted, and meanwhile overlap.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for `pairs`: how many there are, and how many of them are looked at.
    pub fn check_pairs(&self) -> Result<(), Error> {
        let unlisted = self.slabs.iter().map(|slab| slab.unlisted).sum::<usize>();
        let (listed, all) = (self.pairs(), self.pairs() + unlisted + self.strays.unlisted);
        within("pairs", all as f64, 0.0, listed as f64).map(|_| ())
    }

    /// Number of times that a ball is near enough to a wall to be looked at. (The lab's tier looks
    /// at all balls for each half-space, and does not count these.)
    #[must_use]
    pub fn near_walls(&self) -> usize {
        self.slabs.iter().map(|slab| slab.touches.len()).sum()
    }

    /// Number of searches for pairs so far.
    #[must_use]
    pub fn rebuilds(&self) -> u64 {
        self.rebuilds
    }

    /// True in the tier with friction, bounce and spin.
    fn rough(&self) -> bool {
        self.tier() == Tier::Full
    }

    /// Material of all pairs that have no [numbers](kernels::Pushes::numbers) of their own.
    fn common_material(&self) -> Material<f32> {
        let model = self.model.material;
        self.surfaces.common(model, self.len()).unwrap_or(model)
    }

    /// Surfaces by row.
    fn surface_of(&self) -> SurfaceOf<'_> {
        let model = self.model.material;
        SurfaceOf { model, surfaces: &self.surfaces, slots: self.ids.slots() }
    }

    /// Gives the columns that only one tier needs as many rows as there are balls, or none.
    fn shape_columns(&mut self) {
        let rows = self.at.len();
        let (spin, way) = if self.rough() { (rows, 0) } else { (0, rows) };
        self.spin.resize(spin, [0.0; 4]);
        self.way.resize(way, 0.0);
        if spin == 0 {
            self.spin.shrink_to_fit();
        }
        if way == 0 {
            self.way.shrink_to_fit();
        }
    }

    /// Keeps what pairs bore, as rows are about to change. The lab's tier has nothing to keep.
    fn remember(&mut self) {
        if self.remembers || !self.rough() {
            return;
        }
        if self.paired {
            let (slabs, threads) = (&self.slabs[..], self.model.threads as usize);
            self.memory.keep(slabs, &self.strays, self.at.len(), threads);
        } else {
            self.memory.forget(self.at.len());
        }
        self.before.clear();
        self.before.extend(0..self.at.len() as u32);
        self.remembers = true;
    }

    fn measure(&mut self) {
        let radii = self.at.iter().map(|row| row[3]);
        self.largest = radii.clone().fold(0.0, f32::max);
        let sum = radii.map(f64::from).sum::<f64>();
        self.mean = (sum / self.at.len().max(1) as f64) as f32;
    }

    fn wake(&mut self, row: usize) {
        if self.paired {
            let slabs = &mut self.slabs;
            let slab = slabs.partition_point(|slab| slab.rows[1] as usize <= row);
            if let Some(slab) = slabs.get_mut(slab) {
                slab.wake(&mut self.velocity);
            }
        }
        self.velocity[row][3] = self.velocity[row][3].abs();
    }

    fn wake_all(&mut self) {
        for slab in &mut self.slabs {
            (slab.asleep, slab.slow) = (false, 0.0);
        }
        for velocity in &mut self.velocity {
            velocity[3] = velocity[3].abs();
        }
    }
}

fn with(vector: Vec3<f32>, last: f32) -> Row {
    [vector.x, vector.y, vector.z, last]
}

fn checked_place(place: Point3<f32>) -> Result<Point3<f32>, Error> {
    let names = ["position.x", "position.y", "position.z"];
    finite_point(names, place)?;
    for (name, x) in names.into_iter().zip([place.x, place.y, place.z]) {
        within(name, x, -FURTHEST, FURTHEST)?;
    }
    Ok(place)
}

fn checked_velocity(velocity: Vec3<f32>) -> Result<Vec3<f32>, Error> {
    let names = ["velocity.x", "velocity.y", "velocity.z"];
    finite_vector(names, velocity)?;
    for (name, x) in names.into_iter().zip([velocity.x, velocity.y, velocity.z]) {
        within(name, x, -FURTHEST, FURTHEST)?;
    }
    Ok(velocity)
}

/// Leaves the rows that are kept, in their order.
fn retain<T: Copy>(column: &mut Vec<T>, kept: &[bool]) {
    if column.is_empty() {
        return;
    }
    let mut to = 0;
    for (from, kept) in kept.iter().enumerate() {
        if *kept {
            column[to] = column[from];
            to += 1;
        }
    }
    column.truncate(to);
}

/// The speed in m/s up to which a ball counts as lying still, where it weighs so much.
fn lying(gravity: Vec3<f32>, radius: f32) -> f32 {
    if gravity.is_zero() { 0.0 } else { 0.05 * (crate::math::length(gravity) * radius).sqrt() }
}
