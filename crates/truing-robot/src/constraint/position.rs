//! A tool point's position, measured by a sensor.

use super::{Chain, reference_or_regressor, regressor_at, seen_by, write_block, write_tip};
use std::sync::Arc;
use truing::manifold::{Point3, Pose3, Vector};
use truing::nalgebra::Vector3;
use truing::{Constraint, Jacobian, Point, Scalar, Views};

/// The position of a tool point in a sensor's frame: r = S⁻¹ · (base_from_tool · target) − measured \[m\].
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
    /// What the sensor read \[m\].
    pub measured: Vector3<f64>,
}

impl Constraint for Position {
    type Vars = (Vector, Pose3, Point3);
    const DIM: usize = 3;

    fn residual<T: Scalar>(&self, (robot, sensor, target): Views<'_, Self, T>, r: &mut [T]) {
        let tip = self.chain.tip(robot, &self.q, &target);
        let seen = sensor.rotation.transpose() * (tip - sensor.translation);
        for i in 0..3 {
            r[i] = seen[i] - self.measured[i];
        }
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, sensor, target) = at.views();
        let regressor = regressor_at(at, source, &self.chain, parameters, &self.q);
        let tip = regressor.tool.apply(&target);
        let (seen, by_tip, by_sensor) = seen_by(&sensor, &tip);
        r.copy_from_slice((seen - self.measured).as_slice());
        write_tip(j, 0, 2, regressor, &tip, &by_tip);
        write_block(j, 1, &by_sensor);
    }
}
