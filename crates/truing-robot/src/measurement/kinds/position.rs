//! A tool point's position, measured by a sensor.

use crate::error::Error;
use crate::measurement::draw::Draw;
use crate::measurement::equations::Equations;
use crate::measurement::groups::Rows;
use crate::measurement::kind::{DataColumn, Kind, Seen};
use crate::measurement::measurand::Measurand;
use crate::measurement::set::MeasurementSet;
use crate::robot::Chain;
use crate::robot::chain::{reference_or_regressor, regressor_at, seen_by, write_block, write_tip};
use std::sync::Arc;
use truing::manifold::{Point3, Pose, Pose3, Vector, so3};
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

/// Positions of a tool point, measured by a sensor: kind `position`, columns `x`, `y`, `z`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Positions;

/// Measured positions \[m\] of the tool of robot number 0.
pub fn position(
    name: impl Into<String>,
    q: Vec<Vec<f64>>,
    positions: &[Vector3<f64>],
) -> MeasurementSet {
    let values = Rows::from_rows(positions.iter().map(|p| [p.x, p.y, p.z]));
    MeasurementSet::new(name, Positions, q, values)
}

/// The pose of a tool that a sensor would read, with noise on position and rotation.
pub(super) fn seen_somewhere(draw: &mut Draw<'_>, sigma: [f64; 2]) -> Pose<f64> {
    let sensor = draw.at.sensor().inverse();
    let tool = draw.anywhere()[0];
    let tip = sensor.apply(&tool.translation) + draw.normal() * sigma[0];
    let turn = so3::exp_matrix((draw.normal() * sigma[1]).as_slice());
    Pose {
        rotation: sensor.rotation * tool.rotation * turn,
        translation: tip,
    }
}

impl Kind for Positions {
    fn name(&self) -> &'static str {
        "position"
    }

    fn measurands(&self) -> &'static [Measurand] {
        &[Measurand::POSITION]
    }

    fn columns(&self) -> &'static [DataColumn] {
        const {
            &[
                DataColumn::length("x"),
                DataColumn::length("y"),
                DataColumn::length("z"),
            ]
        }
    }

    fn has_frame(&self) -> bool {
        true
    }

    fn equations(&self, on: &mut Equations<'_>) -> Result<(), Error> {
        on.add(|on, row| {
            let tool = &on.tools[0];
            let position = Position {
                chain: tool.chain.clone(),
                q: on.q(0, row),
                measured: Vector3::from_column_slice(on.values(row)),
            };
            ((tool.robot, on.sensor, tool.point()), position)
        })
    }

    fn seen(&self, row: &[f64]) -> Option<Seen> {
        Some(Seen::Position(Vector3::from_column_slice(row)))
    }

    fn draw(&self, draw: &mut Draw<'_>) -> Result<Vec<f64>, Error> {
        let sigma = [draw.noise[0], 0.0];
        Ok(seen_somewhere(draw, sigma).translation.as_slice().to_vec())
    }
}
