//! Robots as chains of frames: their tables, parameters, forward kinematics, the kinematic regressor
//! and postures.

pub mod arm;
pub mod chain;
mod frame;
mod frame_row;
pub mod names;
pub mod posture;
mod regressor;
mod serial;
mod table;
mod table_text;

pub use arm::Arm;
pub use chain::{Chain, Derivatives};
pub use frame_row::{Convention, FrameRow};
pub use regressor::{DifferentiateChain, FrameWise, Regressor, Twist};
pub use serial::{Frame, Joint, Parameter, ParameterKind, Robot, Unit};
pub use table::{JointKind, JointRow, RobotFile};
