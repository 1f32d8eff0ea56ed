//! Problems that cannot be solved end with the reason, and those that can are solved: nothing
//! panics, nothing loops forever, and nothing is called convergence that is not.

use std::sync::Arc;
use truing::manifold::Vector;
use truing::{
    Batch, Constraint, Covariance, Error, LeastSquares, Linearization, Method, Noise, Problem,
    Scalar, Settings, Solution, Structure, Termination, Var, Views, solver,
};

const METHODS: [Method; 4] = [
    Method::LevenbergMarquardt,
    Method::GaussNewton,
    Method::LineSearch,
    Method::Dogleg,
];

fn settings(method: Method) -> Settings {
    Settings {
        method,
        ..Settings::default()
    }
}

#[track_caller]
fn solve(problem: &Problem, method: Method) -> Solution {
    truing::solve(problem, &settings(method)).unwrap()
}

/// All methods refuse to start, and say the same.
#[track_caller]
fn refusal(problem: &Problem) -> Error {
    let [one, others @ ..] =
        METHODS.map(|method| truing::solve(problem, &settings(method)).unwrap_err());
    for other in others {
        assert_eq!(one.to_string(), other.to_string());
    }
    one
}

/// ln x − b.
struct Log {
    b: f64,
}

impl Constraint for Log {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = x[0].ln() - self.b;
    }
}

/// x + y − b.
struct Sum {
    b: f64,
}

impl Constraint for Sum {
    type Vars = (Vector, Vector);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (x, y): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = x[0] + y[0] - self.b;
    }
}

/// |x|² − b, with as many components as x has.
struct Sphere {
    b: f64,
}

impl Constraint for Sphere {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = x.iter().fold(T::from(-self.b), |sum, c| sum + *c * *c);
    }
}

/// The distance from the origin, which has no derivative there, minus b; two rows.
struct Distance {
    b: f64,
}

impl Constraint for Distance {
    type Vars = (Vector,);
    const DIM: usize = 2;
    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = x[0];
        r[1] = (x[0] * x[0] + x[1] * x[1]).sqrt() - self.b;
    }
}

/// Nothing it measures depends on x.
struct Indifferent;

impl Constraint for Indifferent {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = x[0] * 0.0 + 1.0;
    }
}

/// factor · (a exp(b t) − y).
struct Growth {
    t: f64,
    y: f64,
    factor: f64,
}

impl Constraint for Growth {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (p,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = (p[0] * (p[1] * self.t).exp() - self.y) * self.factor;
    }
}

const GROWTH: [(f64, f64); 5] = [(0.0, 2.1), (1.0, 2.4), (2.0, 3.9), (3.0, 4.6), (4.0, 7.2)];

fn growth(factor: f64, repeat: usize) -> (Problem, Var<Vector>) {
    let mut problem = Problem::new();
    let p = problem.add_variable::<Vector>("p", &vec![1.0, 0.1]);
    for _ in 0..repeat {
        for (t, y) in GROWTH {
            problem.add("growth", (p,), Growth { t, y, factor });
        }
    }
    (problem, p)
}

/// A problem with the one variable `x` and the given constraints on it.
fn with_x<C: Constraint<Vars = (Vector,)>>(
    start: &[f64],
    constraints: impl IntoIterator<Item = C>,
) -> (Problem, Var<Vector>) {
    let mut problem = Problem::new();
    let x = problem.add_variable::<Vector>("x", &start.to_vec());
    let mut batch = Batch::new("block");
    for constraint in constraints {
        batch.push((x,), constraint);
    }
    problem.add_block(batch);
    (problem, x)
}

#[test]
fn no_rows_is_an_error() {
    assert_eq!(refusal(&Problem::new()), Error::NoRows);
    let (only_an_empty_block, _) = with_x::<Log>(&[1.0], []);
    assert_eq!(refusal(&only_an_empty_block), Error::NoRows);
}

