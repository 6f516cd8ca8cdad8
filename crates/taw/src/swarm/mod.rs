//! Particle system of up to millions of balls, with few features each, in the scalar of its world.
//!
//! A [`World`](crate::world::World) has marbles that differ in everything: shape, mass, material,
//! integrator, rotation. A [`Swarm`] has balls of any radius, mass, material and gravity
//! scale: see [`Tier`] for what it models. It belongs to a world: it collides with the world's walls
//! and marbles, and the world's force fields act on it.
//!
//! Parts of a step:
//! - Rows lie in the order of cells, so that neighbours in space are neighbours in memory.
//! - Layers of cells are grouped into *chunks*. Chunks that are not neighbours have no ball in
//!   common, so threads work on the even ones first and on each odd one after those beside it, and
//!   the result does not depend on how many threads there are.
//! - Graph colouring: pairs that might touch are put into batches of eight in which no ball is
//!   twice. A batch is solved by vector instructions, the batches of a chunk one after another
//!   (Gauss and Seidel). In the lab's tier each ball and its *neighbour list*, those near it after
//!   it in the order, are a batch.
//! - Each ball has a Verlet *skin*: the distance that it may go until pairs are searched again. A
//!   cache keeps the impulses of pairs across that, for warm starts.

#![expect(
    clippy::inline_always,
    reason = "kernels are compiled for the instructions of their caller"
)]

mod ball_settings;
mod batches;
mod bit_set;
mod bodies;
mod build;
mod chunk;
mod contact_list;
mod crowding;
mod entries;
mod fast_movers;
mod grid;
mod impulse_cache;
mod kernels;
mod limits;
mod model;
mod neighbours;
mod outside_work;
mod proxies;
mod query;
mod recorded_impulses;
mod rest;
mod rows;
mod scratch;
mod sleep;
mod state;
mod step;
mod surfaces;
mod sweeps;
mod wall_contact;
mod wall_paths;
mod walls;

pub use crate::handle::BallId;
pub use crate::math::simd::SimdLevel;
pub(crate) use bodies::{BodyColumns, BodyRow, MarbleRow, SyncToken, VelocityChange};
pub(crate) use kernels::NearLimits;
pub(crate) use limits::{LEAST_RADIUS, MAX_COORDINATE};
pub use model::{Ball, Stage, SwarmModel, Tier};
pub(crate) use proxies::Proxy;
pub use query::{BallQueries, BallQueryHit, BallTree};
pub(crate) use step::BallView;
pub(crate) use surfaces::BallSurface;
pub(crate) use walls::StaticGeometry;

use cgmath::EuclideanSpace;

use crate::Error;
use crate::error::{positive, within};
use crate::handle::{Handles, MarbleId};
use crate::math::{Point3, Row, Scalar, Vec3};
use crate::response::Material;
use crate::uncompared::Uncompared;
use ball_settings::BallForces;
use batches::pairs_in;
use bit_set::BitSet;
use chunk::Chunk;
use fast_movers::FastMovers;
use grid::SortedGrid;
use impulse_cache::ImpulseCache;
use limits::{RADII, validated_position, validated_velocity};
use neighbours::NeighbourColumn;
use rows::retain;
use scratch::SwarmScratch;
use sleep::SleepState;
use state::KnownIdentity;
use surfaces::{SurfaceOf, Surfaces};
use walls::HalfSpace;

/// Inverse mass in 1/kg of a body that no force moves.
pub(crate) const INFINITE_MASS: f64 = 1e-25;

