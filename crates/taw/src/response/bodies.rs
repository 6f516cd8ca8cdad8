//! Bodies as the solvers see them: columns of state, inverse masses, and impulses applied to them.

use cgmath::{InnerSpace, Zero};

use super::{BallRotation, InverseEffectiveMass};
use crate::broad::Period;
use crate::math::{Point3, Scalar, Vec3};

/// Columns of the bodies that a solver works on; all of one length.
#[derive(Debug)]
pub(crate) struct SolverBodies<'a, S> {
    pub period: Period<S>,
    /// Centers, in metres.
    pub position: &'a mut [Point3<S>],
    /// Velocities, in m/s.
    pub velocity: &'a mut [Vec3<S>],
    /// Radii, in metres.
    pub radius: &'a [S],
    /// Inverse masses, in 1/kg; zero for a body of infinite mass. Empty for a method that ignores
    /// masses.
    pub inverse_mass: &'a [S],
    /// Angular velocities, in rad/s; empty where contacts neither read nor change them.
    pub spin: &'a mut [Vec3<S>],
    /// Rows whose rotation is locked: contacts cannot spin them. Empty if there are none.
    pub rotation_locked: &'a [bool],
    /// Capsule axis and inertia per body; empty if all are spheres.
    pub capsules: &'a [CapsuleInertia<S>],
}

/// Axis and inertia of a capsule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CapsuleInertia<S> {
    /// Unit axis in world space, and half the length of the core segment, in metres; zero for a
    /// sphere.
    pub axis: Vec3<S>,
    pub half_length: S,
    /// Mass over the axial and the transverse moment of inertia, in 1/m²; zero if the rotation is
    /// locked.
    pub inverse_unit_inertia: [S; 2],
}

impl<S: Scalar> CapsuleInertia<S> {
    /// Axial and transverse moment of inertia per mass, in m²: a cylinder with a hemisphere at each
    /// end, of uniform density.
    pub fn unit_inertia(radius: S, half_length: S) -> [S; 2] {
        let number = S::from_f64;
        let squared = radius * radius;
        // Fractions of the mass: the cylinder has volume π r² 2 h, the two hemispheres 4/3 π r³.
        let cylinder = half_length / (half_length + radius * number(2.0 / 3.0));
        let ends = S::one() - cylinder;
        let axial = cylinder * squared * number(0.5) + ends * squared * number(0.4);
        // The centroid of a hemisphere is 3/8 r from its flat side (Steiner).
        let cylinder_transverse = squared * number(0.25) + half_length * half_length / number(3.0);
        let ends_transverse =
            squared * number(0.4) + half_length * half_length + half_length * radius * number(0.75);
        [axial, cylinder * cylinder_transverse + ends * ends_transverse]
    }

    /// Change of angular velocity by a torque impulse per mass about the center.
    pub fn apply_inverse_inertia(&self, torque: Vec3<S>) -> Vec3<S> {
        let [axial, transverse] = self.inverse_unit_inertia;
        let part = self.axis * torque.dot(self.axis);
        part * axial + (torque - part) * transverse
    }
}