#[test]
fn nothing_free_is_an_error() {
    let (mut problem, x) = with_x(&[1.0, 2.0], [Sphere { b: 1.0 }]);
    problem.fix(x);
    assert_eq!(refusal(&problem), Error::NothingFree { columns: 2 });
}

#[test]
fn a_residual_that_is_not_finite_at_the_start_is_named() {
    let good = || Log { b: 0.0 };
    for (start, value) in [(-1.0, "NaN"), (0.0, "-inf")] {
        let (mut problem, x) = with_x(&[1.0], [good(), good()]);
        let bad = problem.add_variable::<Vector>("bad", &vec![start]);
        let mut batch = Batch::new("logs");
        batch.push((x,), good());
        batch.push((bad,), good());
        problem.add_block(batch);
        let message = refusal(&problem).to_string();
        let expected = format!("constraint 1 of `logs` (component 0) is {value}");
        assert!(message.contains(&expected), "{message}");
    }
}

#[test]
fn a_residual_that_is_not_finite_is_named_under_any_noise() {
    // A full covariance mixes the rows: the first that is not finite is still the one to blame.
    let full = truing::nalgebra::DMatrix::from_row_slice(2, 2, &[1.0, 0.5, 0.5, 1.0]);
    let mut problem = Problem::new();
    let x = problem.add_variable::<Vector>("x", &vec![1.0, f64::NAN]);
    let mut batch = Batch::new("distance").noise(Noise::full(&full).unwrap());
    batch.push((x,), Distance { b: 1.0 });
    problem.add_block(batch);
    let message = refusal(&problem).to_string();
    assert!(
        message.contains("constraint 0 of `distance` (component 1)"),
        "{message}"
    );
}

#[test]
fn a_derivative_that_is_not_finite_at_the_start_is_named() {
    let (problem, _) = with_x(&[0.0, 0.0], [Distance { b: 1.0 }]);
    match refusal(&problem) {
        Error::DerivativeNotFinite { row, column, value } => {
            assert_eq!(row, "constraint 0 of `block` (component 1)");
            assert_eq!(column, "component 0 of `x`");
            assert!(!value.is_finite());
        }
        other => panic!("{other}"),
    }
}

#[test]
fn all_but_plain_gauss_newton_step_back_from_where_the_model_is_not_defined() {
    for method in [
        Method::LevenbergMarquardt,
        Method::LineSearch,
        Method::Dogleg,
    ] {
        // The full step from 4 leads to 4 − 4 ln 4 < 0.
        let (problem, x) = with_x(&[4.0], [Log { b: 0.0 }]);
        let solution = solve(&problem, method);
        assert!(solution.termination.converged(), "{}", solution.termination);
        // Zero residual: x is known to a few ε.
        let found = solution.values.get(x)[0];
        assert!((found - 1.0).abs() < 1e-14, "{method:?}: {found}");
    }
}

#[test]
fn gauss_newton_says_that_it_left_where_the_model_is_defined() {
    let (problem, _) = with_x(&[4.0], [Log { b: 0.0 }]);
    let solution = solve(&problem, Method::GaussNewton);
    assert_eq!(solution.termination, Termination::Diverged { iteration: 1 });
    assert_eq!(&solution.values, problem.initial());
    assert_eq!(solution.cost, solution.initial_cost);
}

/// r = (x, 1), with a derivative that is only known for x ≥ 2, or is of the wrong sign everywhere.
enum Derivative {
    UnknownBelowTwo,
    Wrong,
}

impl LeastSquares for Derivative {
    type Point = f64;

    fn structure(&self) -> Arc<Structure> {
        Arc::new(Structure::dense(2, 1))
    }
    fn residual(&self, x: &f64, r: &mut [f64]) -> f64 {
        r.copy_from_slice(&[*x, 1.0]);
        0.5 * (x * x + 1.0)
    }
    fn linearize(&self, x: &f64, lin: &mut Linearization) {
        lin.cost = self.residual(x, &mut lin.residual);
        lin.values[0] = match self {
            Self::UnknownBelowTwo if *x < 2.0 => f64::NAN,
            Self::UnknownBelowTwo => 1.0,
            Self::Wrong => -1.0,
        };
    }
    fn plus(&self, x: &f64, delta: &[f64]) -> f64 {
        x + delta[0]
    }
    fn norm(&self, x: &f64) -> f64 {
        x.abs()
    }
}

