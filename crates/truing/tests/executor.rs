//! argmin's executor drives the solvers: observers, checkpoints and timeout work on them, and
//! `solve` offers the same as settings.

use argmin::core::checkpointing::{Checkpoint, CheckpointingFrequency};
use argmin::core::observers::{Observe, ObserverMode};
use argmin::core::{Executor, KV, Solver, State, TerminationReason, TerminationStatus};
use argmin_checkpointing_file::FileCheckpoint;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use truing::manifold::Vector;
use truing::solver::{GaussNewton, LevenbergMarquardt, Progress, SolverState};
use truing::{
    Constraint, Method, Problem, Scalar, Settings, Termination, Tolerances, Values, Var, Views,
};

/// A solver that argmin's executor can run on a borrowed problem.
trait Executable: for<'p> Solver<&'p Problem, SolverState<Values>> + 'static {}
impl<S: for<'p> Solver<&'p Problem, SolverState<Values>> + 'static> Executable for S {}

/// y = a · exp(b · t) at one time.
struct Growth {
    t: f64,
    y: f64,
}

impl Constraint for Growth {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (p,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = p[0] * (p[1] * self.t).exp() - self.y;
    }
}

/// Measurements that no growth fits exactly, so that the fit takes a few iterations.
fn growth_problem() -> (Problem, Var<Vector>) {
    let mut problem = Problem::new();
    let p = problem.add_variable::<Vector>("p", &vec![1.0, 0.1]);
    for (t, y) in [(0.0, 2.1), (1.0, 2.4), (2.0, 3.9), (3.0, 4.6), (4.0, 7.2)] {
        problem.add("growth", (p,), Growth { t, y });
    }
    (problem, p)
}

/// r = x²: the double root halves the error per step, so the solvers are at it for hundreds of
/// iterations. Every evaluation takes `pause` and is told to `on_evaluation`.
struct DoubleRoot {
    pause: Duration,
    on_evaluation: Box<dyn Fn() + Send + Sync>,
}

impl Constraint for DoubleRoot {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        std::thread::sleep(self.pause);
        (self.on_evaluation)();
        r[0] = x[0] * x[0];
    }
}

fn double_root(pause: Duration, on_evaluation: impl Fn() + Send + Sync + 'static) -> Problem {
    let mut problem = Problem::new();
    let x = problem.add_variable::<Vector>("x", &vec![1.0]);
    let on_evaluation = Box::new(on_evaluation);
    let constraint = DoubleRoot {
        pause,
        on_evaluation,
    };
    problem.add("double root", (x,), constraint);
    problem
}

fn executor<S: Executable>(
    problem: &Problem,
    solver: S,
) -> Executor<&Problem, S, SolverState<Values>> {
    let start = problem.initial().clone();
    Executor::new(problem, solver)
        .configure(|state| state.param(start).max_iters(1000))
        .ctrlc(false)
}

/// Every iteration seen: its number, its best cost and its metrics.
type Seen = Arc<Mutex<Vec<(u64, f64, KV)>>>;

struct Recorder(Seen);

impl Observe<SolverState<Values>> for Recorder {
    fn observe_iter(
        &mut self,
        state: &SolverState<Values>,
        metrics: &KV,
    ) -> Result<(), argmin::core::Error> {
        let iteration = (state.get_iter(), state.get_best_cost(), metrics.clone());
        self.0.lock().unwrap().push(iteration);
        Ok(())
    }
}

#[track_caller]
fn assert_observed<S: Executable>(solver: S, metrics: &[&str]) {
    let (problem, _) = growth_problem();
    let seen = Seen::default();
    let result = executor(&problem, solver)
        .add_observer(Recorder(seen.clone()), ObserverMode::Always)
        .run()
        .unwrap();
    let seen = seen.lock().unwrap();
    let iterations: Vec<u64> = seen.iter().map(|(iteration, ..)| *iteration).collect();
    assert_eq!(
        iterations,
        (0..result.state.get_iter()).collect::<Vec<_>>(),
        "every iteration, once and in order"
    );
    assert!(iterations.len() > 3);
    for (iteration, cost, values) in seen.iter() {
        for name in metrics {
            let value = values.get(name).and_then(|value| value.get_float());
            assert!(
                value.is_some_and(f64::is_finite),
                "`{name}` of iteration {iteration} is {value:?}"
            );
        }
        assert!(*cost >= result.state.get_best_cost());
    }
}

