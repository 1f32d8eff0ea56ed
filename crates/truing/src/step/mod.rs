//! Steps: min ½‖Jδ + r‖² + ½λ‖Dδ‖², with or without limits on δ.
//!
//! A [`StepSolver`] is linear algebra: it factors J and solves for the step, with components held or
//! linear equalities where asked. [`Bounded`] puts inequalities on top of any of them, by clarabel.

mod any;
mod bounded;
mod cholesky;
mod factored;
mod jacobian;
mod kkt;
mod normal;
mod null_space;
mod program;
mod qr;
mod sparse_cholesky;
mod sparse_qr;
mod work;

pub use any::{AnyStep, FEW_COLUMNS, LinearSolver, SPARSE};
pub use bounded::Bounded;
pub use cholesky::{Cholesky, DenseLlt};
pub use factored::{Factored, REFINEMENTS};
pub use kkt::{ActiveAt, Kkt, Multiplier, Side, kkt};
pub(crate) use null_space::null_space;
pub use qr::{Qr, triangle};
pub use sparse_cholesky::{SparseCholesky, SparseLlt};
pub use sparse_qr::{SparseQr, SparseTriangle};

use crate::least_squares::Linearization;

/// A step and what the linear model says of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// δ, one number a column of J; zero where a column is not free.
    pub delta: Vec<f64>,
    /// Decrease of ½‖Jδ + r‖² that the linear model promises, at least zero.
    pub predicted: f64,
    /// ‖Dδ‖.
    pub scaled_norm: f64,
    /// Whether a limit changed it.
    pub limited: bool,
}

impl Step {
    /// ‖δ‖.
    pub fn length(&self) -> f64 {
        self.delta.iter().map(|d| d * d).sum::<f64>().sqrt()
    }
}

/// Why there is no step.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum NoStep {
    /// A column cannot be told apart from those before it, and nothing damps it.
    Dependent {
        /// Which column of J.
        column: usize,
        /// What is left of the scaled column.
        pivot: f64,
        /// What would have sufficed.
        threshold: f64,
    },
    /// No step was found that keeps all limits.
    Limits,
}

/// Equalities on a step, in the scaled free components y = Dδ.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Equalities {
    /// Where components are held; `None` for those that may move. One entry a free column.
    pub held: Vec<Option<f64>>,
    /// Rows Σ aₖ yₖ = b: the pairs (k, aₖ), and b.
    pub rows: Vec<(Vec<(usize, f64)>, f64)>,
}

/// The quadratic ½yᵀHy + qᵀy that a step minimises, in the scaled free components: H = D⁻¹JᵀJD⁻¹,
/// q = D⁻¹Jᵀr.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Quadratic {
    /// Start of every column of the upper triangle of H: n + 1 numbers.
    pub starts: Vec<usize>,
    /// Rows of its entries, ascending in a column, the diagonal last and always there.
    pub rows: Vec<usize>,
    /// Its entries.
    pub values: Vec<f64>,
    /// q.
    pub linear: Vec<f64>,
}

/// Solves for steps: [`factor`](Self::factor) once a linearisation, [`solve`](Self::solve) once a trial.
///
/// The split keeps the expensive factorisation of J (rows × cols) out of the damping loop. All
/// vectors are scaled and free: y = Dδ, one number a free column.
pub trait StepSolver {
    /// Takes in J and r; `scale` is the diagonal of D, one positive number for each free column.
    fn factor(&mut self, lin: &Linearization, free: &[usize], scale: &[f64]);

    /// The minimiser y of ½‖JD⁻¹y + r‖² + ½λ‖y‖² under the equalities.
    ///
    /// # Errors
    /// With λ = 0, names the first free column that depends on those before it.
    fn solve(&mut self, lambda: f64, equalities: Option<&Equalities>) -> Result<Vec<f64>, NoStep>;

    /// D⁻¹Jᵀ(JD⁻¹y + r): the gradient of the undamped model at y.
    fn gradient(&self, y: &[f64]) -> Vec<f64>;

    /// Decrease of ½‖r‖² that the undamped linear model promises for y.
    fn predicted(&self, y: &[f64]) -> f64;

    /// H and q, for a quadratic program.
    fn quadratic(&self) -> Quadratic;

    /// The solution a of (H + λI) a = −g, with the λ of the last [`solve`](Self::solve); `None`
    /// where the solver cannot tell. Second-order corrections of a step are made with it.
    fn correction(&self, _g: &[f64]) -> Option<Vec<f64>> {
        None
    }

    /// Its name in reports.
    fn name(&self) -> &'static str;

    /// Why it was chosen, in words; `None` where there was no choice.
    fn reason(&self) -> Option<String> {
        None
    }
}
