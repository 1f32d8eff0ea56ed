//! From files to calibrations: robots and data read, names understood.

mod arms;
mod calibration;
mod data;
mod estimate;
mod names;

pub(crate) use arms::read_arms;
pub use calibration::{load, load_with};
pub(crate) use estimate::estimate;
pub(crate) use names::{Names, in_unit_of};
