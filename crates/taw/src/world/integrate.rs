//! Time integration of the marble columns.

use cgmath::Zero;

use super::marbles::{Compensation, Marbles};
use crate::math::{Scalar, Vec3, cast_point, cast_vector, is_finite, is_finite_point};
use crate::motion::{ForceField, Integrator, Motion, acceleration_in_step};

/// Step context: integrator, gravity, force fields and time step.
#[derive(Clone, Copy)]
pub(super) struct StepContext<'a, S> {
    pub integrator: Integrator,
    pub gravity: Vec3<S>,
    pub forces: &'a [ForceField<S>],
    /// Time step, in seconds.
    pub dt: S,
}

impl<S: Scalar> StepContext<'_, S> {
    /// Acceleration of a marble, in m/s².
    fn acceleration(&self, marbles: &Marbles<S>, row: usize, motion: Motion<S>) -> Vec3<S> {
        let mass = marbles.mass(row);
        if mass.is_infinite() {
            return Vec3::zero();
        }
        let scale = marbles.own.gravity_scale.get(row).unwrap_or(S::one());
        let own = marbles.own.force.get(row).unwrap_or_else(Vec3::zero) / mass;
        let sum =
            self.gravity * scale + own + acceleration_in_step(self.forces, motion, mass, self.dt);
        marbles.locked_axes_of_row(row).free_translation(sum)
    }
}

impl<S: Scalar> Marbles<S> {
    /// Integrates all marbles that are awake. A marble whose motion would become infinite or NaN keeps its
    /// position, loses its velocity, and is added to `stopped`.
    pub(super) fn integrate(&mut self, context: StepContext<S>, stopped: &mut Vec<u32>) {
        let sleep = std::mem::take(&mut self.sleep);
        self.integrate_rows(context, stopped, |row| !sleep.is_asleep(row));
        self.sleep = sleep;
    }

    /// Integrates the marbles that are meant, as [`Marbles::integrate`] does.
    pub(super) fn integrate_rows(
        &mut self,
        context: StepContext<S>,
        stopped: &mut Vec<u32>,
        is_meant: impl Fn(usize) -> bool,
    ) {
        if !self.compensation.is_empty() {
            self.integrate_compensated(context, stopped, is_meant);
            return;
        }
        // The columns are taken out while they are written, so that the others can be read.
        let mut position = std::mem::take(&mut self.position);
        let mut velocity = std::mem::take(&mut self.velocity);
        let (position_rows, velocity_rows) = (&mut position, &mut velocity);
        let mut rows =
            IntegratedRows { position: position_rows, velocity: velocity_rows, stopped, is_meant };
        let only_gravity = context.forces.is_empty()
            && self.own.gravity_scale.is_empty()
            && self.own.mass.is_empty()
            && self.own.locked_axes.is_empty()
            && self.own.force.is_empty();
        let same_for_all = self.own.integrator.is_empty() && self.own.damping.is_empty();
        if only_gravity && same_for_all {
            rows.integrate(context.integrator, context.dt, |_, _| context.gravity);
        } else if same_for_all {
            let all = |row: usize, motion| context.acceleration(self, row, motion);
            rows.integrate(context.integrator, context.dt, all);
        } else {
            rows.each(|row, motion| {
                let integrator = self.own.integrator.get(row).unwrap_or(context.integrator);
                let next = motion
                    .step(integrator, context.dt, |motion| context.acceleration(self, row, motion));
                Motion { velocity: next.velocity * self.damping_factor(row, context.dt), ..next }
            });
        }
        (self.position, self.velocity) = (position, velocity);
    }

    /// Integrates in `f64` and stores the rounding errors in the compensation column.
    fn integrate_compensated(
        &mut self,
        context: StepContext<S>,
        stopped: &mut Vec<u32>,
        is_meant: impl Fn(usize) -> bool,
    ) {
        for row in (0..self.len()).filter(|row| is_meant(*row)) {
            let start = self.motion_f64(row);
            let next = self.step_f64(row, context);
            let overflowed = !(is_finite_point(next.position) && is_finite(next.velocity));
            if overflowed {
                self.set_motion_f64(row, Motion { velocity: Vec3::zero(), ..start });
            }
            if overflowed || !self.set_motion_f64(row, next) {
                stopped.push(row as u32);
            }
        }
    }

