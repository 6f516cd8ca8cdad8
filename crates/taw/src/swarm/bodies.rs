//! Balls of the swarm that are marbles of the world: rows of the same solve as all others.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use cgmath::{EuclideanSpace, Zero};

use super::kernels::{MAX_MAGNITUDE, largest, squared};
use super::rows::less;
use super::state::KnownIdentity;
use super::surfaces::{BallSurface, SurfaceOf};
use super::wall_contact::xyz;
use super::{BallId, Swarm, Tier};
use crate::broad::CollisionLayers;
use crate::handle::NO_ROW;
use crate::math::{Point3, Quat, Row, Scalar, Vec3, is_finite};
use crate::motion::integrate_rotation;
use crate::response::Impact;
use crate::workers::{DisjointSlice, parallel_for};

/// State of a marble as a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BodyRow<S> {
    pub slot: u32,
    /// Center and radius, in metres.
    pub at: Row<S>,
    /// Velocity in m/s, and inverse mass in 1/kg.
    pub velocity: Row<S>,
    /// Radius times angular velocity, in m/s.
    pub spin: Row<S>,
    /// None for that of the swarm's model.
    pub surface: Option<BallSurface<S>>,
    pub layers: CollisionLayers,
    /// Set for infinite mass: a body of any finite mass stops at walls.
    pub is_kinematic: bool,
    pub sleeping_disabled: bool,
}

/// Identity of two columns that agree, except for rows known to have changed. A clone has none, so
/// that whatever is put in their place is compared in full.
#[derive(Debug, Default)]
pub(crate) struct SyncToken(u64);

impl SyncToken {
    /// A token that no other two share.
    pub fn unique() -> [Self; 3] {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        let token = NEXT.fetch_add(1, Ordering::Relaxed);
        [Self(token), Self(token), Self(token)]
    }

    pub fn is_set(&self) -> bool {
        self.0 != 0
    }

    /// Returns true for two of one call of [`Self::unique`].
    pub fn agrees(&self, other: &Self) -> bool {
        self.is_set() && self.0 == other.0
    }
}

impl Clone for SyncToken {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl PartialEq for SyncToken {
    /// Does not count.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// Change of velocity that a body gets besides gravity in a step, in m/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct VelocityChange<S> {
    pub slot: u32,
    pub change: [S; 3],
}

/// Path of a kinematic body in a step, which only its damping changes.
#[derive(Clone, Copy, Debug)]
pub(super) struct KinematicPath<S> {
    slot: u32,
    /// Center at the begin, in metres, and radius.
    at: Row<S>,
    /// Velocity at the begin in m/s, and inverse mass in 1/kg.
    velocity: Row<S>,
    /// Change of velocity in the step, in m/s.
    change: [S; 3],
}

/// Columns of the marbles that a step changes.
pub(crate) struct BodyColumns<'a, S> {
    pub position: &'a mut [Point3<S>],
    pub velocity: &'a mut [Vec3<S>],
    /// Empty where marbles do not turn.
    pub angular_velocity: &'a mut [Vec3<S>],
    pub rotation: &'a mut [Quat<S>],
    pub radius: &'a [S],
}

/// Numbers of a marble that a step changes, and its radius.
#[derive(Clone, Copy)]
pub(crate) struct MarbleRow<S> {
    pub position: Point3<S>,
    pub velocity: Vec3<S>,
    /// None where contacts do not set it spinning.
    pub spin: Option<Vec3<S>>,
    pub radius: S,
}

impl<S: Scalar> Swarm<S> {
    /// Makes bodies rows of the same solve as all others, or proxies that the world's solver moves.
    pub(crate) fn set_bodies_are_rows(&mut self, bodies_are_rows: bool) {
        if bodies_are_rows == self.bodies_are_rows {
            return;
        }
        let tier = self.tier();
        self.bodies_are_rows = bodies_are_rows;
        if self.tier() != tier {
            self.forget_pairs();
        }
        self.proxies.clear();
        self.scratch.proxy_rows.clear();
        self.velocity_changes.clear();
        let slots: Vec<_> =
            self.body_balls.iter().filter_map(|(_, ball)| self.slot_of(*ball)).collect();
        for slot in slots {
            self.forget_settings(slot); // balls that are no bodies keep theirs
        }
        self.synced = SyncToken::default();
        (self.pairs_valid, self.walls_identity) = (false, KnownIdentity::default());
        self.forget_cache();
        self.resize_columns();
        self.wake_all();
    }

