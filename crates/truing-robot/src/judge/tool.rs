//! How sure the pose of a calibrated tool is.

use super::uncertainty::Uncertainty;
use crate::error::Error;
use crate::robot::{DifferentiateChain, FrameWise, Regressor};
use crate::unknown::Key;
use truing::manifold::Pose;
use truing::nalgebra::{DMatrix, Matrix6, Vector3};

/// The pose of a calibrated tool, with its covariance.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolPose {
    /// The pose: in the reference frame, or in a sensor's.
    pub pose: Pose<f64>,
    /// Covariance (6 × 6) of position \[m\] and rotation \[rad\], both along the axes of the frame that
    /// the pose is in: the true pose is at p + δp, turned from the estimated one by the small rotation
    /// vector δθ.
    pub covariance: Matrix6<f64>,
}

/// A tool pose and how it moves.
pub(super) struct ToolMotion {
    pub pose: Pose<f64>,
    /// Columns of the assembly: the robot's, the tool point's, the sensor frame's.
    pub columns: Vec<usize>,
    /// Derivatives of position and rotation by them (6 × columns).
    pub derivatives: DMatrix<f64>,
}

impl ToolPose {
    /// RMS length of the position's error \[m\]: the square root of the sum of its three variances.
    pub fn position_sigma(&self) -> f64 {
        self.covariance
            .fixed_view::<3, 3>(0, 0)
            .trace()
            .max(0.0)
            .sqrt()
    }

    /// RMS angle of the rotation's error \[rad\].
    pub fn rotation_sigma(&self) -> f64 {
        self.covariance
            .fixed_view::<3, 3>(3, 3)
            .trace()
            .max(0.0)
            .sqrt()
    }
}

impl Uncertainty {
    /// The pose of a robot's tool at the joint values `q`, in the units of the joints, with its
    /// covariance G Σ Gᵀ σ₀².
    ///
    /// With a `target` it is that tool point's position, with the tool's rotation; with a `frame` the
    /// pose is seen from that sensor, whose own uncertainty is then in it, together with how it goes
    /// along with the robot's. Without, it is in the reference frame of the robot files.
    ///
    /// What is not estimated is not in it. A base that planes, points or a sensor's frame have taken
    /// over is held where the file has it, so the reference frame means *that* base, not the room; a
    /// rotation of the tool that positions cannot see is as sure as its file. In the frame of the
    /// sensor that measured, all that matters was estimated, and what was held makes no difference.
    ///
    /// # Errors
    /// If there is no such robot, tool point or sensor frame, or not one number a joint.
    pub fn tool_pose(
        &self,
        robot: usize,
        q: &[f64],
        target: Option<&str>,
        frame: Option<&str>,
    ) -> Result<ToolPose, Error> {
        let motion = self.tool_motion(robot, q, target, frame)?;
        let covariance = self
            .covariance
            .propagate(&motion.columns, &motion.derivatives)
            * self.factor().powi(2);
        Ok(ToolPose {
            pose: motion.pose,
            covariance: covariance.fixed_view::<6, 6>(0, 0).into_owned(),
        })
    }

    /// The same with its derivatives by all columns of the robot, the tool point and the frame.
    pub(super) fn tool_motion(
        &self,
        robot: usize,
        q: &[f64],
        target: Option<&str>,
        frame: Option<&str>,
    ) -> Result<ToolMotion, Error> {
        let Some((chain, parameters, first)) = self.robots.get(robot) else {
            return Err(Error::calibration(
                format!("there is no robot number {robot}, of {}", self.robots.len()),
                "robots are numbered from 0, in the order of the calibration",
            ));
        };
        if q.len() < chain.given() {
            return Err(Error::calibration(
                format!(
                    "found {} joint values for the {} joints of {}",
                    q.len(),
                    chain.given(),
                    chain.name()
                ),
                "give one number for each joint",
            ));
        }
        let unknown = |what: &str, name: &str, known: Vec<String>| {
            Error::calibration(
                format!("there is no {what} `{name}` in this calibration; there are {known:?}"),
                "name one that its constraints have",
            )
        };
        let mut regressor = Regressor::default();
        FrameWise.regressor(chain, parameters, q, &mut regressor);
        let mut pose = regressor.tool;
        let mut columns: Vec<usize> = (0..regressor.twists.len()).map(|k| first + k).collect();
        // Derivatives of the position and of the rotation by each column.
        let mut derivatives: Vec<[Vector3<f64>; 2]> = Vec::new();
        let point_column = match target {
            Some(name) => {
                let column = self.columns.get(&Key::Target(robot, name.to_owned()));
                let names = || {
                    let own = |key: &Key| match key {
                        Key::Target(r, name) if *r == robot => Some(name.clone()),
                        _ => None,
                    };
                    self.columns.keys().filter_map(own).collect()
                };
                let column = column.ok_or_else(|| unknown("tool point", name, names()))?;
                let point = self.state.target(robot, name).unwrap_or_default();
                pose.translation = regressor.tool.apply(&point);
                Some(column.start)
            }
            None => None,
        };
        let tip = pose.translation;
        derivatives.extend(regressor.twists.iter().map(|t| [t.at(&tip), t.angular]));
        if let Some(column) = point_column {
            columns.extend(column..column + 3);
            let axis = |k: usize| [pose.rotation.column(k).into_owned(), Vector3::zeros()];
            derivatives.extend((0..3).map(axis));
        }
        if let Some(name) = frame {
            let names = || {
                let own = |key: &Key| match key {
                    Key::Frame(name) => Some(name.clone()),
                    _ => None,
                };
                self.columns.keys().filter_map(own).collect()
            };
            let column = self.columns.get(&Key::Frame(name.to_owned()));
            let (Some(column), Some(sensor)) = (column, self.state.frame(name)) else {
                return Err(unknown("sensor frame", name, names()));
            };
            let column = column.start;
            // Seen from F = (R, t) the pose is F⁻¹ T. F moves by t + δt and R exp(ω), so p′ = Rᵀ(p − t)
            // moves by −Rᵀδt + p′ × ω, and the rotation by −ω.
            let back = sensor.rotation.transpose();
            pose = sensor.inverse().compose(&pose);
            for pair in &mut derivatives {
                *pair = pair.map(|v| back * v);
            }
            columns.extend(column..column + 6);
            let along = |k: usize| [-back.column(k).into_owned(), Vector3::zeros()];
            derivatives.extend((0..3).map(along));
            let about = |k: usize| {
                let axis = Vector3::ith(k, 1.0);
                [pose.translation.cross(&axis), -axis]
            };
            derivatives.extend((0..3).map(about));
        }
        let derivatives =
            DMatrix::from_fn(6, columns.len(), |row, k| derivatives[k][row / 3][row % 3]);
        Ok(ToolMotion {
            pose,
            columns,
            derivatives,
        })
    }
}
