//! Rolling and spinning resistance of pairs.

use super::contact::SolverColumns;
use super::{inverse_mass, scatter};
use crate::constraint::solve_rolling;
use crate::math::{LANES, Scalar, Simd, Vec3Wide};
use crate::swarm::batches::Batch;
use crate::swarm::surfaces::PairNumbers;

/// Inertia of the balls of a batch against torques.
pub(super) struct RollingInertia<L> {
    /// Change of radius times angular velocity by an angular impulse, in m/s per N m s.
    surface_speed: [L; 2],
    /// Reciprocals of the radii.
    per_radius: [L; 2],
    /// Moment of inertia against turning against each other, in kg m².
    mass: L,
    /// Effective radius, in metres.
    radius: L,
}

impl<L: Simd> RollingInertia<L> {
    #[inline(always)]
    pub fn new([at_a, at_b]: [&[L; 4]; 2], [a, b]: &[[L; 4]; 2], [of_a, of_b]: [L; 2]) -> Self {
        let (zero, one) = (L::constant(0.0), L::constant(1.0));
        let [per_a, per_b] = [one / at_a[3], one / at_b[3]];
        let [by_a, by_b] = [of_a * inverse_mass(a) * per_a, of_b * inverse_mass(b) * per_b];
        let sum = by_a * per_a + by_b * per_b;
        Self {
            surface_speed: [by_a, by_b],
            per_radius: [per_a, per_b],
            mass: sum.select_gt(zero, one / sum, zero),
            radius: one / (per_a + per_b),
        }
    }
}

impl<S: Scalar> SolverColumns<'_, S> {
    /// Applies angular impulses about the centers of both; the second gets it as it is.
    #[inline(always)]
    pub(super) fn apply_angular_impulse<L: Simd<Scalar = S>>(
        &self,
        batch: &Batch,
        inertia: &RollingInertia<L>,
        torque: Vec3Wide<L>,
    ) {
        let [a, b] = self.spins::<L>(batch);
        let [by_a, by_b] = inertia.surface_speed;
        let spins = [
            (Vec3Wide::of(&a) - torque * by_a).with(a[3]),
            (Vec3Wide::of(&b) + torque * by_b).with(b[3]),
        ];
        scatter(self.spin, batch, spins);
    }

    /// Slows how the two turn against each other, by a torque of at most the resistance times
    /// normal force times effective radius.
    #[inline(always)]
    pub(super) fn solve_rolling<L: Simd<Scalar = S>>(
        &self,
        batch: &Batch,
        inertia: &RollingInertia<L>,
        normal: Vec3Wide<L>,
        normal_impulse: L,
        numbers: &PairNumbers<S>,
        torque: &mut [[S; LANES]; 3],
    ) {
        let most = normal_impulse * inertia.radius;
        let rolling = L::load(&numbers.rolling_resistance) * most;
        let spinning = L::load(&numbers.spinning_resistance) * most;
        let mut accumulated = Vec3Wide::<L>::load(torque);
        let (zero, [a, b]) = (L::constant(0.0), self.spins::<L>(batch));
        let [per_a, per_b] = inertia.per_radius;
        let relative_spin = Vec3Wide::of(&b) * per_b - Vec3Wide::of(&a) * per_a;
        let wanted = relative_spin * (zero - inertia.mass);
        let limits = [rolling.max(zero), spinning.max(zero)];
        let change = solve_rolling(&mut accumulated, wanted, normal, limits);
        accumulated.store(torque);
        self.apply_angular_impulse(batch, inertia, change);
    }
}
