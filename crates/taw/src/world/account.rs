//! What a step took and brought in, for those who ask.

use cgmath::{InnerSpace, Zero};

use super::World;
use crate::math::{Scalar, Vec3, length};
use crate::response::{EnergyLedger, Response};

/// Where the energy of a step went. Joules; what was *taken* is gone, and negative where it was
/// given.
///
/// The energy ([`World::energy`]) after the step is that before it, and `forces` and `walls`, less
/// what friction, restitution, resistance and the solver took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Account {
    /// What force fields, pushes and damping brought in; zero where only gravity acts.
    pub forces: f64,
    /// What moving walls and marbles of infinite mass brought in.
    pub walls: f64,
    /// What sliding took.
    pub friction: f64,
    /// What collisions took along their normals. For [`Response::Penalty`], also what springs
    /// took and will give back.
    ///
    /// [`Response::Penalty`]: crate::response::Response::Penalty
    pub restitution: f64,
    /// What rolling and spinning resistance took.
    pub resistance: f64,
    /// All the rest: what the method took that no law of physics asked for. The error of the
    /// integrator, what pushing apart lifted, all that [`Response::Displacement`] does; for
    /// [`Response::EventDriven`], also what was taken where marbles rest on each other.
    ///
    /// [`Response::Displacement`]: crate::response::Response::Displacement
    /// [`Response::EventDriven`]: crate::response::Response::EventDriven
    pub solver: f64,
    /// How far the momentum of all is from what walls and forces gave, in kg m/s: what pairs
    /// did not give back to each other.
    pub momentum: f64,
    /// How deep the deepest contact was when it was found, in metres.
    pub deepest: f64,
    /// How many collisions there were. For [`Response::Displacement`] and [`Response::Penalty`],
    /// which know no single ones: contacts, in all substeps.
    ///
    /// [`Response::Displacement`]: crate::response::Response::Displacement
    /// [`Response::Penalty`]: crate::response::Response::Penalty
    pub collisions: u32,
}

/// An account while it is kept.
#[derive(Clone, Debug)]
pub(super) struct Accounting<S> {
    account: Account,
    residual: Vec3<f64>,
    /// When the substep began: velocities and spins by row, and the energy.
    pub velocity: Vec<Vec3<S>>,
    pub spin: Vec<Vec3<S>>,
    energy: f64,
    /// When contacts have been found.
    potential: f64,
    moment: Vec3<f64>,
    pub work: EnergyLedger,
}

impl<S: Scalar> World<S> {
    /// Keeps an [account](Self::account) of every step from now on, or no longer. Off at first,
    /// when it costs nothing.
    pub fn keep_account(&mut self, keep: bool) {
        if keep != self.accounting.is_some() {
            self.accounting = keep.then(|| {
                Box::new(Accounting {
                    account: Account::default(),
                    residual: Vec3::zero(),
                    velocity: Vec::new(),
                    spin: Vec::new(),
                    energy: 0.0,
                    potential: 0.0,
                    moment: Vec3::zero(),
                    work: EnergyLedger::default(),
                })
            });
        }
    }

    /// Where the energy of the last step went, if that is [kept](Self::keep_account). Counts
    /// marbles, not swarms.
    #[must_use]
    pub fn account(&self) -> Option<Account> {
        self.accounting.as_ref().map(|accounting| accounting.account)
    }

    /// A step begins.
    pub(super) fn open_account(&mut self) {
        if let Some(accounting) = &mut self.accounting {
            accounting.account = Account::default();
            accounting.residual = Vec3::zero();
        }
    }

    /// The first verb begins.
    pub(super) fn count_before(&mut self) {
        let Some(mut accounting) = self.accounting.take() else { return };
        accounting.energy = self.energy().total();
        accounting.velocity.clear();
        accounting.velocity.extend_from_slice(self.marbles.velocity());
        accounting.spin.clear();
        accounting.spin.extend_from_slice(self.marbles.spin());
        self.accounting = Some(accounting);
    }

    /// Whether anything but gravity acts.
    fn has_forces(&self) -> bool {
        !self.forces.is_empty() || self.marbles.are_pushed()
    }

    /// The first verb is done.
    pub(super) fn count_forces(&mut self) {
        if self.accounting.is_none() || !self.has_forces() {
            return;
        }
        let energy = self.energy().total();
        if let Some(accounting) = &mut self.accounting {
            accounting.account.forces += energy - accounting.energy;
            accounting.energy = energy;
        }
    }

    /// The third verb begins.
    pub(super) fn count_contacts(&mut self) {
        let Some(mut accounting) = self.accounting.take() else { return };
        let contacts = self.contacts.wm.iter().chain(&self.contacts.mm);
        let deepest = contacts.map(|contact| length(contact.mtv).as_f64()).fold(0.0, f64::max);
        accounting.account.deepest = accounting.account.deepest.max(deepest);
        accounting.potential = self.energy().potential;
        accounting.moment = self.momentum();
        accounting.work = EnergyLedger::default();
        self.accounting = Some(accounting);
    }

    /// The third verb is done.
    pub(super) fn count_after(&mut self) {
        let Some(mut accounting) = self.accounting.take() else { return };
        let Accounting { account, residual, energy, potential, moment, work, .. } =
            &mut *accounting;
        let now = self.energy();
        // What they did besides what gravity did, for a response that moves marbles by itself.
        let moves = self.model.response == Response::EventDriven && self.has_forces();
        let forces = if moves { work.forces - (*potential - now.potential) } else { 0.0 };
        let expected =
            *energy + forces + work.walls - work.friction - work.restitution - work.resistance;
        account.forces += forces;
        account.walls += work.walls;
        account.friction += work.friction;
        account.restitution += work.restitution;
        account.resistance += work.resistance;
        account.solver += expected - now.total();
        account.collisions += work.collisions;
        *residual += self.momentum() - *moment - work.momentum;
        account.momentum = residual.magnitude();
        self.accounting = Some(accounting);
    }
}
