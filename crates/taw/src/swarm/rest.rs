//! Rest: how long each ball has stayed where it is.

use super::INFINITE_MASS;
use super::kernels::squared;
use super::simd::Row;
use super::state::of;
use crate::workers::DisjointSlice;

/// Speed below which a ball counts as resting, over that which it gets when it falls by half of its radius.
const SLOW: f32 = 0.05;
/// Least time of rest before a ball sleeps, in seconds, and in times that it needs to fall by half its
/// radius: the larger a ball, the longer it lingers where it turns back.
const TIME: f32 = 0.5;
const FALLS: f32 = 5.0;
/// Distance in radii that a ball at rest keeps to, unless it is slow and does not speed up: without rolling
/// resistance, a slow one on a level floor rolls on for ever. A ball that begins to roll down a slope
/// of .33° goes further in that time, and one under 10 cm down a gentler slope.
pub(super) const PLACE: f32 = 0.05;
/// Speed over that at the beginning up to which a ball does not speed up: one that rolls down a slope
/// of .08° gains more in that time.
const STEADY: f32 = 1.1;

/// Values of the time of rest of a ball that moves, and of one that has just gone further than [`PLACE`].
const MOVES: f32 = -1.0;
const LEFT: f32 = -2.0;

/// Where balls rest and for how long, by row; empty if none may sleep.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct RestColumns {
    /// Center in metres when the ball came there, and speed in m/s when it began to rest.
    pub place: Vec<Row>,
    /// Time of rest in seconds, or [`MOVES`] or [`LEFT`].
    pub time: Vec<f32>,
}

impl RestColumns {
    /// Gives them this many rows. New ones move.
    pub fn resize(&mut self, rows: usize) {
        self.place.resize(rows, [f32::MAX; 4]);
        self.time.resize(rows, MOVES);
        if rows == 0 {
            *self = Self::default();
        }
    }

    /// Ends the rest of a ball.
    pub fn end(&mut self, row: usize) {
        if let Some(time) = self.time.get_mut(row) {
            *time = MOVES;
        }
    }

    /// Ends the rest of all.
    pub fn end_all(&mut self) {
        self.time.fill(MOVES);
    }

    /// Returns true if a ball left its place in this step.
    pub fn has_left(&self, row: usize) -> bool {
        self.time[row] == LEFT
    }

    /// Returns true if a ball rests.
    pub fn is_at_rest(&self, row: usize) -> bool {
        self.time.get(row).is_some_and(|time| *time >= 0.0)
    }

    /// Returns true if any ball rests.
    pub fn is_any_at_rest(&self) -> bool {
        self.time.iter().any(|time| *time >= 0.0)
    }

    /// Returns true if a ball has rested for long enough to sleep under gravity, in m/s².
    pub fn lasts(&self, row: usize, radius: f32, gravity: f32) -> bool {
        lasts(self.time[row], radius, gravity)
    }

    pub fn bytes(&self) -> usize {
        of(&self.place) + of(&self.time)
    }

    /// Columns for several threads.
    pub fn shared(&mut self) -> SharedRest<'_> {
        SharedRest {
            place: DisjointSlice::new(&mut self.place),
            time: DisjointSlice::new(&mut self.time),
        }
    }
}

/// [`RestColumns`] that several threads work on.
#[derive(Clone, Copy)]
pub(super) struct SharedRest<'a> {
    pub place: DisjointSlice<'a, Row>,
    pub time: DisjointSlice<'a, f32>,
}

/// Rest of some rows.
pub(super) struct RestRows<'a> {
    pub place: &'a mut [Row],
    pub time: &'a mut [f32],
}

impl RestRows<'_> {
    /// Looks, `dt` seconds after the last time, which balls that are awake rest under gravity, in m/s².
    /// Proxies are moved by others, and rest wherever they stay.
    pub fn update(
        &mut self,
        [at, velocity, spin]: [&[Row]; 3],
        is_proxy: impl Fn(usize) -> bool,
        gravity: f32,
        dt: f32,
    ) {
        let rows = at.iter().zip(velocity).zip(spin).zip(&mut *self.place).zip(&mut *self.time);
        for (row, ((((at, velocity), spin), place), time)) in rows.enumerate() {
            if velocity[3].is_sign_negative() {
                continue;
            }
            let square = squared(*velocity);
            let is_slow = square < SLOW * SLOW * gravity * at[3];
            // The mark is that of the last step.
            let is_borne = || velocity[3] > INFINITE_MASS && spin[3] > 0.0;
            let rests = is_proxy(row) || is_slow && (is_borne() || !moves(at, velocity, spin, dt));
            let away = squared([at[0] - place[0], at[1] - place[1], at[2] - place[2], 0.0]);
            let is_near = away <= PLACE * PLACE * at[3] * at[3];
            let is_steady = |first: f32| square <= STEADY * STEADY * first * first;
            *time = if rests && *time >= 0.0 && (is_near || is_steady(place[3])) {
                *time + dt
            } else if !is_near {
                *place = [at[0], at[1], at[2], square.sqrt()];
                LEFT
            } else if rests && *time < 0.0 {
                place[3] = square.sqrt();
                0.0
            } else {
                MOVES
            };
        }
    }

    /// Ends the rest of a ball.
    pub fn end(&mut self, row: usize) {
        self.time[row] = MOVES;
    }

    /// Ends the rest of all.
    pub fn end_all(&mut self) {
        self.time.fill(MOVES);
    }

    /// Returns true if a ball has rested for long enough that one of this radius, in metres, sleeps under
    /// gravity, in m/s².
    pub fn lasts(&self, row: usize, radius: f32, gravity: f32) -> bool {
        lasts(self.time[row], radius, gravity)
    }
}

fn lasts(time: f32, radius: f32, gravity: f32) -> bool {
    time > TIME && time * time * gravity > FALLS * FALLS * radius
}

/// Returns true if a ball moves on or turns in `dt` seconds by more than its coordinates are rounded: one of
/// infinite mass is borne by nothing, but the solver leaves it that much.
fn moves(at: &Row, velocity: &Row, spin: &Row, dt: f32) -> bool {
    let size = at.iter().fold(0.0_f32, |most, x| most.max(x.abs()));
    let rounding = if velocity[3] > INFINITE_MASS { 0.0 } else { f32::EPSILON * size };
    squared(*velocity).max(squared(*spin)).sqrt() * dt > rounding
}

/// Speed in m/s up to which a ball counts as resting, by gravity in m/s² and its radius in metres.
pub(super) fn sleep_speed(gravity: f32, radius: f32) -> f32 {
    SLOW * (gravity * radius).sqrt()
}