#[test]
fn a_derivative_that_vanishes_into_nan_on_the_way_is_not_convergence() {
    for method in METHODS {
        let outcome = solver::run(&Derivative::UnknownBelowTwo, 10.0, &settings(method)).unwrap();
        assert!(!outcome.termination.converged(), "{}", outcome.termination);
        assert!(
            outcome.point >= 2.0,
            "the derivative is known at {}",
            outcome.point
        );
        assert_eq!(outcome.cost, 0.5 * (outcome.point * outcome.point + 1.0));
    }
}

#[test]
fn a_wrong_derivative_is_not_convergence() {
    for method in [
        Method::LevenbergMarquardt,
        Method::LineSearch,
        Method::Dogleg,
    ] {
        let outcome = solver::run(&Derivative::Wrong, 10.0, &settings(method)).unwrap();
        assert!(
            matches!(outcome.termination, Termination::Stalled { .. }),
            "{method:?}: {}",
            outcome.termination
        );
        assert_eq!(outcome.point, 10.0);
    }
    // Gauss–Newton runs away, and the start is the best it has seen.
    let gn = settings(Method::GaussNewton);
    let outcome = solver::run(&Derivative::Wrong, 10.0, &gn).unwrap();
    assert!(!outcome.termination.converged(), "{}", outcome.termination);
    assert_eq!(outcome.point, 10.0);
}

/// r = (x³ − 3x + 3, −x − 1): at x = −1 the cubic is flat and the line zero, so the gradient is zero.
struct CubicAndLine;

impl Constraint for CubicAndLine {
    type Vars = (Vector,);
    const DIM: usize = 2;
    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = x[0] * x[0] * x[0] - x[0] * 3.0 + 3.0;
        r[1] = -x[0] - 1.0;
    }
}

#[test]
fn the_point_returned_is_the_one_that_the_termination_is_about() {
    // From 1, with cost 2.5, the first Gauss–Newton step goes to the stationary point −1, with cost 12.5.
    let (problem, x) = with_x(&[1.0], [CubicAndLine]);
    let solution = solve(&problem, Method::GaussNewton);
    assert!(matches!(solution.termination, Termination::Gradient { .. }));
    assert_eq!(solution.values.get(x), [-1.0]);
    assert_eq!(solution.cost, 12.5);
}

#[test]
fn measurements_that_depend_on_nothing_change_nothing() {
    for method in METHODS {
        let (problem, _) = with_x(&[0.3], [Indifferent]);
        let solution = solve(&problem, method);
        assert_eq!(&solution.values, problem.initial());
        assert_eq!(solution.iterations, 0);
        // Every point is a minimum; that x is not determined is for the covariance to say.
        let error = Covariance::at(&problem, &solution.values).unwrap_err();
        assert!(
            error.to_string().starts_with("`x` cannot be told apart"),
            "{error}"
        );
    }
}

fn only_the_sum_is_measured() -> (Problem, [Var<Vector>; 2]) {
    let mut problem = Problem::new();
    let x = problem.add_variable::<Vector>("x", &vec![0.0]);
    let y = problem.add_variable::<Vector>("y", &vec![1.0]);
    for b in [3.0, 5.0] {
        problem.add("sum", (x, y), Sum { b });
    }
    (problem, [x, y])
}

