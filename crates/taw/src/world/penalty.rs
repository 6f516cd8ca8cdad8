//! [`Response::Penalty`](crate::response::Response) in a world.

use super::World;
use super::method::Method;
use crate::math::Scalar;
use crate::response::ContactLaw;
use crate::response::penalty::PenaltySettings;

/// Forces that grow with penetration.
pub(super) struct Penalty(pub ContactLaw);

impl<S: Scalar> Method<S> for Penalty {
    fn advance(&self, world: &mut World<S>, dt: S) {
        world.move_marbles(dt);
    }

    fn contact_distance(&self, _: &World<S>, _: S) -> S {
        S::zero()
    }

    fn solve(&self, world: &mut World<S>, dt: S) {
        world.begin_bounces();
        let (settings, model, scratch) =
            (world.solver_settings(dt), world.settings.model, &mut world.scratch);
        scratch.continuous.list_wall_stops(&mut scratch.wall_stops);
        let (mut bodies, context) = scratch.columns.constrained(
            &mut world.marbles,
            &world.walls,
            &scratch.continuous,
            model,
            &settings,
        );
        let settings = PenaltySettings { law: self.0, context, wall_stops: &scratch.wall_stops };
        settings.apply(
            &mut bodies,
            &mut world.contacts,
            &mut world.memory.springs,
            &mut scratch.penalty,
            &mut scratch.stopped,
            scratch.audit_state.as_mut().map(|audit_state| &mut audit_state.work),
        );
    }
}
