//! Islands: groups of marbles that touch each other, and how far each is from agreeing.

use cgmath::InnerSpace;

use super::Constraint;
use crate::math::{Scalar, Vec3, direction_and_length};

/// How much a contact gives way beyond what its marbles do, as a part of that, in units of the
/// scalar's rounding. So a search never goes far along impulses that cancel in all but rounding:
/// two walls that press a ball from both sides, each with friction. Sixteen roundings are what
/// a velocity has after a few contacts; a marble is held that is a million times as heavy as
/// what carries it.
const REGULARIZATION: f64 = 16.0;

/// Groups of marbles that touch each other. What happens in one is nothing to the others,
/// to the bit.
#[derive(Clone, Debug, Default)]
pub(super) struct Islands<S> {
    sets: UnionFind,
    pub list: Vec<Island<S>>,
    /// Number of times that a contact was solved.
    pub solve_count: u64,
}

/// Which marbles touch each other, over how many others.
#[derive(Clone, Debug, Default)]
pub(crate) struct UnionFind {
    /// For each row, one of its group that is nearer to its first.
    parent: Vec<u32>,
    /// For each row that is the first of a group, which one.
    island_of_root: Vec<u32>,
    count: u32,
}

impl UnionFind {
    /// Finds who touches whom (Tarjan 1975).
    pub fn build(&mut self, pairs: impl Iterator<Item = (Option<usize>, usize)>, rows: usize) {
        self.parent.clear();
        self.parent.extend(0..rows as u32);
        for (a, b) in pairs {
            let Some(a) = a else { continue };
            let (root_a, root_b) = (self.root(a), self.root(b));
            self.parent[root_a.max(root_b)] = root_a.min(root_b) as u32;
        }
        self.island_of_root.clear();
        self.island_of_root.resize(rows, u32::MAX);
        self.count = 0;
    }

    /// Number of a row's group, by the order in which they are asked for.
    pub fn set_of(&mut self, row: usize) -> u32 {
        let root = self.root(row);
        if self.island_of_root[root] == u32::MAX {
            self.island_of_root[root] = self.count;
            self.count += 1;
        }
        self.island_of_root[root]
    }

    /// First row of a row's group. Halves the way there for the next time.
    fn root(&mut self, row: usize) -> usize {
        let mut row = row as u32;
        while self.parent[row as usize] != row {
            let grandparent = self.parent[row as usize];
            self.parent[row as usize] = self.parent[grandparent as usize];
            row = grandparent;
        }
        row as usize
    }
}

/// A group of marbles that touch each other, while it is solved.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "each is a question of its own")]
pub(super) struct Island<S> {
    /// Units of energy, so that squares do not vanish: 1/kg and m/s.
    inverse_mass_unit: S,
    speed_unit: S,
    /// Whether one of its contacts bounces, and one does not; and the time since the first bounce in this
    /// substep, in seconds.
    pub bounces: bool,
    pub has_resting_contact: bool,
    pub time_since_impact: S,
    /// The largest change of a velocity in this sweep and in the last, in m/s.
    pub change: S,
    residual: S,
    /// True once the contacts have what they ask for.
    pub converged: bool,
    /// True if iterations ended before that, even if a later solution agreed.
    pub incomplete: bool,
    /// True where it pays to go further.
    pub accelerating: bool,
    search: Search<S>,
}

/// Directions that a search looks along: the last sweep, and the ways that it went before.
pub(super) const DIRECTIONS: usize = 3;

/// A search for the impulses, of all that are some of each direction, that bring an island nearest
/// to what its contacts ask for.
#[derive(Clone, Copy, Debug)]
struct Search<S> {
    /// The energy that a unit of each direction gains at first, and what each costs beside each.
    gradient: [S; DIRECTIONS],
    curvature: [[S; DIRECTIONS]; DIRECTIONS],
    /// Coefficients of the directions.
    weights: [S; DIRECTIONS],
    /// Part of that way up to where the first contact comes to bear nothing.
    cone_exit: S,
    /// True if the bounds of friction bend the way.
    friction_clamped: bool,
    /// The energy that a unit of the way within the cones gains at first, and what it costs.
    projected_gradient: S,
    projected_curvature: S,
}

