//! Columns of sleep, of methods that list contacts: how long each marble has rested, and who sleeps.

use std::num::NonZeroU32;

use cgmath::Zero;

use crate::math::{Point3, Scalar, Vec3};
use crate::motion::rest::{self, lasts, time_of_rest};

/// Number of a group of marbles that fell asleep together, and wake together.
pub(super) type SleepGroup = NonZeroU32;

/// Rest and sleep by row; empty while no marble may sleep.
#[derive(Clone, Debug, PartialEq, Default)]
pub(super) struct SleepColumns<S> {
    rest: Vec<Rest<S>>,
    /// None for a marble that is awake.
    group: Vec<Option<SleepGroup>>,
    sleepers: usize,
    last_group: u32,
    /// Number of times that marbles fell asleep or woke.
    version: u64,
    /// Substeps since islands were searched.
    pub clock: u32,
    /// Sleepers that were set or taken out since somebody looked who leant on them.
    disturbed: Vec<Disturbed<S>>,
}

/// Place of a ball and its time of rest, as [`time_of_rest`] has them, and the force, in N, that was applied to
/// it when it fell asleep.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Rest<S> {
    place: [S; 4],
    time: S,
    force: Vec3<S>,
}

/// A sleeper that was set or taken out: where it slept, and with whom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Disturbed<S> {
    pub center: Point3<S>,
    pub reach: S,
    pub group: SleepGroup,
}

impl<S: Scalar> Rest<S> {
    fn moving() -> Self {
        let (place, time) = ([S::max_value(); 4], S::from_f64(rest::MOVES));
        Self { place, time, force: Vec3::zero() }
    }
}

impl<S: Scalar> SleepColumns<S> {
    /// Gives the columns this many rows; new ones are awake.
    pub fn resize(&mut self, rows: usize) {
        self.rest.resize(rows, Rest::moving());
        self.group.resize(rows, None);
    }

    /// Follows a marble that came, if there are columns.
    pub fn push(&mut self) {
        if !self.rest.is_empty() {
            self.resize(self.rest.len() + 1);
        }
    }

    /// Follows a marble that goes, of this reach in metres.
    pub fn swap_remove(&mut self, row: usize, reach: S) {
        self.disturb(row, reach);
        if row < self.rest.len() {
            self.rest.swap_remove(row);
            let group = self.group.swap_remove(row);
            self.sleepers -= usize::from(group.is_some());
            self.version += u64::from(group.is_some());
        }
    }

    /// Empties the columns: all marbles are awake.
    pub fn clear(&mut self) {
        *self = Self { version: self.version + u64::from(self.sleepers > 0), ..Self::default() };
    }

    /// Wakes all.
    pub fn wake_all(&mut self) {
        let rows = self.rest.len();
        self.clear();
        self.resize(rows);
    }

    /// Ends the rest of a marble, of this reach in metres, that somebody sets or takes out. If it sleeps, it
    /// and those near it wake with the next verb.
    pub fn disturb(&mut self, row: usize, reach: S) {
        let Some(rest) = self.rest.get_mut(row) else { return };
        let time = std::mem::replace(&mut rest.time, S::from_f64(rest::MOVES));
        if let Some(group) = self.group[row]
            && time >= S::zero()
        {
            let [x, y, z, _] = rest.place;
            self.disturbed.push(Disturbed { center: Point3::new(x, y, z), reach, group });
        }
    }

    /// Sleepers that were set or taken out.
    pub fn take_disturbed(&mut self) -> Vec<Disturbed<S>> {
        std::mem::take(&mut self.disturbed)
    }

    #[inline]
    pub fn is_asleep(&self, row: usize) -> bool {
        self.group_of(row).is_some()
    }

    /// Returns true if two marbles sleep.
    #[inline]
    pub fn are_asleep(&self, rows: [u32; 2]) -> bool {
        rows.into_iter().all(|row| self.is_asleep(row as usize))
    }

    #[inline]
    pub fn group_of(&self, row: usize) -> Option<SleepGroup> {
        self.group.get(row).copied().flatten()
    }

    /// Force that was applied to a sleeper when it fell asleep, in N.
    pub fn force(&self, row: usize) -> Vec3<S> {
        self.rest[row].force
    }

    /// Number of marbles that sleep.
    pub fn sleepers(&self) -> usize {
        self.sleepers
    }

    /// Number that changes whenever a marble falls asleep or wakes.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Rows of those that sleep.
    pub fn asleep(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.group.len()).filter(|row| self.is_asleep(*row))
    }

    /// Rows of those that are awake.
    pub fn awake(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.group.len()).filter(|row| !self.is_asleep(*row))
    }

    /// Wakes groups, which are sorted, and lists the rows of their marbles.
    pub fn wake(&mut self, groups: &[SleepGroup], woken: &mut Vec<u32>) {
        let before = woken.len();
        for (row, its) in self.group.iter_mut().enumerate() {
            if its.is_some_and(|group| groups.binary_search(&group).is_ok()) {
                *its = None;
                self.rest[row].time = S::from_f64(rest::MOVES);
                woken.push(row as u32);
            }
        }
        self.sleepers -= woken.len() - before;
        self.version += u64::from(woken.len() > before);
    }

    /// Lets a marble rest for another `dt` seconds, if it `rests`: at this center and radius, with this
    /// square of its speed.
    pub fn update(&mut self, row: usize, at: &[S; 4], square: S, rests: bool, dt: S) {
        let Rest { place, time, .. } = &mut self.rest[row];
        *time = time_of_rest((place, *time), at, square, rests, dt);
    }

    /// Returns true if a marble has rested for long enough to sleep.
    pub fn lasts(&self, row: usize, radius: S, gravity: S) -> bool {
        lasts(self.rest[row].time, radius, gravity)
    }

    /// Begins a group of sleepers.
    pub fn new_group(&mut self) -> SleepGroup {
        self.last_group = self.last_group.wrapping_add(1).max(1);
        SleepGroup::MIN.saturating_add(self.last_group - 1)
    }

    /// Lets a marble fall asleep at this center, under this force.
    pub fn fall_asleep(
        &mut self,
        row: usize,
        group: SleepGroup,
        center: Point3<S>,
        force: Vec3<S>,
    ) {
        let rest = &mut self.rest[row];
        (rest.place, rest.force) = ([center.x, center.y, center.z, S::zero()], force);
        self.group[row] = Some(group);
        self.sleepers += 1;
    }

    /// Notes that some fell asleep.
    pub fn mark_changed(&mut self) {
        self.version += 1;
    }
}
