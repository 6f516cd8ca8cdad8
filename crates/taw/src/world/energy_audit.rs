//! Energy audit of a step: work of forces and walls, dissipation by mechanism, and the error of the
//! solver.

use cgmath::{InnerSpace, Zero};

use super::World;
use crate::handle::NO_ROW;
use crate::math::{Scalar, Vec3};
use crate::response::{EnergyLedger, Response};

/// Energy audit of a step, in joules. Dissipated energy counts positive.
///
/// The energy ([`World::energy`]) after the step is that before it, plus `forces` and `walls`,
/// minus the dissipation by friction, restitution, resistance and the solver.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnergyAudit {
    /// Work of force fields, applied forces and damping; zero where only gravity acts.
    pub forces: f64,
    /// Work of moving walls and marbles of infinite mass; for [`Response::SoftStep`], of walls only.
    ///
    /// [`Response::SoftStep`]: crate::response::Response::SoftStep
    pub walls: f64,
    /// Work of moving walls on the balls of the [swarm](World::swarm), which is in no other field; none in the
    /// lab's tier, which moves balls by positions.
    pub walls_on_swarm: f64,
    /// Dissipation by sliding friction.
    pub friction: f64,
    /// Dissipation by collisions along their normals. For [`Response::Penalty`], including energy
    /// stored in contact springs, which is returned later.
    ///
    /// [`Response::Penalty`]: crate::response::Response::Penalty
    pub restitution: f64,
    /// Dissipation by rolling and torsional resistance.
    pub resistance: f64,
    /// Numerical error: energy lost without a physical cause. The error of the integrator, the lift
    /// by position correction, everything that [`Response::Displacement`] does except the work of walls; for
    /// [`Response::EventDriven`], also the dissipation of resting contacts; for
    /// [`Response::SoftStep`], that of all contacts.
    ///
    /// [`Response::SoftStep`]: crate::response::Response::SoftStep
    /// [`Response::Displacement`]: crate::response::Response::Displacement
    /// [`Response::EventDriven`]: crate::response::Response::EventDriven
    pub solver: f64,
    /// Momentum error in kg m/s: change of the total momentum beyond the impulses of walls and
    /// forces, from pairs without equal and opposite impulses.
    pub momentum: f64,
    /// Largest penetration when contacts were found, in metres.
    pub max_penetration: f64,
    /// Number of collisions. For [`Response::Displacement`] and [`Response::Penalty`], which have
    /// no single collisions: number of contacts in all substeps.
    ///
    /// [`Response::Displacement`]: crate::response::Response::Displacement
    /// [`Response::Penalty`]: crate::response::Response::Penalty
    pub collisions: u32,
}

/// State of the energy audit.
#[derive(Clone, Debug)]
pub(super) struct AuditState<S> {
    audit: EnergyAudit,
    residual: Vec3<f64>,
    /// Velocities and angular velocities by index, and the energy, at the start of the substep.
    pub velocity: Vec<Vec3<S>>,
    pub angular_velocity: Vec<Vec3<S>>,
    energy: f64,
    /// Potential energy, that beyond a gravity scale of one, and momentum after contacts were generated.
    potential: f64,
    excess_potential: f64,
    moment: Vec3<f64>,
    pub work: EnergyLedger,
}

impl<S: Scalar> World<S> {
    /// Switches the [energy audit](Self::energy_audit) of every step on or off. Off by default, at
    /// no cost.
    pub fn enable_energy_audit(&mut self, keep: bool) {
        if keep != self.scratch.audit_state.is_some() {
            self.scratch.audit_state = keep.then(|| {
                Box::new(AuditState {
                    audit: EnergyAudit::default(),
                    residual: Vec3::zero(),
                    velocity: Vec::new(),
                    angular_velocity: Vec::new(),
                    energy: 0.0,
                    potential: 0.0,
                    excess_potential: 0.0,
                    moment: Vec3::zero(),
                    work: EnergyLedger::default(),
                })
            });
        }
    }

    /// Energy audit of the last step, if [enabled](Self::enable_energy_audit). Counts marbles, not
    /// swarms.
    #[must_use]
    pub fn energy_audit(&self) -> Option<EnergyAudit> {
        self.scratch.audit_state.as_ref().map(|audit_state| audit_state.audit)
    }

