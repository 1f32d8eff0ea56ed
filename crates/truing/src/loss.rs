//! Losses (robust kernels): how much a large residual may cost.

use crate::error::Error;

/// A robust loss ρ(s) of the squared whitened residual s = ‖r‖² of one measurement; its cost is ½ρ(s).
///
/// ρ(0) = 0 and ρ′(0) = 1: small residuals are treated as in plain least squares. The weight of a
/// measurement is ρ′(s). Scales are in standard deviations, z = s/c².
///
/// | loss | ρ(s) | weight ρ′(s) | 95 % | convex up to s = |
/// | --- | --- | --- | --- | --- |
/// | [`Trivial`](Self::Trivial) | s | 1 | – | ∞ |
/// | [`Huber`](Self::Huber) | s for √s ≤ k, else 2k√s − k² | min(1, k/√s) | 1.345 | ∞ |
/// | [`SoftL1`](Self::SoftL1) | 2c² (√(1 + z) − 1) | 1/√(1 + z) | 1.287 | ∞ |
/// | [`Cauchy`](Self::Cauchy) | c² ln(1 + z) | 1/(1 + z) | 2.385 | c² |
/// | [`GemanMcClure`](Self::GemanMcClure) | s/(1 + z) | 1/(1 + z)² | 3.787 | c²/3 |
/// | [`Welsch`](Self::Welsch) | c² (1 − exp(−z)) | exp(−z) | 2.985 | c²/2 |
/// | [`Tukey`](Self::Tukey) | c²/3 (1 − (1 − z)³) for z ≤ 1, else c²/3 | (1 − z)² or 0 | 4.685 | c²/5 |
/// | [`Barron`](Self::Barron) | 2c² (b/α) ((1 + z/b)^{α/2} − 1), b = 2 − α | (1 + z/b)^{α/2 − 1} | by α | c² b/(b − 1) for α < 1 |
///
/// "95 %" is the scale at which the mean of normal data has 95 % of the efficiency of least squares
/// ([`EFFICIENT`](Self::EFFICIENT)): (E ψ′)²/E ψ² = 0.95 with ψ(x) = x ρ′(x²). Up to the last column
/// the cost of a single residual is convex, ψ′ = ρ′ + 2sρ″ ≥ 0; beyond, the losses that have a beyond
/// [redescend](Self::redescends): the further out, the less a residual pulls, down to nothing. They
/// withstand the grossest outliers and have many local minima: use
/// [`solve_graduated`](crate::solve_graduated).
///
/// A loss weighs the measurements of a block against each other. To let a whole block count less, for
/// a·ρ(s), there is [`Batch::weight`](crate::Batch::weight).
///
/// # How solvers see it
///
/// Where residuals alone are asked for they come multiplied by √ρ′. A linearisation has r̃ and J̃ with
/// the second-order correction of Triggs et al. 2000: J̃ᵀr̃ is the exact gradient of the cost, and J̃ᵀJ̃ its
/// Hessian but for the curvature of r, as long as a tenth of the weight is left along the residual. r̃ is
/// then longer than √ρ′ r, by √10 at most.
///
/// Sources: Huber 1964; Charbonnier et al. 1997 (soft L1); Holland & Welsch 1977 (Cauchy, Welsch and
/// constants); Beaton & Tukey 1974; Geman & McClure 1985; Barron 2019, "A general and adaptive robust
/// loss function".
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Loss {
    /// Plain least squares.
    #[default]
    Trivial,
    /// Quadratic up to k, linear beyond.
    Huber(f64),
    /// Huber's loss without the corner, also pseudo-Huber or Charbonnier: Barron's with α = 1.
    SoftL1(f64),
    /// Logarithmic far out, also Lorentz: Barron's with α = 0 and its scale divided by √2.
    Cauchy(f64),
    /// Tukey's biweight: nothing counts beyond c.
    Tukey(f64),
    /// Also Leclerc: Barron's with α = −∞ and its scale divided by √2.
    Welsch(f64),
    /// Barron's with α = −2 and its scale divided by 2.
    GemanMcClure(f64),
    /// Barron's family: from least squares (α = 2) through soft L1 (1), Cauchy (0) and Geman–McClure
    /// (−2) to Welsch (−∞).
    Barron {
        /// The shape α, −∞ ≤ α ≤ 2: the lower, the less an outlier counts.
        alpha: f64,
        /// The scale c.
        c: f64,
    },
}

impl Loss {
    /// The losses with a scale alone, at 95 % efficiency on one-dimensional normal residuals.
    pub const EFFICIENT: [Self; 6] = [
        Self::Huber(1.345),
        Self::SoftL1(1.287),
        Self::Cauchy(2.385),
        Self::Tukey(4.685),
        Self::Welsch(2.985),
        Self::GemanMcClure(3.787),
    ];

