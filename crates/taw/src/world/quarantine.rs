//! What turns infinite or NaN stops, is named, and is forgotten by what contacts remember; so
//! nothing else learns of it.

use cgmath::One;

use super::World;
use super::marbles::{MarbleId, Marbles, Rest};
use crate::Error;
use crate::broad::Period;
use crate::error::{positive, within};
use crate::math::{Point3, Quat, Scalar, is_finite, is_finite_point};
use crate::response::Response;

/// Where marbles were when the substep began, and who was stopped since the step did.
#[derive(Clone, Debug)]
pub(super) struct Quarantine<S> {
    position: Vec<Point3<S>>,
    rotation: Vec<Quat<S>>,
    /// Rows as they were are those of now only if none went.
    removals: u64,
    /// In the order of their handles, each once.
    pub named: Vec<MarbleId>,
}

impl<S> Default for Quarantine<S> {
    fn default() -> Self {
        Self { position: Vec::new(), rotation: Vec::new(), removals: 0, named: Vec::new() }
    }
}

impl<S: Scalar> Quarantine<S> {
    /// Notes where all are, which is finite.
    fn note(&mut self, marbles: &Marbles<S>) {
        self.removals = marbles.removals();
        self.position.clear();
        self.position.extend_from_slice(marbles.position());
        self.rotation.clear();
        self.rotation.extend_from_slice(marbles.rotation());
    }

    /// Puts a row back to where it was noted, as far as it is nowhere now.
    fn put_back(&self, marbles: &mut Marbles<S>, row: usize) {
        let position = self.position.get(row).filter(|_| self.removals == marbles.removals());
        if !is_finite_point(marbles.position[row]) {
            marbles.position[row] =
                position.copied().unwrap_or_else(|| Point3::from([S::zero(); 3]));
            if let Some(rest) = marbles.rest.get_mut(row) {
                *rest = Rest::default();
            }
        }
        if let Some(rotation) = marbles.rotation.get_mut(row)
            && !(rotation.s.is_finite() && is_finite(rotation.v))
        {
            *rotation = self.rotation.get(row).copied().unwrap_or_else(Quat::one);
        }
    }
}

impl<S: Scalar> World<S> {
    /// The shortest and the longest time, in seconds, that a step and each of its substeps can
    /// be: its square and the reciprocal of that are numbers of `f32`, in which the swarm counts
    /// in any world.
    pub const TIMES: [f64; 2] = [1e-18, 1e18];

    /// The length of a substep, if a step of `dt` seconds can be made.
    pub(crate) fn substep_of(&self, dt: S) -> Result<S, Error> {
        let substeps = S::constant(f64::from(self.model.substeps));
        let [least, most] = Self::TIMES.map(S::constant);
        within("dt", positive("dt", dt)?, least * substeps, most)?;
        self.takes_all_marbles()?;
        Ok(dt / substeps)
    }

    /// `dt`, if a substep can be so long.
    pub(crate) fn checked_dt(dt: S) -> Result<S, Error> {
        let [least, most] = Self::TIMES.map(S::constant);
        within("dt", positive("dt", dt)?, least, most)
    }

    /// Nothing, if the response knows what all marbles are.
    pub(crate) fn takes_all_marbles(&self) -> Result<(), Error> {
        self.takes_marbles_in(self.marbles.period)?;
        match self.marbles.first_capsule() {
            Some(id) if self.model.response == Response::EventDriven => Err(Error::BallsOnly(id)),
            _ => Ok(()),
        }
    }

    /// Nothing, if all marbles are balls that fit into a period.
    pub(super) fn takes_marbles_in(&self, period: Period<S>) -> Result<(), Error> {
        if period.is_open() {
            return Ok(());
        }
        if let Some(id) = self.marbles.first_capsule() {
            return Err(Error::BallsOnly(id));
        }
        period.check_radii(self.marbles.radius())
    }

    /// Notes where all marbles are, before any of them moves.
    pub(super) fn note_places(&mut self) {
        self.quarantine.note(&self.marbles);
    }

    /// Stops what is no longer finite, where it was when the substep began, and names it with
    /// those that a verb has stopped by itself.
    pub(super) fn stop_what_is_not_finite(&mut self) {
        let mad = (0..self.marbles.len()).filter(|row| !self.marbles.is_sane(*row));
        self.stopped.extend(mad.map(|row| row as u32));
        if self.stopped.is_empty() {
            return;
        }
        let mut rows = std::mem::take(&mut self.stopped);
        rows.sort_unstable();
        rows.dedup();
        for row in rows.iter().map(|row| *row as usize) {
            self.quarantine.put_back(&mut self.marbles, row);
            self.marbles.stop(row);
        }
        let stays = |row: usize| rows.binary_search(&(row as u32)).is_err().then_some(row);
        self.warm.retain_mut(|warm| warm.remap(stays));
        self.events.impulse_cache.retain_mut(|warm| warm.remap(stays));
        self.shear
            .retain(|shear| shear.rows().into_iter().flatten().all(|row| stays(row).is_some()));
        self.quarantine.named.extend(rows.iter().filter_map(|row| self.marbles.id(*row as usize)));
        self.quarantine.named.sort_unstable();
        self.quarantine.named.dedup();
        rows.clear();
        self.stopped = rows;
    }
}
