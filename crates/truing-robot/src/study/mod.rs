//! Monte-Carlo studies: many robots with known errors, measured and estimated again by several
//! methods, and how many of them come back.
//!
//! Every random number comes from a stream of its own (purpose, tool error, trial, attempt) and every
//! sum has a fixed order, so that a study comes out the same to the last digit on any number of
//! threads. The cases of a study share their streams: they see the same robots and planes wherever
//! they draw the same things.

mod cases;
mod draw;
mod judge;
mod level;
mod plan;
mod run;
mod summary;

pub use cases::Study;
pub use judge::{Symmetry, tool_error};
pub use plan::load_study;
pub use summary::{Counts, StudyResult, StudyRow};
