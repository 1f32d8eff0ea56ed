//! Which measurements do not fit, and which decide alone.

use super::Covariance;
use crate::least_squares::{LeastSquares, Linearization};
use crate::problem::Problem;
use crate::variable::Values;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};
use std::ops::Range;

/// A direction of a measurement that keeps less than this of its noise is fitted whatever it reads:
/// its residual is zero and tells nothing. Rounding leaves about 1e-14.
const UNCHECKED: f64 = 1e-9;

/// What residuals are compared with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scale {
    /// The noise is as stated, but for this factor, which is not from the residuals themselves: 1
    /// where the noise models are believed (Baarda 1968, data snooping), or a factor that outliers
    /// do not move.
    Known(f64),
    /// σ₀ estimated from these residuals with these degrees of freedom: an outlier makes it larger,
    /// which is taken into account (external studentisation; Cook & Weisberg 1982, section 2.2.1).
    Estimated {
        /// a-posteriori standard deviation of unit weight.
        sigma0: f64,
        /// Degrees of freedom that it is from.
        degrees_of_freedom: f64,
    },
}

impl Scale {
    /// The σ₀ of a covariance, estimated.
    pub fn of(covariance: &Covariance) -> Self {
        Self::Estimated {
            sigma0: covariance.sigma0(),
            degrees_of_freedom: covariance.degrees_of_freedom() as f64,
        }
    }

    /// The median of |r| over 0.6745, which half of the residuals may be outliers of: known, for
    /// robust estimates (Huber 1981, section 5.1). NaN of none.
    pub fn robust(whitened: &[f64]) -> Self {
        let mut sizes: Vec<f64> = whitened.iter().map(|r| r.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let n = sizes.len();
        let median = match n {
            0 => f64::NAN,
            _ => 0.5 * (sizes[(n - 1) / 2] + sizes[n / 2]),
        };
        // The third quartile of the normal distribution.
        Self::Known(median / 0.674_489_750_196_081_7)
    }

    /// The factor.
    pub fn sigma0(self) -> f64 {
        match self {
            Self::Known(sigma0) | Self::Estimated { sigma0, .. } => sigma0,
        }
    }

    /// Probability of a measurement with `checked` rows at least as far off as T².
    fn p_value(self, square: f64, checked: usize) -> f64 {
        let q = checked as f64;
        let upper = match self {
            Self::Known(_) => ChiSquared::new(q).map(|d| d.sf(square)).ok(),
            Self::Estimated {
                degrees_of_freedom, ..
            } => {
                // Without this measurement the sum of squares is less by T², σ₀² being the unit.
                let others = degrees_of_freedom - q;
                let rest = (degrees_of_freedom - square).max(0.0);
                match FisherSnedecor::new(q, others) {
                    Ok(_) if rest == 0.0 => Some(0.0),
                    Ok(d) => Some(d.sf(square / q * others / rest)),
                    Err(_) => None,
                }
            }
        };
        upper.filter(|_| square.is_finite()).unwrap_or(f64::NAN)
    }
}

/// One measurement beside what is expected of it.
#[derive(Debug, Clone, PartialEq)]
pub struct ConstraintResidual {
    /// Its rows in r and J.
    pub rows: Range<usize>,
    /// Trace of its block of the hat matrix H = J Σ Jᵀ: how many of the unknowns it decides, from 0 to
    /// its number of rows. All together add up to the number of unknowns.
    pub leverage: f64,
    /// How many of its rows (or directions in them) other measurements check; the others' residuals are
    /// zero whatever was read.
    pub checked: usize,
    /// T² = rᵀ (I − H)⁻¹ r / σ₀², near χ²(checked): squares of standardised residuals, correlations
    /// within the measurement taken into account.
    pub square: f64,
    /// Probability of a T² at least as large, from F or χ² as the [`Scale`] has it; NaN if nothing
    /// checks it. Of m measurements the smallest is below 0.05/m by chance in 5 % of all fits
    /// (Bonferroni).
    pub p_value: f64,
    /// Cook's distance: how far the estimate would move without it, rᵀ (I − H)⁻¹ H (I − H)⁻¹ r / (p σ₀²)
    /// for p unknowns (Cook 1977). Above 1 it moves the estimate by as much as its uncertainty.
    pub cook: f64,
}

impl ConstraintResidual {
    /// T / √checked: its size in standard deviations, one on average whatever its number of rows;
    /// NaN if nothing checks it.
    pub fn standardised(&self) -> f64 {
        (self.square / self.checked as f64).sqrt()
    }
}

/// Residuals of a fit, each beside its own standard deviation.
///
/// A residual is smaller than its noise, because the fit follows what was measured: the more so the
/// larger its leverage. Its covariance is σ₀² (I − H) with the hat matrix H = J Σ Jᵀ, whose blocks
/// on the diagonal are all that is computed: no matrix of rows × rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Residuals {
    /// What they are compared with.
    pub scale: Scale,
    /// Leverage hᵢᵢ of every row, from 0 to 1. It says where a measurement was made, not what it read.
    pub leverage: Vec<f64>,
    /// rᵢ / (σ₀ √(1 − hᵢᵢ)) of every row: variance 1 if the model is right. NaN if nothing checks it.
    pub standardised: Vec<f64>,
    /// Every measurement.
    pub constraints: Vec<ConstraintResidual>,
}