/// Particle system of balls. See the [module](self).
///
/// Two are equal if they go on alike, bit by bit: scratch memory does not count, nor do threads and
/// instructions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Swarm<S: Scalar = f32> {
    /// Model, with zero threads: [`Swarm::model`] puts the setting in.
    model: SwarmModel<S>,
    threads_of_model: Uncompared<u32>,
    simd_level: Uncompared<SimdLevel>,
    ids: Handles,
    /// Center and radius.
    at: Vec<Row<S>>,
    /// Velocity and inverse mass, which has a minus sign while a ball sleeps. In the lab's tier,
    /// while it steps, the place before.
    velocity: Vec<Row<S>>,
    /// Radius times spin, and whether a wall bears it ([`GROUNDED`](kernels::GROUNDED)); only in
    /// the full tier.
    spin: Vec<Row<S>>,
    /// Remaining skin of each ball: distance until pairs are searched again, in metres.
    skin_left: Vec<S>,
    /// Predicted displacement of each ball in this step, in metres; only in the lab's tier.
    displacement: Vec<S>,
    /// The largest radius, and the mean of all.
    max_radius: S,
    mean_radius: S,
    /// Verlet skin: largest displacement, since pairs were searched, of a ball that is no fast
    /// mover, in metres.
    skin: S,
    grid: SortedGrid<S>,
    chunks: Vec<Chunk<S>>,
    /// Pairs of balls that left their skin.
    fast_movers: FastMovers<S>,
    impulse_cache: ImpulseCache<S>,
    /// For each row, the one that it was when the impulse cache was filled, if it was then.
    old_rows: Vec<u32>,
    cache_valid: bool,
    /// Set while pairs and balls at walls are up to date.
    pairs_valid: bool,
    walls_identity: KnownIdentity,
    rows_of_walls: Uncompared<Option<u64>>,
    gravity: Option<Vec3<S>>,
    planes: Vec<HalfSpace<S>>,
    stopped: Vec<u32>,
    /// The marbles of the world that are balls here, in their order.
    pub(crate) body_balls: Vec<(MarbleId, BallId)>,
    /// Set if these are rows of the same solve as all others, and no proxies.
    bodies_are_rows: bool,
    /// Velocity changes of bodies besides gravity.
    velocity_changes: Vec<bodies::VelocityChange<S>>,
    surfaces: Surfaces<S>,
    ball_forces: BallForces<S>,
    /// Agreement of bodies with the marbles.
    pub(crate) synced: SyncToken,
    proxies: Vec<Proxy<S>>,
    /// Slots of marbles.
    body_slots: BitSet,
    sleep: SleepState<S>,
    /// Number of times that balls fell asleep, woke, came or went.
    sleep_version: Uncompared<u64>,
    neighbours: NeighbourColumn<S>,
    scratch: SwarmScratch<S>,
    rebuilds: u64,
    steps_since_build: u32,
    /// Width of the skin beyond the usual, as a fraction of that.
    skin_scale: S,
}

impl<S: Scalar> Swarm<S> {
    /// Model of its physics and solver.
    #[must_use]
    pub fn model(&self) -> SwarmModel<S> {
        SwarmModel { threads: *self.threads_of_model, ..self.model }
    }

    /// Sets the model. All balls wake.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a field of it.
    pub fn set_model(&mut self, model: SwarmModel<S>) -> Result<(), Error> {
        let model = model.validated()?;
        let tier = self.tier();
        let resists = self.surface_of().differ();
        self.model = SwarmModel { threads: 0, ..model };
        *self.threads_of_model = model.threads;
        self.scratch.threads = model.threads as usize;
        if self.tier() != tier {
            self.forget_pairs();
        } else if resists || self.surface_of().differ() {
            self.cache_impulses();
            self.pairs_valid = false; // pairs have numbers of their own
        }
        self.resize_columns();
        self.walls_identity = KnownIdentity::default();
        self.wake_all();
        Ok(())
    }

    /// Sets the SIMD instructions that it uses. The result has the same bits with any of them.
    pub fn set_simd_level(&mut self, simd_level: SimdLevel) {
        *self.simd_level = simd_level;
    }

    /// Inserts balls, all or none.
    ///
    /// # Errors
    /// [`Error::NotFinite`] or [`Error::OutOfRange`] for a field of one of them,
    /// [`Error::NotPositive`] for a mass, [`Error::Full`] at 2³² − 1 balls.
    pub fn insert(&mut self, balls: &[Ball<S>]) -> Result<Vec<BallId>, Error> {
        for ball in balls {
            validated_position(ball.position)?;
            validated_velocity(ball.velocity)?;
            let [least, most] = RADII.map(S::from_f64);
            within("radius", ball.radius, least, most)?;
            positive("mass", S::one() / ball.mass.of(ball.radius))?;
        }
        self.add(balls)
    }

    /// Puts balls in that are known to be right.
    fn add(&mut self, balls: &[Ball<S>]) -> Result<Vec<BallId>, Error> {
        let first = self.ids.push_many(balls.len())?;
        let rows = balls.iter();
        self.at.extend(rows.clone().map(|ball| pack_row(ball.position.to_vec(), ball.radius)));
        let moving = |ball: &Ball<S>| pack_row(ball.velocity, S::one() / ball.mass.of(ball.radius));
        self.velocity.extend(rows.map(moving));
        self.skin_left.resize(self.at.len(), S::zero());
        if self.has_friction() && (self.pairs_valid || self.cache_valid) {
            self.cache_impulses();
            self.old_rows.resize(self.at.len(), u32::MAX);
        }
        *self.sleep_version += 1;
        self.resize_columns();
        self.measure_radii();
        self.pairs_valid = false;
        Ok((first..self.len()).filter_map(|row| self.id(row)).collect())
    }