#[test]
fn levenberg_marquardt_converges_where_columns_depend_on_each_other() {
    let (problem, [x, y]) = only_the_sum_is_measured();
    let solution = solve(&problem, Method::LevenbergMarquardt);
    assert!(solution.termination.converged(), "{}", solution.termination);
    let (x, y) = (solution.values.get(x)[0], solution.values.get(y)[0]);
    // The mean of the sums, to 1e-6 residual norms (where less than 1e-12 of the cost is to be
    // gained); the difference, which nothing measures, moves by rounding over damping: ε / 1e-6.
    assert!((x + y - 4.0).abs() < 1.5e-6, "{}", x + y);
    assert!((y - x - 1.0).abs() < 3e-10, "{}", y - x);
}

#[test]
fn gauss_newton_names_the_column_that_depends_on_others() {
    let (problem, _) = only_the_sum_is_measured();
    let solution = solve(&problem, Method::GaussNewton);
    match &solution.termination {
        Termination::Singular {
            column,
            pivot,
            threshold,
        } => {
            assert_eq!(column, "`y`");
            assert!(pivot <= threshold);
        }
        other => panic!("{other}"),
    }
    assert_eq!(&solution.values, problem.initial());
}

#[test]
fn residuals_a_googol_times_larger_or_smaller_have_the_same_estimate() {
    let (plain, p) = growth(1.0, 1);
    for method in METHODS {
        let expected = solve(&plain, method).values.get(p);
        for factor in [1e100, 1e-100] {
            let (problem, p) = growth(factor, 1);
            let solution = solve(&problem, method);
            assert!(solution.termination.converged(), "{}", solution.termination);
            // The same path up to rounding, which ends within 1e-6 residual norms of the minimum.
            for (a, b) in solution.values.get(p).iter().zip(&expected) {
                assert!(
                    (a - b).abs() < 1e-6,
                    "{a} is not {b} ({method:?}, {factor:e})"
                );
            }
        }
    }
}

/// (1e8 (a − 1), b − 2e8 − 0.3): two unknowns in units that differ by eight orders.
struct MixedUnits;

impl Constraint for MixedUnits {
    type Vars = (Vector,);
    const DIM: usize = 2;
    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = (x[0] - 1.0) * 1e8;
        r[1] = x[1] - 2e8 - 0.3;
    }
}

#[test]
fn units_that_differ_by_many_orders_hide_no_residual() {
    for method in METHODS {
        let (problem, x) = with_x(&[1.0, 2e8], [MixedUnits]);
        let solution = solve(&problem, method);
        assert!(solution.termination.converged(), "{}", solution.termination);
        // Eight last bits of 2e8 are 3.6e-7.
        let error = solution.values.get(x)[1] - 2e8 - 0.3;
        assert!(error.abs() < 3.6e-7, "{error:e}: {}", solution.termination);
    }
}

#[test]
fn residuals_whose_squares_overflow_are_not_called_solved() {
    for method in METHODS {
        let (problem, _) = growth(1e200, 1);
        match truing::solve(&problem, &settings(method)) {
            Err(error) => assert!(matches!(error, Error::NotFinite { .. }), "{error}"),
            Ok(solution) => assert!(
                !solution.termination.converged(),
                "{}",
                solution.termination
            ),
        }
    }
}

#[test]
fn the_same_measurements_twice_are_the_same_measurements_of_half_the_variance() {
    let [(once, p), (twice, q)] = [1, 2].map(|repeat| growth(1.0, repeat));
    let gn = Method::GaussNewton;
    let [once, twice] = [(once, p), (twice, q)].map(|(problem, p)| {
        let values = solve(&problem, gn).values;
        let covariance = Covariance::at(&problem, &values).unwrap();
        (values.get(p), covariance.block(p, p))
    });
    // Gauss–Newton converges linearly here: what is left of the last step is below 1e-7 of it.
    for (a, b) in once.0.iter().zip(&twice.0) {
        assert!((a - b).abs() < 1e-7, "{a} is not {b}");
    }
    let difference = (&twice.1 * 2.0 - &once.1).amax();
    assert!(difference < 1e-6 * once.1.amax(), "{difference:e}");
}

