//! Solvers: Gauss–Newton, Levenberg–Marquardt and the dogleg as argmin `Solver`s, and [`solve`],
//! which runs them.
//!
//! # How to choose
//!
//! | you have | take |
//! | --- | --- |
//! | no reason for another | [`LevenbergMarquardt`], the default: far starts, rank deficiency, limits, bent valleys |
//! | a costly J, many rejected steps | [`Dogleg`]: a rejected step factors nothing |
//! | a good start, and a published method to repeat | [`GaussNewton`]: full steps, no safeguard |
//! | the same, and doubt about the start | [`GaussNewton`] with a line search: the cost never rises |
//! | several minima | [`multi_start`] with a [`Budget`] |
//! | gross errors | a [`Loss`](crate::Loss); a redescending one with [`solve_graduated`](crate::solve_graduated) |
//! | a cost that is no sum of squares, too | argmin's own solvers: [`Problem`] implements its traits |
//!
//! Left out, because measuring them on the published suites spoke against it: nonmonotone acceptance
//! (fewer trials, but MGH10 is lost) and bold acceptance of uphill steps (the same). Geodesic
//! acceleration stays: without it BoxBOD and MGH10 are lost from their first starts.

mod current;
mod dogleg;
mod finish;
mod gauss_newton;
mod levenberg_marquardt;
mod multi_start;
mod polish;
mod stop;

pub use dogleg::Dogleg;
pub use gauss_newton::GaussNewton;
pub use levenberg_marquardt::LevenbergMarquardt;
pub use multi_start::{Budget, Minimum, Search, SearchEnd, multi_start};
pub use stop::{Termination, Tolerances};

use crate::error::Error;
use crate::least_squares::{LeastSquares, Linearization};
use crate::problem::Problem;
use crate::solution::{BlockReport, Solution};
use crate::step::{ActiveAt, AnyStep, LinearSolver, Multiplier, Side, kkt};
use crate::variable::Values;
use argmin::core::observers::{Observe, ObserverMode};
use argmin::core::{Executor, IterState, KV, Solver, State, TerminationReason, TerminationStatus};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// argmin's state for our solvers: the point is the parameter, the cost is ½Σρ.
pub type SolverState<P> = IterState<P, (), (), (), (), f64>;

/// Which solver takes the steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// [`LevenbergMarquardt`]: the default; converges from far and tolerates rank deficiency.
    #[default]
    LevenbergMarquardt,
    /// [`GaussNewton`]: full steps; fast near the solution, no safeguard.
    GaussNewton,
    /// [`GaussNewton`] with a line search: the cost never rises; no help where J is singular.
    LineSearch,
    /// [`Dogleg`]: a trust region; rejected steps cost no factorisation.
    Dogleg,
}

/// What is told of every iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Iteration, from 1.
    pub iteration: u64,
    /// Lowest cost so far.
    pub cost: f64,
}

/// How [`solve`] goes about it.
#[derive(Clone, Default)]
pub struct Settings {
    /// Which solver.
    pub method: Method,
    /// Which linear algebra makes its steps; chosen from the structure of J by default.
    pub linear_solver: LinearSolver,
    /// When to stop.
    pub tolerances: Tolerances,
    /// Longest time; none by default.
    pub timeout: Option<Duration>,
    /// Set it (from a Ctrl-C handler, say) to stop after the iteration under way, with the best point so far.
    pub interrupt: Option<Arc<AtomicBool>>,
    /// Called after every iteration.
    pub progress: Option<Arc<dyn Fn(Progress) + Send + Sync>>,
}

struct Tell(Arc<dyn Fn(Progress) + Send + Sync>);

impl<P: Clone> Observe<SolverState<P>> for Tell {
    fn observe_iter(&mut self, state: &SolverState<P>, _: &KV) -> Result<(), argmin::core::Error> {
        (self.0)(Progress {
            iteration: state.get_iter() + 1,
            cost: state.get_best_cost(),
        });
        Ok(())
    }
}

/// A solver that can say how it ended.
pub trait Explains {
    /// Why it stopped, if it did so itself.
    fn termination(&self) -> Option<Termination>;
    /// Evaluations of the residual and of the Jacobian.
    fn evaluations(&self) -> Evaluations;
    /// The linear algebra of its steps by name, and why it is that one; empty where it has none.
    fn linear_solver(&self) -> (&'static str, String) {
        ("", String::new())
    }
}