    /// Huber's loss with threshold `k` in standard deviations.
    ///
    /// # Errors
    /// If k is not positive and finite.
    pub fn huber(k: f64) -> Result<Self, Error> {
        Self::Huber(k).checked()
    }

    /// Soft L1 with scale `c` in standard deviations.
    ///
    /// # Errors
    /// If c is not positive and finite.
    pub fn soft_l1(c: f64) -> Result<Self, Error> {
        Self::SoftL1(c).checked()
    }

    /// Cauchy's loss with scale `c` in standard deviations.
    ///
    /// # Errors
    /// If c is not positive and finite.
    pub fn cauchy(c: f64) -> Result<Self, Error> {
        Self::Cauchy(c).checked()
    }

    /// Tukey's biweight, zero beyond `c` standard deviations.
    ///
    /// # Errors
    /// If c is not positive and finite.
    pub fn tukey(c: f64) -> Result<Self, Error> {
        Self::Tukey(c).checked()
    }

    /// Welsch's loss with scale `c` in standard deviations.
    ///
    /// # Errors
    /// If c is not positive and finite.
    pub fn welsch(c: f64) -> Result<Self, Error> {
        Self::Welsch(c).checked()
    }

    /// Geman and McClure's loss with scale `c` in standard deviations.
    ///
    /// # Errors
    /// If c is not positive and finite.
    pub fn geman_mcclure(c: f64) -> Result<Self, Error> {
        Self::GemanMcClure(c).checked()
    }

    /// Barron's loss with shape `alpha` (−∞ is allowed) and scale `c` in standard deviations.
    ///
    /// # Errors
    /// If c is not positive and finite, or alpha is more than 2 or NaN.
    pub fn barron(alpha: f64, c: f64) -> Result<Self, Error> {
        Self::Barron { alpha, c }.checked()
    }

    /// The loss itself if its numbers are possible.
    ///
    /// # Errors
    /// If its scale is not between 1e-100 and 1e100, or its shape is more than 2 or NaN.
    pub fn checked(self) -> Result<Self, Error> {
        let refuse = |what: &str, found: f64, expected: &str| {
            Err(Error::Noise {
                found: format!("a {what} of {found} for the loss `{}`", self.name()),
                expected: expected.into(),
            })
        };
        if let Self::Barron { alpha, .. } = self
            && (alpha.is_nan() || alpha > 2.0)
        {
            return refuse("shape alpha", alpha, "at most 2");
        }
        match self.scale() {
            // Powers of what is beyond are not numbers any more.
            Some(scale) if !(1e-100..=1e100).contains(&scale) => refuse(
                "scale",
                scale,
                "a positive, finite number of standard deviations",
            ),
            _ => Ok(self),
        }
    }

