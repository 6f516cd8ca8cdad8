//! The first verb on the columns of marbles.

use cgmath::{InnerSpace, Zero};

use super::marbles::{Marbles, Rest};
use crate::math::{Quat, Scalar, Vec3, cast_point, cast_vector, is_finite, is_finite_point};
use crate::motion::{Force, Integrator, Motion, Rotation, turned};
use crate::response::CapsuleInertia;

/// What moves all marbles.
#[derive(Clone, Copy)]
pub(super) struct Drive<'a, S> {
    pub integrator: Integrator,
    pub gravity: Vec3<S>,
    pub forces: &'a [Force<S>],
    /// In seconds.
    pub dt: S,
}

impl<S: Scalar> Drive<'_, S> {
    /// What acts on the marble in a row, in m/s².
    fn acceleration(&self, marbles: &Marbles<S>, row: usize, motion: Motion<S>) -> Vec3<S> {
        let mass = marbles.mass(row);
        if mass.is_infinite() {
            return Vec3::zero();
        }
        let scale = marbles.gravity_scale.get(row).unwrap_or(S::one());
        let own = marbles.force.get(row).unwrap_or_else(Vec3::zero) / mass;
        self.forces
            .iter()
            .fold(self.gravity * scale + own, |sum, force| sum + force.acceleration(motion, mass))
    }
}

impl<S: Scalar> Marbles<S> {
    /// Moves every row on. A row that would become infinite or NaN keeps its place,
    /// loses its velocity, and is added to `stopped`.
    pub(super) fn integrate(&mut self, drive: Drive<S>, stopped: &mut Vec<u32>) {
        if !self.rest.is_empty() {
            self.integrate_compensated(drive, stopped);
            return;
        }
        // The columns leave while they are written, so that the rest can be read.
        let mut position = std::mem::take(&mut self.position);
        let mut velocity = std::mem::take(&mut self.velocity);
        let mut rows = Rows { position: &mut position, velocity: &mut velocity, stopped };
        let only_gravity = drive.forces.is_empty()
            && self.gravity_scale.is_empty()
            && self.mass.is_empty()
            && self.force.is_empty();
        let same_for_all = self.integrator.is_empty() && self.damping.is_empty();
        if only_gravity && same_for_all {
            rows.integrate(drive.integrator, drive.dt, |_, _| drive.gravity);
        } else if same_for_all {
            let all = |row: usize, motion| drive.acceleration(self, row, motion);
            rows.integrate(drive.integrator, drive.dt, all);
        } else {
            rows.each(|row, motion| {
                let integrator = self.integrator.get(row).unwrap_or(drive.integrator);
                let next = motion
                    .after(integrator, drive.dt, |motion| drive.acceleration(self, row, motion));
                Motion { velocity: next.velocity * self.kept(row, drive.dt), ..next }
            });
        }
        (self.position, self.velocity) = (position, velocity);
    }

    /// The same in `f64`, keeping what the scalar cuts off.
    fn integrate_compensated(&mut self, drive: Drive<S>, stopped: &mut Vec<u32>) {
        for row in 0..self.len() {
            let start = self.exact(row);
            let next = self.exact_after(row, drive);
            let overflowed = !(is_finite_point(next.position) && is_finite(next.velocity));
            if overflowed {
                self.set_exact(row, Motion { velocity: Vec3::zero(), ..start });
            }
            if overflowed || !self.set_exact(row, next) {
                stopped.push(row as u32);
            }
        }
    }

    /// The mean acceleration of every row over the step, in m/s², which moves none.
    pub(super) fn mean_accelerations(&self, drive: Drive<S>, mean: &mut Vec<Vec3<f64>>) {
        mean.clear();
        mean.extend((0..self.len()).map(|row| {
            let change = self.exact_after(row, drive).velocity - self.exact(row).velocity;
            // Under gravity alone it is known without the rounding of a difference.
            if drive.forces.is_empty() && self.damping.get(row).is_none() {
                cast_vector(drive.acceleration(self, row, self.motion(row)))
            } else {
                change / drive.dt.as_f64()
            }
        }));
    }

    fn exact_after(&self, row: usize, drive: Drive<S>) -> Motion<f64> {
        let integrator = self.integrator.get(row).unwrap_or(drive.integrator);
        let next = self.exact(row).after(integrator, drive.dt.as_f64(), |at| {
            let (position, velocity) = (cast_point(at.position), cast_vector(at.velocity));
            cast_vector(drive.acceleration(self, row, Motion { position, velocity }))
        });
        Motion { velocity: next.velocity * self.kept(row, drive.dt).as_f64(), ..next }
    }

