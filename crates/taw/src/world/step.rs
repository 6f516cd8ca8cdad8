//! The step: its three verbs, each by the model's response.

use super::World;
use super::energy_audit::AuditState;
use super::integrate::StepContext;
use super::walls::SubShape;
use crate::Error;
use crate::math::{Scalar, cast_vector, length};
use crate::motion::Rotation;
use crate::response::displacement::solve_displacement;
use crate::response::impulse::{Context, SolverSettings, SubstepStart, solve_contacts};
use crate::response::penalty::{PenaltySettings, apply_penalty_forces};
use crate::response::{ContactLaw, Response};

impl<S: Scalar> World<S> {
    /// Moves the world on by `dt` seconds, in [`Model::substeps`](super::Model::substeps) equal
    /// parts.
    ///
    /// A marble whose motion overflows keeps its last place, loses its velocity and its spin,
    /// and is named by [`World::stopped`]; no marble that does not touch it is affected.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for `dt`; [`Error::OutOfRange`] if it, or a substep of it, is not in
    /// [`World::TIMES`]; [`Error::UnsupportedShape`] for a capsule in a world that is event-driven,
    /// periodic, or steps by `SoftStep`; [`Error::OutOfRange`] for a marble too large for its
    /// [period](Self::set_period). Then nothing has changed.
    pub fn step(&mut self, dt: S) -> Result<(), Error> {
        let substep = self.validated_substep(dt)?;
        self.begin_step();
        for after in (0..self.settings.model.passes()).rev() {
            self.begin_substep(substep * S::from_f64(f64::from(after)));
            self.integrate(substep)?;
            self.generate_contacts();
            self.restitute(substep)?;
        }
        self.end_step();
        self.step_swarm(dt, &mut |_| ())
    }

    /// The first verb: forces change velocities, velocities change positions, over
    /// `dt` seconds. For [`Response::EventDriven`], forces become accelerations only: what
    /// moves when is decided by the third verb.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for `dt`, [`Error::OutOfRange`] if it is not in [`World::TIMES`],
    /// and what [`World::step`] says of marbles; then nothing has moved.
    pub fn integrate(&mut self, dt: S) -> Result<(), Error> {
        let dt = Self::validated_dt(dt)?;
        self.check_shapes()?;
        self.audit_before();
        if self.settings.model.response == Response::SoftStep {
            return self.integrate_forces(dt);
        }
        self.store_poses();
        self.begin_continuous();
        let drive = StepContext {
            integrator: self.settings.model.integrator,
            gravity: self.settings.gravity,
            forces: &self.settings.forces,
            dt,
        };
        if self.settings.model.rotation == Rotation::Dynamic {
            self.marbles.integrate_angular_velocity(dt);
        }
        if self.settings.model.response == Response::EventDriven {
            self.marbles.mean_accelerations(drive, &mut self.scratch.accelerations);
        } else {
            self.scratch.velocity_before.clear();
            if self.settings.model.response == Response::Impulse {
                self.scratch.velocity_before.extend_from_slice(self.marbles.velocity());
            }
            self.marbles.integrate(drive, &mut self.scratch.stopped);
            self.solve_continuous(dt);
        }
        if !(self.settings.model.response == Response::EventDriven
            && self.settings.model.rotation == Rotation::Dynamic)
        {
            self.marbles.integrate_rotations(dt, self.settings.model.rotation);
        }
        self.quarantine_non_finite();
        self.scratch.reach = match self.settings.model.response {
            // Rounding must not end the touch of what falls together.
            Response::Displacement => length(self.settings.gravity) * dt * dt * S::from_f64(1e-3),
            Response::Penalty(_) => S::zero(),
            Response::Impulse => length(self.settings.gravity) * dt * dt * S::from_f64(2.0),
            Response::EventDriven | Response::SoftStep => self.resting_contact_distance(dt),
        };
        self.audit_forces();
        Ok(())
    }

    /// The second verb: finds who touches whom, and by how much.
    ///
    /// For [`Response::Impulse`], that is also who is so near that gravity closes the
    /// gap within two substeps; the displacement of these is zero. For
    /// [`Response::EventDriven`] it is who may rest on each other at the start; who comes
    /// together later is found later.
    pub fn generate_contacts(&mut self) {
        self.contacts.clear();
        if self.settings.model.response == Response::SoftStep {
            return self.find_soft_contacts();
        }
        self.collide_walls(self.scratch.reach);
        self.collide_marbles(self.scratch.reach);
        self.add_grazing_contacts();
        self.drop_separated_stops();
    }