#[test]
#[should_panic(expected = "variable 0 is given twice to one constraint of `sum`")]
fn a_variable_twice_in_one_constraint_is_the_programmers_mistake() {
    let (mut problem, x) = with_x::<Log>(&[1.0], []);
    problem.add("sum", (x, x), Sum { b: 1.0 });
}

#[test]
fn more_columns_than_rows_have_a_solution_for_levenberg_marquardt() {
    let (problem, x) = with_x(&[1.0, 2.0, -0.5], [Sphere { b: 4.0 }]);
    let solution = solve(&problem, Method::LevenbergMarquardt);
    assert!(
        matches!(solution.termination, Termination::Residual { .. }),
        "{}",
        solution.termination
    );
    let squares: f64 = solution.values.get(x).iter().map(|c| c * c).sum();
    assert!((squares - 4.0).abs() < 1e-13, "{squares}");
    assert_eq!(
        Covariance::at(&problem, &solution.values).unwrap_err(),
        Error::Underdetermined {
            rows: 1,
            columns: 3
        }
    );
}

#[test]
fn more_columns_than_rows_have_no_gauss_newton_step() {
    let (problem, _) = with_x(&[1.0, 2.0, -0.5], [Sphere { b: 4.0 }]);
    let termination = solve(&problem, Method::GaussNewton).termination;
    assert!(
        matches!(&termination, Termination::Singular { column, .. } if column == "component 1 of `x`"),
        "{termination}"
    );
}

#[test]
fn a_single_row_with_a_single_unknown_is_an_equation() {
    for method in METHODS {
        let (problem, x) = with_x(&[1.0], [Sphere { b: 2.0 }]);
        let solution = solve(&problem, method);
        assert!(solution.termination.converged(), "{}", solution.termination);
        let error = solution.values.get(x)[0] - 2.0_f64.sqrt();
        assert!(error.abs() < 1e-15, "{error:e}");
    }
}

#[test]
fn a_start_at_the_solution_is_the_solution() {
    for method in METHODS {
        let (problem, x) = with_x(&[1.0], [Log { b: 0.0 }]);
        let solution = solve(&problem, method);
        assert!(matches!(
            solution.termination,
            Termination::Residual { value: 0.0, .. }
        ));
        assert_eq!(
            (solution.iterations, solution.values.get(x)),
            (0, vec![1.0])
        );
    }
}

#[test]
fn a_variable_without_components_is_in_nobodys_way() {
    for method in METHODS {
        let (mut problem, x) = with_x(&[4.0], [Sphere { b: 9.0 }]);
        problem.add_variable::<Vector>("nothing", &vec![]);
        let solution = solve(&problem, method);
        assert!((solution.values.get(x)[0] - 3.0).abs() < 1e-14);
    }
}

/// exp(−x): the infimum is at infinity.
struct Vanishing;

impl Constraint for Vanishing {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = (-x[0]).exp();
    }
}

#[test]
fn a_minimum_at_infinity_is_not_reached() {
    for method in METHODS {
        let (problem, _) = with_x(&[0.0], [Vanishing]);
        let mut settings = settings(method);
        // A step adds about one to x: before x = 372 the square of the residual does not underflow.
        settings.tolerances.max_iterations = 300;
        let solution = truing::solve(&problem, &settings).unwrap();
        assert!(
            !solution.termination.converged(),
            "{}",
            solution.termination
        );
        assert!(solution.cost < solution.initial_cost);
    }
}

/// A jump at zero that no derivative tells of: r = x + 1 above, x − 1 below.
struct Jump;

impl Constraint for Jump {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        let side = if truing::value(x[0]) >= 0.0 {
            1.0
        } else {
            -1.0
        };
        r[0] = x[0] + side;
    }
}

#[test]
fn a_jump_in_the_residual_is_not_convergence() {
    for method in METHODS {
        let (problem, _) = with_x(&[5.0], [Jump]);
        let solution = solve(&problem, method);
        assert!(
            !solution.termination.converged(),
            "{}",
            solution.termination
        );
        assert!(solution.cost < solution.initial_cost);
    }
}
