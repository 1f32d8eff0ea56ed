//! Ctrl-C stops the executor between two iterations, with the best point so far.
//!
//! One test in a file of its own: a process has one handler for the signal.

#![cfg(unix)]

use argmin::core::{Executor, State, TerminationReason, TerminationStatus};
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;
use truing::manifold::Vector;
use truing::solver::{LevenbergMarquardt, SolverState};
use truing::{Constraint, Problem, Scalar, Values, Views};

/// r = x², whose double root takes hundreds of iterations; the user presses Ctrl-C during the third
/// evaluation. The pause gives the operating system time to deliver it.
struct PressesCtrlC {
    evaluations: AtomicU32,
}

impl Constraint for PressesCtrlC {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        if self.evaluations.fetch_add(1, Ordering::SeqCst) + 1 == 3 {
            let process = std::process::id().to_string();
            let status = Command::new("kill").args(["-INT", &process]).status();
            assert!(status.is_ok_and(|status| status.success()));
        }
        std::thread::sleep(Duration::from_millis(5));
        r[0] = x[0] * x[0];
    }
}

#[test]
fn ctrl_c_ends_the_run_with_the_best_point() {
    let mut problem = Problem::new();
    let x = problem.add_variable::<Vector>("x", &vec![1.0]);
    let evaluations = AtomicU32::new(0);
    problem.add("double root", (x,), PressesCtrlC { evaluations });

    let start = problem.initial().clone();
    let state = Executor::new(&problem, LevenbergMarquardt::new())
        .configure(|state: SolverState<Values>| state.param(start).max_iters(100_000))
        .ctrlc(true)
        .run()
        .unwrap()
        .state;

    assert_eq!(
        state.termination_status,
        TerminationStatus::Terminated(TerminationReason::Interrupt)
    );
    let best = state.get_best_param().unwrap().get(x)[0];
    assert!(best < 1.0, "the iterations before the signal are kept");
    // ½ (x²)², with the very numbers of the point that is returned.
    assert_eq!(state.get_best_cost(), 0.5 * (best * best) * (best * best));
}
