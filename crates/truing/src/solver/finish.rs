//! How a solver that lowers the cost ends: what is left to be gained, and the last digits.

use super::Evaluations;
use super::current::{Current, positive};
use super::stop::{Termination, Tolerances};
use crate::least_squares::LeastSquares;
use crate::step::{Bounded, StepSolver};
use argmin::core::Problem;

/// A relative decrease below which the difference of two costs is rounding.
pub(super) const ROUNDING: f64 = 1e-12;
/// A step this short relative to the point may be taken unseen.
const SHORT: f64 = 1e-6;
/// The damping of a step that stands for the undamped one: a column that depends on others but for
/// rounding, ε of its length, promises ε² / λ = ε of the cost with it, and without it anything.
pub(super) const UNDAMPED: f64 = f64::EPSILON;

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
    let mut promises = [
        (UNDAMPED, tolerances.cost.max(ROUNDING)),
        (lambda.min(1.0), tolerances.cost),
    ]
    .into_iter();
    promises.find_map(|(lambda, tolerance)| {
        let step = step.step(lambda, current.bounds.as_ref()).ok()?;
        let value = step.predicted / cost;
        if value <= tolerance {
            return Some(Termination::Cost { value, tolerance });
        }
        let value = step.length() / (size + tolerances.step);
        let tolerance = tolerances.step;
        (lambda == UNDAMPED && value <= tolerance).then_some(Termination::Step { value, tolerance })
    })
}

/// The point after the undamped step, and its cost, where the solver has converged and the step is
/// too short to be seen in the cost; otherwise the point as it is.
///
/// Where the cost is flat to rounding the gradient is not zero yet: a cost that is right to its last
/// bit leaves the point wrong by the root of that.
pub(super) fn polished<O: LeastSquares, S: StepSolver>(
    problem: &mut Problem<O>,
    step: &mut Bounded<S>,
    termination: Option<&Termination>,
    x: O::Point,
    current: &mut Current,
    evaluations: &mut Evaluations,
) -> Result<(O::Point, f64), argmin::core::Error> {
    let cost = current.lin.cost;
    let flat_out = matches!(
        termination,
        Some(Termination::Cost { .. } | Termination::Step { .. } | Termination::Gradient { .. })
    );
    if !flat_out {
        return Ok((x, cost));
    }
    let Ok(step) = step.step(UNDAMPED, current.bounds.as_ref()) else {
        return Ok((x, cost));
    };
    let (trial, trial_cost, size) = problem.problem("residual_count", |p| {
        let trial = p.plus(&x, &step.delta);
        let cost = p.residual(&trial, &mut current.trial_residual);
        Ok((trial, cost, p.norm(&x)))
    })?;
    evaluations.residual += 1;
    let short = step.length() <= SHORT * (size + SHORT);
    // A cost that is higher by rounding would not be taken for the best: keep the lower one.
    let flat = trial_cost - cost <= ROUNDING * cost;
    Ok(if short && flat {
        (trial, trial_cost.min(cost))
    } else {
        (x, cost)
    })
}
