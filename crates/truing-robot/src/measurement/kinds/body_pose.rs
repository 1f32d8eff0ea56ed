//! The pose of a body that is mounted on the tool, measured by a sensor.

use crate::robot::chain::{reference_or_regressor, regressor_at, seen_by, write_block};
use crate::robot::{Chain, Regressor};
use std::sync::Arc;
use truing::manifold::{Pose, Pose3, Vector, so3};
use truing::nalgebra::{Matrix3, SMatrix};
use truing::{Constraint, Dual, Jacobian, Point, Scalar, Views, autodiff};

/// The pose of a body on the tool in a sensor's frame: with E = S⁻¹ · base_from_tool · X, position rows
/// E's translation − measured \[m\], rotation rows log(R_measuredᵀ · R_E) \[rad\].
///
/// Variables: robot parameters, the sensor's pose S in the reference frame, the body's pose X in the tool
/// frame. Six rows. With the robot known this is robot–world and hand–eye calibration, A X = S B: a camera on the
/// tool that sees a board, or one in the room that sees a board on the tool, is the same equation with
/// sensor and body named the other way round.
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
        let placed = self.chain.robot.forward(robot, &self.q).compose(&body);
        pose_residual(&placed, &sensor, &self.measured, r);
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, sensor, body) = at.views();
        let regressor = regressor_at(at, source, &self.chain, parameters, &self.q);
        let (by_tip, by_body) = linearize_pose(regressor, &sensor, &body, &self.measured, r, j);
        let mut body_columns = SMatrix::<f64, 6, 6>::zeros();
        body_columns
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(by_tip * regressor.tool.rotation));
        body_columns
            .fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&by_body);
        write_block(j, 2, &body_columns);
    }
}

/// The six rows of a body placed in the reference frame and read as `measured` by the sensor.
pub(super) fn pose_residual<T: Scalar>(
    placed: &Pose<T>,
    sensor: &Pose<T>,
    measured: &Pose<f64>,
    r: &mut [T],
) {
    let away = sensor.rotation.transpose();
    let seen = away * (placed.translation - sensor.translation);
    let from_sensor = measured.rotation.transpose().map(T::from);
    let log = so3::log_matrix(&(from_sensor * (away * placed.rotation)));
    for i in 0..3 {
        r[i] = seen[i] - measured.translation[i];
        r[i + 3] = log[i];
    }
}

/// The same of a body at `on_tool`, with its derivatives by the robot (block 0) and the sensor (block 1); those of the
/// position by the tip and of the rotation by a turn of the body on its own side come back.
///
/// A turn w of the tool about the reference axes takes the error E = R_measuredᵀ · R_Sᵀ · R_tool · R_body to
/// exp(u)·E with u = R_measuredᵀ · R_Sᵀ · w; a turn ω of the sensor on its own side, with
/// u = −R_measuredᵀ · ω; one of the body, to E·exp(ω) = exp(E ω)·E. Only log(exp(u)·E) is left to differentiate.
pub(super) fn linearize_pose(
    regressor: &Regressor,
    sensor: &Pose<f64>,
    on_tool: &Pose<f64>,
    measured: &Pose<f64>,
    r: &mut [f64],
    j: &mut Jacobian<'_>,
) -> (Matrix3<f64>, Matrix3<f64>) {
    let tip = regressor.tool.apply(&on_tool.translation);
    let (seen, by_tip, by_sensor) = seen_by(sensor, &tip);
    let from_sensor = measured.rotation.transpose();
    let from_base = from_sensor * sensor.rotation.transpose();
    let error = from_base * (regressor.tool.rotation * on_tool.rotation);
    let (log, by_turn): ([f64; 3], Matrix3<f64>) = autodiff::small(&[0.0; 3], |u, out| {
        let turned = so3::exp_matrix(u) * error.map(Dual::from);
        out.copy_from_slice(so3::log_matrix(&turned).as_slice());
    });
    r[..3].copy_from_slice((seen - measured.translation).as_slice());
    r[3..].copy_from_slice(&log);
    let by_tool_turn = by_turn * from_base;
    for (column, twist) in j.block_mut(0).chunks_exact_mut(6).zip(&regressor.twists) {
        column[..3].copy_from_slice((by_tip * twist.at(&tip)).as_slice());
        column[3..].copy_from_slice((by_tool_turn * twist.angular).as_slice());
    }
    let mut sensor_columns = SMatrix::<f64, 6, 6>::zeros();
    sensor_columns.fixed_rows_mut::<3>(0).copy_from(&by_sensor);
    sensor_columns
        .fixed_view_mut::<3, 3>(3, 3)
        .copy_from(&-(by_turn * from_sensor));
    write_block(j, 1, &sensor_columns);
    (by_tip, by_turn * error)
}
