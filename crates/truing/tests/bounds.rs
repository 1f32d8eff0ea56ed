//! Limits hold exactly and the optimum is the constrained one: boxes, linear inequalities and
//! equalities, feasible start or not, on flat and curved variables.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SupportedConeT};
use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use truing::manifold::{Rotation3, Vector};
use truing::step::{Bounded, Qr, Side};
use truing::{
    ActiveLimit, Batch, Constraint, Error, LeastSquares, LinearLimit, LinearSolver, Linearization,
    Method, Problem, Scalar, Settings, Solution, StepBounds, Structure, Var, Views, solver,
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
    solved_by(problem, method, LinearSolver::Auto)
}

#[track_caller]
fn solved_by(problem: &Problem, method: Method, linear_solver: LinearSolver) -> Solution {
    let settings = Settings {
        method,
        linear_solver,
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
    let mut beside = 0;
    for case in 0..500 {
        let (linear, inside) = random_linear(&mut rng, true);
        let start: Vec<f64> = inside.iter().map(|x| x + f64::from(case % 3)).collect();
        let (problem, x) = linear.problem(&start);
        // One linear algebra after the other.
        let by = [
            LinearSolver::DenseQr,
            LinearSolver::DenseCholesky,
            LinearSolver::SparseCholesky,
            LinearSolver::SparseQr,
        ][(case % 4) as usize];
        let solution = solved_by(&problem, Method::LevenbergMarquardt, by);
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
        let reference = linear.by_clarabel();
        let (ours, theirs) = (linear.cost(&found), linear.cost(&reference));
        assert!(
            ours <= theirs + 1e-8 * (1.0 + theirs),
            "case {case}: cost {ours} against clarabel's {theirs}"
        );
        let size = (linear.a.transpose() * &linear.b).amax();
        let violation = linear.kkt_violation(&found, &solution.limits);
        if violation > 1e-7 * (1.0 + size) {
            // Beside a corner where more limits meet than there are columns, by less than clarabel
            // can tell: limits that are missed by rounding are not listed.
            assert_ne!(by, LinearSolver::DenseQr, "case {case}: {violation}");
            beside += 1;
            assert_close(&found, &reference, 1e-9);
        }
    }
    assert!(beside <= 2, "{beside} cases stop beside the optimum");
}

/// Two correlated columns with x₀ ≤ 1: clamping the free optimum to the bound, as some solvers do,
/// costs eighty times as much as the optimum on the bound.
#[test]
fn a_bound_is_not_a_clamp() {
    let linear = Linear {
        a: DMatrix::from_row_slice(3, 2, &[10.0, 9.9, 0.0, 1.0, 0.0, 0.0]),
        b: DVector::from_row_slice(&[30.0, 1.0, 1.0]),
        lower: vec![-5.0, -5.0],
        upper: vec![1.0, 5.0],
        rows: Vec::new(),
    };
    let (problem, x) = linear.problem(&[0.0, 0.0]);
    for method in METHODS {
        let solution = solved(&problem, method);
        // With x₀ = 1: min over x₁ of (9.9 x₁ − 20)² + (x₁ − 1)².
        let expected = [1.0, (9.9 * 20.0 + 1.0) / (9.9 * 9.9 + 1.0)];
        let found = solution.values.get(x);
        assert_eq!(found[0], 1.0);
        assert_close(&found, &expected, 1e-12);
        let clamped = linear.cost(&[1.0, 1.0]);
        assert!(clamped > 50.0 * linear.cost(&found));
        // The multiplier is −∂cost/∂x₀ there.
        let [limit] = &solution.limits[..] else {
            panic!("{:?}", solution.limits)
        };
        let slope = 10.0 * (10.0 + 9.9 * expected[1] - 30.0);
        assert_eq!(limit.name, "component 0 of `x`");
        assert_eq!(limit.side, Side::Upper);
        assert_close(&[limit.multiplier], &[-slope], 1e-10);
    }
}

const METHODS: [Method; 4] = [
    Method::LevenbergMarquardt,
    Method::GaussNewton,
    Method::LineSearch,
    Method::Dogleg,
];

type Inside<'a> = Box<dyn Fn(&[f64]) -> bool + 'a>;

/// A problem that sees to it that it is only ever evaluated where its limits hold.
struct Watched<'a> {
    problem: &'a Problem,
    x: Var<Vector>,
    inside: Inside<'a>,
}

