//! What an estimate is worth: errors, how sure it is, what does not fit, what is doubtful.

pub(crate) mod doubt;
mod errors;
mod figures;
mod outlier;
mod parts;
mod prediction;
mod statistics;
mod tool;
mod uncertainty;

pub(crate) use errors::Fitted;
pub use figures::{
    Correlated, ErrorSeries, ErrorSummary, GlobalTest, MeasurementStatistics, Outlier, SetResult,
    ToolUncertainty,
};
pub(crate) use statistics::Statistics;
pub use tool::ToolPose;
pub use uncertainty::Uncertainty;
