//! A search from many starts finds the lowest of several minima, keeps them apart, and costs no more
//! than its budget.

use std::f64::consts::PI;
use truing::manifold::{Rotation3, Vector};
use truing::solver::{Budget, SearchEnd, multi_start};
use truing::{Constraint, Error, Problem, Scalar, Settings, Values, Var, Views};

/// sin(x) and x/10 − 0.5: minima between the zeros of the sine, the lowest near x = 2π.
struct Waves;

impl Constraint for Waves {
    type Vars = (Vector,);
    const DIM: usize = 2;
    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = x[0].sin();
        r[1] = x[0] * 0.1 - 0.5;
    }
}

fn waves(lower: f64, upper: f64) -> (Problem, Var<Vector>) {
    let mut problem = Problem::new();
    let x = problem.add_variable::<Vector>("x", &vec![-9.0]);
    problem.add("waves", (x,), Waves);
    problem.bound_component(x, 0, lower, upper);
    (problem, x)
}

/// The cost's local minima in an interval, by bisection of its derivative between samples.
fn minima(lower: f64, upper: f64) -> Vec<f64> {
    let cost = |x: f64| 0.5 * (x.sin().powi(2) + (0.1 * x - 0.5).powi(2));
    let slope = |x: f64| x.sin() * x.cos() + 0.1 * (0.1 * x - 0.5);
    let n = 10_000;
    let at = |k: usize| lower + (upper - lower) * k as f64 / n as f64;
    let mut costs: Vec<f64> = (0..n)
        .filter(|k| slope(at(*k)) < 0.0 && slope(at(k + 1)) >= 0.0)
        .map(|k| {
            let (mut a, mut b) = (at(k), at(k + 1));
            for _ in 0..100 {
                let middle = 0.5 * (a + b);
                if slope(middle) < 0.0 {
                    a = middle
                } else {
                    b = middle
                }
            }
            cost(a)
        })
        .collect();
    costs.sort_by(f64::total_cmp);
    costs
}

#[test]
fn all_minima_are_found_and_the_lowest_is_first() {
    let (problem, x) = waves(-9.5, 19.0);
    let starts = problem.random_starts(1.0, 7).unwrap();
    let budget = Budget {
        starts: Some(200),
        ..Budget::default()
    };
    let search = multi_start(&problem, starts, &Settings::default(), &budget).unwrap();
    assert_eq!((search.end, search.starts), (SearchEnd::Starts, 200));
    let expected = minima(-9.5, 19.0);
    // A minimum at a bound may be among those found.
    let inside: Vec<f64> = (search.minima.iter())
        .filter(|minimum| minimum.outcome.limits.is_empty())
        .map(|minimum| minimum.outcome.cost)
        .collect();
    assert_eq!(inside.len(), expected.len());
    for (found, expected) in inside.iter().zip(&expected) {
        assert!(
            (found - expected).abs() < 1e-12,
            "{found} is not {expected}"
        );
    }
    let lowest = search.best.point.get(x)[0];
    assert!(
        (lowest - 2.0 * PI).abs() < 0.2 || (lowest - PI).abs() < 0.2,
        "{lowest}"
    );
    let counted: usize = search.minima.iter().map(|minimum| minimum.starts).sum();
    assert_eq!(counted + search.unconverged + search.unusable, 200);
    // A single solve from the first start ends in the nearest.
    let near = truing::solve(&problem, &Settings::default()).unwrap();
    assert!(near.cost > 10.0 * search.best.cost);
}

#[test]
fn budgets_are_kept() {
    let (problem, _) = waves(-9.5, 19.0);
    let search = |budget: Budget| {
        let starts = problem.random_starts(1.0, 7).unwrap();
        multi_start(&problem, starts, &Settings::default(), &budget).unwrap()
    };
    let one = search(Budget {
        evaluations: Some(1),
        ..Budget::default()
    });
    assert_eq!((one.starts, one.end), (1, SearchEnd::Evaluations));
    let some = search(Budget {
        evaluations: Some(500),
        ..Budget::default()
    });
    assert_eq!(some.end, SearchEnd::Evaluations);
    let last = some.evaluations.residual + some.evaluations.jacobian;
    assert!((500..700).contains(&last), "{last}");
    // Without any time the first start is looked at, and that is all.
    let time = search(Budget {
        time: Some(std::time::Duration::ZERO),
        ..Budget::default()
    });
    assert_eq!((time.end, time.starts), (SearchEnd::Time, 1));
}

