//! The files Truing reads: robots, calibrations (TOML) and data (CSV).
//!
//! Reading never panics: whatever is wrong with a file comes back as an [`InputError`] that says
//! where it is, what was found, what was expected and what to do.

mod calibration;
mod constraint_spec;
mod constraint_values;
mod error;
mod estimate_spec;
mod frame_row;
mod item;
mod loss;
mod pattern;
mod quantity;
mod robot;
mod robot_text;
mod section;
mod selection;
mod selection_syntax;
mod simulation;
mod study;
mod table;

pub use calibration::{CalibrationFile, RobotRef};
pub use constraint_spec::{ConstraintSpec, DistanceSpec, Holdout, Kind, PlaneSpec, SigmaSpec};
pub use error::{InputError, Source, ValueError, nearest};
pub use estimate_spec::{BoundSpec, EstimateSpec, JacobianKind, SolverKind, StrategyKind};
pub use frame_row::{Convention, FrameRow};
pub use item::Item;
pub use pattern::Pattern;
pub use quantity::{Dimension, Quantity, Units};
pub use robot::{JointKind, JointRow, RobotFile};
pub use section::{Document, Section, Spanned, Spans};
pub use selection::Selection;
pub use simulation::{ErrorSpec, PlacesSpec, SimulationFile, SimulationSpec};
pub use study::{CaseSpec, MethodSpec, StartKind, StudyFile};
pub use table::Table;
