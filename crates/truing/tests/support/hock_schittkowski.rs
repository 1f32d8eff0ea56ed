//! Problems of Hock & Schittkowski 1981, "Test examples for nonlinear programming codes", whose
//! objective is a sum of squares and whose constraints are bounds or linear, as plain data.
//!
//! Optima are the book's; sums of squares are in its scale, f = Σ rᵢ² (+ a constant where one is named).

use truing::manifold::Vector;
use truing::{Batch, Constraint, Problem, Scalar, Var, Views};

/// lower ≤ a·x ≤ upper; equal for an equation, infinite where there is no limit.
pub type Linear = (Vec<f64>, f64, f64);

/// One problem.
pub struct HockSchittkowski {
    /// Name in the book.
    pub name: &'static str,
    /// Its residuals.
    pub function: Function,
    /// Rows of the residual.
    pub rows: usize,
    /// The book's starting point; not always feasible.
    pub start: Vec<f64>,
    /// Lower bounds.
    pub lower: Vec<f64>,
    /// Upper bounds.
    pub upper: Vec<f64>,
    /// Linear constraints.
    pub linear: Vec<Linear>,
    /// The minimiser, where it is unique.
    pub x: Option<Vec<f64>>,
    /// Σ rᵢ² at the minimiser: the book's f without `constant`.
    pub sum: f64,
    /// What has to be added to Σ rᵢ² for the book's f.
    pub constant: f64,
}

/// The objectives, as residuals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Function {
    /// 100 (x₂ − x₁²)² + (1 − x₁)²: 1 and 2.
    Rosenbrock,
    /// x₁²/100 + x₂²: 21 (f + 100).
    Ellipse,
    /// Σ (exp(−(uᵢ − x₂)^x₃ / x₁) − i/100)², uᵢ = 25 + (−50 ln(i/100))^⅔: 25.
    Weibull,
    /// (x₁ + x₂)² + (x₂ + x₃)²: 28.
    Chain3,
    /// 9 − 8x₁ − 6x₂ − 4x₃ + 2x₁² + 2x₂² + x₃² + 2x₁x₂ + 2x₁x₃, as squares: 35.
    Beale,
    /// Wood's function: 38.
    Colville,
    /// (x₁ − 1)² + (x₂ − x₃)² + (x₄ − x₅)²: 48.
    Pairs48,
    /// (x₁ − x₂)² + (x₃ − 1)² + (x₄ − 1)⁴ + (x₅ − 1)⁶: 49.
    Powers49,
    /// (x₁ − x₂)² + (x₂ − x₃)² + (x₃ − x₄)⁴ + (x₄ − x₅)²: 50.
    Chain50,
    /// (x₁ − x₂)² + (x₂ + x₃ − 2)² + (x₄ − 1)² + (x₅ − 1)²: 51 and 53.
    Sums51,
    /// (4x₁ − x₂)² + (x₂ + x₃ − 2)² + (x₄ − 1)² + (x₅ − 1)²: 52.
    Sums52,
    /// x₁² + ½x₂² + x₃² + ½x₄² − x₁x₃ + x₃x₄ − x₁ − 3x₂ + x₃ − x₄, as squares: 76.
    Quadratic76,
}

/// One row of a problem.
pub struct Row {
    function: Function,
    i: usize,
}

impl Constraint for Row {
    type Vars = (Vector,);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = self.function.row(x, self.i);
    }
}