    /// Mean acceleration of every marble over the step, in m/s², without moving any.
    pub(super) fn mean_accelerations(&self, context: StepContext<S>, mean: &mut Vec<Vec3<f64>>) {
        mean.clear();
        mean.extend((0..self.len()).map(|row| {
            let change = self.step_f64(row, context).velocity - self.motion_f64(row).velocity;
            // Under gravity alone, without the rounding of a difference.
            if context.forces.is_empty() && self.own.damping.get(row).is_none() {
                cast_vector(context.acceleration(self, row, self.motion(row)))
            } else {
                change / context.dt.as_f64()
            }
        }));
    }

    fn step_f64(&self, row: usize, context: StepContext<S>) -> Motion<f64> {
        let integrator = self.own.integrator.get(row).unwrap_or(context.integrator);
        let next = self.motion_f64(row).step(integrator, context.dt.as_f64(), |at| {
            let (position, velocity) = (cast_point(at.position), cast_vector(at.velocity));
            cast_vector(context.acceleration(self, row, Motion { position, velocity }))
        });
        Motion { velocity: next.velocity * self.damping_factor(row, context.dt).as_f64(), ..next }
    }

    fn motion(&self, row: usize) -> Motion<S> {
        Motion { position: self.position[row], velocity: self.velocity[row] }
    }

    /// Position and velocity in high precision, including the compensation.
    pub(super) fn motion_f64(&self, row: usize) -> Motion<f64> {
        let low = self.compensation.get(row).copied().unwrap_or_default();
        Motion {
            position: cast_point(self.position[row]) + cast_vector(low.position),
            velocity: cast_vector(self.velocity[row]) + cast_vector(low.velocity),
        }
    }

    /// Splits position and velocity into the scalar part and the compensation. Returns false on
    /// overflow: then the marble keeps its position and loses its velocity.
    pub(super) fn set_motion_f64(&mut self, row: usize, motion: Motion<f64>) -> bool {
        let position = cast_point(motion.position);
        let velocity = cast_vector(motion.velocity);
        if !is_finite_point(position) || !is_finite(velocity) {
            self.velocity[row] = Vec3::zero();
            if let Some(low) = self.compensation.get_mut(row) {
                low.velocity = Vec3::zero();
            }
            return false;
        }
        self.position[row] = position;
        self.velocity[row] = velocity;
        if let Some(low) = self.compensation.get_mut(row) {
            low.position = cast_vector(motion.position - cast_point(position));
            low.velocity = cast_vector(motion.velocity - cast_vector(velocity));
        }
        true
    }

    /// Fraction of the velocity left by damping after `dt` seconds.
    fn damping_factor(&self, row: usize, dt: S) -> S {
        self.own.damping.get(row).map_or(S::one(), |damping| (-damping.linear * dt).exp_portable())
    }

    /// Adds or drops the compensation column.
    pub(super) fn set_compensated(&mut self, compensated: bool) {
        if compensated != self.compensated {
            self.compensated = compensated;
            let rows = if compensated { self.position.len() } else { 0 };
            self.compensation = vec![Compensation::default(); rows];
        }
    }
}

/// Columns that an integrator writes.
struct IntegratedRows<'a, S, F> {
    position: &'a mut [crate::math::Point3<S>],
    velocity: &'a mut [Vec3<S>],
    stopped: &'a mut Vec<u32>,
    is_meant: F,
}

impl<S: Scalar, F: Fn(usize) -> bool> IntegratedRows<'_, S, F> {
    /// Integrates all marbles with a kernel that is chosen once for all.
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
            if !(self.is_meant)(row) {
                continue;
            }
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
