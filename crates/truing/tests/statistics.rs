//! Correlations, leverage, standardised residuals, tests and predictions: of closed forms, of published
//! regressions, and of what is found where a measurement is left out and the rest is fitted again.

use truing::manifold::Vector;
use truing::nalgebra::{DMatrix, DVector};
use truing::statistics::{ConstraintResidual, Influence, Residuals, Scale};
use truing::{
    Batch, Constraint, Covariance, Error, Loss, Noise, Problem, Scalar, Settings, Values, Var,
    Views, solve,
};

/// One row of a linear regression, x·β − y.
#[derive(Clone)]
struct Row {
    x: Vec<f64>,
    y: f64,
}

impl Constraint for Row {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (beta,): Views<'_, Self, T>, r: &mut [T]) {
        let terms = self.x.iter().zip(beta);
        r[0] = terms.fold(T::from(-self.y), |sum, (x, b)| sum + *b * *x);
    }
}

fn regression(rows: &[Row], noise: f64, loss: Loss) -> (Problem, Var<Vector>) {
    let mut problem = Problem::new();
    let beta = problem.add_variable::<Vector>("beta", &vec![0.0; rows[0].x.len()]);
    let noise = Noise::isotropic(noise).unwrap();
    let mut batch = Batch::new("rows").noise(noise).loss(loss);
    for row in rows {
        batch.push((beta,), row.clone());
    }
    problem.add_block(batch);
    (problem, beta)
}

fn fit(rows: &[Row]) -> (Problem, Var<Vector>, Values, Covariance) {
    let (problem, beta) = regression(rows, 1.0, Loss::Trivial);
    let values = solve(&problem, &Settings::default()).unwrap().values;
    let covariance = Covariance::at(&problem, &values).unwrap();
    (problem, beta, values, covariance)
}

#[track_caller]
fn assert_close(ours: f64, theirs: f64, relative: f64) {
    assert!(
        (ours - theirs).abs() <= relative * theirs.abs(),
        "{ours} is not {theirs}"
    );
}

// Published regressions.

/// Norris, NIST Statistical Reference Datasets, linear regression: (y, x).
const NORRIS: [(f64, f64); 36] = [
    (0.1, 0.2),
    (338.8, 337.4),
    (118.1, 118.2),
    (888.0, 884.6),
    (9.2, 10.1),
    (228.1, 226.5),
    (668.5, 666.3),
    (998.5, 996.3),
    (449.1, 448.6),
    (778.9, 777.0),
    (559.2, 558.2),
    (0.3, 0.4),
    (0.1, 0.6),
    (778.1, 775.5),
    (668.8, 666.9),
    (339.3, 338.0),
    (448.9, 447.5),
    (10.8, 11.6),
    (557.7, 556.0),
    (228.3, 228.1),
    (998.0, 995.8),
    (888.8, 887.6),
    (119.6, 120.2),
    (0.3, 0.3),
    (0.6, 0.3),
    (557.6, 556.8),
    (339.3, 339.1),
    (888.0, 887.2),
    (998.5, 999.0),
    (778.9, 779.0),
    (10.2, 11.1),
    (117.6, 118.3),
    (228.9, 229.2),
    (668.4, 669.1),
    (449.2, 448.9),
    (0.2, 0.5),
];

#[test]
fn norris_has_its_certified_standard_deviations() {
    let rows: Vec<Row> = NORRIS
        .map(|(y, x)| Row { x: vec![1.0, x], y })
        .into_iter()
        .collect();
    let (_, beta, values, covariance) = fit(&rows);
    assert_close(covariance.sigma0(), 0.884796396144373, 1e-10);
    let deviations = covariance.std_devs(beta);
    for (k, (estimate, deviation)) in [
        (-0.262323073774029, 0.232818234301152),
        (1.00211681802045, 0.429796848199937e-3),
    ]
    .into_iter()
    .enumerate()
    {
        assert_close(values.get(beta)[k], estimate, 1e-10);
        assert_close(deviations[k] * covariance.sigma0(), deviation, 1e-10);
    }
}

