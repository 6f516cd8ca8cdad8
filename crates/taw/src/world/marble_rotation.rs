//! Rotation of marbles: models, visual rolling, and integration.

use cgmath::{InnerSpace, One, Zero};

use super::continuous::Turn;
use super::marbles::Marbles;
use crate::math::{Quat, Scalar, Vec3, cast_vector, is_finite};
use crate::motion::{LockedAxes, Rotation, integrate_rotation};
use crate::shape::capsule_unit_inertia;

impl<S: Scalar> Marbles<S> {
    /// Rotation model of a marble in a world of this model.
    pub(super) fn rotation_of(&self, row: usize, world: Rotation) -> Rotation {
        if self.locked_axes_of_row(row).contains(LockedAxes::ROTATION) {
            return Rotation::None;
        }
        self.own.rotation_model.get(row).map_or(world, |own| own.min(world))
    }

    /// Returns true if contacts and torques do not affect the marble's rotation.
    pub(super) fn is_rotation_locked(&self, row: usize) -> bool {
        self.rotation_of(row, Rotation::Dynamic) != Rotation::Dynamic
    }

    /// Returns true if any marble has its own rotation model or locked axes.
    pub(super) fn has_rotation_locks(&self) -> bool {
        !(self.own.rotation_model.is_empty() && self.own.locked_axes.is_empty())
    }

    /// Adds or drops the columns for rotation. New ones start with no rotation, at rest.
    pub(super) fn enable_rotation(&mut self, enable: bool) {
        if enable != self.has_rotation {
            self.has_rotation = enable;
            let rows = if enable { self.position.len() } else { 0 };
            self.rotation = vec![Quat::one(); rows];
            self.angular_velocity = vec![Vec3::zero(); rows];
        }
    }

    /// Sets the angular velocity of rolling without slip over a surface at rest with this normal.
    pub(super) fn roll_without_slip(&mut self, row: usize, normal: Vec3<S>) {
        let angular_velocity = normal.cross(self.velocity[row]) / self.radius[row];
        let locks = self.locked_axes_of_row(row);
        if self.own.half_length.get(row).is_some() {
            return; // it does not roll whichever way it goes
        }
        if let Some(slot) = self.angular_velocity.get_mut(row)
            && is_finite(angular_velocity)
        {
            *slot = locks.free_rotation(angular_velocity);
        }
    }

    /// Angular velocity in high precision, in rad/s.
    pub(super) fn angular_velocity_f64(&self, row: usize) -> Vec3<f64> {
        let low = self.compensation.get(row).copied().unwrap_or_default();
        let angular_velocity = self.angular_velocity.get(row).copied().unwrap_or_else(Vec3::zero);
        cast_vector::<S, f64>(angular_velocity) + cast_vector(low.angular_velocity)
    }

    /// Splits the angular velocity likewise. Does nothing in a model without rotation.
    pub(super) fn set_angular_velocity_f64(
        &mut self,
        row: usize,
        angular_velocity: Vec3<f64>,
    ) -> bool {
        if let Some(slot) = self.angular_velocity.get_mut(row) {
            *slot = cast_vector(angular_velocity);
            if !is_finite(*slot) {
                *slot = Vec3::zero();
                if let Some(low) = self.compensation.get_mut(row) {
                    low.angular_velocity = Vec3::zero();
                }
                return false;
            }
            if let Some(low) = self.compensation.get_mut(row) {
                low.angular_velocity = cast_vector(angular_velocity - cast_vector(*slot));
            }
        }
        true
    }

    /// Integrates torques and angular damping over `dt` seconds.
    pub(super) fn integrate_angular_velocity(&mut self, dt: S) {
        if self.own.torque.is_empty() && self.own.damping.is_empty() {
            return;
        }
        for row in 0..self.angular_velocity.len() {
            if self.is_rotation_locked(row) {
                continue;
            }
            let mut angular_velocity = self.angular_velocity[row];
            if let Some(torque) = self.own.torque.get(row) {
                angular_velocity += self.apply_inverse_inertia(row, torque.dual()) * dt;
            }
            if let Some(damping) = self.own.damping.get(row) {
                angular_velocity *= (-damping.angular * dt).exp_portable();
            }
            let angular_velocity = self.free_spin(row, angular_velocity);
            if is_finite(angular_velocity) && angular_velocity != self.angular_velocity[row] {
                self.angular_velocity[row] = angular_velocity;
                self.mark_changed(row);
            }
        }
    }

    /// Integrates rotations over `dt` seconds. Capsules without dynamic rotation in a world of this
    /// `rotation` rotate about their axes only: otherwise they would rotate into walls and be
    /// lifted out, which gains energy. `turns` says by row how walls stop the rotation of capsules; it
    /// is empty if they stop none.
    pub(super) fn integrate_rotations(&mut self, dt: S, rotation: Rotation, turns: &[Turn<S>]) {
        if self.has_capsules() {
            for row in 0..self.angular_velocity.len() {
                if self.sleep.is_asleep(row) {
                    continue;
                }
                let Turn { free, carried } = turns.get(row).copied().unwrap_or_default();
                self.integrate_free_rotation(row, dt * free, rotation);
                let turns = self.locked_axes_of_row(row).turns_freely();
                if carried != Quat::one() && turns {
                    self.carry_rotation(row, carried);
                }
            }
            return;
        }
        let columns = self.rotation.iter_mut().zip(&self.angular_velocity);
        for (row, (rotation, angular_velocity)) in columns.enumerate() {
            if !self.sleep.is_asleep(row) {
                *rotation = integrate_rotation(*rotation, *angular_velocity, dt);
            }
        }
    }

