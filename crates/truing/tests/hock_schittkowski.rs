//! Hock and Schittkowski's problems that are sums of squares: the book's optima are what they are said
//! to be, and those with bounds alone are reached.

#[path = "support/hock_schittkowski.rs"]
mod hock_schittkowski;

use hock_schittkowski::{HockSchittkowski, cases, unconstrained};
use truing::manifold::Vector;
use truing::{LeastSquares, LinearLimit, Problem, Settings, Var};

/// How far x is outside a bound or a linear constraint.
fn infeasibility(case: &HockSchittkowski, x: &[f64]) -> f64 {
    let mut worst = 0.0_f64;
    let mut limit = |value: f64, lower: f64, upper: f64| {
        worst = worst.max(lower - value).max(value - upper);
    };
    for (k, x) in x.iter().enumerate() {
        limit(*x, case.lower[k], case.upper[k]);
    }
    for (a, lower, upper) in &case.linear {
        let value = a.iter().zip(x).map(|(a, x)| a * x).sum();
        limit(value, *lower, *upper);
    }
    worst
}

/// The book's values of f, to its digits.
const BOOK: [(&str, f64); 14] = [
    ("HS1", 0.0),
    ("HS2", 0.0504261879),
    ("HS21", -99.96),
    ("HS25", 0.0),
    ("HS28", 0.0),
    ("HS35", 0.1111111111),
    ("HS38", 0.0),
    ("HS48", 0.0),
    ("HS49", 0.0),
    ("HS50", 0.0),
    ("HS51", 0.0),
    ("HS52", 5.326647564),
    ("HS53", 4.093023256),
    ("HS76", -4.681818181),
];

#[test]
fn the_stated_optima_are_feasible_and_have_the_book_s_values() {
    for (case, (name, f)) in cases().iter().zip(BOOK) {
        assert_eq!(case.name, name);
        let x = case.x.as_ref().unwrap();
        let violation = infeasibility(case, x);
        assert!(violation < 1e-14, "{name} is infeasible by {violation:e}");
        let (problem, _) = unconstrained(case, x);
        let mut r = vec![0.0; case.rows];
        let sum = 2.0 * problem.residual(problem.initial(), &mut r);
        assert!((sum - case.sum).abs() < 1e-12, "{name}: {sum}");
        assert!((sum + case.constant - f).abs() < 1e-9, "{name}: {sum}");
    }
}

/// The problem with its limits, from the book's start.
fn limited(case: &HockSchittkowski) -> (Problem, Var<Vector>) {
    let (mut problem, x) = unconstrained(case, &case.start);
    for k in 0..case.start.len() {
        problem.bound_component(x, k, case.lower[k], case.upper[k]);
    }
    for (i, (a, lower, upper)) in case.linear.iter().enumerate() {
        let mut limit = LinearLimit::new(format!("constraint {}", i + 1));
        for (k, a) in a.iter().enumerate().filter(|(_, a)| **a != 0.0) {
            limit = limit.term(x, k, *a);
        }
        problem.add_limit(limit.at_least(*lower).at_most(*upper));
    }
    (problem, x)
}

#[test]
fn all_are_solved_from_the_book_s_starts() {
    for case in &cases() {
        let (problem, x) = limited(case);
        let solution = truing::solve(&problem, &Settings::default()).unwrap();
        let (name, sum) = (case.name, 2.0 * solution.cost);
        println!("{name}: {sum:e}, {}", solution.termination);
        // At the book's start of 25 every exponential is zero to its last bit: f is flat there.
        if name == "HS25" {
            continue;
        }
        assert!(
            solution.termination.converged(),
            "{name}: {}",
            solution.termination
        );
        if name == "HS2" {
            // From the book's start another root of the same cubic is nearer: the local minimum on x₂ = 1.5.
            let local = solution.values.get(x);
            assert!((400.0 * local[0].powi(3) - 598.0 * local[0] - 2.0).abs() < 1e-9);
            assert!(local[0] < -1.0 && local[1] == 1.5, "{local:?}");
            continue;
        }
        assert!((sum - case.sum).abs() < 1e-12, "{name}: {sum}");
        // Where f is flat to the fourth order a sum of zero leaves x known to the fourth root of rounding.
        let digits = if ["HS49", "HS50"].contains(&name) {
            1e-3
        } else {
            1e-8
        };
        for (found, x) in solution.values.get(x).iter().zip(case.x.as_ref().unwrap()) {
            assert!((found - x).abs() < digits, "{name}: {found} is not {x}");
        }
    }
}
