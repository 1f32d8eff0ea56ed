//! What a Jacobian can tell apart: independent columns in an order of preference.

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

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

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