impl<S: Scalar> Islands<S> {
    /// The largest change of a velocity in the last sweep, in m/s.
    pub fn residual(&self) -> S {
        self.list.iter().fold(S::zero(), |max, island| max.max(island.residual))
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
    pub fn accelerating(&mut self, c: &Constraint<S>) -> Option<&mut Island<S>> {
        Some(self.of_mut(c)).filter(|island| island.accelerating)
    }

    /// Sets some islands back to where the sweeps begin, and none of the others.
    pub fn restart(&mut self, which: impl Fn(usize) -> bool) {
        for (number, island) in self.list.iter_mut().enumerate() {
            island.incomplete |= !island.converged;
            island.converged = !which(number);
            island.accelerating = false;
        }
    }

    /// Finds which contacts are of one island.
    pub fn build(&mut self, constraints: &mut [Constraint<S>], rows: usize, speed_unit: S) {
        self.sets.build(constraints.iter().map(|c| (c.a.marble(), c.b)), rows);
        self.list.clear();
        self.solve_count = 0;
        for c in constraints {
            c.island = self.sets.set_of(c.b);
            if c.island as usize == self.list.len() {
                self.list.push(Island::new(c.inverse_effective_mass.normal, speed_unit));
            }
        }
    }

    /// Looks back at a sweep. True if all islands agree.
    pub fn end_iteration(&mut self, restitution_threshold: S, tolerance: S) -> bool {
        for island in self.list.iter_mut().filter(|island| !island.converged) {
            // What is left is beyond what the next sweep could still see.
            island.converged = island.change <= tolerance;
            // Near the end the sweeps alone come to rest, which the search does not quite.
            island.accelerating =
                !island.converged && island.change > restitution_threshold * S::constant(1e-5);
            island.residual = island.change;
            island.change = S::zero();
        }
        self.list.iter().all(|island| island.converged)
    }
}

impl<S: Scalar> Island<S> {
    fn new(inverse_mass_unit: S, speed_unit: S) -> Self {
        let (zero, one) = (S::zero(), S::one());
        Self {
            inverse_mass_unit,
            speed_unit: if speed_unit > zero { speed_unit } else { one },
            bounces: false,
            has_resting_contact: false,
            time_since_impact: zero,
            change: zero,
            residual: zero,
            converged: false,
            incomplete: false,
            accelerating: false,
            search: Search::new(),
        }
    }

    /// An impulse (as a speed, times the mobility) on a contact times a velocity there, in
    /// units of the island.
    #[inline]
    pub fn energy(&self, c: &Constraint<S>, impulse: Vec3<S>, velocity: Vec3<S>) -> S {
        let weight = self.inverse_mass_unit / c.inverse_effective_mass.normal;
        (impulse / self.speed_unit).dot(velocity / self.speed_unit) * weight
    }

    /// An angular impulse (in kg m²/s) times a spin, in units of the island.
    pub fn angular_energy(&self, angular_impulse: Vec3<S>, spin: Vec3<S>) -> S {
        (angular_impulse / self.speed_unit).dot(spin / self.speed_unit) * self.inverse_mass_unit
    }

    /// Begins a search.
    pub fn begin_search(&mut self) {
        self.search = Search::new();
    }

    /// Adds what a contact's part of each direction gains and costs, if the velocities that it gives
    /// are known to this rounding, in m/s.
    pub fn add_directions(&mut self, c: &Constraint<S>, rounding: S) {
        let regularization = S::epsilon() * S::constant(REGULARIZATION);
        for (row, direction) in c.search_directions.iter().enumerate() {
            let Some((unit, _)) = direction_and_length(*direction) else { continue };
            self.search.gradient[row] += self.energy(c, *direction, c.velocity_error);
            let uncertainty = *direction * regularization + unit * rounding;
            self.search.curvature[row][row] += self.energy(c, *direction, uncertainty);
            for (column, velocity) in c.direction_velocities.iter().enumerate().take(row + 1) {
                self.search.curvature[row][column] += self.energy(c, *direction, *velocity);
            }
        }
    }

    /// Finds how much of each direction is best.
    pub fn solve_weights(&mut self) {
        self.search.solve_weights();
    }

    /// Those parts of some vectors, one for each direction.
    pub fn combine(&self, vectors: &[Vec3<S>; DIRECTIONS]) -> Vec3<S> {
        let weights = self.search.weights;
        vectors[0] * weights[0] + vectors[1] * weights[1] + vectors[2] * weights[2]
    }

