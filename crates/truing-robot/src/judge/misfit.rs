//! Residuals that are larger than the noise: what they go with.

use super::statistics::LEVEL;
use super::uncertainty::Judged;
use crate::doubt::{Cause, Doubt};
use crate::estimate::Job;
use crate::measurement::MeasurementSet;
use crate::robot::JointKind;
use truing::nalgebra::{DMatrix, DVector};
use truing::statistics::ChiSquareTest;

/// So many measurements for every number of a regression, at least.
const EACH: usize = 4;

/// Something that residuals may go with: a name, a joint, and functions of every row.
struct Candidate {
    what: &'static str,
    joint: Option<usize>,
    columns: Vec<Vec<f64>>,
}

impl Job {
    /// Says that residuals are larger than the stated noise, and what they go with: the number of the row (a drift), or
    /// the sine and cosine of a joint's angle and of its double. A regression of the whitened residuals of a set on each
    /// is beyond chance at the level of 5 % over all that are tried (Bonferroni).
    pub fn doubt_misfit(&self, judged: &Judged, doubts: &mut Vec<Doubt>) {
        let Some(test) = judged.misfit() else {
            return;
        };
        let problem = &judged.assembly.problem;
        let mut found = Vec::new();
        let mut tried = 0;
        for (k, (set, block)) in self.sets.iter().zip(problem.blocks()).enumerate() {
            let rows = problem.block_rows(k);
            if block.len() != set.len() {
                continue;
            }
            let r = &judged.whitened[rows];
            for candidate in self.candidates(set) {
                if set.len() < EACH * (candidate.columns.len() + 1) {
                    continue;
                }
                tried += 1;
                if let Some((share, p_value)) = regressed(&candidate.columns, r, block.dim()) {
                    found.push((set, candidate.what, candidate.joint, share, p_value));
                }
            }
        }
        let mut causes: Vec<Cause> = found
            .into_iter()
            .map(|(set, what, joint, share, p_value)| {
                let arm = &self.arms[set.tool().robot];
                Cause {
                    set: set.name.clone(),
                    what,
                    joint: joint.map(|joint| arm.prefixed(&arm.robot.joints()[joint].name)),
                    share,
                    p_value: (p_value * f64::from(tried)).min(1.0),
                }
            })
            .filter(|cause| cause.p_value < LEVEL)
            .collect();
        causes.sort_by(|a, b| b.share.total_cmp(&a.share));
        doubts.push(Doubt::Misfit {
            sigma0: judged.uncertainty.sigma0,
            p_value: test.p_too_large,
            causes,
        });
    }

    fn candidates(&self, set: &MeasurementSet) -> Vec<Candidate> {
        let n = set.len();
        let drift = (0..n).map(|row| row as f64 / n as f64 - 0.5).collect();
        let mut all = vec![Candidate {
            what: "drift",
            joint: None,
            columns: vec![drift],
        }];
        let joints = self.arms[set.tool().robot]
            .robot
            .joints()
            .iter()
            .enumerate();
        for (joint, _) in joints.filter(|(_, joint)| joint.kind == JointKind::Revolute) {
            let of = |f: fn(f64) -> f64| set.q().iter().map(|q| f(q[joint])).collect();
            all.push(Candidate {
                what: "harmonic",
                joint: Some(joint),
                columns: vec![
                    of(f64::sin),
                    of(f64::cos),
                    of(|q| (2.0 * q).sin()),
                    of(|q| (2.0 * q).cos()),
                ],
            });
        }
        all
    }
}

/// The share of the squared residuals that columns and a constant explain beyond the constant, every coordinate on its
/// own, and the probability of that by chance; none where the columns are constant.
fn regressed(columns: &[Vec<f64>], r: &[f64], dim: usize) -> Option<(f64, f64)> {
    let n = r.len() / dim;
    let centred = |of: &dyn Fn(usize) -> f64| {
        let mean = (0..n).map(of).sum::<f64>() / n as f64;
        DVector::from_fn(n, |row, _| of(row) - mean)
    };
    let a: Vec<DVector<f64>> = columns.iter().map(|c| centred(&|row| c[row])).collect();
    let a = DMatrix::from_columns(&a);
    let svd = a.svd(true, false);
    let u = svd.u?;
    let largest = svd.singular_values.max();
    let kept: Vec<usize> = (0..u.ncols())
        .filter(|k| svd.singular_values[*k] > 1e-6 * largest && largest > 1e-6)
        .collect();
    let (mut explained, mut all) = (0.0, 0.0);
    for coordinate in 0..dim {
        let y = centred(&|row| r[row * dim + coordinate]);
        all += y.norm_squared();
        explained += kept
            .iter()
            .map(|k| u.column(*k).dot(&y).powi(2))
            .sum::<f64>();
    }
    let left = (all - explained) / ((n - 1 - kept.len()) * dim) as f64;
    let test = ChiSquareTest::new(explained / left, (kept.len() * dim) as f64)?;
    (!kept.is_empty() && left > 0.0).then_some((explained / all, test.p_too_large))
}
