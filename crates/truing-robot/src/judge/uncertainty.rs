//! How sure an estimate is: σ₀ from the measurements, priors as they are, robust losses, bounds.

use crate::error::Error;
use crate::estimate::{Job, Prior};
use crate::identify::Choice;
use crate::measurement::MeasurementSet;
use crate::model::{Assembly, Owner};
use crate::robot::Robot;
use crate::unknown::{Key, State};
use std::collections::BTreeMap;
use std::ops::Range;
use truing::statistics::{ChiSquareTest, Influence, Residuals, Scale, huber_sigma0};
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

/// The covariance at a state, and what it is from.
pub(crate) struct Covered {
    /// No losses, only what is free in it.
    pub assembly: Assembly,
    /// In units of σ₀².
    pub covariance: Covariance,
    pub sigma0: f64,
    pub degrees_of_freedom: f64,
    /// Residuals of the measurements, set after set.
    pub whitened: Vec<f64>,
}

/// The uncertainty, with what else is to be said of the measurements that it is from.
pub(crate) struct Judged {
    pub uncertainty: Uncertainty,
    /// The problem that was judged: no losses, only what is free in it.
    pub assembly: Assembly,
    /// Residuals of the measurements, set after set, then of priors.
    pub residuals: Residuals,
    /// Whitened residuals of the measurements, row by row.
    pub whitened: Vec<f64>,
    /// ‖r‖² of the measurements, whitened.
    pub squares: f64,
    /// Whether a robust loss was set aside, so that this sum is not χ².
    pub robust: bool,
}

/// Level of the global test that residuals must fail to be called larger than the noise.
const CERTAIN: f64 = 1e-3;

impl Judged {
    /// The global test, if residuals are larger than the stated noise for certain.
    pub fn misfit(&self) -> Option<ChiSquareTest> {
        let freedom = self.uncertainty.degrees_of_freedom;
        let test = ChiSquareTest::new(self.squares, freedom)?;
        (freedom >= 1.0 && !self.robust && test.p_too_large < CERTAIN).then_some(test)
    }
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
    /// The covariance of the estimated columns at a state.
    ///
    /// Measurements are known up to a factor: their covariance is scaled by σ₀². Priors are not, so
    /// (JₘᵀJₘ/σ₀² + JₚᵀJₚ)⁻¹ = σ₀² (JₘᵀJₘ + σ₀² JₚᵀJₚ)⁻¹. Degrees of freedom are the rows less the
    /// unknowns, of which a prior takes the share that it determines. Under a robust loss σ₀ is
    /// [Huber's factor](huber_sigma0), with J unweighted. Parameters at a bound do not move.
    pub fn covariance(
        &self,
        state: &State,
        choices: &[Choice],
        held: &[Prior],
    ) -> Result<Covered, Error> {
        let plain: Vec<MeasurementSet> = self.sets.iter().map(MeasurementSet::unweighted).collect();
        let (mut assembly, shares) = self.assembled(&plain, state, choices, held, 1.0)?;
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
        r.truncate(rows);
        let degrees_of_freedom = rows as f64 - unknowns;
        let sigma0 = huber_sigma0(influences, unknowns);
        if !shares.is_empty() && sigma0.is_finite() && sigma0 != 0.0 {
            (assembly, _) = self.assembled(&plain, state, choices, held, 1.0 / sigma0)?;
            covariance = Covariance::at(&assembly.problem, assembly.problem.initial())?;
        }
        Ok(Covered {
            assembly,
            covariance,
            sigma0,
            degrees_of_freedom,
            whitened: r,
        })
    }

    /// The uncertainty of the estimated columns at a state, from their [covariance](Self::covariance). Under a robust
    /// loss residuals are compared with their median, which outliers do not move.
    pub fn uncertainty(
        &self,
        state: &State,
        choices: &[Choice],
        held: &[Prior],
    ) -> Result<Judged, Error> {
        let Covered {
            assembly,
            covariance,
            sigma0,
            degrees_of_freedom,
            whitened,
        } = self.covariance(state, choices, held)?;
        let scale = if self.is_robust() {
            Scale::robust(&whitened)
        } else {
            Scale::Estimated {
                sigma0,
                degrees_of_freedom,
            }
        };
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
            squares: whitened.iter().map(|r| r * r).sum(),
            whitened,
            robust: self.is_robust(),
        })
    }

    /// The problem at a state with the estimated columns free that are not at a bound, and priors
    /// with their standard deviations times `scale`, which come back as (column, standard deviation).
    fn assembled(
        &self,
        sets: &[MeasurementSet],
        state: &State,
        choices: &[Choice],
        held: &[Prior],
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
        for (robot, parameter, sigma) in self.estimate.priors.iter().chain(held) {
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
