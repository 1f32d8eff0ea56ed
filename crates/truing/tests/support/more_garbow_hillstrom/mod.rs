//! The test problems of Moré, Garbow & Hillstrom 1981, "Testing unconstrained optimization software"
//! (ACM TOMS 7, algorithm 566): functions, sizes, standard starts and published optima.

pub mod bounded;
pub mod functions;

use functions::{Function, Row};
use truing::manifold::Vector;
use truing::{Batch, Problem, Var};

/// A function in one size.
pub struct Case {
    /// Number in the paper.
    pub number: usize,
    /// The function.
    pub function: Function,
    /// Rows.
    pub m: usize,
    /// Standard start.
    pub start: Vec<f64>,
    /// Published least sum of squares.
    pub optimum: f64,
    /// Sums of squares of other minima and of valleys that fall towards infinity, with what they are. They
    /// are the paper's, or as said; "SciPy" is where most runs of SciPy 1.17.1's `least_squares` from random
    /// starts end.
    pub others: &'static [(f64, Other)],
}

/// What else than the least minimum a solver may honestly come to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Other {
    /// A local minimum.
    Local,
    /// The limit of a valley as x goes to infinity, or a plateau.
    Asymptote,
}

impl Case {
    /// Name, with the number of unknowns.
    pub fn name(&self) -> String {
        format!("{:?} {}", self.function, self.start.len())
    }

    /// The standard start times a factor; where that is zero, the factor itself in every component,
    /// as in MINPACK's test driver.
    pub fn start(&self, factor: f64) -> Vec<f64> {
        if factor != 1.0 && self.start.iter().all(|x| *x == 0.0) {
            return vec![factor; self.start.len()];
        }
        self.start.iter().map(|x| factor * x).collect()
    }

    /// The problem from a start: one constraint a row.
    pub fn problem(&self, start: &[f64]) -> (Problem, Var<Vector>) {
        let mut problem = Problem::new();
        let x = problem.add_variable::<Vector>("x", &start.to_vec());
        let mut batch = Batch::new(format!("{:?}", self.function));
        for i in 1..=self.m {
            let (function, m) = (self.function, self.m);
            batch.push((x,), Row { function, i, m });
        }
        problem.add_block(batch);
        (problem, x)
    }
}

