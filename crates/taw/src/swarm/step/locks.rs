//! Bodies with locked axes, within a step: whatever changes rows, they stay where they are along these.

use crate::math::{Row, Scalar, Vec3};
use crate::motion::LockedAxes;
use crate::swarm::Swarm;

/// Row of a body with locked axes.
#[derive(Clone, Copy, Debug)]
pub(in crate::swarm) struct HeldRow<S> {
    slot: u32,
    axes: LockedAxes,
    /// Center in metres, and radius, which it keeps along locked axes.
    at: Row<S>,
}

impl<S: Scalar> Swarm<S> {
    /// Saves where the bodies with locked axes are as a step begins, and stops them along these.
    pub(super) fn save_held_rows(&mut self) {
        let (rows, at) = (self.ids.rows(), &self.at);
        let held = self.surfaces.locked().map(|(slot, axes)| HeldRow {
            slot,
            axes,
            at: at[rows[slot as usize] as usize],
        });
        self.scratch.free_axes.clear();
        self.scratch.held_rows.clear();
        self.scratch.held_rows.extend(held);
        self.hold_rows();
    }

    /// Finds the free axes of all rows, if any has locked ones. Rows may have changed.
    pub(super) fn find_free_axes(&mut self) {
        if self.scratch.held_rows.is_empty() {
            return;
        }
        let (rows, free) = (self.ids.rows(), &mut self.scratch.free_axes);
        free.clear();
        free.resize(self.at.len(), [S::one(); 4]);
        for HeldRow { slot, axes, .. } in &self.scratch.held_rows {
            let [x, y, z]: [S; 3] = axes.free_translation(Vec3::from([S::one(); 3])).into();
            free[rows[*slot as usize] as usize] = [x, y, z, S::one()];
        }
    }

    /// Puts them back along their locked axes, and stops them along those: what a pass did about an axis
    /// of rotation, which only takes energy; what set positions did.
    pub(super) fn hold_rows(&mut self) {
        let rows = self.ids.rows();
        for HeldRow { slot, axes, at } in &self.scratch.held_rows {
            let row = rows[*slot as usize] as usize;
            if self.velocity[row][3].is_sign_negative() {
                continue; // nobody moves what sleeps
            }
            for axis in 0..3 {
                if axes.locks_translation(axis) {
                    self.at[row][axis] = at[axis];
                    self.velocity[row][axis] = S::zero();
                }
                if axes.locks_rotation(axis) {
                    self.spin[row][axis] = S::zero();
                }
            }
        }
    }
}
