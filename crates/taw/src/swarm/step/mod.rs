//! A step of a swarm, and its parts in the full tier.

mod backing;
mod bodies;
mod bounces;
mod cluster;
mod islands;
mod joints;
mod lab;
mod locks;
mod overflow;
mod passages;
mod paths;
mod relax;
mod sleep;
mod unconverged;
mod wall_contacts;

pub(crate) use bodies::BallView;
pub(super) use bounces::WayToWall;
pub(super) use locks::LockedRows;
pub(super) use passages::SavedPlace;
pub(super) use sleep::inverse_masses;
use wall_contacts::WallPass;
pub(super) use wall_contacts::listed_planes;

use super::build::SOON;
use super::chunk::Chunk;
use super::fast_movers::FastMovers;
use super::kernels::{IntegratePositions, Pass, SolverColumns, SolverParams, solve, squared};
use super::scratch::SwarmScratch;
use super::state::KnownIdentity;
use super::walls::half_spaces;
use super::{Stage, StaticGeometry, Swarm, Tier};
use crate::math::{Row, Scalar, Vec3, length};
use crate::workers::{DisjointSlice, parallel_for, parallel_for_odd_even};
use cgmath::Zero;

use crate::constraint::ContactSoftness;

/// Stiffness of contacts: natural frequency at most, in Hz, and damping ratio.
const HERTZ: f64 = 60.0;
const DAMPING: f64 = 10.0;
/// Largest speed at which an overlap is pushed out, as a time of free fall, in seconds.
const PUSHING: f64 = 0.3;
/// So much of twice the smaller radius two balls may overlap before they are moved apart: more than
/// what bears a heap gets, and less than the tenth of a radius that is seen, since each substep
/// presses in a little again. (Contacts sink by a thousandth for each three balls on them; if that
/// is moved out, they never come to rest.)
const SLOP: f64 = 0.04;
/// Slop where nothing lies on anything: only so that balls that touch are left alone.
const SLOP_WEIGHTLESS: f64 = 0.01;
/// Fraction of its radius by which a ball may sink into another in a step. Half of an overlap beyond the slop goes
/// in each substep, so at most twice as much remains: with the slop, the tenth that is seen.
const MAX_SINKING: f64 = 0.01;
/// Number of looks for bounces in a substep while any is found: in a gas hardly ever do five
/// balls meet in one. What meets after that is stopped.
const ROUNDS: usize = 4;
/// Most passes of a substep that relax what is jammed.
const RELAXATIONS: usize = 16;

impl<S: Scalar> Swarm<S> {
    /// See [`Swarm::step`].
    pub(super) fn step_here(
        &mut self,
        dt: S,
        gravity: Vec3<S>,
        walls: &dyn StaticGeometry<S>,
        walls_identity: u64,
        observe: &mut dyn FnMut(Stage),
    ) {
        let walls_changed = self.begin(gravity, walls, walls_identity);
        match self.tier() {
            Tier::Lab => self.step_lab(dt, gravity, walls, walls_changed, observe),
            Tier::Full => {
                self.find_contacts(dt, gravity, walls, walls_changed, observe);
                self.solve(dt, self.model.substeps, walls, observe);
                self.stop_what_overflowed();
            }
        }
        self.end();
    }

    /// See [`Swarm::prepare`].
    pub(super) fn prepare_here(
        &mut self,
        dt: S,
        gravity: Vec3<S>,
        walls: &dyn StaticGeometry<S>,
        walls_identity: u64,
    ) {
        let walls_changed = self.begin(gravity, walls, walls_identity);
        self.find_contacts(dt, gravity, walls, walls_changed, &mut |_| ());
        self.update_contacts_on_the_way(walls, walls_changed, dt);
    }

    /// Returns true if pairs are known, so that a step can be finished.
    pub(crate) fn is_prepared(&self) -> bool {
        self.pairs_valid && !self.scratch.filters_changed
    }

    /// See [`Swarm::finish`].
    pub(super) fn finish_here(&mut self, dt: S, substeps: u32, walls: &dyn StaticGeometry<S>) {
        self.solve(dt, substeps, walls, &mut |_| ());
        self.stop_what_overflowed();
        self.end();
    }

