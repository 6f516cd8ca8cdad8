//! Islands: groups of marbles that touch each other, and how far each is from agreeing.

use cgmath::InnerSpace;

use super::Constraint;
use crate::math::{Scalar, Vec3, direction_and_length};

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
    /// True once the contacts have what they ask for.
    pub agrees: bool,
    /// True if iterations ended before that, even if a later solution agreed.
    pub gave_up: bool,
    /// True where it pays to go further.
    pub searches: bool,
    search: Search<S>,
}

/// Directions that a search looks along: the last sweep, and the ways that it went before.
pub(super) const DIRECTIONS: usize = 3;

/// A search for the impulses, of all that are some of each direction, that bring an island nearest
/// to what its contacts ask for.
#[derive(Clone, Copy, Debug)]
struct Search<S> {
    /// The energy that a unit of each direction gains at first, and what each costs beside each.
    wish: [S; DIRECTIONS],
    cost: [[S; DIRECTIONS]; DIRECTIONS],
    /// Coefficients of the directions.
    parts: [S; DIRECTIONS],
    /// Part of that way up to where the first contact comes to bear nothing.
    short: S,
    /// True if the bounds of friction bend the way.
    slips: bool,
    /// The energy that a unit of the way within the cones gains at first, and what it costs.
    bent_wish: S,
    bent_cost: S,
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
            island.searches = false;
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
            island.searches = !island.agrees && island.change > bounce_speed * S::constant(1e-5);
            island.residual = island.change;
            island.change = S::zero();
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
            agrees: false,
            gave_up: false,
            searches: false,
            search: Search::new(),
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

    /// Begins a search.
    pub fn begin_search(&mut self) {
        self.search = Search::new();
    }

    /// Adds what a contact's part of each direction gains and costs, if the velocities that it gives
    /// are known to this rounding, in m/s.
    pub fn count_directions(&mut self, c: &Constraint<S>, rounding: S) {
        let more = S::epsilon() * S::constant(YIELD);
        for (row, way) in c.ways.iter().enumerate() {
            let Some((direction, _)) = direction_and_length(*way) else { continue };
            self.search.wish[row] += self.energy(c, *way, c.wanted);
            let unknown = *way * more + direction * rounding;
            self.search.cost[row][row] += self.energy(c, *way, unknown);
            for (column, given) in c.given.iter().enumerate().take(row + 1) {
                self.search.cost[row][column] += self.energy(c, *way, *given);
            }
        }
    }

    /// Finds how much of each direction is best.
    pub fn choose_parts(&mut self) {
        self.search.choose_parts();
    }

    /// Those parts of some vectors, one for each direction.
    pub fn combine(&self, of: &[Vec3<S>; DIRECTIONS]) -> Vec3<S> {
        let parts = self.search.parts;
        of[0] * parts[0] + of[1] * parts[1] + of[2] * parts[2]
    }

    /// Notes that the way leaves a contact's cone at this part of it, or that friction bends it.
    pub fn count_cone(&mut self, leaves: S, slips: bool) {
        self.search.short = self.search.short.min(leaves);
        self.search.slips |= slips;
    }

    /// Adds what a contact's part of the way within the cones gains and costs, if it gives this
    /// velocity.
    pub fn count_bent(&mut self, c: &Constraint<S>, way: Vec3<S>, given: Vec3<S>) {
        self.search.bent_wish += self.energy(c, way, c.wanted);
        let more = way * (S::epsilon() * S::constant(YIELD));
        self.search.bent_cost += self.energy(c, way, given + more);
    }

    /// Part to go of the way within the cones, or of the straight way to where the first
    /// contact bears nothing any more: whichever lowers the energy more.
    pub fn go(&self) -> Go<S> {
        self.search.go()
    }
}

/// How far to go, as a part.
#[derive(Clone, Copy, Debug)]
pub(super) enum Go<S> {
    Bent(S),
    Straight(S),
}

impl<S: Scalar> Search<S> {
    fn new() -> Self {
        let zero = S::zero();
        Self {
            wish: [zero; DIRECTIONS],
            cost: [[zero; DIRECTIONS]; DIRECTIONS],
            parts: [zero; DIRECTIONS],
            short: S::infinity(),
            slips: false,
            bent_wish: zero,
            bent_cost: zero,
        }
    }

    /// Solves `cost · parts = wish` (Cholesky 1910), without directions that say nothing that others
    /// do not.
    fn choose_parts(&mut self) {
        let (cost, zero) = (self.cost, S::zero());
        let mut root = [[zero; DIRECTIONS]; DIRECTIONS];
        let mut parts = [zero; DIRECTIONS];
        for row in 0..DIRECTIONS {
            for column in 0..row {
                let known = (0..column).fold(zero, |sum, k| sum + root[row][k] * root[column][k]);
                let pivot = root[column][column];
                if pivot > zero {
                    root[row][column] = (cost[row][column] - known) / pivot;
                }
            }
            let known = (0..row).fold(zero, |sum, k| sum + root[row][k] * root[row][k]);
            let pivot = cost[row][row] - known;
            // Half of the digits are left to what a direction says that others do not.
            if pivot > cost[row][row] * S::epsilon().sqrt() && pivot.is_finite() {
                let known = (0..row).fold(zero, |sum, k| sum + root[row][k] * parts[k]);
                root[row][row] = pivot.sqrt();
                parts[row] = (self.wish[row] - known) / root[row][row];
            } else {
                root[row] = [zero; DIRECTIONS];
            }
        }
        for row in (0..DIRECTIONS).rev() {
            let pivot = root[row][row];
            if pivot > zero {
                let known =
                    (row + 1..DIRECTIONS).fold(zero, |sum, k| sum + root[k][row] * parts[k]);
                parts[row] = (parts[row] - known) / pivot;
            }
        }
        if parts.iter().all(|part| part.is_finite()) {
            self.parts = parts;
        }
    }

    fn go(&self) -> Go<S> {
        let half = S::constant(0.5);
        let gain = |part: S, wish: S, cost: S| part * wish - part * part * cost * half;
        let bent = self.bent_wish / self.bent_cost;
        let bent = if bent > S::zero() { bent.min(S::one()) } else { S::zero() };
        let (mut wish, mut cost) = (S::zero(), S::zero());
        for row in 0..DIRECTIONS {
            wish += self.parts[row] * self.wish[row];
            for column in 0..DIRECTIONS {
                let of_both = self.cost[row.max(column)][row.min(column)];
                cost += self.parts[row] * self.parts[column] * of_both;
            }
        }
        let gains_bent = gain(bent, self.bent_wish, self.bent_cost);
        if !self.slips && self.short < S::one() && gain(self.short, wish, cost) > gains_bent {
            Go::Straight(self.short)
        } else {
            Go::Bent(bent)
        }
    }
}
