//! Runs a solver under argmin's executor and watches it with an observer.
//!
//! `truing::solve` is the short way; the executor gives access to argmin's observers, checkpoints,
//! timeouts and Ctrl-C. Run it: `cargo run --example observers`

use std::error::Error;
use std::io::Write;
use std::sync::{Arc, Mutex};
use truing::argmin::core::observers::{Observe, ObserverMode};
use truing::argmin::core::{self as argmin, Executor, KV, State};
use truing::manifold::Vector;
use truing::solver::{Explains, LevenbergMarquardt, SolverState};
use truing::{Constraint, Problem, Scalar, Termination, Values, Views};

/// Rosenbrock's valley as two residuals: 10 (y − x²) and 1 − x. The minimum is at (1, 1).
struct Rosenbrock;

impl Constraint for Rosenbrock {
    type Vars = (Vector,);
    const DIM: usize = 2;

    fn residual<T: Scalar>(&self, (p,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = (p[1] - p[0] * p[0]) * 10.0;
        r[1] = -p[0] + 1.0;
    }
}

// ANCHOR: observer
// 1. An observer is told of every iteration: the state, and the solver's own metrics by name.
struct Recorder(Arc<Mutex<Vec<String>>>);

impl Observe<SolverState<Values>> for Recorder {
    fn observe_iter(
        &mut self,
        state: &SolverState<Values>,
        metrics: &KV,
    ) -> Result<(), argmin::Error> {
        let metric = |name| metrics.get(name).and_then(|value| value.get_float());
        let line = format!(
            "{:3}  cost {:.3e}  damping {:.1e}  gain ratio {:6.3}",
            state.get_iter() + 1,
            state.get_best_cost(),
            metric("lambda").unwrap_or(f64::NAN),
            metric("gain").unwrap_or(f64::NAN),
        );
        if let Ok(mut lines) = self.0.lock() {
            lines.push(line);
        }
        Ok(())
    }
}
// ANCHOR_END: observer

/// Finds the minimum and prints every iteration.
pub fn run(out: &mut dyn Write) -> Result<(Vec<f64>, Option<Termination>), Box<dyn Error>> {
    let mut problem = Problem::new();
    let p = problem.add_variable::<Vector>("x, y", &vec![-1.2, 1.0]);
    problem.add("valley", (p,), Rosenbrock);

    // ANCHOR: executor
    // 2. A solver is an argmin solver, and a problem is its problem.
    let lines = Arc::new(Mutex::new(Vec::new()));
    let start = problem.initial().clone();
    let result = Executor::new(&problem, LevenbergMarquardt::new())
        .configure(|state: SolverState<Values>| state.param(start).max_iters(100))
        .add_observer(Recorder(lines.clone()), ObserverMode::Always)
        .ctrlc(false)
        .run()?;
    // ANCHOR_END: executor

    // 3. The state holds the best point, the solver says why it stopped.
    for line in lines.lock().map_err(|_| "the observer panicked")?.iter() {
        writeln!(out, "{line}")?;
    }
    let values = result.state.get_best_param().ok_or("there is no point")?;
    let point = values.get(p);
    let termination = result.solver.termination();
    if let Some(termination) = &termination {
        writeln!(out, "{termination}")?;
    }
    writeln!(out, "minimum at ({:.6}, {:.6})", point[0], point[1])?;
    Ok((point, termination))
}

fn main() -> Result<(), Box<dyn Error>> {
    run(&mut std::io::stdout())?;
    Ok(())
}
