//! Levenberg–Marquardt.

use super::current::Current;
use super::finish::{exhausted, polished};
use super::stop::{Termination, Tolerances};
use super::{Evaluations, Explains, SolverState};
use crate::least_squares::LeastSquares;
use crate::step::{Bounded, Qr, Step, StepSolver};
use argmin::argmin_error_closure;
use argmin::core::{KV, Problem, Solver, TerminationStatus};
use argmin::kv;
use serde::{Deserialize, Serialize};

/// Levenberg–Marquardt: min ½‖Jδ + r‖² + ½λ‖Dδ‖², D the largest column norms seen so far, faded as
/// the residual has shrunk since.
///
/// One iteration is one trial step. The gain ratio, actual over predicted decrease, is that of the
/// undamped model over the free columns under bounds, so without robust losses it tends to one at
/// every regular minimum. A trial whose cost or Jacobian is not finite is a rejected step.
///
/// Where a trial gained less than promised, the next one bends with the valley: a second-order
/// correction for one more residual (geodesic acceleration; not where a limit is active or losses are robust). A step
/// longer than the point itself, ‖Dδ‖ > ‖Dx‖, is only taken where that correction is small.
///
/// It ends with a few steps that the cost is too flat to see, each judged by the next: the point has
/// the digits that its equations give it, not half of them.
///
/// # Requirements
/// The problem implements [`LeastSquares`]; argmin's executor drives it
/// (`Executor::new(&problem, LevenbergMarquardt::new())`), with its observers, checkpoints, timeout
/// and Ctrl-C.
///
/// # Reference
/// Moré 1978, "The Levenberg–Marquardt algorithm: implementation and theory" (scaling);
/// Nielsen 1999, "Damping parameter in Marquardt's method" (update of λ);
/// Transtrum & Sethna 2012, "Improvements to the Levenberg-Marquardt algorithm for nonlinear
/// least-squares minimization" (geodesic acceleration);
/// Nocedal & Wright, section 10.3.
#[derive(Clone, Serialize, Deserialize)]
pub struct LevenbergMarquardt<S = Qr> {
    tolerances: Tolerances,
    lambda: f64,
    /// Factor by which the next rejection raises λ.
    raise: f64,
    /// Whether the last trial gained less than the linear model promised: the path bends.
    curved: bool,
    scale: Vec<f64>,
    /// Size of the largest point seen: what the length of a last step is compared to.
    size: f64,
    evaluations: Evaluations,
    termination: Option<Termination>,
    #[serde(skip, default)]
    step: Bounded<S>,
    #[serde(skip)]
    current: Option<Current>,
}

const INITIAL_LAMBDA: f64 = 1e-4;
const MIN_LAMBDA: f64 = 1e-30;
const MAX_LAMBDA: f64 = 1e24;
/// Times its own size that a component may move without a look at the second order.
const FAR: f64 = 100.0;

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
            curved: false,
            scale: Vec::new(),
            size: 0.0,
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

    /// With another damping at the start (1e-4 by default, relative to the scaled columns).
    #[must_use]
    pub fn initial_damping(mut self, lambda: f64) -> Self {
        self.lambda = lambda.clamp(MIN_LAMBDA, MAX_LAMBDA);
        self
    }

    /// Whether a step goes farther than what x itself is: ‖Dδ‖ > ‖Dx‖, or, for what r hardly sees here,
    /// a component a hundred times its own size (zero has none).
    fn leaps(&self, current: &Current, step: &Step, sizes: &[f64]) -> bool {
        let columns = || current.free.iter().zip(&self.scale);
        let squares = columns().map(|(column, scale)| (scale * sizes[*column]).powi(2));
        let far = |(column, _): (&usize, &f64)| {
            sizes[*column] > 0.0 && step.delta[*column].abs() > FAR * sizes[*column]
        };
        step.scaled_norm > squares.sum::<f64>().sqrt() || columns().any(far)
    }
}

impl<S: StepSolver> LevenbergMarquardt<S> {
    fn exhausted(&mut self, current: &Current, size: f64) -> Option<Termination> {
        let (step, scale) = (&mut self.step, &self.scale);
        exhausted(step, self.lambda, current, scale, size, &self.tolerances)
    }

    fn polished<O: LeastSquares>(
        &mut self,
        problem: &mut Problem<O>,
        x: O::Point,
        current: &mut Current,
    ) -> Result<(O::Point, f64), argmin::core::Error> {
        polished(
            problem,
            &mut self.step,
            self.termination.as_ref(),
            self.lambda,
            x,
            current,
            &mut self.scale,
            &mut self.evaluations,
            &self.tolerances,
        )
    }
}

/// Length of the finite difference along a step, as a part of it.
const PROBE: f64 = 0.1;

/// The correction may be this much of the step (twice its length over the step's, scaled).
const BEND: f64 = 0.75;

/// Below this the path is straight: the correction need not be computed.
const STRAIGHT: f64 = 1e-3;

/// A step with its second-order correction.
struct Bent {
    delta: Vec<f64>,
    /// Twice the length of the correction over that of the step, scaled.
    ratio: f64,
}

