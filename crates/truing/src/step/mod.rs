//! Steps: min ½‖Jδ + r‖² + ½λ‖Dδ‖², with or without bounds on δ.

mod box_qp;
mod qr;

pub use box_qp::box_qp;
pub use qr::{Qr, triangle};

use crate::least_squares::{Linearization, StepBounds};

/// A step and what the linear model says of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// δ, one number a column of J; zero where a column is not free.
    pub delta: Vec<f64>,
    /// Decrease of ½‖Jδ + r‖² that the linear model promises, at least zero.
    pub predicted: f64,
    /// ‖Dδ‖.
    pub scaled_norm: f64,
}

impl Step {
    /// ‖δ‖.
    pub fn length(&self) -> f64 {
        self.delta.iter().map(|d| d * d).sum::<f64>().sqrt()
    }
}

/// A column that cannot be told apart from those before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dependent {
    /// Which column of J.
    pub column: usize,
    /// What is left of the scaled column.
    pub pivot: f64,
    /// What would have sufficed.
    pub threshold: f64,
}

/// Solves for steps: `factor` once a linearisation, `step` once a trial.
///
/// The split keeps the expensive factorisation of J (rows × cols) out of the damping loop, which
/// only refactors the small triangle.
pub trait StepSolver {
    /// Takes in J and r; `scale` is the diagonal of D, one positive number for each free column.
    fn factor(&mut self, lin: &Linearization, free: &[usize], scale: &[f64]);

    /// The minimiser of ½‖Jδ + r‖² + ½λ‖Dδ‖² over the free columns, inside the bounds.
    ///
    /// # Errors
    /// With λ = 0, names the first free column that depends on those before it.
    fn step(&mut self, lambda: f64, bounds: Option<&StepBounds>) -> Result<Step, Dependent>;

    /// The solution a of (JᵀJ + λD²) a = −g over the free columns, with the λ of the last step and
    /// g one number a column; `None` where the solver cannot tell. Second-order corrections of a
    /// step are made with it.
    fn correction(&self, _g: &[f64]) -> Option<Vec<f64>> {
        None
    }
}
