//! Divergence: iterations that end worse than they began.
//!
//! Where a marble that weighs a billion times as much pinches another one, what stops it is an impulse a
//! billion times the momentum of the light one. A search that lowers the error of the heavy one throws the
//! light one about; and of forces that should cancel, a warm start at turned normals, or rounding, leaves
//! some. The energy of the island tells nothing of it: next to that of the heavy one it is nothing.

use cgmath::Zero;

use super::islands::{Island, Islands};
use super::rows::Rows;
use super::solve::iterate;
use super::{Constraint, SolverSettings};
use crate::constraint::ContactImpulse;
use crate::math::{Scalar, Vec3};
use crate::response::SolverBodies;

impl<S: Scalar> Island<S> {
    /// Tells if the last iteration changed a velocity by more than any contact asks for: restitution at
    /// most doubles an approach.
    fn is_diverging(&self) -> bool {
        !self.converged && self.residual > self.load.relative_speed * S::from_f64(2.0)
    }
}

impl<S: Scalar> SolverBodies<'_, S> {
    /// Saves velocities and spins before contacts act.
    pub(super) fn save_motion(&self, [velocity, spin]: [&mut Vec<Vec3<S>>; 2]) {
        velocity.clear();
        velocity.extend_from_slice(self.velocity);
        spin.clear();
        spin.extend_from_slice(self.spin);
    }

    /// Solves diverged islands again, from the saved motion and without impulses, by plain passes: one
    /// gives a marble no more than a collision with each of its neighbours.
    pub(super) fn solve_diverged(
        &mut self,
        constraints: &mut [Constraint<S>],
        islands: &mut Islands<S>,
        [velocity, spin]: [&[Vec3<S>]; 2],
        rows: &mut Rows<S>,
        settings: &SolverSettings<S>,
    ) {
        if !islands.list.iter().any(Island::is_diverging) {
            return;
        }
        let diverged: Vec<_> = islands.list.iter().map(Island::is_diverging).collect();
        for (island, diverged) in islands.list.iter_mut().zip(&diverged) {
            island.diverged = *diverged;
        }
        for c in constraints.iter_mut().filter(|c| diverged[c.island as usize]) {
            c.impulse = ContactImpulse::zero();
            if let Some(rolling) = &mut c.rolling {
                rolling.angular_impulse = Vec3::zero();
            }
            for row in [Some(c.b), c.a.marble()].into_iter().flatten() {
                self.velocity[row] = velocity[row];
                if let Some(before) = spin.get(row) {
                    self.spin[row] = *before;
                }
            }
        }
        islands.restart(|island| diverged[island]);
        iterate(self, constraints, islands, rows, settings);
    }
}
