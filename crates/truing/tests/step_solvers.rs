//! The contract of step solvers, all of them on the same problems: against the augmented system of
//! the Karush–Kuhn–Tucker conditions, which nalgebra solves by LU with full pivoting.

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::sync::Arc;
use truing::step::{
    AnyStep, Cholesky, Equalities, LinearSolver, NoStep, Qr, SparseCholesky, SparseQr, StepSolver,
};
use truing::{Linearization, Structure};

/// Every solver there is.
fn solvers() -> Vec<Box<dyn StepSolver>> {
    let mut all: Vec<Box<dyn StepSolver>> = vec![
        Box::new(Qr::default()),
        Box::new(Cholesky::default()),
        Box::new(SparseCholesky::default()),
        Box::new(SparseQr::default()),
    ];
    for asked in EVERY {
        all.push(Box::new(AnyStep::new(asked)));
    }
    all
}

const EVERY: [LinearSolver; 5] = [
    LinearSolver::Auto,
    LinearSolver::DenseQr,
    LinearSolver::DenseCholesky,
    LinearSolver::SparseCholesky,
    LinearSolver::SparseQr,
];

/// J with r and the diagonal of D.
#[derive(Clone, Debug)]
struct Case {
    j: DMatrix<f64>,
    r: DVector<f64>,
    scale: Vec<f64>,
}

impl Case {
    /// Scaled to columns of length one, as the solvers do.
    fn new(j: DMatrix<f64>, r: DVector<f64>) -> Self {
        let length = |k: usize| {
            let largest = j.column(k).amax();
            let length = (j.column(k) / largest).norm() * largest;
            if largest > 0.0 { length } else { 1.0 }
        };
        Self {
            scale: (0..j.ncols()).map(length).collect(),
            j,
            r,
        }
    }

    fn cols(&self) -> usize {
        self.j.ncols()
    }

    /// A = J D⁻¹.
    fn a(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.j.nrows(), self.cols(), |i, k| {
            self.j[(i, k)] / self.scale[k]
        })
    }

    /// In compressed columns without the zeros; a column between two others is not free.
    fn linearization(&self) -> (Linearization, Vec<usize>) {
        let n = self.cols();
        let middle = n / 2;
        let mut structure = Structure {
            rows: self.j.nrows(),
            column_starts: vec![0],
            row_indices: Vec::new(),
        };
        let mut values = Vec::new();
        let mut free = Vec::new();
        for k in 0..n {
            if k == middle {
                for row in 0..self.j.nrows() {
                    structure.row_indices.push(row);
                    values.push(1.0 + row as f64);
                }
                structure.column_starts.push(values.len());
            }
            free.push(structure.column_starts.len() - 1);
            for (row, value) in self.j.column(k).iter().enumerate() {
                if *value != 0.0 {
                    structure.row_indices.push(row);
                    values.push(*value);
                }
            }
            structure.column_starts.push(values.len());
        }
        let mut lin = Linearization::new(Arc::new(structure));
        lin.values = values;
        lin.residual = self.r.iter().copied().collect();
        lin.cost = 0.5 * self.r.norm_squared();
        (lin, free)
    }

    fn factored(&self, solver: &mut dyn StepSolver) -> Vec<usize> {
        let (lin, free) = self.linearization();
        solver.factor(&lin, &free, &self.scale);
        free
    }

    /// The minimiser of ½‖Ay + r‖² + ½λ‖y‖² + gᵀy under the equalities, by
    /// e − Ay = r, Aᵀe + λy + Cᵀz = −g, Cy = d, which does not square A.
    fn reference(
        &self,
        lambda: f64,
        equalities: Option<&Equalities>,
        g: Option<&[f64]>,
    ) -> DVector<f64> {
        let a = self.a();
        let (m, n) = a.shape();
        let mut c: Vec<(Vec<(usize, f64)>, f64)> = Vec::new();
        if let Some(equalities) = equalities {
            for (k, held) in equalities.held.iter().enumerate() {
                if let Some(held) = held {
                    c.push((vec![(k, 1.0)], *held));
                }
            }
            c.extend(equalities.rows.iter().cloned());
        }
        let size = m + n + c.len();
        let mut kkt = DMatrix::<f64>::zeros(size, size);
        let mut right = DVector::<f64>::zeros(size);
        for i in 0..m {
            kkt[(i, i)] = 1.0;
            if g.is_none() {
                right[i] = self.r[i];
            }
            for k in 0..n {
                kkt[(i, m + k)] = -a[(i, k)];
                kkt[(m + k, i)] = a[(i, k)];
            }
        }
        for k in 0..n {
            kkt[(m + k, m + k)] = lambda;
            right[m + k] = g.map_or(0.0, |g| -g[k]);
        }
        for (row, (terms, d)) in c.iter().enumerate() {
            for (k, coefficient) in terms {
                kkt[(m + k, m + n + row)] += coefficient;
                kkt[(m + n + row, m + k)] += coefficient;
            }
            right[m + n + row] = *d;
        }
        let lu = kkt.clone().full_piv_lu();
        let mut x = lu.solve(&right).expect("the reference system is regular");
        // Refined once: λ may be far larger than anything else.
        let left = &right - &kkt * &x;
        x += lu.solve(&left).expect("it was regular a moment ago");
        x.rows(m, n).into_owned()
    }
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    rng.sample(StandardNormal)
}

