//! Levenberg–Marquardt.

use super::current::Current;
use super::stop::{Termination, Tolerances};
use super::{Evaluations, Explains, SolverState};
use crate::least_squares::LeastSquares;
use crate::step::{Qr, StepSolver};
use argmin::argmin_error_closure;
use argmin::core::{KV, Problem, Solver, TerminationStatus};
use argmin::kv;
use serde::{Deserialize, Serialize};

/// Levenberg–Marquardt: min ½‖Jδ + r‖² + ½λ‖Dδ‖², D the largest column norms seen so far.
///
/// One iteration is one trial step. The gain ratio, actual over predicted decrease, is that of the
/// undamped model over the free columns under bounds and losses, so it tends to one at every
/// regular minimum. A trial whose cost is not finite is a rejected step.
///
/// # Requirements
/// The problem implements [`LeastSquares`]; argmin's executor drives it
/// (`Executor::new(&problem, LevenbergMarquardt::new())`), with its observers, checkpoints, timeout
/// and Ctrl-C.
///
/// # Reference
/// Moré 1978, "The Levenberg–Marquardt algorithm: implementation and theory" (scaling);
/// Nielsen 1999, "Damping parameter in Marquardt's method" (update of λ);
/// Nocedal & Wright, section 10.3.
#[derive(Clone, Serialize, Deserialize)]
pub struct LevenbergMarquardt<S = Qr> {
    tolerances: Tolerances,
    lambda: f64,
    /// Factor by which the next rejection raises λ.
    raise: f64,
    scale: Vec<f64>,
    evaluations: Evaluations,
    termination: Option<Termination>,
    #[serde(skip)]
    step: S,
    #[serde(skip)]
    current: Option<Current>,
}

const INITIAL_LAMBDA: f64 = 1e-4;
const MIN_LAMBDA: f64 = 1e-20;
const MAX_LAMBDA: f64 = 1e24;
/// A relative decrease below which the difference of two costs is rounding.
const ROUNDING: f64 = 1e-12;

impl LevenbergMarquardt {
    /// With the default tolerances and dense QR.
    pub fn new() -> Self {
        Self::with_step_solver(Qr::default())
    }
}

impl Default for LevenbergMarquardt {
    fn default() -> Self {
        Self::new()
    }
}

impl<S: StepSolver> LevenbergMarquardt<S> {
    /// With another step solver.
    pub fn with_step_solver(step: S) -> Self {
        Self {
            tolerances: Tolerances::default(),
            lambda: INITIAL_LAMBDA,
            raise: 2.0,
            scale: Vec::new(),
            evaluations: Evaluations::default(),
            termination: None,
            step,
            current: None,
        }
    }

    /// With other tolerances.
    #[must_use]
    pub fn tolerances(mut self, tolerances: Tolerances) -> Self {
        self.tolerances = tolerances;
        self
    }

    /// With another damping at the start (1e-4 by default, relative to the scaled columns).
    #[must_use]
    pub fn initial_damping(mut self, lambda: f64) -> Self {
        self.lambda = lambda.clamp(MIN_LAMBDA, MAX_LAMBDA);
        self
    }

    /// Whether even the undamped step promises nothing or is down to rounding: a rejected trial is
    /// then the end of the road and not a lack of damping.
    fn exhausted(&mut self, current: &Current, size: f64) -> Option<Termination> {
        let step = self.step.step(MIN_LAMBDA, current.bounds.as_ref()).ok()?;
        let promised = step.predicted / current.lin.cost.max(f64::MIN_POSITIVE);
        let tolerance = self.tolerances.cost.max(ROUNDING);
        if promised <= tolerance {
            return Some(Termination::Cost {
                value: promised,
                tolerance,
            });
        }
        let relative = step.length() / (size + self.tolerances.step);
        (relative <= self.tolerances.step).then_some(Termination::Step {
            value: relative,
            tolerance: self.tolerances.step,
        })
    }
}

impl<S> Explains for LevenbergMarquardt<S> {
    fn termination(&self) -> Option<Termination> {
        self.termination.clone()
    }

    fn evaluations(&self) -> Evaluations {
        self.evaluations
    }
}

