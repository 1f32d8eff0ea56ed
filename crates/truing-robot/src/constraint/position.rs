//! A tool point's position, measured by a sensor.

use super::{
    Chain, moved_pose, reference_or_regressor, regressor_at, transposed, write_block, write_tip,
};
use std::sync::Arc;
use truing::manifold::{Point3, Pose, Pose3, Vector};
use truing::nalgebra::{SMatrix, Vector3};
use truing::{Constraint, Jacobian, Point, Scalar, Views, autodiff};

/// The position of a tool point in a sensor's frame: r = S⁻¹ · (base_from_tool · target) − measured [m].
///
/// Variables: robot parameters, the sensor's pose S in the reference frame, the target in the tool
/// frame. Three rows, in the sensor's axes. Hold S at identity for positions in the reference frame
/// and the target at zero for those of the tool origin.
#[derive(Clone)]
pub struct Position {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values.
    pub q: Vec<f64>,
    /// What the sensor read [m].
    pub measured: Vector3<f64>,
}

fn model<T: Scalar>(tip: &Vector3<T>, sensor: &Pose<T>, measured: &Vector3<f64>, r: &mut [T]) {
    let seen = transposed(&sensor.rotation, &(tip - sensor.translation));
    for i in 0..3 {
        r[i] = seen[i] - measured[i];
    }
}

impl Constraint for Position {
    type Vars = (Vector, Pose3, Point3);
    const DIM: usize = 3;

    fn residual<T: Scalar>(&self, (robot, sensor, target): Views<'_, Self, T>, r: &mut [T]) {
        model(
            &self.chain.tip(robot, &self.q, &target),
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
        let inputs = [tip.x, tip.y, tip.z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let (value, gradient): ([f64; 3], SMatrix<f64, 3, 9>) =
            autodiff::small(&inputs, |x, out| {
                model(
                    &Vector3::new(x[0], x[1], x[2]),
                    &moved_pose(&sensor, &x[3..9]),
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
        write_block(j, 1, &gradient.fixed_columns::<6>(3).into_owned());
    }
}