impl LeastSquares for Watched<'_> {
    type Point = truing::Values;
    fn structure(&self) -> std::sync::Arc<Structure> {
        LeastSquares::structure(self.problem)
    }
    fn residual(&self, x: &truing::Values, r: &mut [f64]) -> f64 {
        let at = x.get(self.x);
        assert!((self.inside)(&at), "evaluated outside: {at:?}");
        LeastSquares::residual(self.problem, x, r)
    }
    fn linearize(&self, x: &truing::Values, lin: &mut Linearization) {
        let at = x.get(self.x);
        assert!((self.inside)(&at), "linearised outside: {at:?}");
        LeastSquares::linearize(self.problem, x, lin);
    }
    fn plus(&self, x: &truing::Values, delta: &[f64]) -> truing::Values {
        LeastSquares::plus(self.problem, x, delta)
    }
    fn norm(&self, x: &truing::Values) -> f64 {
        LeastSquares::norm(self.problem, x)
    }
    fn step_bounds(&self, x: &truing::Values) -> Option<StepBounds> {
        self.problem.step_bounds(x)
    }
}

/// 10 (x₁ − x₀²), 1 − x₀.
struct Rosenbrock;

impl Constraint for Rosenbrock {
    type Vars = (Vector,);
    const DIM: usize = 2;
    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = (x[1] - x[0] * x[0]) * 10.0;
        r[1] = -x[0] + 1.0;
    }
}

#[test]
fn no_method_evaluates_the_model_outside_its_limits() {
    // The bent valley of Rosenbrock along a wall x₀ + x₁ ≥ −0.3 in a box that ends before (1, 1).
    for method in METHODS {
        let mut problem = Problem::new();
        let x = problem.add_variable::<Vector>("x", &vec![-1.2, 1.0]);
        problem.add("rosenbrock", (x,), Rosenbrock);
        problem.bound_component(x, 0, -2.0, 0.8);
        problem.bound_component(x, 1, -0.4, 1.1);
        let wall = LinearLimit::new("wall").term(x, 0, 1.0).term(x, 1, 1.0);
        problem.add_limit(wall.at_least(-0.3));
        let inside = |x: &[f64]| {
            (-2.0..=0.8).contains(&x[0])
                && (-0.4..=1.1).contains(&x[1])
                && x[0] + x[1] >= -0.3 - 1e-15
        };
        let watched = Watched {
            problem: &problem,
            x,
            inside: Box::new(inside),
        };
        let settings = Settings {
            method,
            ..Settings::default()
        };
        let start = problem.initial().clone();
        let outcome = solver::run(&watched, start, &settings).unwrap();
        assert!(
            outcome.termination.converged(),
            "{method:?}: {}",
            outcome.termination
        );
        // On x₀ = 0.8 the best x₁ is 0.64.
        assert_close(&outcome.point.get(x), &[0.8, 0.64], 1e-10);
    }
}

#[test]
fn clarabel_is_asked_only_where_a_limit_is_in_the_way_and_its_solver_is_kept() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let structure = std::sync::Arc::new(Structure::dense(8, 3));
    let mut lin = Linearization::new(structure);
    let mut steps = Bounded::new(Qr::default());
    let mut bounds = StepBounds::unlimited(3);
    for round in 0..20 {
        for value in lin.values.iter_mut().chain(&mut lin.residual) {
            *value = rng.sample(StandardNormal);
        }
        steps.factor(&lin, &[0, 1, 2], &[1.0; 3]);
        // Wide bounds: never.
        bounds.lower.fill(-1e3);
        bounds.upper.fill(1e3);
        let free = steps.step(1e-3, Some(&bounds)).unwrap();
        assert!(!free.limited);
        let (made, solved) = steps.programs();
        assert!(made <= 1);
        // A wall that changes sides in the middle of the step, so that the last active set is wrong.
        let k = round % 3;
        let middle = 0.5 * free.delta[k];
        bounds.lower[k] = middle.min(0.0);
        bounds.upper[k] = middle.max(0.0);
        let step = steps.step(1e-3, Some(&bounds)).unwrap();
        assert!(step.limited && step.delta[k] == middle);
        let (made, more) = steps.programs();
        assert_eq!(made, 1);
        assert!(more <= solved + 1);
    }
    assert!(steps.programs().1 > 5);
}