    /// Physics that the step models: bodies need all of it.
    pub(super) fn tier(&self) -> Tier {
        if self.bodies_are_rows { Tier::Full } else { self.model.tier }
    }

    /// Marks which slots are bodies.
    pub(crate) fn set_bodies(&mut self, slots: impl Iterator<Item = u32>) {
        self.body_slots.clear();
        for slot in slots {
            self.body_slots.insert(slot);
        }
    }

    /// Returns true if a marble is still as [`Self::read_bodies`] left it, and the body has this
    /// radius, in metres, inverse mass, in 1/kg, surface and layers, and is kinematic and sleepless or not.
    #[inline]
    pub(crate) fn is_as_read(
        &self,
        slot: u32,
        marble: MarbleRow<S>,
        [row_radius, inverse_mass]: [S; 2],
        (surface, layers): (Option<BallSurface<S>>, CollisionLayers),
        [is_kinematic, is_sleepless]: [bool; 2],
    ) -> bool {
        let row = self.ids.rows()[slot as usize] as usize;
        let [at, velocity] = [&self.at[row], &self.velocity[row]];
        let MarbleRow { position, velocity: speed, spin, radius } = marble;
        let turns = || spin.is_none_or(|spin| spin == xyz(&self.spin[row]) / radius);
        Point3::from_vec(xyz(at)) == position
            && at[3] == row_radius
            && xyz(velocity) == speed
            && velocity[3].abs() == inverse_mass
            && turns()
            && self.surfaces.get(slot) == surface
            && self.surfaces.layers(slot) == layers
            && self.surfaces.is_kinematic(slot) == is_kinematic
            && self.sleep.sleepless.contains(slot) == is_sleepless
    }

    /// Takes over what changed of bodies, and wakes those.
    pub(crate) fn write_bodies(&mut self, bodies: &[BodyRow<S>]) {
        self.set_layers_of_slots(bodies.iter().map(|body| (body.slot, body.layers)));
        let (mut resized, mut resurfaced, mut lighter) = (false, false, Vec::new());
        for body in bodies {
            let row = self.ids.rows()[body.slot as usize] as usize;
            resurfaced |= self.surfaces.set(body.slot, body.surface)
                | self.surfaces.set_kinematic(body.slot, body.is_kinematic);
            if body.sleeping_disabled {
                self.sleep.sleepless.insert(body.slot);
            } else {
                self.sleep.sleepless.remove(body.slot);
            }
            self.wake(row);
            let at = self.at[row];
            resized |= at[3] != body.at[3];
            self.skin_left[row] -= squared(less(&body.at, &at)).sqrt() + (body.at[3] - at[3]).abs();
            let fraction = self.velocity[row][3] / body.velocity[3];
            // Passes take back impulses up to twice too large.
            if S::zero() < fraction && fraction < S::from_f64(0.5) {
                lighter.push((row, fraction));
            }
            (self.at[row], self.velocity[row]) = (body.at, body.velocity);
            let [x, y, z, _] = body.spin;
            self.spin[row] = [x, y, z, self.spin[row][3]];
        }
        if resized {
            self.measure_radii();
        }
        if resurfaced || !lighter.is_empty() {
            self.forget_contacts();
        }
        if !lighter.is_empty() {
            // Their contacts give them no more velocity than before.
            let lighter = lighter.into_iter().map(|(row, fraction)| (self.old_rows[row], fraction));
            self.impulse_cache.scale(lighter);
        }
    }

    /// Sets the velocity changes besides gravity in the next step, in m/s; those of one slot add up.
    /// Wakes those for which it is another one than in the last step.
    pub(crate) fn set_velocity_changes(&mut self, mut now: Vec<VelocityChange<S>>) {
        now.sort_by_key(|change| change.slot);
        now.dedup_by(|next, sum| {
            let is_same = next.slot == sum.slot;
            if is_same {
                sum.change = [0, 1, 2].map(|axis| sum.change[axis] + next.change[axis]);
            }
            is_same
        });
        // What is no number stops the body, as what overflows does; but it must equal itself.
        for change in now.iter_mut().flat_map(|change| &mut change.change) {
            *change = if change.is_nan() { S::infinity() } else { *change };
        }
        let before = std::mem::take(&mut self.velocity_changes);
        let (mut old, mut new) = (before.iter().peekable(), now.iter().peekable());
        while let Some(slot) = [old.peek(), new.peek()].into_iter().flatten().map(|c| c.slot).min()
        {
            let of_slot = |change: &&VelocityChange<S>| change.slot == slot;
            if old.next_if(of_slot) != new.next_if(of_slot)
                && let Some(row) = self.ids.rows().get(slot as usize).copied()
                && row != NO_ROW
            {
                self.wake(row as usize);
            }
        }
        self.velocity_changes = now;
    }