    /// Integrates the rotation of a marble among capsules.
    fn integrate_free_rotation(&mut self, row: usize, dt: S, model: Rotation) {
        let locks = self.locked_axes_of_row(row);
        let is_ball = self.half_length(row) == S::zero();
        if !locks.turns_freely() && !is_ball && self.is_dynamic(row, model) {
            if !self.angular_velocity[row].is_zero() {
                self.rotate_locked_capsule(row, locks, dt.as_f64());
            }
        } else if self.is_dynamic(row, model) || is_ball {
            self.integrate_symmetric_top(row, dt);
        } else {
            let axis = self.rotation[row] * Vec3::unit_y();
            let angular_velocity = axis * self.angular_velocity[row].dot(axis);
            self.rotation[row] = integrate_rotation(self.rotation[row], angular_velocity, dt);
        }
    }

    /// Returns true if a marble rotates as a rigid body in a world of this model.
    pub(super) fn is_dynamic(&self, row: usize, model: Rotation) -> bool {
        self.rotation_of(row, model) == Rotation::Dynamic
    }

    /// Rotates a capsule with a wall that carries it, its angular velocity with it: its energy stays.
    fn carry_rotation(&mut self, row: usize, carried: Quat<S>) {
        let exact = Quat::from_sv(carried.s.as_f64(), cast_vector(carried.v)).normalize();
        self.rotation[row] = (carried * self.rotation[row]).normalize();
        self.set_angular_velocity_f64(row, exact * self.angular_velocity_f64(row));
    }

    /// Angular velocity of a capsule's axis in free motion in a world of this model, in rad/s.
    pub(super) fn axis_velocity(&self, row: usize, model: Rotation) -> Vec3<S> {
        if !self.is_dynamic(row, model) || self.angular_velocity[row].is_zero() {
            return Vec3::zero();
        }
        if !self.locked_axes_of_row(row).turns_freely() {
            return self.angular_velocity[row];
        }
        cast_vector(self.precession(row, cast_vector(self.axis(row))))
    }

    /// Precession rate of a capsule with this axis, in rad/s: its angular momentum over the moment across
    /// the axis.
    fn precession(&self, row: usize, axis: Vec3<f64>) -> Vec3<f64> {
        let half = self.half_length(row).as_f64();
        let [along, across] = capsule_unit_inertia(self.radius[row].as_f64(), half);
        let angular_velocity = self.angular_velocity_f64(row);
        angular_velocity + axis * (angular_velocity.dot(axis) * (along / across - 1.0))
    }

    /// Rotates a capsule as the symmetric top that it is: steadily about its axis, and the axis
    /// about the conserved angular momentum (Landau and Lifshitz, *Mechanics*, §33).
    ///
    /// Computed in `f64` and rounded once. In `f32` a quaternion and its axis are normalized only
    /// to 1e-7: the angular velocity along the axis would grow by that in every substep, always in
    /// the same direction.
    fn integrate_symmetric_top(&mut self, row: usize, dt: S) {
        let (rotation, half) = (self.rotation[row], self.half_length(row));
        if half == S::zero() || self.angular_velocity[row].is_zero() {
            self.rotation[row] = integrate_rotation(rotation, self.angular_velocity[row], dt);
            return;
        }
        let exact = |rotation: Quat<S>| {
            Quat::from_sv(rotation.s.as_f64(), cast_vector(rotation.v)).normalize()
        };
        let dt = dt.as_f64();
        let rotation = exact(rotation);
        let axis = (rotation * Vec3::unit_y()).normalize();
        let about_axis = self.angular_velocity_f64(row).dot(axis);
        let precession = self.precession(row, axis);
        let own = axis * (about_axis - precession.dot(axis));
        let rotation = integrate_rotation(integrate_rotation(rotation, own, dt), precession, dt);
        self.rotation[row] = Quat::from_sv(S::from_f64(rotation.s), cast_vector(rotation.v));
        // Relative to the stored, rounded axis, so that the angular velocity along it, and with it
        // the energy of thin capsules, does not change.
        let axis = (exact(self.rotation[row]) * Vec3::unit_y()).normalize();
        let next = precession + axis * (about_axis - precession.dot(axis));
        self.set_angular_velocity_f64(row, next);
    }

    /// Rotates a marble by an angle, an axial vector in radians.
    pub(super) fn rotate_by(&mut self, row: usize, angle: Vec3<S>) {
        if let Some(rotation) = self.rotation.get_mut(row) {
            *rotation = integrate_rotation(*rotation, angle, S::one());
        }
    }
}
