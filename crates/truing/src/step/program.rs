//! Quadratic programs by clarabel, in one solver object that is kept.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

/// min ½xᵀPx + qᵀx with b − Ax in a product of cones.
pub(super) struct Data {
    /// Upper triangle of P.
    pub p: CscMatrix<f64>,
    pub q: Vec<f64>,
    pub a: CscMatrix<f64>,
    pub b: Vec<f64>,
    pub cones: Vec<SupportedConeT<f64>>,
}

/// What clarabel found.
pub(super) struct Found {
    pub x: Vec<f64>,
    /// Slacks b − Ax.
    pub s: Vec<f64>,
    /// Multipliers of the rows.
    pub z: Vec<f64>,
}

/// A clarabel solver that is made once for a sparsity pattern and given new numbers afterwards.
#[derive(Default)]
pub(super) struct Program {
    solver: Option<DefaultSolver<f64>>,
    pattern: Pattern,
    /// How many solver objects were made.
    pub made: u64,
    /// How many programs were solved.
    pub solved: u64,
}

/// Starts and rows of P and A, and the cones: what may not change in a solver object.
#[derive(Default, PartialEq)]
struct Pattern {
    p: (Vec<usize>, Vec<usize>),
    a: (Vec<usize>, Vec<usize>),
    cones: Vec<SupportedConeT<f64>>,
}

/// The solver object is not copied: the copy makes its own.
impl Clone for Program {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl Program {
    /// The solution, as far as clarabel came; `None` if it says that there is none, or breaks down.
    pub fn solve(&mut self, data: &Data) -> Option<Found> {
        let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        if ![&data.p.nzval, &data.q, &data.a.nzval, &data.b]
            .iter()
            .all(|values| finite(values))
        {
            return None;
        }
        let pattern = Pattern {
            p: (data.p.colptr.clone(), data.p.rowval.clone()),
            a: (data.a.colptr.clone(), data.a.rowval.clone()),
            cones: data.cones.clone(),
        };
        let kept = self.solver.take().filter(|_| self.pattern == pattern);
        let updated = kept.and_then(|mut solver| {
            solver
                .update_data(&data.p, &data.q, &data.a, &data.b)
                .ok()
                .map(|()| solver)
        });
        let mut solver = match updated {
            Some(solver) => solver,
            None => {
                let settings = DefaultSettings::<f64> {
                    verbose: false,
                    // A solver object whose data may change neither presolves nor drops zeros.
                    presolve_enable: false,
                    input_sparse_dropzeros: false,
                    tol_gap_abs: 1e-12,
                    tol_gap_rel: 1e-12,
                    tol_feas: 1e-12,
                    ..DefaultSettings::default()
                };
                self.made += 1;
                self.pattern = pattern;
                DefaultSolver::new(&data.p, &data.q, &data.a, &data.b, &data.cones, settings)
                    .ok()?
            }
        };
        solver.solve();
        self.solved += 1;
        let nothing = matches!(
            solver.solution.status,
            SolverStatus::PrimalInfeasible
                | SolverStatus::AlmostPrimalInfeasible
                | SolverStatus::DualInfeasible
                | SolverStatus::AlmostDualInfeasible
        );
        let found = Found {
            x: solver.solution.x.clone(),
            s: solver.solution.s.clone(),
            z: solver.solution.z.clone(),
        };
        self.solver = Some(solver);
        let usable = [&found.x, &found.s, &found.z]
            .iter()
            .all(|values| finite(values));
        (!nothing && usable).then_some(found)
    }
}
