//! Questions about shapes, beside the same questions to parry3d. There is nothing here: see
//! `benches/pairs.rs` for what they cost, and `tests/oracle.rs` for who is right.