#[test]
fn an_observer_sees_every_iteration_of_levenberg_marquardt_with_its_metrics() {
    assert_observed(LevenbergMarquardt::new(), &["lambda", "gain", "step"]);
}

#[test]
fn an_observer_sees_every_iteration_of_gauss_newton_with_its_metrics() {
    assert_observed(GaussNewton::new(), &["step", "predicted"]);
}

/// Fails as a full disk or a lost connection would, after some iterations.
struct Crash {
    after: u64,
}

impl Observe<SolverState<Values>> for Crash {
    fn observe_iter(
        &mut self,
        state: &SolverState<Values>,
        _: &KV,
    ) -> Result<(), argmin::core::Error> {
        if state.get_iter() < self.after {
            Ok(())
        } else {
            Err(argmin::core::Error::msg("crash"))
        }
    }
}

#[track_caller]
fn assert_resumes<S>(solver: impl Fn() -> S)
where
    S: Executable,
    FileCheckpoint: Checkpoint<S, SolverState<Values>>,
{
    let (problem, p) = growth_problem();
    let uninterrupted = executor(&problem, solver()).run().unwrap().state;

    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().to_str().unwrap();
    let checkpoint = || FileCheckpoint::new(path, "fit", CheckpointingFrequency::Always);
    let crashed = executor(&problem, solver())
        .checkpointing(checkpoint())
        .add_observer(Crash { after: 3 }, ObserverMode::Always)
        .run();
    assert!(crashed.is_err(), "it should have crashed");

    let seen = Seen::default();
    let resumed = executor(&problem, solver())
        .checkpointing(checkpoint())
        .add_observer(Recorder(seen.clone()), ObserverMode::Always)
        .run()
        .unwrap()
        .state;
    assert_eq!(
        seen.lock().unwrap()[0].0,
        3,
        "it starts where the other was"
    );
    assert_eq!(resumed.get_iter(), uninterrupted.get_iter());
    // The linearisation is made again from the same numbers; only its rounding may differ.
    let (ours, theirs) = (
        resumed.get_best_param().unwrap().get(p),
        uninterrupted.get_best_param().unwrap().get(p),
    );
    for (a, b) in ours.iter().zip(&theirs) {
        assert!((a - b).abs() <= 1e-12, "{ours:?} is not {theirs:?}");
    }
}

#[test]
fn levenberg_marquardt_resumes_from_a_checkpoint_file() {
    assert_resumes(LevenbergMarquardt::new);
}

#[test]
fn gauss_newton_resumes_from_a_checkpoint_file() {
    assert_resumes(GaussNewton::new);
}

#[test]
fn a_timeout_of_the_executor_stops_a_slow_problem_and_keeps_the_best_point() {
    let problem = double_root(Duration::from_millis(5), || {});
    let state = executor(&problem, LevenbergMarquardt::new())
        .timeout(Duration::from_millis(40))
        .run()
        .unwrap()
        .state;
    assert_eq!(
        state.termination_status,
        TerminationStatus::Terminated(TerminationReason::Timeout)
    );
    let best = state.get_best_param().unwrap().as_slice()[0];
    // ½ (x²)², with the very numbers of the point that is returned.
    assert_eq!(state.get_best_cost(), 0.5 * (best * best) * (best * best));
    assert!(best < 1.0, "something was achieved");
}

