//! The pose of a body that is mounted on the tool.

use crate::robot::Chain;
use std::sync::Arc;
use truing::manifold::{Pose, Pose3, Vector, so3};
use truing::{Constraint, Scalar, Views};

/// The pose of a body on the tool in a sensor's frame.
#[derive(Clone)]
pub struct BodyPose {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values.
    pub q: Vec<f64>,
    /// What the sensor read: sensor_from_body.
    pub measured: Pose<f64>,
}

impl Constraint for BodyPose {
    type Vars = (Vector, Pose3, Pose3);
    const DIM: usize = 6;

    fn residual<T: Scalar>(&self, (robot, sensor, body): Views<'_, Self, T>, r: &mut [T]) {
        let seen = self.chain.robot.forward(robot, &self.q).compose(&body);
        let away = sensor.rotation.transpose();
        let position = away * (seen.translation - sensor.translation);
        let from_sensor = self.measured.rotation.transpose().map(T::from);
        let log = so3::log_matrix(&(from_sensor * (away * seen.rotation)));
        for i in 0..3 {
            r[i] = position[i] - self.measured.translation[i];
            r[i + 3] = log[i];
        }
    }
}
