//! Outline of a step's three verbs, which all methods follow, each in a file of its own.

use super::World;
use super::displacement::Displacement;
use super::event_driven::EventDriven;
use super::impulse::Impulse;
use super::penalty::Penalty;
use super::soft_step::SoftStep;
use crate::Error;
use crate::math::Scalar;
use crate::response::{ContactLaw, Response};

/// Method of a response.
pub(super) trait Method<S: Scalar> {
    /// Moves marbles freely over `dt` seconds, from velocities and forces.
    fn advance(&self, world: &mut World<S>, dt: S);

    /// Speculative margin of contacts after `dt` seconds, in metres. Gravity closes it within two
    /// substeps, and a marble that one contact moves may be moved into another one.
    fn contact_distance(&self, world: &World<S>, dt: S) -> S {
        world.resting_approach(dt)
    }

    /// Solves the listed contacts of a substep of `dt` seconds.
    fn solve(&self, world: &mut World<S>, dt: S);

    /// First verb.
    fn integrate(&self, world: &mut World<S>, dt: S) -> Result<(), Error> {
        world.integrate_marbles(self, dt);
        Ok(())
    }

    /// Second verb.
    fn generate_contacts(&self, world: &mut World<S>) {
        world.list_contacts();
    }

    /// Third verb.
    fn restitute(&self, world: &mut World<S>, dt: S) -> Result<(), Error> {
        world.solve_listed_contacts(self, dt);
        Ok(())
    }

    /// True if walls are moved to the end of each substep, false if the method moves them itself.
    fn interpolates_walls(&self) -> bool {
        true
    }

    /// Who sleeps with whom in columns of the world: none of the three verbs changes sleepers.
    fn sleep_unit(&self) -> SleepUnit {
        SleepUnit::Island
    }
}

/// Those that fall asleep and wake as one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SleepUnit {
    /// No marble sleeps in columns of the world.
    None,
    /// Marbles that touch, those that these touch, and so on.
    Island,
    /// All marbles: one that moves may meet any other one within the third verb.
    World,
}

/// Method of a response.
pub(super) fn method_of<S: Scalar>(response: Response) -> &'static dyn Method<S> {
    match response {
        Response::Displacement => &Displacement,
        Response::Impulse => &Impulse,
        Response::SoftStep => &SoftStep,
        Response::Penalty(ContactLaw::SpringDashpot) => &Penalty(ContactLaw::SpringDashpot),
        Response::Penalty(ContactLaw::HertzMindlin) => &Penalty(ContactLaw::HertzMindlin),
        Response::EventDriven => &EventDriven,
    }
}
