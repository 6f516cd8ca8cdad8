//! The budget of pairs: how many marbles and balls may lie in one place.

use super::World;
use crate::Error;
use crate::broad::{CrowdBall, pairs_among};
use crate::math::Scalar;

impl<S: Scalar> World<S> {
    /// Largest number of pairs of overlapping marbles, and balls of the [swarm](Self::swarm), that a
    /// step takes.
    ///
    /// As candidates of contacts they fill a gigabyte. [`SoftStep`](crate::response::Response::SoftStep) and swarms
    /// list at most 64 pairs for each ball, which takes less than half of that, and look at all in
    /// each search, which takes about a second.
    pub const MAX_PAIRS: u64 = 1 << 27;

    /// Checks that no more pairs than a step takes overlap for certain: a lower bound of their number,
    /// from balls of radii within a factor of two that share a cell in which all such overlap.
    ///
    /// # Errors
    /// [`Error::TooManyPairs`].
    pub(super) fn check_crowding(&mut self) -> Result<(), Error> {
        let others = self.swarm.len().saturating_sub(self.swarm.body_balls.len());
        if pairs_among(self.marbles.len() + others) <= Self::MAX_PAIRS || !self.may_be_crowded() {
            return Ok(());
        }
        let (marbles, swarm) = (&self.marbles, &self.swarm);
        let of_marbles = (0..marbles.len()).map(|row| {
            let center = marbles.position()[row];
            CrowdBall {
                center: [center.x, center.y, center.z].map(S::as_f64),
                radius: marbles.radius()[row].as_f64(),
                layers: marbles.layers_of_row(row),
            }
        });
        let balls = of_marbles.chain(swarm.crowd_balls());
        match self.scratch.crowding.pairs_beyond(Self::MAX_PAIRS, balls) {
            Some(pairs) => Err(Error::TooManyPairs { pairs, max: Self::MAX_PAIRS }),
            None => Ok(()),
        }
    }

    /// Returns false if the last step took what overlaps now. Solved contacts part marbles, so by
    /// [`SoftStep`](crate::response::Response::SoftStep) and in swarms, which take millions, they are counted only where
    /// somebody else moved them, or where not all pairs were listed.
    fn may_be_crowded(&self) -> bool {
        if self.swarm.may_be_crowded() {
            return true;
        }
        let count = self.marbles.len();
        if self.settings.model.response.uses_swarm_rows() {
            // Each marble that was set overlaps at most all others.
            self.changed_marbles().is_none_or(|changed| {
                (changed as u64).saturating_mul(count as u64) > Self::MAX_PAIRS
            })
        } else {
            pairs_among(count) > Self::MAX_PAIRS
        }
    }
}
