//! The classical method, equations (2) to (4): measured positions and poses of the tool.

use std::sync::Arc;
use truing::manifold::{Point3, Pose, Pose3, Vector};
use truing::nalgebra::{Matrix3, SMatrix, Vector3};
use truing::{Constraint, Jacobian, Point, Scalar, Views};
use truing_robot::Error;
use truing_robot::kinds::pose_of;
use truing_robot::measurement::Equations;
use truing_robot::robot::Chain;
use truing_robot::robot::chain::{reference_or_regressor, regressor_at, write_block, write_tip};

/// The position error of the tool in frame −1: r = P(q) − S · measured \[m\], the upper half of Δy.
///
/// Variables: robot parameters, the sensor's pose S, the target in the tool frame. Three rows.
#[derive(Clone)]
pub struct ClassicalPosition {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values.
    pub q: Vec<f64>,
    /// What the sensor read \[m\].
    pub measured: Vector3<f64>,
}

impl Constraint for ClassicalPosition {
    type Vars = (Vector, Pose3, Point3);
    const DIM: usize = 3;

    fn residual<T: Scalar>(&self, (robot, sensor, target): Views<'_, Self, T>, r: &mut [T]) {
        let off =
            self.chain.tip(robot, &self.q, &target) - sensor.apply(&self.measured.map(T::from));
        r.copy_from_slice(off.as_slice());
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, sensor, target) = at.views();
        let regressor = regressor_at(at, source, &self.chain, parameters, &self.q);
        let tip = regressor.tool.apply(&target);
        r.copy_from_slice((tip - sensor.apply(&self.measured)).as_slice());
        write_tip(j, 0, 2, regressor, &tip, &Matrix3::identity());
        write_block(j, 1, &moved_reading(&sensor, &self.measured));
    }
}

/// −∂(S · measured)/∂(tangent of S): −1 for the translation, R_S · measured× for the rotation.
fn moved_reading(sensor: &Pose<f64>, measured: &Vector3<f64>) -> SMatrix<f64, 3, 6> {
    let mut columns = SMatrix::<f64, 3, 6>::zeros();
    columns
        .fixed_columns_mut::<3>(0)
        .copy_from(&-Matrix3::identity());
    columns
        .fixed_columns_mut::<3>(3)
        .copy_from(&(sensor.rotation * measured.cross_matrix()));
    columns
}

/// The orientation error ½ Σ aₖ × bₖ over the axes of two frames: the vector that turns the first
/// into the second, to first order in the angle between them.
pub(crate) fn orientation_error<T: Scalar>(from: &Matrix3<T>, to: &Matrix3<T>) -> Vector3<T> {
    let half = T::from(0.5);
    let mut sum = Vector3::new(T::zero(), T::zero(), T::zero());
    for k in 0..3 {
        let (a, b) = (from.column(k), to.column(k));
        sum += Vector3::new(
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        );
    }
    sum * half
}

/// The derivative of [`orientation_error`] by a turn of `to`: ½ (tr(M) 1 − M) with M = to · fromᵀ,
/// the identity where the two agree.
pub(crate) fn orientation_error_by_turn(from: &Matrix3<f64>, to: &Matrix3<f64>) -> Matrix3<f64> {
    let m = to * from.transpose();
    (Matrix3::identity() * m.trace() - m) * 0.5
}

/// The pose error of the tool in frame −1, Δy of equation (2): position rows P(q) − S · measured
/// \[m\], rotation rows the orientation error ½ Σ aₖ × bₖ from the measured axes to the tool's \[rad\].
///
/// Variables: robot parameters, the sensor's pose S, the target in the tool frame. Six rows.
#[derive(Clone)]
pub struct ClassicalPose {
    /// The robot.
    pub chain: Arc<Chain>,
    /// Joint values.
    pub q: Vec<f64>,
    /// What the sensor read: sensor_from_tool.
    pub measured: Pose<f64>,
}

impl Constraint for ClassicalPose {
    type Vars = (Vector, Pose3, Point3);
    const DIM: usize = 6;

    fn residual<T: Scalar>(&self, (robot, sensor, target): Views<'_, Self, T>, r: &mut [T]) {
        let tool = self.chain.robot.forward(robot, &self.q);
        let off = tool.apply(&target) - sensor.apply(&self.measured.translation.map(T::from));
        let measured = sensor.rotation * self.measured.rotation.map(T::from);
        let turn = orientation_error(&measured, &tool.rotation);
        for i in 0..3 {
            r[i] = off[i];
            r[i + 3] = turn[i];
        }
    }

    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        let Some(source) = reference_or_regressor(self, &self.chain, at, r, j) else {
            return;
        };
        let (parameters, sensor, target) = at.views();
        let regressor = regressor_at(at, source, &self.chain, parameters, &self.q);
        let tip = regressor.tool.apply(&target);
        let reading = &self.measured.translation;
        let measured = sensor.rotation * self.measured.rotation;
        let by_turn = orientation_error_by_turn(&measured, &regressor.tool.rotation);
        r[..3].copy_from_slice((tip - sensor.apply(reading)).as_slice());
        r[3..].copy_from_slice(orientation_error(&measured, &regressor.tool.rotation).as_slice());
        for (column, twist) in j.block_mut(0).chunks_exact_mut(6).zip(&regressor.twists) {
            column[..3].copy_from_slice(twist.at(&tip).as_slice());
            column[3..].copy_from_slice((by_turn * twist.angular).as_slice());
        }
        let mut by_sensor = SMatrix::<f64, 6, 6>::zeros();
        by_sensor
            .fixed_rows_mut::<3>(0)
            .copy_from(&moved_reading(&sensor, reading));
        // The sensor turns about its own axes; the measured axes turn with it, against the tool's.
        by_sensor
            .fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&-(by_turn.transpose() * sensor.rotation));
        write_block(j, 1, &by_sensor);
        let mut by_target = SMatrix::<f64, 6, 3>::zeros();
        by_target
            .fixed_rows_mut::<3>(0)
            .copy_from(&regressor.tool.rotation);
        write_block(j, 2, &by_target);
    }
}

pub(crate) fn add_positions(on: &mut Equations<'_>) -> Result<(), Error> {
    on.add(|on, row| {
        let tool = &on.tools[0];
        let constraint = ClassicalPosition {
            chain: tool.chain.clone(),
            q: on.q(0, row),
            measured: Vector3::from_column_slice(on.values(row)),
        };
        ((tool.robot, on.sensor, tool.point()), constraint)
    })
}

pub(crate) fn add_poses(on: &mut Equations<'_>) -> Result<(), Error> {
    on.add(|on, row| {
        let tool = &on.tools[0];
        let constraint = ClassicalPose {
            chain: tool.chain.clone(),
            q: on.q(0, row),
            measured: pose_of(on.values(row)),
        };
        ((tool.robot, on.sensor, tool.point()), constraint)
    })
}
