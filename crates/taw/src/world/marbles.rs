//! Marbles as columns.

use std::collections::BTreeMap;

use cgmath::{One, Zero};

use super::ColliderId;
use super::changed_rows::ChangedRows;
use super::marble::{Damping, Marble, non_default, validated_half_length, validated_rotation};
use super::sleep_columns::SleepColumns;
use super::sparse_column::{SparseColumn, sparse_columns};
use crate::Error;
use crate::broad::{CollisionLayers, IgnoredPairs, Period};
use crate::contact::ContactMaterial;
use crate::error::{finite, finite_point, finite_vector, positive};
use crate::frame::Bivector;
use crate::handle::{Handles, MarbleId};
use crate::math::{Point3, Quat, Scalar, Vec3, cast_vector, is_finite, is_finite_point};
use crate::motion::{Integrator, LockedAxes, Mass, Motion, Rotation};
use crate::response::{CapsuleInertia, Material, SolverBodies};
use crate::swarm::BodyColumns;
use crate::uncompared::Uncompared;

/// Compensation: the low parts of a marble's double-single numbers, which the scalar cuts off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Compensation<S> {
    pub position: Vec3<S>,
    pub velocity: Vec3<S>,
    pub angular_velocity: Vec3<S>,
}

impl<S: Scalar> Default for Compensation<S> {
    fn default() -> Self {
        Self { position: Vec3::zero(), velocity: Vec3::zero(), angular_velocity: Vec3::zero() }
    }
}

sparse_columns! {
    /// Columns of what few marbles have.
    OwnColumns, OwnValues {
        /// Capsules only.
        half_length: S,
        /// Non-default masses.
        mass: Mass<S>,
        /// Gravity scales other than one.
        gravity_scale: S,
        /// Non-zero damping.
        damping: Damping<S>,
        /// Applied force of this step.
        force: Vec3<S>,
        /// Applied torque of this step.
        torque: Bivector<S>,
        integrator: Integrator,
        rotation_model: Rotation,
        material: Material<S>,
        /// Locked axes other than none.
        locked_axes: LockedAxes,
        /// Layers other than all.
        layers: CollisionLayers,
        /// Marbles that never sleep.
        sleeping_disabled: (),
    }
}

/// Marbles (dynamic spheres and capsules) as columns: index *i* of each belongs to one marble.
///
/// Indices change when marbles are removed; a [`MarbleId`] stays valid.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Marbles<S> {
    handles: Handles,
    /// Flags: columns for rotation and for compensation exist.
    pub(super) has_rotation: bool,
    pub(super) compensated: bool,
    pub(super) period: Period<S>,
    pub(super) changed: ChangedRows,
    pub(super) position: Vec<Point3<S>>,
    pub(super) radius: Vec<S>,
    pub(super) velocity: Vec<Vec3<S>>,
    /// Empty in a model without rotation, as is `angular_velocity`.
    pub(super) rotation: Vec<Quat<S>>,
    pub(super) angular_velocity: Vec<Vec3<S>>,
    /// Empty in a model of plain precision.
    pub(super) compensation: Vec<Compensation<S>>,
    pub(super) own: OwnColumns<S>,
    pub(super) sleep: SleepColumns<S>,
    /// Lists of whom marbles pass through; see `ignored.rs`.
    pub(super) ignored: BTreeMap<MarbleId, Vec<ColliderId>>,
    /// Rows of these pairs.
    pub(super) ignored_rows: Uncompared<IgnoredPairs>,
}

pub(super) const POSITION: [&str; 3] = ["position.x", "position.y", "position.z"];
pub(super) const ANGULAR_VELOCITY: [&str; 3] =
    ["angular_velocity.x", "angular_velocity.y", "angular_velocity.z"];
pub(super) const VELOCITY: [&str; 3] = ["velocity.x", "velocity.y", "velocity.z"];