impl<S: Scalar> SolverBodies<'_, S> {
    /// Tells if contacts can spin a row.
    #[inline]
    pub(super) fn ball_rotation(&self, row: usize) -> BallRotation {
        let locked = self.rotation_locked.get(row).copied().unwrap_or(false);
        if locked || self.spin.is_empty() { BallRotation::Locked } else { BallRotation::Free }
    }

    /// Angular velocity of a row, in rad/s; zero if its rotation is locked.
    #[inline]
    pub(super) fn unlocked_spin(&self, row: usize) -> Vec3<S> {
        match self.ball_rotation(row) {
            BallRotation::Free => self.spin[row],
            BallRotation::Locked => Vec3::zero(),
        }
    }

    /// Radius times angular velocity, in m/s; crossed with the normal, the surface speed.
    #[inline]
    pub(super) fn radius_times_spin(&self, row: usize) -> Vec3<S> {
        self.unlocked_spin(row) * self.radius[row]
    }

    /// Inverse moment of inertia, in 1/(kg m²), the largest one of a capsule; zero if the rotation
    /// is locked.
    pub(super) fn inverse_inertia(&self, row: usize) -> S {
        if let Some(CapsuleInertia { inverse_unit_inertia: [axial, transverse], .. }) =
            self.capsule(row)
        {
            return axial.max(*transverse) * self.inverse_mass[row];
        }
        let factor = self.ball_rotation(row).inverse_inertia_factor::<S>();
        factor * self.inverse_mass[row] / (self.radius[row] * self.radius[row])
    }

    /// Vector from the center of a row to the point of its axis that a contact refers to.
    #[inline]
    pub(super) fn anchor(&self, row: usize, axis_offset: S) -> Vec3<S> {
        self.capsules.get(row).map_or_else(Vec3::zero, |capsule| capsule.axis * axis_offset)
    }

    /// Capsule data of a row; none for a sphere.
    #[inline]
    pub(super) fn capsule(&self, row: usize) -> Option<&CapsuleInertia<S>> {
        self.capsules.get(row).filter(|capsule| capsule.half_length > S::zero())
    }

    /// Inverse effective mass of one body at a contact whose normal points to its center, in 1/kg.
    pub(super) fn inverse_effective_mass(
        &self,
        row: usize,
        arm: Vec3<S>,
        normal: Vec3<S>,
    ) -> InverseEffectiveMass<S> {
        let inverse_mass = self.inverse_mass[row];
        let Some(capsule) = self.capsule(row) else {
            return InverseEffectiveMass::of([
                (S::zero(), BallRotation::Locked),
                (inverse_mass, self.ball_rotation(row)),
            ]);
        };
        let lever = arm.cross(normal);
        let [axial, transverse] = capsule.inverse_unit_inertia;
        let max_inverse = axial.max(transverse);
        InverseEffectiveMass {
            normal: inverse_mass * (S::one() + lever.dot(capsule.apply_inverse_inertia(lever))),
            // Upper bound, so that a tangential step never overshoots.
            tangent: inverse_mass * (S::one() + max_inverse * arm.magnitude2()),
        }
    }

    /// Applies an impulse, given as a velocity change of the center, at a contact point: `arm`
    /// metres from the center, along the negative `normal` for a ball.
    #[inline]
    pub(super) fn apply_impulse(
        &mut self,
        row: usize,
        velocity_change: Vec3<S>,
        normal: Vec3<S>,
        arm: Vec3<S>,
    ) {
        self.velocity[row] += velocity_change;
        if !self.capsules.is_empty() && self.spin_capsule(row, velocity_change, arm) {
            return;
        }
        let factor = self.ball_rotation(row).inverse_inertia_factor::<S>();
        if let Some(spin) = self.spin.get_mut(row) {
            *spin -= normal.cross(velocity_change) * (factor / self.radius[row]);
        }
    }

    /// Applies the angular part to a capsule. False if the body is a sphere.
    fn spin_capsule(&mut self, row: usize, velocity_change: Vec3<S>, arm: Vec3<S>) -> bool {
        let Some(capsule) = self.capsule(row).copied() else { return false };
        if let Some(spin) = self.spin.get_mut(row) {
            *spin += capsule.apply_inverse_inertia(arm.cross(velocity_change));
        }
        true
    }

    /// Applies an angular impulse, in kg m²/s.
    pub(super) fn apply_angular_impulse(&mut self, row: usize, angular_impulse: Vec3<S>) {
        let inverse = self.inverse_inertia(row);
        if let Some(capsule) = self.capsule(row).copied() {
            let inverse_mass = self.inverse_mass[row];
            if let Some(spin) = self.spin.get_mut(row) {
                *spin += capsule.apply_inverse_inertia(angular_impulse * inverse_mass);
            }
            return;
        }
        if let Some(spin) = self.spin.get_mut(row) {
            *spin += angular_impulse * inverse;
        }
    }
}