/// How often the model was evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub struct Evaluations {
    /// Evaluations of r alone.
    pub residual: u64,
    /// Evaluations of r and J together.
    pub jacobian: u64,
}

/// The interruption of a wrapped solver by a flag.
struct Interruptible<S> {
    solver: S,
    flag: Option<Arc<AtomicBool>>,
}

impl<O, S: Solver<O, SolverState<O::Point>>> Solver<O, SolverState<O::Point>> for Interruptible<S>
where
    O: LeastSquares,
{
    fn name(&self) -> &str {
        self.solver.name()
    }

    fn init(
        &mut self,
        problem: &mut argmin::core::Problem<O>,
        state: SolverState<O::Point>,
    ) -> Result<(SolverState<O::Point>, Option<KV>), argmin::core::Error> {
        self.solver.init(problem, state)
    }

    fn next_iter(
        &mut self,
        problem: &mut argmin::core::Problem<O>,
        state: SolverState<O::Point>,
    ) -> Result<(SolverState<O::Point>, Option<KV>), argmin::core::Error> {
        self.solver.next_iter(problem, state)
    }

    fn terminate(&mut self, state: &SolverState<O::Point>) -> TerminationStatus {
        let own = self.solver.terminate(state);
        if !own.terminated()
            && self
                .flag
                .as_ref()
                .is_some_and(|flag| flag.load(Ordering::SeqCst))
        {
            return TerminationStatus::Terminated(TerminationReason::Interrupt);
        }
        own
    }
}

/// What [`run`] returns: the point, its cost, the cost at the start, iterations and how it ended.
#[derive(Debug, Clone)]
pub struct Outcome<P> {
    /// The point of convergence, or the best one if there was none.
    pub point: P,
    /// Its cost ½Σρ.
    pub cost: f64,
    /// The cost at the start.
    pub initial_cost: f64,
    /// Iterations: trial steps.
    pub iterations: u64,
    /// Model evaluations.
    pub evaluations: Evaluations,
    /// Why it stopped.
    pub termination: Termination,
    /// The limits that are active there.
    pub limits: Vec<ActiveLimit>,
    /// The linear algebra that made the steps.
    pub linear_solver: &'static str,
    /// Why it was that one, in words.
    pub linear_solver_reason: String,
}

/// A limit that is active at a solution.
#[derive(Debug, Clone, PartialEq)]
pub struct ActiveLimit {
    /// The component, or the linear limit, in words.
    pub name: String,
    /// Whose limit it is.
    pub limit: ActiveAt,
    /// Which side is active.
    pub side: Side,
    /// −∂cost/∂limit: by how much the cost would fall if the limit rose by one unit. Positive at an
    /// upper limit, negative at a lower one; zero where the limit holds nothing back.
    pub multiplier: f64,
}

/// The limits that are active at a point, with their multipliers.
pub fn active_limits<O: LeastSquares>(problem: &O, x: &O::Point) -> Vec<ActiveLimit> {
    let Some(bounds) = problem.step_bounds(x) else {
        return Vec::new();
    };
    let mut lin = Linearization::new(problem.structure());
    problem.linearize(x, &mut lin);
    kkt(&lin, &problem.free(), Some(&bounds))
        .multipliers
        .into_iter()
        .map(|Multiplier { limit, side, value }| ActiveLimit {
            name: match limit {
                ActiveAt::Column(column) => problem.describe_column(column),
                ActiveAt::Row(row) => problem.describe_limit(row),
            },
            limit,
            side,
            multiplier: value,
        })
        .collect()
}

/// Solves any least-squares problem from `start`.
///
/// # Errors
/// If there is no usable point: no rows, nothing free, a residual that is not finite at the start.
pub fn run<O: LeastSquares>(
    problem: &O,
    start: O::Point,
    settings: &Settings,
) -> Result<Outcome<O::Point>, Error> {
    let steps = AnyStep::new(settings.linear_solver);
    match settings.method {
        Method::LevenbergMarquardt => run_with(
            problem,
            start,
            LevenbergMarquardt::with_step_solver(steps).tolerances(settings.tolerances),
            settings,
        ),
        Method::GaussNewton => run_with(
            problem,
            start,
            GaussNewton::with_step_solver(steps).tolerances(settings.tolerances),
            settings,
        ),
        Method::LineSearch => run_with(
            problem,
            start,
            GaussNewton::with_step_solver(steps)
                .line_search(true)
                .tolerances(settings.tolerances),
            settings,
        ),
        Method::Dogleg => run_with(
            problem,
            start,
            Dogleg::with_step_solver(steps).tolerances(settings.tolerances),
            settings,
        ),
    }
}

