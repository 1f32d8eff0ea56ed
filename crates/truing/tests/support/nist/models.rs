//! The models of NIST's nonlinear regression data sets, as constraints.

use truing::manifold::Vector;
use truing::{Constraint, Scalar, Views};

/// The functions f(x; b) of the 27 data sets: several sets share one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Model {
    /// b₁ (1 − exp(−b₂ x)): Misra1a, BoxBOD.
    Saturation,
    /// b₁ (1 − (1 + b₂x/2)⁻²): Misra1b.
    SquaredSaturation,
    /// b₁ (1 − (1 + 2 b₂x)^−½): Misra1c.
    RootSaturation,
    /// b₁ b₂ x / (1 + b₂ x): Misra1d.
    Hyperbola,
    /// exp(−b₁ x) / (b₂ + b₃ x): Chwirut1, Chwirut2.
    DampedHyperbola,
    /// b₁ exp(−b₂x) + b₃ exp(−b₄x) + b₅ exp(−b₆x): Lanczos1, 2 and 3.
    ThreeExponentials,
    /// b₁ exp(−b₂x) + b₃ exp(−(x − b₄)²/b₅²) + b₆ exp(−(x − b₇)²/b₈²): Gauss1, 2 and 3.
    TwoPeaks,
    /// b₁ x^b₂: DanWood.
    Power,
    /// (b₁ + b₂x + b₃x²) / (1 + b₄x + b₅x²): Kirby2.
    QuadraticOverQuadratic,
    /// (b₁ + b₂x + b₃x² + b₄x³) / (1 + b₅x + b₆x² + b₇x³): Hahn1, Thurber.
    CubicOverCubic,
    /// ln y = b₁ − b₂ x₁ exp(−b₃ x₂): Nelson.
    Degradation,
    /// b₁ + b₂ exp(−b₄ x) + b₃ exp(−b₅ x): MGH17.
    TwoExponentials,
    /// b₁ − b₂x − arctan(b₃ / (x − b₄)) / π: Roszman1.
    QuantumDefect,
    /// A year's wave and two of periods b₄ and b₇: ENSO.
    ThreeWaves,
    /// b₁ (x² + b₂x) / (x² + b₃x + b₄): MGH09.
    Enzyme,
    /// b₁ / (1 + exp(b₂ − b₃x)): Rat42.
    Logistic,
    /// b₁ / (1 + exp(b₂ − b₃x))^(1/b₄): Rat43.
    RichardsGrowth,
    /// b₁ exp(b₂ / (x + b₃)): MGH10.
    Thermistor,
    /// b₁/b₂ exp(−½ ((x − b₃)/b₂)²): Eckerle4.
    Peak,
    /// b₁ (b₂ + x)^(−1/b₃): Bennett5.
    Relaxation,
}

impl Model {
    /// The model of a data set; `None` for a name that NIST does not have.
    pub fn of(name: &str) -> Option<Self> {
        Some(match name {
            "Misra1a" | "BoxBOD" => Self::Saturation,
            "Misra1b" => Self::SquaredSaturation,
            "Misra1c" => Self::RootSaturation,
            "Misra1d" => Self::Hyperbola,
            "Chwirut1" | "Chwirut2" => Self::DampedHyperbola,
            "Lanczos1" | "Lanczos2" | "Lanczos3" => Self::ThreeExponentials,
            "Gauss1" | "Gauss2" | "Gauss3" => Self::TwoPeaks,
            "DanWood" => Self::Power,
            "Kirby2" => Self::QuadraticOverQuadratic,
            "Hahn1" | "Thurber" => Self::CubicOverCubic,
            "Nelson" => Self::Degradation,
            "MGH17" => Self::TwoExponentials,
            "Roszman1" => Self::QuantumDefect,
            "ENSO" => Self::ThreeWaves,
            "MGH09" => Self::Enzyme,
            "Rat42" => Self::Logistic,
            "Rat43" => Self::RichardsGrowth,
            "MGH10" => Self::Thermistor,
            "Eckerle4" => Self::Peak,
            "Bennett5" => Self::Relaxation,
            _ => return None,
        })
    }

