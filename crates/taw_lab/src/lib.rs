//! The measuring bench of taw: scenes whose outcome physics knows, and how near to it
//! each model comes at what cost.

#![allow(clippy::missing_panics_doc, reason = "a bench that cannot set up its scene has a bug")]
#![allow(clippy::doc_markdown, reason = "it cites people and programs on every page")]

pub mod advise;
pub mod scene;
pub mod stages;
pub mod suite;
pub mod trade;
