//! Powell's dogleg.

use super::current::Current;
use super::finish::{exhausted, polished};
use super::polish::UNDAMPED;
use super::stop::{Termination, Tolerances};
use super::{Evaluations, Explains, SolverState};
use crate::least_squares::{LeastSquares, StepBounds};
use crate::step::{Bounded, NoStep, Qr, Step, StepSolver};
use argmin::argmin_error_closure;
use argmin::core::{KV, Problem, Solver, TerminationStatus};
use argmin::kv;
use serde::{Deserialize, Serialize};

/// Powell's dogleg: a trust region ‖Dδ‖ ≤ Δ, D the largest column norms seen so far.
///
/// The step goes along the gradient to the minimum of the linear model, then bends towards the
/// Gauss–Newton step, as far as the region allows. One iteration is one trial step; a rejected trial
/// needs no new factorisation at all, which is where it is cheaper than
/// [`LevenbergMarquardt`](super::LevenbergMarquardt). Where a limit is in the way of the path, the
/// step is the minimiser in the ball and inside the limits, by clarabel's second-order cone.
///
/// # Requirements
/// The problem implements [`LeastSquares`]; argmin's executor drives it.
///
/// # Reference
/// Powell 1970, "A hybrid method for nonlinear equations"; Nocedal & Wright, sections 4.1 and 10.3.
#[derive(Clone, Serialize, Deserialize)]
pub struct Dogleg<S = Qr> {
    tolerances: Tolerances,
    /// Δ; zero before the first step.
    radius: f64,
    scale: Vec<f64>,
    evaluations: Evaluations,
    termination: Option<Termination>,
    #[serde(skip, default)]
    step: Bounded<S>,
    #[serde(skip)]
    current: Option<Current>,
    #[serde(skip)]
    path: Option<Path>,
}

/// The damping whose step's length is the first radius.
const FIRST_DAMPING: f64 = 1e-4;

/// The path of one linearisation, scaled: it does not depend on the radius.
#[derive(Debug, Clone)]
struct Path {
    /// The minimum along the gradient.
    cauchy: Vec<f64>,
    /// The Gauss–Newton step.
    newton: Vec<f64>,
}

