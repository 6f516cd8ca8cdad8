//! No energy from nothing. Newton's restitution and friction, each right in its own contact,
//! can together gain energy in several contacts at once (Kane and Levinson, *Dynamics: theory
//! and applications*, 1985): such collisions rebound less. And what iterations leave undone, or
//! remember wrongly from the last substep, must not gain either.

use cgmath::{InnerSpace, Zero};

use super::islands::Islands;
use super::solve::iterate;
use super::{Constraint, SolverSettings};
use crate::math::{Scalar, Vec3};
use crate::response::SolverBodies;

/// A gain below this part of what the impulses exchange is what the sweeps left over.
const GAIN_TOLERANCE: f64 = 1e-5;

/// Energy balance of an island's impulses, in units of the island.
#[derive(Clone, Copy, Debug)]
pub(super) struct IslandEnergy<S> {
    bounces: bool,
    /// The energy that came in by the impulses as they are.
    work: S,
    /// Energy exchanged through the contacts, the scale for `work`.
    exchanged: S,
    /// Coefficients of the energy `linear x + quadratic x²` that comes in with a part `x` of something.
    linear: S,
    quadratic: S,
}

impl<S: Scalar> IslandEnergy<S> {
    fn new() -> Self {
        let zero = S::zero();
        Self { bounces: false, work: zero, exchanged: zero, linear: zero, quadratic: zero }
    }

    fn gains(&self) -> bool {
        self.work > self.exchanged * S::constant(GAIN_TOLERANCE)
    }

    /// The largest part of the rebound that gains nothing.
    fn max_restitution_fraction(&self) -> S {
        let Self { work, linear, quadratic, .. } = *self;
        let root = (linear * linear - S::constant(4.0) * quadratic * work).sqrt();
        // Of the two forms of the solution, the one that subtracts nothing.
        let fraction = if linear > S::zero() {
            work * S::constant(-2.0) / (linear + root)
        } else {
            (root - linear) / (quadratic * S::constant(2.0))
        };
        if fraction > S::zero() { fraction.min(S::one()) } else { S::zero() }
    }

    /// The part of all impulses that leaves the least energy.
    fn min_energy_fraction(&self) -> S {
        let fraction = -self.linear / (self.quadratic * S::constant(2.0));
        if fraction > S::zero() && fraction.is_finite() { fraction } else { S::zero() }
    }
}

/// State of a contact with full restitution.
#[derive(Clone, Copy, Debug)]
pub(super) struct FullRestitution<S> {
    impulse: Vec3<S>,
    angular_impulse: Vec3<S>,
    /// The relative velocity of the two points afterwards, in m/s, and how they turn, in rad/s.
    relative_velocity: Vec3<S>,
    relative_spin: Vec3<S>,
}

