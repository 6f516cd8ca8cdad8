//! Broad phase: candidate pairs of indices, never fewer than touch and as few others as possible.
//! [`contact`](crate::contact) tests if they touch.

mod brute_force;
mod crowding;
mod grid;
mod ignored;
mod layers;
mod period;

pub use brute_force::brute_force_pairs;
pub(crate) use crowding::{CrowdBall, Crowding, pairs_among};
pub use grid::Grid;
pub(crate) use ignored::{CollisionFilter, IgnoredPairs};
pub use layers::CollisionLayers;
pub(crate) use period::{Images, Period};