/// Longley 1967, NIST Statistical Reference Datasets: y, then six columns that hardly differ.
const LONGLEY: [[f64; 7]; 16] = [
    [60323.0, 83.0, 234289.0, 2356.0, 1590.0, 107608.0, 1947.0],
    [61122.0, 88.5, 259426.0, 2325.0, 1456.0, 108632.0, 1948.0],
    [60171.0, 88.2, 258054.0, 3682.0, 1616.0, 109773.0, 1949.0],
    [61187.0, 89.5, 284599.0, 3351.0, 1650.0, 110929.0, 1950.0],
    [63221.0, 96.2, 328975.0, 2099.0, 3099.0, 112075.0, 1951.0],
    [63639.0, 98.1, 346999.0, 1932.0, 3594.0, 113270.0, 1952.0],
    [64989.0, 99.0, 365385.0, 1870.0, 3547.0, 115094.0, 1953.0],
    [63761.0, 100.0, 363112.0, 3578.0, 3350.0, 116219.0, 1954.0],
    [66019.0, 101.2, 397469.0, 2904.0, 3048.0, 117388.0, 1955.0],
    [67857.0, 104.6, 419180.0, 2822.0, 2857.0, 118734.0, 1956.0],
    [68169.0, 108.4, 442769.0, 2936.0, 2798.0, 120445.0, 1957.0],
    [66513.0, 110.8, 444546.0, 4681.0, 2637.0, 121950.0, 1958.0],
    [68655.0, 112.6, 482704.0, 3813.0, 2552.0, 123366.0, 1959.0],
    [69564.0, 114.2, 502601.0, 3931.0, 2514.0, 125368.0, 1960.0],
    [69331.0, 115.7, 518173.0, 4806.0, 2572.0, 127852.0, 1961.0],
    [70551.0, 116.9, 554894.0, 4007.0, 2827.0, 130081.0, 1962.0],
];

/// Its normal matrix has a condition number of 2e19, beyond double precision; J with its columns scaled
/// has 43,000, and leaves about ten digits.
#[test]
fn longley_has_its_certified_standard_deviations() {
    let rows: Vec<Row> = LONGLEY
        .iter()
        .map(|row| Row {
            x: [&[1.0], &row[1..]].concat(),
            y: row[0],
        })
        .collect();
    let (_, beta, values, covariance) = fit(&rows);
    assert_close(covariance.sigma0(), 304.854073561965, 1e-9);
    let certified = [
        (-3482258.63459582, 890420.383607373),
        (15.0618722713733, 84.9149257747669),
        (-0.358191792925910e-1, 0.334910077722432e-1),
        (-2.02022980381683, 0.488399681651699),
        (-1.03322686717359, 0.214274163161675),
        (-0.511041056535807e-1, 0.226073200069370),
        (1829.15146461355, 455.478499142212),
    ];
    let deviations = covariance.std_devs(beta);
    for (k, (estimate, deviation)) in certified.into_iter().enumerate() {
        assert_close(values.get(beta)[k], estimate, 1e-7);
        assert_close(deviations[k] * covariance.sigma0(), deviation, 1e-9);
    }
}

/// Brownlee's stack loss data: air flow, water temperature, acid concentration, loss.
const STACK: [[f64; 4]; 21] = [
    [80.0, 27.0, 89.0, 42.0],
    [80.0, 27.0, 88.0, 37.0],
    [75.0, 25.0, 90.0, 37.0],
    [62.0, 24.0, 87.0, 28.0],
    [62.0, 22.0, 87.0, 18.0],
    [62.0, 23.0, 87.0, 18.0],
    [62.0, 24.0, 93.0, 19.0],
    [62.0, 24.0, 93.0, 20.0],
    [58.0, 23.0, 87.0, 15.0],
    [58.0, 18.0, 80.0, 14.0],
    [58.0, 18.0, 89.0, 14.0],
    [58.0, 17.0, 88.0, 13.0],
    [58.0, 18.0, 82.0, 11.0],
    [58.0, 19.0, 93.0, 12.0],
    [50.0, 18.0, 89.0, 8.0],
    [50.0, 18.0, 86.0, 7.0],
    [50.0, 19.0, 72.0, 8.0],
    [50.0, 19.0, 79.0, 8.0],
    [50.0, 20.0, 80.0, 9.0],
    [56.0, 20.0, 82.0, 15.0],
    [70.0, 20.0, 91.0, 15.0],
];

