//! Whether the residuals are as large as the noise models say.

use super::Covariance;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::fmt;

/// The global test of a fit: is the sum of squared whitened residuals one of χ²(degrees of freedom)?
///
/// If the model is right and the noise is normal and as stated, it is. Too large means that the
/// noise is larger than stated, that there are outliers, or that the model is wrong; too small that
/// the noise is smaller than stated. The test cannot tell which. (Koch 1999, *Parameter Estimation
/// and Hypothesis Testing in Linear Models*, section 4.2; the *global model test* of geodesy.)
///
/// Priors are rows like measurements: an estimate far from a prior makes the sum as large as an
/// outlier does. Under a robust loss the sum is of reweighted residuals and smaller than χ², which
/// [`robust`](Self::robust) says; only "too large" means something then.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChiSquareTest {
    /// vᵀPv = ‖r‖², whitened.
    pub statistic: f64,
    /// Rows less independent unknowns; not a whole number where priors share in unknowns.
    pub degrees_of_freedom: f64,
    /// Probability of a sum at least as large.
    pub p_too_large: f64,
    /// Probability of a sum at most as large.
    pub p_too_small: f64,
    /// Whether residuals were reweighted by a robust loss: the sum is then not χ².
    pub robust: bool,
}

/// What a test says at a level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Residuals as the noise models make them.
    AsExpected,
    /// Residuals larger than chance explains.
    TooLarge,
    /// Residuals smaller than chance explains.
    TooSmall,
}

impl ChiSquareTest {
    /// The test of a sum of squares; none without degrees of freedom or with a sum that is no number.
    pub fn new(statistic: f64, degrees_of_freedom: f64) -> Option<Self> {
        let distribution = ChiSquared::new(degrees_of_freedom).ok()?;
        let usable = statistic >= 0.0 && degrees_of_freedom.is_finite();
        usable.then(|| Self {
            statistic,
            degrees_of_freedom,
            p_too_large: distribution.sf(statistic),
            p_too_small: distribution.cdf(statistic),
            robust: false,
        })
    }

    /// a-posteriori standard deviation of unit weight √(statistic / degrees of freedom).
    pub fn sigma0(&self) -> f64 {
        (self.statistic / self.degrees_of_freedom).sqrt()
    }

    /// Two-sided p-value: the probability of a sum at least as unusual, on either side.
    pub fn p_value(&self) -> f64 {
        (2.0 * self.p_too_large.min(self.p_too_small)).min(1.0)
    }

    /// The verdict of the two-sided test at a level such as 0.05: so often a right model is blamed.
    pub fn verdict(&self, level: f64) -> Verdict {
        if self.p_too_large < 0.5 * level {
            Verdict::TooLarge
        } else if self.p_too_small < 0.5 * level {
            Verdict::TooSmall
        } else {
            Verdict::AsExpected
        }
    }
}

impl fmt::Display for ChiSquareTest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "χ² = {:.1} of {} degrees of freedom, p ",
            self.statistic,
            (10.0 * self.degrees_of_freedom).round() / 10.0,
        )?;
        match self.p_value() {
            p if p < 1e-16 => write!(f, "< 1e-16")?,
            p if p < 0.01 => write!(f, "= {p:.0e}")?,
            p => write!(f, "= {p:.2}")?,
        }
        if self.robust {
            write!(f, " (reweighted by a robust loss: smaller than χ²)")?;
        }
        Ok(())
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::AsExpected => "the residuals are as large as the stated noise makes them",
            Self::TooLarge => {
                "the residuals are larger than the stated noise explains: the noise is larger, there are outliers, or \
                 the model lacks something"
            }
            Self::TooSmall => {
                "the residuals are smaller than the stated noise makes them: the noise is smaller than stated"
            }
        })
    }
}

impl Covariance {
    /// The global test of the fit it was made at; none without redundancy.
    pub fn chi_square(&self) -> Option<ChiSquareTest> {
        let test = ChiSquareTest::new(self.squares(), self.degrees_of_freedom() as f64)?;
        Some(ChiSquareTest {
            robust: self.is_robust(),
            ..test
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Percentage points of χ² (Abramowitz & Stegun 1964, table 26.8).
    #[test]
    fn probabilities_are_those_of_the_tables() {
        for (statistic, freedom, upper) in [
            (3.84146, 1.0, 0.05),
            (18.3070, 10.0, 0.05),
            (129.561, 100.0, 0.025),
            (74.2219, 100.0, 0.975),
            (10.8276, 1.0, 0.001),
        ] {
            let test = ChiSquareTest::new(statistic, freedom).unwrap();
            assert_relative_eq!(test.p_too_large, upper, max_relative = 1e-4);
            assert_relative_eq!(test.p_too_small, 1.0 - upper, max_relative = 1e-4);
        }
        // exp(−x/2) for two degrees of freedom, far out too.
        let test = ChiSquareTest::new(200.0, 2.0).unwrap();
        assert_relative_eq!(test.p_too_large, (-100.0_f64).exp(), max_relative = 1e-9);
    }

    #[test]
    fn the_verdict_is_two_sided() {
        let verdict =
            |statistic| ChiSquareTest::new(statistic, 100.0).map(|test| test.verdict(0.05));
        assert_eq!(verdict(129.0), Some(Verdict::AsExpected));
        assert_eq!(verdict(130.0), Some(Verdict::TooLarge));
        assert_eq!(verdict(75.0), Some(Verdict::AsExpected));
        assert_eq!(verdict(74.0), Some(Verdict::TooSmall));
        assert_eq!(verdict(f64::NAN), None);
        assert_eq!(ChiSquareTest::new(1.0, 0.0), None);
    }
}