fn random(rng: &mut ChaCha8Rng, m: usize, n: usize) -> Case {
    let j = DMatrix::from_fn(m, n, |_, k| normal(rng) * 10f64.powi(k as i32 % 7 - 3));
    Case::new(j, DVector::from_fn(m, |_, _| normal(rng)))
}

/// Blocks of `width` columns in a chain with a loop, as a pose graph has them; the first is anchored.
fn chain(rng: &mut ChaCha8Rng, blocks: usize, width: usize) -> Case {
    let mut pairs: Vec<(usize, usize)> = (1..blocks).map(|i| (i - 1, i)).collect();
    pairs.push((0, blocks - 1));
    pairs.push((blocks / 3, blocks - 2));
    let rows = width * (pairs.len() + 1);
    let mut j = DMatrix::<f64>::zeros(rows, width * blocks);
    for k in 0..width {
        j[(k, k)] = 3.0;
    }
    for (i, (a, b)) in pairs.iter().enumerate() {
        for row in 0..width {
            for k in 0..width {
                j[(width * (i + 1) + row, width * a + k)] = normal(rng);
                j[(width * (i + 1) + row, width * b + k)] = normal(rng);
            }
        }
    }
    Case::new(j, DVector::from_fn(rows, |_, _| normal(rng)))
}

/// Singular values from 1 down to 1/condition.
fn conditioned(rng: &mut ChaCha8Rng, m: usize, n: usize, condition: f64) -> Case {
    let orthogonal =
        |rng: &mut ChaCha8Rng, m: usize| DMatrix::from_fn(m, n, |_, _| normal(rng)).qr().q();
    let (u, v) = (orthogonal(rng, m), orthogonal(rng, n));
    let sigma = DVector::from_fn(n, |k, _| condition.powf(-(k as f64) / (n - 1) as f64));
    let j = u * DMatrix::from_diagonal(&sigma) * v.transpose();
    Case {
        scale: vec![1.0; n],
        j,
        r: DVector::from_fn(m, |_, _| normal(rng)),
    }
}

fn regular() -> Vec<(&'static str, Case)> {
    let rng = &mut ChaCha8Rng::seed_from_u64(7);
    let mut isolated = chain(rng, 6, 3);
    // Rows that no free column has.
    isolated.j.row_mut(5).fill(0.0);
    isolated = Case::new(isolated.j, isolated.r);
    let diagonal = DMatrix::from_fn(9, 9, |i, k| if i == k { 1.0 + k as f64 } else { 0.0 });
    vec![
        ("dense", random(rng, 20, 8)),
        ("square", random(rng, 12, 12)),
        ("tall", random(rng, 150, 5)),
        ("one column", random(rng, 4, 1)),
        ("one entry", random(rng, 1, 1)),
        ("chain of blocks", chain(rng, 12, 3)),
        ("chain of columns", chain(rng, 40, 1)),
        ("empty row", isolated),
        (
            "diagonal",
            Case::new(diagonal, DVector::from_element(9, 2.0)),
        ),
        ("conditioned 1e3", conditioned(rng, 30, 10, 1e3)),
    ]
}