fn norm(y: &[f64]) -> f64 {
    y.iter().map(|y| y * y).sum::<f64>().sqrt()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Path {
    /// The point of the path at the radius, or its end inside.
    fn at(&self, radius: f64) -> Vec<f64> {
        if norm(&self.newton) <= radius {
            return self.newton.clone();
        }
        let length = norm(&self.cauchy);
        if length >= radius {
            return self.cauchy.iter().map(|y| y * radius / length).collect();
        }
        // ‖c + t (n − c)‖ = Δ, the root between zero and one.
        let way: Vec<f64> = (self.newton.iter().zip(&self.cauchy))
            .map(|(n, c)| n - c)
            .collect();
        let (a, b) = (dot(&way, &way), dot(&self.cauchy, &way));
        let room = radius * radius - length * length;
        // The form without cancellation for either sign of b.
        let root = (b * b + a * room).sqrt();
        let t = if b > 0.0 {
            room / (b + root)
        } else {
            (root - b) / a
        };
        (self.cauchy.iter().zip(&way))
            .map(|(c, w)| c + t * w)
            .collect()
    }
}

impl Dogleg {
    /// With the default tolerances and dense QR.
    pub fn new() -> Self {
        Self::with_step_solver(Qr::default())
    }
}

impl Default for Dogleg {
    fn default() -> Self {
        Self::new()
    }
}

impl<S: StepSolver> Dogleg<S> {
    /// With another step solver.
    pub fn with_step_solver(step: S) -> Self {
        Self {
            tolerances: Tolerances::default(),
            radius: 0.0,
            scale: Vec::new(),
            evaluations: Evaluations::default(),
            termination: None,
            step: Bounded::new(step),
            current: None,
            path: None,
        }
    }

    /// With other tolerances.
    #[must_use]
    pub fn tolerances(mut self, tolerances: Tolerances) -> Self {
        self.tolerances = tolerances;
        self
    }

    /// With another radius at the start, in lengths of scaled columns: δ that changes r by about as
    /// much. By default the length of a step with a small damping.
    #[must_use]
    pub fn initial_radius(mut self, radius: f64) -> Self {
        self.radius = radius;
        self
    }

    fn make_path(&mut self) -> Option<Path> {
        // Where J is singular a hardly damped step stands for the one that does not exist.
        let newton = (self.step.free_step(0.0))
            .or_else(|_| self.step.free_step(UNDAMPED))
            .ok()?;
        let gradient = self.step.gradient();
        let along = self.step.gradient_at(&gradient);
        // gᵀHg = gᵀ((Hg + g) − g).
        let curvature = dot(&gradient, &along) - dot(&gradient, &gradient);
        let length = dot(&gradient, &gradient) / curvature;
        length.is_finite().then(|| Path {
            cauchy: gradient.iter().map(|g| -length * g).collect(),
            newton,
        })
    }

    /// The step for the radius, inside the limits.
    fn trial(&mut self, bounds: Option<&StepBounds>) -> Result<Step, NoStep> {
        if self.path.is_none() {
            self.path = self.make_path();
        }
        if self.radius <= 0.0 {
            let first = self.step.step(FIRST_DAMPING, bounds)?;
            self.radius = first.scaled_norm;
        }
        if let Some(path) = &self.path {
            let step = self.step.along(path.at(self.radius));
            if bounds.is_none_or(|bounds| bounds.hold(&step.delta)) {
                return Ok(step);
            }
        }
        self.step.ball(self.radius, bounds)
    }
}

impl<S: StepSolver> Explains for Dogleg<S> {
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

impl<O, S> Solver<O, SolverState<O::Point>> for Dogleg<S>
where
    O: LeastSquares,
    S: StepSolver,
{
    fn name(&self) -> &str {
        "dogleg"
    }

    fn init(
        &mut self,
        problem: &mut Problem<O>,
        mut state: SolverState<O::Point>,
    ) -> Result<(SolverState<O::Point>, Option<KV>), argmin::core::Error> {
        let x = state.take_param().ok_or_else(argmin_error_closure!(
            NotInitialized,
            "the dogleg needs a starting point: configure(|state| state.param(x))"
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
        self.path = None;
        Ok((state.param(x).cost(cost), None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<O>,
        mut state: SolverState<O::Point>,
    ) -> Result<(SolverState<O::Point>, Option<KV>), argmin::core::Error> {
        let x = state.take_param().ok_or_else(argmin_error_closure!(
            PotentialBug,
            "the dogleg lost its point"
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
        let Ok(step) = self.trial(current.bounds.as_ref()) else {
            self.termination = Some(Termination::Stalled {
                lambda: 0.0,
                promised: f64::NAN,
            });
            self.current = Some(current);
            return Ok((state.param(x).cost(cost), None));
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
        let metrics = kv!("radius" => self.radius; "gain" => gain; "step" => relative;);
        let mut accepted = trial_cost.is_finite() && decrease >= 0.0 && gain > 1e-4;
        if accepted {
            accepted = problem.problem("linearize_count", |p| {
                current.linearize(p, &trial);
                self.evaluations.jacobian += 1;
                if current.usable() {
                    return Ok(true);
                }
                current.linearize(p, &x);
                self.evaluations.jacobian += 1;
                Ok(false)
            })?;
        }
        // Nocedal & Wright, algorithm 4.1: the region follows how well the model did.
        let before = self.radius;
        if !accepted || gain < 0.25 {
            self.radius = 0.25 * step.scaled_norm.min(self.radius);
        } else if gain > 0.75 {
            self.radius = self.radius.max(3.0 * step.scaled_norm);
        }
        // The damping that a region of this size amounts to, for the question whether it is over.
        let damping = step.predicted / (step.scaled_norm * step.scaled_norm);
        let damping = if damping.is_finite() { damping } else { 1.0 };
        if accepted {
            self.path = None;
            current.fading = (trial_cost / cost).sqrt();
            self.termination = problem.problem("describe_count", |p| {
                Ok(current.look(p, &trial, &mut self.scale, &mut self.step, &self.tolerances))
            })?;
            let promised = step.predicted / cost;
            let small = promised.max(decrease / cost) <= self.tolerances.cost
                || relative <= self.tolerances.step;
            if self.termination.is_none() && small {
                self.termination = exhausted(
                    &mut self.step,
                    damping,
                    &current,
                    &self.scale,
                    size,
                    &self.tolerances,
                );
            }
        } else {
            let rounding =
                decrease.abs() <= current.noise() * cost || relative <= self.tolerances.step;
            let tiny = before.is_nan() || relative <= f64::EPSILON * self.tolerances.step;
            if rounding || tiny {
                self.termination = exhausted(
                    &mut self.step,
                    damping,
                    &current,
                    &self.scale,
                    size,
                    &self.tolerances,
                );
            }
            if self.termination.is_none() && tiny {
                self.termination = Some(Termination::Stalled {
                    lambda: damping,
                    promised: step.predicted / cost,
                });
            }
        }
        let x = if accepted { trial } else { x };
        let (x, cost) = polished(
            problem,
            &mut self.step,
            self.termination.as_ref(),
            damping,
            x,
            &mut current,
            &mut self.scale,
            &mut self.evaluations,
            &self.tolerances,
        )?;
        self.current = Some(current);
        Ok((state.param(x).cost(cost), Some(metrics)))
    }

    fn terminate(&mut self, _state: &SolverState<O::Point>) -> TerminationStatus {
        super::stop::status(self.termination.as_ref())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn the_path_meets_the_radius_and_ends_at_the_newton_step() {
        let path = Path {
            cauchy: vec![1.0, 0.0],
            newton: vec![2.0, 3.0],
        };
        assert_eq!(path.at(0.5), [0.5, 0.0]);
        assert_eq!(path.at(4.0), [2.0, 3.0]);
        let between = path.at(2.0);
        assert_relative_eq!(norm(&between), 2.0, epsilon = 1e-14);
        // On the second leg: (between − cauchy) is along (1, 3).
        assert_relative_eq!(between[1], 3.0 * (between[0] - 1.0), epsilon = 1e-14);
    }
}