fn stack() -> Vec<Row> {
    let row = |[a, w, c, y]: [f64; 4]| Row {
        x: vec![1.0, a, w, c],
        y,
    };
    STACK.map(row).into()
}

/// What R prints of `lm(stack.loss ~ ., stackloss)`: `hatvalues`, `rstandard`, `rstudent`,
/// `cooks.distance`, by number of the row from 1.
#[test]
fn the_stack_loss_data_have_the_outliers_that_everyone_finds() {
    let (problem, _, values, covariance) = fit(&stack());
    let residuals = Residuals::at(&problem, &values, &covariance);
    for (row, hat, standardised, studentised, cook) in [
        (1, 0.301555, 1.19334, 1.20947, 0.15371),
        (3, 0.174615, 1.54602, 1.6179, 0.126414),
        (4, 0.128505, 1.88182, 2.0518, 0.130542),
        (17, 0.412123, -0.61121, -0.599586, 0.0654731),
        (21, 0.284533, -2.63822, -3.33049, 0.692),
    ] {
        let of = &residuals.constraints[row - 1];
        assert_close(residuals.leverage[row - 1], hat, 1e-5);
        assert_close(of.leverage, hat, 1e-5);
        // Their residuals are y − x·β, ours x·β − y.
        assert_close(-residuals.standardised[row - 1], standardised, 1e-5);
        assert_close(of.standardised(), f64::abs(standardised), 1e-5);
        assert_close(of.cook, cook, 1e-5);
        let freedom = 17.0;
        let t2 = of.square;
        let external = (t2 * (freedom - 1.0) / (freedom - t2)).sqrt();
        assert_close(external, f64::abs(studentised), 1e-5);
    }
    // Student's t with 16 degrees of freedom is beyond ±2.120 with 5 % (Abramowitz & Stegun, table
    // 26.10), beyond ±3.330 with 0.42 %.
    let p = |row: usize| residuals.constraints[row - 1].p_value;
    assert!((p(21) - 0.0042).abs() < 1e-4, "{}", p(21));
    assert!(p(4) > 0.05 && p(4) < 0.06, "{}", p(4));
    assert!((residuals.leverage.iter().sum::<f64>() - 4.0).abs() < 1e-12);
}

/// `summary(MASS::rlm(stack.loss ~ ., stackloss))` (Venables & Ripley 2002, *Modern Applied Statistics
/// with S*, section 6.5): Huber's loss with k = 1.345 at the scale 2.441; standard errors by the same
/// formula, with n − 1 in a variance where Huber has n, which changes them by less than 0.3 %.
#[test]
fn robust_standard_deviations_are_those_of_rlm() {
    const SCALE: f64 = 2.441;
    let loss = Loss::huber(1.345).unwrap();
    let (robust, _) = regression(&stack(), SCALE, loss);
    let values = solve(&robust, &Settings::default()).unwrap().values;
    let (plain, beta) = regression(&stack(), SCALE, Loss::Trivial);
    let raw = plain.raw_residual(0, &values);
    let influences = raw.iter().map(|r| Influence::of(&loss, &[r / SCALE]));
    let covariance = Covariance::robust(&plain, &values, influences).unwrap();
    let deviations = covariance.std_devs(beta);
    for (k, (estimate, deviation)) in [
        (-41.0265, 9.8073),
        (0.8294, 0.1112),
        (0.9261, 0.3034),
        (-0.1278, 0.1289),
    ]
    .into_iter()
    .enumerate()
    {
        assert!((values.get(beta)[k] - estimate).abs() < 1e-3 * deviation + 5e-5);
        assert_close(deviations[k] * covariance.sigma0(), deviation, 4e-3);
    }
    let test = covariance.chi_square().unwrap();
    assert!(test.robust && test.to_string().contains("robust"));
}

