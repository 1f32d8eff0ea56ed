//! What a Jacobian can tell apart: independent columns in an order of preference, singular values,
//! and how well measurements determine what they identify.

use nalgebra::{DMatrix, DVector};

/// What becomes of a column.
#[derive(Debug, Clone, PartialEq)]
pub enum ColumnStatus {
    /// Independent of the columns preferred to it.
    Identifiable,
    /// A zero column: nothing that is measured depends on it.
    NoEffect,
    /// A linear combination of identifiable columns, given as (column, coefficient): a change δ of
    /// this column does what changes coefficient·δ of those would do.
    Regrouped(Vec<(usize, f64)>),
}

/// Sorts the columns of a Jacobian into base columns and the rest.
///
/// Columns are scaled to unit length and visited in `order`, the preferred first; a column is kept
/// if what is left of it after projection onto those kept is longer than `tolerance` (Gram–Schmidt,
/// twice; the same as QR with a fixed column order, Gautier 1991, "Numerical calculation of the
/// base inertial parameters"). `tolerance` separates structure from rounding and must never be
/// asked to separate noise: give a Jacobian at configurations that satisfy the constraints exactly.
///
/// Columns that are not in `order` get [`ColumnStatus::NoEffect`] and are not looked at.
pub fn base_columns(jacobian: &DMatrix<f64>, order: &[usize], tolerance: f64) -> Vec<ColumnStatus> {
    let mut status = vec![ColumnStatus::NoEffect; jacobian.ncols()];
    let largest = order
        .iter()
        .map(|c| jacobian.column(*c).norm())
        .fold(0.0, f64::max);
    let mut basis: Vec<DVector<f64>> = Vec::new();
    // Unit column = Σ basis · coefficients; for kept columns this is the triangle R.
    let mut kept: Vec<(usize, f64)> = Vec::new();
    let mut triangle: Vec<Vec<f64>> = Vec::new();
    for &column in order {
        let length = jacobian.column(column).norm();
        // What a column without effect is left with where the constraints hold but for rounding.
        if length <= (1e-5 * tolerance).max(1e-13) * largest {
            continue;
        }
        let mut rest = jacobian.column(column) / length;
        let mut coefficients = vec![0.0; basis.len()];
        for _ in 0..2 {
            for (direction, coefficient) in basis.iter().zip(&mut coefficients) {
                let along = direction.dot(&rest);
                rest.axpy(-along, direction, 1.0);
                *coefficient += along;
            }
        }
        let left = rest.norm();
        if left > tolerance {
            coefficients.push(left);
            triangle.push(coefficients);
            kept.push((column, length));
            basis.push(rest / left);
            status[column] = ColumnStatus::Identifiable;
        } else {
            // Back substitution through the triangle: unit column = Σ kept unit columns · w.
            let mut w = coefficients;
            for k in (0..kept.len()).rev() {
                w[k] /= triangle[k][k];
                for i in 0..k {
                    w[i] -= triangle[k][i] * w[k];
                }
            }
            let into = kept
                .iter()
                .zip(w)
                .filter(|(_, w)| w.abs() > 100.0 * tolerance)
                .map(|((other, norm), w)| (*other, w * length / norm))
                .collect();
            status[column] = ColumnStatus::Regrouped(into);
        }
    }
    status
}

/// The columns of `jacobian` with what they share with the columns of `others` taken out: unknowns
/// that are estimated too, but not asked about, are eliminated.
///
/// Columns of `others` that depend on those before them by `tolerance` (of their length) are left out.
pub fn eliminate(jacobian: &DMatrix<f64>, others: &DMatrix<f64>, tolerance: f64) -> DMatrix<f64> {
    let mut basis: Vec<DVector<f64>> = Vec::new();
    let project = |column: &mut DVector<f64>, basis: &[DVector<f64>]| {
        for _ in 0..2 {
            for direction in basis {
                let along = direction.dot(column);
                column.axpy(-along, direction, 1.0);
            }
        }
    };
    for column in others.column_iter() {
        let length = column.norm();
        if length == 0.0 {
            continue;
        }
        let mut rest = column / length;
        project(&mut rest, &basis);
        let left = rest.norm();
        if left > tolerance {
            basis.push(rest / left);
        }
    }
    let mut out = jacobian.clone();
    for mut column in out.column_iter_mut() {
        let mut rest = column.clone_owned();
        project(&mut rest, &basis);
        column.copy_from(&rest);
    }
    out
}

/// The singular values of a matrix, one a column, the largest first.
pub fn singular_values(matrix: &DMatrix<f64>) -> Vec<f64> {
    let columns = matrix.ncols();
    let mut values: Vec<f64> = if matrix.is_empty() {
        Vec::new()
    } else {
        matrix.clone().singular_values().iter().copied().collect()
    };
    values.resize(columns, 0.0);
    values.sort_by(|a, b| b.total_cmp(a));
    values
}

/// The five observability indices of a Jacobian, larger is better.
///
/// With singular values σ₁ ≥ … ≥ σ_L of J (not of JᵀJ) and m measurements. Sun & Hollerbach 2008,
/// "Observability index selection for robot calibration". Their size depends on how the columns of J
/// are scaled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observability {
    /// (σ₁⋯σ_L)^(1/L) / √m: the volume of the ellipsoid of the parameters' errors (Borm & Menq 1989).
    pub o1: f64,
    /// σ_L / σ₁: the inverse of the condition number (Driels & Pathre 1990).
    pub o2: f64,
    /// σ_L: the worst determined direction (Nahvi, Hollerbach & Hayward 1994).
    pub o3: f64,
    /// σ_L² / σ₁: the noise amplification index (Nahvi & Hollerbach 1996).
    pub o4: f64,
    /// 1 / Σ(1/σᵢ): the sum of the errors' sizes (Sun & Hollerbach 2008).
    pub o5: f64,
}

