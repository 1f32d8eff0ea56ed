//! How well a calibrated robot can be expected to predict its tool, from the covariance alone.

use super::errors::Fitted;
use super::uncertainty::Uncertainty;
use crate::estimate::Job;
use crate::identify::Choice;
use crate::measurement::MeasurementSet;
use crate::measurement::fit::rigid_registration;
use crate::model::{Assembly, Owner};
use crate::robot::{DifferentiateChain, FrameWise, Regressor};
use truing::nalgebra::{DMatrix, Vector3};

/// The tool of one robot where it was measured, up to a rigid motion of every set of measurements
/// (and the scale, if that is free).
pub(crate) struct Prediction {
    /// The robot.
    pub robot: usize,
    /// RMS standard deviation of the tool point \[m\].
    pub sigma: f64,
    /// RMS distance between the tool points of the calibrated and of the nominal robot \[m\].
    pub change: f64,
    /// RMS noise of what was measured \[m\].
    pub noise: f64,
}

/// Tool points of a robot in one set: of the estimated robot, of the nominal one, the derivatives of
/// the first by some columns (3 × points, columns), and by the tool point if that is estimated too
/// (3 × points, 3).
struct Tips {
    estimated: Vec<Vector3<f64>>,
    nominal: Vec<Vector3<f64>>,
    derivatives: DMatrix<f64>,
    by_point: Option<DMatrix<f64>>,
}

impl Job {
    /// The expected error of the calibrated robots beside what the calibration changed, one entry for
    /// each robot that has estimated parameters.
    ///
    /// With G the derivatives of all tool points by the estimated columns, C their covariance and P
    /// the projection that takes rigid motions (and scale, and moves of the tool point) out, σ² = trace(P G C Gᵀ P) / points.
    /// Each set has its own motion: where its sensor and its tool point are says nothing of the robot.
    pub fn predictions(
        &self,
        fitted: &Fitted,
        assembly: &Assembly,
        choices: &[Choice],
        uncertainty: &Uncertainty,
    ) -> Vec<Prediction> {
        let scaled = choices.iter().any(|c| matches!(c, Choice::Anchor(_)));
        let sigma0 = uncertainty.factor();
        let mut predictions = Vec::new();
        for robot in 0..self.arms.len() {
            let own = |c: &usize| match &assembly.columns[*c].owner {
                Owner::Parameter { robot: r, .. } => *r == robot,
                _ => false,
            };
            let columns: Vec<usize> = (0..choices.len())
                .filter(|c| choices[*c] == Choice::Estimated)
                .filter(own)
                .collect();
            if columns.is_empty() {
                continue;
            }
            let c = DMatrix::from_fn(columns.len(), columns.len(), |i, k| {
                uncertainty.covariance.entry(columns[i], columns[k])
            });
            let (mut variance, mut change, mut noise, mut points) = (0.0, 0.0, 0.0, 0.0);
            for set in &self.sets {
                for tips in self.tool_points(robot, set, fitted, assembly, &columns) {
                    let generators = motions(&tips, scaled);
                    let g = without(&generators, &tips.derivatives);
                    variance += (&g * &c).component_mul(&g).sum();
                    // Registered first: what is left is small enough for the projection.
                    let motion = rigid_registration(&tips.nominal, &tips.estimated);
                    let pairs = tips.nominal.iter().zip(&tips.estimated);
                    let moved: Vec<f64> = pairs
                        .flat_map(|(n, t)| {
                            let moved = t - motion.apply(n);
                            [moved.x, moved.y, moved.z]
                        })
                        .collect();
                    let moved = DMatrix::from_vec(moved.len(), 1, moved);
                    change += without(&generators, &moved).norm_squared();
                    points += tips.estimated.len() as f64;
                    let sigmas = (0..set.len()).filter_map(|row| set.length_sigma(row));
                    noise += sigmas.map(|s| s * s).sum::<f64>();
                }
            }
            if points > 0.0 {
                predictions.push(Prediction {
                    robot,
                    sigma: (variance.max(0.0) / points).sqrt() * sigma0,
                    change: (change / points).sqrt(),
                    noise: (noise / points).sqrt() * sigma0,
                });
            }
        }
        predictions
    }

