//! Relaxation of contacts after balls have moved.

use super::RELAXATIONS;
use crate::math::Scalar;
use crate::swarm::Swarm;
use crate::swarm::batches::Batch;
use crate::swarm::chunk::Chunk;
use crate::swarm::kernels::{Pass, SolverParams};

impl<S: Scalar> Swarm<S> {
    /// Relaxes, and records what that changes, along the normals of now.
    pub(super) fn relax_recorded(&mut self, params: SolverParams<S>) {
        self.record_contact_impulses(-S::one());
        self.relax(params);
        self.record_contact_impulses(S::one());
    }

    /// Takes the speed back by which overlaps were pushed out, and moves apart what overlaps too much.
    ///
    /// A ball between two others that walls press together is thrown out sideways by their pushes. One
    /// pass over the contacts takes back little of that: each undoes what the ones before it did. Each
    /// lowers the kinetic energy (projected Gauss–Seidel on rigid contacts is a descent), so chunks that are
    /// jammed are relaxed until their contacts agree.
    fn relax(&mut self, params: SolverParams<S>) {
        self.pass(Pass::Relax(params), |_, _| true);
        // Nothing is moved apart twice in a substep.
        let stays = SolverParams { moves_apart: false, ..params };
        for _ in 0..RELAXATIONS {
            if !self.choose_jammed() {
                return;
            }
            self.pass(Pass::Relax(stays), |chunk, _| chunk.again);
        }
        self.choose_jammed(); // so that none is left marked for the next substep
    }

    /// Chooses the chunks with a jammed pair, and those beside them. Returns true if there are any.
    fn choose_jammed(&mut self) -> bool {
        if std::mem::take(&mut self.fast_movers.impulses.jammed) {
            for row in self.fast_movers.batches.iter().flat_map(Batch::pairs).flatten() {
                let chunk = self.chunks.partition_point(|chunk| chunk.rows[1] <= row);
                self.chunks[chunk].impulses.jammed = true;
            }
        }
        let jammed = |chunk: Option<&Chunk<S>>| chunk.is_some_and(|chunk| chunk.impulses.jammed);
        let mut any = false;
        for i in 0..self.chunks.len() {
            let before = i.checked_sub(1).and_then(|i| self.chunks.get(i));
            let [own, next] = [self.chunks.get(i), self.chunks.get(i + 1)];
            let again = jammed(before) || jammed(own) || jammed(next);
            any |= again;
            self.chunks[i].again = again;
        }
        self.chunks.iter_mut().for_each(|chunk| chunk.impulses.jammed = false);
        any
    }
}
