//! Limits hold exactly and the optimum is the constrained one: boxes, linear inequalities and
//! equalities, feasible start or not, on flat and curved variables.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SupportedConeT};
use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use truing::manifold::{Rotation3, Vector};
use truing::solver::LevenbergMarquardt;
use truing::step::{Bounded, Qr, Side};
use truing::{
    ActiveLimit, Batch, Constraint, Error, LeastSquares, LinearLimit, Linearization, Method, Noise,
    Problem, Scalar, Settings, Solution, StepBounds, Structure, Var, Views, solver,
};

/// a·x − b.
struct Row {
    a: Vec<f64>,
    b: f64,
}

impl Constraint for Row {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        let sum = |sum: T, (a, x): (&f64, &T)| sum + *x * *a;
        r[0] = self.a.iter().zip(x).fold(T::from(-self.b), sum);
    }
}

/// min ½‖Ax − b‖² with limits, all of it in numbers.
struct Linear {
    a: DMatrix<f64>,
    b: DVector<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// (coefficients, lower, upper).
    rows: Vec<(Vec<f64>, f64, f64)>,
}

impl Linear {
    fn problem(&self, start: &[f64]) -> (Problem, Var<Vector>) {
        let mut problem = Problem::new();
        let x = problem.add_variable::<Vector>("x", &start.to_vec());
        let mut batch = Batch::new("rows");
        for i in 0..self.a.nrows() {
            let a = self.a.row(i).iter().copied().collect();
            batch.push((x,), Row { a, b: self.b[i] });
        }
        problem.add_block(batch);
        for k in 0..start.len() {
            problem.bound_component(x, k, self.lower[k], self.upper[k]);
        }
        for (i, (a, lower, upper)) in self.rows.iter().enumerate() {
            let mut limit = LinearLimit::new(format!("limit {i}"));
            for (k, a) in a.iter().enumerate() {
                if *a != 0.0 {
                    limit = limit.term(x, k, *a);
                }
            }
            problem.add_limit(limit.at_least(*lower).at_most(*upper));
        }
        (problem, x)
    }

    /// The largest violation of the conditions of Karush, Kuhn and Tucker at x, with the
    /// multipliers given: stationarity, feasibility, signs, complementarity.
    fn kkt_violation(&self, x: &[f64], limits: &[ActiveLimit]) -> f64 {
        let x = DVector::from_column_slice(x);
        let mut gradient = self.a.transpose() * (&self.a * &x - &self.b);
        let mut worst = 0.0_f64;
        for limit in limits {
            let sign = match limit.side {
                Side::Upper => 1.0,
                Side::Lower => -1.0,
                Side::Equal => 0.0,
            };
            worst = worst.max(-sign * limit.multiplier);
            match limit.limit {
                truing::step::ActiveAt::Column(k) => gradient[k] += limit.multiplier,
                truing::step::ActiveAt::Row(i) => {
                    for (k, a) in self.rows[i].0.iter().enumerate() {
                        gradient[k] += a * limit.multiplier;
                    }
                }
            }
        }
        worst.max(gradient.amax())
    }

    /// clarabel on the whole problem, without any of our own code.
    fn by_clarabel(&self) -> Vec<f64> {
        let n = self.a.ncols();
        let p = self.a.transpose() * &self.a;
        let q: Vec<f64> = (-(self.a.transpose() * &self.b)).iter().copied().collect();
        let upper: Vec<(usize, usize, f64)> = (0..n)
            .flat_map(|k| (0..=k).map(move |i| (i, k)))
            .map(|(i, k)| (i, k, p[(i, k)]))
            .collect();
        let mut triplets = Vec::new();
        let mut b = Vec::new();
        let mut add = |a: &[f64], sign: f64, limit: f64| {
            for (k, a) in a.iter().enumerate() {
                triplets.push((b.len(), k, sign * a));
            }
            b.push(sign * limit);
        };
        let unit = |k: usize| {
            (0..n)
                .map(|i| f64::from(u8::from(i == k)))
                .collect::<Vec<_>>()
        };
        let mut equal = 0;
        for (a, lower, upper) in &self.rows {
            if lower == upper {
                add(a, 1.0, *upper);
                equal += 1;
            }
        }
        let boxes = (0..n).map(|k| (unit(k), self.lower[k], self.upper[k]));
        let rows = self.rows.iter().filter(|(_, l, u)| l != u).cloned();
        for (a, lower, upper) in boxes.chain(rows) {
            if upper.is_finite() {
                add(&a, 1.0, upper);
            }
            if lower.is_finite() {
                add(&a, -1.0, lower);
            }
        }
        let matrix = |rows: usize, entries: &[(usize, usize, f64)]| {
            CscMatrix::new_from_triplets(
                rows,
                n,
                entries.iter().map(|e| e.0).collect(),
                entries.iter().map(|e| e.1).collect(),
                entries.iter().map(|e| e.2).collect(),
            )
        };
        let settings = DefaultSettings::<f64> {
            verbose: false,
            tol_gap_abs: 1e-14,
            tol_gap_rel: 1e-14,
            tol_feas: 1e-14,
            ..DefaultSettings::default()
        };
        let cones = [
            SupportedConeT::ZeroConeT(equal),
            SupportedConeT::NonnegativeConeT(b.len() - equal),
        ];
        let mut solver = DefaultSolver::new(
            &matrix(n, &upper),
            &q,
            &matrix(b.len(), &triplets),
            &b,
            &cones,
            settings,
        )
        .unwrap();
        solver.solve();
        solver.solution.x.clone()
    }