impl<S: StepSolver> LevenbergMarquardt<S> {
    /// The step v with its second-order correction, v + ½a: geodesic acceleration, which follows a
    /// bent valley where the straight step would leave it.
    ///
    /// (JᵀJ + λD²) a = −Jᵀ r″, with r″ = 2/h · ((r(x ⊞ hv) − r)/h − Jv) the second derivative along
    /// the step, for one more residual. `None` where the correction is longer than the series can
    /// be trusted for.
    fn bend<O: LeastSquares>(
        &self,
        problem: &O,
        x: &O::Point,
        step: &Step,
        current: &mut Current,
    ) -> Option<Bent> {
        let probe: Vec<f64> = step.delta.iter().map(|d| PROBE * d).collect();
        problem.residual(&problem.plus(x, &probe), &mut current.trial_residual);
        let lin = &current.lin;
        let second = &mut current.trial_residual;
        for (second, r) in second.iter_mut().zip(&lin.residual) {
            *second = (*second - r) / PROBE;
        }
        for column in &current.free {
            let delta = step.delta[*column];
            lin.column(*column)
                .for_each(|(row, j)| second[row] -= j * delta);
        }
        let mut g = vec![0.0; step.delta.len()];
        for column in &current.free {
            g[*column] = 2.0 / PROBE
                * lin
                    .column(*column)
                    .map(|(row, j)| j * second[row])
                    .sum::<f64>();
        }
        let correction = self.step.correction(&g)?;
        let scaled = |delta: &[f64]| {
            let of = |(column, scale): (&usize, &f64)| (delta[*column] * scale).powi(2);
            current
                .free
                .iter()
                .zip(&self.scale)
                .map(of)
                .sum::<f64>()
                .sqrt()
        };
        let ratio = 2.0 * scaled(&correction) / scaled(&step.delta);
        let bent = |part: f64| -> Vec<f64> {
            let along = step.delta.iter().zip(&correction);
            along.map(|(v, a)| v + part * a).collect()
        };
        // Where the bent step would leave the limits the straight one is as good as the next.
        let keeps = |delta: &[f64]| (current.bounds.as_ref()).is_none_or(|b| b.hold(delta));
        (ratio <= BEND).then(|| Bent {
            delta: Some(bent(0.5))
                .filter(|delta| keeps(delta))
                .unwrap_or_else(|| step.delta.clone()),
            ratio,
        })
    }
}

impl<S: StepSolver> Explains for LevenbergMarquardt<S> {
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
            "Levenberg-Marquardt lost its point"
        ))?;
        let mut current = match self.current.take() {
            Some(current) => current,
            // Resumed from a checkpoint: everything but the numbers is made again.
            None => problem.problem("linearize_count", |p| {
                let mut current = Current::start(p, &x)?;
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
        let limited = step.limited;
        let (straight, size, sizes) = problem.problem("describe_count", |p| {
            Ok((limited || p.is_robust(), p.norm(&x), p.sizes(&x)))
        })?;
        let leap = self.leaps(&current, &step, &sizes);
        let bendable = !straight && (self.curved || leap);
        let bend = if bendable {
            self.evaluations.residual += 1;
            problem.problem("residual_count", |p| {
                Ok(self.bend(p, &x, &step, &mut current))
            })?
        } else {
            None
        };
        if bendable && leap && bend.is_none() && self.lambda < MAX_LAMBDA {
            // Far, and off the series: a lower cost there is luck, and often a plateau from which nothing
            // leads back.
            self.reject();
            self.curved = true;
            self.current = Some(current);
            let relative = step.length() / (size + self.tolerances.step);
            let metrics = kv!("lambda" => self.lambda; "gain" => 0.0; "step" => relative;);
            return Ok((state.param(x).cost(cost), Some(metrics)));
        }
        let (trial, trial_cost) = problem.problem("residual_count", |p| {
            let trial = p.plus(&x, bend.as_ref().map_or(&step.delta, |bend| &bend.delta));
            let cost = p.residual(&trial, &mut current.trial_residual);
            Ok((trial, cost))
        })?;
        self.evaluations.residual += 1;
        self.size = self.size.max(size);
        let size = self.size;

        let decrease = cost - trial_cost;
        let gain = decrease / step.predicted;
        let relative = step.length() / (size + self.tolerances.step);
        self.curved =
            gain.is_nan() || gain <= 0.9 || bend.as_ref().is_some_and(|bend| bend.ratio > STRAIGHT);
        let metrics = kv!("lambda" => self.lambda; "gain" => gain; "step" => relative;);
        let mut accepted = trial_cost.is_finite() && decrease >= 0.0 && gain > 1e-4;
        if accepted {
            accepted = problem.problem("linearize_count", |p| {
                current.linearize(p, &trial);
                self.evaluations.jacobian += 1;
                if current.usable() {
                    return Ok(true);
                }
                // The residual is finite there but a derivative is not: no step would lead on.
                current.linearize(p, &x);
                self.evaluations.jacobian += 1;
                Ok(false)
            })?;
        }
        if accepted {
            // On a straight path a gain near one says that the damping hardly matters any more.
            let shrink = if gain > 0.9 && !self.curved {
                0.1
            } else {
                (1.0 - (2.0 * gain - 1.0).powi(3)).max(1.0 / 3.0)
            };
            self.lambda = (self.lambda * shrink).max(MIN_LAMBDA);
            self.raise = 2.0;
            current.fading = (trial_cost / cost).sqrt();
            self.termination = problem.problem("describe_count", |p| {
                Ok(current.look(p, &trial, &mut self.scale, &mut self.step, &self.tolerances))
            })?;
            // A small step may be the damping's doing: only the undamped one can tell.
            let promised = step.predicted / cost;
            let small = promised.max(decrease / cost) <= self.tolerances.cost
                || relative <= self.tolerances.step;
            if self.termination.is_none() && small {
                self.termination = self.exhausted(&current, size);
            }
            let (trial, cost) = self.polished(problem, trial, &mut current)?;
            self.current = Some(current);
            Ok((state.param(trial).cost(cost), Some(metrics)))
        } else {
            let rounding =
                decrease.abs() <= current.noise() * cost || relative <= self.tolerances.step;
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
            let (x, cost) = self.polished(problem, x, &mut current)?;
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
