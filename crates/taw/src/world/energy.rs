use cgmath::{EuclideanSpace, InnerSpace, Zero};

use super::World;
use crate::math::{Scalar, Vec3, cast_vector};
use crate::motion::{Motion, Rotation};

/// Energy of a world's marbles and rigid bodies in joules, computed in `f64`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Translational kinetic energy.
    pub kinetic: f64,
    /// Rotational kinetic energy of marbles with [`Rotation::Dynamic`], and of rigid bodies.
    pub rotational: f64,
    /// Potential energy in the world's gravity, relative to the origin.
    pub potential: f64,
}

impl Energy {
    /// Total energy.
    #[must_use]
    pub fn total(self) -> f64 {
        self.kinetic + self.rotational + self.potential
    }
}

impl<S: Scalar> World<S> {
    /// Energy of all marbles and rigid bodies except those of infinite mass, without force fields and walls.
    #[must_use]
    pub fn energy(&self) -> Energy {
        let gravity = cast_vector::<S, f64>(self.gravity());
        let mut energy = Energy::default();
        for row in self.finite_mass_indices() {
            let mass = self.marbles.mass(row).as_f64();
            let Motion { position, velocity } = self.marbles.motion_f64(row);
            let scale = self.marbles.own.gravity_scale.get(row).unwrap_or(S::one()).as_f64();
            energy.kinetic += 0.5 * mass * velocity.magnitude2();
            if self.marbles.rotation_of(row, self.settings.model.rotation) == Rotation::Dynamic {
                energy.rotational += 0.5 * mass * self.marbles.rotational_energy(row);
            }
            energy.potential -= mass * scale * gravity.dot(position.to_vec());
        }
        for state in self.bodies.states.iter().filter(|state| state.is_dynamic()) {
            let [kinetic, rotational] = state.solver.energies();
            energy.kinetic += kinetic;
            energy.rotational += rotational;
            let weight = gravity * (state.body.gravity_scale.as_f64() / state.solver.inverse_mass);
            energy.potential -= weight.dot(state.solver.center().to_vec());
        }
        energy
    }

    /// Potential energy of those whose gravity is scaled, less that which they would have without, in joules.
    pub(super) fn excess_potential(&self) -> f64 {
        let gravity = cast_vector::<S, f64>(self.gravity());
        let excess = |row| {
            let scale = self.marbles.own.gravity_scale.get(row)?.as_f64();
            let position = self.marbles.motion_f64(row).position.to_vec();
            Some(-self.marbles.mass(row).as_f64() * (scale - 1.0) * gravity.dot(position))
        };
        self.finite_mass_indices().filter_map(excess).sum()
    }

    /// Momentum of all marbles and rigid bodies except those of infinite mass, in kg m/s.
    #[must_use]
    pub fn momentum(&self) -> Vec3<f64> {
        let momentum =
            |row| self.marbles.motion_f64(row).velocity * self.marbles.mass(row).as_f64();
        let of_marbles = self.finite_mass_indices().map(momentum);
        let bodies = self.bodies.states.iter().filter(|state| state.is_dynamic());
        let of_bodies = bodies.map(|state| state.solver.velocity / state.solver.inverse_mass);
        of_marbles.chain(of_bodies).fold(Vec3::zero(), |sum, p| sum + p)
    }

    fn finite_mass_indices(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.marbles.len()).filter(|row| self.marbles.mass(*row).is_finite())
    }
}