    /// The tool points of a robot in a set: one group, or two where it takes two postures.
    fn tool_points(
        &self,
        robot: usize,
        set: &MeasurementSet,
        fitted: &Fitted,
        assembly: &Assembly,
        columns: &[usize],
    ) -> Vec<Tips> {
        let chain = &self.arms[robot].robot;
        let (estimated, nominal) = (&fitted.estimated, &fitted.nominal);
        let mut groups = Vec::new();
        let mut regressor = Regressor::default();
        for (postures, target) in postures(set, robot) {
            if postures.len() < 3 {
                continue;
            }
            // The point on the tool is that of the estimate for both robots.
            let point = target
                .and_then(|name| estimated.target(robot, name))
                .unwrap_or_default();
            let (mut tips, mut before, mut rows) = (Vec::new(), Vec::new(), Vec::new());
            let mut turns = Vec::new();
            for q in postures.iter().step_by(postures.len().div_ceil(ENOUGH)) {
                FrameWise.regressor(chain, &estimated.robots[robot], q, &mut regressor);
                let tip = regressor.tool.apply(&point);
                rows.extend(
                    columns
                        .iter()
                        .map(|column| match &assembly.columns[*column].owner {
                            Owner::Parameter { parameter, .. } => {
                                regressor.twists[*parameter].at(&tip)
                            }
                            _ => Vector3::zeros(),
                        }),
                );
                tips.push(tip);
                turns.push(regressor.tool.rotation);
                before.push(chain.forward(&nominal.robots[robot], q).apply(&point));
            }
            let derivatives = DMatrix::from_fn(3 * tips.len(), columns.len(), |row, column| {
                rows[row / 3 * columns.len() + column][row % 3]
            });
            let by_point = target.is_some().then(|| {
                DMatrix::from_fn(3 * tips.len(), 3, |row, axis| {
                    turns[row / 3][(row % 3, axis)]
                })
            });
            groups.push(Tips {
                estimated: tips,
                nominal: before,
                derivatives,
                by_point,
            });
        }
        groups
    }
}

/// The postures of a robot in a set, with the name of the tool point.
fn postures(set: &MeasurementSet, robot: usize) -> Vec<(&[Vec<f64>], Option<&String>)> {
    let own = set.tools.iter().filter(|tool| tool.robot == robot);
    own.map(|tool| (&tool.q[..], tool.target.as_ref()))
        .collect()
}

/// So many postures of a set tell how well a tool is known.
const ENOUGH: usize = 1000;

/// Velocities of tool points in the rigid motions of space, in its growth if asked for, and in moves
/// of the point on the tool if that is estimated; one column a motion.
fn motions(tips: &Tips, scaled: bool) -> DMatrix<f64> {
    let points = &tips.estimated;
    let center = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    let of_space = if scaled { 7 } else { 6 };
    let count = of_space + tips.by_point.as_ref().map_or(0, DMatrix::ncols);
    DMatrix::from_fn(3 * points.len(), count, |row, motion| {
        if let (Some(axis), Some(by_point)) = (motion.checked_sub(of_space), &tips.by_point) {
            return by_point[(row, axis)];
        }
        let p = points[row / 3] - center;
        let velocity = match motion {
            0..3 => Vector3::ith(motion, 1.0),
            3..6 => Vector3::ith(motion - 3, 1.0).cross(&p),
            _ => p,
        };
        velocity[row % 3]
    })
}

/// What is left of columns after projection onto others.
fn without(others: &DMatrix<f64>, columns: &DMatrix<f64>) -> DMatrix<f64> {
    let svd = others.clone().svd(true, false);
    let Some(u) = svd.u else {
        return columns.clone();
    };
    let largest = svd.singular_values.max();
    let mut left = columns.clone();
    for (k, value) in svd.singular_values.iter().enumerate() {
        if *value > 1e-9 * largest {
            let direction = u.column(k);
            let along = direction.transpose() * &left;
            left -= direction * along;
        }
    }
    left
}