impl<S: Scalar> SolverBodies<'_, S> {
    /// Finds the islands whose solution gained energy, solves them without rebound, which
    /// hardly ever does, and puts as much of the rebound back as gains nothing. Both keep to
    /// the contacts and to the cones of friction, so what is between them does, too. Where
    /// the sweeps ended too soon even for that, they begin anew, [pushes before
    /// friction](Self::solve_normals_before_friction).
    pub(super) fn limit_energy(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &mut Islands<S>,
        energies: &mut Vec<IslandEnergy<S>>,
        full_restitution: &mut Vec<FullRestitution<S>>,
        settings: &SolverSettings<S>,
    ) {
        self.measure_energy(constraints, islands, energies);
        if energies.iter().any(|energy| energy.bounces && energy.gains()) {
            self.reduce_restitution(constraints, islands, energies, full_restitution, settings);
            self.measure_energy(constraints, islands, energies);
        }
        if energies.iter().any(IslandEnergy::gains) {
            self.solve_normals_before_friction(constraints, islands, energies, settings);
        }
        self.stop_approaches(constraints, islands);
    }

    /// Pushes, without more friction, at what still approaches. Two walls whose friction presses a
    /// ball into the other have no solution that sweeps could reach; and a ball that went on into
    /// one of them would be lifted out, which is energy. To end an approach only lowers it. Walls,
    /// which come first, have the last word.
    fn stop_approaches(&mut self, constraints: &mut [Constraint<S>], islands: &Islands<S>) {
        let indices = 0..constraints.len();
        for index in indices.clone().chain(indices.rev()) {
            let c = &mut constraints[index];
            let missing_speed =
                c.target_without_restitution() - self.relative_velocity_of(c).dot(c.normal);
            let island = islands.of(c);
            let unfinished = island.bounces || island.incomplete || !island.converged;
            if unfinished && missing_speed > self.velocity_rounding(c) && missing_speed.is_finite()
            {
                self.add_impulse(c, c.normal * missing_speed);
            }
        }
    }

    fn reduce_restitution(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &mut Islands<S>,
        energies: &mut Vec<IslandEnergy<S>>,
        full_restitution: &mut Vec<FullRestitution<S>>,
        settings: &SolverSettings<S>,
    ) {
        let gaining: Vec<_> = energies.iter().map(|it| it.bounces && it.gains()).collect();
        full_restitution.clear();
        full_restitution.extend(constraints.iter().map(|c| FullRestitution {
            impulse: c.impulse(),
            angular_impulse: c.angular_impulse(),
            relative_velocity: self.relative_velocity_of(c),
            relative_spin: self.relative_spin(c),
        }));
        for c in constraints.iter_mut().filter(|c| c.bounces && gaining[c.island as usize]) {
            (c.target_normal_velocity, c.target_tangent_velocity) = (
                c.target_without_restitution(),
                c.velocity_since_impact - c.normal * c.velocity_since_impact.dot(c.normal),
            );
        }
        islands.restart(|island| gaining[island]);
        iterate(self, constraints, islands, settings);
        self.measure_energy(constraints, islands, energies);
        let half = S::constant(0.5);
        for (c, full) in constraints.iter().zip(full_restitution.iter()) {
            let energy = &mut energies[c.island as usize];
            let (relative_velocity, relative_spin) =
                (self.relative_velocity_of(c), self.relative_spin(c));
            let (impulse, angular_impulse) =
                (full.impulse - c.impulse(), full.angular_impulse - c.angular_impulse());
            let (velocity_change, spin_change) =
                (full.relative_velocity - relative_velocity, full.relative_spin - relative_spin);
            let island = islands.of(c);
            energy.linear += island.energy(c, impulse, c.mean_velocity(relative_velocity))
                + island.energy(c, c.impulse(), velocity_change * half)
                + island.angular_energy(
                    angular_impulse,
                    (c.initial_relative_spin + relative_spin) * half,
                )
                + island.angular_energy(c.angular_impulse(), spin_change * half);
            energy.quadratic += island.energy(c, impulse, velocity_change * half)
                + island.angular_energy(angular_impulse, spin_change * half);
        }
        for (c, full) in constraints.iter_mut().zip(full_restitution) {
            if gaining[c.island as usize] {
                let fraction = energies[c.island as usize].max_restitution_fraction();
                self.add_impulse(c, (full.impulse - c.impulse()) * fraction);
                self.add_angular_impulse(
                    c,
                    (full.angular_impulse - c.angular_impulse()) * fraction,
                );
            }
        }
    }

    /// Solves islands that gain energy in a way that never does, however few the sweeps. First
    /// all pushes, without friction: each step of a sweep lowers the energy, from none. They
    /// rebound as Poisson says, by their impulses, no further than energy allows. Then friction,
    /// within the bounds that these pushes give, beside pushes that only grow: again each step
    /// lowers the energy.
    fn solve_normals_before_friction(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &mut Islands<S>,
        energies: &mut Vec<IslandEnergy<S>>,
        settings: &SolverSettings<S>,
    ) {
        let gaining: Vec<_> = energies.iter().map(IslandEnergy::gains).collect();
        let mut gaining_constraints: Vec<_> =
            constraints.iter_mut().filter(|c| gaining[c.island as usize]).collect();
        let mut friction = Vec::with_capacity(gaining_constraints.len());
        for c in &mut gaining_constraints {
            self.add_impulse(c, -c.impulse());
            self.add_angular_impulse(c, -c.angular_impulse());
            c.rolling = None;
            friction.push(std::mem::replace(&mut c.friction, S::zero()));
            (c.target_normal_velocity, c.target_tangent_velocity) = (
                c.target_without_restitution(),
                if c.bounces {
                    c.velocity_since_impact - c.normal * c.velocity_since_impact.dot(c.normal)
                } else {
                    Vec3::zero()
                },
            );
        }
        islands.restart(|island| gaining[island]);
        iterate(self, constraints, islands, settings);
        self.apply_poisson_restitution(constraints, islands, energies, &gaining);
        let gaining_constraints = constraints.iter_mut().filter(|c| gaining[c.island as usize]);
        for (c, friction) in gaining_constraints.zip(friction) {
            c.normal_impulse = c.normal_impulse.max(S::zero()); // rounding
            (c.min_normal_impulse, c.friction_bound) =
                (c.normal_impulse, friction * c.normal_impulse);
        }
        islands.restart(|island| gaining[island]);
        iterate(self, constraints, islands, settings);
    }

    /// Makes pushes that ended approaches as much larger as restitution says (Poisson 1838): the
    /// least restitution of the bounces in an island, and no more than gains nothing.
    fn apply_poisson_restitution(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &Islands<S>,
        energies: &mut Vec<IslandEnergy<S>>,
        gaining: &[bool],
    ) {
        self.measure_scaling(constraints, islands, energies);
        let mut min_restitution = vec![S::one(); energies.len()];
        for c in constraints.iter().filter(|c| c.normal_impulse > S::zero()) {
            let restitution = if c.bounces { c.restitution } else { S::zero() };
            let min_restitution = &mut min_restitution[c.island as usize];
            *min_restitution = min_restitution.min(restitution);
        }
        for c in constraints.iter_mut().filter(|c| gaining[c.island as usize]) {
            let island = c.island as usize;
            let best = energies[island].min_energy_fraction();
            // Between nothing and twice the best part, energy is lost.
            let fraction = (S::one() + min_restitution[island]).min(best + best).max(S::zero());
            self.add_impulse(c, c.impulse() * (fraction - S::one()));
        }
    }

    /// Shortens all impulses of an island, alike, to what leaves the least energy, where they
    /// bring some in: a guess that no longer fits.
    pub(super) fn limit_warm_start(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &Islands<S>,
        energies: &mut Vec<IslandEnergy<S>>,
    ) {
        self.measure_energy(constraints, islands, energies);
        if !energies.iter().any(IslandEnergy::gains) {
            return;
        }
        let gaining: Vec<_> = energies.iter().map(IslandEnergy::gains).collect();
        self.measure_scaling(constraints, islands, energies);
        for c in constraints.iter_mut().filter(|c| gaining[c.island as usize]) {
            let change = energies[c.island as usize].min_energy_fraction().min(S::one()) - S::one();
            self.add_impulse(c, c.impulse() * change);
            self.add_angular_impulse(c, c.angular_impulse() * change);
        }
    }

    /// Counts what a part of all impulses would do to the energy.
    fn measure_scaling(
        &self,
        constraints: &[Constraint<S>],
        islands: &Islands<S>,
        energies: &mut Vec<IslandEnergy<S>>,
    ) {
        self.measure_energy(constraints, islands, energies);
        let half = S::constant(0.5);
        for c in constraints {
            let energy = &mut energies[c.island as usize];
            let island = islands.of(c);
            let velocity_change = self.relative_velocity_of(c) - c.initial_relative_velocity;
            let spin_change = self.relative_spin(c) - c.initial_relative_spin;
            energy.linear +=
                island.energy(c, c.impulse(), c.mean_velocity(c.initial_relative_velocity))
                    + island.angular_energy(c.angular_impulse(), c.initial_relative_spin);
            energy.quadratic += island.energy(c, c.impulse(), velocity_change * half)
                + island.angular_energy(c.angular_impulse(), spin_change * half);
        }
    }

    /// Adds to what a contact bears, within its cone.
    fn add_impulse(&mut self, c: &mut Constraint<S>, impulse: Vec3<S>) {
        self.apply_impulse_pair(c, impulse);
        let axis_offset = impulse.dot(c.normal);
        c.normal_impulse += axis_offset;
        c.tangent_impulse += impulse - c.normal * axis_offset;
    }

    fn add_angular_impulse(&mut self, c: &mut Constraint<S>, impulse: Vec3<S>) {
        if let Some(rolling) = &mut c.rolling {
            rolling.angular_impulse += impulse;
            self.apply_angular_impulse_pair(c, impulse);
        }
    }

    /// Counts what the impulses did to the energy: an impulse times the mean of the
    /// velocities before and after.
    fn measure_energy(
        &self,
        constraints: &[Constraint<S>],
        islands: &Islands<S>,
        energies: &mut Vec<IslandEnergy<S>>,
    ) {
        energies.clear();
        energies.resize(islands.len(), IslandEnergy::new());
        let half = S::constant(0.5);
        for c in constraints {
            let energy = &mut energies[c.island as usize];
            let island = islands.of(c);
            energy.bounces |= c.bounces;
            let relative_spin = (c.initial_relative_spin + self.relative_spin(c)) * half;
            energy.work +=
                island.energy(c, c.impulse(), c.mean_velocity(self.relative_velocity_of(c)))
                    + island.angular_energy(c.angular_impulse(), relative_spin);
            energy.exchanged += island.energy(c, c.impulse(), c.initial_relative_velocity).abs();
        }
    }
}

impl<S: Scalar> Constraint<S> {
    /// The speed along the normal that is asked for without a rebound, in m/s.
    fn target_without_restitution(&self) -> S {
        if self.bounces {
            self.velocity_since_impact.dot(self.normal)
        } else {
            self.target_normal_velocity
        }
    }

    /// The mean of the relative velocities before and after an impulse at the moment when it
    /// acted, in m/s.
    fn mean_velocity(&self, after: Vec3<S>) -> Vec3<S> {
        (self.initial_relative_velocity + after) * S::constant(0.5) - self.velocity_since_impact
    }
}