impl<O, S> Solver<O, SolverState<O::Point>> for LevenbergMarquardt<S>
where
    O: LeastSquares,
    S: StepSolver,
{
    fn name(&self) -> &str {
        "Levenberg-Marquardt"
    }

    fn init(
        &mut self,
        problem: &mut Problem<O>,
        mut state: SolverState<O::Point>,
    ) -> Result<(SolverState<O::Point>, Option<KV>), argmin::core::Error> {
        let x = state.take_param().ok_or_else(argmin_error_closure!(
            NotInitialized,
            "Levenberg-Marquardt needs a starting point: configure(|state| state.param(x))"
        ))?;
        let current = problem.problem("linearize_count", |p| {
            let current = Current::start(p, &x)?;
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
            "Levenberg-Marquardt lost its point"
        ))?;
        let mut current = match self.current.take() {
            Some(current) => current,
            // Resumed from a checkpoint: everything but the numbers is made again.
            None => problem.problem("linearize_count", |p| {
                let current = Current::start(p, &x)?;
                current.look(p, &x, &mut self.scale, &mut self.step, &self.tolerances);
                Ok(current)
            })?,
        };
        let cost = current.lin.cost;
        let Ok(step) = self.step.step(self.lambda, current.bounds.as_ref()) else {
            // Damping below rounding on dependent columns: damp more.
            self.reject();
            self.current = Some(current);
            return Ok((
                state.param(x).cost(cost),
                Some(kv!("lambda" => self.lambda;)),
            ));
        };
        let (trial, trial_cost, size) = problem.problem("residual_count", |p| {
            let trial = p.plus(&x, &step.delta);
            let cost = p.residual(&trial, &mut current.trial_residual);
            Ok((trial, cost, p.norm(&x)))
        })?;
        self.evaluations.residual += 1;

        let decrease = cost - trial_cost;
        let gain = decrease / step.predicted;
        let relative = step.length() / (size + self.tolerances.step);
        let metrics = kv!("lambda" => self.lambda; "gain" => gain; "step" => relative;);
        if trial_cost.is_finite() && decrease >= 0.0 && gain > 1e-4 {
            let shrink = if gain > 0.9 {
                0.1
            } else {
                (1.0 - (2.0 * gain - 1.0).powi(3)).max(1.0 / 3.0)
            };
            self.lambda = (self.lambda * shrink).max(MIN_LAMBDA);
            self.raise = 2.0;
            self.termination = problem.problem("linearize_count", |p| {
                current.linearize(p, &trial);
                Ok(current.look(p, &trial, &mut self.scale, &mut self.step, &self.tolerances))
            })?;
            self.evaluations.jacobian += 1;
            let promised = step.predicted / cost;
            if self.termination.is_none() && promised.max(decrease / cost) <= self.tolerances.cost {
                self.termination = Some(Termination::Cost {
                    value: promised,
                    tolerance: self.tolerances.cost,
                });
            } else if self.termination.is_none() && relative <= self.tolerances.step {
                self.termination = self.exhausted(&current, size);
            }
            let cost = current.lin.cost;
            self.current = Some(current);
            Ok((state.param(trial).cost(cost), Some(metrics)))
        } else {
            let rounding = decrease.abs() <= ROUNDING * cost || relative <= self.tolerances.step;
            if rounding || self.lambda >= MAX_LAMBDA {
                self.termination = self.exhausted(&current, size);
            }
            if self.termination.is_none() && self.lambda >= MAX_LAMBDA {
                let promised = step.predicted / cost;
                self.termination = Some(Termination::Stalled {
                    lambda: self.lambda,
                    promised,
                });
            }
            self.reject();
            self.current = Some(current);
            Ok((state.param(x).cost(cost), Some(metrics)))
        }
    }

    fn terminate(&mut self, _state: &SolverState<O::Point>) -> TerminationStatus {
        super::stop::status(self.termination.as_ref())
    }
}

impl<S> LevenbergMarquardt<S> {
    fn reject(&mut self) {
        self.lambda = (self.lambda * self.raise).min(MAX_LAMBDA);
        self.raise *= 2.0;
    }
}
