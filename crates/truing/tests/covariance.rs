//! The covariance is that of the estimate: of closed forms, of repeated experiments, and of nothing
//! that the solver did on the way.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use truing::argmin::core::{Executor, State};
use truing::manifold::Vector;
use truing::nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use truing::solver::{LevenbergMarquardt, SolverState};
use truing::{
    Batch, Constraint, Covariance, Error, Method, Noise, Problem, Scalar, Settings, Values, Var,
    Views,
};

/// One row a·x − b.
struct Row {
    a: [f64; 3],
    b: f64,
}

impl Constraint for Row {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = (0..3).fold(T::from(-self.b), |sum, i| sum + x[i] * self.a[i]);
    }
}

const DESIGN: [([f64; 3], f64); 5] = [
    ([1.0, 0.0, 2.0], 1.0),
    ([0.5, -1.0, 0.0], -2.0),
    ([3.0, 1.0, 1.0], 0.5),
    ([-1.0, 2.0, 0.3], 4.0),
    ([0.0, 0.7, -1.0], 0.1),
];
const SIGMA: f64 = 0.2;

/// The rows of the design, measured with SIGMA.
fn linear_problem(rows: &[([f64; 3], f64)]) -> (Problem, Var<Vector>) {
    let mut problem = Problem::new();
    let x = problem.add_variable::<Vector>("x", &vec![0.0; 3]);
    let mut batch = Batch::new("rows").noise(Noise::isotropic(SIGMA).unwrap());
    for &(a, b) in rows {
        batch.push((x,), Row { a, b });
    }
    problem.add_block(batch);
    (problem, x)
}

#[track_caller]
fn assert_close(ours: &DMatrix<f64>, theirs: &DMatrix<f64>, relative: f64) {
    let difference = (ours - theirs).amax();
    assert!(
        difference <= relative * theirs.amax(),
        "{ours} is not {theirs}, by {difference:e}"
    );
}

#[test]
fn a_linear_model_has_the_inverse_of_its_normal_matrix() {
    let (problem, x) = linear_problem(&DESIGN);
    let a = DMatrix::from_fn(5, 3, |i, k| DESIGN[i].0[k]);
    let b = DVector::from_fn(5, |i, _| DESIGN[i].1);
    let inverse = (a.transpose() * &a).try_inverse().unwrap();
    let solution = truing::solve(&problem, &Settings::default()).unwrap();
    let covariance = Covariance::at(&problem, &solution.values).unwrap();
    assert_close(&covariance.block(x, x), &(&inverse * SIGMA.powi(2)), 1e-13);
    for (k, deviation) in covariance.std_devs(x).into_iter().enumerate() {
        assert!((deviation - SIGMA * inverse[(k, k)].sqrt()).abs() < 1e-13);
    }
    // σ₀² is the weighted sum of squares of the closed-form residuals over 5 − 3.
    let residual = &a * (&inverse * (a.transpose() * &b)) - &b;
    let sigma0 = residual.norm() / SIGMA / 2.0_f64.sqrt();
    assert_eq!(covariance.degrees_of_freedom(), 2);
    assert!((covariance.sigma0() - sigma0).abs() < 1e-12 * sigma0);
}

#[test]
fn the_condition_is_that_of_the_scaled_jacobian() {
    let (problem, _) = linear_problem(&DESIGN);
    let covariance = Covariance::at(&problem, problem.initial()).unwrap();
    let mut a = DMatrix::from_fn(5, 3, |i, k| DESIGN[i].0[k]);
    for mut column in a.column_iter_mut() {
        column.normalize_mut();
    }
    // The squared singular values are the eigenvalues of AᵀA, whose trace is 3.
    let mut squares = (a.transpose() * a)
        .symmetric_eigenvalues()
        .as_slice()
        .to_vec();
    squares.sort_by(|a, b| b.total_cmp(a));
    for (ours, square) in covariance.singular_values().iter().zip(&squares) {
        assert!((ours * ours - square).abs() < 1e-13);
    }
    let condition = (squares[0] / squares[2]).sqrt();
    assert!((covariance.condition() - condition).abs() < 1e-12 * condition);
}

