//! Rest: how long each ball has stayed where it is.

use super::INFINITE_MASS;
use super::kernels::squared;
use super::state::of;
use crate::math::{Row, Scalar};
use crate::motion::rest::{LEFT, MOVES, is_slow, lasts, time_of_rest};
use crate::workers::DisjointSlice;

/// Where balls rest and for how long, by row; empty if none may sleep.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct RestColumns<S> {
    /// Center in metres when the ball came there, and speed in m/s when it began to rest.
    pub place: Vec<Row<S>>,
    /// Time of rest in seconds, or [`MOVES`] or [`LEFT`].
    pub time: Vec<S>,
}

impl<S: Scalar> RestColumns<S> {
    /// Gives them this many rows. New ones move.
    pub fn resize(&mut self, rows: usize) {
        self.place.resize(rows, [S::max_value(); 4]);
        self.time.resize(rows, S::from_f64(MOVES));
        if rows == 0 {
            *self = Self::default();
        }
    }

    /// Ends the rest of a ball.
    pub fn end(&mut self, row: usize) {
        if let Some(time) = self.time.get_mut(row) {
            *time = S::from_f64(MOVES);
        }
    }

    /// Ends the rest of all.
    pub fn end_all(&mut self) {
        self.time.fill(S::from_f64(MOVES));
    }

    /// Returns true if a ball left its place in this step.
    pub fn has_left(&self, row: usize) -> bool {
        self.time[row] == S::from_f64(LEFT)
    }

    /// Returns true if a ball rests.
    pub fn is_at_rest(&self, row: usize) -> bool {
        self.time.get(row).is_some_and(|time| *time >= S::zero())
    }

    /// Returns true if any ball rests.
    pub fn is_any_at_rest(&self) -> bool {
        self.time.iter().any(|time| *time >= S::zero())
    }

    /// Returns true if a ball has rested for long enough to sleep under gravity, in m/s².
    pub fn lasts(&self, row: usize, radius: S, gravity: S) -> bool {
        lasts(self.time[row], radius, gravity)
    }

    pub fn bytes(&self) -> usize {
        of(&self.place) + of(&self.time)
    }

    /// Columns for several threads.
    pub fn shared(&mut self) -> SharedRest<'_, S> {
        SharedRest {
            place: DisjointSlice::new(&mut self.place),
            time: DisjointSlice::new(&mut self.time),
        }
    }
}

/// [`RestColumns`] that several threads work on.
#[derive(Clone, Copy)]
pub(super) struct SharedRest<'a, S> {
    pub place: DisjointSlice<'a, Row<S>>,
    pub time: DisjointSlice<'a, S>,
}

/// Rest of some rows.
pub(super) struct RestRows<'a, S> {
    pub place: &'a mut [Row<S>],
    pub time: &'a mut [S],
}

impl<S: Scalar> RestRows<'_, S> {
    /// Looks, `dt` seconds after the last time, which balls that are awake rest under gravity, in m/s².
    /// Proxies are moved by others, and rest wherever they stay.
    pub fn update(
        &mut self,
        [at, velocity, spin]: [&[Row<S>]; 3],
        is_proxy: impl Fn(usize) -> bool,
        gravity: S,
        dt: S,
    ) {
        let rows = at.iter().zip(velocity).zip(spin).zip(&mut *self.place).zip(&mut *self.time);
        for (row, ((((at, velocity), spin), place), time)) in rows.enumerate() {
            if velocity[3].is_sign_negative() {
                continue;
            }
            let square = squared(*velocity);
            let is_slow = is_slow(square, gravity, at[3]);
            // The mark is that of the last step.
            let is_borne = || velocity[3] > S::from_f64(INFINITE_MASS) && spin[3] > S::zero();
            let rests = is_proxy(row) || is_slow && (is_borne() || !moves(at, velocity, spin, dt));
            *time = time_of_rest((place, *time), at, square, rests, dt);
        }
    }

    /// Ends the rest of a ball.
    pub fn end(&mut self, row: usize) {
        self.time[row] = S::from_f64(MOVES);
    }

    /// Ends the rest of all.
    pub fn end_all(&mut self) {
        self.time.fill(S::from_f64(MOVES));
    }

    /// Returns true if a ball has rested for long enough that one of this radius, in metres, sleeps under
    /// gravity, in m/s².
    pub fn lasts(&self, row: usize, radius: S, gravity: S) -> bool {
        lasts(self.time[row], radius, gravity)
    }
}

/// Returns true if a ball moves on or turns in `dt` seconds by more than its coordinates are rounded: one of
/// infinite mass is borne by nothing, but the solver leaves it that much.
fn moves<S: Scalar>(at: &Row<S>, velocity: &Row<S>, spin: &Row<S>, dt: S) -> bool {
    let size = at.iter().fold(S::zero(), |most, x| most.max(x.abs()));
    let rounding =
        if velocity[3] > S::from_f64(INFINITE_MASS) { S::zero() } else { S::epsilon() * size };
    squared(*velocity).max(squared(*spin)).sqrt() * dt > rounding
}
