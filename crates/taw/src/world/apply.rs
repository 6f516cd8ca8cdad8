//! Forces, impulses and momentum of single marbles.

use cgmath::{InnerSpace, Zero};

use super::marbles::{MarbleId, Marbles, SPIN, VELOCITY};
use crate::Error;
use crate::error::{finite_point, finite_vector};
use crate::frame::Bivector;
use crate::math::{Point3, Scalar, Vec3, cast_vector};
use crate::response::CapsuleInertia;

const FORCE: [&str; 3] = ["force.x", "force.y", "force.z"];
const IMPULSE: [&str; 3] = ["impulse.x", "impulse.y", "impulse.z"];
const POINT: [&str; 3] = ["point.x", "point.y", "point.z"];
const TORQUE: [&str; 3] = ["torque.yz", "torque.zx", "torque.xy"];

/// Forces and torques last for one [`World::step`](super::World::step), all of its
/// substeps, and add up. Torques count only in a model whose rotation is dynamic.
/// Impulses change velocities at once.
impl<S: Scalar> Marbles<S> {
    /// Pushes a marble at its center, in newtons.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`]; [`Error::NotFinite`] for the force, or for the sum of all
    /// so far.
    pub fn apply_force(&mut self, id: MarbleId, force: Vec3<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        let sum = self.force_with(row, force)?;
        self.force.set(row, Some(sum), self.len());
        Ok(())
    }

    /// The force on a row with another one.
    fn force_with(&self, row: usize, force: Vec3<S>) -> Result<Vec3<S>, Error> {
        finite_vector(FORCE, force)?;
        finite_vector(FORCE, self.force.get(row).unwrap_or_else(Vec3::zero) + force)
    }

    /// The torque on a row with another one.
    fn torque_with(&self, row: usize, torque: Vec3<S>) -> Result<Bivector<S>, Error> {
        finite_vector(TORQUE, torque)?;
        let sum = self.torque.get(row).unwrap_or_else(Bivector::zero).dual() + torque;
        finite_vector(TORQUE, sum).map(Bivector::from)
    }

    /// Pushes a marble at a point (in world space, of its surface or not), which turns it
    /// too.
    ///
    /// # Errors
    /// As [`Marbles::apply_force`] and [`Marbles::apply_torque`], and [`Error::NotFinite`] for
    /// the point; then nothing has changed.
    pub fn apply_force_at(
        &mut self,
        id: MarbleId,
        force: Vec3<S>,
        point: Point3<S>,
    ) -> Result<(), Error> {
        let row = self.row(id)?;
        let lever = finite_point(POINT, point)? - self.position[row];
        let sum = self.force_with(row, force)?;
        let torque = self.torque_with(row, Bivector::wedge(lever, force).dual())?;
        self.force.set(row, Some(sum), self.len());
        self.torque.set(row, Some(torque), self.len());
        Ok(())
    }

    /// Turns a marble, in N m: a [`Bivector`], or the axial vector that is its dual.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`]; [`Error::NotFinite`] for the torque, or for the sum of all
    /// so far.
    pub fn apply_torque(
        &mut self,
        id: MarbleId,
        torque: impl Into<Bivector<S>>,
    ) -> Result<(), Error> {
        let row = self.row(id)?;
        let sum = self.torque_with(row, torque.into().dual())?;
        self.torque.set(row, Some(sum), self.len());
        Ok(())
    }

    /// Forgets all forces and torques that were applied. A step ends with this.
    pub fn clear_forces(&mut self) {
        self.force.clear();
        self.torque.clear();
    }

    /// Changes a marble's velocity at once, as a hit at its center does: by `impulse` (in
    /// N s) over its mass.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`]; [`Error::NotFinite`] if the impulse or the velocity
    /// after it is not finite.
    pub fn apply_impulse(&mut self, id: MarbleId, impulse: Vec3<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        finite_vector(IMPULSE, impulse)?;
        let velocity = self.velocity[row] + impulse / self.mass(row);
        self.velocity[row] = finite_vector(VELOCITY, velocity)?;
        Ok(())
    }