/// y = a · exp(−t / τ), with a in units of `unit`: a thousandth for thousandths.
struct Decay {
    t: f64,
    y: f64,
    unit: f64,
}

impl Constraint for Decay {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (p,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = p[0] * self.unit * (-(p[1].recip() * self.t)).exp() - self.y;
    }
}

const AMPLITUDE: f64 = 3.0;
const TAU: f64 = 2.0;
const DECAY_SIGMA: f64 = 0.02;
const SAMPLES: usize = 20;

fn decay_problem(seed: u64, unit: f64) -> (Problem, Var<Vector>) {
    let mut noise = ChaCha8Rng::seed_from_u64(seed);
    let mut problem = Problem::new();
    let p = problem.add_variable::<Vector>("p", &vec![2.0 / unit, 1.5]);
    let mut batch = Batch::new("decay").noise(Noise::isotropic(DECAY_SIGMA).unwrap());
    for i in 0..SAMPLES {
        let t = 0.3 * i as f64;
        let error: f64 = StandardNormal.sample(&mut noise);
        let y = AMPLITUDE * (-t / TAU).exp() + DECAY_SIGMA * error;
        batch.push((p,), Decay { t, y, unit });
    }
    problem.add_block(batch);
    (problem, p)
}

#[test]
fn the_covariance_does_not_know_the_solver_nor_its_damping() {
    let (problem, p) = decay_problem(7, 1.0);
    let mut found: Vec<(DMatrix<f64>, f64)> = Vec::new();
    let mut keep = |values: &Values| {
        let covariance = Covariance::at(&problem, values).unwrap();
        found.push((covariance.block(p, p), covariance.sigma0()));
    };
    for method in [Method::GaussNewton, Method::LevenbergMarquardt] {
        let settings = Settings {
            method,
            ..Settings::default()
        };
        keep(&truing::solve(&problem, &settings).unwrap().values);
    }
    for damping in [1e-12, 1.0, 1e6] {
        let start = problem.initial().clone();
        let solver = LevenbergMarquardt::new().initial_damping(damping);
        let result = Executor::new(&problem, solver)
            .configure(|state: SolverState<Values>| state.param(start).max_iters(200))
            .ctrlc(false)
            .run()
            .unwrap();
        keep(result.state.get_best_param().unwrap());
    }
    // The points differ by 1e-6 residual norms at most (see estimation.rs), here 1e-6 · 4 standard
    // deviations, which is 1e-8 of the parameters; their covariances by a little more.
    for (covariance, sigma0) in &found[1..] {
        assert_close(covariance, &found[0].0, 1e-6);
        assert!((sigma0 - found[0].1).abs() < 1e-10 * sigma0);
    }
}

#[test]
fn the_covariance_carries_the_units_of_the_columns() {
    let (problem, p) = decay_problem(7, 1.0);
    let plain = truing::solve(&problem, &Settings::default())
        .unwrap()
        .values;
    let plain = Covariance::at(&problem, &plain).unwrap();
    let (problem, q) = decay_problem(7, 1e-6);
    let micro = truing::solve(&problem, &Settings::default())
        .unwrap()
        .values;
    let micro = Covariance::at(&problem, &micro).unwrap();
    // In the columns' own units; what is left is the distance of the two points, as above.
    let unit = DMatrix::from_diagonal(&DVector::from_vec(vec![1e-6, 1.0]));
    assert_close(
        &(&unit * micro.block(q, q) * &unit),
        &plain.block(p, p),
        1e-6,
    );
    assert!((micro.condition() - plain.condition()).abs() < 1e-6 * plain.condition());
}