#[test]
fn a_timeout_in_the_settings_is_told_with_its_seconds() {
    let problem = double_root(Duration::from_millis(5), || {});
    for method in [Method::LevenbergMarquardt, Method::GaussNewton] {
        let settings = Settings {
            method,
            timeout: Some(Duration::from_millis(40)),
            ..Settings::default()
        };
        let solution = truing::solve(&problem, &settings).unwrap();
        assert_eq!(solution.termination, Termination::Timeout { seconds: 0.04 });
        assert!(!solution.termination.converged());
        assert!(solution.cost < solution.initial_cost);
    }
}

#[test]
fn the_interrupt_flag_stops_after_the_iteration_under_way() {
    let flag = Arc::new(AtomicBool::new(false));
    for method in [Method::LevenbergMarquardt, Method::GaussNewton] {
        flag.store(false, Ordering::SeqCst);
        let raised = flag.clone();
        let settings = Settings {
            method,
            interrupt: Some(flag.clone()),
            progress: Some(Arc::new(move |progress: Progress| {
                raised.store(progress.iteration == 4, Ordering::SeqCst);
            })),
            ..Settings::default()
        };
        let solution = truing::solve(&double_root(Duration::ZERO, || {}), &settings).unwrap();
        assert_eq!(solution.termination, Termination::Interrupted);
        assert_eq!(solution.iterations, 4);
        // Four halvings of the error; damping makes Levenberg–Marquardt's a little shorter.
        let x = solution.values.as_slice()[0];
        assert!((x - 0.0625).abs() < 1e-3, "x = {x}");
    }
}

#[test]
fn a_flag_that_is_set_beforehand_leaves_the_starting_point() {
    let settings = Settings {
        interrupt: Some(Arc::new(AtomicBool::new(true))),
        ..Settings::default()
    };
    let problem = double_root(Duration::ZERO, || {});
    let solution = truing::solve(&problem, &settings).unwrap();
    assert_eq!(solution.termination, Termination::Interrupted);
    assert_eq!(
        (solution.iterations, &solution.values),
        (0, problem.initial())
    );
}

#[test]
fn progress_is_told_of_every_iteration_and_never_gets_worse() {
    for method in [Method::LevenbergMarquardt, Method::GaussNewton] {
        let told = Arc::new(Mutex::new(Vec::new()));
        let tell = told.clone();
        let settings = Settings {
            method,
            progress: Some(Arc::new(move |progress| {
                tell.lock().unwrap().push(progress)
            })),
            ..Settings::default()
        };
        let solution = truing::solve(&growth_problem().0, &settings).unwrap();
        assert!(solution.termination.converged(), "{}", solution.termination);
        let told = told.lock().unwrap();
        let numbers: Vec<u64> = told.iter().map(|p| p.iteration).collect();
        assert_eq!(numbers, (1..=solution.iterations).collect::<Vec<_>>());
        assert!(told.windows(2).all(|pair| pair[1].cost <= pair[0].cost));
        assert_eq!(told.last().unwrap().cost, solution.cost);
    }
}

#[test]
fn iterations_run_out_where_the_settings_say() {
    let settings = Settings {
        tolerances: Tolerances {
            max_iterations: 7,
            ..Tolerances::default()
        },
        ..Settings::default()
    };
    let solution = truing::solve(&double_root(Duration::ZERO, || {}), &settings).unwrap();
    assert_eq!(
        solution.termination,
        Termination::MaxIterations { limit: 7 }
    );
    assert_eq!(solution.iterations, 7);
}

#[test]
fn the_evaluations_told_are_those_that_happened() {
    for method in [Method::LevenbergMarquardt, Method::GaussNewton] {
        let count = Arc::new(Mutex::new(0));
        let counter = count.clone();
        let problem = double_root(Duration::ZERO, move || *counter.lock().unwrap() += 1);
        let settings = Settings {
            method,
            ..Settings::default()
        };
        let solution = truing::solve(&problem, &settings).unwrap();
        let told = solution.evaluations.residual + solution.evaluations.jacobian;
        // Besides the solver's: the cost at the start, and two for the report of the block.
        assert_eq!(*count.lock().unwrap(), told + 3);
    }
}
