//! The choice of the linear algebra.

use super::sparse_qr::SparseTriangle;
use super::{Cholesky, Equalities, NoStep, Qr, Quadratic, SparseCholesky, SparseQr, StepSolver};
use crate::least_squares::{Linearization, Structure};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Which linear algebra makes the steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LinearSolver {
    /// Chosen from the structure of J: see [`AnyStep`].
    #[default]
    Auto,
    /// [`Qr`]: the most accurate; any number of rows, up to about a thousand columns.
    DenseQr,
    /// [`Cholesky`]: faster than dense QR, breaks down at κ(J) ≈ 10⁷.
    DenseCholesky,
    /// [`SparseCholesky`]: thousands of columns of which each meets few others; breaks down at
    /// κ(J) ≈ 10⁷.
    SparseCholesky,
    /// [`SparseQr`]: the same columns where J is worse conditioned, for several times the work.
    SparseQr,
}

/// Steps by the [`LinearSolver`] that was asked for, or by the one that the structure calls for:
///
/// - at most [`FEW_COLUMNS`] free columns: dense QR, the most accurate;
/// - more, and at most the part [`SPARSE`] of the Cholesky factor of JᵀJ filled after ordering:
///   sparse Cholesky;
/// - more, and a fuller factor, or a row of J that alone makes it so: dense QR.
///
/// Where the sparse Cholesky that was chosen breaks down with nothing to damp it (λ ≤ ε), sparse QR
/// has the last word on whether a column depends on others: Cholesky sees squares of lengths, and
/// cannot tell below 10⁻⁷.
#[derive(Debug, Clone, Default)]
pub struct AnyStep {
    asked: LinearSolver,
    chosen: Chosen,
    structure: Option<Arc<Structure>>,
    free: Vec<usize>,
    reason: String,
}

/// So few columns are dense whatever their structure.
pub const FEW_COLUMNS: usize = 100;

/// The part of the Cholesky factor's triangle that may be filled for sparse Cholesky to be chosen.
pub const SPARSE: f64 = 0.7;

#[derive(Debug, Clone)]
enum Chosen {
    DenseQr(Qr),
    DenseCholesky(Box<Cholesky>),
    SparseCholesky(Box<SparseCholesky>),
    SparseQr(Box<SparseQr>),
}

impl Default for Chosen {
    fn default() -> Self {
        Self::DenseQr(Qr::default())
    }
}

impl Chosen {
    fn solver(&self) -> &dyn StepSolver {
        match self {
            Self::DenseQr(solver) => solver,
            Self::DenseCholesky(solver) => &**solver,
            Self::SparseCholesky(solver) => &**solver,
            Self::SparseQr(solver) => &**solver,
        }
    }

    fn solver_mut(&mut self) -> &mut dyn StepSolver {
        match self {
            Self::DenseQr(solver) => solver,
            Self::DenseCholesky(solver) => &mut **solver,
            Self::SparseCholesky(solver) => &mut **solver,
            Self::SparseQr(solver) => &mut **solver,
        }
    }
}

impl AnyStep {
    /// By this linear algebra.
    pub fn new(asked: LinearSolver) -> Self {
        Self {
            asked,
            ..Self::default()
        }
    }

    /// The first linearisation of a structure: which solver, and why; it has factored already.
    fn choose(&mut self, lin: &Linearization, free: &[usize], scale: &[f64]) {
        let n = free.len();
        let columns = if n == 1 { "column" } else { "columns" };
        self.reason = format!("{n} {columns}");
        let asked = match self.asked {
            LinearSolver::Auto if n <= FEW_COLUMNS => LinearSolver::DenseQr,
            LinearSolver::Auto => {
                // A row with entries in t columns fills t² of JᵀJ: no need to look further.
                let most = longest_row(&lin.structure, free);
                if (most as f64).powi(2) > SPARSE * (n as f64).powi(2) {
                    self.reason = format!("{n} {columns}, {most} of them in one row");
                    LinearSolver::DenseQr
                } else {
                    LinearSolver::Auto
                }
            }
            asked => asked,
        };
        self.chosen = match asked {
            LinearSolver::DenseQr => Chosen::default(),
            LinearSolver::DenseCholesky => Chosen::DenseCholesky(Box::default()),
            LinearSolver::SparseQr => Chosen::SparseQr(Box::default()),
            LinearSolver::Auto | LinearSolver::SparseCholesky => {
                Chosen::SparseCholesky(Box::default())
            }
        };
        self.chosen.solver_mut().factor(lin, free, scale);
        if let Chosen::SparseCholesky(sparse) = &self.chosen {
            let (h, l) = sparse.inner().fill();
            self.reason = format!(
                "{n} {columns}, {} of JᵀJ is not zero, {} of its factor",
                percent(h),
                percent(l)
            );
            if self.asked == LinearSolver::Auto && l > SPARSE {
                self.chosen = Chosen::default();
                self.chosen.solver_mut().factor(lin, free, scale);
            }
        }
    }
}

/// The most entries that a row has in the free columns.
fn longest_row(structure: &Structure, free: &[usize]) -> usize {
    let mut counts = vec![0; structure.rows];
    for column in free {
        let entries = structure.column_starts[*column]..structure.column_starts[column + 1];
        (structure.row_indices[entries].iter()).for_each(|row| counts[*row] += 1);
    }
    counts.into_iter().max().unwrap_or(0)
}

fn percent(part: f64) -> String {
    format!(
        "{:.2$} {}",
        100.0 * part,
        "%",
        if part < 0.095 { 1 } else { 0 }
    )
}

impl StepSolver for AnyStep {
    fn factor(&mut self, lin: &Linearization, free: &[usize], scale: &[f64]) {
        let known = self.free == free
            && (self.structure.as_ref()).is_some_and(|old| Arc::ptr_eq(old, &lin.structure));
        if known {
            return self.chosen.solver_mut().factor(lin, free, scale);
        }
        self.structure = Some(lin.structure.clone());
        self.free = free.to_vec();
        self.choose(lin, free, scale);
    }

    fn solve(&mut self, lambda: f64, equalities: Option<&Equalities>) -> Result<Vec<f64>, NoStep> {
        let solved = self.chosen.solver_mut().solve(lambda, equalities);
        match &self.chosen {
            Chosen::SparseCholesky(sparse)
                if solved.is_err()
                    && self.asked == LinearSolver::Auto
                    && lambda <= f64::EPSILON =>
            {
                let mut careful: SparseQr = sparse.by::<SparseTriangle>();
                careful.solve(lambda, equalities)
            }
            _ => solved,
        }
    }

    fn gradient(&self, y: &[f64]) -> Vec<f64> {
        self.chosen.solver().gradient(y)
    }

    fn predicted(&self, y: &[f64]) -> f64 {
        self.chosen.solver().predicted(y)
    }

    fn quadratic(&self) -> Quadratic {
        self.chosen.solver().quadratic()
    }

    fn correction(&self, g: &[f64]) -> Option<Vec<f64>> {
        self.chosen.solver().correction(g)
    }

    fn name(&self) -> &'static str {
        self.chosen.solver().name()
    }

    fn reason(&self) -> Option<String> {
        (!self.reason.is_empty()).then(|| self.reason.clone())
    }
}
