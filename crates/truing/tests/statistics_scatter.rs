//! Over many simulated experiments estimates, sums of squares and residuals are distributed as the
//! statistics say. Seeds are fixed: the outcome is always the same.
//!
//! Distributions are compared by Kolmogorov–Smirnov: √N sup|F_N − F| is above 1.95 with 0.1 %
//! (Smirnov 1948, table). Moments must lie within 4 of their standard deviations, which one in 16,000
//! does not. With the 60 or so comparisons here that is a level below 1.5 % in all.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::sync::OnceLock;
use truing::manifold::{Point3, Vector};
use truing::nalgebra::{DMatrix, DVector, Vector3};
use truing::statistics::{Residuals, Scale};
use truing::{Batch, Constraint, Covariance, Noise, Problem, Scalar, Settings, Var, Views, solve};

/// The place of a source that fades with distance, seen from a station: three rows, direction times
/// strength over distance squared.
struct Sight {
    station: [f64; 3],
    seen: [f64; 3],
}

impl Constraint for Sight {
    type Vars = (Point3, Vector);
    const DIM: usize = 3;
    fn residual<T: Scalar>(&self, (p, s): Views<'_, Self, T>, r: &mut [T]) {
        let d: [T; 3] = std::array::from_fn(|i| p[i] - self.station[i]);
        let square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        for i in 0..3 {
            r[i] = d[i] * s[0] / square + s[1] * self.station[i] - self.seen[i];
        }
    }
}

const SOURCE: [f64; 3] = [0.4, -0.3, 0.5];
const STRENGTH: [f64; 2] = [2.0, 0.1];
const STATIONS: usize = 9;
const SEEDS: u64 = 1500;

/// Standard deviations of half to one per cent, rows of one station correlated.
fn noise() -> DMatrix<f64> {
    DMatrix::from_row_slice(3, 3, &[1.0, 0.4, 0.0, 0.4, 0.5, -0.2, 0.0, -0.2, 0.8]) * 1e-6
}

fn station(k: usize) -> [f64; 3] {
    let turn = 2.4 * k as f64;
    [2.0 * turn.cos(), 2.0 * turn.sin(), 0.3 * k as f64 - 1.0]
}

fn experiment(seed: u64) -> (Problem, Var<Point3>, Var<Vector>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let factor = noise().cholesky().unwrap().l();
    let mut problem = Problem::new();
    let p = problem.add_variable::<Point3>("source", &Vector3::new(0.2, 0.0, 0.2));
    let s = problem.add_variable::<Vector>("strength", &vec![1.5, 0.0]);
    let mut batch = Batch::new("sights").noise(Noise::full(&noise()).unwrap());
    for k in 0..STATIONS {
        let station = station(k);
        let exact = Sight {
            station,
            seen: [0.0; 3],
        };
        let mut seen = [0.0; 3];
        exact.residual((Vector3::from(SOURCE), &STRENGTH[..]), &mut seen);
        let white = DVector::from_fn(3, |_, _| StandardNormal.sample(&mut rng));
        let error: DVector<f64> = &factor * white;
        seen.iter_mut().zip(&error).for_each(|(y, e)| *y += e);
        batch.push((p, s), Sight { station, seen });
    }
    problem.add_block(batch);
    (problem, p, s)
}

struct Trial {
    error: DVector<f64>,
    covariance: DMatrix<f64>,
    sigma0: f64,
    /// Where the sum of squares is in its distribution.
    fit: f64,
    known: Residuals,
    estimated: Residuals,
    /// Where a new sight from elsewhere is in its distribution, were σ₀ known.
    new: f64,
}

fn trial(seed: u64) -> Trial {
    let (problem, p, s) = experiment(seed);
    let solution = solve(&problem, &Settings::default()).unwrap();
    assert!(solution.termination.converged(), "{}", solution.termination);
    let values = &solution.values;
    let covariance = Covariance::at(&problem, values).unwrap();
    let (place, strength) = (values.get(p), values.get(s));
    let error = DVector::from_fn(5, |k, _| match k {
        0..3 => place[k] - SOURCE[k],
        _ => strength[k - 3] - STRENGTH[k - 3],
    });
    // A sight that was not used, from another place, with noise of its own.
    let mut rng = ChaCha8Rng::seed_from_u64(seed + 1_000_000);
    let at = |seen| Sight {
        station: [0.3, 1.5, 1.2],
        seen,
    };
    let mut seen = [0.0; 3];
    at(seen).residual((Vector3::from(SOURCE), &STRENGTH[..]), &mut seen);
    let white = DVector::from_fn(3, |_, _| StandardNormal.sample(&mut rng));
    let drawn: DVector<f64> = noise().cholesky().unwrap().l() * white;
    seen.iter_mut().zip(&drawn).for_each(|(y, e)| *y += e);
    let new = covariance.predict((p, s), &at(seen), values);
    let expected = new.measured_with(&Noise::full(&noise()).unwrap());
    let off = DVector::from_vec(new.value);
    let square = off.dot(&(expected.try_inverse().unwrap() * &off));
    Trial {
        error,
        covariance: covariance.matrix(),
        sigma0: covariance.sigma0(),
        fit: covariance.chi_square().unwrap().p_too_small,
        known: Residuals::with_scale(&problem, values, &covariance, Scale::Known(1.0)),
        estimated: Residuals::at(&problem, values, &covariance),
        new: truing::statistics::ChiSquareTest::new(square, 3.0)
            .unwrap()
            .p_too_small,
    }
}