    fn motion(&self, row: usize) -> Motion<S> {
        Motion { position: self.position[row], velocity: self.velocity[row] }
    }

    /// Position and velocity with what the scalar cuts off.
    pub(super) fn exact(&self, row: usize) -> Motion<f64> {
        let rest = self.rest.get(row).copied().unwrap_or_default();
        Motion {
            position: cast_point(self.position[row]) + cast_vector(rest.position),
            velocity: cast_vector(self.velocity[row]) + cast_vector(rest.velocity),
        }
    }

    /// Splits position and velocity into what the scalar holds and the rest. False if they are
    /// beyond what it holds: then the row keeps its place and loses its velocity.
    pub(super) fn set_exact(&mut self, row: usize, motion: Motion<f64>) -> bool {
        let position = cast_point(motion.position);
        let velocity = cast_vector(motion.velocity);
        if !is_finite_point(position) || !is_finite(velocity) {
            self.velocity[row] = Vec3::zero();
            if let Some(rest) = self.rest.get_mut(row) {
                rest.velocity = Vec3::zero();
            }
            return false;
        }
        self.position[row] = position;
        self.velocity[row] = velocity;
        if let Some(rest) = self.rest.get_mut(row) {
            rest.position = cast_vector(motion.position - cast_point(position));
            rest.velocity = cast_vector(motion.velocity - cast_vector(velocity));
        }
        true
    }

    /// The spin with what the scalar cuts off, in rad/s.
    pub(super) fn exact_spin(&self, row: usize) -> Vec3<f64> {
        let rest = self.rest.get(row).copied().unwrap_or_default();
        let spin = self.spin.get(row).copied().unwrap_or_else(Vec3::zero);
        cast_vector::<S, f64>(spin) + cast_vector(rest.spin)
    }

    /// Splits the spin in the same way. Does nothing in a model without rotation.
    pub(super) fn set_exact_spin(&mut self, row: usize, spin: Vec3<f64>) -> bool {
        if let Some(slot) = self.spin.get_mut(row) {
            *slot = cast_vector(spin);
            if !is_finite(*slot) {
                *slot = Vec3::zero();
                if let Some(rest) = self.rest.get_mut(row) {
                    rest.spin = Vec3::zero();
                }
                return false;
            }
            if let Some(rest) = self.rest.get_mut(row) {
                rest.spin = cast_vector(spin - cast_vector(*slot));
            }
        }
        true
    }

    /// The part of the velocity that damping leaves after `dt` seconds.
    fn kept(&self, row: usize, dt: S) -> S {
        self.damping.get(row).map_or(S::one(), |damping| (-damping.linear * dt).exp_portable())
    }

    /// Lets torques and damping change the spins over `dt` seconds.
    pub(super) fn spin_up(&mut self, dt: S) {
        if self.torque.is_empty() && self.damping.is_empty() {
            return;
        }
        for row in 0..self.spin.len() {
            if self.is_held(row) {
                continue;
            }
            let mut spin = self.spin[row];
            if let Some(torque) = self.torque.get(row) {
                spin += self.spin_by(row, torque.dual()) * dt;
            }
            if let Some(damping) = self.damping.get(row) {
                spin *= (-damping.angular * dt).exp_portable();
            }
            if is_finite(spin) && spin != self.spin[row] {
                self.spin[row] = spin;
            }
        }
    }

    /// Turns every row on by its spin for `dt` seconds. Capsules that do not feel their spin in a
    /// world of this `rotation` turn about their axes only: else they would turn into walls, and be
    /// lifted out, which is energy from nothing.
    pub(super) fn turn(&mut self, dt: S, rotation: Rotation) {
        if self.has_capsules() {
            for row in 0..self.spin.len() {
                let own = self.rotation_model.get(row).unwrap_or(rotation);
                if own.min(rotation) == Rotation::Dynamic || self.half_length(row) == S::zero() {
                    self.turn_top(row, dt);
                } else {
                    let axis = self.rotation[row] * Vec3::unit_y();
                    let spin = axis * self.spin[row].dot(axis);
                    self.rotation[row] = turned(self.rotation[row], spin, dt);
                }
            }
            return;
        }
        for (rotation, spin) in self.rotation.iter_mut().zip(&self.spin) {
            *rotation = turned(*rotation, *spin, dt);
        }
    }