    /// The third verb: contacts change positions and velocities back to what the
    /// scene allows. `dt` is the time that was integrated, in seconds.
    ///
    /// # Errors
    /// [`Error::NotPositive`] for `dt`, [`Error::OutOfRange`] if it is not in [`World::TIMES`].
    pub fn restitute(&mut self, dt: S) -> Result<(), Error> {
        let dt = Self::validated_dt(dt)?;
        if self.settings.model.response == Response::SoftStep {
            return self.solve_soft_contacts(dt);
        }
        self.walls.update_tree(); // some may have been taken out since contacts were looked for
        let (walls, marbles) = (self.walls.len() as u32, self.marbles.len() as u32);
        self.contacts.wm.retain(|c| c.a < walls && c.b < marbles);
        self.contacts.mm.retain(|c| c.a < marbles && c.b < marbles);
        self.release_separated_stops();
        if self.settings.model.response != Response::EventDriven {
            self.scratch.continuous.begin_bounces(&self.marbles.position);
        }
        self.contacts.sort();
        self.audit_contacts();
        self.look_at_marbles();
        self.solve(dt);
        self.stop_bounces_at_walls();
        self.quarantine_non_finite();
        self.roll_what_only_shows();
        self.settings.limits.apply(&mut self.marbles);
        self.audit_after();
        self.marbles.wrap();
        Ok(())
    }

    /// Solves the contacts by the model's response.
    fn solve(&mut self, dt: S) {
        match self.settings.model.response {
            Response::Displacement | Response::Impulse => self.solve_listed_contacts(dt),
            Response::Penalty(law) => self.apply_penalty_forces(law, dt),
            Response::EventDriven => self.step_events(dt, self.scratch.rest_of_step),
            Response::SoftStep => {} // has verbs of its own
        }
    }

    /// Solves the listed contacts by impulses, or by displacements.
    fn solve_listed_contacts(&mut self, dt: S) {
        let settings = self.solver_settings(dt);
        let (mut columns, material, integrator) = self.marbles.columns(
            &self.scratch.inverse_mass,
            &self.scratch.held,
            &self.scratch.rods,
        );
        if self.settings.model.rotation != Rotation::Dynamic {
            columns.spin = &mut []; // cosmetic rotation does not affect contacts
        }
        let context = Context {
            walls: &self.walls,
            material: |row| material.get(row).unwrap_or_default(),
            position_weight: |row| {
                integrator.get(row).unwrap_or(self.settings.model.integrator).position_weight()
            },
            start: SubstepStart {
                position: &[],
                velocity: &self.scratch.velocity_before,
                ccd_stops: &self.scratch.continuous.projections,
            },
            settings: &settings,
        };
        let (contacts, impulses, stopped) =
            (&mut self.contacts, &mut self.memory.impulses, &mut self.scratch.stopped);
        if self.settings.model.response == Response::Impulse {
            solve_contacts(
                &mut columns,
                contacts,
                &context,
                &mut self.scratch.impulse,
                impulses,
                stopped,
            );
            if let Some(audit_state) = &mut self.scratch.audit_state {
                let AuditState { velocity, angular_velocity, work, .. } = &mut **audit_state;
                self.scratch.impulse.record_energy(&mut columns, velocity, angular_velocity, work);
            }
            return;
        }
        let count = contacts.len() as u32;
        let mut pushes = self.scratch.audit_state.as_ref().map(|_| Vec::new());
        let push = |row, change| pushes.iter_mut().for_each(|pushes| pushes.push((row, change)));
        let scratch = &mut self.scratch.displacement;
        solve_displacement(&mut columns, contacts, &context, scratch, impulses, stopped, push);
        if let Some(audit_state) = &mut self.scratch.audit_state {
            audit_state.work.collisions = count;
            for (row, change) in pushes.into_iter().flatten() {
                let mass = self.marbles.mass(row as usize).as_f64();
                audit_state.work.momentum += cast_vector::<S, f64>(change) * mass;
            }
        }
    }