impl Residuals {
    /// The residuals of a problem at a solution, with the covariance there and its σ₀. The covariance
    /// must be of the same problem at the same point.
    ///
    /// Under robust losses they are those of the reweighted problem, in which outliers are drawn in:
    /// ask the problem without losses, with [`Scale::robust`].
    pub fn at(problem: &Problem, x: &Values, covariance: &Covariance) -> Self {
        Self::with_scale(problem, x, covariance, Scale::of(covariance))
    }

    /// The same, compared with another scale.
    pub fn with_scale(
        problem: &Problem,
        x: &Values,
        covariance: &Covariance,
        scale: Scale,
    ) -> Self {
        let dims = problem
            .blocks()
            .flat_map(|block| std::iter::repeat_n(block.dim(), block.len()));
        Self::grouped(problem, x, covariance, scale, dims)
    }

    /// The residuals of any least-squares problem, whose measurements have these numbers of rows, one
    /// after another.
    pub fn grouped<P: LeastSquares>(
        problem: &P,
        x: &P::Point,
        covariance: &Covariance,
        scale: Scale,
        dims: impl IntoIterator<Item = usize>,
    ) -> Self {
        let mut lin = Linearization::new(problem.structure());
        problem.linearize(x, &mut lin);
        let rows = lin.structure.rows;
        let mut all = Self {
            scale,
            leverage: Vec::with_capacity(rows),
            standardised: Vec::with_capacity(rows),
            constraints: Vec::new(),
        };
        let mut panels = Panels::new(&lin, covariance);
        for dim in dims {
            all.push(dim, &lin, &mut panels);
        }
        all
    }

    /// Adds the measurement of the next `dim` rows.
    fn push(&mut self, dim: usize, lin: &Linearization, panels: &mut Panels<'_>) {
        let first = self.leverage.len();
        let rows = first..(first + dim).min(lin.structure.rows);
        let hat = panels.hat(lin, &rows);
        let sigma0 = self.scale.sigma0();
        for (i, row) in rows.clone().enumerate() {
            let h = hat[(i, i)].clamp(0.0, 1.0);
            let left = 1.0 - h;
            self.leverage.push(h);
            self.standardised.push(if left > UNCHECKED {
                lin.residual[row] / (sigma0 * left.sqrt())
            } else {
                f64::NAN
            });
        }
        let r = DVector::from_column_slice(&lin.residual[rows.clone()]);
        let leverage = hat.trace();
        let eigen = hat.symmetric_eigen();
        let (mut checked, mut square, mut moved) = (0, 0.0, 0.0);
        for (k, h) in eigen.eigenvalues.iter().enumerate() {
            let left = 1.0 - h;
            if left > UNCHECKED {
                let along = eigen.eigenvectors.column(k).dot(&r) / sigma0;
                checked += 1;
                square += along * along / left;
                moved += along * along * h.max(0.0) / (left * left);
            }
        }
        let (square, moved) = match checked {
            0 => (f64::NAN, f64::NAN),
            _ => (square, moved),
        };
        self.constraints.push(ConstraintResidual {
            rows,
            leverage,
            checked,
            square,
            p_value: self.scale.p_value(square, checked),
            cook: moved / panels.rank,
        });
    }
}

/// Rows of J, gathered from its columns in row order.
struct Panels<'a> {
    covariance: &'a Covariance,
    rank: f64,
    /// Next entry of every free column.
    cursor: Vec<usize>,
    /// S Jᵀ of the rows at hand (rank × rows).
    image: DMatrix<f64>,
}

impl<'a> Panels<'a> {
    fn new(lin: &Linearization, covariance: &'a Covariance) -> Self {
        let starts = &lin.structure.column_starts;
        Self {
            covariance,
            rank: covariance.rank() as f64,
            cursor: covariance.free().iter().map(|c| starts[*c]).collect(),
            image: DMatrix::zeros(covariance.rank(), 0),
        }
    }

    /// The block J Σ Jᵀ of the next rows.
    fn hat(&mut self, lin: &Linearization, rows: &Range<usize>) -> DMatrix<f64> {
        if self.image.ncols() != rows.len() {
            self.image = DMatrix::zeros(self.covariance.rank(), rows.len());
        }
        self.image.fill(0.0);
        let root = self.covariance.root();
        for (place, column) in self.covariance.free().iter().enumerate() {
            let end = lin.structure.column_starts[column + 1];
            let cursor = &mut self.cursor[place];
            while *cursor < end && lin.structure.row_indices[*cursor] < rows.end {
                let row = lin.structure.row_indices[*cursor] - rows.start;
                let mut target = self.image.column_mut(row);
                target.axpy(lin.values[*cursor], &root.column(place), 1.0);
                *cursor += 1;
            }
        }
        self.image.tr_mul(&self.image)
    }
}