    /// Turns a row on as what it is, a symmetric top: it turns evenly about its axis, and the
    /// axis about the angular momentum, which stays (Landau and Lifshitz, *Mechanics*, §33).
    ///
    /// Counted in `f64` and rounded once. In `f32` a quaternion is a unit only to 1e-7, and its
    /// axis too: the spin along it would grow by that in every substep, always the same way.
    fn turn_top(&mut self, row: usize, dt: S) {
        let (rotation, half) = (self.rotation[row], self.half_length(row));
        if half == S::zero() || self.spin[row].is_zero() {
            self.rotation[row] = turned(rotation, self.spin[row], dt);
            return;
        }
        let exact = |rotation: Quat<S>| {
            Quat::from_sv(rotation.s.as_f64(), cast_vector(rotation.v)).normalize()
        };
        let (spin, dt) = (self.exact_spin(row), dt.as_f64());
        let rotation = exact(rotation);
        let axis = (rotation * Vec3::unit_y()).normalize();
        let [along, across] =
            CapsuleInertia::unit_inertia(self.radius[row].as_f64(), half.as_f64());
        // Angular momentum over the moment across: how fast the axis goes around it.
        let about_axis = spin.dot(axis);
        let precession = spin + axis * (about_axis * (along / across - 1.0));
        let own = axis * (about_axis - precession.dot(axis));
        let rotation = turned(turned(rotation, own, dt), precession, dt);
        self.rotation[row] = Quat::from_sv(S::constant(rotation.s), cast_vector(rotation.v));
        // About the axis as it is kept, which rounding has tilted: so the spin along it, and
        // with it the energy of thin capsules, does not change.
        let axis = (exact(self.rotation[row]) * Vec3::unit_y()).normalize();
        let next = precession + axis * (about_axis - precession.dot(axis));
        self.set_exact_spin(row, next);
    }

    /// Turns a row on by an angle, an axial vector in radians.
    pub(super) fn turn_by(&mut self, row: usize, angle: Vec3<S>) {
        if let Some(rotation) = self.rotation.get_mut(row) {
            *rotation = turned(*rotation, angle, S::one());
        }
    }

    /// Adds or drops the column of what the scalar cuts off.
    pub(super) fn set_compensated(&mut self, compensated: bool) {
        if compensated != self.compensated {
            self.compensated = compensated;
            let rows = if compensated { self.position.len() } else { 0 };
            self.rest = vec![Rest::default(); rows];
        }
    }
}

/// The columns that an integrator writes.
struct Rows<'a, S> {
    position: &'a mut [crate::math::Point3<S>],
    velocity: &'a mut [Vec3<S>],
    stopped: &'a mut Vec<u32>,
}

impl<S: Scalar> Rows<'_, S> {
    /// Moves every row on, by a kernel that is chosen once for all of them.
    fn integrate(
        &mut self,
        integrator: Integrator,
        dt: S,
        acceleration: impl Fn(usize, Motion<S>) -> Vec3<S>,
    ) {
        let at = |row: usize| {
            let acceleration = &acceleration;
            move |motion| acceleration(row, motion)
        };
        match integrator {
            Integrator::ExplicitEuler => self.each(|row, m| m.explicit_euler(dt, at(row))),
            Integrator::SemiImplicitEuler => self.each(|row, m| m.semi_implicit_euler(dt, at(row))),
            Integrator::VelocityVerlet => self.each(|row, m| m.velocity_verlet(dt, at(row))),
            Integrator::Leapfrog => self.each(|row, m| m.leapfrog(dt, at(row))),
            Integrator::Rk4 => self.each(|row, m| m.rk4(dt, at(row))),
        }
    }

    #[inline]
    fn each(&mut self, kernel: impl Fn(usize, Motion<S>) -> Motion<S>) {
        let columns = self.position.iter_mut().zip(self.velocity.iter_mut());
        for (row, (position, velocity)) in columns.enumerate() {
            let next = kernel(row, Motion { position: *position, velocity: *velocity });
            if is_finite_point(next.position) && is_finite(next.velocity) {
                (*position, *velocity) = (next.position, next.velocity);
            } else {
                *velocity = Vec3::zero();
                self.stopped.push(row as u32);
            }
        }
    }
}
