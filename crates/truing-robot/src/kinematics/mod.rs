//! Robots as chains of frames: parameters, forward kinematics and the kinematic regressor.

mod frame;
mod regressor;
mod robot;

pub use frame::{Convention, JointKind};
pub use regressor::{DifferentiateChain, FrameWise, Regressor, Twist};
pub use robot::{Frame, Joint, Parameter, ParameterKind, Robot, Unit};