    /// Resets the audit at the start of a step.
    pub(super) fn reset_audit(&mut self) {
        if let Some(audit_state) = &mut self.scratch.audit_state {
            audit_state.audit = EnergyAudit::default();
            audit_state.residual = Vec3::zero();
        }
    }

    /// Records the state before integration.
    pub(super) fn audit_before(&mut self) {
        let Some(mut audit_state) = self.scratch.audit_state.take() else { return };
        audit_state.energy = self.energy().total();
        audit_state.velocity.clear();
        audit_state.velocity.extend_from_slice(self.marbles.velocity());
        audit_state.angular_velocity.clear();
        audit_state.angular_velocity.extend_from_slice(self.marbles.angular_velocity());
        self.scratch.audit_state = Some(audit_state);
    }

    /// Returns true if anything besides gravity acts.
    fn has_forces(&self) -> bool {
        !self.settings.forces.is_empty() || self.marbles.has_external_forces()
    }

    /// Records the work of forces after integration.
    pub(super) fn audit_forces(&mut self) {
        if self.scratch.audit_state.is_none() || !self.has_forces() {
            return;
        }
        let energy = self.energy().total();
        if let Some(audit_state) = &mut self.scratch.audit_state {
            audit_state.audit.forces += energy - audit_state.energy;
            audit_state.energy = energy;
        }
    }

    /// Records the state before the contacts are solved.
    pub(super) fn audit_contacts(&mut self) {
        let Some(mut audit_state) = self.scratch.audit_state.take() else { return };
        let contacts = self.contacts.wm.iter().chain(&self.contacts.mm);
        let max_penetration =
            contacts.map(|contact| contact.penetration().as_f64()).fold(0.0, f64::max);
        audit_state.audit.max_penetration = audit_state.audit.max_penetration.max(max_penetration);
        audit_state.potential = self.energy().potential;
        audit_state.excess_potential = self.excess_potential();
        audit_state.moment = self.momentum();
        audit_state.work = EnergyLedger::default();
        self.scratch.audit_state = Some(audit_state);
    }

    /// Records what walls and forces do to the rows of the swarm in the step that follows.
    pub(super) fn audit_rows_before(&mut self) {
        if self.scratch.audit_state.is_some() {
            self.swarm.record_outside_work();
        }
    }

    /// Adds up what walls and forces did to balls of the swarm and, if they are rows of it, to marbles.
    pub(super) fn audit_rows_after(&mut self) {
        let Some(audit_state) = &mut self.scratch.audit_state else { return };
        let soft = self.settings.model.response.uses_swarm_rows();
        let rows = if soft { &self.scratch.soft_step.marble_of_slot[..] } else { &[] };
        audit_state.work.collisions += if soft { self.impacts.len() as u32 } else { 0 };
        for (slot, work) in self.swarm.take_outside_work().into_iter().enumerate() {
            match rows.get(slot).filter(|row| **row != NO_ROW) {
                None => audit_state.audit.walls_on_swarm += work.walls,
                Some(row) if self.marbles.mass(*row as usize).is_finite() => {
                    audit_state.work.momentum += work.impulse;
                    audit_state.work.walls += work.walls;
                    audit_state.work.forces += work.forces;
                }
                Some(_) => {}
            }
        }
    }

    /// Completes the audit of a substep.
    pub(super) fn audit_after(&mut self) {
        let Some(mut audit_state) = self.scratch.audit_state.take() else { return };
        let AuditState {
            audit, residual, energy, potential, excess_potential, moment, work, ..
        } = &mut *audit_state;
        let now = self.energy();
        // Work of forces without that of gravity, for responses that move marbles themselves.
        let forces = match self.settings.model.response {
            Response::EventDriven if self.has_forces() => {
                work.forces - (*potential - now.potential)
            }
            Response::SoftStep => work.forces + self.excess_potential() - *excess_potential,
            _ => 0.0,
        };
        let expected =
            *energy + forces + work.walls - work.friction - work.restitution - work.resistance;
        audit.forces += forces;
        audit.walls += work.walls;
        audit.friction += work.friction;
        audit.restitution += work.restitution;
        audit.resistance += work.resistance;
        audit.solver += expected - now.total();
        audit.collisions += work.collisions;
        *residual += self.momentum() - *moment - work.momentum;
        audit.momentum = residual.magnitude();
        self.scratch.audit_state = Some(audit_state);
    }
}
