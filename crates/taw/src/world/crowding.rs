//! The budget of pairs: how many marbles may lie in one place.

use super::World;
use crate::Error;
use crate::broad::CollisionLayers;
use crate::math::Scalar;
use crate::response::Response;

/// Cell in which all marbles of a size overlap.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct CrowdCell {
    /// Exponent of the radii: from 2^size to twice that.
    size: i16,
    /// Cell along each axis.
    cell: [i64; 3],
    /// Memberships and filters.
    layers: [u32; 2],
}

impl<S: Scalar> World<S> {
    /// Largest number of pairs of overlapping marbles that a step of a response other than
    /// [`SoftStep`](Response::SoftStep) takes. As candidates of contacts they fill a gigabyte.
    pub const MAX_PAIRS: u64 = 1 << 27;

    /// Checks that no more pairs than a step takes overlap for certain: a lower bound of their number,
    /// from marbles of radii within a factor of two that share a cell in which all such overlap.
    ///
    /// # Errors
    /// [`Error::TooManyPairs`].
    pub(super) fn check_crowding(&mut self) -> Result<(), Error> {
        let pairs = |count: usize| count as u64 * (count as u64).saturating_sub(1) / 2;
        let marbles = &self.marbles;
        if self.settings.model.response == Response::SoftStep
            || pairs(marbles.len()) <= Self::MAX_PAIRS
        {
            return Ok(());
        }
        let cells = &mut self.scratch.crowd_cells;
        cells.clear();
        cells.extend((0..marbles.len()).filter_map(|row| {
            cell_of(marbles.position()[row], marbles.radius()[row], marbles.layers_of_row(row))
        }));
        cells.sort_unstable();
        let overlapping: u64 = cells.chunk_by(|a, b| a == b).map(|cell| pairs(cell.len())).sum();
        if overlapping > Self::MAX_PAIRS {
            return Err(Error::TooManyPairs { pairs: overlapping, max: Self::MAX_PAIRS });
        }
        Ok(())
    }
}

/// Cell of a marble that collides with such as itself, if numbers have a place for it.
fn cell_of<S: Scalar>(
    position: crate::math::Point3<S>,
    radius: S,
    layers: CollisionLayers,
) -> Option<CrowdCell> {
    /// Integers up to here are exact.
    const EXACT: f64 = (1_u64 << 53) as f64;
    if !layers.interacts_with(layers) {
        return None;
    }
    let size = radius.as_f64().log2().floor();
    // The diagonal of a cube of side 1 is less than 2.
    let side = size.exp2();
    let cell: [f64; 3] =
        [position.x, position.y, position.z].map(|it| (it.as_f64() / side).floor());
    cell.iter().all(|at| at.abs() < EXACT).then(|| CrowdCell {
        size: size as i16,
        cell: cell.map(|at| at as i64),
        layers: [layers.memberships, layers.filters],
    })
}
