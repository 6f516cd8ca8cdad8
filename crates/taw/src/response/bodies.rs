//! Bodies as the solvers see them: columns of state, inverse masses, and impulses applied to them.

use cgmath::{InnerSpace, Zero};

use super::{BallRotation, InverseEffectiveMass};
use crate::broad::Period;
use crate::math::{Point3, Scalar, Vec3, is_finite_point};
use crate::motion::LockedAxes;

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
    /// Locked axes of each row; empty if there are none.
    pub locked_axes: &'a [LockedAxes],
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
    /// Axes of the world about which it does not turn.
    pub locked_axes: LockedAxes,
}

impl<S: Scalar> CapsuleInertia<S> {
    /// Twice the energy of a spin per mass, in m²/s²; zero if the rotation is locked.
    pub fn spin_energy(&self, spin: Vec3<S>) -> S {
        let axial = spin.dot(self.axis);
        let transverse = (spin - self.axis * axial).magnitude2();
        let energy =
            |spin: S, inverse: S| if inverse > S::zero() { spin / inverse } else { inverse };
        let [inverse_axial, inverse_transverse] = self.inverse_unit_inertia;
        energy(axial * axial, inverse_axial) + energy(transverse, inverse_transverse)
    }

    /// Change of angular velocity by a torque impulse per mass about the center.
    pub fn apply_inverse_inertia(&self, torque: Vec3<S>) -> Vec3<S> {
        let free = self.scale(torque, self.inverse_unit_inertia);
        if self.locked_axes.turns_freely() { free } else { self.locked_spin(free, torque) }
    }

    /// Angular velocity that locks leave of one that is set from outside, by an impulse of theirs: none
    /// gains energy.
    pub fn constrained(&self, spin: Vec3<S>) -> Vec3<S> {
        if self.locked_axes.free_rotation(spin) == spin {
            return spin; // to the bit
        }
        self.locked_spin(spin, self.momentum(spin))
    }

    /// Angular momentum per mass, in m²/s; of a rotation that is not locked.
    pub fn momentum(&self, spin: Vec3<S>) -> Vec3<S> {
        self.scale(spin, self.inverse_unit_inertia.map(S::recip))
    }

    /// Multiplies the parts of an axial vector along the axis and across it.
    fn scale(&self, v: Vec3<S>, [axial, transverse]: [S; 2]) -> Vec3<S> {
        let part = self.axis * v.dot(self.axis);
        part * axial + (v - part) * transverse
    }