// Closed forms.

const TIMES: [f64; 7] = [-3.0, -1.0, 0.0, 0.5, 2.0, 2.5, 6.0];

fn line() -> Vec<Row> {
    let row = |t: f64| Row {
        x: vec![1.0, t],
        y: 0.3 + 2.0 * t + (7.0 * t).sin(),
    };
    TIMES.map(row).into()
}

/// h = 1/n + (t − t̄)²/Stt, and the line at any t is known by that; ρ of intercept and slope is
/// −t̄/√(mean of t²).
#[test]
fn a_straight_line_has_the_leverage_of_the_book() {
    let n = TIMES.len() as f64;
    let mean = TIMES.iter().sum::<f64>() / n;
    let stt: f64 = TIMES.iter().map(|t| (t - mean).powi(2)).sum();
    let hat = |t: f64| 1.0 / n + (t - mean).powi(2) / stt;
    let (problem, beta, values, covariance) = fit(&line());
    let residuals = Residuals::at(&problem, &values, &covariance);
    for (h, t) in residuals.leverage.iter().zip(TIMES) {
        assert_close(*h, hat(t), 1e-13);
    }
    let square_mean = TIMES.iter().map(|t| t * t).sum::<f64>() / n;
    let rho = -mean / square_mean.sqrt();
    assert_close(covariance.correlation(0, 1), rho, 1e-13);
    assert_close(covariance.correlations()[(1, 0)], rho, 1e-13);
    for t in [-10.0, 0.7, 4.0] {
        let later = Row {
            x: vec![1.0, t],
            y: 0.0,
        };
        let line = covariance.predict((beta,), &later, &values);
        assert_close(
            line.value[0],
            values.get(beta)[0] + t * values.get(beta)[1],
            1e-13,
        );
        assert_close(line.covariance[(0, 0)], hat(t), 1e-13);
        let g = DMatrix::from_row_slice(1, 2, &[1.0, t]);
        assert_close(covariance.propagate(&[0, 1], &g)[(0, 0)], hat(t), 1e-13);
        let measured = line.measured_with(&Noise::Isotropic(2.0));
        assert_close(measured[(0, 0)], hat(t) + 4.0, 1e-13);
    }
}

/// A line held on a point (t₀, y₀) only turns about it: the slope's variance is 1/Σ(t − t₀)², the
/// intercept goes with it by −t₀, and h = (t − t₀)²/Σ(t − t₀)².
#[test]
fn a_line_through_a_given_point_only_turns_about_it() {
    const T0: f64 = 1.5;
    let (problem, beta, values, _) = fit(&line());
    // Any length of the basis will do.
    for length in [1.0, 1e6, -0.3] {
        let basis = DMatrix::from_column_slice(2, 1, &[-T0 * length, length]);
        let covariance = Covariance::within(&problem, &values, Some(&basis)).unwrap();
        let moment: f64 = TIMES.iter().map(|t| (t - T0).powi(2)).sum();
        let expected = [[T0 * T0, -T0], [-T0, 1.0]];
        let block = covariance.block(beta, beta);
        for i in 0..2 {
            for k in 0..2 {
                assert_close(block[(i, k)], expected[i][k] / moment, 1e-13);
            }
        }
        assert_close(covariance.correlation(0, 1), -1.0, 1e-13);
        assert_eq!(covariance.rank(), 1);
        assert_eq!(covariance.degrees_of_freedom(), TIMES.len() - 1);
        let residuals = Residuals::at(&problem, &values, &covariance);
        for (h, t) in residuals.leverage.iter().zip(TIMES) {
            assert_close(*h, (t - T0).powi(2) / moment, 1e-12);
        }
    }
    // The whole space in other coordinates is the whole space.
    let turned = DMatrix::from_column_slice(2, 2, &[1.0, 1.0, -3.0, 0.5]);
    let whole = Covariance::within(&problem, &values, Some(&turned)).unwrap();
    let plain = Covariance::at(&problem, &values).unwrap();
    assert!((whole.matrix() - plain.matrix()).amax() < 1e-14);
    // Nothing that can move is known exactly.
    let none = Covariance::within(&problem, &values, Some(&DMatrix::zeros(2, 0))).unwrap();
    assert_eq!(none.matrix(), DMatrix::zeros(2, 2));
    let twice = DMatrix::from_column_slice(2, 2, &[1.0, 1.0, 2.0, 2.0]);
    let error = Covariance::within(&problem, &values, Some(&twice)).unwrap_err();
    assert!(
        matches!(&error, Error::RankDeficient { column, .. } if column == "component 1 of `beta`"),
        "{error}"
    );
}

