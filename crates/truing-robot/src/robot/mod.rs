//! Robots as chains of frames: their tables, parameters, forward kinematics, the kinematic regressor
//! and postures.

pub mod arm;
mod build;
pub mod chain;
mod chain_frame;
pub mod frame;
mod frame_row;
mod joint_kind;
pub mod joint_model;
mod models;
pub mod names;
pub mod posture;
mod regressor;
pub(crate) mod serial;
mod table;
mod table_items;
mod table_reader;
mod table_text;
mod twist;
mod unit;

pub use arm::Arm;
pub use chain::{Chain, Derivatives};
pub use chain_frame::{Frame, Motion};
pub use frame::FrameModel;
pub use frame_row::{Convention, FrameRow, GeneralFrame};
pub use joint_kind::JointKind;
pub use joint_model::{Input, JointModel, NamedJointModel};
pub use models::{CustomFrame, ModelRow, Models, NamedFrameModel};
pub use regressor::{DifferentiateChain, FrameWise, Regressor};
pub use serial::{InputColumn, Joint, Parameter, ParameterKind, Robot};
pub use table::{GRAVITY, InputRow, JointRow, Mass, Reading, RobotFile};
pub use twist::Twist;
pub use unit::{ModelParameter, Unit};