#[test]
fn over_400_experiments_the_normalised_estimates_are_chi_square() {
    // For each seed q = (p̂ − p)ᵀ C⁻¹ (p̂ − p) is χ² with 2 and twice the cost with 20 − 2 degrees of
    // freedom, up to curvature, which at this noise (deviations below one per cent) is below 1e-2 of
    // the spread of the sums. Both are tested at the level 0.1 %, two-sided: quantiles 0.0005 and
    // 0.9995 of χ², from the regularised incomplete gamma function (Abramowitz & Stegun 26.4.19).
    const SEEDS: u64 = 400;
    const CHI_SQUARE_800: [f64; 2] = [674.893, 938.205];
    const CHI_SQUARE_7200: [f64; 2] = [6811.68, 7601.43];
    let (mut estimates, mut residuals) = (0.0, 0.0);
    // For each component, how many truths are within its standard deviation.
    let mut inside = [0; 2];
    for seed in 0..SEEDS {
        let (problem, p) = decay_problem(seed, 1.0);
        let solution = truing::solve(&problem, &Settings::default()).unwrap();
        assert!(solution.termination.converged(), "{}", solution.termination);
        let covariance = Covariance::at(&problem, &solution.values).unwrap();
        let error = Vector2::from_vec(solution.values.get(p)) - Vector2::new(AMPLITUDE, TAU);
        let block = Matrix2::from_column_slice(covariance.block(p, p).as_slice());
        estimates += error.dot(&(block.try_inverse().unwrap() * error));
        residuals += 2.0 * solution.cost;
        for (count, (error, deviation)) in inside
            .iter_mut()
            .zip(error.iter().zip(covariance.std_devs(p)))
        {
            *count += u32::from(error.abs() < deviation);
        }
    }
    let [low, high] = CHI_SQUARE_800;
    assert!(low < estimates && estimates < high, "Σq = {estimates}");
    let [low, high] = CHI_SQUARE_7200;
    assert!(low < residuals && residuals < high, "Σr² = {residuals}");
    // Binomial(400, 0.6827) is 273.1 ± 9.31; at 0.1 % two-sided, 3.29 deviations: 242.5 … 303.7.
    for count in inside {
        assert!((243..=303).contains(&count), "{count} of 400 within one σ");
    }
}

#[test]
fn fixed_components_have_none() {
    let (mut problem, x) = linear_problem(&DESIGN);
    problem.fix_component(x, 1);
    let covariance = Covariance::at(&problem, problem.initial()).unwrap();
    let block = covariance.block(x, x);
    for k in 0..3 {
        assert_eq!((block[(1, k)], block[(k, 1)]), (0.0, 0.0));
    }
    // The others have what they would have if there were no such column.
    let a = DMatrix::from_fn(5, 2, |i, k| DESIGN[i].0[2 * k]);
    let expected = (a.transpose() * a).try_inverse().unwrap() * SIGMA.powi(2);
    let free = block.select_columns(&[0, 2]).select_rows(&[0, 2]);
    assert_close(&free, &expected, 1e-13);
    assert_eq!(covariance.degrees_of_freedom(), 3);
}

#[test]
fn a_dependent_column_is_named() {
    // The last column is the sum of the others, to rounding.
    let rows = DESIGN.map(|([a, b, _], y)| ([a, b, a + b], y));
    let (problem, _) = linear_problem(&rows);
    match Covariance::at(&problem, problem.initial()) {
        Err(Error::RankDeficient {
            column,
            pivot,
            threshold,
        }) => {
            assert_eq!(column, "component 2 of `x`");
            assert!(pivot <= threshold);
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_column_without_effect_is_named() {
    let rows = DESIGN.map(|([a, _, c], y)| ([a, 0.0, c], y));
    let (problem, _) = linear_problem(&rows);
    let error = Covariance::at(&problem, problem.initial()).unwrap_err();
    assert!(
        matches!(&error, Error::RankDeficient { column, .. } if column == "component 1 of `x`"),
        "{error}"
    );
}

#[test]
fn more_unknowns_than_rows_is_an_error_with_both_numbers() {
    let (mut problem, x) = linear_problem(&DESIGN[..2]);
    assert_eq!(
        Covariance::at(&problem, problem.initial()).unwrap_err(),
        Error::Underdetermined {
            rows: 2,
            columns: 3
        }
    );
    // As many as rows have a covariance, but nothing to estimate σ₀ from.
    problem.fix_component(x, 2);
    let covariance = Covariance::at(&problem, problem.initial()).unwrap();
    assert_eq!(covariance.degrees_of_freedom(), 0);
    assert!(covariance.sigma0().is_nan());
}
