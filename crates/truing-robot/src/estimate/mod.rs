//! The estimate: a calibration as plain data, checked, started, solved.

mod calibration;
mod check_sets;
mod columns;
mod drawing;
mod estimated;
mod far;
mod job;
mod robust;
mod search;
mod small_groups;
mod solve;
mod stage;
mod tempered;
mod touches;
mod whole;
pub(crate) mod words;

pub use calibration::{Calibration, Estimate, Strategy};
pub(crate) use check_sets::ordinary;
pub(crate) use drawing::Prior;
pub use estimated::Estimated;
pub(crate) use job::Job;
pub use stage::Stage;
pub use whole::Registration;
