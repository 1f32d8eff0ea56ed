//! How sure an estimate is: σ₀ from the measurements, priors as they are, robust losses, bounds.

use crate::error::Error;
use crate::estimate::Job;
use crate::identify::Choice;
use crate::measurement::MeasurementSet;
use crate::model::{Assembly, Owner};
use crate::robot::Robot;
use crate::unknown::{Key, State};
use std::collections::BTreeMap;
use std::ops::Range;
use truing::statistics::{Influence, Residuals, Scale, huber_sigma0};
use truing::{Covariance, LeastSquares};

/// How sure everything is that a calibration estimated: standard deviations, covariances, and
/// [`tool_pose`](Self::tool_pose).
#[derive(Debug, Clone)]
pub struct Uncertainty {
    /// Covariance of the estimated columns that are not at a bound, in units of σ₀².
    pub covariance: Covariance,
    /// A-posteriori standard deviation of unit weight, of the measurements alone; NaN without
    /// redundancy.
    pub sigma0: f64,
    /// Rows of measurements less the unknowns, of which priors take the shares that they determine.
    pub degrees_of_freedom: f64,
    /// The robots as estimated, with their parameters and the first column of each.
    pub(super) robots: Vec<(Robot, Vec<f64>, usize)>,
    /// Columns of sensor frames, tool points and what else was estimated.
    pub(super) columns: BTreeMap<Key, Range<usize>>,
    pub(super) state: State,
}

/// The uncertainty, with what else is to be said of the measurements that it is from.
pub(crate) struct Judged {
    pub uncertainty: Uncertainty,
    /// The problem that was judged: no losses, only what is free in it.
    pub assembly: Assembly,
    /// Residuals of the measurements, set after set, then of priors.
    pub residuals: Residuals,
    /// Whitened residuals, row by row.
    pub whitened: Vec<f64>,
    /// ‖r‖² of the measurements, whitened.
    pub squares: f64,
}

impl Uncertainty {
    /// Standard deviation of a column of the assembly; zero if it is not estimated.
    pub fn std_dev(&self, column: usize) -> f64 {
        self.covariance.std_dev(column) * self.sigma0
    }

    /// σ₀, or 1 where nothing is left to estimate it from: the noise is then believed.
    pub fn factor(&self) -> f64 {
        if self.sigma0.is_finite() {
            self.sigma0
        } else {
            1.0
        }
    }
}

impl Job {
    /// The uncertainty of the estimated columns at a state.
    ///
    /// Measurements are known up to a factor: their covariance is scaled by σ₀². Priors are not, so
    /// (JₘᵀJₘ/σ₀² + JₚᵀJₚ)⁻¹ = σ₀² (JₘᵀJₘ + σ₀² JₚᵀJₚ)⁻¹. Degrees of freedom are the rows less the
    /// unknowns, of which a prior takes the share that it determines. Under a robust loss σ₀ is
    /// [Huber's factor](huber_sigma0), with J unweighted; residuals are then compared with their
    /// median, which outliers do not move. Parameters at a bound do not move.
    pub fn uncertainty(&self, state: &State, choices: &[Choice]) -> Result<Judged, Error> {
        let plain: Vec<MeasurementSet> = self.sets.iter().map(MeasurementSet::unweighted).collect();
        let (mut assembly, shares) = self.assembled(&plain, state, choices, 1.0)?;
        let mut covariance = Covariance::at(&assembly.problem, assembly.problem.initial())?;
        let by_priors: f64 = shares
            .iter()
            .map(|(column, sigma)| (covariance.std_dev(*column) / sigma).powi(2))
            .sum();
        let unknowns = assembly.problem.free().len() as f64 - by_priors;

        let mut r = vec![0.0; assembly.problem.rows()];
        let problem = &assembly.problem;
        problem.residual(problem.initial(), &mut r);
        let mut influences = Vec::new();
        for (k, (set, block)) in self.sets.iter().zip(problem.blocks()).enumerate() {
            let measurements = r[problem.block_rows(k)].chunks_exact(block.dim());
            influences.extend(measurements.map(|r| Influence::of(&set.loss, r)));
        }
        let rows: usize = influences.iter().map(|influence| influence.rows).sum();
        let measured = &r[..rows];
        let squares = measured.iter().map(|r| r * r).sum();
        let degrees_of_freedom = rows as f64 - unknowns;
        let sigma0 = huber_sigma0(influences, unknowns);
        let scale = if self.is_robust() {
            Scale::robust(measured)
        } else {
            Scale::Estimated {
                sigma0,
                degrees_of_freedom,
            }
        };
        if !shares.is_empty() && sigma0.is_finite() && sigma0 != 0.0 {
            (assembly, _) = self.assembled(&plain, state, choices, 1.0 / sigma0)?;
            covariance = Covariance::at(&assembly.problem, assembly.problem.initial())?;
        }
        let problem = &assembly.problem;
        let residuals = Residuals::with_scale(problem, problem.initial(), &covariance, scale);
        let robots = self.arms.iter().zip(&state.robots).enumerate();
        let columns = state.iter().filter_map(|(key, _)| {
            let var = assembly.unknown(key)?;
            Some((key.clone(), var.columns()))
        });
        let uncertainty = Uncertainty {
            covariance,
            sigma0,
            degrees_of_freedom,
            robots: robots
                .map(|(r, (arm, values))| {
                    let first = assembly.robot(r).column();
                    (arm.robot.clone(), values.clone(), first)
                })
                .collect(),
            columns: columns.collect(),
            state: state.clone(),
        };
        Ok(Judged {
            uncertainty,
            assembly,
            residuals,
            whitened: r,
            squares,
        })
    }

    /// The problem at a state with the estimated columns free that are not at a bound, and priors
    /// with their standard deviations times `scale`, which come back as (column, standard deviation).
    fn assembled(
        &self,
        sets: &[MeasurementSet],
        state: &State,
        choices: &[Choice],
        scale: f64,
    ) -> Result<(Assembly, Vec<(usize, f64)>), Error> {
        let mut assembly = Assembly::new(&self.arms, sets, state, &self.estimate.derivatives)?;
        let free: Vec<usize> = (0..choices.len())
            .filter(|c| choices[*c] == Choice::Estimated)
            .filter(|c| match assembly.columns[*c].owner {
                Owner::Parameter { robot, parameter } => self
                    .at_bound(robot, parameter, state.robots[robot][parameter])
                    .is_none(),
                _ => true,
            })
            .collect();
        assembly.free_only(&free);
        let mut shares = Vec::new();
        for (robot, parameter, sigma) in self.estimate.priors.iter().chain(&self.estimate.held) {
            let var = assembly.robot(*robot);
            let column = var.column() + parameter;
            if free.contains(&column) {
                let nominal = self.arms[*robot].robot.nominal();
                assembly
                    .problem
                    .prior_components(var, &nominal, &[(*parameter, sigma * scale)])?;
                shares.push((column, *sigma));
            }
        }
        Ok((assembly, shares))
    }
}