    /// Notes that the way leaves a contact's cone at this part of it, or that friction bends it.
    pub fn add_cone_limit(&mut self, cone_exit: S, friction_clamped: bool) {
        self.search.cone_exit = self.search.cone_exit.min(cone_exit);
        self.search.friction_clamped |= friction_clamped;
    }

    /// Adds what a contact's part of the way within the cones gains and costs, if it gives this
    /// velocity.
    pub fn add_projected(&mut self, c: &Constraint<S>, direction: Vec3<S>, velocity: Vec3<S>) {
        self.search.projected_gradient += self.energy(c, direction, c.velocity_error);
        let regularization = direction * (S::epsilon() * S::constant(REGULARIZATION));
        self.search.projected_curvature += self.energy(c, direction, velocity + regularization);
    }

    /// Part to go of the way within the cones, or of the straight way to where the first
    /// contact bears nothing any more: whichever lowers the energy more.
    pub fn choose_step(&self) -> SearchStep<S> {
        self.search.choose_step()
    }
}

/// How far to go, as a part.
#[derive(Clone, Copy, Debug)]
pub(super) enum SearchStep<S> {
    Projected(S),
    Straight(S),
}

impl<S: Scalar> Search<S> {
    fn new() -> Self {
        let zero = S::zero();
        Self {
            gradient: [zero; DIRECTIONS],
            curvature: [[zero; DIRECTIONS]; DIRECTIONS],
            weights: [zero; DIRECTIONS],
            cone_exit: S::infinity(),
            friction_clamped: false,
            projected_gradient: zero,
            projected_curvature: zero,
        }
    }

    /// Solves `curvature · weights = gradient` (Cholesky 1910), without directions that say nothing that others
    /// do not.
    fn solve_weights(&mut self) {
        let (curvature, zero) = (self.curvature, S::zero());
        let mut factor = [[zero; DIRECTIONS]; DIRECTIONS];
        let mut weights = [zero; DIRECTIONS];
        for row in 0..DIRECTIONS {
            for column in 0..row {
                let known =
                    (0..column).fold(zero, |sum, k| sum + factor[row][k] * factor[column][k]);
                let pivot = factor[column][column];
                if pivot > zero {
                    factor[row][column] = (curvature[row][column] - known) / pivot;
                }
            }
            let known = (0..row).fold(zero, |sum, k| sum + factor[row][k] * factor[row][k]);
            let pivot = curvature[row][row] - known;
            // Half of the digits are left to what a direction says that others do not.
            if pivot > curvature[row][row] * S::epsilon().sqrt() && pivot.is_finite() {
                let known = (0..row).fold(zero, |sum, k| sum + factor[row][k] * weights[k]);
                factor[row][row] = pivot.sqrt();
                weights[row] = (self.gradient[row] - known) / factor[row][row];
            } else {
                factor[row] = [zero; DIRECTIONS];
            }
        }
        for row in (0..DIRECTIONS).rev() {
            let pivot = factor[row][row];
            if pivot > zero {
                let known =
                    (row + 1..DIRECTIONS).fold(zero, |sum, k| sum + factor[k][row] * weights[k]);
                weights[row] = (weights[row] - known) / pivot;
            }
        }
        if weights.iter().all(|weight| weight.is_finite()) {
            self.weights = weights;
        }
    }

    fn choose_step(&self) -> SearchStep<S> {
        let half = S::constant(0.5);
        let decrease = |fraction: S, gradient: S, curvature: S| {
            fraction * gradient - fraction * fraction * curvature * half
        };
        let projected = self.projected_gradient / self.projected_curvature;
        let projected = if projected > S::zero() { projected.min(S::one()) } else { S::zero() };
        let (mut gradient, mut curvature) = (S::zero(), S::zero());
        for row in 0..DIRECTIONS {
            gradient += self.weights[row] * self.gradient[row];
            for column in 0..DIRECTIONS {
                let entry = self.curvature[row.max(column)][row.min(column)];
                curvature += self.weights[row] * self.weights[column] * entry;
            }
        }
        let projected_decrease =
            decrease(projected, self.projected_gradient, self.projected_curvature);
        if !self.friction_clamped
            && self.cone_exit < S::one()
            && decrease(self.cone_exit, gradient, curvature) > projected_decrease
        {
            SearchStep::Straight(self.cone_exit)
        } else {
            SearchStep::Projected(projected)
        }
    }
}