#[track_caller]
fn assert_close(found: &[f64], expected: &DVector<f64>, tolerance: f64, what: &str) {
    let found = DVector::from_column_slice(found);
    assert_eq!(found.len(), expected.len(), "{what}");
    let error = (&found - expected).norm();
    assert!(
        error <= tolerance * expected.norm() + 1e-300,
        "{what}: off by {:e} of {:e}",
        error,
        expected.norm()
    );
}

const DAMPING: [f64; 8] = [0.0, 1e-16, 1e-12, 1e-8, 1e-4, 1.0, 1e4, 1e12];

#[test]
fn steps_are_the_minimisers() {
    for (name, case) in regular() {
        let expected = DAMPING.map(|lambda| case.reference(lambda, None, None));
        for mut solver in solvers() {
            case.factored(&mut *solver);
            for (lambda, expected) in DAMPING.iter().zip(&expected) {
                let what = format!("{name} by {}, λ = {lambda:e}", solver.name());
                let y = solver.solve(*lambda, None).expect(&what);
                // A QR turns r against √λ I: what it leaves of r is right to ε ‖r‖.
                let tolerance = 1e-10 + 1e-15 * lambda.sqrt();
                assert_close(&y, expected, tolerance, &what);
            }
        }
    }
}

#[test]
fn models_and_corrections_are_those_of_j() {
    let rng = &mut ChaCha8Rng::seed_from_u64(8);
    for (name, case) in regular() {
        let (a, n) = (case.a(), case.cols());
        let y = DVector::from_fn(n, |_, _| normal(rng));
        let residual = &a * &y + &case.r;
        let (h, q) = (a.transpose() * &a, a.transpose() * &case.r);
        let promised = 0.5 * (case.r.norm_squared() - residual.norm_squared());
        for mut solver in solvers() {
            case.factored(&mut *solver);
            let what = format!("{name} by {}", solver.name());
            let gradient = a.transpose() * &residual;
            assert_close(&solver.gradient(y.as_slice()), &gradient, 1e-12, &what);
            let predicted = solver.predicted(y.as_slice());
            let size = residual.norm_squared() + case.r.norm_squared();
            assert!((predicted - promised).abs() <= 1e-13 * size, "{what}");
            let quadratic = solver.quadratic();
            assert_close(&quadratic.linear, &q, 1e-12, &what);
            assert_eq!(quadratic.starts.len(), n + 1);
            let mut found = DMatrix::<f64>::zeros(n, n);
            for k in 0..n {
                let (start, end) = (quadratic.starts[k], quadratic.starts[k + 1]);
                let rows = &quadratic.rows[start..end];
                assert!(rows.is_sorted_by(|a, b| a < b), "{what}");
                assert_eq!(rows.last(), Some(&k), "{what}: the diagonal is last");
                for (row, value) in rows.iter().zip(&quadratic.values[start..end]) {
                    found[(*row, k)] = *value;
                    found[(k, *row)] = *value;
                }
            }
            assert!((&found - &h).norm() <= 1e-13 * h.norm(), "{what}");
            for lambda in [0.0, 1e-3, 1e3] {
                solver.solve(lambda, None).expect(&what);
                let correction = solver.correction(y.as_slice()).expect(&what);
                let expected = case.reference(lambda, None, Some(y.as_slice()));
                // κ² ε: corrections are not refined.
                assert_close(&correction, &expected, 1e-7, &what);
            }
        }
    }
}

