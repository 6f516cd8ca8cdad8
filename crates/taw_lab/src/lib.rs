//! The measuring bench of taw: scenes whose outcome physics knows, and how near to it
//! each model comes at what cost.

pub mod scene;
pub mod suite;
