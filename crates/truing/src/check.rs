//! Checkers: Jacobians against each other, variables against the laws of a manifold.

use crate::least_squares::{LeastSquares, Linearization};
use crate::variable::Variable;

/// Where two Jacobians differ most in one column.
#[derive(Debug, Clone, PartialEq)]
pub struct ColumnDifference {
    /// The column.
    pub column: usize,
    /// Row of the largest difference.
    pub row: usize,
    /// The entries there.
    pub entries: (f64, f64),
    /// Largest difference over the column's norm, or over a millionth of the longest column's where
    /// that is more: a column without effect holds only rounding.
    pub relative: f64,
}

/// Compares two linearisations of the same problem column by column, worst first.
///
/// # Panics
/// If they are of different structure.
#[track_caller]
pub fn compare(a: &Linearization, b: &Linearization) -> Vec<ColumnDifference> {
    assert_eq!(
        a.structure.rows, b.structure.rows,
        "the Jacobians have different rows"
    );
    assert_eq!(
        a.structure.cols(),
        b.structure.cols(),
        "the Jacobians have different columns"
    );
    let rows = a.structure.rows;
    let longest = (0..a.structure.cols())
        .map(|c| a.column_norm(c).max(b.column_norm(c)))
        .fold(0.0, f64::max);
    let floor = (1e-6 * longest).max(f64::MIN_POSITIVE);
    let mut differences: Vec<ColumnDifference> = (0..a.structure.cols())
        .map(|column| {
            let mut dense = vec![(0.0, 0.0); rows];
            a.column(column).for_each(|(row, j)| dense[row].0 = j);
            b.column(column).for_each(|(row, j)| dense[row].1 = j);
            let norm = a.column_norm(column).max(b.column_norm(column)).max(floor);
            let size = |(x, y): (f64, f64)| {
                if (x - y).is_nan() {
                    f64::INFINITY
                } else {
                    (x - y).abs()
                }
            };
            let (row, entries) = dense
                .into_iter()
                .enumerate()
                .max_by(|x, y| size(x.1).total_cmp(&size(y.1)))
                .unwrap_or_default();
            ColumnDifference {
                column,
                row,
                entries,
                relative: size(entries) / norm,
            }
        })
        .collect();
    differences.sort_by(|x, y| y.relative.total_cmp(&x.relative));
    differences
}

/// r and J of a problem by central differences in the tangent space, with steps h = ε^⅓ (5 × 10⁻⁶).
///
/// Good to about ten digits. Robust losses are differentiated too, which `linearize` does not: it
/// takes their weights at x. Compare problems with the trivial loss.
pub fn central_differences<P: LeastSquares>(problem: &P, x: &P::Point) -> Linearization {
    let mut at = Linearization::new(problem.structure());
    problem.linearize(x, &mut at);
    let structure = std::sync::Arc::new(crate::least_squares::Structure::dense(
        at.structure.rows,
        at.structure.cols(),
    ));
    let mut lin = Linearization::new(structure);
    lin.residual.clone_from(&at.residual);
    lin.cost = at.cost;
    let (rows, cols) = (at.structure.rows, at.structure.cols());
    let (mut plus, mut minus) = (vec![0.0; rows], vec![0.0; rows]);
    let h = f64::EPSILON.cbrt();
    for column in 0..cols {
        let mut delta = vec![0.0; cols];
        delta[column] = h;
        problem.residual(&problem.plus(x, &delta), &mut plus);
        delta[column] = -h;
        problem.residual(&problem.plus(x, &delta), &mut minus);
        for row in 0..rows {
            lin.values[column * rows + row] = (plus[row] - minus[row]) / (2.0 * h);
        }
    }
    lin
}

/// Compares a problem's Jacobian at x with central differences, column by column, worst first.
pub fn jacobian<P: LeastSquares>(problem: &P, x: &P::Point) -> Vec<ColumnDifference> {
    let mut lin = Linearization::new(problem.structure());
    problem.linearize(x, &mut lin);
    compare(&lin, &central_differences(problem, x))
}

/// Asserts that a problem's Jacobian agrees with central differences, relative to each column's norm.
///
/// `assert_jacobian!(problem, values)` allows 1e-7; a third argument sets another tolerance.
#[macro_export]
macro_rules! assert_jacobian {
    ($problem:expr, $values:expr) => {
        $crate::assert_jacobian!($problem, $values, 1e-7)
    };
    ($problem:expr, $values:expr, $tolerance:expr) => {
        if let Some(worst) = $crate::check::jacobian($problem, $values).first() {
            assert!(
                worst.relative <= $tolerance,
                "the Jacobian differs from central differences by {:.1e} in {}, {}: {} against {}",
                worst.relative,
                $crate::LeastSquares::describe_column($problem, worst.column),
                $crate::LeastSquares::describe_row($problem, worst.row),
                worst.entries.0,
                worst.entries.1
            );
        }
    };
}

/// Checks the laws of a manifold at x for a small and a larger step δ; says which one fails.
///
/// x ⊞ 0 = x; (x ⊞ δ) ⊟ x = δ; x ⊞ (y ⊟ x) = y; ∂((x ⊞ δ) ⊟ x)/∂δ = 1 at δ = 0, by dual numbers.
///
/// # Errors
/// The law that fails, with the numbers.
pub fn variable<V: Variable>(x: &V::Value, delta: &[f64], tolerance: f64) -> Result<(), String> {
    use crate::autodiff::{partials, seed};
    use crate::scalar::Dual;
    let x = V::store(x);
    let dim = V::tangent_dim(x.len());
    let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance);
    // Quaternions of opposite sign are the same rotation: compare through ⊟ only.
    let minus = |y: &[f64], x: &[f64]| {
        let mut d = vec![0.0; dim];
        V::minus(y, x, &mut d);
        d
    };
    let plus = |x: &[f64], d: &[f64]| {
        let mut y = vec![0.0; x.len()];
        V::plus(x, d, &mut y);
        y
    };
    let zero = vec![0.0; dim];
    let same = plus(&x, &zero);
    if !close(&same, &x) {
        return Err(format!("x ⊞ 0 = {same:?} is not x = {x:?}"));
    }
    let y = plus(&x, delta);
    let back = minus(&y, &x);
    if !close(&back, delta) {
        return Err(format!("(x ⊞ δ) ⊟ x = {back:?} is not δ = {delta:?}"));
    }
    let again = minus(&plus(&x, &back), &y);
    if !close(&again, &zero) {
        return Err(format!("x ⊞ (y ⊟ x) differs from y by {again:?}"));
    }
    for k in 0..dim {
        let step: Vec<Dual<1>> = (0..dim)
            .map(|i| {
                if i == k {
                    seed(0.0, 0)
                } else {
                    Dual::from(0.0)
                }
            })
            .collect();
        let (mut moved, mut tangent) = (
            vec![Dual::<1>::from(0.0); x.len()],
            vec![Dual::<1>::from(0.0); dim],
        );
        V::plus(&x, &step, &mut moved);
        V::minus(&moved, &x, &mut tangent);
        for (i, t) in tangent.iter().enumerate() {
            let expected = f64::from(u8::from(i == k));
            if (partials(t)[0] - expected).abs() > tolerance {
                return Err(format!(
                    "∂((x ⊞ δ) ⊟ x)/∂δ at zero has entry ({i}, {k}) = {}, not {expected}",
                    partials(t)[0]
                ));
            }
        }
    }
    Ok(())
}
