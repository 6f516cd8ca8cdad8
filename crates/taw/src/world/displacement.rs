//! [`Response::Displacement`](crate::response::Response) in a world.

use cgmath::InnerSpace;

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
        world.note_positions();
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
            |row, change, surface_speed| {
                pushes.iter_mut().for_each(|pushes| pushes.push((row, change, surface_speed)));
            },
        );
        drop(context);
        if let Some(audit_state) = &mut scratch.audit_state {
            audit_state.work.collisions = world.contacts.len() as u32;
            for (row, change, surface_speed) in pushes.into_iter().flatten() {
                let mass = world.marbles.mass(row as usize).as_f64();
                let impulse = cast_vector::<S, f64>(change) * mass;
                audit_state.work.momentum += impulse;
                audit_state.work.walls += impulse.magnitude() * surface_speed.as_f64();
            }
        }
    }
}
