//! Scratch memory of a step: lists kept for their capacity, what can be found again, and measurements
//! (residual, energy audit).

use super::contact_limit::ContactLimit;
use super::continuous::Continuous;
use super::energy_audit::AuditState;
use super::lasting_contacts::LastingContacts;
use super::narrow_phase::Candidate;
use super::quarantine::StoredPoses;
use super::sleep::SleepScratch;
use super::soft_step::SoftRows;
use super::solver_columns::SolverColumns;
use crate::broad::{Crowding, Grid, Images};
use crate::math::{Scalar, Vec3};
use crate::response::event::EventDriven;
use crate::response::{displacement, impulse, penalty};

/// Lists that the verbs of a step fill and read. All are equal, so that worlds can be compared.
#[derive(Clone, Debug)]
pub(super) struct Scratch<S> {
    pub grid: Grid,
    pub images: Images<S>,
    /// Rows that the current verb has stopped.
    pub stopped: Vec<u32>,
    pub stored_poses: StoredPoses<S>,
    /// Cells of marbles, to count those that share one.
    pub crowding: Crowding,
    pub contact_limit: ContactLimit<S>,
    /// Speculative margin: maximum separation of a contact, in metres. Gravity closes it within two
    /// substeps, for a response that looks ahead.
    pub reach: S,
    pub columns: SolverColumns<S>,
    pub displacement: displacement::Scratch<S>,
    pub impulse: impulse::Scratch<S>,
    pub penalty: penalty::Scratch<S>,
    /// Stop of each row at walls; empty if they stopped none.
    pub wall_stops: Vec<Option<penalty::WallStop<S>>>,
    /// Accelerations in m/s², for a response that integrates marbles by itself.
    pub accelerations: Vec<Vec3<f64>>,
    /// Time of the step that is left after the substep, in seconds; zero unless within one.
    pub rest_of_step: S,
    /// Length of the substep that was integrated, in seconds; zero if none was since contacts were solved.
    pub substep: S,
    pub events: EventDriven,
    pub soft_step: SoftRows<S>,
    pub continuous: Continuous<S>,
    pub lasting_contacts: LastingContacts,
    pub sleep: SleepScratch,
    pub near_walls: Vec<Candidate<S>>,
    /// Bounding radii of capsules, in metres.
    pub reaches: Vec<S>,
    pub audit_state: Option<Box<AuditState<S>>>,
}

impl<S: Scalar> Default for Scratch<S> {
    fn default() -> Self {
        Self {
            grid: Grid::default(),
            images: Images::default(),
            stopped: Vec::new(),
            stored_poses: StoredPoses::default(),
            crowding: Crowding::default(),
            contact_limit: ContactLimit::default(),
            reach: S::zero(),
            columns: SolverColumns::default(),
            displacement: displacement::Scratch::default(),
            impulse: impulse::Scratch::default(),
            penalty: penalty::Scratch::default(),
            wall_stops: Vec::new(),
            accelerations: Vec::new(),
            rest_of_step: S::zero(),
            substep: S::zero(),
            events: EventDriven::default(),
            soft_step: SoftRows::default(),
            continuous: Continuous::default(),
            lasting_contacts: LastingContacts::default(),
            sleep: SleepScratch::default(),
            near_walls: Vec::new(),
            reaches: Vec::new(),
            audit_state: None,
        }
    }
}

impl<S> PartialEq for Scratch<S> {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}