    /// Begins a step: gravity and walls. Returns whether these changed.
    fn begin(&mut self, gravity: Vec3<S>, walls: &dyn StaticGeometry<S>, identity: u64) -> bool {
        self.stopped.clear();
        self.scratch.impacts.clear();
        self.steps_since_build = (self.steps_since_build + 1).min(SOON);
        if self.gravity != Some(gravity) {
            self.gravity = Some(gravity);
            self.wake_all();
        }
        let walls_changed = self.walls_identity.0 != Some(identity);
        if walls_changed {
            half_spaces(walls, &mut self.planes);
            self.follow_removed_walls(walls);
            self.wake_beside_changes(walls);
            self.walls_identity = KnownIdentity(Some(identity));
            *self.rows_of_walls = Some(identity);
        }
        self.wake_beside_stirred();
        // Not before: who wakes is counted in its chunk only while pairs are valid.
        self.pairs_valid &= !std::mem::take(&mut self.scratch.filters_changed);
        self.scratch.threads = self.threads_for_awake();
        walls_changed | std::mem::take(&mut self.scratch.contacts_forgotten)
    }

    /// Number of threads that a step pays for: none is woken for what sleeps.
    fn threads_for_awake(&self) -> usize {
        if !self.pairs_valid {
            return self.model().threads_for(self.at.len());
        }
        let awake = self.chunks.iter().filter(|chunk| !chunk.asleep);
        match awake.map(|chunk| chunk.own_rows().len()).sum() {
            0 => 1,
            rows => self.model().threads_for(rows),
        }
    }

    fn end(&mut self) {
        for chunk in &mut self.chunks {
            self.stopped.append(&mut chunk.stopped);
        }
        self.stopped.sort_unstable();
        self.stopped.dedup();
    }

    /// Brings up to date which pairs are near, and which balls are near walls; and who sleeps.
    fn find_contacts(
        &mut self,
        dt: S,
        gravity: Vec3<S>,
        walls: &dyn StaticGeometry<S>,
        walls_changed: bool,
        observe: &mut dyn FnMut(Stage),
    ) {
        observe(Stage::Integrate);
        if self.pairs_valid {
            self.update_sleep(dt, gravity, true);
        }
        let mut leaving = std::mem::take(&mut self.scratch.leaving);
        leaving.clear();
        leaving.extend(self.chunks.iter().flat_map(|chunk| &chunk.leaving));
        if !self.pairs_valid {
            self.build(dt, walls, observe);
            self.update_sleep(dt, gravity, true);
        } else if !leaving.is_empty() {
            let rebuilds = self.rebuilds;
            self.find_pairs_of(&leaving, dt, walls, observe);
            if self.rebuilds == rebuilds {
                self.wake_beside_moving(gravity, dt); // of the new pairs
                self.find_wall_contacts_if_changed(walls_changed, dt, walls, observe);
            } else {
                self.update_sleep(dt, gravity, false);
            }
        } else {
            self.find_wall_contacts_if_changed(walls_changed, dt, walls, observe);
        }
        self.wake_on_paths();
        self.mark_idle_batches();
        self.scratch.leaving = leaving;
    }

