//! Postures that satisfy a geometric condition exactly, found by damped Newton steps on the joints.

use super::joint_kind::JointKind;
use super::regressor::{DifferentiateChain, FrameWise, Regressor};
use super::serial::Robot;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use truing::nalgebra::{DMatrix, DVector, Vector3};

/// Residual below which a condition holds \[m\].
pub const EXACT: f64 = 1e-12;

/// A robot as it is posed: its parameters and the tool point that has to be somewhere.
#[derive(Clone, Copy)]
pub struct Posed<'a> {
    /// The robot.
    pub robot: &'a Robot,
    /// Its parameters.
    pub parameters: &'a [f64],
    /// The tool point in the tool frame \[m\].
    pub target: Vector3<f64>,
}

impl Posed<'_> {
    /// The tool point in the reference frame, and how it moves with each joint (3 × joints).
    pub fn tip(&self, q: &[f64], regressor: &mut Regressor) -> (Vector3<f64>, DMatrix<f64>) {
        let slopes = self.robot.slopes(self.parameters, q);
        FrameWise.regressor(self.robot, self.parameters, q, regressor);
        let tip = regressor.tool.apply(&self.target);
        let readings = self.robot.joints().len();
        let columns: Vec<Vector3<f64>> = (0..readings)
            .map(|k| regressor.joint_velocity(self.robot, &slopes, k, &tip))
            .collect();
        // Further columns are what they are: no step moves them.
        let entry = |i: usize, k: usize| columns.get(k).map_or(0.0, |column| column[i]);
        (tip, DMatrix::from_fn(3, q.len(), entry))
    }

    /// How the tool turns with each number of a row (3 × numbers), after [`tip`](Self::tip).
    pub fn turns(&self, q: &[f64], regressor: &Regressor) -> DMatrix<f64> {
        let slopes = self.robot.slopes(self.parameters, q);
        let readings = self.robot.joints().len();
        let columns: Vec<Vector3<f64>> = (0..readings)
            .map(|k| regressor.joint_turn(self.robot, &slopes, k))
            .collect();
        let entry = |i: usize, k: usize| columns.get(k).map_or(0.0, |column| column[i]);
        DMatrix::from_fn(3, q.len(), entry)
    }
}

/// The range in which each number of a row may be: a joint's limits, or a full turn (a metre either way if it
/// slides), then those of further columns.
pub fn limits(robot: &Robot) -> Vec<[f64; 2]> {
    let joints = robot.joints().iter().map(|joint| {
        joint.limits.unwrap_or(match joint.kind {
            JointKind::Prismatic => [-1.0, 1.0],
            _ => [-std::f64::consts::PI, std::f64::consts::PI],
        })
    });
    let columns = robot.columns().iter().map(|column| column.range);
    joints.chain(columns).collect()
}

/// A posture drawn uniformly between limits.
pub fn random(limits: &[[f64; 2]], rng: &mut impl Rng) -> Vec<f64> {
    limits
        .iter()
        .map(|[lower, upper]| lower + (upper - lower) * rng.random::<f64>())
        .collect()
}

/// How far the tool reaches, about \[m\]: 4/3 of the RMS distance of random postures' tool points from their middle.
pub fn reach(robot: &Robot) -> f64 {
    const POSTURES: usize = 100;
    let reach = 4.0 / 3.0 * spread(robot, &robot.nominal(), POSTURES, 0);
    if reach > 0.0 { reach } else { 1.0 }
}

/// The size of a robot's workspace: RMS distance of the tool from its mean over `count` random postures
/// \[m\]; the same seed draws the same postures.
pub fn spread(robot: &Robot, parameters: &[f64], count: usize, seed: u64) -> f64 {
    let limits = limits(robot);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let tips: Vec<Vector3<f64>> = (0..count)
        .map(|_| {
            let q = random(&limits, &mut rng);
            robot.forward(parameters, &q).translation
        })
        .collect();
    let mean = tips.iter().sum::<Vector3<f64>>() / count as f64;
    let squares: f64 = tips.iter().map(|tip| (tip - mean).norm_squared()).sum();
    (squares / count as f64).sqrt()
}

