//! Islands: groups of marbles that touch each other, and how far each is from agreeing.

use cgmath::InnerSpace;

use super::Constraint;
use crate::math::{Scalar, Vec3};

/// Where a sweep has less than this part of the energy of the one before, sweeps alone
/// are quick enough.
const SLOW: f64 = 0.6;
/// How much a contact gives way beyond what its marbles do, as a part of that, in units of the
/// scalar's rounding. So a search never goes far along impulses that cancel in all but rounding:
/// two walls that press a ball from both sides, each with friction. Sixteen roundings are what
/// a velocity has after a few contacts; a marble is held that is a million times as heavy as
/// what carries it.
const YIELD: f64 = 16.0;

/// Groups of marbles that touch each other. What happens in one is nothing to the others,
/// to the bit.
#[derive(Clone, Debug, Default)]
pub(super) struct Islands<S> {
    groups: Groups,
    pub list: Vec<Island<S>>,
    /// Number of times that a contact was solved.
    pub solved: u64,
}

/// Which marbles touch each other, over how many others.
#[derive(Clone, Debug, Default)]
pub(crate) struct Groups {
    /// For each row, one of its group that is nearer to its first.
    parent: Vec<u32>,
    /// For each row that is the first of a group, which one.
    number: Vec<u32>,
    count: u32,
}

impl Groups {
    /// Finds who touches whom (Tarjan 1975).
    pub fn find(&mut self, pairs: impl Iterator<Item = (Option<usize>, usize)>, rows: usize) {
        self.parent.clear();
        self.parent.extend(0..rows as u32);
        for (a, b) in pairs {
            let Some(a) = a else { continue };
            let (first, second) = (self.first(a), self.first(b));
            self.parent[first.max(second)] = first.min(second) as u32;
        }
        self.number.clear();
        self.number.resize(rows, u32::MAX);
        self.count = 0;
    }

    /// Number of a row's group, by the order in which they are asked for.
    pub fn of(&mut self, row: usize) -> u32 {
        let first = self.first(row);
        if self.number[first] == u32::MAX {
            self.number[first] = self.count;
            self.count += 1;
        }
        self.number[first]
    }

    /// First row of a row's group. Halves the way there for the next time.
    fn first(&mut self, row: usize) -> usize {
        let mut row = row as u32;
        while self.parent[row as usize] != row {
            let above = self.parent[row as usize];
            self.parent[row as usize] = self.parent[above as usize];
            row = above;
        }
        row as usize
    }
}

/// A group of marbles that touch each other, while it is solved.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "each is a question of its own")]
pub(super) struct Island<S> {
    /// Units of energy, so that squares do not vanish: 1/kg and m/s.
    mobility: S,
    speed: S,
    /// Whether one of its contacts bounces, and one does not; and the time since the first bounce in this
    /// substep, in seconds.
    pub bounces: bool,
    pub leans: bool,
    pub since: S,
    /// The largest change of a velocity in this sweep and in the last, in m/s.
    pub change: S,
    residual: S,
    /// The energy of all changes in this sweep and in the last.
    pub squared: S,
    last: S,
    /// True once the contacts have what they ask for.
    pub agrees: bool,
    /// True if iterations ended before that, even if a later solution agreed.
    pub gave_up: bool,
    /// Whether it pays to go further, and which part of the way before to keep.
    pub searches: bool,
    pub kept: S,
    /// Whether the way leaves the cones of its contacts.
    pub bends: bool,
    /// The energy that a unit of the way gains at first, and what it costs.
    wish: S,
    cost: S,
}

impl<S: Scalar> Islands<S> {
    /// The largest change of a velocity in the last sweep, in m/s.
    pub fn residual(&self) -> S {
        self.list.iter().fold(S::zero(), |most, island| most.max(island.residual))
    }

    /// The number of islands.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// The island of a contact.
    #[inline]
    pub fn of(&self, c: &Constraint<S>) -> &Island<S> {
        &self.list[c.island as usize]
    }

