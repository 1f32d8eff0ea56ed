//! How sure an estimate with robust losses is.

use super::Covariance;
use crate::error::Error;
use crate::least_squares::LeastSquares;
use crate::loss::Loss;

/// What one measurement with a robust loss contributes to the uncertainty of an estimate: how hard
/// it pulls, ψ(r) = ρ′(‖r‖²) r, and how that changes with its residual.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Influence {
    /// Its rows.
    pub rows: usize,
    /// ‖ψ‖² = ρ′² ‖r‖².
    pub square: f64,
    /// Mean of the diagonal of ∂ψ/∂r.
    pub slope: f64,
}

impl Influence {
    /// Of a measurement with whitened residual r under a loss.
    pub fn of(loss: &Loss, r: &[f64]) -> Self {
        let s: f64 = r.iter().map(|r| r * r).sum();
        let (_, first, second) = loss.evaluate(s);
        Self::new(r.len(), s, first, second)
    }

    /// Of a measurement with whitened residual r of `rows` rows, s = ‖r‖², from the first and second
    /// derivatives of its loss at s: ∂ψ/∂r = ρ′ I + 2ρ″ r rᵀ has the trace rows · ρ′ + 2ρ″ s.
    pub fn new(rows: usize, s: f64, first: f64, second: f64) -> Self {
        Self {
            rows,
            square: first * first * s,
            slope: first + 2.0 * second * s / rows as f64,
        }
    }
}

/// Huber's factor σ₀ by which the covariance (JᵀJ)⁻¹ of the *unweighted* problem is to be multiplied,
/// squared, to be that of the robust estimate:
///
/// σ₀² = K² · \[Σψ² / (n − p)\] / (mean ψ′)², with K = 1 + (p/n) · var ψ′ / (mean ψ′)²
///
/// for n rows and p unknowns (Huber 1981, *Robust Statistics*, section 7.6). With trivial losses it
/// is the ordinary σ₀. NaN without redundancy.
pub fn huber_sigma0(influences: impl IntoIterator<Item = Influence>, unknowns: f64) -> f64 {
    let (mut rows, mut square) = (0.0, 0.0);
    let (mut slope, mut slope_square) = (0.0, 0.0);
    for influence in influences {
        let dim = influence.rows as f64;
        rows += dim;
        square += influence.square;
        slope += influence.slope * dim;
        slope_square += influence.slope * influence.slope * dim;
    }
    let freedom = rows - unknowns;
    if freedom <= 1e-9 {
        return f64::NAN;
    }
    let mean = slope / rows;
    let spread = (slope_square / rows / (mean * mean) - 1.0).max(0.0);
    let correction = 1.0 + unknowns / rows * spread;
    (square / freedom).sqrt() / mean * correction
}

impl Covariance {
    /// The covariance of an estimate with robust losses at `x`, from the problem *without* them and
    /// what each measurement contributes with its loss, in any order.
    ///
    /// [`sigma0`](Self::sigma0) is then [Huber's factor](huber_sigma0): the covariance of the estimate
    /// is σ₀² times the entries, also where the noise models are believed, since it is what a robust
    /// estimate loses on good data and gains on bad.
    ///
    /// # Errors
    /// As [`at`](Self::at).
    pub fn robust<P: LeastSquares>(
        unweighted: &P,
        x: &P::Point,
        influences: impl IntoIterator<Item = Influence>,
    ) -> Result<Self, Error> {
        let covariance = Self::at(unweighted, x)?;
        let sigma0 = huber_sigma0(influences, covariance.rank() as f64);
        Ok(covariance.with_sigma0(sigma0))
    }
}
