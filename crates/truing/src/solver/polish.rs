//! The last digits: steps that are too small for the cost to see.

use super::current::Current;
use super::stop::Tolerances;
use crate::least_squares::LeastSquares;
use crate::step::{Bounded, Step, StepSolver};

/// The damping of a step that stands for the undamped one: a column that depends on others but for
/// rounding, ε of its length, promises ε² / λ = ε of the cost with it, and without it anything.
pub(super) const UNDAMPED: f64 = f64::EPSILON;
/// A step this short relative to the point may be judged by the next step alone.
const SHORT: f64 = 1e-6;
/// Steps of this part of the residual's length change nothing that can be seen.
const INVISIBLE: f64 = 1e-11;
/// A point this close, again as a part of the residual's length, is not worth slow damped steps.
const SEEN: f64 = 1e-9;
/// Most steps: where the residual is large, each adds only a part of a digit.
const MOST: usize = 30;

/// What [`polish`] found.
pub(super) struct Polished<P> {
    /// The better point, or none.
    pub point: Option<P>,
    /// How often J was evaluated.
    pub jacobians: u64,
}

/// Where the cost is flat to rounding the gradient is not zero yet: a cost that is right to its last
/// bit leaves the point wrong by the root of that. There the steps judge themselves: near a minimum
/// each is a part of the one before, ‖Dδₖ₊₁‖ ≈ ρ ‖Dδₖ‖, with ρ the part of the Hessian that JᵀJ lacks,
/// and a step is kept if the next one is shorter.
///
/// Undamped steps go first; where they do not contract (ρ ≥ 1, large residuals on bent models), those
/// with the solver's own damping `lambda`, then with one as long as the columns. `noise` is the part of the cost that is rounding: a step
/// that raises the cost by more is not kept.
pub(super) fn polish<O: LeastSquares>(
    problem: &O,
    x: &O::Point,
    lambda: f64,
    noise: f64,
    current: &mut Current,
    scale: &mut Vec<f64>,
    solver: &mut Bounded<impl StepSolver>,
    tolerances: &Tolerances,
) -> Polished<O::Point> {
    let cost = current.lin.cost;
    let residual = (2.0 * cost).sqrt();
    let mut found = Polished {
        point: None,
        jacobians: 0,
    };
    // Lengths of steps are compared in the columns of here, not in those of the way.
    scale.fill(0.0);
    current.look(problem, x, scale, solver, tolerances);
    for damping in [UNDAMPED, lambda.clamp(UNDAMPED, 1.0), 1.0] {
        let mut at = x.clone();
        let Some(mut step) = short(problem, &at, damping, current, solver) else {
            continue;
        };
        let enough = if damping == UNDAMPED { INVISIBLE } else { SEEN };
        if step.scaled_norm <= enough * residual {
            return found;
        }
        for _ in 0..MOST {
            let trial = problem.plus(&at, &step.delta);
            current.linearize(problem, &trial);
            found.jacobians += 1;
            if !current.usable() || current.lin.cost - cost > noise * cost {
                break;
            }
            current.look(problem, &trial, scale, solver, tolerances);
            let Some(next) = short(problem, &trial, damping, current, solver) else {
                break;
            };
            if next.scaled_norm >= step.scaled_norm {
                break;
            }
            // What is left after the next step, which is not looked at any more if that is nothing.
            let left = next.scaled_norm * (next.scaled_norm / step.scaled_norm);
            at = trial;
            found.point = Some(at.clone());
            step = next;
            if left <= INVISIBLE * residual {
                found.point = Some(problem.plus(&at, &step.delta));
                return found;
            }
        }
        if found.point.is_some() {
            return found;
        }
        current.linearize(problem, x);
        current.look(problem, x, scale, solver, tolerances);
        found.jacobians += 1;
    }
    found
}

/// The step with a damping, if it exists and is short.
fn short<O: LeastSquares>(
    problem: &O,
    x: &O::Point,
    damping: f64,
    current: &Current,
    solver: &mut Bounded<impl StepSolver>,
) -> Option<Step> {
    let step = solver.step(damping, current.bounds.as_ref()).ok()?;
    (step.length() <= SHORT * (problem.norm(x) + SHORT)).then_some(step)
}
