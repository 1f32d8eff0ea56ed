//! A loss whose shape the residuals themselves decide (Barron 2019).

use crate::error::Error;
use crate::loss::Loss;
use crate::problem::Problem;
use crate::solution::Solution;
use crate::solver::{Settings, solve_from};

/// The outcome of [`solve_adaptive`].
#[derive(Debug, Clone, PartialEq)]
pub struct Adapted {
    /// The solution under the last loss.
    pub solution: Solution,
    /// The loss: [`Loss::Barron`] with 0 ≤ α ≤ 2.
    pub loss: Loss,
    /// How often the loss was fitted.
    pub rounds: usize,
    /// Whether the loss came to rest, and the last solve as well.
    pub settled: bool,
}

/// The shape is settled when it changes by less, and the scale by less relative to itself.
const SETTLED: f64 = 1e-3;
const ROUNDS: usize = 50;

/// Solves a problem and chooses the loss of one of its blocks by maximum likelihood of the block's
/// residuals, in turns, starting from the loss that the block has; the block keeps the loss chosen.
///
/// Each turn is a solve and an [`adapt_loss`]. The iterations and evaluations of the solution are those
/// of all turns; the limits of the settings hold for each.
///
/// # Errors
/// As [`solve`](crate::solve), and if the block takes no loss.
///
/// # Panics
/// If there is no such block.
///
/// # Reference
/// Barron 2019, "A general and adaptive robust loss function", section 3.1; alternation as in
/// Chebrolu et al. 2021, "Adaptive robust kernels for non-linear least squares problems".
#[track_caller]
pub fn solve_adaptive(
    problem: &mut Problem,
    block: usize,
    settings: &Settings,
) -> Result<Adapted, Error> {
    let first = solve_from(problem, problem.initial(), settings)?;
    let (initial_cost, blocks) = (first.initial_cost, first.blocks.clone());
    let mut adapted = Adapted {
        solution: first,
        loss: Loss::Trivial,
        rounds: 0,
        settled: false,
    };
    while adapted.rounds < ROUNDS && !adapted.settled {
        let residuals = problem.whitened(block, &adapted.solution.values);
        let loss = adapt_loss(&residuals);
        problem.set_loss(block, loss)?;
        let mut solution = solve_from(problem, &adapted.solution.values, settings)?;
        solution.iterations += adapted.solution.iterations;
        solution.evaluations.residual += adapted.solution.evaluations.residual;
        solution.evaluations.jacobian += adapted.solution.evaluations.jacobian;
        adapted.settled = close(loss, adapted.loss) && solution.termination.converged();
        let stopped = !solution.termination.converged();
        adapted = Adapted {
            solution,
            loss,
            rounds: adapted.rounds + 1,
            settled: adapted.settled,
        };
        if stopped {
            break;
        }
    }
    adapted.solution.initial_cost = initial_cost;
    for (own, first) in adapted.solution.blocks.iter_mut().zip(blocks) {
        own.initial_rms = first.initial_rms;
    }
    Ok(adapted)
}

fn close(a: Loss, b: Loss) -> bool {
    match (a, b) {
        (Loss::Barron { alpha: a, c: s }, Loss::Barron { alpha: b, c: t }) => {
            (a - b).abs() < SETTLED && (s - t).abs() < SETTLED * s
        }
        _ => false,
    }
}

/// Barron's loss, 0 ≤ α ≤ 2, under whose density the residuals are likeliest:
/// p(x) = exp(−½ρ(x²)) / (c Z(α)), each residual by itself.
///
/// α = 2 is the normal distribution with standard deviation c, α = 0 Cauchy's with half-width √2 c. For
/// each α of a grid, then of a golden section, the scale is the zero of the likelihood's derivative,
/// Σ ρ′(x²) x² = n c². Without residuals, or with more than half of them zero, it is α = 2, c = 1: plain least
/// squares.
pub fn adapt_loss(residuals: &[f64]) -> Loss {
    let zero = residuals.iter().filter(|x| **x == 0.0).count();
    if residuals.is_empty() || 2 * zero > residuals.len() {
        return Loss::Barron { alpha: 2.0, c: 1.0 };
    }
    // The likelihood does not change its shape with the unit; squares of huge numbers are none.
    let largest = residuals.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    if !largest.is_finite() {
        return Loss::Barron { alpha: 2.0, c: 1.0 };
    }
    let scaled: Vec<f64> = residuals.iter().map(|x| x / largest).collect();
    let surprise = |alpha: f64| {
        let c = likeliest_scale(&scaled, alpha);
        let loss = Loss::Barron { alpha, c };
        let mean = scaled.iter().map(|x| loss.evaluate(x * x).0).sum::<f64>() / scaled.len() as f64;
        (0.5 * mean / (c * c) + c.ln() + normalisation(alpha).ln(), c)
    };
    const STEPS: u32 = 20;
    let width = 2.0 / f64::from(STEPS);
    let likeliest = |shapes: &[f64]| {
        let mut best = (f64::INFINITY, 2.0, 1.0);
        for alpha in shapes {
            let (value, c) = surprise(*alpha);
            if value < best.0 {
                best = (value, *alpha, c);
            }
        }
        (best.1, best.2)
    };
    let grid: Vec<f64> = (0..=STEPS).map(|k| f64::from(k) * width).collect();
    let (best, _) = likeliest(&grid);
    let (mut low, mut high) = ((best - width).max(0.0), (best + width).min(2.0));
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    while high - low > 1e-4 {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        if surprise(a).0 < surprise(b).0 {
            high = b;
        } else {
            low = a;
        }
    }
    // The ends of the range are reached, not approached.
    let middle = 0.5 * (low + high);
    let mut last = vec![middle];
    last.extend([low, high].iter().filter(|a| **a == 0.0 || **a == 2.0));
    let (alpha, c) = likeliest(&last);
    Loss::Barron {
        alpha,
        c: c * largest,
    }
}

