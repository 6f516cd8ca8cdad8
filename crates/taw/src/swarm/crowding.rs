//! Balls that may be too many at one point for a step.

use super::Swarm;
use crate::broad::CrowdBall;
use crate::math::Scalar;

impl<S: Scalar> Swarm<S> {
    /// Returns false if all pairs that overlapped in the last step were listed, and none came by
    /// anything but a step.
    pub(crate) fn may_be_crowded(&self) -> bool {
        let unlisted = |chunk: &super::Chunk<S>| chunk.unlisted > 0;
        !self.pairs_valid || self.fast_movers.unlisted > 0 || self.chunks.iter().any(unlisted)
    }

    /// Balls that stand for no marble.
    pub(crate) fn crowd_balls(&self) -> impl Iterator<Item = CrowdBall> + Clone + '_ {
        let surfaces = self.surface_of();
        (0..self.len()).filter(|row| !self.is_marble(*row)).map(move |row| {
            let [x, y, z, radius] = self.at[row].map(S::as_f64);
            CrowdBall { center: [x, y, z], radius, layers: surfaces.layers(row as u32) }
        })
    }
}