#[test]
fn equalities_are_kept_and_the_rest_is_minimal() {
    let rng = &mut ChaCha8Rng::seed_from_u64(9);
    for (name, case) in regular().into_iter().filter(|(_, case)| case.cols() > 4) {
        let n = case.cols();
        let mut some = Vec::new();
        // Held components; rows; both, with a row that begins on a held component.
        for (held, rows) in [(1, 0), (2, 0), (0, 1), (0, 2), (2, 2), (n - 1, 0)] {
            let mut equalities = Equalities {
                held: vec![None; n],
                rows: Vec::new(),
            };
            for k in 0..held {
                equalities.held[k] = Some(0.3 * k as f64 - 0.2);
            }
            for row in 0..rows {
                let terms = (0..n).filter(|k| k % 3 == row % 3 || *k == n - 1);
                let terms = terms.map(|k| (k, normal(rng))).collect();
                equalities.rows.push((terms, normal(rng)));
            }
            some.push(equalities);
        }
        let all = some.iter().flat_map(|equalities| {
            let damping = [0.0, 1e-6, 1.0, 1e6];
            damping.map(|lambda| {
                (
                    equalities,
                    lambda,
                    case.reference(lambda, Some(equalities), None),
                )
            })
        });
        let all: Vec<_> = all.collect();
        for mut solver in solvers() {
            case.factored(&mut *solver);
            for (equalities, lambda, expected) in &all {
                {
                    let what = format!(
                        "{name} by {}, λ = {lambda:e}, {equalities:?}",
                        solver.name()
                    );
                    let y = solver.solve(*lambda, Some(equalities)).expect(&what);
                    assert_close(&y, expected, 1e-9, &what);
                    for (k, held) in equalities.held.iter().enumerate() {
                        assert!(held.is_none_or(|held| held == y[k]), "{what}");
                    }
                    for (terms, d) in &equalities.rows {
                        let value: f64 = terms.iter().map(|(k, a)| a * y[*k]).sum();
                        let size = terms.iter().map(|(k, a)| (a * y[*k]).abs()).sum::<f64>();
                        assert!((value - d).abs() <= 1e-14 * (size + d.abs()), "{what}");
                    }
                }
            }
        }
    }
}

#[test]
fn rows_that_depend_on_others_are_left_out() {
    let rng = &mut ChaCha8Rng::seed_from_u64(10);
    let case = chain(rng, 5, 2);
    let n = case.cols();
    let row = (vec![(0, 0.6), (3, 0.8)], 0.1);
    let once = Equalities {
        held: vec![None; n],
        rows: vec![row.clone()],
    };
    let mut held = vec![None; n];
    held[7] = Some(0.5);
    let twice = Equalities {
        held,
        // The same row, the row twice as long, and one whose only component is held already.
        rows: vec![
            row.clone(),
            row.clone(),
            (vec![(0, 1.2), (3, 1.6)], 0.2),
            (vec![(7, 1.0)], 0.5),
        ],
    };
    let mut expected = once.clone();
    expected.held = twice.held.clone();
    for mut solver in solvers() {
        case.factored(&mut *solver);
        for lambda in [0.0, 1e-3] {
            let name = solver.name();
            let y = solver.solve(lambda, Some(&twice)).expect(name);
            let reference = case.reference(lambda, Some(&expected), None);
            assert_close(&y, &reference, 1e-10, solver.name());
        }
    }
}

/// Differences only: what is common to all columns is free.
fn floating(rng: &mut ChaCha8Rng, n: usize) -> Case {
    let mut j = DMatrix::<f64>::zeros(n, n);
    for k in 0..n {
        j[(k, k)] = 1.0;
        j[(k, (k + 1) % n)] = -1.0;
    }
    Case::new(j, DVector::from_fn(n, |_, _| normal(rng)))
}

#[test]
fn an_equality_can_fix_what_j_leaves_free() {
    let rng = &mut ChaCha8Rng::seed_from_u64(11);
    for n in [3, 10, 60] {
        let case = floating(rng, n);
        let mean = Equalities {
            held: vec![None; n],
            rows: vec![((0..n).map(|k| (k, 1.0 / (n as f64).sqrt())).collect(), 0.7)],
        };
        let mut first = mean.clone();
        first.rows = vec![(vec![(0, 1.0)], 0.3)];
        let mut held = mean.clone();
        held.rows.clear();
        held.held[n / 2] = Some(-0.4);
        for mut solver in solvers() {
            case.factored(&mut *solver);
            for equalities in [&mean, &first, &held] {
                let what = format!("{n} columns by {}, {equalities:?}", solver.name());
                for lambda in [0.0, 1e-10, 1e-5] {
                    let y = solver.solve(lambda, Some(equalities)).expect(&what);
                    let expected = case.reference(lambda, Some(equalities), None);
                    assert_close(&y, &expected, 1e-8, &what);
                }
            }
            // An equality that does not: between two columns.
            let other = Equalities {
                held: vec![None; n],
                rows: vec![(vec![(0, 1.0), (1, -1.0)], 0.0)],
            };
            let found = solver.solve(0.0, Some(&other));
            assert!(matches!(found, Err(NoStep::Dependent { .. })), "{found:?}");
        }
    }
}

