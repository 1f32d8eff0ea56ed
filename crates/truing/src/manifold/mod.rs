//! The kinds of unknowns: manifolds stored flat, with a retraction ⊞ and its inverse ⊟.

mod direction3;
mod plane3;
mod point3;
mod pose2;
mod pose3;
mod rotation3;
pub mod so3;
mod vector;

pub use direction3::Direction3;
pub use plane3::{Plane, Plane3};
pub use point3::Point3;
pub use pose2::{PlanarPose, Pose2};
pub use pose3::{Pose, Pose3};
pub use rotation3::Rotation3;
pub use vector::Vector;