#[test]
fn agreement_is_enough() {
    let (problem, _) = waves(-9.5, 19.0);
    let starts = problem.random_starts(1.0, 7).unwrap();
    let budget = Budget {
        agreeing: Some(3),
        ..Budget::default()
    };
    let search = multi_start(&problem, starts, &Settings::default(), &budget).unwrap();
    assert_eq!(search.end, SearchEnd::Agreement);
    assert_eq!(search.minima[0].starts, 3);
}

#[test]
fn the_same_seed_gives_the_same_starts_inside_the_bounds() {
    let (problem, x) = waves(-9.5, 19.0);
    let draw =
        |seed: u64| -> Vec<Values> { problem.random_starts(1.0, seed).unwrap().take(50).collect() };
    assert_eq!(draw(1), draw(1));
    assert_ne!(draw(1), draw(2));
    assert_eq!(&draw(1)[0], problem.initial());
    for values in draw(3) {
        assert!((-9.5..=19.0).contains(&values.get(x)[0]));
    }
    // Curved variables are turned about their start.
    let mut problem = Problem::new();
    let turn = problem.add_variable::<Rotation3>("turn", &nalgebra::Matrix3::identity());
    problem.fix_component(turn, 2);
    let starts: Vec<Values> = problem.random_starts(0.3, 1).unwrap().take(20).collect();
    for values in &starts[1..] {
        let rotation = nalgebra::Rotation3::from_matrix_unchecked(values.get(turn));
        let vector = rotation.scaled_axis();
        assert!(vector.x.abs() <= 0.3 && vector.y.abs() <= 0.3 && vector.z.abs() < 1e-12);
    }
}

/// ln x, which has no value at negative starts.
struct Log;

impl Constraint for Log {
    type Vars = (Vector,);
    const DIM: usize = 1;
    fn residual<T: Scalar>(&self, (x,): Views<'_, Self, T>, r: &mut [T]) {
        r[0] = x[0].ln();
    }
}

#[test]
fn starts_without_a_value_are_counted_and_not_fatal_unless_all_are() {
    let mut problem = Problem::new();
    let x = problem.add_variable::<Vector>("x", &vec![2.0]);
    problem.add("log", (x,), Log);
    let from = |start: f64| {
        let mut values = problem.initial().clone();
        values.set(x, &vec![start]);
        values
    };
    let settings = Settings::default();
    let starts = [-1.0, -2.0, 3.0].map(from);
    let search = multi_start(&problem, starts, &settings, &Budget::default()).unwrap();
    assert_eq!((search.unusable, search.minima.len()), (2, 1));
    assert!((search.best.point.get(x)[0] - 1.0).abs() < 1e-14);
    let starts = [-1.0, -2.0].map(from);
    let error = multi_start(&problem, starts, &settings, &Budget::default()).unwrap_err();
    assert!(matches!(error, Error::NotFinite { .. }), "{error}");
}

/// Starts without end, none of which has a value: the search ends, whatever its budget counts.
#[test]
fn starts_without_a_value_and_without_end_come_to_an_end() {
    let mut problem = Problem::new();
    let x = problem.add_variable::<Vector>("x", &vec![2.0]);
    problem.add("log", (x,), Log);
    let start = || {
        let mut values = problem.initial().clone();
        values.set(x, &vec![-1.0]);
        values
    };
    for budget in [
        Budget {
            agreeing: Some(2),
            ..Budget::default()
        },
        Budget {
            evaluations: Some(100),
            ..Budget::default()
        },
    ] {
        let starts = std::iter::repeat_with(start);
        let error = multi_start(&problem, starts, &Settings::default(), &budget).unwrap_err();
        assert!(matches!(error, Error::NotFinite { .. }), "{error}");
    }
}