    /// Applies a fraction of these, where bodies are awake. In that time gravity adds `fall`, in m/s.
    pub(super) fn apply_velocity_changes(&mut self, part: S, fall: Vec3<S>) {
        let rows = self.ids.rows();
        for VelocityChange { slot, change } in &self.velocity_changes {
            let Some(velocity) = self.velocity.get_mut(rows[*slot as usize] as usize) else {
                continue;
            };
            if !velocity[3].is_sign_negative() {
                let before = *velocity;
                for (speed, change) in velocity.iter_mut().zip(change) {
                    *speed += *change * part;
                }
                if let Some(work) = self.scratch.outside_work.get_mut(*slot as usize) {
                    work.record_force(&before, velocity, fall);
                }
            }
        }
    }

    /// Saves where kinematic bodies are at the begin of a step of `dt` seconds.
    pub(super) fn save_kinematic_paths(&mut self, dt: S) {
        let fall: [S; 3] = (self.gravity.unwrap_or_else(Vec3::zero) * dt).into();
        let changes = &self.velocity_changes;
        let paths = &mut self.scratch.kinematic_paths;
        paths.clear();
        paths.extend(self.surfaces.kinematic().filter_map(|slot| {
            let row = self.ids.rows()[slot as usize] as usize;
            let (at, velocity) = (self.at[row], self.velocity[row]);
            let own = changes.binary_search_by_key(&slot, |change| change.slot);
            // Its own change takes gravity back, up to rounding.
            let change = own.map_or([S::zero(); 3], |i| {
                [0, 1, 2].map(|axis| {
                    let sum = changes[i].change[axis] + fall[axis];
                    if sum.abs() > S::from_f64(4.0) * S::epsilon() * fall[axis].abs() {
                        sum
                    } else {
                        S::zero()
                    }
                })
            });
            let is_awake = velocity[3].is_sign_positive();
            is_awake.then_some(KinematicPath { slot, at, velocity, change })
        }));
    }

    /// Puts kinematic bodies where they are after a fraction of the step of `dt` seconds, whatever they met.
    pub(super) fn follow_kinematic_paths(&mut self, part: S, dt: S) {
        for KinematicPath { slot, at, velocity, change } in &self.scratch.kinematic_paths {
            let row = self.ids.rows()[*slot as usize] as usize;
            let mean = |axis: usize| velocity[axis] + S::from_f64(0.5) * part * change[axis];
            let [x, y, z] = [0, 1, 2].map(|axis| at[axis] + mean(axis) * (part * dt));
            let at = [x, y, z, at[3]];
            self.skin_left[row] -= squared(less(&at, &self.at[row])).sqrt();
            self.at[row] = at;
            for axis in 0..3 {
                self.velocity[row][axis] = velocity[axis] + part * change[axis];
            }
        }
    }

    /// Moves bodies that no wall bears by these changes times some seconds: back by half of what
    /// they moved too far by them, as a drift does for gravity.
    pub(super) fn correct_free_flight(&mut self, time: S) {
        let rows = self.ids.rows();
        for VelocityChange { slot, change } in &self.velocity_changes {
            let row = rows[*slot as usize] as usize;
            let Some(at) = self.at.get_mut(row) else { continue };
            let [x, y, z] = *change;
            // Else it has stopped the body.
            let is_sane = largest([x, y, z, S::zero()]) < S::from_f64(MAX_MAGNITUDE);
            if self.spin[row][3] == S::zero()
                && !self.velocity[row][3].is_sign_negative()
                && is_sane
            {
                for (x, change) in at.iter_mut().zip(change) {
                    *x += *change * time;
                }
            }
        }
    }

