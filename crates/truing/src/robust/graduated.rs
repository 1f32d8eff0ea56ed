//! Graduated non-convexity: a redescending loss approached from least squares.

use crate::error::Error;
use crate::least_squares::LeastSquares;
use crate::problem::Problem;
use crate::solution::Solution;
use crate::solver::{Outcome, Progress, Settings, Termination, report, run};
use crate::variable::Values;
use std::sync::Arc;
use std::time::Instant;

/// By how much the squared scales shrink from stage to stage (Yang et al. 2020).
const SHRINK: f64 = 1.4;
/// How well, and in how many iterations, a stage is solved: the first finds where the problem is, the
/// others follow the minimum.
const LOOSE: f64 = 1e-3;
const FIRST: u64 = 50;
const ITERATIONS: u64 = 3;
/// No loss is relaxed further: what is larger still is an outlier from the start.
const FURTHEST: f64 = 1e8;

/// Solves a problem whose losses [redescend](crate::Loss::redescends), by graduated non-convexity.
///
/// Such a loss has a local minimum wherever some measurements agree. So the scales of all losses are
/// first made so large that every residual lies where its loss is convex, which is least squares but
/// for a little, and then shrunk, their squares by 1.4 a stage, until they are as stated; each stage
/// starts where the last one ended and takes a few steps. What comes out is a minimum of the problem
/// as stated, and the termination is of its plain solve at the end. Iterations and evaluations are
/// counted over all stages; the limits on iterations and time hold for all of them together.
///
/// Without redescending losses this is [`solve`](crate::solve).
///
/// ```
/// # use truing::{Batch, Constraint, Loss, Noise, Problem, Scalar, Settings, Views, manifold::Point3, solve_graduated};
/// # struct Fix([f64; 3]);
/// # impl Constraint for Fix {
/// #     type Vars = (Point3,);
/// #     const DIM: usize = 3;
/// #     fn residual<T: Scalar>(&self, (p,): Views<'_, Self, T>, r: &mut [T]) {
/// #         for i in 0..3 { r[i] = p[i] - self.0[i]; }
/// #     }
/// # }
/// # let mut problem = Problem::new();
/// # let p = problem.add_variable::<Point3>("p", &[0.0; 3].into());
/// let mut fixes = Batch::new("fixes").noise(Noise::isotropic(0.1)?).loss(Loss::tukey(4.685)?);
/// for at in [[1.0, 2.0, 3.0], [1.1, 2.0, 2.9], [50.0, -7.0, 0.0], [0.9, 2.0, 3.1]] {
///     fixes.push((p,), Fix(at));
/// }
/// problem.add_block(fixes);
/// let solution = solve_graduated(&problem, &Settings::default())?;
/// assert!((solution.values.get(p).x - 1.0).abs() < 1e-3);
/// assert_eq!(solution.outliers[0].item, 2);
/// # Ok::<(), truing::Error>(())
/// ```
///
/// # Errors
/// As [`solve`](crate::solve).
///
/// # Reference
/// Blake & Zisserman 1987, "Visual Reconstruction"; Yang, Antonante, Tzoumas & Carlone 2020,
/// "Graduated non-convexity for robust spatial perception: from non-minimal solvers to global outlier
/// rejection".
pub fn solve_graduated(problem: &Problem, settings: &Settings) -> Result<Solution, Error> {
    solve_graduated_from(problem, problem.initial(), settings)
}

/// [`solve_graduated`] from other values than the problem's starting ones.
///
/// # Errors
/// As [`solve`](crate::solve).
pub fn solve_graduated_from(
    problem: &Problem,
    start: &Values,
    settings: &Settings,
) -> Result<Solution, Error> {
    let outcome = graduate(problem, start, settings)?;
    Ok(report(problem, start, outcome))
}

fn graduate(
    problem: &Problem,
    start: &Values,
    settings: &Settings,
) -> Result<Outcome<Values>, Error> {
    let deadline = settings.timeout.map(|timeout| Instant::now() + timeout);
    let limit = settings.tolerances.max_iterations;
    let mut r = vec![0.0; problem.rows()];
    let initial_cost = problem.residual(start, &mut r);
    let mut x = start.clone();
    let mut factor = problem.non_convexity(&x).min(FURTHEST);
    let mut most = FIRST;
    let (mut iterations, mut evaluations) = (0, crate::solver::Evaluations::default());
    loop {
        let last = factor <= 1.0;
        let mut stage = settings.clone();
        let left = limit.saturating_sub(iterations);
        stage.tolerances.max_iterations = if last { left } else { most.min(left) };
        if !last {
            stage.tolerances.cost = stage.tolerances.cost.max(LOOSE);
        }
        stage.timeout = deadline.map(|end| end.saturating_duration_since(Instant::now()));
        stage.progress = settings.progress.clone().map(|tell| {
            Arc::new(move |p: Progress| {
                tell(Progress {
                    iteration: iterations + p.iteration,
                    cost: p.cost,
                });
            }) as Arc<dyn Fn(Progress) + Send + Sync>
        });
        let mut outcome = if last {
            run(problem, x, &stage)?
        } else {
            run(&problem.relaxed(factor), x, &stage)?
        };
        iterations += outcome.iterations;
        evaluations.residual += outcome.evaluations.residual;
        evaluations.jacobian += outcome.evaluations.jacobian;
        let stopped = match &mut outcome.termination {
            Termination::MaxIterations { limit: own } if iterations >= limit => {
                *own = limit;
                true
            }
            Termination::Timeout { seconds } => {
                *seconds = settings.timeout.unwrap_or_default().as_secs_f64();
                true
            }
            Termination::Interrupted => true,
            _ => false,
        };
        if last || stopped {
            if !last {
                outcome.cost = problem.residual(&outcome.point, &mut r);
            }
            return Ok(Outcome {
                initial_cost,
                iterations,
                evaluations,
                ..outcome
            });
        }
        x = outcome.point;
        factor = problem.non_convexity(&x).min(factor) / SHRINK.sqrt();
        most = ITERATIONS;
    }
}

impl Problem {
    /// By what the scales of the losses must be multiplied for every residual at `x` to lie where its
    /// loss is convex; 1 at least.
    fn non_convexity(&self, x: &Values) -> f64 {
        let mut factor = 1.0_f64;
        for (block, weights) in self.blocks().zip(self.weights(x)) {
            let convex = block.loss().convex_up_to().sqrt();
            for w in weights {
                factor = factor.max(w.norm / convex);
            }
        }
        factor
    }
}
