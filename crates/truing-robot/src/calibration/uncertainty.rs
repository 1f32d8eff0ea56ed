//! How sure an estimate is: σ₀ from the measurements, priors as they are, robust losses, bounds.

use super::assembly::Assembly;
use super::measurement::MeasurementSet;
use super::run::Calibration;
use super::select::Choice;
use super::state::{Owner, State};
use crate::error::Error;
use truing::{Covariance, LeastSquares};

/// Standard deviations at a solution.
pub(super) struct Uncertainty {
    /// Covariance of the estimated columns that are not at a bound, in units of σ₀².
    pub covariance: Covariance,
    /// A-posteriori standard deviation of unit weight, of the measurements alone.
    pub sigma0: f64,
}

impl Uncertainty {
    /// Standard deviation of a column; zero if it is not estimated.
    pub fn std_dev(&self, column: usize) -> f64 {
        self.covariance.std_dev(column) * self.sigma0
    }
}

impl Calibration {
    /// The uncertainty of the estimated columns at a state.
    ///
    /// Measurements are known up to a factor: their covariance is scaled by σ₀². Priors are not, so
    /// (JₘᵀJₘ/σ₀² + JₚᵀJₚ)⁻¹ = σ₀² (JₘᵀJₘ + σ₀² JₚᵀJₚ)⁻¹. Degrees of freedom are the rows less the
    /// unknowns, of which a prior takes the share that it determines. Under a robust loss with
    /// influence ψ, σ₀² = K² · Σψ² / f / (mean ψ′)² with J unweighted and
    /// K = 1 + (unknowns / rows) · var ψ′ / (mean ψ′)² (Huber 1981, section 7.6).
    /// Parameters at a bound do not move.
    pub(super) fn uncertainty(
        &self,
        state: &State,
        choices: &[Choice],
    ) -> Result<Uncertainty, Error> {
        let plain: Vec<MeasurementSet> = self.sets.iter().map(MeasurementSet::unweighted).collect();
        let (assembly, shares) = self.assembled(&plain, state, choices, 1.0)?;
        let covariance = Covariance::at(&assembly.problem, assembly.problem.initial())?;
        let by_priors: f64 = shares
            .iter()
            .map(|(column, sigma)| (covariance.std_dev(*column) / sigma).powi(2))
            .sum();
        let unknowns = assembly.problem.free().len() as f64 - by_priors;

        let mut r = vec![0.0; assembly.problem.rows()];
        assembly
            .problem
            .residual(assembly.problem.initial(), &mut r);
        let (mut influence, mut rows) = (0.0, 0.0);
        let (mut slope, mut slope_square) = (0.0, 0.0);
        let blocks = assembly.problem.blocks().map(|block| block.dim());
        for (k, (set, dim)) in self.sets.iter().zip(blocks).enumerate() {
            for r in r[assembly.problem.block_rows(k)].chunks_exact(dim) {
                let square: f64 = r.iter().map(|r| r * r).sum();
                let weight = set.loss.evaluate(square).1;
                influence += weight * weight * square;
                let dim = dim as f64;
                // Beyond the threshold ψ only turns: ψ′ is the weight across r, zero along it.
                let own = if weight < 1.0 {
                    weight * (dim - 1.0) / dim
                } else {
                    1.0
                };
                slope += own * dim;
                slope_square += own * own * dim;
                rows += dim;
            }
        }
        let freedom = rows - unknowns;
        let mean = slope / rows;
        let spread = (slope_square / rows / (mean * mean) - 1.0).max(0.0);
        let correction = 1.0 + unknowns / rows * spread;
        let sigma0 = if freedom > 1e-9 {
            (influence / freedom).sqrt() / mean * correction
        } else {
            f64::NAN
        };
        if shares.is_empty() || !sigma0.is_finite() || sigma0 == 0.0 {
            return Ok(Uncertainty { covariance, sigma0 });
        }
        let (assembly, _) = self.assembled(&plain, state, choices, 1.0 / sigma0)?;
        let covariance = Covariance::at(&assembly.problem, assembly.problem.initial())?;
        Ok(Uncertainty { covariance, sigma0 })
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
        for (robot, parameter, sigma) in &self.estimate.priors {
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
