//! Who might touch. A broad phase names pairs of rows, never fewer than touch and
//! as few others as it can; whether they do is [`contact`](crate::contact)'s.

mod all_pairs;
mod grid;
mod period;

pub use all_pairs::all_pairs;
pub use grid::Grid;
pub(crate) use period::{Images, Period};