/// Beyond its threshold k the pull of Huber's loss only turns: ψ′ is k/‖r‖ across r and zero along it.
#[test]
fn the_influence_of_huber_is_capped() {
    let loss = Loss::huber(2.0).unwrap();
    let inside = Influence::of(&loss, &[1.0, -1.0, 0.5]);
    assert_eq!((inside.rows, inside.slope, inside.square), (3, 1.0, 2.25));
    let outside = Influence::of(&loss, &[4.0, 0.0, -3.0]);
    assert_close(outside.square, 4.0, 1e-14);
    assert_close(outside.slope, 2.0 / 5.0 * 2.0 / 3.0, 1e-9);
    let zero = Influence::of(&loss, &[0.0]);
    assert_eq!((zero.slope, zero.square), (1.0, 0.0));
}

#[test]
fn strong_correlations_have_names() {
    let (mut problem, beta) = regression(&line(), 1.0, Loss::Trivial);
    problem.name_components(beta, &["offset".into(), "slope".into()]);
    let covariance = Covariance::at(&problem, problem.initial()).unwrap();
    let strong = covariance.strongest_correlations(&problem, 0.2);
    assert_eq!(strong.len(), 1);
    assert_eq!(strong[0].names, ("`offset`".into(), "`slope`".into()));
    assert_eq!(strong[0].columns, (0, 1));
    assert!(covariance.strongest_correlations(&problem, 0.9).is_empty());
}

// Measurements of several rows.

/// Three rows A x − b.
#[derive(Clone)]
struct Triple {
    a: [[f64; 4]; 3],
    b: [f64; 3],
}

impl Constraint for Triple {
    type Vars = (Vector,);
    const DIM: usize = 3;
    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        for i in 0..3 {
            let terms = self.a[i].iter().zip(x);
            r[i] = terms.fold(T::from(-self.b[i]), |sum, (a, x)| sum + *x * *a);
        }
    }
}

fn triples() -> Vec<Triple> {
    let wave =
        |i: usize, k: usize, m: usize| (0.37 * ((1 + i + 5 * k + 11 * m) as f64).powi(2)).sin();
    let triple = |m: usize| Triple {
        a: std::array::from_fn(|i| std::array::from_fn(|k| wave(i, k, m))),
        b: std::array::from_fn(|i| 3.0 * wave(i, 7, m)),
    };
    (0..8).map(triple).collect()
}

fn correlated() -> Noise {
    let covariance = [4.0, 1.0, 0.5, 1.0, 3.0, -0.2, 0.5, -0.2, 2.0];
    Noise::full(&DMatrix::from_row_slice(3, 3, &covariance)).unwrap()
}

