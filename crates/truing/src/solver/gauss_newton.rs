//! Gauss–Newton.

use super::current::Current;
use super::finish::exhausted;
use super::stop::{Termination, Tolerances};
use super::{Evaluations, Explains, SolverState};
use crate::least_squares::LeastSquares;
use crate::step::{Bounded, NoStep, Qr, Step, StepSolver};
use argmin::argmin_error_closure;
use argmin::core::{KV, Problem, Solver, TerminationStatus};
use argmin::kv;
use serde::{Deserialize, Serialize};

/// Gauss–Newton: min ‖Jδ + r‖².
///
/// Every step is taken whole, whether it lowers the cost or not: this is the plain method, fast near
/// the solution and without a safeguard elsewhere. With [`line_search`](Self::line_search) a step is
/// shortened until the cost falls as the gradient promises, at least by a part (Armijo). Columns that
/// depend on others end it with [`Termination::Singular`].
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
    line_search: bool,
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
            line_search: false,
            scale: Vec::new(),
            evaluations: Evaluations::default(),
            termination: None,
            step: Bounded::new(step),
            current: None,
        }
    }

    /// Whether steps are shortened until the cost falls (not by default).
    #[must_use]
    pub fn line_search(mut self, line_search: bool) -> Self {
        self.line_search = line_search;
        self
    }

    /// With other tolerances.
    #[must_use]
    pub fn tolerances(mut self, tolerances: Tolerances) -> Self {
        self.tolerances = tolerances;
        self
    }
}

/// The part of what the gradient promises that a shortened step must keep (Armijo's constant).
const ARMIJO: f64 = 1e-4;

/// A step is shortened at most this often; 2⁻⁵⁰ of it is rounding.
const SHORTENED: usize = 50;

impl<S: StepSolver> GaussNewton<S> {
    /// The part t of the step δ with cost(x ⊞ tδ) ≤ cost + 10⁻⁴ t gᵀδ, from one down by the minimum
    /// of the parabola through what is known, kept between a tenth and a half; `None` if the cost
    /// does not fall at all (Nocedal & Wright, section 3.5).
    fn search<O: LeastSquares>(
        &mut self,
        problem: &mut Problem<O>,
        x: &O::Point,
        step: &Step,
        current: &mut Current,
    ) -> Result<Option<f64>, argmin::core::Error> {
        let cost = current.lin.cost;
        let slope: f64 = (current.free.iter())
            .map(|column| current.lin.gradient(*column) * step.delta[*column])
            .sum();
        let mut length = 1.0;
        for _ in 0..SHORTENED {
            let delta: Vec<f64> = step.delta.iter().map(|d| length * d).collect();
            let trial = problem.problem("residual_count", |p| {
                Ok(p.residual(&p.plus(x, &delta), &mut current.trial_residual))
            })?;
            self.evaluations.residual += 1;
            if trial <= cost + ARMIJO * length * slope {
                // What a short step promises may be less than the rounding of the cost: nothing fell.
                let seen = length == 1.0 || -length * slope > current.noise() * cost;
                return Ok(seen.then_some(length));
            }
            let shorter = -0.5 * slope * length * length / (trial - cost - slope * length);
            length = if shorter.is_finite() {
                shorter.clamp(0.1 * length, 0.5 * length)
            } else {
                0.1 * length
            };
        }
        Ok(None)
    }
}

impl<S: StepSolver> Explains for GaussNewton<S> {
    fn termination(&self) -> Option<Termination> {
        self.termination.clone()
    }

    fn evaluations(&self) -> Evaluations {
        self.evaluations
    }

    fn linear_solver(&self) -> (&'static str, String) {
        self.step.described()
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
        let mut length = 1.0;
        if self.line_search {
            match self.search(problem, &x, &step, &mut current)? {
                Some(found) => length = found,
                None => {
                    let size = problem.problem("describe_count", |p| Ok(p.norm(&x)))?;
                    let ended = exhausted(
                        &mut self.step,
                        0.0,
                        &current,
                        &self.scale,
                        size,
                        &self.tolerances,
                    );
                    self.termination = ended.or(Some(Termination::Stalled {
                        lambda: 0.0,
                        promised: step.predicted / cost,
                    }));
                    self.current = Some(current);
                    return Ok((state.param(x).cost(cost), None));
                }
            }
        }
        let (trial, size) = problem.problem("linearize_count", |p| {
            let delta: Vec<f64> = step.delta.iter().map(|d| length * d).collect();
            let trial = p.plus(&x, &delta);
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
        } else if self.termination.is_none() && length * relative <= self.tolerances.step {
            self.termination = Some(Termination::Step {
                value: relative,
                tolerance: self.tolerances.step,
            });
        }
        let cost = current.lin.cost;
        self.current = Some(current);
        Ok((
            state.param(trial).cost(cost),
            Some(kv!("step" => length * relative; "predicted" => promised;)),
        ))
    }

    fn terminate(&mut self, _state: &SolverState<O::Point>) -> TerminationStatus {
        super::stop::status(self.termination.as_ref())
    }
}
