//! Columns that the solvers work on, and how impulses change them.

use cgmath::{InnerSpace, Zero};

use super::{BallRotation, InverseEffectiveMass};
use crate::broad::Period;
use crate::math::{Point3, Scalar, Vec3};

/// The columns that a response works on; all of one length.
#[derive(Debug)]
pub(crate) struct SolverBodies<'a, S> {
    pub period: Period<S>,
    /// Centers, in metres.
    pub position: &'a mut [Point3<S>],
    /// In metres per second.
    pub velocity: &'a mut [Vec3<S>],
    /// In metres.
    pub radius: &'a [S],
    /// In 1/kg; zero for what cannot be moved. Empty for a response that has no use
    /// for it.
    pub inverse_mass: &'a [S],
    /// In rad/s; empty where contacts neither feel nor change it.
    pub spin: &'a mut [Vec3<S>],
    /// Which rows contacts cannot set spinning; empty if there are none.
    pub rotation_locked: &'a [bool],
    /// What is long about each row; empty if all are balls.
    pub capsules: &'a [CapsuleInertia<S>],
}

/// What makes a capsule of a ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CapsuleInertia<S> {
    /// A unit vector in world space, and half the length of the line, in metres; zero for a
    /// ball.
    pub axis: Vec3<S>,
    pub half_length: S,
    /// The mass over the moments of inertia along the axis and across it, in 1/m²; nothing for
    /// what contacts cannot set spinning.
    pub inverse_unit_inertia: [S; 2],
}

impl<S: Scalar> CapsuleInertia<S> {
    /// The moments of inertia along the axis and across it over the mass, in m²: of a
    /// cylinder with half a ball at each end, of even density.
    pub fn unit_inertia(radius: S, half_length: S) -> [S; 2] {
        let number = S::constant;
        let squared = radius * radius;
        // As parts of all: the cylinder has π r² 2 h, the two halves 4/3 π r³.
        let cylinder = half_length / (half_length + radius * number(2.0 / 3.0));
        let ends = S::one() - cylinder;
        let axial = cylinder * squared * number(0.5) + ends * squared * number(0.4);
        // The middle of half a ball is 3/8 r from its flat side (Steiner).
        let cylinder_transverse = squared * number(0.25) + half_length * half_length / number(3.0);
        let ends_transverse =
            squared * number(0.4) + half_length * half_length + half_length * radius * number(0.75);
        [axial, cylinder * cylinder_transverse + ends * ends_transverse]
    }

    /// A torque about its middle over the mass, as the change of spin that it makes.
    pub fn apply_inverse_inertia(&self, torque: Vec3<S>) -> Vec3<S> {
        let [axial, transverse] = self.inverse_unit_inertia;
        let part = self.axis * torque.dot(self.axis);
        part * axial + (torque - part) * transverse
    }
}

impl<S: Scalar> SolverBodies<'_, S> {
    /// Whether an impulse can set the marble in a row spinning.
    #[inline]
    pub(super) fn ball_rotation(&self, row: usize) -> BallRotation {
        let locked = self.rotation_locked.get(row).copied().unwrap_or(false);
        if locked || self.spin.is_empty() { BallRotation::Locked } else { BallRotation::Free }
    }

    /// The spin in a row, in rad/s, as far as contacts feel it.
    #[inline]
    pub(super) fn unlocked_spin(&self, row: usize) -> Vec3<S> {
        match self.ball_rotation(row) {
            BallRotation::Free => self.spin[row],
            BallRotation::Locked => Vec3::zero(),
        }
    }

    /// Radius times spin, in m/s.
    #[inline]
    pub(super) fn radius_times_spin(&self, row: usize) -> Vec3<S> {
        self.unlocked_spin(row) * self.radius[row]
    }

    /// In 1/(kg m²), of a capsule the greatest; zero for what cannot be turned.
    pub(super) fn inverse_inertia(&self, row: usize) -> S {
        if let Some(CapsuleInertia { inverse_unit_inertia: [axial, transverse], .. }) =
            self.capsule(row)
        {
            return axial.max(*transverse) * self.inverse_mass[row];
        }
        let factor = self.ball_rotation(row).inverse_inertia_factor::<S>();
        factor * self.inverse_mass[row] / (self.radius[row] * self.radius[row])
    }

    /// From the middle of a row to the point of its axis that a contact is about.
    #[inline]
    pub(super) fn anchor(&self, row: usize, axis_offset: S) -> Vec3<S> {
        self.capsules.get(row).map_or_else(Vec3::zero, |capsule| capsule.axis * axis_offset)
    }

    /// What is long about a row that can be set spinning, if anything is.
    #[inline]
    pub(super) fn capsule(&self, row: usize) -> Option<&CapsuleInertia<S>> {
        self.capsules.get(row).filter(|capsule| capsule.half_length > S::zero())
    }

    /// How easily a row gives way where it is touched, with its center that way; in 1/kg.
    pub(super) fn inverse_effective_mass(
        &self,
        row: usize,
        axis_offset: S,
        normal: Vec3<S>,
    ) -> InverseEffectiveMass<S> {
        let inverse_mass = self.inverse_mass[row];
        let Some(capsule) = self.capsule(row) else {
            return InverseEffectiveMass::of([
                (S::zero(), BallRotation::Locked),
                (inverse_mass, self.ball_rotation(row)),
            ]);
        };
        let arm = capsule.axis * axis_offset - normal * self.radius[row];
        let lever = arm.cross(normal);
        let [axial, transverse] = capsule.inverse_unit_inertia;
        let max_inverse = axial.max(transverse);
        InverseEffectiveMass {
            normal: inverse_mass * (S::one() + lever.dot(capsule.apply_inverse_inertia(lever))),
            // At most; so a step across never goes too far.
            tangent: inverse_mass * (S::one() + max_inverse * arm.magnitude2()),
        }
    }

    /// The velocity that its spin gives to the point of a row's axis that a contact is about.
    #[inline]
    pub(super) fn anchor_spin_velocity(&self, row: usize, axis_offset: S) -> Vec3<S> {
        match self.capsule(row) {
            Some(capsule) => self.unlocked_spin(row).cross(capsule.axis * axis_offset),
            None => Vec3::zero(),
        }
    }

    /// Changes a velocity by a hit where a marble is touched, and its spin with it;
    /// `normal` points to its center, or to the point `axis_offset` its axis.
    #[inline]
    pub(super) fn apply_impulse(
        &mut self,
        row: usize,
        velocity_change: Vec3<S>,
        normal: Vec3<S>,
        axis_offset: S,
    ) {
        self.velocity[row] += velocity_change;
        if !self.capsules.is_empty() && self.spin_capsule(row, velocity_change, normal, axis_offset)
        {
            return;
        }
        let factor = self.ball_rotation(row).inverse_inertia_factor::<S>();
        if let Some(spin) = self.spin.get_mut(row) {
            *spin -= normal.cross(velocity_change) * (factor / self.radius[row]);
        }
    }

    /// Changes the spin of what is long, if it is.
    pub(super) fn spin_capsule(
        &mut self,
        row: usize,
        velocity_change: Vec3<S>,
        normal: Vec3<S>,
        axis_offset: S,
    ) -> bool {
        let Some(capsule) = self.capsule(row).copied() else { return false };
        let arm = capsule.axis * axis_offset - normal * self.radius[row];
        if let Some(spin) = self.spin.get_mut(row) {
            *spin += capsule.apply_inverse_inertia(arm.cross(velocity_change));
        }
        true
    }

    /// Changes a spin by an angular impulse, in kg m²/s.
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
