//! The kinds of measurement: one file a kind, with its equation, and one line of the list here.

mod ball_bar;
mod body_pose;
mod distance;
mod known_plane;
mod pose;
mod position;
mod same_location;
mod same_point;
mod unknown_plane;

pub use ball_bar::{AnchorLength, BallBar, ball_bar};
pub use body_pose::BodyPose;
pub use distance::{Distance, Distances, PostureDistance, distance, posture_distance};
pub use known_plane::{KnownPlane, KnownPlaneTouches, known_plane};
pub use pose::{MeasuredPose, Poses, pose, pose_of};
pub use position::{Position, Positions, position};
pub use same_location::{LocationVisits, same_location};
pub use same_point::{PointVisits, SamePoint, same_point};
pub use unknown_plane::{UnknownPlane, UnknownPlaneTouches, unknown_plane};

use crate::measurement::kind::Kind;
use std::sync::Arc;

/// The kinds that every file can name.
pub fn built_in() -> Vec<Arc<dyn Kind>> {
    vec![
        Arc::new(Poses),
        Arc::new(Positions),
        Arc::new(KnownPlaneTouches::default()),
        Arc::new(UnknownPlaneTouches::default()),
        Arc::new(PointVisits),
        Arc::new(LocationVisits),
        Arc::new(Distances::default()),
        Arc::new(BallBar::default()),
    ]
}