impl Function {
    /// Row i of the residual, from zero.
    pub fn row<T: Scalar>(self, x: &[T], i: usize) -> T {
        match (self, i) {
            (Self::Rosenbrock | Self::Colville, 0) => (x[1] - x[0] * x[0]) * 10.0,
            (Self::Rosenbrock, _) | (Self::Colville, 1) => -x[0] + 1.0,
            (Self::Ellipse, 0) => x[0] / 10.0,
            (Self::Ellipse, _) => x[1],
            (Self::Weibull, _) => {
                let t = (i + 1) as f64 / 100.0;
                let u = 25.0 + (-50.0 * t.ln()).powf(2.0 / 3.0);
                (-((-x[1] + u).powd(x[2]) / x[0])).exp() - t
            }
            (Self::Chain3, _) => x[i] + x[i + 1],
            (Self::Beale, 0) => (x[0] + x[1] / 2.0 + x[2] / 2.0 - 2.0) * 2f64.sqrt(),
            (Self::Beale, 1) => (x[1] - x[2] / 3.0 - 2.0 / 3.0) * 1.5f64.sqrt(),
            (Self::Beale, _) => (x[2] - 1.0) / 3f64.sqrt(),
            (Self::Colville, 2) => (x[3] - x[2] * x[2]) * 90f64.sqrt(),
            (Self::Colville, 3) => -x[2] + 1.0,
            // 10.1 ((y − 1)² + (w − 1)²) + 19.8 (y − 1)(w − 1).
            (Self::Colville, 4) => (x[1] + x[3] - 2.0) * 10f64.sqrt(),
            (Self::Colville, _) => (x[1] - x[3]) * 0.1f64.sqrt(),
            (Self::Pairs48, 0) => x[0] - 1.0,
            (Self::Pairs48, _) => x[2 * i - 1] - x[2 * i],
            (Self::Powers49, 0) => x[0] - x[1],
            (Self::Powers49, _) => (x[i + 1] - 1.0).powi(i as i32),
            (Self::Chain50, 2) => (x[2] - x[3]).powi(2),
            (Self::Chain50, _) => x[i] - x[i + 1],
            (Self::Sums51, 0) => x[0] - x[1],
            (Self::Sums52, 0) => x[0] * 4.0 - x[1],
            (Self::Sums51 | Self::Sums52, 1) => x[1] + x[2] - 2.0,
            (Self::Sums51 | Self::Sums52, _) => x[i + 1] - 1.0,
            (Self::Quadratic76, 0) => x[0] - x[2] / 2.0 - 0.5,
            (Self::Quadratic76, 1) => (x[1] - 3.0) / 2f64.sqrt(),
            // ¾z² + ½w² + zw + ½z − w − 19/4 is left.
            (Self::Quadratic76, 2) => (x[3] + x[2] - 1.0) / 2f64.sqrt(),
            (Self::Quadratic76, _) => (x[2] + 3.0) / 2.0,
        }
    }
}

/// The problem from a starting point, without its bounds and linear constraints.
pub fn unconstrained(case: &HockSchittkowski, start: &[f64]) -> (Problem, Var<Vector>) {
    let mut problem = Problem::new();
    let x = problem.add_variable::<Vector>("x", &start.to_vec());
    let mut batch = Batch::new(case.name);
    for i in 0..case.rows {
        let function = case.function;
        batch.push((x,), Row { function, i });
    }
    problem.add_block(batch);
    (problem, x)
}

const FREE: f64 = f64::INFINITY;