/// A posture well inside the joint limits and away from singular ones, so that a location near the
/// tool's can be reached too; the best of the draws if none is.
pub fn dexterous(robot: &Robot, parameters: &[f64], rng: &mut impl Rng) -> Vec<f64> {
    const DRAWS: usize = 100;
    const ENOUGH: f64 = 0.1;
    let inner: Vec<[f64; 2]> = limits(robot)
        .into_iter()
        .map(|[l, u]| [0.85 * l + 0.15 * u, 0.15 * l + 0.85 * u])
        .collect();
    let mut best = (f64::NEG_INFINITY, Vec::new());
    let mut regressor = Regressor::default();
    for _ in 0..DRAWS {
        let q = random(&inner, rng);
        let slopes = robot.slopes(parameters, &q);
        FrameWise.regressor(robot, parameters, &q, &mut regressor);
        let tip = regressor.tool.translation;
        let jacobian = DMatrix::from_fn(6, robot.joints().len(), |row, joint| {
            if row < 3 {
                regressor.joint_velocity(robot, &slopes, joint, &tip)[row]
            } else {
                regressor.joint_turn(robot, &slopes, joint)[row - 3]
            }
        });
        let smallest = jacobian.singular_values().min();
        if smallest > best.0 {
            best = (smallest, q);
        }
        if best.0 > ENOUGH {
            break;
        }
    }
    best.1
}

/// Moves `q` by damped minimum-norm Newton steps inside `limits` until every row of `condition` is
/// below [`EXACT`]; `None` if that fails.
///
/// `condition` returns the residual rows \[m\] and their Jacobian (rows × joints).
pub fn satisfy(
    mut q: Vec<f64>,
    limits: &[[f64; 2]],
    mut condition: impl FnMut(&[f64]) -> (DVector<f64>, DMatrix<f64>),
) -> Option<Vec<f64>> {
    const STEPS: usize = 60;
    const LONGEST: f64 = 0.4;
    let mut damping = 1e-3;
    let (mut r, mut j) = condition(&q);
    for _ in 0..STEPS {
        if r.amax() < EXACT {
            return Some(q);
        }
        // Joints at a limit that the step would push further are left out.
        let mut active = vec![false; q.len()];
        let mut step;
        loop {
            let mut free = j.clone();
            for (k, active) in active.iter().enumerate() {
                if *active {
                    free.column_mut(k).fill(0.0);
                }
            }
            let square = &free * free.transpose();
            let size = square.diagonal().max().max(1e-9);
            let damped = square + DMatrix::identity(r.len(), r.len()) * (damping * size);
            step = -(free.transpose() * damped.cholesky()?.solve(&r));
            let pushed = (0..q.len()).find(|k| {
                let [lower, upper] = limits[*k];
                !active[*k]
                    && ((q[*k] <= lower && step[*k] < 0.0) || (q[*k] >= upper && step[*k] > 0.0))
            });
            match pushed {
                Some(k) => active[k] = true,
                None => break,
            }
        }
        let scale = (LONGEST / step.amax().max(LONGEST)).min(1.0);
        let trial: Vec<f64> = q
            .iter()
            .zip(step.iter())
            .zip(limits)
            .map(|((q, step), [lower, upper])| (q + scale * step).clamp(*lower, *upper))
            .collect();
        let (trial_r, trial_j) = condition(&trial);
        if trial_r.norm() < r.norm() {
            (q, r, j) = (trial, trial_r, trial_j);
            damping = (damping * 0.1).max(1e-16);
        } else {
            damping *= 10.0;
            if damping > 1e3 {
                return None;
            }
        }
    }
    (r.amax() < EXACT).then_some(q)
}
