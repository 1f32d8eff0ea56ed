//! The tool's pose, measured by a sensor.

use super::{
    Chain, lift, moved_pose, reference_or_regressor, regressor_at, transposed, write_block,
    write_tip,
};
use std::sync::Arc;
use truing::manifold::{Point3, Pose, Pose3, Vector, so3};
use truing::nalgebra::{Matrix3, SMatrix, Vector3};
use truing::{Constraint, Jacobian, Point, Scalar, Views, autodiff};

/// The pose of the tool in a sensor's frame: position rows S⁻¹ · (base_from_tool · target) − measured [m],
/// rotation rows log(R_measuredᵀ · R_Sᵀ · R_tool) [rad].
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

fn model<T: Scalar>(
    tip: &Vector3<T>,
    rotation: &Matrix3<T>,
    sensor: &Pose<T>,
    measured: &Pose<f64>,
    r: &mut [T],
) {
    let seen = transposed(&sensor.rotation, &(tip - sensor.translation));
    let turned =
        lift::<T>(&measured.rotation.transpose()) * (sensor.rotation.transpose() * rotation);
    let log = so3::log_matrix(&turned);
    for i in 0..3 {
        r[i] = seen[i] - measured.translation[i];
        r[i + 3] = log[i];
    }
}

impl Constraint for MeasuredPose {
    type Vars = (Vector, Pose3, Point3);
    const DIM: usize = 6;

    fn residual<T: Scalar>(&self, (robot, sensor, target): Views<'_, Self, T>, r: &mut [T]) {
        let tool = self.chain.robot.forward(robot, &self.q);
        model(
            &tool.apply(&target),
            &tool.rotation,
            &sensor,
            &self.measured,
            r,
        );
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, sensor, target) = at.views();
        let regressor = regressor_at(at, source, &self.chain, parameters, &self.q);
        let tip = regressor.tool.apply(&target);
        // Tip (3), a turn of the tool about the reference axes (3), the sensor's tangent (6).
        let mut inputs = [0.0; 12];
        inputs[..3].copy_from_slice(tip.as_slice());
        let tool = regressor.tool.rotation;
        let (value, gradient): ([f64; 6], SMatrix<f64, 6, 12>) =
            autodiff::small(&inputs, |x, out| {
                let turned = so3::exp_matrix(&x[3..6]) * lift::<truing::Dual<12>>(&tool);
                let tip = Vector3::new(x[0], x[1], x[2]);
                model(
                    &tip,
                    &turned,
                    &moved_pose(&sensor, &x[6..12]),
                    &self.measured,
                    out,
                );
            });
        r.copy_from_slice(&value);
        write_tip(
            j,
            0,
            2,
            regressor,
            &tip,
            &gradient.fixed_columns::<3>(0).into_owned(),
        );
        let by_turn = gradient.fixed_columns::<3>(3).into_owned();
        for (column, twist) in j.block_mut(0).chunks_exact_mut(6).zip(&regressor.twists) {
            for (entry, turned) in column.iter_mut().zip((by_turn * twist.angular).iter()) {
                *entry += turned;
            }
        }
        write_block(j, 1, &gradient.fixed_columns::<6>(6).into_owned());
    }
}