impl<S: Scalar> Marbles<S> {
    /// Adds a marble.
    ///
    /// # Errors
    /// [`Error::NotFinite`], [`Error::NotPositive`], [`Error::NotUnit`] or [`Error::OutOfRange`]
    /// for its fields, also if size and density together make a mass that the scalar cannot
    /// represent; [`Error::Full`] at 2³² − 1 marbles.
    pub fn insert(&mut self, marble: Marble<S>) -> Result<MarbleId, Error> {
        let position = finite_point(POSITION, marble.position)?;
        let radius = positive("radius", marble.radius)?;
        let half_length = validated_half_length(marble.half_length)?;
        let velocity = finite_vector(VELOCITY, marble.velocity)?;
        let rotation = validated_rotation(marble.rotation)?;
        let angular_velocity = finite_vector(ANGULAR_VELOCITY, marble.angular_velocity)?;
        let mass = marble.mass.validated()?;
        mass.of_size(radius, marble.half_length)?;
        let gravity_scale = finite("gravity_scale", marble.gravity_scale)?;
        let damping = marble.damping.validated()?;
        let material = marble.material.map(Material::validated).transpose()?;
        let handle = self.handles.push()?;
        if half_length.is_some() {
            self.enable_rotation(true); // which way it points counts in any model
        }
        self.position.push(position);
        self.radius.push(radius);
        self.velocity.push(velocity);
        if self.has_rotation {
            self.rotation.push(rotation);
            let turns = marble.rotation_model != Some(Rotation::None);
            self.angular_velocity.push(if turns { angular_velocity } else { Vec3::zero() });
        }
        if self.compensated {
            self.compensation.push(Compensation::default());
        }
        let own = OwnValues {
            half_length,
            mass: non_default(mass, Mass::default()),
            gravity_scale: non_default(gravity_scale, S::one()),
            damping: non_default(damping, Damping::default()),
            force: None,
            torque: None,
            integrator: marble.integrator,
            rotation_model: marble.rotation_model,
            material,
            locked_axes: non_default(marble.locked_axes, LockedAxes::NONE),
            layers: non_default(marble.layers, CollisionLayers::ALL),
            sleeping_disabled: marble.sleeping_disabled.then_some(()),
        };
        self.own.push(own, self.position.len());
        self.sleep.push();
        Ok(MarbleId(handle))
    }