    /// Removes balls, all or none, and wakes those beside them. To remove many at once takes as long as to
    /// remove one, which grows with the number of all balls.
    ///
    /// # Errors
    /// [`Error::NoSuchBall`], also for one that is listed twice, and for a marble's.
    pub fn remove(&mut self, balls: &[BallId]) -> Result<(), Error> {
        balls.iter().try_for_each(|ball| self.own_slot(*ball).map(|_| ()))?;
        self.take_out(balls)
    }

    /// Takes balls out, those of marbles too.
    pub(crate) fn take_out(&mut self, balls: &[BallId]) -> Result<(), Error> {
        self.check_listed(balls)?;
        if balls.is_empty() {
            return Ok(());
        }
        *self.sleep_version += 1;
        for ball in balls {
            self.wake(self.row(*ball)?);
        }
        self.wake_beside_stirred(); // while they are known
        self.cache_impulses();
        for ball in balls {
            if let Some(slot) = self.slot_of(*ball) {
                self.forget_settings(slot);
                self.body_slots.remove(slot);
            }
        }
        let kept = self.ids.remove_many(balls.iter().map(|ball| ball.0));
        retain(&mut self.at, &kept);
        retain(&mut self.velocity, &kept);
        retain(&mut self.spin, &kept);
        retain(&mut self.skin_left, &kept);
        retain(&mut self.displacement, &kept);
        retain(&mut self.old_rows, &kept);
        retain(&mut self.sleep.rest.place, &kept);
        retain(&mut self.sleep.rest.time, &kept);
        self.measure_radii();
        self.pairs_valid = false;
        Ok(())
    }

    /// Checks that all of these balls are there, and listed once.
    fn check_listed(&self, balls: &[BallId]) -> Result<(), Error> {
        let mut seen = vec![false; self.len()];
        for ball in balls {
            if std::mem::replace(&mut seen[self.row(*ball)?], true) {
                return Err(Error::NoSuchBall(*ball));
            }
        }
        Ok(())
    }

    /// Number of balls that were removed so far; to look only when it changes which are gone.
    #[must_use]
    pub fn removals(&self) -> u64 {
        self.ids.removals()
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

    /// Centers and radii by row, in metres. Steps reorder the rows.
    #[must_use]
    pub fn balls(&self) -> &[[S; 4]] {
        &self.at
    }

    /// True if the ball in a row stands for a marble of the world.
    #[must_use]
    pub fn is_marble(&self, row: usize) -> bool {
        row < self.len() && self.body_slots.contains(self.ids.slots()[row])
    }

    /// Velocities by row, in m/s. The last number is the inverse mass in 1/kg, with a minus sign if
    /// the ball sleeps.
    #[must_use]
    pub fn velocities(&self) -> &[[S; 4]] {
        &self.velocity
    }

    /// Radius times angular velocity by row, in m/s, and a number for internal use; empty in
    /// [`Tier::Lab`].
    #[must_use]
    pub fn spin_velocities(&self) -> &[[S; 4]] {
        &self.spin
    }

    /// Ball in a row.
    #[must_use]
    pub fn id(&self, row: usize) -> Option<BallId> {
        self.ids.handle(row).map(BallId)
    }

    /// Slot of the ball in each row: an index that a ball keeps as long as it exists, below the
    /// maximum number of balls so far. For tables of the caller.
    #[must_use]
    pub fn slots(&self) -> &[u32] {
        self.ids.slots()
    }

    /// Row of a ball, until the next step or change.
    ///
    /// # Errors
    /// [`Error::NoSuchBall`].
    pub fn row(&self, ball: BallId) -> Result<usize, Error> {
        self.ids.row(ball.0).ok_or(Error::NoSuchBall(ball))
    }

    /// Sets the position of a ball (teleports it), in metres, and wakes it.
    ///
    /// # Errors
    /// [`Error::NoSuchBall`], also for a marble's, [`Error::NotFinite`], [`Error::OutOfRange`].
    pub fn set_position(&mut self, ball: BallId, position: Point3<S>) -> Result<(), Error> {
        self.own_slot(ball)?;
        let (row, position) = (self.row(ball)?, validated_position(position)?);
        self.wake(row);
        self.at[row] = pack_row(position.to_vec(), self.at[row][3]);
        self.cache_impulses();
        self.pairs_valid = false;
        Ok(())
    }

    /// Sets the velocity of a ball, in m/s, and wakes it and those around.
    ///
    /// # Errors
    /// [`Error::NoSuchBall`], also for a marble's, [`Error::NotFinite`], [`Error::OutOfRange`].
    pub fn set_velocity(&mut self, ball: BallId, velocity: Vec3<S>) -> Result<(), Error> {
        self.own_slot(ball)?;
        let (row, velocity) = (self.row(ball)?, validated_velocity(velocity)?);
        self.wake(row);
        self.velocity[row] = pack_row(velocity, self.velocity[row][3]);
        Ok(())
    }

    /// Balls that the last step stopped because their motion overflowed.
    pub fn stopped(&self) -> impl Iterator<Item = BallId> + '_ {
        self.stopped.iter().filter_map(|row| self.id(*row as usize))
    }

