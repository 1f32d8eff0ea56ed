//! Typed results, and putting them together.

mod calibration_result;
mod report;
mod sentences;

pub use calibration_result::{
    CalibrationResult, ComponentEstimate, FrameEstimate, LocationEstimate, ParameterResult,
    PlaneEstimate, PointEstimate, TargetEstimate, TerminationReport, UnknownEstimate,
};
pub(crate) use report::Report;
