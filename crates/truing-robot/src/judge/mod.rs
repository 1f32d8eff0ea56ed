//! What an estimate is worth: errors, how sure it is, what does not fit, what is doubtful.

mod clusters;
pub(crate) mod doubt;
mod errors;
mod figures;
mod forecast;
mod foresight;
mod leave_out;
mod misfit;
mod outlier;
mod parts;
mod statistics;
mod suspect;
mod tips;
mod tool;
mod uncertainty;

pub(crate) use errors::Fitted;
pub use figures::{
    Correlated, ErrorSeries, ErrorSummary, GlobalTest, MeasurementStatistics, Outlier, SetResult,
    ToolEverywhere, ToolUncertainty,
};
pub(crate) use statistics::Statistics;
pub use tool::ToolPose;
pub use uncertainty::Uncertainty;
