//! The tool's pose, measured by a sensor.

use super::body_pose::{BodyPose, linearize_pose, pose_residual};
use super::position::seen_somewhere;
use crate::error::Error;
use crate::measurement::draw::Draw;
use crate::measurement::equations::Equations;
use crate::measurement::groups::Rows;
use crate::measurement::kind::{DataColumn, Kind, Seen, TargetKind};
use crate::measurement::measurand::Measurand;
use crate::measurement::set::MeasurementSet;
use crate::robot::Chain;
use crate::robot::chain::{reference_or_regressor, regressor_at, write_block};
use std::sync::Arc;
use truing::manifold::{Point3, Pose, Pose3, Vector, so3};
use truing::nalgebra::{Matrix3, SMatrix, Vector3};
use truing::{Constraint, Jacobian, Point, Scalar, Views};

/// The pose of the tool in a sensor's frame: position rows S⁻¹ · (base_from_tool · target) − measured \[m\],
/// rotation rows log(R_measuredᵀ · R_Sᵀ · R_tool) \[rad\].
///
/// Variables: robot parameters, the sensor's pose S, the target in the tool frame. Six rows.
#[derive(Clone)]
pub struct MeasuredPose {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values.
    pub q: Vec<f64>,
    /// What the sensor read: sensor_from_tool.
    pub measured: Pose<f64>,
}

impl Constraint for MeasuredPose {
    type Vars = (Vector, Pose3, Point3);
    const DIM: usize = 6;

    fn residual<T: Scalar>(&self, (robot, sensor, target): Views<'_, Self, T>, r: &mut [T]) {
        let tool = self.chain.robot.forward(robot, &self.q);
        let placed = Pose::new(tool.rotation, tool.apply(&target));
        pose_residual(&placed, &sensor, &self.measured, r);
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, sensor, target) = at.views();
        let regressor = regressor_at(at, source, &self.chain, parameters, &self.q);
        let on_tool = Pose::new(Matrix3::identity(), target);
        let (by_tip, _) = linearize_pose(regressor, &sensor, &on_tool, &self.measured, r, j);
        let mut target_columns = SMatrix::<f64, 6, 3>::zeros();
        target_columns
            .fixed_rows_mut::<3>(0)
            .copy_from(&(by_tip * regressor.tool.rotation));
        write_block(j, 2, &target_columns);
    }
}

/// Poses of the tool, or of a body on it, measured by a sensor: kind `pose`, columns `x`, `y`, `z`, `qw`, `qx`,
/// `qy`, `qz`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Poses;

/// Measured poses of the tool of robot number 0.
pub fn pose(name: impl Into<String>, q: Vec<Vec<f64>>, poses: &[Pose<f64>]) -> MeasurementSet {
    let mut values = Rows::new(7);
    poses.iter().for_each(|pose| values.push(&numbers(pose)));
    MeasurementSet::new(name, Poses, q, values)
}

/// A pose as position and unit quaternion.
fn numbers(pose: &Pose<f64>) -> [f64; 7] {
    let p = pose.translation;
    let [qw, qx, qy, qz] = pose.quaternion();
    [p.x, p.y, p.z, qw, qx, qy, qz]
}

/// The pose that the columns of a row give, `x`, `y`, `z`, `qw`, `qx`, `qy`, `qz`; the quaternion has unit
/// length.
pub fn pose_of(row: &[f64]) -> Pose<f64> {
    Pose {
        rotation: so3::quaternion_matrix(&[row[3], row[4], row[5], row[6]]),
        translation: Vector3::new(row[0], row[1], row[2]),
    }
}

impl Kind for Poses {
    fn name(&self) -> &'static str {
        "pose"
    }

    fn measurands(&self) -> &'static [Measurand] {
        &[Measurand::POSITION, Measurand::ROTATION]
    }

    fn columns(&self) -> &'static [DataColumn] {
        const {
            &[
                DataColumn::length("x"),
                DataColumn::length("y"),
                DataColumn::length("z"),
                DataColumn::number("qw"),
                DataColumn::number("qx"),
                DataColumn::number("qy"),
                DataColumn::number("qz"),
            ]
        }
    }

    fn check_row(&self, row: &mut [f64]) -> Result<bool, (String, String)> {
        let q = &mut row[3..];
        let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
        let is_unit = (length - 1.0).abs() <= 0.01;
        if !is_unit {
            let message = format!(
                "the quaternion ({:.4}, {:.4}, {:.4}, {:.4}) has length {length:.4}; expected 1",
                q[0], q[1], q[2], q[3]
            );
            let help = "give unit quaternions as qw, qx, qy, qz (w first)";
            return Err((message, help.to_owned()));
        }
        if (length - 1.0).abs() > 4.0 * f64::EPSILON {
            q.iter_mut().for_each(|c| *c /= length);
        }
        Ok((length - 1.0).abs() > 1e-5)
    }

    fn changed(&self) -> &'static str {
        "quaternions were not quite of unit length and were normalised"
    }

    fn targets(&self) -> TargetKind {
        TargetKind::Body
    }

    fn has_frame(&self) -> bool {
        true
    }

    fn equations(&self, on: &mut Equations<'_>) -> Result<(), Error> {
        let Some(body) = on.tools[0].body() else {
            return on.add(|on, row| {
                let tool = &on.tools[0];
                let pose = MeasuredPose {
                    chain: tool.chain.clone(),
                    q: on.q(0, row),
                    measured: pose_of(on.values(row)),
                };
                ((tool.robot, on.sensor, tool.point()), pose)
            });
        };
        on.add(|on, row| {
            let tool = &on.tools[0];
            let pose = BodyPose {
                chain: tool.chain.clone(),
                q: on.q(0, row),
                measured: pose_of(on.values(row)),
            };
            ((tool.robot, on.sensor, body), pose)
        })
    }

    fn seen(&self, row: &[f64]) -> Option<Seen> {
        Some(Seen::Pose(pose_of(row)))
    }

    fn draw(&self, draw: &mut Draw<'_>) -> Result<Vec<f64>, Error> {
        let sigma = [draw.noise[0], draw.noise[1]];
        Ok(numbers(&seen_somewhere(draw, sigma)).to_vec())
    }
}