    /// The island of a contact.
    #[inline]
    pub fn of_mut(&mut self, c: &Constraint<S>) -> &mut Island<S> {
        &mut self.list[c.island as usize]
    }

    /// The island of a contact, if it searches.
    #[inline]
    pub fn searching(&mut self, c: &Constraint<S>) -> Option<&mut Island<S>> {
        Some(self.of_mut(c)).filter(|island| island.searches)
    }

    /// Sets some islands back to where the sweeps begin, and none of the others.
    pub fn begin_again(&mut self, which: impl Fn(usize) -> bool) {
        for (number, island) in self.list.iter_mut().enumerate() {
            island.gave_up |= !island.agrees;
            island.agrees = !which(number);
            (island.last, island.searches, island.kept) = (S::zero(), false, S::zero());
        }
    }

    /// Finds which contacts are of one island.
    pub fn find(&mut self, constraints: &mut [Constraint<S>], rows: usize, speed: S) {
        self.groups.find(constraints.iter().map(|c| (c.a.marble(), c.b)), rows);
        self.list.clear();
        self.solved = 0;
        for c in constraints {
            c.island = self.groups.of(c.b);
            if c.island as usize == self.list.len() {
                self.list.push(Island::new(c.mobility.normal, speed));
            }
        }
    }

    /// Looks back at a sweep. True if all islands agree.
    pub fn end_sweep(&mut self, bounce_speed: S, enough: S) -> bool {
        for island in self.list.iter_mut().filter(|island| !island.agrees) {
            // What is left is beyond what the next sweep could still see.
            island.agrees = island.change <= enough;
            // Near the end the sweeps alone come to rest, which the search does not quite.
            let ratio = island.squared / island.last;
            let slow = ratio >= S::constant(SLOW) || ratio.is_nan();
            island.searches =
                slow && !island.agrees && island.change > bounce_speed * S::constant(1e-5);
            // Where the steps grow, it starts anew.
            island.kept = if ratio < S::one() { ratio } else { S::zero() };
            island.last = island.squared;
            island.residual = island.change;
            island.bends = false;
            (island.change, island.squared) = (S::zero(), S::zero());
        }
        self.list.iter().all(|island| island.agrees)
    }
}

impl<S: Scalar> Island<S> {
    fn new(mobility: S, speed: S) -> Self {
        let (zero, one) = (S::zero(), S::one());
        Self {
            mobility,
            speed: if speed > zero { speed } else { one },
            bounces: false,
            leans: false,
            since: zero,
            change: zero,
            residual: zero,
            squared: zero,
            last: zero,
            agrees: false,
            gave_up: false,
            searches: false,
            kept: zero,
            bends: false,
            wish: zero,
            cost: zero,
        }
    }

    /// An impulse (as a speed, times the mobility) on a contact times a velocity there, in
    /// units of the island.
    #[inline]
    pub fn energy(&self, c: &Constraint<S>, impulse: Vec3<S>, velocity: Vec3<S>) -> S {
        let weight = self.mobility / c.mobility.normal;
        (impulse / self.speed).dot(velocity / self.speed) * weight
    }

    /// An angular impulse (in kg m²/s) times a spin, in units of the island.
    pub fn energy_of_twist(&self, twist: Vec3<S>, spin: Vec3<S>) -> S {
        (twist / self.speed).dot(spin / self.speed) * self.mobility
    }

    /// Begins to sum up a way.
    pub fn begin_way(&mut self) {
        (self.wish, self.cost) = (S::zero(), S::zero());
    }

    /// Adds what a contact's part of the way gains and costs, if it gives this velocity.
    pub fn count_way(&mut self, c: &Constraint<S>, given: Vec3<S>) {
        self.wish += self.energy(c, c.way, c.wanted);
        let more = c.way * (S::epsilon() * S::constant(YIELD));
        self.cost += self.energy(c, c.way, given + more);
    }

    /// How far it is best to go along the way, in units of it; never back.
    pub fn far(&self) -> S {
        let far = self.wish / self.cost;
        if far > S::zero() && far.is_finite() { far } else { S::zero() }
    }
}
