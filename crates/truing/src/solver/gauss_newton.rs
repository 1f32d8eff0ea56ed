//! Gauss–Newton.

use super::current::Current;
use super::stop::{Termination, Tolerances};
use super::{Evaluations, Explains, SolverState};
use crate::least_squares::LeastSquares;
use crate::step::{Bounded, NoStep, Qr, StepSolver};
use argmin::argmin_error_closure;
use argmin::core::{KV, Problem, Solver, TerminationStatus};
use argmin::kv;
use serde::{Deserialize, Serialize};

/// Gauss–Newton with full steps: min ‖Jδ + r‖².
///
/// Every step is taken, whether it lowers the cost or not: this is the plain method, fast near the
/// solution and without a safeguard elsewhere. Columns that depend on others end it with
/// [`Termination::Singular`].
///
/// # Requirements
/// The problem implements [`LeastSquares`]; argmin's executor drives it.
///
/// # Reference
/// Nocedal & Wright, section 10.3. Unlike argmin's own `GaussNewton` it solves by QR and does not
/// invert JᵀJ.
#[derive(Clone, Serialize, Deserialize)]
pub struct GaussNewton<S = Qr> {
    tolerances: Tolerances,
    scale: Vec<f64>,
    evaluations: Evaluations,
    termination: Option<Termination>,
    #[serde(skip, default)]
    step: Bounded<S>,
    #[serde(skip)]
    current: Option<Current>,
}

impl GaussNewton {
    /// With the default tolerances and dense QR.
    pub fn new() -> Self {
        Self::with_step_solver(Qr::default())
    }
}

impl Default for GaussNewton {
    fn default() -> Self {
        Self::new()
    }
}

impl<S: StepSolver> GaussNewton<S> {
    /// With another step solver.
    pub fn with_step_solver(step: S) -> Self {
        Self {
            tolerances: Tolerances::default(),
            scale: Vec::new(),
            evaluations: Evaluations::default(),
            termination: None,
            step: Bounded::new(step),
            current: None,
        }
    }

    /// With other tolerances.
    #[must_use]
    pub fn tolerances(mut self, tolerances: Tolerances) -> Self {
        self.tolerances = tolerances;
        self
    }
}

impl<S> Explains for GaussNewton<S> {
    fn termination(&self) -> Option<Termination> {
        self.termination.clone()
    }

    fn evaluations(&self) -> Evaluations {
        self.evaluations
    }
}

impl<O, S> Solver<O, SolverState<O::Point>> for GaussNewton<S>
where
    O: LeastSquares,
    S: StepSolver,
{
    fn name(&self) -> &str {
        "Gauss-Newton"
    }

    fn init(
        &mut self,
        problem: &mut Problem<O>,
        mut state: SolverState<O::Point>,
    ) -> Result<(SolverState<O::Point>, Option<KV>), argmin::core::Error> {
        let x = state.take_param().ok_or_else(argmin_error_closure!(
            NotInitialized,
            "Gauss-Newton needs a starting point: configure(|state| state.param(x))"
        ))?;
        let current = problem.problem("linearize_count", |p| {
            let mut current = Current::start(p, &x)?;
            self.termination =
                current.look(p, &x, &mut self.scale, &mut self.step, &self.tolerances);
            Ok(current)
        })?;
        self.evaluations.jacobian += 1;
        let cost = current.lin.cost;
        self.current = Some(current);
        Ok((state.param(x).cost(cost), None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<O>,
        mut state: SolverState<O::Point>,
    ) -> Result<(SolverState<O::Point>, Option<KV>), argmin::core::Error> {
        let x = state.take_param().ok_or_else(argmin_error_closure!(
            PotentialBug,
            "Gauss-Newton lost its point"
        ))?;
        let mut current = match self.current.take() {
            Some(current) => current,
            None => problem.problem("linearize_count", |p| {
                let mut current = Current::start(p, &x)?;
                current.look(p, &x, &mut self.scale, &mut self.step, &self.tolerances);
                Ok(current)
            })?,
        };
        let cost = current.lin.cost;
        let step = match self.step.step(0.0, current.bounds.as_ref()) {
            Ok(step) => step,
            Err(NoStep::Dependent {
                column,
                pivot,
                threshold,
            }) => {
                let column =
                    problem.problem("describe_count", |p| Ok(p.describe_column(column)))?;
                self.termination = Some(Termination::Singular {
                    column,
                    pivot,
                    threshold,
                });
                self.current = Some(current);
                return Ok((state.param(x).cost(cost), None));
            }
            Err(NoStep::Limits) => {
                self.termination = Some(Termination::Stalled {
                    lambda: 0.0,
                    promised: f64::NAN,
                });
                self.current = Some(current);
                return Ok((state.param(x).cost(cost), None));
            }
        };
        let iteration = state.iter + 1;
        let (trial, size) = problem.problem("linearize_count", |p| {
            let trial = p.plus(&x, &step.delta);
            current.linearize(p, &trial);
            Ok((trial, p.norm(&x)))
        })?;
        self.evaluations.jacobian += 1;
        if !current.usable() {
            self.termination = Some(Termination::Diverged { iteration });
            return Ok((state.param(x).cost(cost), None));
        }
        let relative = step.length() / (size + self.tolerances.step);
        let promised = step.predicted / cost.max(f64::MIN_POSITIVE);
        self.termination = problem.problem("describe_count", |p| {
            Ok(current.look(p, &trial, &mut self.scale, &mut self.step, &self.tolerances))
        })?;
        // A step that changes r by less than its rounding is no step.
        let rounding = 0.5 * current.rounding * current.rounding / cost.max(f64::MIN_POSITIVE);
        let tolerance = self.tolerances.cost.max(rounding);
        if self.termination.is_none() && promised <= tolerance {
            self.termination = Some(Termination::Cost {
                value: promised,
                tolerance,
            });
        } else if self.termination.is_none() && relative <= self.tolerances.step {
            self.termination = Some(Termination::Step {
                value: relative,
                tolerance: self.tolerances.step,
            });
        }
        let cost = current.lin.cost;
        self.current = Some(current);
        Ok((
            state.param(trial).cost(cost),
            Some(kv!("step" => relative; "predicted" => promised;)),
        ))
    }

    fn terminate(&mut self, _state: &SolverState<O::Point>) -> TerminationStatus {
        super::stop::status(self.termination.as_ref())
    }
}