fn dependent() -> Vec<(&'static str, Case)> {
    let rng = &mut ChaCha8Rng::seed_from_u64(12);
    let mut twice = random(rng, 15, 6);
    let copy = twice.j.column(1) * 3.0;
    twice.j.set_column(4, &copy);
    let mut sum = random(rng, 30, 8);
    let total = sum.j.column(0) + sum.j.column(3) * 2.0;
    sum.j.set_column(7, &total);
    let mut zero = random(rng, 10, 4);
    zero.j.column_mut(2).fill(0.0);
    vec![
        ("a column twice", Case::new(twice.j, twice.r)),
        ("a sum of columns", Case::new(sum.j, sum.r)),
        ("a zero column", Case::new(zero.j, zero.r)),
        ("more columns than rows", random(rng, 4, 9)),
        ("differences", floating(rng, 30)),
        (
            "no rows",
            Case::new(DMatrix::zeros(0, 3), DVector::zeros(0)),
        ),
        ("zero", Case::new(DMatrix::zeros(3, 2), DVector::zeros(3))),
    ]
}

#[test]
fn dependent_columns_are_named_and_damping_makes_up_for_them() {
    for (name, case) in dependent() {
        for mut solver in solvers() {
            let free = case.factored(&mut *solver);
            let what = format!("{name} by {}", solver.name());
            match solver.solve(0.0, None) {
                Err(NoStep::Dependent {
                    column,
                    pivot,
                    threshold,
                }) => {
                    assert!(free.contains(&column), "{what}: column {column}");
                    assert!(pivot <= threshold, "{what}: {pivot:e}, {threshold:e}");
                }
                other => panic!("{what}: {other:?}"),
            }
            for lambda in [1e-16, 1e-14, 1e-12, 1e-8, 1e-4, 1.0, 1e8] {
                match solver.solve(lambda, None) {
                    Ok(y) => assert!(y.iter().all(|y| y.is_finite()), "{what}, λ = {lambda:e}"),
                    // What rounding leaves of a square may be more than the damping.
                    Err(NoStep::Dependent { .. }) => assert!(lambda < 1e-12, "{what}, {lambda:e}"),
                    Err(other) => panic!("{what}: {other:?}"),
                }
            }
            for lambda in [1e-6, 1e-2, 1e3] {
                let y = solver.solve(lambda, None).expect(&what);
                let expected = case.reference(lambda, None, None);
                assert_close(&y, &expected, 1e-8, &what);
            }
        }
    }
}

#[test]
fn refined_steps_are_as_good_as_those_of_qr() {
    let rng = &mut ChaCha8Rng::seed_from_u64(13);
    for condition in [1e4, 1e5, 1e6] {
        for (m, n) in [(40, 12), (60, 30)] {
            let case = conditioned(rng, m, n, condition);
            let expected = case.reference(0.0, None, None);
            for mut solver in solvers() {
                case.factored(&mut *solver);
                let what = format!("κ = {condition:e} by {}", solver.name());
                let y = solver.solve(0.0, None).expect(&what);
                // A plain Cholesky step would be off by κ² ε.
                assert_close(&y, &expected, 1e-14 * condition, &what);
            }
        }
    }
}

#[test]
fn what_is_not_finite_or_huge_or_tiny_is_no_panic() {
    let rng = &mut ChaCha8Rng::seed_from_u64(14);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for (row, column) in [(0, 0), (7, 3), (19, 5)] {
            let mut spoilt = random(rng, 20, 6);
            spoilt.j[(row, column)] = bad;
            let mut beside = random(rng, 20, 6);
            beside.r[row] = bad;
            for case in [spoilt, beside] {
                for mut solver in solvers() {
                    case.factored(&mut *solver);
                    let equalities = Equalities {
                        held: vec![None, Some(1.0), None, None, None, None],
                        rows: vec![(vec![(0, 0.6), (3, 0.8)], 0.1)],
                    };
                    for lambda in [0.0, 1e-8, 1.0] {
                        let _ = solver.solve(lambda, None);
                        let _ = solver.correction(&[1.0; 6]);
                        let _ = solver.solve(lambda, Some(&equalities));
                    }
                    let _ = (solver.predicted(&[1.0; 6]), solver.gradient(&[1.0; 6]));
                    let _ = solver.quadratic();
                }
            }
        }
    }
    for size in [1e150, 1e-150] {
        let mut case = random(rng, 20, 6);
        let expected = case.reference(1e-3, None, None) * size;
        case = Case::new(case.j * size, case.r * size);
        for mut solver in solvers() {
            case.factored(&mut *solver);
            let name = solver.name();
            let y = solver.solve(1e-3, None).expect(name);
            assert_close(&y, &expected, 1e-11, solver.name());
        }
    }
}

