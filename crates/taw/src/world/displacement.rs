//! [`Response::Displacement`](crate::response::Response) in a world.

use super::World;
use super::method::Method;
use crate::math::{Scalar, cast_vector};
use crate::response::displacement::solve_displacement;

/// Position projection, without masses.
pub(super) struct Displacement;

impl<S: Scalar> Method<S> for Displacement {
    fn advance(&self, world: &mut World<S>, dt: S) {
        world.move_marbles(dt);
    }

    fn solve(&self, world: &mut World<S>, dt: S) {
        world.store_positions_before_contacts();
        let (settings, model, scratch) =
            (world.solver_settings(dt), world.settings.model, &mut world.scratch);
        let (mut bodies, context) = scratch.columns.constrained(
            &mut world.marbles,
            &world.walls,
            &scratch.continuous,
            model,
            &settings,
        );
        let mut pushes = scratch.audit_state.as_ref().map(|_| Vec::new());
        solve_displacement(
            &mut bodies,
            &mut world.contacts,
            &context,
            &mut scratch.displacement,
            &mut world.memory.impulses,
            &mut scratch.stopped,
            |row, normal, speeds| {
                if let Some(pushes) = &mut pushes {
                    pushes.push((row, normal, speeds));
                }
            },
        );
        drop(context);
        if let Some(audit_state) = &mut scratch.audit_state {
            let contacts = world.contacts.wm.iter().chain(&world.contacts.mm);
            audit_state.work.collisions = contacts.filter(|c| c.is_touching()).count() as u32;
            for (row, normal, speeds) in pushes.into_iter().flatten() {
                let mass = world.marbles.mass(row as usize).as_f64();
                if mass.is_finite() {
                    let [change, surface_speed] = speeds.map(S::as_f64);
                    audit_state.work.momentum += cast_vector::<S, f64>(normal) * (mass * change);
                    audit_state.work.walls += mass * change * surface_speed;
                }
            }
        }
    }
}
