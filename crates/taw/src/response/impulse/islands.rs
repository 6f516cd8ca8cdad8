//! Islands: connected groups of marbles, each with its own convergence state and search.

use cgmath::InnerSpace;

use super::Constraint;
use super::jam::Load;
use super::rows::{ConstraintRow, SearchDirections};
use crate::math::{Scalar, UnionFind, Vec3};

/// Regularization of the search: additional compliance of a contact, relative to its own, in units
/// of the scalar's rounding. It limits impulses that cancel except for rounding: two walls that
/// press a ball from both sides, each with friction. Sixteen roundings are the error of a velocity
/// after a few contacts; a marble a million times as heavy as the one below it is still held.
const REGULARIZATION: f64 = 16.0;

/// Islands of marbles in contact. They do not influence each other, to the bit.
#[derive(Clone, Debug, Default)]
pub(super) struct Islands<S> {
    sets: UnionFind,
    pub list: Vec<Island<S>>,
}

/// Island: marbles connected by contacts, while it is solved.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "each is a question of its own")]
pub(super) struct Island<S> {
    /// Energy units, so that squares do not underflow: mass in 1/kg, and speed as its reciprocal, in
    /// s/m.
    pub inverse_mass_unit: S,
    pub inverse_speed_unit: S,
    /// Masses and velocities before contacts act.
    pub load: Load<S>,
    /// True if one of its contacts bounces; true if one rests; and the time since the first bounce
    /// in this substep, in seconds.
    pub bounces: bool,
    pub has_resting_contact: bool,
    pub time_since_impact: S,
    /// Largest velocity change in this iteration and in the last one, in m/s.
    pub change: S,
    residual: S,
    /// Number of contact solves, over all iterations.
    pub solve_count: u64,
    /// True once the velocity changes are within the tolerance.
    pub converged: bool,
    /// True if an earlier solution ended before convergence.
    pub incomplete: bool,
    /// True where acceleration pays.
    pub accelerating: bool,
    search: SubspaceSearch<S>,
}

/// Number of search directions: the last iteration, and the accelerated steps before it.
pub(super) const DIRECTIONS: usize = 3;

/// Subspace search: the combination of directions that brings an island nearest to the target
/// velocities of its contacts.
#[derive(Clone, Copy, Debug)]
struct SubspaceSearch<S> {
    /// Linear and quadratic terms of the energy over the directions.
    gradient: [S; DIRECTIONS],
    curvature: [[S; DIRECTIONS]; DIRECTIONS],
    /// Coefficient of each direction.
    weights: [S; DIRECTIONS],
    /// Fraction of the step at which the first normal impulse vanishes.
    cone_exit: S,
    /// True if friction cones clamp the step.
    friction_clamped: bool,
    /// Linear and quadratic term of the energy along the step projected to the cones.
    projected_gradient: S,
    projected_curvature: S,
}

impl<S: Scalar> Islands<S> {
    /// Largest velocity change in the last iteration, in m/s.
    pub fn residual(&self) -> S {
        self.list.iter().fold(S::zero(), |max, island| max.max(island.residual))
    }

    /// Number of contact solves, over all iterations.
    pub fn solve_count(&self) -> u64 {
        self.list.iter().map(|island| island.solve_count).sum()
    }

    /// Number of islands.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// Island by its index.
    #[inline]
    pub fn of(&self, island: u32) -> &Island<S> {
        &self.list[island as usize]
    }

    /// Island by its index.
    #[inline]
    pub fn of_mut(&mut self, island: u32) -> &mut Island<S> {
        &mut self.list[island as usize]
    }

    /// Island of a marble, by its row; none if nothing touches it.
    pub fn of_row(&mut self, row: usize) -> Option<&mut Island<S>> {
        self.sets.known_set_of(row).map(|set| &mut self.list[set as usize])
    }

    /// Restarts the iterations of some islands; all others count as converged.
    pub fn restart(&mut self, which: impl Fn(usize) -> bool) {
        for (number, island) in self.list.iter_mut().enumerate() {
            island.incomplete |= !island.converged;
            island.converged = !which(number);
            island.accelerating = false;
        }
    }

    /// Assigns contacts to islands.
    pub fn build(&mut self, constraints: &mut [Constraint<S>], rows: usize, speed_unit: S) {
        self.sets.build(constraints.iter().map(|c| (c.a.marble(), c.b)), rows);
        self.list.clear();
        for c in constraints {
            c.island = self.sets.set_of(c.b);
            if c.island as usize == self.list.len() {
                self.list.push(Island::new(c.inverse_effective_mass.normal, speed_unit));
            }
        }
    }
}

