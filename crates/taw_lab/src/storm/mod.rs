//! Thousands of scenes that nobody chose, judged by what holds in every scene.
//!
//! - [`generate`] makes an ordinary scene of a name;
//! - [`run`] steps it, and [`judge`] says how near each invariant came to its bound;
//! - [`shrink`] makes the smallest scene of one that failed, to be kept;
//! - [`weather`] does all of it, on several threads, and reports.

mod case;
mod generate;
pub mod judge;
mod observe;
mod report;
mod run;
mod shrink;
mod symmetry;
mod weather;

pub use case::{Case, Kind, Name, SwarmPart};
pub use generate::generate;
pub use judge::{Bench, Finding, Invariant};
pub use observe::{Body, Snapshot};
pub use report::{Tally, table};
pub use run::{Failure, Pulse, Verdict, run, run_for};
pub use shrink::{shrink, shrink_by};
pub use weather::{Plan, Settings, Storm, replay, weather, write};
