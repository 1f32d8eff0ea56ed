//! Geometric robot calibration on the [`truing`] estimation framework.
//!
//! A [`Robot`] is a chain of frames with named parameters; a [`Calibration`] holds robots and sets of
//! measurements in any mixture and estimates what they can identify. What can be measured is open: a
//! [`Kind`](measurement::Kind) of measurement is one type, the [`kinds`] here are seven of them, and a
//! [`Plugin`] hands more to files by name.

pub mod check;
mod error;
pub mod estimate;
pub mod file;
pub mod identify;
pub mod judge;
pub mod load;
pub mod measurement;
pub mod model;
mod plugin;
mod questions;
pub mod result;
pub mod robot;
mod run;
pub mod simulate;
pub mod start;
pub mod study;
pub mod text;
pub mod unknown;

pub use error::Error;
pub use estimate::{Calibration, Estimate};
pub use measurement::{MeasurementSet, kinds};
pub use plugin::{Plugin, Registry};
pub use robot::{Arm, Robot};
pub use run::Outcome;