    /// Writes the rows of bodies back to the columns of the marbles, of which each slot has one or
    /// [none](NO_ROW). What slept through the step is as it was. Rotations go on by `dt` seconds;
    /// with none, only what has just fallen asleep is read. Marbles whose angular velocity overflows
    /// are added to `stopped`, in any order.
    pub(crate) fn read_bodies(
        &mut self,
        marble_of_slot: &[u32],
        columns: BodyColumns<S>,
        dt: Option<S>,
        stopped: &mut Vec<u32>,
    ) {
        let BodyColumns { position, velocity, angular_velocity: spin, rotation, radius } = columns;
        let (position, velocity) = (DisjointSlice::new(position), DisjointSlice::new(velocity));
        let (turns, spin, rotation) =
            (!spin.is_empty(), DisjointSlice::new(spin), DisjointSlice::new(rotation));
        let slots = self.ids.slots();
        let [places, speeds, spins] = [&self.at[..], &self.velocity[..], &self.spin[..]];
        let surfaces = SurfaceOf { model: self.model.material, surfaces: &self.surfaces, slots };
        let non_finite = Mutex::new(stopped);
        let chunks = DisjointSlice::new(&mut self.chunks);
        parallel_for(self.scratch.threads, chunks.len(), |_, chunk| {
            // SAFETY: each thread has its own chunks.
            let chunk = unsafe { &mut *chunks.row(chunk) };
            let unread = std::mem::take(&mut chunk.unread);
            if !unread && (chunk.asleep || dt.is_none()) {
                return;
            }
            for row in chunk.own_rows() {
                let marble = marble_of_slot.get(slots[row] as usize).copied().unwrap_or(NO_ROW);
                let is_asleep = speeds[row][3].is_sign_negative();
                if marble == NO_ROW || !(if is_asleep { unread } else { dt.is_some() }) {
                    continue;
                }
                let marble = marble as usize;
                // SAFETY: a marble is that of one slot, and a slot that of one row.
                unsafe {
                    *position.row(marble) = Point3::from_vec(xyz(&places[row]));
                    *velocity.row(marble) = xyz(&speeds[row]);
                    if turns && !surfaces.row(row as u32).rotation_locked {
                        let rate: Vec3<S> = xyz(&spins[row]) / radius[marble];
                        if !is_finite(rate) {
                            let mut stopped =
                                non_finite.lock().unwrap_or_else(PoisonError::into_inner);
                            stopped.push(marble as u32);
                            continue;
                        }
                        *spin.row(marble) = rate;
                        let rotation = rotation.row(marble);
                        *rotation =
                            dt.map_or(*rotation, |dt| integrate_rotation(*rotation, rate, dt));
                    }
                }
            }
        });
    }

    /// Bounces of the step, if bodies are rows: of slots, in the order in which they were solved.
    pub(crate) fn noted_impacts(&self) -> &[Impact<S>] {
        &self.scratch.impacts
    }

    /// Slots of the balls near walls other than half-spaces.
    pub(crate) fn slots_near_shapes(&self) -> impl Iterator<Item = u32> + '_ {
        let awake = self.chunks.iter().filter(|chunk| !chunk.asleep);
        let rows = awake.flat_map(|chunk| &chunk.near_shapes).map(|row| *row as usize);
        let awake = rows.filter(|row| self.velocity[*row][3].is_sign_positive());
        awake.map(|row| self.ids.slots()[row])
    }

    /// Returns true if a ball sleeps.
    pub(crate) fn is_asleep(&self, ball: BallId) -> bool {
        let row = self.ids.row(ball.0);
        row.is_some_and(|row| self.velocity[row][3].is_sign_negative())
    }

    /// Returns true if the ball of a slot sleeps, if there is one.
    pub(crate) fn is_slot_asleep(&self, slot: u32) -> bool {
        let row = self.ids.rows().get(slot as usize).map(|row| *row as usize);
        let velocity = row.and_then(|row| self.velocity.get(row));
        velocity.is_some_and(|velocity| velocity[3].is_sign_negative())
    }

    /// Position and velocity of a ball, and the speed of its surface by spin, in m/s.
    pub(crate) fn motion_of(&self, ball: BallId) -> Option<(Point3<S>, Vec3<S>, S)> {
        let row = self.ids.row(ball.0)?;
        // The lab's tier has no spin.
        let surface_speed = self.spin.get(row).map_or(S::zero(), |spin| squared(*spin).sqrt());
        Some((Point3::from_vec(xyz(&self.at[row])), xyz(&self.velocity[row]), surface_speed))
    }

    /// Number that changes whenever a ball falls asleep, wakes, comes or goes.
    pub(crate) fn sleep_version(&self) -> u64 {
        *self.sleep_version
    }

    /// Slot of a ball.
    pub(crate) fn slot_of(&self, ball: BallId) -> Option<u32> {
        self.ids.row(ball.0).map(|row| self.ids.slots()[row])
    }

    /// Rows that the last step stopped, as slots.
    pub(crate) fn stopped_slots(&self) -> impl Iterator<Item = u32> + '_ {
        let slots = self.ids.slots();
        self.stopped.iter().filter_map(|row| slots.get(*row as usize).copied())
    }
}