    /// Hits a marble at a point, as a cue does: velocity and, in a model with rotation,
    /// spin change.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`]; [`Error::NotFinite`] for impulse or point, or for what
    /// comes of them; then nothing has changed.
    pub fn apply_impulse_at(
        &mut self,
        id: MarbleId,
        impulse: Vec3<S>,
        point: Point3<S>,
    ) -> Result<(), Error> {
        let row = self.row(id)?;
        finite_vector(IMPULSE, impulse)?;
        let lever = finite_point(POINT, point)? - self.position[row];
        let before = self.spin.get(row).copied();
        self.apply_angular_impulse(id, Bivector::wedge(lever, impulse))?;
        self.apply_impulse(id, impulse).inspect_err(|_| {
            if let (Some(slot), Some(before)) = (self.spin.get_mut(row), before) {
                *slot = before;
            }
        })
    }

    /// Changes a marble's spin at once: by an angular impulse (in kg m²/s) over its moment
    /// of inertia. Does nothing in a model without rotation.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`]; [`Error::NotFinite`] if the impulse or the spin after it
    /// is not finite.
    pub fn apply_angular_impulse(
        &mut self,
        id: MarbleId,
        impulse: impl Into<Bivector<S>>,
    ) -> Result<(), Error> {
        let row = self.row(id)?;
        let impulse =
            finite_vector(["impulse.yz", "impulse.zx", "impulse.xy"], impulse.into().dual())?;
        let change = self.spin_by(row, impulse);
        if let Some(spin) = self.spin.get_mut(row) {
            *spin = finite_vector(SPIN, *spin + change)?;
        }
        Ok(())
    }

    /// Mass times velocity, in kg m/s; infinite for a moving marble of infinite mass.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn momentum(&self, id: MarbleId) -> Result<Vec3<S>, Error> {
        let row = self.row(id)?;
        let (velocity, mass) = (self.velocity[row], self.mass(row));
        Ok(if velocity.is_zero() { velocity } else { velocity * mass })
    }

    /// Gives a marble the velocity that this momentum (in kg m/s) means for its mass.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`]; [`Error::NotFinite`] for the momentum or the velocity.
    pub fn set_momentum(&mut self, id: MarbleId, momentum: Vec3<S>) -> Result<(), Error> {
        let row = self.row(id)?;
        finite_vector(["momentum.x", "momentum.y", "momentum.z"], momentum)?;
        self.set_velocity(id, momentum / self.mass(row))
    }

    /// Moment of inertia times spin, about the marble's center, in kg m²/s; zero in a
    /// model without rotation.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn angular_momentum(&self, id: MarbleId) -> Result<Bivector<S>, Error> {
        let row = self.row(id)?;
        let spin = self.spin.get(row).copied().unwrap_or_else(Vec3::zero);
        let mass = self.mass(row);
        Ok(if spin.is_zero() { spin } else { self.by_moments(row, spin, |moment| moment * mass) }
            .into())
    }

    /// Twice the energy of the spin over the mass, in m²/s².
    pub(super) fn spin_energy(&self, row: usize) -> f64 {
        let (spin, radius) = (self.exact_spin(row), self.radius[row].as_f64());
        let half = self.half_length(row).as_f64();
        if half == 0.0 {
            return 0.4 * (spin * radius).magnitude2();
        }
        let [along, across] = CapsuleInertia::unit_inertia(radius, half);
        let axis = cast_vector::<S, f64>(self.axis(row)).normalize();
        let about_axis = spin.dot(axis);
        about_axis * about_axis * along + (spin - axis * about_axis).magnitude2() * across
    }

    /// What an angular impulse changes a spin by. Nothing for infinite mass.
    pub(super) fn spin_by(&self, row: usize, impulse: Vec3<S>) -> Vec3<S> {
        let mass = self.mass(row);
        self.by_moments(row, impulse, |moment| S::one() / mass / moment)
    }

    /// An axial vector, times something of the moments of inertia over the mass: about the
    /// axis of a capsule, and across it; those of a ball are `2/5 r²`, in m².
    pub(super) fn by_moments(&self, row: usize, v: Vec3<S>, of: impl Fn(S) -> S) -> Vec3<S> {
        let (radius, half) = (self.radius[row], self.half_length(row));
        if half == S::zero() {
            return v * of(S::constant(0.4) * radius * radius);
        }
        let [along, across] = CapsuleInertia::unit_inertia(radius, half).map(of);
        let axis = self.axis(row);
        let part = axis * v.dot(axis);
        part * along + (v - part) * across
    }
}