#[test]
fn nothing_free_is_an_empty_step() {
    let rng = &mut ChaCha8Rng::seed_from_u64(15);
    let (lin, _) = random(rng, 5, 3).linearization();
    for mut solver in solvers() {
        solver.factor(&lin, &[], &[]);
        assert_eq!(solver.solve(0.0, None), Ok(Vec::new()));
        assert_eq!(solver.gradient(&[]), Vec::<f64>::new());
        assert_eq!(solver.predicted(&[]), 0.0);
        assert_eq!(solver.quadratic().starts, [0]);
    }
}

#[test]
fn a_solver_can_be_given_one_problem_after_another() {
    let rng = &mut ChaCha8Rng::seed_from_u64(16);
    let mut used = solvers();
    for _ in 0..3 {
        for (name, mut case) in regular() {
            let (mut lin, free) = case.linearization();
            // The same structure with new numbers, twice.
            for factor in [1.0, -0.5, 3.0] {
                case.j *= factor;
                lin.values.iter_mut().for_each(|value| *value *= factor);
                let before = case.r.clone();
                case.r += DVector::from_fn(before.len(), |_, _| normal(rng));
                lin.residual = case.r.iter().copied().collect();
                let expected = case.reference(0.01, None, None);
                for solver in &mut used {
                    solver.factor(&lin, &free, &case.scale);
                    let y = solver.solve(0.01, None).expect(name);
                    assert_close(&y, &expected, 1e-10, name);
                }
            }
        }
    }
}

/// A random pattern in which every column has an entry of its own.
fn pattern() -> impl Strategy<Value = (Case, Equalities, f64)> {
    let sizes = (
        1..14_usize,
        0..20_usize,
        0.05..1.0_f64,
        any::<u64>(),
        -9.0..6.0_f64,
    );
    sizes.prop_map(|(n, more, part, seed, power)| {
        let rng = &mut ChaCha8Rng::seed_from_u64(seed);
        let m = n + more;
        let mut j = DMatrix::from_fn(m, n, |_, _| {
            let there = rng.random_bool(part);
            if there { normal(rng) } else { 0.0 }
        });
        for k in 0..n {
            j[(k, k)] = 4.0 + rng.random_range(0.0..1.0);
        }
        let case = Case::new(j, DVector::from_fn(m, |_, _| normal(rng)));
        let held = (0..n)
            .map(|_| rng.random_bool(0.2).then(|| normal(rng)))
            .collect::<Vec<_>>();
        let moving: Vec<usize> = (0..n).filter(|k| held[*k].is_none()).collect();
        let rows = (0..rng.random_range(0..=moving.len().min(3)))
            .map(|row| {
                // Its own component, and any others.
                let mut terms = vec![(moving[row], 3.0)];
                terms.extend((0..n).filter(|_| rng.random_bool(0.3)).map(|k| (k, 0.3)));
                (terms, normal(rng))
            })
            .collect();
        (case, Equalities { held, rows }, 10f64.powf(power))
    })
}

proptest! {
    #[test]
    fn any_pattern_with_any_equalities_is_solved((case, equalities, lambda) in pattern()) {
        let expected = case.reference(lambda, Some(&equalities), None);
        let unconstrained = case.reference(lambda, None, None);
        for mut solver in solvers() {
            case.factored(&mut *solver);
            let name = solver.name();
            let y = solver.solve(lambda, Some(&equalities)).expect(name);
            assert_close(&y, &expected, 1e-9, solver.name());
            let name = solver.name();
            let y = solver.solve(lambda, None).expect(name);
            assert_close(&y, &unconstrained, 1e-9, solver.name());
        }
    }
}