    /// Moves all on by `dt` seconds, in substeps: *bounce*, *integrate velocities*, *warm start*,
    /// *solve*, *integrate positions*, *relax* (Catto, 2024, `Solver2D`, `solve_soft_step.c`); and after
    /// *solve*, where heavy balls still sink, *solve what is unconverged*.
    fn solve(
        &mut self,
        dt: S,
        count: u32,
        walls: &dyn StaticGeometry<S>,
        observe: &mut dyn FnMut(Stage),
    ) {
        self.scratch.backing.clear(); // of other rows
        self.scratch.backing_speed.clear();
        if self.has_none_awake() && !self.has_bodies() {
            return;
        }
        self.list_proxy_rows();
        self.save_held_rows();
        observe(Stage::Restitute);
        let gravity = self.gravity.unwrap_or_else(Vec3::zero);
        let (zero, half, substeps) = (S::zero(), S::from_f64(0.5), S::from_f64(f64::from(count)));
        let h = dt / substeps;
        let (times, all) = ([dt, h], |_: &Chunk<S>| true);
        self.age_marks();
        self.update_wall_contacts(walls, dt, times, all, false);
        let params = self.solver_params(dt, h);
        self.save_kinematic_paths(dt);
        for substep in 0..count {
            let left = dt - h * S::from_f64(f64::from(substep));
            self.save_places(walls);
            if substep > 0 {
                self.update_wall_contacts(walls, left, times, |chunk| chunk.has_fast, true);
            }
            self.bounce(substep, [dt, h, left], params, walls, observe);
            observe(Stage::Integrate);
            let parts = [substep, substep + 1].map(|part| S::from_f64(f64::from(part)) / substeps);
            self.apply_velocity_changes(S::one() / substeps, gravity * h);
            self.record_gravity(h);
            self.save_proxies();
            self.integrate(row(gravity * h), [zero; 4], [zero; 4]);
            self.advance_proxies(parts, false, zero);
            observe(Stage::Restitute);
            self.find_backing();
            self.solve_contacts_and_joints(&params, h / substeps);
            self.record_contact_impulses(S::one());
            observe(Stage::Integrate);
            self.end_swift_paths([dt, h, left], walls, observe);
            self.save_proxies();
            self.integrate([zero; 4], [h, h, h, zero], row(gravity * (-half * h * h)));
            self.correct_free_flight(-half * h / substeps);
            self.shorten_paths();
            self.hold_rows();
            let caught = self.stop_at_walls(walls, h, gravity * (half * h * h));
            self.scratch.path_changes.clear();
            self.advance_proxies(parts, true, h);
            let (skin, before, left) = (self.skin, left, left - h);
            let left_it = |_, _: &Row<S>, skin_left: S, _: &FastMovers<S>| skin_left < -skin;
            if self.find_pairs_within_step(|chunk| chunk.overrun, left_it, dt, walls, observe) {
                self.update_wall_contacts(walls, left, times, all, false);
                self.restore_backing(); // rows may have changed
            } else if caught {
                self.update_wall_contacts(walls, left, times, |chunk| chunk.caught, true);
            }
            observe(Stage::Restitute);
            self.relax_contacts_and_joints(params);
            self.record_borne();
            self.forget_impacts();
            self.keep_out(walls, [before, left]);
            self.follow_kinematic_paths(parts[1], dt);
            self.hold_rows();
        }
    }

    /// Returns true if all balls sleep.
    fn has_none_awake(&self) -> bool {
        !self.pairs_valid || self.chunks.iter().all(|chunk| chunk.asleep)
    }

    /// Parameters of a substep of `h` seconds in a step of `dt` seconds.
    fn solver_params(&self, dt: S, h: S) -> SolverParams<S> {
        let gravity = self.gravity.unwrap_or_else(Vec3::zero);
        SolverParams {
            // What gravity makes of rest in two substeps is no impact.
            restitution_threshold: S::from_f64(2.0) * length(gravity) * h,
            // Nor is what it makes in two steps a jam. Without weight, overlap makes no speed.
            jam_speed: if gravity.is_zero() {
                S::infinity()
            } else {
                S::from_f64(2.0) * length(gravity) * dt
            },
            restitution: self.common_material().restitution,
            time: h,
            gravity: row(gravity),
            // Soft contacts bear what lies on others; all else that overlaps is moved apart. Where
            // nothing has weight, overlap makes no speed at all.
            softness: ContactSoftness::new(
                h,
                [HERTZ, DAMPING],
                S::from_f64(PUSHING) * length(gravity),
            ),
            slop: if length(gravity) > S::zero() {
                S::from_f64(SLOP)
            } else {
                S::from_f64(SLOP_WEIGHTLESS)
            },
            max_sinking: S::from_f64(MAX_SINKING) * h / dt,
            moves_apart: true,
            notes_impacts: self.bodies_are_rows,
        }
    }

