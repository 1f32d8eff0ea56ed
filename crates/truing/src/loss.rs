//! Losses (robust kernels): how much a large residual may cost.

use crate::error::Error;

/// A robust loss ρ(s) of the squared whitened residual s = ‖r‖² of one measurement; its cost is ½ρ(s).
///
/// ρ(0) = 0 and ρ'(0) = 1: small residuals are treated as in plain least squares. The weight of a
/// measurement is ρ'(s); its residual and Jacobian are multiplied by √ρ', which makes the gradient
/// of the reweighted problem that of the robust cost (Triggs et al. 2000, without the second-order term).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Loss {
    /// ρ(s) = s: plain least squares.
    #[default]
    Trivial,
    /// ρ(s) = s for √s ≤ k, 2k√s − k² beyond: quadratic near zero, linear far out (Huber 1964).
    Huber(f64),
}

impl Loss {
    /// Huber's loss with threshold `k` in standard deviations; 1.345 keeps 95 % efficiency on normal noise.
    ///
    /// # Errors
    /// If k is not positive and finite.
    pub fn huber(k: f64) -> Result<Self, Error> {
        if k.is_finite() && k > 0.0 {
            Ok(Self::Huber(k))
        } else {
            Err(Error::Noise {
                found: format!("a Huber threshold of {k}"),
                expected: "a positive, finite number of standard deviations".into(),
            })
        }
    }

    /// (ρ(s), ρ'(s)).
    pub fn evaluate(&self, s: f64) -> (f64, f64) {
        match self {
            Self::Trivial => (s, 1.0),
            Self::Huber(k) => {
                let norm = s.sqrt();
                if norm <= *k {
                    (s, 1.0)
                } else {
                    (2.0 * k * norm - k * k, k / norm)
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn huber_is_continuous_and_its_weight_is_its_slope() {
        let loss = Loss::huber(1.5).unwrap();
        assert_eq!(loss.evaluate(1.0), (1.0, 1.0));
        for s in [2.24, 2.26, 9.0, 1e6] {
            let h = 1e-6 * s;
            let slope = (loss.evaluate(s + h).0 - loss.evaluate(s - h).0) / (2.0 * h);
            assert_relative_eq!(slope, loss.evaluate(s).1, epsilon = 1e-6);
        }
        assert!(Loss::huber(0.0).is_err() && Loss::huber(f64::NAN).is_err());
    }
}