impl<S: Scalar> Island<S> {
    fn new(inverse_mass_unit: S, speed_unit: S) -> Self {
        let (zero, one) = (S::zero(), S::one());
        Self {
            inverse_mass_unit,
            inverse_speed_unit: Some(speed_unit.recip()).filter(|r| r.is_finite()).unwrap_or(one),
            load: Load::none(),
            bounces: false,
            has_resting_contact: false,
            time_since_impact: zero,
            change: zero,
            residual: zero,
            solve_count: 0,
            converged: false,
            incomplete: false,
            accelerating: false,
            search: SubspaceSearch::new(),
        }
    }

    /// Ends an iteration.
    pub fn end_iteration(&mut self, restitution_threshold: S, tolerance: S) {
        // The rest is below what the next iteration could resolve.
        self.converged = self.change <= tolerance;
        // Close to convergence plain iterations come to rest, which the search does not quite.
        self.accelerating =
            !self.converged && self.change > restitution_threshold * S::from_f64(1e-5);
        self.residual = self.change;
        self.change = S::zero();
    }

    /// Product of an impulse (as a speed: times the inverse effective mass) and a velocity at a
    /// contact, in units of the island.
    #[inline]
    pub fn energy(&self, inverse_effective_mass: S, impulse: Vec3<S>, velocity: Vec3<S>) -> S {
        let weight = self.inverse_mass_unit / inverse_effective_mass;
        (impulse * self.inverse_speed_unit).dot(velocity * self.inverse_speed_unit) * weight
    }

    /// Product of an angular impulse (in kg m²/s) and a spin, in units of the island.
    pub fn angular_energy(&self, angular_impulse: Vec3<S>, spin: Vec3<S>) -> S {
        (angular_impulse * self.inverse_speed_unit).dot(spin * self.inverse_speed_unit)
            * self.inverse_mass_unit
    }

    /// Resets the search.
    pub fn begin_search(&mut self) {
        self.search = SubspaceSearch::new();
    }

    /// Adds the terms of one contact for each direction; `rounding` is the error of its velocities,
    /// in m/s.
    #[inline]
    pub fn add_directions(
        &mut self,
        row: &ConstraintRow<S>,
        search: &SearchDirections<S>,
        rounding: S,
    ) {
        let scale = self.inverse_speed_unit;
        let weight = self.inverse_mass_unit / row.inverse_effective_mass;
        let regularization = S::epsilon() * S::from_f64(REGULARIZATION);
        let directions = search.directions.map(|direction| direction * scale);
        let velocities = search.velocities.map(|velocity| velocity * scale);
        let (error, rounding) = (search.velocity_error * scale, rounding * scale);
        let SubspaceSearch { gradient, curvature, .. } = &mut self.search;
        for (row, direction) in directions.iter().enumerate() {
            let squared = direction.magnitude2();
            gradient[row] += direction.dot(error) * weight;
            curvature[row][row] += (squared * regularization + squared.sqrt() * rounding) * weight;
            for (column, velocity) in velocities.iter().enumerate().take(row + 1) {
                curvature[row][column] += direction.dot(*velocity) * weight;
            }
        }
    }

    /// Solves for the weights of the directions.
    pub fn solve_weights(&mut self) {
        self.search.solve_weights();
    }

    /// Weighted sum of one vector per direction.
    pub fn combine(&self, vectors: &[Vec3<S>; DIRECTIONS]) -> Vec3<S> {
        let weights = self.search.weights;
        vectors[0] * weights[0] + vectors[1] * weights[1] + vectors[2] * weights[2]
    }

    /// Records where the step leaves a contact's cone, and if friction clamps it.
    pub fn add_cone_limit(&mut self, cone_exit: S, friction_clamped: bool) {
        self.search.cone_exit = self.search.cone_exit.min(cone_exit);
        self.search.friction_clamped |= friction_clamped;
    }

    /// Adds the terms of one contact for the projected step.
    pub fn add_projected(&mut self, row: &ConstraintRow<S>, search: &SearchDirections<S>) {
        let mass = row.inverse_effective_mass;
        let (direction, velocity) = (search.directions[1], search.velocities[1]);
        self.search.projected_gradient += self.energy(mass, direction, search.velocity_error);
        let regularization = direction * (S::epsilon() * S::from_f64(REGULARIZATION));
        self.search.projected_curvature += self.energy(mass, direction, velocity + regularization);
    }

    /// Chooses between the projected step and the straight step up to the exit from the first cone:
    /// the one that lowers the energy more.
    pub fn choose_step(&self) -> SearchStep<S> {
        self.search.choose_step()
    }
}

/// Chosen step, with the fraction of it to take.
#[derive(Clone, Copy, Debug)]
pub(super) enum SearchStep<S> {
    Projected(S),
    Straight(S),
}

impl<S: Scalar> SubspaceSearch<S> {
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

    /// Solves `curvature · weights = gradient` (Cholesky 1910), without directions that depend on
    /// others.
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
            // A direction counts if half of the digits of its pivot are its own.
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
        let half = S::from_f64(0.5);
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
