//! Energy guard: contacts must not create energy. Newton's restitution and friction, each right in
//! its own contact, can together gain energy in several contacts at once (Kane and Levinson,
//! *Dynamics: theory and applications*, 1985): such collisions get less restitution. Unconverged
//! iterations and an outdated warm start must not gain energy either.

use cgmath::{InnerSpace, Zero};

use super::islands::Islands;
use super::rows::Rows;
use super::solve::iterate;
use super::{Constraint, SolverSettings};
use crate::constraint::ContactImpulse;
use crate::math::{Scalar, Vec3};
use crate::response::SolverBodies;

/// A gain below this fraction of the energy of the velocity changes is the residual of the
/// iterations.
const GAIN_TOLERANCE: f64 = 1e-5;
/// Gain below which collisions are left as they are, over the energy of the velocity changes, in machine
/// epsilons: the rounding of a few contacts. A large island may exceed it by rounding alone, and loses as
/// little.
const GAIN_ROUNDING: f64 = 2.0;

/// Fraction from which on the warm start is not scaled: the rest is what the iterations left in the last
/// substep, and a heap at rest keeps its impulses to the bit.
const FITS: f64 = 0.99;

/// Energy balance of an island's impulses, in units of the island.
#[derive(Clone, Copy, Debug)]
pub(super) struct IslandEnergy<S> {
    bounces: bool,
    /// Energy that the impulses bring in as they are.
    work: S,
    /// Twice the kinetic energy of the velocity changes, the scale for `work`. Impulses that cancel,
    /// as of two walls that press a ball, do not count, however large they are.
    changed: S,
    /// Coefficients of the energy `linear x + quadratic x²` that a fraction `x` of some impulses
    /// brings in.
    linear: S,
    quadratic: S,
}

impl<S: Scalar> IslandEnergy<S> {
    fn new() -> Self {
        let zero = S::zero();
        Self { bounces: false, work: zero, changed: zero, linear: zero, quadratic: zero }
    }

    fn gains(&self) -> bool {
        self.work > self.changed * S::from_f64(GAIN_TOLERANCE)
    }

    /// Tells if collisions gained a residual of the iterations. What rests loses it again.
    fn bounces_with_residual(&self) -> bool {
        self.bounces && self.work > self.changed * S::epsilon() * S::from_f64(GAIN_ROUNDING)
    }

    /// Largest fraction of the restitution that gains no energy.
    fn max_restitution_fraction(&self) -> S {
        let Self { work, linear, quadratic, .. } = *self;
        let root = (linear * linear - S::from_f64(4.0) * quadratic * work).sqrt();
        // Root of the quadratic equation in the form without cancellation.
        let fraction = if linear > S::zero() {
            work * S::from_f64(-2.0) / (linear + root)
        } else {
            (root - linear) / (quadratic * S::from_f64(2.0))
        };
        if fraction > S::zero() { fraction.min(S::one()) } else { S::zero() }
    }

    /// Largest fraction of all impulses that gains no energy; one where that is not a small correction.
    fn lossless_fraction(&self) -> S {
        let best = self.min_energy_fraction();
        let fraction = best + best;
        if fraction > S::from_f64(0.5) { fraction.min(S::one()) } else { S::one() }
    }

    /// Fraction of all impulses that leaves the least energy.
    fn min_energy_fraction(&self) -> S {
        let fraction = -self.linear / (self.quadratic * S::from_f64(2.0));
        if fraction > S::zero() && fraction.is_finite() { fraction } else { S::zero() }
    }
}

/// Solution of a contact with full restitution.
#[derive(Clone, Copy, Debug)]
pub(super) struct FullRestitution<S> {
    impulse: Vec3<S>,
    angular_impulse: Vec3<S>,
    /// Relative velocity of the two points, in m/s, and relative spin, in rad/s, after the impulse.
    relative_velocity: Vec3<S>,
    relative_spin: Vec3<S>,
}