    /// Settings of the solver of listed contacts.
    fn solver_settings(&self, dt: S) -> SolverSettings<S> {
        let restitution_threshold = length(self.settings.gravity) * dt * S::from_f64(2.0);
        SolverSettings {
            iterations: self.settings.model.iterations,
            dt,
            restitution_threshold,
            tolerance: restitution_threshold * S::epsilon(),
            slop: length(self.settings.gravity) * dt * dt,
            max_relative_slop: S::from_f64(0.001),
        }
    }

    /// Applies forces that grow with the overlap.
    fn apply_penalty_forces(&mut self, law: ContactLaw, dt: S) {
        let (mut columns, material, integrator) = self.marbles.columns(
            &self.scratch.inverse_mass,
            &self.scratch.held,
            &self.scratch.rods,
        );
        if self.settings.model.rotation != Rotation::Dynamic {
            columns.spin = &mut [];
        }
        let settings = PenaltySettings {
            law,
            dt,
            material: |row| material.get(row).unwrap_or_default(),
            position_weight: |row| {
                integrator.get(row).unwrap_or(self.settings.model.integrator).position_weight()
            },
        };
        apply_penalty_forces(
            &settings,
            &mut columns,
            &mut self.contacts,
            &self.walls,
            &mut self.memory.springs,
            &mut self.scratch.stopped,
            self.scratch.audit_state.as_mut().map(|audit_state| &mut audit_state.work),
        );
    }

    /// Makes marbles that turn for show only roll over the walls that they touch.
    pub(super) fn roll_what_only_shows(&mut self) {
        let all_dynamic =
            self.settings.model.rotation == Rotation::Dynamic && !self.marbles.has_rotation_locks();
        if self.settings.model.rotation == Rotation::None || all_dynamic {
            return;
        }
        // The deepest contact comes first in the list, so it has the last word.
        for contact in self.contacts.wm.iter().rev() {
            let part = SubShape { wall: contact.a, index: contact.part };
            let row = contact.b as usize;
            let normal = self.walls.project_point(part, self.marbles.position()[row]).normal;
            if self.marbles.rotation_of(row, self.settings.model.rotation) == Rotation::Rolling {
                self.marbles.roll_without_slip(row, normal);
            }
        }
    }

    /// Brings up to date what a response asks of marbles: masses, who is held, what is long;
    /// and what contacts remember of them.
    fn look_at_marbles(&mut self) {
        self.scratch.inverse_mass.clear();
        if matches!(self.settings.model.response, Response::Impulse | Response::Penalty(_)) {
            let masses = (0..self.marbles.len()).map(|row| self.marbles.mass(row));
            self.scratch.inverse_mass.extend(masses.map(|mass| S::one() / mass));
        }
        self.follow_contacts();
        self.scratch.held.clear();
        if self.settings.model.rotation == Rotation::Dynamic && self.marbles.has_rotation_locks() {
            self.scratch
                .held
                .extend((0..self.marbles.len()).map(|row| self.marbles.is_rotation_locked(row)));
        }
        self.marbles.rods(self.settings.model.rotation, &mut self.scratch.rods);
    }

    /// Forgets who was [stopped](World::stopped), and the [impacts](World::impacts). A
    /// step begins with this; whoever calls the verbs one by one begins so too.
    pub fn begin_step(&mut self) {
        self.scratch.rest_of_step = S::zero();
        self.scratch.stopped.clear();
        self.quarantined.clear();
        self.impacts.clear();
        self.reset_audit();
    }

    /// Begins a substep, after which `rest` seconds of the step are left: walls that were set
    /// elsewhere and have a motion are where that puts them by then. Whoever calls the verbs one by
    /// one in several substeps begins each so; without it, walls are at the end of their ways.
    pub fn begin_substep(&mut self, rest: S) {
        self.scratch.rest_of_step = if rest.is_finite() { rest.max(S::zero()) } else { S::zero() };
        if !matches!(self.settings.model.response, Response::EventDriven | Response::SoftStep) {
            self.walls.interpolate_to(self.scratch.rest_of_step);
        }
    }

    /// Ends a step: walls are at the end of their ways, and forces that were applied are forgotten.
    pub fn end_step(&mut self) {
        self.walls.finish_step();
        self.marbles.clear_forces();
    }
}