    /// Number of balls that sleep.
    #[must_use]
    pub fn asleep(&self) -> usize {
        self.sleep.sleepers
    }

    /// Number of candidate pairs of balls (broad phase).
    #[must_use]
    pub fn pairs(&self) -> usize {
        self.chunks.iter().map(|chunk| chunk.pairs).sum::<usize>()
            + pairs_in(&self.fast_movers.batches)
    }

    /// Checks that all candidate pairs are solved. Up to 64 per ball on average are, ten times as
    /// many as touch in the densest heap; where more balls than that overlap each other, the other
    /// pairs wait until some have separated, and overlap meanwhile.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for `pairs`: the number of candidates, and the number that is solved.
    pub fn check_pairs(&self) -> Result<(), Error> {
        let unlisted = self.chunks.iter().map(|chunk| chunk.unlisted).sum::<usize>();
        let (listed, all) = (self.pairs(), self.pairs() + unlisted + self.fast_movers.unlisted);
        within("pairs", all as f64, 0.0, listed as f64).map(|_| ())
    }

    /// Number of candidate pairs of a ball and a wall, in [`Tier::Lab`] without half-spaces.
    #[must_use]
    pub fn near_walls(&self) -> usize {
        self.chunks.iter().map(|chunk| chunk.wall_contacts.len()).sum()
    }

    /// Number of searches for candidate pairs so far.
    #[must_use]
    pub fn rebuilds(&self) -> u64 {
        self.rebuilds
    }

    /// True in the tier with friction, bounce and spin.
    fn has_friction(&self) -> bool {
        self.tier() == Tier::Full
    }

    /// Material of all pairs that have no [numbers](kernels::ContactImpulses::numbers) of their
    /// own.
    fn common_material(&self) -> Material<S> {
        let model = self.model.material;
        self.surfaces.common(model, self.len()).unwrap_or(model)
    }

    /// Surfaces by row.
    fn surface_of(&self) -> SurfaceOf<'_, S> {
        let model = self.model.material;
        SurfaceOf { model, surfaces: &self.surfaces, slots: self.ids.slots() }
    }

    /// Gives the columns that only one tier needs as many rows as there are balls, or none.
    fn resize_columns(&mut self) {
        let rows = self.at.len();
        let (spin, displacement) = if self.has_friction() { (rows, 0) } else { (0, rows) };
        self.spin.resize(spin, [S::zero(); 4]);
        self.displacement.resize(displacement, S::zero());
        self.sleep.rest.resize(if self.model.sleeps { spin } else { 0 });
        if spin == 0 {
            self.spin.shrink_to_fit();
        }
        if displacement == 0 {
            self.displacement.shrink_to_fit();
        }
    }

    /// Caches the impulses of pairs, as rows are about to change. The lab's tier has none.
    fn cache_impulses(&mut self) {
        if self.cache_valid || !self.has_friction() {
            return;
        }
        if self.pairs_valid {
            let (chunks, threads) = (&self.chunks[..], self.scratch.threads);
            self.impulse_cache.keep(chunks, &self.fast_movers, self.at.len(), threads);
        } else {
            self.impulse_cache.forget(self.at.len());
        }
        self.old_rows.clear();
        self.old_rows.extend(0..self.at.len() as u32);
        self.cache_valid = true;
    }

    /// Forgets pairs and impulses: those of one tier are not those of the other.
    fn forget_pairs(&mut self) {
        self.pairs_valid = false;
        self.forget_cache();
        self.old_rows.clear();
        (self.neighbours, self.scratch.column) = Default::default();
    }

    /// Forgets the cached impulses.
    fn forget_cache(&mut self) {
        self.cache_valid = false;
        self.impulse_cache.clear();
    }

    fn measure_radii(&mut self) {
        let radii = self.at.iter().map(|row| row[3]);
        self.max_radius = radii.clone().fold(S::zero(), S::max);
        let sum = radii.map(S::as_f64).sum::<f64>();
        self.mean_radius = S::from_f64(sum / self.at.len().max(1) as f64);
    }
}

fn pack_row<S: Scalar>(vector: Vec3<S>, last: S) -> Row<S> {
    [vector.x, vector.y, vector.z, last]
}