    /// Removes a marble and returns it.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn remove(&mut self, id: MarbleId) -> Result<Marble<S>, Error> {
        let marble = self.get(id)?;
        if let Some(row) = self.handles.swap_remove(id.0) {
            // All fields by name, so that none is forgotten.
            let Self {
                handles: _,
                has_rotation: _,
                compensated: _,
                period: _,
                changed: _,
                position,
                radius,
                velocity,
                rotation,
                angular_velocity,
                compensation,
                own,
                sleep,
                ignored,
                ignored_rows: _,
            } = self;
            position.swap_remove(row);
            radius.swap_remove(row);
            velocity.swap_remove(row);
            swap_remove_if_any(rotation, row);
            swap_remove_if_any(angular_velocity, row);
            swap_remove_if_any(compensation, row);
            own.swap_remove(row);
            sleep.swap_remove(row, marble.radius + marble.half_length);
            ignored.remove(&id);
        }
        Ok(marble)
    }

    /// Current state of a marble.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn get(&self, id: MarbleId) -> Result<Marble<S>, Error> {
        let row = self.row(id)?;
        Ok(Marble {
            position: self.position[row],
            radius: self.radius[row],
            half_length: self.half_length(row),
            velocity: self.velocity[row],
            rotation: self.rotation.get(row).copied().unwrap_or_else(Quat::one),
            angular_velocity: self.angular_velocity.get(row).copied().unwrap_or_else(Vec3::zero),
            mass: self.own.mass.get(row).unwrap_or_default(),
            gravity_scale: self.own.gravity_scale.get(row).unwrap_or(S::one()),
            damping: self.own.damping.get(row).unwrap_or_default(),
            integrator: self.own.integrator.get(row),
            rotation_model: self.own.rotation_model.get(row),
            material: self.own.material.get(row),
            locked_axes: self.locked_axes_of_row(row),
            layers: self.layers_of_row(row),
            sleeping_disabled: self.own.sleeping_disabled.get(row).is_some(),
        })
    }

    /// Current state of a marble in `f64`, including the compensation of
    /// [`Precision::Compensated`].
    ///
    /// [`Precision::Compensated`]: super::Precision::Compensated
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn get_high_precision(&self, id: MarbleId) -> Result<Marble<f64>, Error> {
        let (row, marble) = (self.row(id)?, self.get(id)?);
        let Motion { position, velocity } = self.motion_f64(row);
        let rotation = marble.rotation;
        Ok(Marble {
            position,
            velocity,
            angular_velocity: self.angular_velocity_f64(row),
            radius: marble.radius.as_f64(),
            half_length: marble.half_length.as_f64(),
            mass: marble.mass.cast(),
            gravity_scale: marble.gravity_scale.as_f64(),
            damping: marble.damping.cast(),
            rotation: Quat::from_sv(rotation.s.as_f64(), cast_vector(rotation.v)),
            integrator: marble.integrator,
            rotation_model: marble.rotation_model,
            material: marble.material.map(Material::cast),
            locked_axes: marble.locked_axes,
            layers: marble.layers,
            sleeping_disabled: marble.sleeping_disabled,
        })
    }

    /// Material of the contact of two marbles.
    #[inline]
    pub(super) fn contact_material(&self, a: usize, b: usize) -> ContactMaterial<S> {
        match [a, b].map(|row| self.own.material.get(row)) {
            [None, None] => ContactMaterial::default(),
            of => {
                let [a, b] = of.map(Option::unwrap_or_default);
                b.combined_with(a)
            }
        }
    }

    /// Layers of a marble.
    #[inline]
    pub(super) fn layers_of_row(&self, row: usize) -> CollisionLayers {
        self.own.layers.get(row).unwrap_or_default()
    }

    /// Returns true if any marble has applied forces, torques or damping.
    pub(super) fn has_external_forces(&self) -> bool {
        !(self.own.force.is_empty() && self.own.torque.is_empty() && self.own.damping.is_empty())
    }

    /// Centers by index, in metres.
    #[must_use]
    pub fn position(&self) -> &[Point3<S>] {
        &self.position
    }

    /// Radii by index, in metres.
    #[must_use]
    pub fn radius(&self) -> &[S] {
        &self.radius
    }

    /// Velocities by index, in m/s.
    #[must_use]
    pub fn velocity(&self) -> &[Vec3<S>] {
        &self.velocity
    }

    /// Rotations by index; empty in a model without rotation.
    #[must_use]
    pub fn rotation(&self) -> &[Quat<S>] {
        &self.rotation
    }

    /// Angular velocities by index, in rad/s; empty in a model without rotation.
    #[must_use]
    pub fn angular_velocity(&self) -> &[Vec3<S>] {
        &self.angular_velocity
    }

    /// Index of a marble, valid until the next removal.
    ///
    /// # Errors
    /// [`Error::NoSuchMarble`].
    pub fn row(&self, id: MarbleId) -> Result<usize, Error> {
        self.handles.row(id.0).ok_or(Error::NoSuchMarble(id))
    }

    /// Handle of the marble at an index.
    #[must_use]
    pub fn id(&self, row: usize) -> Option<MarbleId> {
        self.handles.handle(row).map(MarbleId)
    }

    /// Number of removals so far.
    pub(super) fn removals(&self) -> u64 {
        self.handles.removals()
    }

    /// The number of marbles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// Returns true without any marble.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }

    /// Adds a displacement, a velocity change, and a change of radius times angular velocity to a
    /// marble, where it exists and the result is finite.
    pub(super) fn apply_delta(
        &mut self,
        id: MarbleId,
        way: Vec3<S>,
        faster: Vec3<S>,
        rim: Vec3<S>,
    ) {
        let Ok(row) = self.row(id) else { return };
        let locks = self.locked_axes_of_row(row);
        let [way, faster] = [way, faster].map(|change| locks.free_translation(change));
        let rim = locks.free_rotation(rim);
        if [way, faster, rim] != [Vec3::zero(); 3] {
            self.disturb(row);
        }
        let (position, velocity) = (self.position[row] + way, self.velocity[row] + faster);
        if is_finite_point(position) && is_finite(velocity) {
            (self.position[row], self.velocity[row]) = (position, velocity);
        }
        let turned = rim / self.radius[row];
        if let Some(angular_velocity) = self.angular_velocity.get_mut(row)
            && is_finite(*angular_velocity + turned)
        {
            *angular_velocity += turned;
        }
    }

    /// Columns for a response, with own integrators.
    pub(super) fn columns<'a>(
        &'a mut self,
        inverse_mass: &'a [S],
        held: &'a [bool],
        locked_axes: &'a [LockedAxes],
        rods: &'a [CapsuleInertia<S>],
    ) -> (SolverBodies<'a, S>, &'a SparseColumn<Integrator>) {
        let columns = SolverBodies {
            period: self.period,
            position: &mut self.position,
            velocity: &mut self.velocity,
            radius: &self.radius,
            inverse_mass,
            spin: &mut self.angular_velocity,
            rotation_locked: held,
            locked_axes,
            capsules: rods,
        };
        (columns, &self.own.integrator)
    }

    /// Returns true if gravity does not accelerate all alike, or other forces act.
    pub(super) fn accelerate_differently(&self) -> bool {
        self.has_external_forces()
            || !self.own.gravity_scale.is_empty()
            || !self.own.locked_axes.is_empty()
            || self.own.mass.values().any(|mass| mass == Mass::Infinite)
    }

    /// Columns that a solver of rows writes.
    pub(super) fn body_columns(&mut self, turns: bool) -> BodyColumns<'_, S> {
        let (angular_velocity, rotation) = if turns {
            (&mut self.angular_velocity[..], &mut self.rotation[..])
        } else {
            (&mut [][..], &mut [][..])
        };
        BodyColumns {
            position: &mut self.position,
            velocity: &mut self.velocity,
            angular_velocity,
            rotation,
            radius: &self.radius,
        }
    }

    /// Lists a row as set by others than the solver.
    pub(super) fn mark_changed(&mut self, row: usize) {
        self.changed.add(row, self.position.len());
        self.disturb(row);
    }

    /// Ends the rest of a marble.
    pub(super) fn disturb(&mut self, row: usize) {
        self.sleep.disturb(row, self.reach_of_row(row));
    }

    /// Radius of a ball, or of the sphere around a capsule, in metres.
    pub(super) fn reach_of_row(&self, row: usize) -> S {
        self.radius[row] + self.half_length(row)
    }

    /// Returns true if a torque is applied to a marble.
    pub(super) fn is_twisted(&self, row: usize) -> bool {
        self.own.torque.get(row).is_some_and(|torque| !torque.dual().is_zero())
    }

    /// Returns true if a marble neither moves nor turns.
    pub(super) fn is_still(&self, row: usize) -> bool {
        self.velocity[row].is_zero() && self.angular_velocity.get(row).is_none_or(Vec3::is_zero)
    }

    /// Mass in kilograms; infinite for kinematic marbles.
    pub(super) fn mass(&self, row: usize) -> S {
        self.own_mass(row).of_capsule(self.radius[row], self.half_length(row))
    }

    pub(super) fn own_mass(&self, row: usize) -> Mass<S> {
        self.own.mass.get(row).unwrap_or_default()
    }

    /// Returns true if the state of a marble is finite.
    pub(super) fn is_finite_state(&self, row: usize) -> bool {
        let turns = |angular_velocity: &Vec3<S>| is_finite(*angular_velocity);
        let turned = |q: &Quat<S>| q.s.is_finite() && is_finite(q.v);
        is_finite_point(self.position[row])
            && is_finite(self.velocity[row])
            && self.angular_velocity.get(row).is_none_or(turns)
            && self.rotation.get(row).is_none_or(turned)
    }

    /// Stops a marble that moves, and lists it as set.
    pub(super) fn stop(&mut self, row: usize) {
        self.mark_changed(row);
        self.clear_motion(row);
    }

    /// Clears velocity, angular velocity and their compensation.
    pub(super) fn clear_motion(&mut self, row: usize) {
        self.velocity[row] = Vec3::zero();
        if let Some(angular_velocity) = self.angular_velocity.get_mut(row) {
            *angular_velocity = Vec3::zero();
        }
        if let Some(low) = self.compensation.get_mut(row) {
            (low.velocity, low.angular_velocity) = (Vec3::zero(), Vec3::zero());
        }
    }
}

/// Removes a row of a column that may not exist; the last one takes its place.
fn swap_remove_if_any<T>(column: &mut Vec<T>, row: usize) {
    if !column.is_empty() {
        column.swap_remove(row);
    }
}