#[test]
fn a_ball_is_kept_and_its_step_is_the_damped_one_of_that_length() {
    // H = diag(1, 4, 9), gradient −(1, 2, 3): y(λ) = gᵢ / (hᵢ + λ), ‖y‖ = Δ found by bisection.
    let mut lin = Linearization::new(std::sync::Arc::new(Structure::dense(3, 3)));
    lin.values = vec![1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0];
    lin.residual = vec![-1.0, -1.0, -1.0];
    let mut steps = Bounded::new(Qr::default());
    steps.factor(&lin, &[0, 1, 2], &[1.0; 3]);
    let damped = |lambda: f64| [1.0, 2.0, 3.0].map(|d: f64| d / (d * d + lambda));
    let length = |y: &[f64]| y.iter().map(|y| y * y).sum::<f64>().sqrt();
    for radius in [1e-3, 0.1, 0.5, 1.0] {
        let (mut low, mut high) = (0.0, 1e6);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if length(&damped(middle)) > radius {
                low = middle;
            } else {
                high = middle;
            }
        }
        let step = steps.ball(radius, None).unwrap();
        assert!(step.scaled_norm <= radius * (1.0 + 1e-15));
        assert_close(&step.delta, &damped(low), 1e-6);
    }
    // A ball that is wide enough changes nothing, and one that cuts a box keeps both.
    assert_close(&steps.ball(10.0, None).unwrap().delta, &damped(0.0), 1e-14);
    let mut bounds = StepBounds::unlimited(3);
    bounds.upper[1] = 0.1;
    let step = steps.ball(0.5, Some(&bounds)).unwrap();
    assert!(step.delta[1] <= 0.1 && step.scaled_norm <= 0.5 * (1.0 + 1e-15));
    // With y₁ = 0.1 the others have √(0.25 − 0.01) left: λ by bisection again.
    let rest = |lambda: f64| [1.0 / (1.0 + lambda), 3.0 / (9.0 + lambda)];
    let (mut low, mut high) = (0.0, 1e6);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if length(&rest(middle)) > 0.24_f64.sqrt() {
            low = middle;
        } else {
            high = middle;
        }
    }
    let [first, last] = rest(low);
    assert_close(&step.delta, &[first, 0.1, last], 1e-6);
}

/// rotation · body − measured.
struct Turned {
    body: Vector3<f64>,
    measured: Vector3<f64>,
}

impl Constraint for Turned {
    type Vars = (Rotation3,);
    const DIM: usize = 3;
    fn residual<T: Scalar>(&self, (rotation,): Views<'_, Self, T>, r: &mut [T]) {
        for i in 0..3 {
            r[i] = T::from(-self.measured[i]);
            for k in 0..3 {
                r[i] += rotation[(i, k)] * self.body[k];
            }
        }
    }
}

#[test]
fn a_rotation_is_bounded_in_the_tangent_at_its_reference() {
    // The measurements ask for a turn by 0.9 about z; the tangent at the reference, turned by 0.2
    // about z, may go to 0.4 there: 0.6 in all, whatever the start.
    let turn = |angle: f64| UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, angle));
    let matrix = |q: UnitQuaternion<f64>| *q.to_rotation_matrix().matrix();
    for start in [
        turn(0.2),
        turn(0.5),
        // Outside the bound.
        turn(1.5),
        turn(0.1) * UnitQuaternion::from_scaled_axis(Vector3::new(0.4, -0.3, 0.0)),
    ] {
        for method in METHODS {
            let mut problem = Problem::new();
            let rotation = problem.add_variable::<Rotation3>("rotation", &matrix(start));
            for body in [Vector3::x(), Vector3::y(), Vector3::z()] {
                let measured = turn(0.9) * body;
                problem.add("turned", (rotation,), Turned { body, measured });
            }
            problem.limits_about(rotation, &matrix(turn(0.2)));
            problem.bound_component(rotation, 2, -0.4, 0.4);
            let solution = solved(&problem, method);
            let found = solution.values.get(rotation);
            let expected = matrix(turn(0.6));
            assert!((found - expected).amax() < 1e-8, "{method:?}: {found}");
            let [limit] = &solution.limits[..] else {
                panic!("{:?}", solution.limits)
            };
            // Two of three vectors turn: cost = ½ · 2 · |2 sin(0.15)|², −∂cost/∂angle = 2 sin(0.3).
            assert_close(&[limit.multiplier], &[2.0 * 0.3_f64.sin()], 1e-6);
            assert_eq!(limit.name, "component 2 of `rotation`");
        }
    }
}

#[test]
fn an_equality_tells_apart_what_the_measurements_do_not() {
    // Only x₀ + x₁ is measured; x₀ − x₁ = 1 is known.
    let linear = Linear {
        a: DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 1.0, 1.0]),
        b: DVector::from_row_slice(&[3.0, 5.0]),
        lower: vec![f64::NEG_INFINITY; 2],
        upper: vec![f64::INFINITY; 2],
        rows: vec![(vec![1.0, -1.0], 1.0, 1.0)],
    };
    let (problem, x) = linear.problem(&[7.0, 7.0]);
    for method in METHODS {
        let solution = solved(&problem, method);
        assert_close(&solution.values.get(x), &[2.5, 1.5], 1e-12);
    }
}