/// All problems, in the paper's order. Sums of squares are the paper's, to its six digits.
pub fn cases() -> Vec<Case> {
    use Function as F;
    use Other::{Asymptote, Local};
    let case = |number, function, m, start: &[f64], optimum, others| Case {
        number,
        function,
        m,
        start: start.to_vec(),
        optimum,
        others,
    };
    let repeated =
        |n: usize, four: &[f64]| -> Vec<f64> { four.iter().copied().cycle().take(n).collect() };
    let grid = |n: usize, f: &dyn Fn(f64) -> f64| -> Vec<f64> {
        (1..=n).map(|j| f(j as f64 / (n + 1) as f64)).collect()
    };
    let bvp = |t: f64| t * (t - 1.0);
    vec![
        case(1, F::Rosenbrock, 2, &[-1.2, 1.0], 0.0, &[]),
        case(
            2,
            F::FreudensteinRoth,
            2,
            &[0.5, -2.0],
            0.0,
            &[(48.9842, Local)],
        ),
        case(3, F::PowellBadlyScaled, 2, &[0.0, 1.0], 0.0, &[]),
        case(4, F::BrownBadlyScaled, 3, &[1.0, 1.0], 0.0, &[]),
        // As x₂ → 1 with x₁(1 − x₂) → c: rows 1.5 − c, 2.25 − 2c, 2.625 − 3c; least squares in c.
        case(
            5,
            F::Beale,
            3,
            &[1.0, 1.0],
            0.0,
            &[(0.452_008_928_571, Asymptote)],
        ),
        case(6, F::JennrichSampson, 10, &[0.3, 0.4], 124.362, &[]),
        case(7, F::HelicalValley, 3, &[-1.0, 0.0, 0.0], 0.0, &[]),
        case(
            8,
            F::Bard,
            15,
            &[1.0; 3],
            8.21487e-3,
            &[(17.4286, Asymptote)],
        ),
        case(9, F::Gaussian, 15, &[0.4, 1.0, 0.0], 1.12793e-8, &[]),
        case(10, F::Meyer, 16, &[0.02, 4000.0, 250.0], 87.9458, &[]),
        // From a hundred times the start every exponential underflows: Σ tᵢ² is left.
        case(
            11,
            F::Gulf,
            99,
            &[5.0, 2.5, 0.15],
            0.0,
            &[(32.835, Asymptote)],
        ),
        // x₂ → ∞ (SciPy on the two unknowns that are left).
        case(
            12,
            F::Box3d,
            10,
            &[0.0, 10.0, 20.0],
            0.0,
            &[(0.0755887408, Asymptote)],
        ),
        case(13, F::PowellSingular, 4, &[3.0, -1.0, 0.0, 1.0], 0.0, &[]),
        case(14, F::Wood, 6, &[-3.0, -1.0, -3.0, -1.0], 0.0, &[]),
        case(
            15,
            F::KowalikOsborne,
            11,
            &[0.25, 0.39, 0.415, 0.39],
            3.07505e-4,
            &[(1.02734e-3, Asymptote)],
        ),
        case(
            16,
            F::BrownDennis,
            20,
            &[25.0, 5.0, -5.0, -1.0],
            85822.2,
            &[],
        ),
        case(
            17,
            F::Osborne1,
            33,
            &[0.5, 1.5, -1.0, 0.01, 0.02],
            5.46489e-5,
            &[],
        ),
        // A single exponential is left as x₂ → ∞ (SciPy on its two unknowns).
        case(
            18,
            F::BiggsExp6,
            13,
            &[1.0, 2.0, 1.0, 1.0, 1.0, 1.0],
            0.0,
            &[(5.65565e-3, Local), (0.306366773, Asymptote)],
        ),
        // Peaks that are too narrow or too far off for the data: the decaying exponential is left.
        case(
            19,
            F::Osborne2,
            65,
            &[1.3, 0.65, 0.65, 0.7, 0.6, 3.0, 5.0, 7.0, 2.0, 4.5, 5.5],
            4.01377e-2,
            &[(1.789813587, Asymptote)],
        ),
        case(20, F::Watson, 31, &[0.0; 6], 2.28767e-3, &[]),
        case(20, F::Watson, 31, &[0.0; 9], 1.39976e-6, &[]),
        case(20, F::Watson, 31, &[0.0; 12], 4.72238e-10, &[]),
        case(
            21,
            F::ExtendedRosenbrock,
            10,
            &repeated(10, &[-1.2, 1.0]),
            0.0,
            &[],
        ),
        case(
            22,
            F::ExtendedPowell,
            12,
            &repeated(12, &[3.0, -1.0, 0.0, 1.0]),
            0.0,
            &[],
        ),
        case(23, F::Penalty1, 5, &[1.0, 2.0, 3.0, 4.0], 2.24997e-5, &[]),
        case(
            23,
            F::Penalty1,
            11,
            &(1..=10).map(f64::from).collect::<Vec<_>>(),
            7.08765e-5,
            &[],
        ),
        case(24, F::Penalty2, 8, &[0.5; 4], 9.37629e-6, &[]),
        case(24, F::Penalty2, 20, &[0.5; 10], 2.93660e-4, &[]),
        case(
            25,
            F::VariablyDimensioned,
            12,
            &(1..=10)
                .map(|j| 1.0 - f64::from(j) / 10.0)
                .collect::<Vec<_>>(),
            0.0,
            &[],
        ),
        // The second one: SciPy.
        case(
            26,
            F::Trigonometric,
            10,
            &[0.1; 10],
            0.0,
            &[(2.79506e-5, Local), (4.21863e-5, Local)],
        ),
        case(
            27,
            F::BrownAlmostLinear,
            10,
            &[0.5; 10],
            0.0,
            &[(1.0, Local)],
        ),
        case(
            27,
            F::BrownAlmostLinear,
            40,
            &[0.5; 40],
            0.0,
            &[(1.0, Local)],
        ),
        case(28, F::DiscreteBoundaryValue, 10, &grid(10, &bvp), 0.0, &[]),
        case(29, F::DiscreteIntegral, 10, &grid(10, &bvp), 0.0, &[]),
        case(30, F::BroydenTridiagonal, 10, &[-1.0; 10], 0.0, &[]),
        case(31, F::BroydenBanded, 10, &[-1.0; 10], 0.0, &[]),
        // m − n; m(m − 1) / (2(2m + 1)); (m² + 3m − 6) / (2(2m − 3)).
        case(32, F::LinearFullRank, 10, &[1.0; 5], 5.0, &[]),
        case(33, F::LinearRank1, 10, &[1.0; 5], 45.0 / 21.0, &[]),
        case(34, F::LinearRank1Zeros, 10, &[1.0; 5], 62.0 / 17.0, &[]),
        // SciPy; MINPACK's driver ends at 1.884248² and, started where the gradient is zero, 1.886238².
        case(
            35,
            F::Chebyquad,
            8,
            &grid(1, &|t| t),
            3.06652723,
            &[(3.550391, Local), (3.557894, Local)],
        ),
        case(35, F::Chebyquad, 7, &grid(7, &|t| t), 0.0, &[]),
        case(35, F::Chebyquad, 8, &grid(8, &|t| t), 3.51687e-3, &[]),
        case(35, F::Chebyquad, 9, &grid(9, &|t| t), 0.0, &[]),
        // Both others: SciPy. The first is lower than the published one.
        case(
            35,
            F::Chebyquad,
            10,
            &grid(10, &|t| t),
            6.50395e-3,
            &[(4.77271e-3, Local), (9.50063e-3, Local)],
        ),
    ]
}
