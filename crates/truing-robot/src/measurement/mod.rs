//! What can be measured: sets of measurements as plain data, kinds of measurement and their equations.

pub mod at;
pub mod draw;
pub mod equations;
pub mod fit;
mod groups;
pub mod kind;
pub mod kinds;
mod measurand;
pub mod method;
pub mod places;
mod readings;
pub mod sample;
mod set;

pub use at::At;
pub use draw::{ConditionRow, Draw};
pub use equations::{Equations, ToolVars};
pub use groups::{Groups, Rows};
pub use kind::{DataColumn, Grouping, Kind, Placed, Scene, SceneGroups, Seen, TargetKind, Touched};
pub use measurand::Measurand;
pub use method::{Chart, Method};
pub use places::Places;
pub use readings::{Origin, Readings, Tool};
pub use sample::{Sampling, sample};
pub use set::MeasurementSet;