fn fit_triples(triples: &[Triple]) -> (Problem, Var<Vector>, Values, Covariance) {
    let mut problem = Problem::new();
    let x = problem.add_variable::<Vector>("x", &vec![0.0; 4]);
    let mut batch = Batch::new("triples").noise(correlated());
    triples
        .iter()
        .for_each(|triple| batch.push((x,), triple.clone()));
    problem.add_block(batch);
    let values = solve(&problem, &Settings::default()).unwrap().values;
    let covariance = Covariance::at(&problem, &values).unwrap();
    (problem, x, values, covariance)
}

/// Each measurement is left out in turn and the rest fitted again: its error there, beside the
/// uncertainty of its prediction, is what the whole fit says of it at once; so is how far the
/// estimate moves.
#[test]
fn a_measurement_is_judged_as_if_it_had_been_left_out() {
    let triples = triples();
    let (problem, x, values, covariance) = fit_triples(&triples);
    let residuals = Residuals::at(&problem, &values, &covariance);
    assert_eq!(residuals.constraints.len(), 8);
    let total: f64 = residuals.constraints.iter().map(|c| c.leverage).sum();
    assert!((total - 4.0).abs() < 1e-12);
    let sigma0 = covariance.sigma0();
    let vector = |values: &Values| DVector::from_vec(values.get(x));
    for (k, of) in residuals.constraints.iter().enumerate() {
        let mut others = triples.clone();
        let out = others.remove(k);
        let (_, x, without, rest) = fit_triples(&others);
        let predicted = rest.predict((x,), &out, &without);
        let error = DVector::from_vec(predicted.value.clone());
        let expected = predicted.measured_with(&correlated());
        let square = error.dot(&(expected.try_inverse().unwrap() * &error));
        // T² σ₀² is the same with either fit (the update of a least-squares fit by one block).
        assert_close(of.square * sigma0 * sigma0, square, 1e-9);
        // And the sum of squares is smaller by just that.
        let freedom = covariance.degrees_of_freedom() as f64;
        let all = sigma0 * sigma0 * freedom;
        let left = rest.sigma0().powi(2) * rest.degrees_of_freedom() as f64;
        assert_close(all - square, left, 1e-9);
        let moved = vector(&without) - vector(&values);
        let normal = covariance.block(x, x).try_inverse().unwrap();
        let cook = moved.dot(&(normal * &moved)) / (4.0 * sigma0 * sigma0);
        assert_close(of.cook, cook, 1e-8);
        assert_eq!((of.checked, of.rows.clone()), (3, 3 * k..3 * k + 3));
    }
}

/// A measurement that alone determines an unknown is fitted whatever it reads.
#[test]
fn what_nothing_checks_has_no_standardised_residual() {
    let mut rows: Vec<Row> = line();
    rows.iter_mut().for_each(|row| row.x.push(0.0));
    rows[2].x[2] = 1.0;
    let (problem, _, values, covariance) = fit(&rows);
    let residuals = Residuals::at(&problem, &values, &covariance);
    let alone = &residuals.constraints[2];
    assert!((alone.leverage - 1.0).abs() < 1e-12);
    assert_eq!(alone.checked, 0);
    assert!(alone.p_value.is_nan() && alone.standardised().is_nan() && alone.cook.is_nan());
    assert!(residuals.standardised[2].is_nan());
    let checked = |c: &&ConstraintResidual| c.checked == 1 && c.p_value > 0.0;
    assert_eq!(residuals.constraints.iter().filter(checked).count(), 6);
}

#[test]
fn the_robust_scale_is_the_median_over_its_normal_value() {
    // Quartiles of the normal distribution are at ∓0.6745 (Abramowitz & Stegun, table 26.1).
    let scale = |r: &[f64]| Scale::robust(r).sigma0();
    assert_close(scale(&[-0.6745, 0.1, 1e9]), 1.0, 1e-4);
    assert_close(scale(&[0.5, -0.849, 3.0, 0.0]), 1.0, 1e-4);
    assert!(scale(&[]).is_nan());
}
