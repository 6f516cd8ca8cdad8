//! Scratch memory of a step: lists kept for their capacity, what can be found again, and measurements
//! (residual, energy audit).

use super::bodies::BodyScratch;
use super::contact_limit::ContactLimit;
use super::continuous::Continuous;
use super::energy_audit::AuditState;
use super::lasting_contacts::LastingContacts;
use super::narrow_phase::Candidate;
use super::quarantine::StoredPoses;
use super::sleep::SleepScratch;
use super::soft_step::SoftRows;
use super::solver_columns::MarbleColumns;
use crate::broad::{Crowding, Grid, Images};
use crate::math::Vec3;
use crate::response::displacement::DisplacementScratch;
use crate::response::event::EventSolver;
use crate::response::impulse::ImpulseScratch;
use crate::response::penalty::{PenaltyScratch, WallStop};

/// Lists that the verbs of a step fill and read. All are equal, so that worlds can be compared.
#[derive(Clone, Debug, Default)]
pub(super) struct WorldScratch<S> {
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
    pub columns: MarbleColumns<S>,
    pub displacement: DisplacementScratch<S>,
    pub impulse: ImpulseScratch<S>,
    pub penalty: PenaltyScratch<S>,
    /// Stop of each row at walls; empty if they stopped none.
    pub wall_stops: Vec<Option<WallStop<S>>>,
    /// Accelerations in m/s², for a response that integrates marbles by itself.
    pub accelerations: Vec<Vec3<f64>>,
    /// Time of the step that is left after the substep, in seconds; zero unless within one.
    pub rest_of_step: S,
    /// Length of the substep that was integrated, in seconds; zero if none was since contacts were solved.
    pub substep: S,
    pub events: EventSolver,
    pub soft_step: SoftRows<S>,
    pub bodies: BodyScratch<S>,
    pub continuous: Continuous<S>,
    pub lasting_contacts: LastingContacts,
    pub sleep: SleepScratch,
    pub near_walls: Vec<Candidate<S>>,
    /// Bounding radii of capsules, in metres.
    pub reaches: Vec<S>,
    pub audit_state: Option<Box<AuditState<S>>>,
}

impl<S> PartialEq for WorldScratch<S> {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}
