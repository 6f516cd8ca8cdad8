use cgmath::{EuclideanSpace, InnerSpace, Zero};

use super::World;
use crate::math::{Scalar, Vec3, cast_vector};
use crate::motion::{Motion, Rotation};

/// The energy of a world's marbles, in joules, counted in `f64`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Of their velocities.
    pub kinetic: f64,
    /// Of those spins that contacts feel: [`Rotation::Dynamic`].
    pub spin: f64,
    /// In the world's gravity, against the origin.
    pub potential: f64,
}

impl Energy {
    /// All of it.
    #[must_use]
    pub fn total(self) -> f64 {
        self.kinetic + self.spin + self.potential
    }
}

impl<S: Scalar> World<S> {
    /// The energy of all marbles but those of infinite mass. Force fields and the walls
    /// have none here.
    #[must_use]
    pub fn energy(&self) -> Energy {
        let gravity = cast_vector::<S, f64>(self.gravity());
        let mut energy = Energy::default();
        for row in self.finite_rows() {
            let mass = self.marbles.mass(row).as_f64();
            let Motion { position, velocity } = self.marbles.exact(row);
            let scale = self.marbles.gravity_scale.get(row).unwrap_or(S::one()).as_f64();
            energy.kinetic += 0.5 * mass * velocity.magnitude2();
            if self.marbles.rotation_of(row, self.model.rotation) == Rotation::Dynamic {
                energy.spin += 0.5 * mass * self.marbles.spin_energy(row);
            }
            energy.potential -= mass * scale * gravity.dot(position.to_vec());
        }
        energy
    }

    /// The momentum of all marbles but those of infinite mass, in kg m/s.
    #[must_use]
    pub fn momentum(&self) -> Vec3<f64> {
        let momentum = |row| self.marbles.exact(row).velocity * self.marbles.mass(row).as_f64();
        self.finite_rows().map(momentum).fold(Vec3::zero(), |sum, p| sum + p)
    }

    fn finite_rows(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.marbles.len()).filter(|row| self.marbles.mass(*row).is_finite())
    }
}
