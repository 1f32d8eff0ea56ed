//! The files Truing reads: calibrations, simulations and studies (TOML).

mod calibration;
mod constraint;
mod constraint_values;
mod estimate;
mod holdout;
mod robots;
mod simulation;
mod study;

pub use calibration::CalibrationFile;
pub use constraint::ConstraintSpec;
pub use estimate::{BoundSpec, EstimateSpec, JacobianKind, SolverKind, StrategyKind};
pub use holdout::Holdout;
pub use robots::RobotRef;
pub use simulation::{ErrorSpec, SimulationFile, SimulationSpec};
pub use study::{CaseSpec, MethodSpec, StartKind, StudyFile};