    /// Forgets who was borne by a wall two steps ago.
    fn age_marks(&mut self) {
        let (chunks, velocity) = (&self.chunks, &self.velocity);
        let spin = DisjointSlice::new(&mut self.spin);
        parallel_for(self.scratch.threads, chunks.len(), |_, chunk| {
            if !chunks[chunk].asleep {
                let rows = chunks[chunk].own_rows();
                // SAFETY: the rows of the chunk.
                for (spin, velocity) in
                    unsafe { spin.part(rows.clone()) }.iter_mut().zip(&velocity[rows])
                {
                    if velocity[3].is_sign_positive() {
                        spin[3] = (spin[3] - S::one()).max(S::zero());
                    }
                }
            }
        });
    }

    /// Finds pairs and walls for balls of some chunks that leave their remaining skin within a
    /// step, since a bounce or a contact made them faster. Says whether there were any.
    fn find_pairs_within_step(
        &mut self,
        which: impl Fn(&Chunk<S>) -> bool,
        leaves: impl Fn(u32, &Row<S>, S, &FastMovers<S>) -> bool,
        dt: S,
        walls: &dyn StaticGeometry<S>,
        observe: &mut dyn FnMut(Stage),
    ) -> bool {
        let mut leaving = std::mem::take(&mut self.scratch.leaving);
        leaving.clear();
        // More than this are too many.
        let most = self.fast_movers.remaining(self.at.len()) + 1;
        for chunk in self.chunks.iter().filter(|chunk| which(chunk) && !chunk.asleep) {
            let leaves = |row: &u32| {
                let at = *row as usize;
                leaves(*row, &self.velocity[at], self.skin_left[at], &self.fast_movers)
            };
            let room = most.saturating_sub(leaving.len());
            leaving.extend((chunk.rows[0]..chunk.rows[1]).filter(leaves).take(room));
        }
        self.find_pairs_of_listed(leaving, dt, walls, observe)
    }

    /// Finds pairs and walls for some balls within a step. Says whether there were any.
    fn find_pairs_of_listed(
        &mut self,
        leaving: Vec<u32>,
        dt: S,
        walls: &dyn StaticGeometry<S>,
        observe: &mut dyn FnMut(Stage),
    ) -> bool {
        if !leaving.is_empty() {
            // Rows may change.
            self.save_backing();
            for chunk in &mut self.chunks {
                self.stopped.append(&mut chunk.stopped);
            }
            let slots = self.ids.slots();
            self.stopped.iter_mut().for_each(|row| *row = slots[*row as usize]);
            let rebuilds = self.rebuilds;
            self.find_pairs_of(&leaving, dt, walls, observe);
            if self.rebuilds != rebuilds {
                self.update_sleep(dt, self.gravity.unwrap_or_else(Vec3::zero), false);
                self.list_proxy_rows();
            }
            self.wake_on_paths();
            let rows = self.ids.columns().1;
            self.stopped.iter_mut().for_each(|slot| *slot = rows[*slot as usize]);
        }
        let any = !leaving.is_empty();
        self.scratch.leaving = leaving;
        any
    }

    /// Changes velocities and moves the balls that are awake.
    fn integrate(&mut self, change: Row<S>, time: Row<S>, correction: Row<S>) {
        let simd_level = *self.simd_level;
        let SwarmScratch { threads, backing, backing_speed, locks, .. } = &mut self.scratch;
        let columns = SolverColumns::new(
            [&mut self.at, &mut self.velocity, &mut self.spin, backing, &mut locks.free_axes],
            [&mut self.skin_left, backing_speed],
        );
        let chunks = DisjointSlice::new(&mut self.chunks);
        let least = -self.skin;
        parallel_for(*threads, chunks.len(), |_, chunk| {
            // SAFETY: each thread has its own chunks, and their rows.
            let chunk = unsafe { &mut *chunks.row(chunk) };
            if chunk.asleep {
                return;
            }
            let (rows, first) = (chunk.own_rows(), chunk.rows[0]);
            let (at, velocity, spin, skin_left) = unsafe {
                let at = columns.at.part(rows.clone());
                let (velocity, spin) =
                    (columns.velocity.part(rows.clone()), columns.spin.part(rows.clone()));
                (at, velocity, spin, columns.skin_left.part(rows))
            };
            for contact in &mut chunk.wall_contacts {
                contact.advance(time[0]);
            }
            let (stopped, overrun) = (&mut chunk.stopped, &mut chunk.overrun);
            *overrun = false;
            simd_level.run(IntegratePositions {
                at,
                velocity,
                spin,
                skin_left,
                change,
                time,
                correction,
                least,
                overrun,
                stopped,
                first,
            });
        });
        self.hold_rows();
    }

