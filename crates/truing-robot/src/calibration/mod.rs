//! Calibrations: robots, sets of measurements, what to estimate, and the result.

mod assembly;
mod load;
mod measurement;
mod result;
mod run;
mod select;
mod start;
mod structure;

pub use assembly::{Assembly, Column, Owner, State};
pub use load::load;
pub use measurement::{Arm, Groups, Measured, MeasurementSet, Sigma};
pub use result::{
    CalibrationResult, ErrorSummary, FrameEstimate, ParameterResult, PlaneEstimate, PointEstimate,
    SetResult, Status, TargetEstimate, TerminationReport,
};
pub use run::{Calibration, Estimate, Outcome, Stage};