/// All trials, made once for all tests.
fn trials() -> &'static [Trial] {
    static TRIALS: OnceLock<Vec<Trial>> = OnceLock::new();
    TRIALS.get_or_init(|| (0..SEEDS).map(trial).collect())
}

/// Whether numbers may well be uniform between 0 and 1.
#[track_caller]
fn assert_uniform(what: &str, mut p: Vec<f64>) {
    p.sort_by(f64::total_cmp);
    let n = p.len() as f64;
    let off = p.iter().enumerate().map(|(k, p)| {
        let (before, after) = (k as f64 / n, (k + 1) as f64 / n);
        (p - before).abs().max((after - p).abs())
    });
    let statistic = n.sqrt() * off.fold(0.0, f64::max);
    println!("{what}: {statistic:.2}");
    assert!(statistic < 1.95, "{what}: {statistic:.2}");
}

/// Covariances, those between the two variables too: a sample covariance of N pairs has the standard
/// deviation √((σᵢ²σₖ² + σᵢₖ²)/N).
#[test]
fn estimates_scatter_as_their_covariance_says() {
    let expected = &trials()[0].covariance;
    let n = SEEDS as f64;
    for i in 0..5 {
        for k in 0..=i {
            let sum: f64 = trials().iter().map(|t| t.error[i] * t.error[k]).sum();
            let c = expected[(i, k)];
            let deviation = ((expected[(i, i)] * expected[(k, k)] + c * c) / n).sqrt();
            let off = (sum / n - c) / deviation;
            println!("Σ({i}, {k}): {off:+.2}");
            assert!(off.abs() < 4.0, "Σ({i}, {k}) is {off:.1} deviations off");
        }
    }
}

/// Correlations: Fisher's artanh ρ has the standard deviation 1/√(N − 3) whatever ρ is.
#[test]
fn estimates_are_correlated_as_is_said() {
    let (problem, ..) = experiment(0);
    let solution = solve(&problem, &Settings::default()).unwrap();
    let covariance = Covariance::at(&problem, &solution.values).unwrap();
    let strong = covariance.strongest_correlations(&problem, 0.0);
    assert_eq!(strong.len(), 10);
    assert!(strong[0].coefficient.abs() > 0.3, "{strong:?}");
    for pair in &strong {
        let (i, k) = pair.columns;
        let sum = |i: usize, k: usize| {
            let products = trials().iter().map(|t| t.error[i] * t.error[k]);
            products.sum::<f64>()
        };
        let sample = sum(i, k) / (sum(i, i) * sum(k, k)).sqrt();
        let off = (sample.atanh() - pair.coefficient.atanh()) * (SEEDS as f64 - 3.0).sqrt();
        println!("{:?}: {sample:.3}, {off:+.2}", pair.names);
        assert!(off.abs() < 4.0, "{pair:?} is {sample:.3}");
    }
}

#[test]
fn sums_of_squares_are_chi_square() {
    assert_uniform("fit", trials().iter().map(|t| t.fit).collect());
}

#[test]
fn new_measurements_are_as_far_off_as_predicted() {
    assert_uniform("new", trials().iter().map(|t| t.new).collect());
}

/// Standardised residuals of every row have variance 1; with σ₀ estimated too, if their squares are
/// 22 · Beta(1/2, 21/2): then the fourth moment is 3 · 22/24.
#[test]
fn standardised_residuals_have_variance_one() {
    let n = SEEDS as f64;
    for row in 0..3 * STATIONS {
        for (what, fourth, of) in [
            ("known", 3.0, (|t| &t.known) as fn(&Trial) -> &Residuals),
            ("estimated", 3.0 * 22.0 / 24.0, |t| &t.estimated),
        ] {
            let squares = trials().iter().map(|t| of(t).standardised[row].powi(2));
            let off = (squares.sum::<f64>() / n - 1.0) / ((fourth - 1.0) / n).sqrt();
            assert!(off.abs() < 4.0, "{what}, row {row}: {off:+.1} deviations");
        }
    }
    let freedom: f64 = trials().iter().map(|t| t.sigma0 * t.sigma0).sum::<f64>() / n;
    assert!((freedom - 1.0).abs() < 4.0 * (2.0 / 22.0 / n).sqrt());
}

/// p-values of a measurement are uniform, with the noise known and with σ₀ estimated.
#[test]
fn p_values_of_measurements_are_uniform() {
    for station in 0..STATIONS {
        let p = |of: fn(&Trial) -> &Residuals| -> Vec<f64> {
            let values = trials().iter().map(|t| of(t).constraints[station].p_value);
            values.collect()
        };
        assert_uniform(&format!("known {station}"), p(|t| &t.known));
        assert_uniform(&format!("estimated {station}"), p(|t| &t.estimated));
    }
}