/// All of them.
pub fn cases() -> Vec<HockSchittkowski> {
    use Function as F;
    let case = |name, function, rows, start: &[f64], x: &[f64], sum| HockSchittkowski {
        name,
        function,
        rows,
        start: start.to_vec(),
        lower: vec![-FREE; start.len()],
        upper: vec![FREE; start.len()],
        linear: Vec::new(),
        x: (!x.is_empty()).then(|| x.to_vec()),
        sum,
        constant: 0.0,
    };
    let equal = |a: &[f64], b: f64| (a.to_vec(), b, b);
    let most = |a: &[f64], b: f64| (a.to_vec(), -FREE, b);
    let least = |a: &[f64], b: f64| (a.to_vec(), b, FREE);
    // 2: x₁ is the positive root of 400x³ − 598x − 2 = 0 (x₂ at its bound 1.5).
    let root = {
        let a = (598.0f64 / 1200.0).sqrt();
        2.0 * a * ((1.0 / (400.0 * a.powi(3))).acos() / 3.0).cos()
    };
    let second = 100.0 * (1.5 - root * root).powi(2) + (1.0 - root).powi(2);
    vec![
        HockSchittkowski {
            lower: vec![-FREE, -1.5],
            ..case("HS1", F::Rosenbrock, 2, &[-2.0, 1.0], &[1.0, 1.0], 0.0)
        },
        HockSchittkowski {
            lower: vec![-FREE, 1.5],
            ..case("HS2", F::Rosenbrock, 2, &[-2.0, 1.0], &[root, 1.5], second)
        },
        HockSchittkowski {
            lower: vec![2.0, -50.0],
            upper: vec![50.0, 50.0],
            linear: vec![least(&[10.0, -1.0], 10.0)],
            constant: -100.0,
            ..case("HS21", F::Ellipse, 2, &[-1.0, -1.0], &[2.0, 0.0], 0.04)
        },
        HockSchittkowski {
            lower: vec![0.1, 0.0, 0.0],
            upper: vec![100.0, 25.6, 5.0],
            ..case(
                "HS25",
                F::Weibull,
                99,
                &[100.0, 12.5, 3.0],
                &[50.0, 25.0, 1.5],
                0.0,
            )
        },
        HockSchittkowski {
            linear: vec![equal(&[1.0, 2.0, 3.0], 1.0)],
            ..case(
                "HS28",
                F::Chain3,
                2,
                &[-4.0, 1.0, 1.0],
                &[0.5, -0.5, 0.5],
                0.0,
            )
        },
        HockSchittkowski {
            lower: vec![0.0; 3],
            linear: vec![most(&[1.0, 1.0, 2.0], 3.0)],
            ..case(
                "HS35",
                F::Beale,
                3,
                &[0.5; 3],
                &[4.0 / 3.0, 7.0 / 9.0, 4.0 / 9.0],
                1.0 / 9.0,
            )
        },
        HockSchittkowski {
            lower: vec![-10.0; 4],
            upper: vec![10.0; 4],
            ..case(
                "HS38",
                F::Colville,
                6,
                &[-3.0, -1.0, -3.0, -1.0],
                &[1.0; 4],
                0.0,
            )
        },
        HockSchittkowski {
            linear: vec![
                equal(&[1.0; 5], 5.0),
                equal(&[0.0, 0.0, 1.0, -2.0, -2.0], -3.0),
            ],
            ..case(
                "HS48",
                F::Pairs48,
                3,
                &[3.0, 5.0, -3.0, 2.0, -2.0],
                &[1.0; 5],
                0.0,
            )
        },
        HockSchittkowski {
            linear: vec![
                equal(&[1.0, 1.0, 1.0, 4.0, 0.0], 7.0),
                equal(&[0.0, 0.0, 1.0, 0.0, 5.0], 6.0),
            ],
            ..case(
                "HS49",
                F::Powers49,
                4,
                &[10.0, 7.0, 2.0, -3.0, 0.8],
                &[1.0; 5],
                0.0,
            )
        },
        HockSchittkowski {
            linear: vec![
                equal(&[1.0, 2.0, 3.0, 0.0, 0.0], 6.0),
                equal(&[0.0, 1.0, 2.0, 3.0, 0.0], 6.0),
                equal(&[0.0, 0.0, 1.0, 2.0, 3.0], 6.0),
            ],
            ..case(
                "HS50",
                F::Chain50,
                4,
                &[35.0, -31.0, 11.0, 5.0, -5.0],
                &[1.0; 5],
                0.0,
            )
        },
        HockSchittkowski {
            linear: vec![
                equal(&[1.0, 3.0, 0.0, 0.0, 0.0], 4.0),
                equal(&[0.0, 0.0, 1.0, 1.0, -2.0], 0.0),
                equal(&[0.0, 1.0, 0.0, 0.0, -1.0], 0.0),
            ],
            ..case(
                "HS51",
                F::Sums51,
                4,
                &[2.5, 0.5, 2.0, -1.0, 0.5],
                &[1.0; 5],
                0.0,
            )
        },
        HockSchittkowski {
            linear: vec![
                equal(&[1.0, 3.0, 0.0, 0.0, 0.0], 0.0),
                equal(&[0.0, 0.0, 1.0, 1.0, -2.0], 0.0),
                equal(&[0.0, 1.0, 0.0, 0.0, -1.0], 0.0),
            ],
            ..case(
                "HS52",
                F::Sums52,
                4,
                &[2.0; 5],
                &[-33.0, 11.0, 180.0, -158.0, 11.0].map(|x| x / 349.0),
                1859.0 / 349.0,
            )
        },
        HockSchittkowski {
            lower: vec![-10.0; 5],
            upper: vec![10.0; 5],
            linear: vec![
                equal(&[1.0, 3.0, 0.0, 0.0, 0.0], 0.0),
                equal(&[0.0, 0.0, 1.0, 1.0, -2.0], 0.0),
                equal(&[0.0, 1.0, 0.0, 0.0, -1.0], 0.0),
            ],
            ..case(
                "HS53",
                F::Sums51,
                4,
                &[2.0; 5],
                &[-33.0, 11.0, 27.0, -5.0, 11.0].map(|x| x / 43.0),
                176.0 / 43.0,
            )
        },
        HockSchittkowski {
            lower: vec![0.0; 4],
            linear: vec![
                most(&[1.0, 2.0, 1.0, 1.0], 5.0),
                most(&[3.0, 1.0, 2.0, -1.0], 4.0),
                least(&[0.0, 1.0, 4.0, 0.0], 1.5),
            ],
            constant: -7.5,
            ..case(
                "HS76",
                F::Quadratic76,
                4,
                &[0.5; 4],
                &[3.0 / 11.0, 23.0 / 11.0, 0.0, 6.0 / 11.0],
                31.0 / 11.0,
            )
        },
    ]
}