impl<S: Scalar> SolverBodies<'_, S> {
    /// Limits the energy of islands whose solution gained some: solves them without restitution,
    /// which hardly ever gains, and adds the largest fraction of the restitution that gains
    /// nothing. Both solutions satisfy contacts and friction cones, so every mixture does, too.
    /// Where the iterations ended too soon even for that, solves again, [normals before
    /// friction](Self::solve_normals_before_friction).
    pub(super) fn limit_energy(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &mut Islands<S>,
        energies: &mut Vec<IslandEnergy<S>>,
        full_restitution: &mut Vec<FullRestitution<S>>,
        rows: &mut Rows<S>,
        settings: &SolverSettings<S>,
    ) {
        self.measure_energy(constraints, islands, energies);
        if energies.iter().any(|energy| energy.bounces && energy.gains()) {
            self.reduce_restitution(
                constraints,
                islands,
                energies,
                full_restitution,
                rows,
                settings,
            );
            self.measure_energy(constraints, islands, energies);
        }
        if energies.iter().any(IslandEnergy::gains) {
            let gaining: Vec<_> = energies.iter().map(IslandEnergy::gains).collect();
            self.solve_normals_before_friction(
                constraints,
                islands,
                energies,
                &gaining,
                rows,
                settings,
            );
            self.measure_energy(constraints, islands, energies);
        }
        self.remove_residual_gain(constraints, islands, energies);
        self.stop_approaches(constraints, islands);
    }

    /// Scales the impulses of collisions down by the little energy that unconverged iterations
    /// gained: elastic collisions would add it up.
    fn remove_residual_gain(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &Islands<S>,
        energies: &mut Vec<IslandEnergy<S>>,
    ) {
        if !energies.iter().any(IslandEnergy::bounces_with_residual) {
            return;
        }
        let gaining: Vec<_> = energies.iter().map(IslandEnergy::bounces_with_residual).collect();
        self.measure_scaling(constraints, islands, energies, Constraint::velocity_at_impact);
        self.scale_impulses(constraints, |island| {
            if gaining[island] { energies[island].lossless_fraction() } else { S::one() }
        });
    }

    /// Scales all impulses by the fraction of their island.
    fn scale_impulses(
        &mut self,
        constraints: &mut [Constraint<S>],
        fraction_of: impl Fn(usize) -> S,
    ) {
        for c in constraints {
            let fraction = fraction_of(c.island as usize);
            if fraction < S::one() {
                self.add_impulse(c, c.impulse() * (fraction - S::one()));
                self.add_angular_impulse(c, c.angular_impulse() * (fraction - S::one()));
            }
        }
    }

    /// Stops remaining approaches by normal impulses alone. Two walls whose friction presses a ball
    /// into each other have no solution that iterations could reach; and a ball that went on into a
    /// wall would be lifted out again, which is energy. Stopping an approach only lowers it. Walls
    /// come first, so the backward pass ends with them.
    pub(super) fn stop_approaches(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &Islands<S>,
    ) {
        let indices = 0..constraints.len();
        for index in indices.clone().chain(indices.rev()) {
            let c = &mut constraints[index];
            let missing_speed =
                c.target_without_restitution() - self.relative_velocity_of(c).dot(c.normal);
            let island = islands.of(c.island);
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
        rows: &mut Rows<S>,
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
        iterate(self, constraints, islands, rows, settings);
        self.measure_energy(constraints, islands, energies);
        let half = S::from_f64(0.5);
        for (c, full) in constraints.iter().zip(full_restitution.iter()) {
            let energy = &mut energies[c.island as usize];
            let (relative_velocity, relative_spin) =
                (self.relative_velocity_of(c), self.relative_spin(c));
            let (impulse, angular_impulse) =
                (full.impulse - c.impulse(), full.angular_impulse - c.angular_impulse());
            let (velocity_change, spin_change) =
                (full.relative_velocity - relative_velocity, full.relative_spin - relative_spin);
            let island = islands.of(c.island);
            energy.linear += island.energy(
                c.inverse_effective_mass.normal,
                impulse,
                c.mean_velocity(relative_velocity),
            ) + island.energy(
                c.inverse_effective_mass.normal,
                c.impulse(),
                velocity_change * half,
            ) + island
                .angular_energy(angular_impulse, (c.initial_relative_spin + relative_spin) * half)
                + island.angular_energy(c.angular_impulse(), spin_change * half);
            energy.quadratic +=
                island.energy(c.inverse_effective_mass.normal, impulse, velocity_change * half)
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

    /// Solves some islands in an order that cannot gain, however few the iterations. First the
    /// normal impulses, without friction: each step lowers the energy. Then restitution by
    /// Poisson's hypothesis, no further than energy allows. Then friction, with cones fixed by
    /// these normal impulses, while normal impulses may only grow: again each step lowers the
    /// energy.
    pub(super) fn solve_normals_before_friction(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &mut Islands<S>,
        energies: &mut Vec<IslandEnergy<S>>,
        gaining: &[bool],
        rows: &mut Rows<S>,
        settings: &SolverSettings<S>,
    ) {
        let mut gaining_constraints: Vec<_> =
            constraints.iter_mut().filter(|c| gaining[c.island as usize]).collect();
        let mut friction = Vec::with_capacity(gaining_constraints.len());
        for c in &mut gaining_constraints {
            self.add_impulse(c, -c.impulse());
            self.add_angular_impulse(c, -c.angular_impulse());
            c.rolling = None;
            friction.push(std::mem::replace(&mut c.cone.friction, S::zero()));
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
        iterate(self, constraints, islands, rows, settings);
        self.apply_poisson_restitution(constraints, islands, energies, gaining);
        let gaining_constraints = constraints.iter_mut().filter(|c| gaining[c.island as usize]);
        for (c, friction) in gaining_constraints.zip(friction) {
            c.impulse.normal = c.impulse.normal.max(S::zero()); // rounding
            (c.cone.min_normal_impulse, c.cone.extra_friction) =
                (c.impulse.normal, friction * c.impulse.normal);
        }
        islands.restart(|island| gaining[island]);
        iterate(self, constraints, islands, rows, settings);
    }

    /// Scales the normal impulses by Poisson's hypothesis (1838): by the least restitution of the
    /// bounces in an island, and no further than gains nothing.
    fn apply_poisson_restitution(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &Islands<S>,
        energies: &mut Vec<IslandEnergy<S>>,
        gaining: &[bool],
    ) {
        self.measure_scaling(constraints, islands, energies, Constraint::velocity_at_impact);
        let mut min_restitution = vec![S::one(); energies.len()];
        for c in constraints.iter().filter(|c| c.impulse.normal > S::zero()) {
            let restitution = if c.bounces { c.restitution } else { S::zero() };
            let min_restitution = &mut min_restitution[c.island as usize];
            *min_restitution = min_restitution.min(restitution);
        }
        for c in constraints.iter_mut().filter(|c| gaining[c.island as usize]) {
            let island = c.island as usize;
            let best = energies[island].min_energy_fraction();
            // Fractions between zero and twice the best one lose energy.
            let fraction = (S::one() + min_restitution[island]).min(best + best).max(S::zero());
            self.add_impulse(c, c.impulse() * (fraction - S::one()));
        }
    }

    /// Scales the warm start of each island down to where it is nearest to the target velocities, by
    /// the exact line search of what [`iterate`] lowers: the guess may no longer fit.
    pub(super) fn scale_warm_start(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &Islands<S>,
        energies: &mut Vec<IslandEnergy<S>>,
    ) {
        self.measure_scaling(constraints, islands, energies, |c| {
            let target = c.normal * c.target_normal_velocity + c.target_tangent_velocity;
            c.initial_relative_velocity - target
        });
        self.scale_impulses(constraints, |island| {
            let fraction = energies[island].min_energy_fraction();
            let is_outdated =
                fraction < S::from_f64(FITS) && energies[island].quadratic > S::zero();
            if is_outdated { fraction } else { S::one() }
        });
    }

    /// Measures the energy that a fraction of all impulses would bring in, where it acts on these
    /// velocities of the contacts, in m/s.
    fn measure_scaling(
        &self,
        constraints: &[Constraint<S>],
        islands: &Islands<S>,
        energies: &mut Vec<IslandEnergy<S>>,
        initial_velocity: impl Fn(&Constraint<S>) -> Vec3<S>,
    ) {
        energies.clear();
        energies.resize(islands.len(), IslandEnergy::new());
        let half = S::from_f64(0.5);
        for c in constraints {
            let energy = &mut energies[c.island as usize];
            let island = islands.of(c.island);
            let energy_of = |velocity: Vec3<S>, spin: Vec3<S>| {
                island.energy(c.inverse_effective_mass.normal, c.impulse(), velocity)
                    + island.angular_energy(c.angular_impulse(), spin)
            };
            let velocity_change = self.relative_velocity_of(c) - c.initial_relative_velocity;
            let spin_change = self.relative_spin(c) - c.initial_relative_spin;
            energy.linear += energy_of(initial_velocity(c), c.initial_relative_spin);
            energy.quadratic += energy_of(velocity_change * half, spin_change * half);
        }
    }

    /// Adds an impulse to a contact; the caller keeps it within the friction cone.
    pub(super) fn add_impulse(&mut self, c: &mut Constraint<S>, impulse: Vec3<S>) {
        self.apply_impulse_pair(c, impulse);
        let change = ContactImpulse::split(impulse, c.normal);
        c.impulse.normal += change.normal;
        c.impulse.tangent += change.tangent;
    }

    pub(super) fn add_angular_impulse(&mut self, c: &mut Constraint<S>, impulse: Vec3<S>) {
        if let Some(rolling) = &mut c.rolling {
            rolling.angular_impulse += impulse;
            self.apply_angular_impulse_pair(c, impulse);
        }
    }

    /// Measures the energy of all impulses: impulse times mean velocity before and after.
    fn measure_energy(
        &self,
        constraints: &[Constraint<S>],
        islands: &Islands<S>,
        energies: &mut Vec<IslandEnergy<S>>,
    ) {
        energies.clear();
        energies.resize(islands.len(), IslandEnergy::new());
        let half = S::from_f64(0.5);
        for c in constraints {
            let energy = &mut energies[c.island as usize];
            let island = islands.of(c.island);
            energy.bounces |= c.bounces;
            let (after, spin_after) = (self.relative_velocity_of(c), self.relative_spin(c));
            let energy_of = |velocity: Vec3<S>, spin: Vec3<S>| {
                island.energy(c.inverse_effective_mass.normal, c.impulse(), velocity)
                    + island.angular_energy(c.angular_impulse(), spin)
            };
            energy.work +=
                energy_of(c.mean_velocity(after), (c.initial_relative_spin + spin_after) * half);
            energy.changed += energy_of(
                after - c.initial_relative_velocity,
                spin_after - c.initial_relative_spin,
            );
        }
    }
}

impl<S: Scalar> Constraint<S> {
    /// Target normal velocity without restitution, in m/s.
    pub(super) fn target_without_restitution(&self) -> S {
        if self.bounces {
            self.velocity_since_impact.dot(self.normal)
        } else {
            self.target_normal_velocity
        }
    }

    /// Relative velocity before the impulse, at the time of impact, in m/s.
    fn velocity_at_impact(&self) -> Vec3<S> {
        self.initial_relative_velocity - self.velocity_since_impact
    }

    /// Mean of the relative velocities before and after the impulse, at the time of impact, in m/s.
    fn mean_velocity(&self, after: Vec3<S>) -> Vec3<S> {
        (self.initial_relative_velocity + after) * S::from_f64(0.5) - self.velocity_since_impact
    }
}
