//! The tool's pose, measured by a sensor.

use super::{Chain, reference_or_regressor, regressor_at, seen_by, write_block};
use std::sync::Arc;
use truing::manifold::{Point3, Pose, Pose3, Vector, so3};
use truing::nalgebra::{Matrix3, SMatrix};
use truing::{Constraint, Dual, Jacobian, Point, Scalar, Views, autodiff};

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
        let away = sensor.rotation.transpose();
        let seen = away * (tool.apply(&target) - sensor.translation);
        let from_sensor = self.measured.rotation.transpose().map(T::from);
        let log = so3::log_matrix(&(from_sensor * (away * tool.rotation)));
        for i in 0..3 {
            r[i] = seen[i] - self.measured.translation[i];
            r[i + 3] = log[i];
        }
    }

    /// A turn w of the tool about the reference axes takes the error E = R_measuredᵀ · R_Sᵀ · R_tool to
    /// exp(u)·E with u = R_measuredᵀ · R_Sᵀ · w; a turn ω of the sensor on its own side, with
    /// u = −R_measuredᵀ · ω. Only log(exp(u)·E) is left to differentiate.
    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, sensor, target) = at.views();
        let regressor = regressor_at(at, source, &self.chain, parameters, &self.q);
        let tip = regressor.tool.apply(&target);
        let (seen, by_tip, by_sensor) = seen_by(&sensor, &tip);
        let from_sensor = self.measured.rotation.transpose();
        let from_base = from_sensor * sensor.rotation.transpose();
        let error = from_base * regressor.tool.rotation;
        let (log, by_turn): ([f64; 3], Matrix3<f64>) = autodiff::small(&[0.0; 3], |u, out| {
            let turned = so3::exp_matrix(u) * error.map(Dual::from);
            out.copy_from_slice(so3::log_matrix(&turned).as_slice());
        });
        r[..3].copy_from_slice((seen - self.measured.translation).as_slice());
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
        let mut target_columns = SMatrix::<f64, 6, 3>::zeros();
        target_columns
            .fixed_rows_mut::<3>(0)
            .copy_from(&(by_tip * regressor.tool.rotation));
        write_block(j, 2, &target_columns);
    }
}
