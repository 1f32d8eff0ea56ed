//! Noise models: how a residual in its own units becomes one in units of its standard deviation.

use crate::error::Error;
use nalgebra::DMatrix;

/// The noise of a measurement; a residual r is whitened to L⁻¹ r with Σ = L Lᵀ.
#[derive(Debug, Clone, PartialEq)]
pub enum Noise {
    /// Standard deviation one in every row: nothing to whiten.
    Unit,
    /// One standard deviation for all rows.
    Isotropic(f64),
    /// A standard deviation for each row.
    Diagonal(Vec<f64>),
    /// A full covariance, kept as the inverse L⁻¹ of its Cholesky factor (rows × rows).
    Full(DMatrix<f64>),
}

impl Noise {
    /// The same standard deviation, in the residual's units, for all rows.
    ///
    /// # Errors
    /// If sigma is not positive and finite.
    pub fn isotropic(sigma: f64) -> Result<Self, Error> {
        check(sigma)?;
        Ok(Self::Isotropic(sigma))
    }

    /// A standard deviation for each row.
    ///
    /// # Errors
    /// If one of them is not positive and finite.
    pub fn diagonal(sigmas: &[f64]) -> Result<Self, Error> {
        sigmas.iter().try_for_each(|s| check(*s))?;
        Ok(Self::Diagonal(sigmas.to_vec()))
    }

    /// A full covariance matrix.
    ///
    /// # Errors
    /// If it is not symmetric and positive definite.
    pub fn full(covariance: &DMatrix<f64>) -> Result<Self, Error> {
        let symmetric = covariance.is_square()
            && (covariance - covariance.transpose()).amax() <= 1e-12 * covariance.amax();
        let factor = if symmetric {
            covariance.clone().cholesky()
        } else {
            None
        };
        let inverse = factor.and_then(|c| {
            let n = covariance.nrows();
            c.l().solve_lower_triangular(&DMatrix::identity(n, n))
        });
        match inverse {
            Some(inverse) if inverse.iter().all(|x| x.is_finite()) => Ok(Self::Full(inverse)),
            _ => Err(Error::Noise {
                found: format!(
                    "a covariance matrix ({} × {})",
                    covariance.nrows(),
                    covariance.ncols()
                ),
                expected: "a symmetric, positive definite one".into(),
            }),
        }
    }

    /// Number of rows the model is made for, if it is for a certain number.
    pub fn dim(&self) -> Option<usize> {
        match self {
            Self::Unit | Self::Isotropic(_) => None,
            Self::Diagonal(sigmas) => Some(sigmas.len()),
            Self::Full(inverse) => Some(inverse.nrows()),
        }
    }

    /// The covariance of a measurement of `rows` rows (rows × rows).
    ///
    /// # Panics
    /// If the model is made for another number of rows.
    #[track_caller]
    pub fn covariance(&self, rows: usize) -> DMatrix<f64> {
        assert!(
            self.dim().is_none_or(|dim| dim == rows),
            "noise for {:?} rows, asked for {rows}",
            self.dim()
        );
        let one = DMatrix::identity(rows, rows);
        match self {
            Self::Unit => one,
            Self::Isotropic(sigma) => one * (sigma * sigma),
            Self::Diagonal(sigmas) => {
                DMatrix::from_fn(rows, rows, |i, k| one[(i, k)] * sigmas[i] * sigmas[i])
            }
            Self::Full(inverse) => match inverse.solve_lower_triangular(&one) {
                Some(factor) => &factor * factor.transpose(),
                None => DMatrix::from_element(rows, rows, f64::INFINITY),
            },
        }
    }

    /// Whitens a column of `rows` numbers in place.
    pub fn whiten(&self, column: &mut [f64]) {
        match self {
            Self::Unit => {}
            Self::Isotropic(sigma) => {
                for c in column {
                    *c /= sigma;
                }
            }
            Self::Diagonal(sigmas) => {
                for (c, sigma) in column.iter_mut().zip(sigmas) {
                    *c /= sigma;
                }
            }
            // L⁻¹ is lower triangular: from the last row up nothing is overwritten that is still needed.
            Self::Full(inverse) => {
                for row in (0..column.len()).rev() {
                    column[row] = (0..=row).map(|k| inverse[(row, k)] * column[k]).sum();
                }
            }
        }
    }
}

fn check(sigma: f64) -> Result<(), Error> {
    if sigma.is_finite() && sigma > 0.0 {
        Ok(())
    } else {
        Err(Error::Noise {
            found: format!("a standard deviation of {sigma}"),
            expected: "a positive, finite number".into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn a_full_covariance_whitens_to_the_mahalanobis_norm() {
        let covariance =
            DMatrix::from_row_slice(3, 3, &[4.0, 1.0, 0.5, 1.0, 3.0, -0.2, 0.5, -0.2, 2.0]);
        let noise = Noise::full(&covariance).unwrap();
        let r = [1.0, -2.0, 0.5];
        let mut white = r;
        noise.whiten(&mut white);
        let v = DMatrix::from_column_slice(3, 1, &r);
        let mahalanobis = (v.transpose() * covariance.clone().try_inverse().unwrap() * &v)[0];
        assert_relative_eq!(
            white.iter().map(|w| w * w).sum::<f64>(),
            mahalanobis,
            epsilon = 1e-14
        );
        assert_relative_eq!(noise.covariance(3), covariance, epsilon = 1e-14);
    }

    #[test]
    fn bad_noise_is_refused() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Noise::isotropic(bad).is_err());
            assert!(Noise::diagonal(&[1.0, bad]).is_err());
        }
        assert!(Noise::full(&DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0])).is_err());
        assert!(Noise::full(&DMatrix::from_row_slice(2, 2, &[1.0, 0.5, 0.0, 1.0])).is_err());
    }
}
