//! Marbles with locked axes: what keeps them in place, whatever pushes.

use cgmath::{InnerSpace, One};

use super::World;
use super::marbles::Marbles;
use crate::Error;
use crate::math::{Point3, Quat, Scalar, Vec3, cast_vector};
use crate::motion::{LockedAxes, integrate_rotation};
use crate::response::CapsuleInertia;
use crate::shape::capsule_unit_inertia;

/// Marble with locked axes, and its center, in metres, that it keeps along them.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeldMarble<S> {
    row: usize,
    axes: LockedAxes,
    position: Point3<S>,
}

impl<S: Scalar> World<S> {
    /// Refuses locked axes where the response has no method for them.
    pub(super) fn check_locked_axes(&self) -> Result<(), Error> {
        if self.marbles.own.locked_axes.is_empty()
            || self.settings.model.response.knows_locked_axes()
        {
            return Ok(());
        }
        Err(LOCKS_REFUSED)
    }

    /// Returns the error by which the response refuses a marble for its locked axes.
    pub(super) fn check_locked_axes_of_row(&self, row: usize) -> Result<(), Error> {
        let refused = !self.settings.model.response.knows_locked_axes()
            && !self.marbles.locked_axes_of_row(row).is_empty();
        if refused { Err(LOCKS_REFUSED) } else { Ok(()) }
    }
}

/// Refusal by the only response without a method for locks.
const LOCKS_REFUSED: Error = Error::Unsupported { response: "EventDriven", feature: "locked axes" };

impl<S: Scalar> Marbles<S> {
    /// Locked axes of a marble.
    #[inline]
    pub(super) fn locked_axes_of_row(&self, row: usize) -> LockedAxes {
        self.own.locked_axes.get(row).unwrap_or_default()
    }

    /// Lists the marbles with locked axes, where they are; nothing without any.
    pub(super) fn held(&self) -> Vec<HeldMarble<S>> {
        if self.own.locked_axes.is_empty() {
            return Vec::new();
        }
        let held = |row: usize| {
            let axes = self.own.locked_axes.get(row)?;
            Some(HeldMarble { row, axes, position: self.position[row] })
        };
        (0..self.len()).filter_map(held).collect()
    }

    /// Puts these back along their locked axes, and stops them along those.
    pub(super) fn hold(&mut self, held: &[HeldMarble<S>]) {
        for HeldMarble { row, axes, position } in held {
            self.position[*row] = axes.held(self.position[*row], *position);
            self.velocity[*row] = axes.free_translation(self.velocity[*row]);
            if let Some(low) = self.compensation.get_mut(*row) {
                low.velocity = axes.free_translation(low.velocity);
            }
            self.stop_locked_spin(*row, *axes);
        }
    }

    /// Takes the angular velocity about locked axes.
    fn stop_locked_spin(&mut self, row: usize, axes: LockedAxes) {
        if axes.turns_freely() || self.angular_velocity.is_empty() {
            return;
        }
        let spin = self.angular_velocity_f64(row);
        let kept = self.locked_spin(row, axes, spin);
        if kept != spin {
            self.set_angular_velocity_f64(row, kept);
        }
    }

    /// Part of an angular velocity, in rad/s, that the locks of a marble leave.
    pub(super) fn free_spin(&self, row: usize, spin: Vec3<S>) -> Vec3<S> {
        let axes = self.locked_axes_of_row(row);
        if axes.turns_freely() {
            return spin;
        }
        cast_vector(self.locked_spin(row, axes, cast_vector(spin)))
    }

    /// Part of an angular velocity that locks leave: of a ball that about free axes, of a capsule what the
    /// impulse of an ideal constraint leaves.
    fn locked_spin(&self, row: usize, axes: LockedAxes, spin: Vec3<f64>) -> Vec3<f64> {
        if self.half_length(row) == S::zero() {
            axes.free_rotation(spin)
        } else {
            self.locked_rod(row, axes).constrained(spin)
        }
    }

    /// Axis and inertia of a marble with locked axes, in `f64`.
    fn locked_rod(&self, row: usize, locked_axes: LockedAxes) -> CapsuleInertia<f64> {
        let half_length = self.half_length(row).as_f64();
        let moments = capsule_unit_inertia(self.radius[row].as_f64(), half_length);
        CapsuleInertia {
            axis: exact(self.axis_rotation(row)) * Vec3::unit_y(),
            half_length,
            inverse_unit_inertia: moments.map(f64::recip),
            locked_axes,
        }
    }

    fn axis_rotation(&self, row: usize) -> Quat<S> {
        self.rotation.get(row).copied().unwrap_or_else(Quat::one)
    }

    /// Rotates a capsule with locked axes of rotation over `dt` seconds. Its angular momentum about free
    /// axes stays; where two are free, the rounding of the step is not allowed to add energy.
    pub(super) fn rotate_locked_capsule(&mut self, row: usize, axes: LockedAxes, dt: f64) {
        let spin = self.angular_velocity_f64(row);
        let before = self.locked_rod(row, axes);
        let rotation = integrate_rotation(exact(self.rotation[row]), spin, dt);
        self.rotation[row] = Quat::from_sv(S::from_f64(rotation.s), cast_vector(rotation.v));
        let after = self.locked_rod(row, axes);
        let next = after.apply_inverse_inertia(before.momentum(spin));
        let [energy, gained] = [before.spin_energy(spin), after.spin_energy(next)];
        let part = if gained > energy { (energy / gained).sqrt() } else { 1.0 };
        self.set_angular_velocity_f64(row, next * part);
    }
}

/// Rotation in `f64`, of unit length.
fn exact<S: Scalar>(rotation: Quat<S>) -> Quat<f64> {
    Quat::from_sv(rotation.s.as_f64(), cast_vector(rotation.v)).normalize()
}
