//! Bodies with locked axes, within a step: whatever changes rows, they stay where they are along these.

use cgmath::EuclideanSpace;

use crate::math::{Point3, Row, Scalar, Vec3};
use crate::motion::LockedAxes;
use crate::swarm::Swarm;
use crate::swarm::state::of;
use crate::swarm::wall_contact::{set, xyz};

/// Bodies with locked axes, and the free axes of all rows.
#[derive(Clone, Debug, Default)]
pub(in crate::swarm) struct LockedRows<S> {
    held: Vec<HeldRow<S>>,
    /// See [`SolverColumns::free_axes`](crate::swarm::kernels::SolverColumns::free_axes).
    pub free_axes: Vec<Row<S>>,
}

impl<S: Scalar> LockedRows<S> {
    /// Bytes that it has from the allocator.
    pub fn bytes(&self) -> usize {
        of(&self.held) + of(&self.free_axes)
    }
}

/// Row of a body with locked axes.
#[derive(Clone, Copy, Debug)]
struct HeldRow<S> {
    slot: u32,
    axes: LockedAxes,
    /// Center in metres, which it keeps along locked axes.
    center: Point3<S>,
}

impl<S: Scalar> Swarm<S> {
    /// Saves where the bodies with locked axes are as a step begins, and stops them along these.
    pub(super) fn save_held_rows(&mut self) {
        let (rows, at) = (self.ids.rows(), &self.at);
        let held = self.surfaces.locked().map(|(slot, axes)| {
            let center = Point3::from_vec(xyz(&at[rows[slot as usize] as usize]));
            HeldRow { slot, axes, center }
        });
        self.scratch.locks.free_axes.clear();
        self.scratch.locks.held.clear();
        self.scratch.locks.held.extend(held);
        self.hold_rows();
    }

    /// Finds the free axes of all rows, if any has locked ones. Rows may have changed.
    pub(super) fn find_free_axes(&mut self) {
        let (rows, LockedRows { held, free_axes }) = (self.ids.rows(), &mut self.scratch.locks);
        if held.is_empty() {
            return;
        }
        free_axes.clear();
        free_axes.resize(self.at.len(), [S::one(); 4]);
        for HeldRow { slot, axes, .. } in held {
            let free = axes.free_translation(Vec3::from([S::one(); 3]));
            set(&mut free_axes[rows[*slot as usize] as usize], free);
        }
    }

    /// Puts them back along their locked axes, and stops them along those: what a pass did about an axis
    /// of rotation, which only takes energy; what set positions did.
    pub(super) fn hold_rows(&mut self) {
        let rows = self.ids.rows();
        for HeldRow { slot, axes, center } in &self.scratch.locks.held {
            let row = rows[*slot as usize] as usize;
            let (at, velocity, spin) =
                (&mut self.at[row], &mut self.velocity[row], &mut self.spin[row]);
            if velocity[3].is_sign_negative() {
                continue; // nobody moves what sleeps
            }
            set(at, axes.held(Point3::from_vec(xyz(at)), *center).to_vec());
            set(velocity, axes.free_translation(xyz(velocity)));
            set(spin, axes.free_rotation(xyz(spin)));
        }
    }
}
