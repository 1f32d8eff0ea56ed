//! Twelve of the problems inside bounds, after Gay 1984, "A trust-region approach to linearly constrained
//! optimization", from their standard starts.
//!
//! Optima were computed with SciPy 1.17.1 for these bounds: the least of `least_squares(method="trf")`
//! from 400 starts drawn in the box.

use super::functions::{Function, Row};
use truing::manifold::Vector;
use truing::{Batch, Problem, Var};

/// A function with bounds.
pub struct Bounded {
    /// The function.
    pub function: Function,
    /// Rows.
    pub m: usize,
    /// Standard start; where it is outside, the nearest point of the box is meant.
    pub start: &'static [f64],
    /// Lower bounds.
    pub lower: &'static [f64],
    /// Upper bounds.
    pub upper: &'static [f64],
    /// Least sum of squares in the box.
    pub optimum: f64,
}

/// The problem from the start, which need not be in the box.
pub fn problem(case: &Bounded) -> (Problem, Var<Vector>) {
    let mut problem = Problem::new();
    let x = problem.add_variable::<Vector>("x", &case.start.to_vec());
    for k in 0..case.start.len() {
        problem.bound_component(x, k, case.lower[k], case.upper[k]);
    }
    let mut batch = Batch::new(format!("{:?}", case.function));
    for i in 1..=case.m {
        let (function, m) = (case.function, case.m);
        batch.push((x,), Row { function, i, m });
    }
    problem.add_block(batch);
    (problem, x)
}

/// All of them.
pub fn cases() -> Vec<Bounded> {
    use Function as F;
    let case = |function, m, start, lower, upper, optimum| Bounded {
        function,
        m,
        start,
        lower,
        upper,
        optimum,
    };
    vec![
        case(
            F::PowellBadlyScaled,
            2,
            &[0.0, 1.0],
            &[0.0, 1.0],
            &[1.0, 9.0],
            1.5125936724e-10,
        ),
        case(
            F::BrownBadlyScaled,
            3,
            &[1.0, 1.0],
            &[0.0, 3e-5],
            &[1e6, 100.0],
            7.8399999930e2,
        ),
        case(F::Beale, 3, &[1.0, 1.0], &[0.6, 0.5], &[10.0, 100.0], 0.0),
        case(
            F::HelicalValley,
            3,
            &[-1.0, 0.0, 0.0],
            &[-100.0, -1.0, -1.0],
            &[0.8, 1.0, 1.0],
            9.9042212096e-1,
        ),
        case(
            F::Gaussian,
            15,
            &[0.4, 1.0, 0.0],
            &[0.398, 1.0, -400.0],
            &[4.2, 2.0, 1.0],
            1.1279327696e-8,
        ),
        case(
            F::Meyer,
            16,
            &[0.02, 4000.0, 250.0],
            &[0.006, 0.0, 0.0],
            &[2.0, 3e5, 3e4],
            1.2745177121e2,
        ),
        case(
            F::Gulf,
            99,
            &[5.0, 2.5, 0.15],
            &[1e-9, 0.0, 0.0],
            &[10.0, 10.0, 10.0],
            5.1216857156,
        ),
        case(
            F::Box3d,
            10,
            &[0.0, 10.0, 20.0],
            &[0.0, 5.0, 0.0],
            &[2.0, 9.5, 20.0],
            1.1434818026e-4,
        ),
        case(
            F::PowellSingular,
            4,
            &[3.0, -1.0, 0.0, 1.0],
            &[0.1, -20.0, -1.0, -1.0],
            &[100.0, 20.0, 1.0, 50.0],
            1.8781963006e-4,
        ),
        case(
            F::Wood,
            6,
            &[-3.0, -1.0, -3.0, -1.0],
            &[-100.0; 4],
            &[0.0, 10.0, 100.0, 100.0],
            1.5567008004,
        ),
        case(
            F::BrownDennis,
            20,
            &[25.0, 5.0, -5.0, -1.0],
            &[-10.0, -15.0, -100.0, -20.0],
            &[100.0, 15.0, 0.0, 0.2],
            8.8860479770e4,
        ),
        case(
            F::BiggsExp6,
            13,
            &[1.0, 2.0, 1.0, 1.0, 1.0, 1.0],
            &[0.0, 0.0, 1.0, 1.0, 0.0, 0.0],
            &[2.0, 8.0, 7.0, 7.0, 5.0, 5.0],
            5.8956977434e-4,
        ),
    ]
}
