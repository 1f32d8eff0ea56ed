//! The problem of a calibration: robots, sensor frames, tools and the unknowns of sets as variables, the
//! measurements as equations.

mod assembly;
mod column;
mod errors;

pub use assembly::{Assembly, is_given};
pub use column::{Column, Owner};
pub use errors::{errors_of, residuals};
