//! How a solver that lowers the cost ends: what is left to be gained, and the last digits.

use super::Evaluations;
use super::current::{Current, positive};
use super::polish::{UNDAMPED, polish};
use super::stop::{Termination, Tolerances};
use crate::least_squares::LeastSquares;
use crate::step::{Bounded, StepSolver};
use argmin::core::Problem;

/// Whether nothing is left to be gained, seen from a trial that gained nothing: the undamped step
/// promises rounding only or is down to it; or, where J is singular and the undamped step promises
/// what curvature forbids, the one with damping `lambda` promises less than the tolerance. There the
/// damping counts up to the length of the columns: beyond, any step is small. The columns count as
/// long as they are here: scaled by what they once were, one that has shrunk would look dependent.
pub(super) fn exhausted<S: StepSolver>(
    step: &mut Bounded<S>,
    lambda: f64,
    current: &Current,
    scale: &[f64],
    size: f64,
    tolerances: &Tolerances,
) -> Option<Termination> {
    let lengths: Vec<f64> = (current.free.iter())
        .map(|column| current.lin.column_norm(*column))
        .collect();
    step.factor(&current.lin, &current.free, &positive(&lengths));
    let ended = exhausted_here(step, lambda, current, size, tolerances);
    if ended.is_none() {
        step.factor(&current.lin, &current.free, &positive(scale));
    }
    ended
}

fn exhausted_here<S: StepSolver>(
    step: &mut Bounded<S>,
    lambda: f64,
    current: &Current,
    size: f64,
    tolerances: &Tolerances,
) -> Option<Termination> {
    let cost = current.lin.cost.max(f64::MIN_POSITIVE);
    let least = tolerances.cost.max(current.noise());
    let mut dampings = [UNDAMPED, lambda.min(1.0)].into_iter();
    dampings.find_map(|lambda| {
        let step = step.step(lambda, current.bounds.as_ref()).ok()?;
        let value = step.predicted / cost;
        if value <= least {
            let tolerance = least;
            return Some(Termination::Cost { value, tolerance });
        }
        let value = step.length() / (size + tolerances.step);
        let tolerance = tolerances.step;
        (lambda == UNDAMPED && value <= tolerance).then_some(Termination::Step { value, tolerance })
    })
}

/// The converged point with its last digits, and its cost; any other point as it is.
pub(super) fn polished<O: LeastSquares, S: StepSolver>(
    problem: &mut Problem<O>,
    step: &mut Bounded<S>,
    termination: Option<&Termination>,
    lambda: f64,
    x: O::Point,
    current: &mut Current,
    scale: &mut Vec<f64>,
    evaluations: &mut Evaluations,
    tolerances: &Tolerances,
) -> Result<(O::Point, f64), argmin::core::Error> {
    let cost = current.lin.cost;
    let flat_out = matches!(
        termination,
        Some(Termination::Cost { .. } | Termination::Step { .. } | Termination::Gradient { .. })
    );
    if !flat_out {
        return Ok((x, cost));
    }
    let noise = current.noise();
    let polished = problem.problem("linearize_count", |p| {
        Ok(polish(
            p, &x, lambda, noise, current, scale, step, tolerances,
        ))
    })?;
    evaluations.jacobian += polished.jacobians;
    // A cost that is higher by rounding would not be taken for the best: the lower one is told.
    Ok((polished.point.unwrap_or(x), current.lin.cost.min(cost)))
}