    /// Goes over all contacts of the chunks that are awake or beside one, and of which the
    /// condition holds, given how fast a ball of the next one is.
    fn pass(&mut self, pass: Pass<S>, condition: impl Fn(&Chunk<S>, S) -> bool + Sync) {
        self.mark_idle_batches();
        self.find_free_axes();
        let simd_level = *self.simd_level;
        let friction = self.common_material().friction;
        let mut fast_movers = std::mem::take(&mut self.fast_movers);
        let held = std::mem::take(&mut self.scratch.held);
        let mut outside_work = std::mem::take(&mut self.scratch.outside_work);
        let slots = if outside_work.is_empty() { &[][..] } else { self.ids.slots() }.to_vec();
        let of_walls = WallPass {
            held: &held,
            notes_impacts: self.bodies_are_rows,
            work: DisjointSlice::new(&mut outside_work),
            slots: &slots,
        };
        self.for_each_chunk(|next, columns, chunk| {
            if chunk.asleep && next.is_none_or(|(asleep, _)| asleep)
                || !condition(chunk, next.map_or(S::zero(), |(_, speed)| speed))
            {
                return;
            }
            let Chunk { batches, impulses, .. } = &mut *chunk;
            solve(simd_level, pass, columns, batches, impulses, friction);
            // Walls come last, so that nothing is pushed into them.
            if !chunk.asleep {
                of_walls.solve(pass, columns, chunk);
            }
        });
        let SwarmScratch { backing, backing_speed, locks, .. } = &mut self.scratch;
        let columns = SolverColumns::new(
            [&mut self.at, &mut self.velocity, &mut self.spin, backing, &mut locks.free_axes],
            [&mut self.skin_left, backing_speed],
        );
        let FastMovers { batches, impulses, .. } = &mut fast_movers;
        solve(simd_level, pass, columns, batches, impulses, friction);
        (self.fast_movers, self.scratch.held) = (fast_movers, held);
        self.scratch.outside_work = outside_work;
        self.hold_rows();
    }

    /// Runs a job on all chunks, each with exclusive access to the balls of it and of the next one. The
    /// job is told if the next one sleeps, and the largest speed of its balls, in m/s; `None` for the last.
    fn for_each_chunk(
        &mut self,
        job: impl Fn(Option<(bool, S)>, SolverColumns<S>, &mut Chunk<S>) + Sync,
    ) {
        let SwarmScratch { threads, chunk_states, backing, backing_speed, locks, .. } =
            &mut self.scratch;
        let columns = SolverColumns::new(
            [&mut self.at, &mut self.velocity, &mut self.spin, backing, &mut locks.free_axes],
            [&mut self.skin_left, backing_speed],
        );
        let chunks = DisjointSlice::new(&mut self.chunks);
        parallel_for_odd_even(*threads, chunks.len(), chunk_states, |chunk| {
            // SAFETY: nobody works on a neighbour meanwhile. Of the next one, only what nobody
            // changes is read.
            unsafe {
                let next = (chunk + 1 < chunks.len()).then(|| {
                    let next = chunks.row(chunk + 1);
                    ((*next).asleep, (*next).speed)
                });
                job(next, columns, &mut *chunks.row(chunk));
            }
        });
    }
}

/// The range of two ranges.
fn wider<S: Scalar>([a, b]: [S; 2], [c, d]: [S; 2]) -> [S; 2] {
    [a.min(c), b.max(d)]
}

/// Returns true if a ball leaves its skin within a time.
fn leaves<S: Scalar>(velocity: &Row<S>, skin_left: S, time: S) -> bool {
    skin_left < S::zero() || squared(*velocity) * time * time > skin_left * skin_left
}

fn row<S: Scalar>(vector: Vec3<S>) -> Row<S> {
    [vector.x, vector.y, vector.z, S::zero()]
}
