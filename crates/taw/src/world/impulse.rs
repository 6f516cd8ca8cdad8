//! [`Response::Impulse`](crate::response::Response) in a world.

use super::World;
use super::energy_audit::AuditState;
use super::method::Method;
use crate::math::Scalar;
use crate::response::impulse::solve_contacts;

/// Sequential impulses.
pub(super) struct Impulse;

impl<S: Scalar> Method<S> for Impulse {
    fn advance(&self, world: &mut World<S>, dt: S) {
        let before = &mut world.scratch.columns.velocity_before;
        before.clear();
        before.extend_from_slice(world.marbles.velocity());
        world.move_marbles(dt);
    }

    fn generate_contacts(&self, world: &mut World<S>) {
        world.list_contacts();
        world.add_lasting_contacts();
    }

    fn solve(&self, world: &mut World<S>, dt: S) {
        world.begin_bounces();
        world.forget_lasting_impulses();
        let (settings, model, scratch) =
            (world.solver_settings(dt), world.settings.model, &mut world.scratch);
        let (mut bodies, context) = scratch.columns.constrained(
            &mut world.marbles,
            &world.walls,
            &scratch.continuous,
            model,
            &settings,
        );
        solve_contacts(
            &mut bodies,
            &mut world.contacts,
            &context,
            &mut scratch.impulse,
            &mut world.memory.impulses,
            &mut scratch.stopped,
        );
        if let Some(audit_state) = &mut scratch.audit_state {
            let AuditState { velocity, angular_velocity, work, .. } = &mut **audit_state;
            scratch.impulse.record_energy(&mut bodies, velocity, angular_velocity, work);
        }
        drop((bodies, context));
        world.drop_lasting_contacts();
    }
}