    /// f(x; b). Only Nelson's model has a second predictor.
    pub fn value<T: Scalar>(self, b: &[T], [x, x2]: [f64; 2]) -> T {
        use std::f64::consts::PI;
        let peak = |height: T, centre: T, width: T| {
            let z = (-centre + x) / width;
            height * (-(z * z)).exp()
        };
        let decay = |rate: T| (-rate * x).exp();
        let growth = |b: &[T]| (b[1] - b[2] * x).exp() + 1.0;
        match self {
            Self::Saturation => b[0] * (-decay(b[1]) + 1.0),
            Self::SquaredSaturation => b[0] * (-(b[1] * x / 2.0 + 1.0).powi(-2) + 1.0),
            Self::RootSaturation => b[0] * (-(b[1] * x * 2.0 + 1.0).powf(-0.5) + 1.0),
            Self::Hyperbola => b[0] * b[1] * x / (b[1] * x + 1.0),
            Self::DampedHyperbola => decay(b[0]) / (b[1] + b[2] * x),
            Self::ThreeExponentials => b[0] * decay(b[1]) + b[2] * decay(b[3]) + b[4] * decay(b[5]),
            Self::TwoPeaks => b[0] * decay(b[1]) + peak(b[2], b[3], b[4]) + peak(b[5], b[6], b[7]),
            Self::Power => b[0] * (b[1] * x.ln()).exp(),
            Self::QuadraticOverQuadratic => {
                (b[0] + (b[1] + b[2] * x) * x) / ((b[3] + b[4] * x) * x + 1.0)
            }
            Self::CubicOverCubic => {
                (b[0] + (b[1] + (b[2] + b[3] * x) * x) * x)
                    / ((b[4] + (b[5] + b[6] * x) * x) * x + 1.0)
            }
            Self::Degradation => b[0] - b[1] * x * (-b[2] * x2).exp(),
            Self::TwoExponentials => b[0] + b[1] * decay(b[3]) + b[2] * decay(b[4]),
            Self::QuantumDefect => b[0] - b[1] * x - (b[2] / (-b[3] + x)).atan() / PI,
            Self::ThreeWaves => {
                let year = 2.0 * PI * x / 12.0;
                let wave = |period: T, cos: T, sin: T| {
                    let (s, c) = (period.recip() * (2.0 * PI * x)).sin_cos();
                    cos * c + sin * s
                };
                b[0] + b[1] * year.cos()
                    + b[2] * year.sin()
                    + wave(b[3], b[4], b[5])
                    + wave(b[6], b[7], b[8])
            }
            Self::Enzyme => b[0] * ((b[1] + x) * x) / ((b[2] + x) * x + b[3]),
            Self::Logistic => b[0] / growth(b),
            Self::RichardsGrowth => b[0] / growth(b).powd(b[3].recip()),
            Self::Thermistor => b[0] * (b[1] / (b[2] + x)).exp(),
            Self::Peak => {
                let z = (-b[2] + x) / b[1];
                b[0] / b[1] * (z * z * -0.5).exp()
            }
            Self::Relaxation => b[0] * (b[1] + x).powd(-b[2].recip()),
        }
    }

    /// What is fitted for an observed y: its logarithm in Nelson's model, y itself in all others.
    pub fn response(self, y: f64) -> f64 {
        match self {
            Self::Degradation => y.ln(),
            _ => y,
        }
    }
}

/// One observation: f(x; b) − y.
pub struct Observation {
    /// Which curve it is on.
    pub model: Model,
    /// Predictors; the second is zero where there is only one.
    pub x: [f64; 2],
    /// What was observed, transformed as the model says.
    pub y: f64,
}

impl Constraint for Observation {
    type Vars = (Vector,);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (b,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = self.model.value(b, self.x) - self.y;
    }
}
