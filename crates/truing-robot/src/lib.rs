//! Geometric robot calibration on the [`truing`] estimation framework.
//!
//! A [`Robot`] is a chain of frames with named parameters; a [`calibration::Calibration`] holds robots and sets
//! of measurements in any mixture and estimates what they can identify. [`constraint`] has one file
//! a kind of measurement; each is an ordinary [`truing::Constraint`], so a problem can also be
//! composed by hand.

pub mod calibration;
pub mod constraint;
mod error;
pub mod file;
pub mod kinematics;
pub mod posture;
pub mod simulate;
pub mod study;

pub use error::Error;
pub use kinematics::Robot;