fn run_with<O: LeastSquares, S>(
    problem: &O,
    start: O::Point,
    solver: S,
    settings: &Settings,
) -> Result<Outcome<O::Point>, Error>
where
    S: Explains,
    S: for<'p> Solver<&'p O, SolverState<O::Point>>,
{
    let structure = problem.structure();
    if structure.rows == 0 {
        return Err(Error::NoRows);
    }
    let mut residual = vec![0.0; structure.rows];
    let initial_cost = problem.residual(&start, &mut residual);
    let start = problem.feasible(&start)?;
    let limit = settings.tolerances.max_iterations;
    let solver = Interruptible {
        solver,
        flag: settings.interrupt.clone(),
    };
    let mut executor = Executor::new(problem, solver)
        .configure(|state: SolverState<O::Point>| state.param(start).max_iters(limit))
        .ctrlc(false)
        .timer(false);
    if let Some(timeout) = settings.timeout {
        executor = executor.timeout(timeout);
    }
    if let Some(progress) = &settings.progress {
        executor = executor.add_observer(Tell(progress.clone()), ObserverMode::Always);
    }
    let result = executor
        .run()
        .map_err(|error| match error.downcast::<Error>() {
            Ok(own) => own,
            Err(other) => Error::Executor(other.to_string()),
        })?;
    let state = result.state;
    let solver = result.solver.solver;
    let termination = solver
        .termination()
        .unwrap_or_else(|| match &state.termination_status {
            TerminationStatus::Terminated(TerminationReason::Timeout) => Termination::Timeout {
                seconds: settings.timeout.unwrap_or_default().as_secs_f64(),
            },
            TerminationStatus::Terminated(TerminationReason::Interrupt) => Termination::Interrupted,
            _ => Termination::MaxIterations { limit },
        });
    let iterations = state.get_iter();
    // A termination that says "converged" is about the last point; Gauss–Newton may have passed
    // through one of lower cost that is no minimum.
    let (cost, point) = if termination.converged() {
        (state.cost, state.param)
    } else {
        (state.best_cost, state.best_param.or(state.param))
    };
    let (linear_solver, linear_solver_reason) = solver.linear_solver();
    match point {
        Some(point) => Ok(Outcome {
            limits: active_limits(problem, &point),
            point,
            cost,
            initial_cost,
            iterations,
            evaluations: solver.evaluations(),
            termination,
            linear_solver,
            linear_solver_reason,
        }),
        None => Err(Error::Executor("it returned no point".into())),
    }
}

/// Solves a [`Problem`] from its starting values.
///
/// # Errors
/// If there is no usable point: no rows, nothing free, a residual that is not finite at the start.
/// Not converging is a [`Termination`] of the [`Solution`].
pub fn solve(problem: &Problem, settings: &Settings) -> Result<Solution, Error> {
    solve_from(problem, problem.initial(), settings)
}

/// Solves a [`Problem`] from other values than its own starting ones.
///
/// # Errors
/// As [`solve`].
pub fn solve_from(
    problem: &Problem,
    start: &Values,
    settings: &Settings,
) -> Result<Solution, Error> {
    let outcome = run(problem, start.clone(), settings)?;
    Ok(report(problem, start, outcome))
}

/// The solution that an outcome is, with every block's residuals and the outliers.
pub(crate) fn report(problem: &Problem, start: &Values, outcome: Outcome<Values>) -> Solution {
    let blocks = problem
        .blocks()
        .enumerate()
        .map(|(i, block)| {
            let rms = |x: &Values| {
                let r = problem.raw_residual(i, x);
                (r.iter().map(|r| r * r).sum::<f64>() / r.len().max(1) as f64).sqrt()
            };
            BlockReport {
                name: block.name().to_owned(),
                count: block.len(),
                rows: block.len() * block.dim(),
                initial_rms: rms(start),
                rms: rms(&outcome.point),
            }
        })
        .collect();
    Solution {
        outliers: problem.outliers(&outcome.point),
        values: outcome.point,
        termination: outcome.termination,
        cost: outcome.cost,
        initial_cost: outcome.initial_cost,
        iterations: outcome.iterations,
        evaluations: outcome.evaluations,
        limits: outcome.limits,
        linear_solver: outcome.linear_solver,
        linear_solver_reason: outcome.linear_solver_reason,
        blocks,
    }
}
