//! The cases that break collision code, as tables: coincident, touching exactly, parallel,
//! flat, without length, huge beside tiny, at rest, at the first and the last moment.
//!
//! Each is asked at five scales, three offsets and three rotations, in both scalars and both
//! orders. The numbering is that of the families in which such cases are usually listed.
//! `cargo test -p taw --test geometry degenerate -- --nocapture` prints how many there are.

mod cases;
mod pairs;
mod rounding;
mod sweeps;