    fn cost(&self, x: &[f64]) -> f64 {
        0.5 * (&self.a * DVector::from_column_slice(x) - &self.b).norm_squared()
    }
}

#[track_caller]
fn solved(problem: &Problem, method: Method) -> Solution {
    let settings = Settings {
        method,
        ..Settings::default()
    };
    let solution = truing::solve(problem, &settings).unwrap();
    assert!(solution.termination.converged(), "{}", solution.termination);
    solution
}

#[track_caller]
fn assert_close(found: &[f64], expected: &[f64], tolerance: f64) {
    for (found_k, expected_k) in found.iter().zip(expected) {
        assert!(
            (found_k - expected_k).abs() <= tolerance * (1.0 + expected_k.abs()),
            "{found:?} is not {expected:?}"
        );
    }
}

fn random_linear(rng: &mut ChaCha8Rng, linear_limits: bool) -> (Linear, Vec<f64>) {
    let n = rng.random_range(1..12);
    let m = n + rng.random_range(0..20);
    let normal = |rng: &mut ChaCha8Rng| rng.sample::<f64, _>(StandardNormal);
    // Columns of different sizes that are not orthogonal.
    let common = DVector::from_fn(m, |_, _| normal(rng));
    let mut a = DMatrix::from_fn(m, n, |_, _| normal(rng));
    for k in 0..n {
        let (size, share) = (
            10f64.powf(rng.random_range(-2.0..2.0)),
            rng.random_range(0.0..3.0),
        );
        for i in 0..m {
            a[(i, k)] = size * (a[(i, k)] + share * common[i]);
        }
    }
    let b = DVector::from_fn(m, |_, _| 3.0 * normal(rng));
    let inside: Vec<f64> = (0..n).map(|_| normal(rng)).collect();
    let limit = |rng: &mut ChaCha8Rng, at: f64, sign: f64| match rng.random_range(0..4) {
        0 => sign * f64::INFINITY,
        1 => at,
        _ => at + sign * rng.random_range(0.0..1.0),
    };
    let lower: Vec<f64> = inside.iter().map(|at| limit(rng, *at, -1.0)).collect();
    let upper: Vec<f64> = inside.iter().map(|at| limit(rng, *at, 1.0)).collect();
    let mut rows = Vec::new();
    if linear_limits {
        for k in 0..rng.random_range(0..n.min(4)) {
            let a: Vec<f64> = (0..n).map(|_| normal(rng)).collect();
            let at: f64 = a.iter().zip(&inside).map(|(a, x)| a * x).sum();
            let (l, u) = if k == 0 {
                (at, at)
            } else {
                (limit(rng, at, -1.0), limit(rng, at, 1.0))
            };
            rows.push((a, l, u));
        }
    }
    let linear = Linear {
        a,
        b,
        lower,
        upper,
        rows,
    };
    (linear, inside)
}

#[test]
fn a_thousand_random_boxes_agree_with_clarabel_on_the_whole_problem() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut active = 0;
    for case in 0..1000 {
        let (linear, inside) = random_linear(&mut rng, false);
        let start: Vec<f64> = if case % 2 == 0 {
            inside
        } else {
            // Not feasible.
            inside.iter().map(|x| x + 3.0).collect()
        };
        let (problem, x) = linear.problem(&start);
        let solution = solved(&problem, Method::LevenbergMarquardt);
        let found = solution.values.get(x);
        for k in 0..found.len() {
            assert!(
                linear.lower[k] <= found[k] && found[k] <= linear.upper[k],
                "case {case}: {} is outside [{}, {}]",
                found[k],
                linear.lower[k],
                linear.upper[k]
            );
        }
        let reference = linear.by_clarabel();
        let (ours, theirs) = (linear.cost(&found), linear.cost(&reference));
        assert!(
            ours <= theirs + 1e-8 * (1.0 + theirs),
            "case {case}: cost {ours} against clarabel's {theirs}"
        );
        let size = (linear.a.transpose() * &linear.b).amax();
        let violation = linear.kkt_violation(&found, &solution.limits);
        assert!(violation <= 1e-8 * (1.0 + size), "case {case}: {violation}");
        active += solution.limits.len();
    }
    // The cases are about active bounds.
    assert!(active > 2000, "only {active} active bounds");
}

#[test]
fn random_linear_limits_agree_with_clarabel_on_the_whole_problem() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for case in 0..500 {
        let (linear, inside) = random_linear(&mut rng, true);
        let start: Vec<f64> = inside.iter().map(|x| x + f64::from(case % 3)).collect();
        let (problem, x) = linear.problem(&start);
        let solution = solved(&problem, Method::LevenbergMarquardt);
        let found = solution.values.get(x);
        for (a, lower, upper) in &linear.rows {
            let value: f64 = a.iter().zip(&found).map(|(a, x)| a * x).sum();
            let size: f64 = a.iter().zip(&found).map(|(a, x)| (a * x).abs()).sum();
            let rounding = 1e-13 * (1.0 + size);
            assert!(
                lower - rounding <= value && value <= upper + rounding,
                "case {case}: {value} is outside [{lower}, {upper}]"
            );
        }
        let (ours, theirs) = (linear.cost(&found), linear.cost(&linear.by_clarabel()));
        assert!(
            ours <= theirs + 1e-8 * (1.0 + theirs),
            "case {case}: cost {ours} against clarabel's {theirs}"
        );
        let size = (linear.a.transpose() * &linear.b).amax();
        let violation = linear.kkt_violation(&found, &solution.limits);
        assert!(violation <= 1e-7 * (1.0 + size), "case {case}: {violation}");
    }
}
