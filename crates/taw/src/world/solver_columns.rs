//! Marbles as the solvers of listed contacts see them.

use super::World;
use super::continuous::Continuous;
use super::marbles::Marbles;
use super::model::Model;
use super::walls::Walls;
use crate::math::{Scalar, Vec3, length};
use crate::motion::{LockedAxes, Rotation};
use crate::response::impulse::{Context, SolverSettings, SubstepStart};
use crate::response::{CapsuleInertia, SolverBodies};

/// Columns that a solver reads besides those of the marbles.
#[derive(Clone, Debug, Default)]
pub(super) struct MarbleColumns<S> {
    /// Inverse masses, in 1/kg; empty for a method that ignores masses.
    inverse_mass: Vec<S>,
    /// Velocities before forces changed them in this substep, in m/s; empty for a method that does
    /// not use them.
    pub velocity_before: Vec<Vec3<S>>,
    /// Rows whose rotation is locked; empty if there are none.
    held: Vec<bool>,
    /// Locked axes of each row; empty if there are none.
    locked_axes: Vec<LockedAxes>,
    /// Axes and inertia of capsules; empty if there are none.
    capsules: Vec<CapsuleInertia<S>>,
}

impl<S: Scalar> MarbleColumns<S> {
    /// Brings masses, locks and capsules up to date with the marbles.
    pub fn read(&mut self, marbles: &mut Marbles<S>, model: Model) {
        self.inverse_mass.clear();
        if model.response.reads_inverse_masses() {
            let masses = (0..marbles.len()).map(|row| marbles.mass(row));
            self.inverse_mass.extend(masses.map(|mass| S::one() / mass));
        }
        self.held.clear();
        if model.rotation == Rotation::Dynamic && marbles.has_rotation_locks() {
            self.held.extend((0..marbles.len()).map(|row| marbles.is_rotation_locked(row)));
        }
        self.locked_axes.clear();
        if !marbles.own.locked_axes.is_empty() {
            let rows = 0..marbles.len();
            self.locked_axes.extend(rows.map(|row| marbles.locked_axes_of_row(row)));
        }
        marbles.rods(model.rotation, &mut self.capsules);
    }

    /// Bodies, and how far the position of each row follows a change of velocity.
    pub fn bodies<'a>(
        &'a self,
        marbles: &'a mut Marbles<S>,
        model: Model,
    ) -> (SolverBodies<'a, S>, impl Fn(usize) -> S + use<'a, S>) {
        let (mut bodies, integrator) =
            marbles.columns(&self.inverse_mass, &self.held, &self.locked_axes, &self.capsules);
        if model.rotation != Rotation::Dynamic {
            bodies.spin = &mut []; // cosmetic rotation does not affect contacts
        }
        let position_weight =
            move |row| integrator.get(row).unwrap_or(model.integrator).position_weight();
        (bodies, position_weight)
    }

    /// Bodies, and what else a solver of contacts reads.
    pub fn constrained<'a>(
        &'a self,
        marbles: &'a mut Marbles<S>,
        walls: &'a Walls<S>,
        continuous: &'a Continuous<S>,
        model: Model,
        settings: &'a SolverSettings<S>,
    ) -> (SolverBodies<'a, S>, Context<'a, S, Walls<S>, impl Fn(usize) -> S + use<'a, S>>) {
        let (bodies, position_weight) = self.bodies(marbles, model);
        let start = SubstepStart {
            position: &[],
            velocity: &self.velocity_before,
            ccd_stops: &continuous.projections,
        };
        (bodies, Context { walls, position_weight, start, settings })
    }
}

impl<S: Scalar> World<S> {
    /// Settings of the solver of listed contacts.
    pub(super) fn solver_settings(&self, dt: S) -> SolverSettings<S> {
        let restitution_threshold = length(self.settings.gravity) * dt * S::from_f64(2.0);
        SolverSettings {
            iterations: self.settings.model.iterations,
            dt,
            restitution_threshold,
            tolerance: restitution_threshold * S::epsilon(),
            slop: length(self.settings.gravity) * dt * dt,
            max_relative_slop: S::from_f64(0.001),
            max_relative_push: S::from_f64(0.5),
            gravity: self.settings.gravity,
            threads: self.swarm.model().all_threads(),
            resolve_jams: true,
        }
    }
}