impl Observability {
    /// The indices of `singular_values` in any order, of a Jacobian of `measurements`; `None` if
    /// there are none of either.
    pub fn of(singular_values: &[f64], measurements: usize) -> Option<Self> {
        let largest = singular_values.iter().copied().reduce(f64::max)?;
        let smallest = singular_values.iter().copied().reduce(f64::min)?;
        if measurements == 0 || largest <= 0.0 {
            return None;
        }
        let count = singular_values.len() as f64;
        let mean_log = singular_values.iter().map(|s| s.ln()).sum::<f64>() / count;
        Some(Self {
            o1: mean_log.exp() / (measurements as f64).sqrt(),
            o2: smallest / largest,
            o3: smallest,
            o4: smallest * smallest / largest,
            o5: 1.0 / singular_values.iter().map(|s| 1.0 / s).sum::<f64>(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn observability_is_of_the_jacobian_and_has_closed_forms() {
        // Orthogonal columns of lengths 5, 2 and 10 over four rows.
        let j = DMatrix::from_row_slice(
            4,
            3,
            &[
                3.0, 0.0, 0.0, //
                4.0, 0.0, 0.0, //
                0.0, 2.0, 0.0, //
                0.0, 0.0, 10.0,
            ],
        );
        let values = singular_values(&j);
        for (value, expected) in values.iter().zip([10.0, 5.0, 2.0]) {
            assert_relative_eq!(*value, expected, max_relative = 1e-14);
        }
        let o = Observability::of(&values, 4).unwrap();
        assert_relative_eq!(o.o1, 100f64.cbrt() / 2.0, max_relative = 1e-14);
        assert_relative_eq!(o.o2, 0.2, max_relative = 1e-14);
        assert_relative_eq!(o.o3, 2.0, max_relative = 1e-14);
        assert_relative_eq!(o.o4, 0.4, max_relative = 1e-14);
        assert_relative_eq!(o.o5, 1.25, max_relative = 1e-14);
        assert_eq!(Observability::of(&[], 4), None);
        assert_eq!(Observability::of(&values, 0), None);
    }

    #[test]
    fn singular_values_are_not_lengths_of_columns() {
        // JᵀJ = [5 4; 4 5], with eigenvalues 9 and 1.
        let j = DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 1.0, 2.0]);
        let o = Observability::of(&singular_values(&j), 1).unwrap();
        assert_relative_eq!(o.o1, 3f64.sqrt(), max_relative = 1e-14);
        assert_relative_eq!(o.o2, 1.0 / 3.0, max_relative = 1e-14);
        assert_relative_eq!(o.o3, 1.0, max_relative = 1e-14);
        assert_relative_eq!(o.o4, 1.0 / 3.0, max_relative = 1e-14);
        assert_relative_eq!(o.o5, 0.75, max_relative = 1e-14);
    }

    #[test]
    fn a_wide_matrix_has_a_singular_value_for_every_column() {
        let j = DMatrix::from_row_slice(1, 3, &[1.0, 2.0, 2.0]);
        let values = singular_values(&j);
        assert_relative_eq!(values[0], 3.0, max_relative = 1e-14);
        assert_eq!(values[1..], [0.0, 0.0]);
    }

    #[test]
    fn what_others_take_up_is_eliminated() {
        let j = DMatrix::from_row_slice(3, 2, &[1.0, 3.0, 2.0, 0.0, 5.0, 0.0]);
        // The second of the others is twice the first.
        let others = DMatrix::from_row_slice(3, 2, &[1.0, 2.0, 0.0, 0.0, 0.0, 0.0]);
        let left = eliminate(&j, &others, 1e-9);
        assert_eq!(left.column(0).as_slice(), [0.0, 2.0, 5.0]);
        assert_eq!(left.column(1).as_slice(), [0.0; 3]);
    }

    #[test]
    fn the_order_decides_and_the_coefficients_reproduce_the_column() {
        // c2 = 2 c0 − 3 c1, c3 = 0, in badly mixed units.
        let c0 = DVector::from_vec(vec![1.0, 2.0, 3.0, 4.0]);
        let c1 = DVector::from_vec(vec![1e3, 0.0, -1e3, 5e2]);
        let j = DMatrix::from_columns(&[
            c0.clone(),
            c1.clone(),
            2.0 * &c0 - 3.0 * &c1,
            c0.clone() * 0.0,
        ]);
        let status = base_columns(&j, &[0, 1, 2, 3], 1e-9);
        assert_eq!(status[0], ColumnStatus::Identifiable);
        assert_eq!(status[1], ColumnStatus::Identifiable);
        assert_eq!(status[3], ColumnStatus::NoEffect);
        let ColumnStatus::Regrouped(into) = &status[2] else {
            panic!("{:?}", status[2])
        };
        assert_relative_eq!(into[0].1, 2.0, epsilon = 1e-9);
        assert_relative_eq!(into[1].1, -3.0, epsilon = 1e-9);
        let status = base_columns(&j, &[2, 1, 0, 3], 1e-9);
        let ColumnStatus::Regrouped(into) = &status[0] else {
            panic!("{:?}", status[0])
        };
        for (column, coefficient) in into {
            assert_relative_eq!(
                *coefficient,
                if *column == 2 { 0.5 } else { 1.5 },
                epsilon = 1e-9
            );
        }
    }
}
