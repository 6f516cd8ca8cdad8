//! The measuring bench of taw: scenes whose outcome physics knows, and how near to it
//! each model comes at what cost.
//!
//! Games that measure themselves use [`advise`] with a [`Snapshot`](advise::Snapshot). What only
//! the program needs is behind the feature `cli`, which is on by default.

#![allow(clippy::missing_panics_doc, reason = "a bench that cannot set up its scene has a bug")]
#![allow(clippy::doc_markdown, reason = "it cites people and programs on every page")]

pub mod advise;
pub mod scene;
#[cfg(feature = "cli")]
pub mod stages;
#[cfg(feature = "cli")]
pub mod storm;
#[cfg(feature = "cli")]
pub mod suite;
pub mod trade;