    /// Its name in files: `huber`, `soft-l1`, ….
    pub fn name(&self) -> &'static str {
        match self {
            Self::Trivial => "trivial",
            Self::Huber(_) => "huber",
            Self::SoftL1(_) => "soft-l1",
            Self::Cauchy(_) => "cauchy",
            Self::Tukey(_) => "tukey",
            Self::Welsch(_) => "welsch",
            Self::GemanMcClure(_) => "geman-mcclure",
            Self::Barron { .. } => "barron",
        }
    }

    /// The scale in standard deviations; none for the trivial loss.
    pub fn scale(&self) -> Option<f64> {
        match self {
            Self::Trivial => None,
            Self::Huber(c)
            | Self::SoftL1(c)
            | Self::Cauchy(c)
            | Self::Tukey(c)
            | Self::Welsch(c)
            | Self::GemanMcClure(c)
            | Self::Barron { c, .. } => Some(*c),
        }
    }

    /// The same loss with its scale multiplied by a `factor`: the larger, the more like least squares,
    /// and the trivial loss for ∞.
    #[must_use]
    pub fn relaxed(&self, factor: f64) -> Self {
        if factor == 1.0 {
            return *self;
        }
        // Beyond this every residual is small.
        let scale = self.scale().unwrap_or(f64::INFINITY) * factor;
        if scale > 1e150 {
            return Self::Trivial;
        }
        match self {
            Self::Trivial => Self::Trivial,
            Self::Huber(_) => Self::Huber(scale),
            Self::SoftL1(_) => Self::SoftL1(scale),
            Self::Cauchy(_) => Self::Cauchy(scale),
            Self::Tukey(_) => Self::Tukey(scale),
            Self::Welsch(_) => Self::Welsch(scale),
            Self::GemanMcClure(_) => Self::GemanMcClure(scale),
            Self::Barron { alpha, .. } => Self::Barron {
                alpha: *alpha,
                c: scale,
            },
        }
    }

    /// The squared residual up to which the cost is convex, ψ′ = ρ′ + 2sρ″ ≥ 0; infinite for convex losses.
    pub fn convex_up_to(&self) -> f64 {
        match *self {
            Self::Trivial | Self::Huber(_) | Self::SoftL1(_) => f64::INFINITY,
            Self::Cauchy(c) => c * c,
            Self::Tukey(c) => c * c / 5.0,
            Self::Welsch(c) => c * c / 2.0,
            Self::GemanMcClure(c) => c * c / 3.0,
            Self::Barron { alpha, .. } if alpha >= 1.0 => f64::INFINITY,
            Self::Barron { alpha, c } => c * c / (1.0 - 1.0 / (2.0 - alpha)),
        }
    }

    /// Whether residuals far out pull less than nearer ones: the cost is not convex.
    pub fn redescends(&self) -> bool {
        self.convex_up_to().is_finite()
    }

    /// (ρ(s), ρ′(s), ρ″(s)) for s ≥ 0, as large as s may be. At Huber's corner ρ″ is that from inside.
    pub fn evaluate(&self, s: f64) -> (f64, f64, f64) {
        // The square of a finite residual may be infinite: its loss is not.
        let finite = |s: f64| if s > f64::MAX { f64::MAX } else { s };
        match *self {
            Self::Trivial => (s, 1.0, 0.0),
            Self::Huber(k) => {
                let s = finite(s);
                let norm = s.sqrt();
                if norm <= k {
                    (s, 1.0, 0.0)
                } else {
                    (
                        2.0 * k * norm - k * k,
                        k / norm,
                        -0.5 * (k / norm) * s.recip(),
                    )
                }
            }
            Self::SoftL1(c) => {
                let (s, z) = (finite(s), squares_of(s, c));
                let root = (1.0 + z).sqrt();
                let slope = root.recip();
                let curvature = -0.5 * slope / (1.0 + z) / c / c;
                (2.0 * (s / (1.0 + root)), slope, curvature)
            }
            Self::Cauchy(c) => {
                let z = squares_of(s, c);
                let slope = (1.0 + z).recip();
                (c * c * z.ln_1p(), slope, -(slope / c) * (slope / c))
            }
            Self::Tukey(c) => {
                let z = squares_of(s, c);
                if z > 1.0 {
                    (c * c / 3.0, 0.0, 0.0)
                } else {
                    let left = 1.0 - z;
                    let rho = s * (1.0 - z + z * z / 3.0);
                    (rho, left * left, -2.0 * left / c / c)
                }
            }
            Self::Welsch(c) => {
                let z = squares_of(s, c);
                let slope = (-z).exp();
                (-c * c * (-z).exp_m1(), slope, -slope / c / c)
            }
            Self::GemanMcClure(c) => {
                let (s, z) = (finite(s), squares_of(s, c));
                let weight = (1.0 + z).recip();
                let slope = weight * weight;
                (s * weight, slope, -2.0 * slope * weight / c / c)
            }
            Self::Barron { alpha, c } => barron(alpha, c, s),
        }
    }
}

/// z = s/c², as the largest number where it is none.
fn squares_of(s: f64, c: f64) -> f64 {
    let z = s / c / c;
    if z > f64::MAX { f64::MAX } else { z }
}

/// Barron's loss. With b = 2 − α and L = ln(1 + z/b), ρ = c² b L φ(αL/2) where φ(x) = (eˣ − 1)/x, and
/// ρ′ = e^{−bL/2}: nothing cancels, whatever α is.
fn barron(alpha: f64, c: f64, s: f64) -> (f64, f64, f64) {
    let b = 2.0 - alpha;
    if b == 0.0 {
        return (s, 1.0, 0.0);
    }
    let z = squares_of(s, c);
    if b.is_infinite() {
        let slope = (-0.5 * z).exp();
        let rho = -2.0 * c * c * (-0.5 * z).exp_m1();
        return (rho, slope, -0.5 * slope / c / c);
    }
    let ratio = z / b;
    let log = if ratio.is_finite() {
        ratio.ln_1p()
    } else {
        z.ln() - b.ln()
    };
    let slope = (-0.5 * b * log).exp();
    let x = 0.5 * alpha * log;
    let rho = if x > 700.0 {
        2.0 / alpha * (x + b.ln()).exp()
    } else if x == 0.0 {
        b * log
    } else {
        b * log * (x.exp_m1() / x)
    };
    let curvature = -0.5 * slope * (-log).exp() / c / c;
    (c * c * rho, slope, curvature)
}

#[cfg(test)]
mod tests;
