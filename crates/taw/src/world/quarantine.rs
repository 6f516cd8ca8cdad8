//! Quarantine of non-finite bodies: a marble whose state overflows is stopped and reported, and its
//! cached contact impulses are dropped, so that no other marble is affected.

use cgmath::One;

use super::World;
use super::marbles::{Compensation, Marbles};
use crate::Error;
use crate::broad::Period;
use crate::error::{positive, within};
use crate::math::{Point3, Quat, Scalar, is_finite, is_finite_point};
use crate::response::rename_rows;

/// Reason for which a step stopped a marble.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum StopReason {
    /// Its position, rotation or velocity overflowed. No other marble is affected.
    NotFinite,
    /// It still had events when the budget of the step was spent, by
    /// [`Response::EventDriven`](crate::response::Response::EventDriven): thousands of collisions within a step, as between walls that close.
    EventBudget,
}

/// Poses at the start of the substep.
#[derive(Clone, Debug, Default)]
pub(super) struct StoredPoses<S> {
    position: Vec<Point3<S>>,
    rotation: Vec<Quat<S>>,
    /// Number of removals at that time: with others, the stored indices are stale.
    removals: u64,
}

impl<S: Scalar> StoredPoses<S> {
    /// Stores the poses, which are finite.
    fn store(&mut self, marbles: &Marbles<S>) {
        self.removals = marbles.removals();
        self.position.clear();
        self.position.extend_from_slice(marbles.position());
        self.rotation.clear();
        self.rotation.extend_from_slice(marbles.rotation());
    }

    /// Restores the stored pose of a marble where the current one is not finite.
    fn restore(&self, marbles: &mut Marbles<S>, row: usize) {
        let is_known = self.removals == marbles.removals();
        let position = self.position.get(row).filter(|_| is_known);
        if !is_finite_point(marbles.position[row]) {
            marbles.position[row] =
                position.copied().unwrap_or_else(|| Point3::from([S::zero(); 3]));
            if let Some(low) = marbles.compensation.get_mut(row) {
                *low = Compensation::default();
            }
        }
        if let Some(rotation) = marbles.rotation.get_mut(row)
            && !(rotation.s.is_finite() && is_finite(rotation.v))
        {
            let known = self.rotation.get(row).filter(|_| is_known);
            *rotation = known.copied().unwrap_or_else(Quat::one);
        }
    }
}

impl<S: Scalar> World<S> {
    /// Shortest and longest duration in seconds of a step and of each substep: their squares and
    /// reciprocals are representable in either scalar.
    pub const TIMES: [f64; 2] = [1e-18, 1e18];

    /// Length of a substep; validates a step of `dt` seconds.
    pub(crate) fn validated_substep(&self, dt: S) -> Result<S, Error> {
        let substeps = S::from_f64(f64::from(self.settings.model.substeps));
        let passes = S::from_f64(f64::from(self.settings.model.passes()));
        let [least, most] = Self::TIMES.map(S::from_f64);
        within("dt", positive("dt", dt)?, least * substeps, most)?;
        self.check_shapes()?;
        Ok(dt / passes)
    }

    /// Validates the length of a substep.
    pub(crate) fn validated_dt(dt: S) -> Result<S, Error> {
        let [least, most] = Self::TIMES.map(S::from_f64);
        within("dt", positive("dt", dt)?, least, most)
    }

    /// Checks that the response supports all marbles: their shapes, and their numbers.
    pub(crate) fn check_shapes(&self) -> Result<(), Error> {
        self.check_period(self.marbles.period)?;
        self.check_joints()?;
        self.check_bodies()?;
        self.check_locked_axes()?;
        self.check_rows()?;
        match self.marbles.first_capsule() {
            Some(id) if !self.settings.model.response.knows_capsules() => {
                Err(Error::UnsupportedShape(id))
            }
            _ => Ok(()),
        }
    }

    /// Checks that all marbles are balls that fit into a period.
    pub(super) fn check_period(&self, period: Period<S>) -> Result<(), Error> {
        if period.is_open() {
            return Ok(());
        }
        if self.settings.model.response.uses_swarm_rows() {
            return Err(Error::Unsupported { response: "SoftStep", feature: "a period" });
        }
        if let Some(id) = self.marbles.first_capsule() {
            return Err(Error::UnsupportedShape(id));
        }
        period.check_radii(self.marbles.radius())
    }

    /// Stores the poses of all marbles before any of them moves.
    pub(super) fn store_poses(&mut self) {
        self.scratch.stored_poses.store(&self.marbles);
    }

    /// Stops marbles with non-finite state where they were at the start of the substep, and reports
    /// them together with those that a stage has stopped itself.
    pub(super) fn quarantine_non_finite(&mut self) {
        let non_finite = (0..self.marbles.len()).filter(|row| !self.marbles.is_finite_state(*row));
        self.scratch.stopped.extend(non_finite.map(|row| row as u32));
        self.quarantine_stopped();
    }

    /// Stops marbles that a stage has found to be non-finite, and reports them.
    pub(super) fn quarantine_stopped(&mut self) {
        if self.scratch.stopped.is_empty() {
            return;
        }
        let mut rows = std::mem::take(&mut self.scratch.stopped);
        rows.sort_unstable();
        rows.dedup();
        for row in rows.iter().map(|row| *row as usize) {
            self.scratch.stored_poses.restore(&mut self.marbles, row);
            self.marbles.stop(row);
        }
        let stays = |row: usize| rows.binary_search(&(row as u32)).is_err().then_some(row);
        rename_rows(&mut self.memory.impulses, stays);
        rename_rows(&mut self.memory.springs, stays);
        rename_rows(&mut self.memory.event_impulses, stays);
        // Of those that other responses stop, none is left from its time.
        let events = self.settings.model.response.has_event_budget();
        let unfinished = if events { self.scratch.events.unfinished.as_slice() } else { &[] };
        self.quarantined.extend(rows.iter().filter_map(|row| {
            let was_finite = unfinished.contains(row);
            let reason = if was_finite { StopReason::EventBudget } else { StopReason::NotFinite };
            Some((self.marbles.id(*row as usize)?, reason))
        }));
        self.quarantined.sort_unstable();
        self.quarantined.dedup_by_key(|(id, _)| *id);
        rows.clear();
        self.scratch.stopped = rows;
    }
}