#[test]
fn limits_that_contradict_each_other_are_an_error_that_names_them() {
    let mut problem = Problem::new();
    let x = problem.add_variable::<Vector>("x", &vec![0.0, 0.0]);
    problem.add("rosenbrock", (x,), Rosenbrock);
    problem.bound_component(x, 0, 0.0, 1.0);
    problem.bound_component(x, 1, 0.0, 1.0);
    let sum = LinearLimit::new("sum").term(x, 0, 1.0).term(x, 1, 1.0);
    problem.add_limit(sum.at_least(2.5));
    let error = truing::solve(&problem, &Settings::default()).unwrap_err();
    assert_eq!(
        error,
        Error::Infeasible {
            limits: "`sum`".into()
        }
    );
    let empty = LinearLimit::new("empty").term(x, 0, 1.0).at_least(2.0);
    problem.add_limit(empty.at_most(1.0));
    let error = truing::solve(&problem, &Settings::default()).unwrap_err();
    assert!(matches!(error, Error::Limit { name, .. } if name == "empty"));
}

#[test]
fn a_bound_that_is_not_in_the_way_changes_no_bit() {
    for method in METHODS {
        let solve_with = |bounded: bool| {
            let mut problem = Problem::new();
            let x = problem.add_variable::<Vector>("x", &vec![-1.2, 1.0]);
            problem.add("rosenbrock", (x,), Rosenbrock);
            if bounded {
                problem.bound_component(x, 0, -100.0, 100.0);
                let sum = LinearLimit::new("sum").term(x, 0, 1.0).term(x, 1, 1.0);
                problem.add_limit(sum.at_most(1e3));
            }
            let settings = Settings {
                method,
                ..Settings::default()
            };
            truing::solve(&problem, &settings).unwrap().values
        };
        assert_eq!(solve_with(true), solve_with(false), "{method:?}");
    }
}

/// The covariance is that of what is left to move: with x₀ at its bound that of the other two alone,
/// and under an equality C δ = 0 that of the null space of C, N (NᵀAᵀAN)⁻¹ Nᵀ.
#[test]
fn the_covariance_is_that_of_the_free_subspace() {
    let a = DMatrix::from_row_slice(
        5,
        3,
        &[
            1.0, 0.5, 0.1, 0.2, 2.0, -0.3, 0.0, 1.0, 1.0, -1.0, 0.4, 0.6, 0.7, 0.7, -2.0,
        ],
    );
    let b = DVector::from_row_slice(&[4.0, 1.0, 2.0, -3.0, 0.5]);
    let infinite = f64::INFINITY;
    let mut linear = Linear {
        a: a.clone(),
        b,
        lower: vec![-infinite; 3],
        upper: vec![1.0, infinite, infinite],
        rows: Vec::new(),
    };
    let (problem, x) = linear.problem(&[0.0; 3]);
    let solution = solved(&problem, Method::LevenbergMarquardt);
    assert_eq!(solution.values.get(x)[0], 1.0);
    let covariance = truing::Covariance::at(&problem, &solution.values).unwrap();
    let rest = a.columns(1, 2).into_owned();
    let expected = (rest.transpose() * rest).try_inverse().unwrap();
    assert_eq!(covariance.std_dev(0), 0.0);
    for (i, k) in [(0, 0), (0, 1), (1, 1)] {
        assert!((covariance.entry(i + 1, k + 1) - expected[(i, k)]).abs() < 1e-13);
    }
    assert_eq!(covariance.degrees_of_freedom(), 3);

    linear.upper[0] = infinite;
    linear.rows.push((vec![1.0, 1.0, 1.0], 2.0, 2.0));
    // Not in the way.
    linear.rows.push((vec![0.0, 1.0, 0.0], -100.0, 100.0));
    let (problem, _) = linear.problem(&[0.0; 3]);
    let solution = solved(&problem, Method::LevenbergMarquardt);
    let covariance = truing::Covariance::at(&problem, &solution.values).unwrap();
    let basis = DMatrix::from_row_slice(3, 2, &[1.0, 0.0, 0.0, 1.0, -1.0, -1.0]);
    let image = &a * &basis;
    let inner = (image.transpose() * image).try_inverse().unwrap();
    let expected = &basis * inner * basis.transpose();
    for i in 0..3 {
        for k in 0..3 {
            assert!((covariance.entry(i, k) - expected[(i, k)]).abs() < 1e-12);
        }
    }
    assert_eq!(covariance.degrees_of_freedom(), 3);
}
