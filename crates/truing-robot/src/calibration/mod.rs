//! Calibrations: robots, sets of measurements, what to estimate, and the result.

mod assembly;
mod check;
mod data;
mod doubt;
mod estimated;
mod far;
mod form;
mod identification;
mod identify;
mod load;
mod measurement;
mod names;
mod outlier;
mod predict;
mod prediction;
mod question;
mod report;
mod result;
mod run;
mod select;
mod small_groups;
mod solve;
mod start;
mod state;
mod statistics;
mod symmetry;
mod tempered;
mod tool;
mod uncertainty;

pub use assembly::{Assembly, PlaneVar};
pub use check::{ColumnCheck, SetCheck, Way, WayCheck};
pub use estimated::{Estimated, Registration};
pub use far::Strategy;
pub use form::{Form, Parts, PlaneChart, Plugin};
pub use identification::{
    DataAnswer, Gap, Identification, Identified, Indices, RankOf, Scaling, Step,
};
pub use identify::Question;
pub(crate) use load::{estimate, read_arms};
pub use load::{load, load_with};
pub use measurement::{Arm, Groups, Measured, MeasurementSet, Origin, Sigma};
pub(crate) use names::{Names, in_unit_of};
pub use question::{Asked, RobotQuestion};
pub use result::{
    CalibrationResult, Correlated, ErrorSeries, ErrorSummary, FrameEstimate, GlobalTest,
    LocationEstimate, MeasurementStatistics, Outlier, ParameterResult, PlaneEstimate,
    PointEstimate, SetResult, Status, TargetEstimate, TerminationReport, ToolUncertainty,
};
pub use run::{Calibration, Estimate, Outcome, Stage};
pub use select::{Choice, default_preference, in_order, select};
pub use start::{best_fit_plane, rigid_registration, start};
pub use state::{Column, Owner, State};
pub use symmetry::{Motion, Symmetry, direction};
pub use tool::ToolPose;
pub use uncertainty::Uncertainty;