/// The zero of Σ ρ′(x²) x²/c² − n, which falls with c, by bisection of ln c; the residuals are at most 1.
fn likeliest_scale(residuals: &[f64], alpha: f64) -> f64 {
    let n = residuals.len() as f64;
    let (mut low, mut high) = (-60.0_f64, 1.0_f64);
    while high - low > 1e-6 {
        let middle = 0.5 * (low + high);
        let c = middle.exp();
        let loss = Loss::Barron { alpha, c };
        let sum: f64 = residuals
            .iter()
            .map(|x| loss.evaluate(x * x).1 * (x / c) * (x / c))
            .sum();
        if sum > n {
            low = middle;
        } else {
            high = middle;
        }
    }
    (0.5 * (low + high)).exp()
}

/// Z(α) = ∫ exp(−½ρ(x²)) dx with c = 1, by the trapezoidal rule over t with x = √2 sinh t: the
/// integrand falls exponentially in t even for α = 0, so the rule converges exponentially.
fn normalisation(alpha: f64) -> f64 {
    const STEP: f64 = 0.05;
    const HALF: i32 = 800;
    let loss = Loss::Barron { alpha, c: 1.0 };
    let term = |t: f64| {
        let x = t.sinh() * std::f64::consts::SQRT_2;
        (-0.5 * loss.evaluate(x * x).0).exp() * std::f64::consts::SQRT_2 * t.cosh()
    };
    let half: f64 = (1..=HALF).map(|k| term(f64::from(k) * STEP)).sum();
    STEP * (term(0.0) + 2.0 * half)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Barron 2019: Z(0) = π√2, Z(1) = 2e K₁(1), Z(2) = √(2π); K₁(1) from Abramowitz & Stegun, table 9.8.
    #[test]
    fn the_normalisation_is_that_of_known_densities() {
        let pi = std::f64::consts::PI;
        assert_relative_eq!(normalisation(0.0), pi * 2.0_f64.sqrt(), epsilon = 1e-9);
        assert_relative_eq!(normalisation(2.0), (2.0 * pi).sqrt(), epsilon = 1e-12);
        let k1 = 0.601_907_230_197_234_6;
        let e = std::f64::consts::E;
        assert_relative_eq!(normalisation(1.0), 2.0 * e * k1, epsilon = 1e-9);
    }

    /// Quantiles of a distribution at the middles of equal parts: its sample without chance.
    fn sample(quantile: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..2000)
            .map(|k| quantile((f64::from(k) + 0.5) / 2000.0))
            .collect()
    }

    #[test]
    fn the_shape_is_that_of_the_data() {
        let cauchy = sample(|p| 3.0 * (std::f64::consts::PI * (p - 0.5)).tan());
        let Loss::Barron { alpha, c } = adapt_loss(&cauchy) else {
            panic!("not Barron's");
        };
        assert!(alpha < 0.05, "{alpha}");
        assert_relative_eq!(c, 3.0 / 2.0_f64.sqrt(), max_relative = 0.05);
        // Logistic quantiles are near a normal distribution with heavier tails.
        let logistic = sample(|p| (p / (1.0 - p)).ln());
        let Loss::Barron { alpha, .. } = adapt_loss(&logistic) else {
            panic!("not Barron's");
        };
        assert!((0.6..1.8).contains(&alpha), "{alpha}");
    }

    #[test]
    fn too_little_is_least_squares() {
        for residuals in [&[][..], &[0.0, 0.0, 1.0], &[1.0, f64::INFINITY]] {
            let loss = adapt_loss(residuals);
            assert_eq!(loss, Loss::Barron { alpha: 2.0, c: 1.0 });
        }
    }
}