    /// Angular velocity of a capsule with locked axes, given that of a free one with the same angular
    /// momentum per mass: locks change only the momentum about their own axes.
    fn locked_spin(&self, spin: Vec3<S>, momentum: Vec3<S>) -> Vec3<S> {
        let (zero, locks) = (Vec3::zero(), self.locked_axes);
        let [axial, transverse] = self.inverse_unit_inertia;
        if axial == S::zero() || transverse == S::zero() {
            return zero;
        }
        let mut only = zero; // unit vector of the only locked or free axis
        let locked = (0..3).filter(|axis| locks.locks_rotation(*axis)).count();
        let index = (0..3).find(|axis| locks.locks_rotation(*axis) == (locked == 1));
        match (locked, index) {
            (0, _) => spin,
            (1, Some(axis)) => {
                only[axis] = S::one();
                let column = self.scale(only, self.inverse_unit_inertia);
                locks.free_rotation(spin - column * (spin[axis] / column[axis]))
            }
            (2, Some(axis)) => {
                only[axis] = S::one();
                let inertia = self.scale(only, [axial.recip(), transverse.recip()]);
                only * (momentum[axis] / inertia[axis])
            }
            _ => zero,
        }
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

    /// Locked axes of a row.
    #[inline]
    pub(super) fn locked_axes(&self, row: usize) -> LockedAxes {
        self.locked_axes.get(row).copied().unwrap_or_default()
    }

    /// Moves a row along its free axes. One that would become infinite or NaN stays.
    pub(super) fn displace(&mut self, row: usize, displacement: Vec3<S>) {
        let position = self.position[row] + self.locked_axes(row).free_translation(displacement);
        if is_finite_point(position) {
            self.position[row] = position;
        }
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
        let share = self.locked_axes(row).share(normal);
        let Some(capsule) = self.capsule(row) else {
            let free = InverseEffectiveMass::of([
                (S::zero(), BallRotation::Locked),
                (inverse_mass, self.ball_rotation(row)),
            ]);
            // Along the tangents an upper bound, as for capsules.
            return InverseEffectiveMass { normal: free.normal * share, ..free };
        };
        let lever = arm.cross(normal);
        let [axial, transverse] = capsule.inverse_unit_inertia;
        let max_inverse = axial.max(transverse);
        InverseEffectiveMass {
            normal: inverse_mass * (share + lever.dot(capsule.apply_inverse_inertia(lever))),
            // Upper bound, so that a tangential step never overshoots.
            tangent: inverse_mass * (S::one() + max_inverse * arm.magnitude2()),
        }
    }

    /// Motion of a row, as contacts see it.
    #[inline]
    pub(super) fn motion(&self, row: usize) -> BodyMotion<S> {
        BodyMotion {
            velocity: self.velocity[row],
            spin: self.unlocked_spin(row),
            radius: self.radius[row],
        }
    }

    /// Spin of a ball per change of its velocity at right angles to the normal, in 1/m; zero if the
    /// rotation is locked.
    #[inline]
    pub(super) fn spin_per_speed(&self, row: usize) -> S {
        self.ball_rotation(row).inverse_inertia_factor::<S>() / self.radius[row]
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
        let locks = self.locked_axes(row);
        if self.capsule(row).is_some() {
            self.velocity[row] += locks.free_translation(velocity_change);
            return self.spin_capsule(row, velocity_change, arm);
        }
        let spin_per_speed = self.spin_per_speed(row);
        let mut no_spin = Vec3::zero();
        let spin = self.spin.get_mut(row).unwrap_or(&mut no_spin);
        let velocity = &mut self.velocity[row];
        push_locked(velocity, spin, velocity_change, normal, (spin_per_speed, locks));
    }

    /// Applies the angular part of an impulse to a capsule.
    fn spin_capsule(&mut self, row: usize, velocity_change: Vec3<S>, arm: Vec3<S>) {
        let Some(capsule) = self.capsule(row).copied() else { return };
        if let Some(spin) = self.spin.get_mut(row) {
            *spin += capsule.apply_inverse_inertia(arm.cross(velocity_change));
        }
    }

    /// Change of the spin by an angular impulse (in kg m²/s), in rad/s.
    pub(super) fn spin_change(&self, row: usize, angular_impulse: Vec3<S>) -> Vec3<S> {
        if let Some(capsule) = self.capsule(row) {
            capsule.apply_inverse_inertia(angular_impulse * self.inverse_mass[row])
        } else {
            self.locked_axes(row).free_rotation(angular_impulse * self.inverse_inertia(row))
        }
    }

    /// Applies an angular impulse, in kg m²/s.
    pub(super) fn apply_angular_impulse(&mut self, row: usize, angular_impulse: Vec3<S>) {
        let change = self.spin_change(row, angular_impulse);
        if let Some(spin) = self.spin.get_mut(row) {
            *spin += change;
        }
    }
}

/// Motion of a body, as contacts see it.
#[derive(Clone, Copy, Debug)]
pub(super) struct BodyMotion<S> {
    /// Velocity of the center, in m/s.
    pub velocity: Vec3<S>,
    /// Angular velocity, in rad/s; zero if the rotation is locked.
    pub spin: Vec3<S>,
    /// Radius, in metres.
    pub radius: S,
}

/// Changes the velocity of a ball by an impulse at a contact, and its spin with it.
#[inline]
pub(super) fn push<S: Scalar>(
    velocity: &mut Vec3<S>,
    spin: &mut Vec3<S>,
    change: Vec3<S>,
    normal: Vec3<S>,
    spin_per_speed: S,
) {
    *velocity += change;
    *spin -= normal.cross(change) * spin_per_speed;
}

/// Changes the velocity of a ball, and its spin, as [`push`] does, by what its locks leave.
#[inline]
pub(super) fn push_locked<S: Scalar>(
    velocity: &mut Vec3<S>,
    spin: &mut Vec3<S>,
    change: Vec3<S>,
    normal: Vec3<S>,
    (spin_per_speed, locks): (S, LockedAxes),
) {
    if locks.is_empty() {
        return push(velocity, spin, change, normal, spin_per_speed);
    }
    let (mut faster, mut turned) = (Vec3::zero(), Vec3::zero());
    push(&mut faster, &mut turned, change, normal, spin_per_speed);
    *velocity += locks.free_translation(faster);
    *spin += locks.free_rotation(turned);
}

/// Relative velocity at a contact: that of the second body's contact point minus the first's, or
/// the surface's if there is no first body; in m/s.
#[inline(always)]
#[expect(clippy::inline_always, reason = "most of a pass is this")]
pub(super) fn relative_velocity<S: Scalar>(
    motion: impl Fn(usize) -> BodyMotion<S>,
    is_capsule: impl Fn(usize) -> bool,
    (a, b): (Option<usize>, usize),
    arms: &[Vec3<S>; 2],
    normal: Vec3<S>,
    surface_velocity: Vec3<S>,
) -> Vec3<S> {
    let second = motion(b);
    let mut velocity = second.velocity - surface_velocity;
    // The arms of balls lie along the normal: one product does for both. A ball among capsules
    // moves to the same bits as without them.
    let mut radius_times_spin = Vec3::zero();
    let mut add_spin = |row: usize, motion: &BodyMotion<S>, arm: &Vec3<S>, sign: S| {
        if is_capsule(row) {
            velocity += motion.spin.cross(*arm) * sign;
        } else {
            radius_times_spin += motion.spin * motion.radius;
        }
    };
    add_spin(b, &second, &arms[1], S::one());
    if let Some(a) = a {
        let first = motion(a);
        add_spin(a, &first, &arms[0], -S::one());
        velocity -= first.velocity;
    }
    velocity + normal.cross(radius_times_spin)
}
