//! The scaled Jacobian over the free columns.

use crate::least_squares::{Linearization, Structure};
use std::sync::Arc;

/// A = J D⁻¹ over the free columns in compressed columns, with r: the linear model ½‖A y + r‖² of
/// scaled free components y = Dδ.
#[derive(Debug, Clone, Default)]
pub struct ScaledJacobian {
    structure: Option<Arc<Structure>>,
    free: Vec<usize>,
    pub(super) rows: usize,
    /// Start of every column: n + 1 numbers.
    pub(super) starts: Vec<usize>,
    /// Row of every entry, ascending in a column.
    pub(super) indices: Vec<usize>,
    pub(super) values: Vec<f64>,
    pub(super) residual: Vec<f64>,
}

impl ScaledJacobian {
    /// Takes in J and r; says whether the structure is the one it had. Then it allocates nothing.
    pub(super) fn take(&mut self, lin: &Linearization, free: &[usize], scale: &[f64]) -> bool {
        let same = self.free == free
            && (self.structure.as_ref()).is_some_and(|old| Arc::ptr_eq(old, &lin.structure));
        if !same {
            self.structure = Some(lin.structure.clone());
            self.free = free.to_vec();
            self.rows = lin.structure.rows;
            self.starts.clear();
            self.indices.clear();
            self.starts.push(0);
            for column in free {
                let starts = &lin.structure.column_starts;
                let entries = starts[*column]..starts[column + 1];
                (self.indices).extend_from_slice(&lin.structure.row_indices[entries]);
                self.starts.push(self.indices.len());
            }
        }
        self.values.clear();
        for (column, scale) in free.iter().zip(scale) {
            let starts = &lin.structure.column_starts;
            let entries = &lin.values[starts[*column]..starts[column + 1]];
            self.values.extend(entries.iter().map(|j| j / scale));
        }
        self.residual.clone_from(&lin.residual);
        same
    }

    /// Number of columns.
    pub(super) fn cols(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// The column of J that component k stands for.
    pub(super) fn column_of(&self, k: usize) -> usize {
        self.free[k]
    }

    /// Rows and entries of a column.
    pub(super) fn column(&self, k: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.starts[k]..self.starts[k + 1];
        let rows = self.indices[range.clone()].iter().copied();
        rows.zip(self.values[range].iter().copied())
    }

    /// A y.
    pub(super) fn image(&self, y: &[f64]) -> Vec<f64> {
        let mut image = vec![0.0; self.rows];
        for (k, y) in y.iter().enumerate().filter(|(_, y)| **y != 0.0) {
            self.column(k).for_each(|(row, a)| image[row] += a * y);
        }
        image
    }

    /// Aᵀ v.
    pub(super) fn back(&self, v: &[f64]) -> Vec<f64> {
        (0..self.cols())
            .map(|k| self.column(k).map(|(row, a)| a * v[row]).sum())
            .collect()
    }

    /// A y + r.
    pub(super) fn residual_at(&self, y: &[f64]) -> Vec<f64> {
        let mut residual = self.image(y);
        (residual.iter_mut().zip(&self.residual)).for_each(|(e, r)| *e += r);
        residual
    }

    /// Aᵀ(A y + r).
    pub(super) fn gradient(&self, y: &[f64]) -> Vec<f64> {
        self.back(&self.residual_at(y))
    }

    /// ½‖r‖² − ½‖A y + r‖² = −(A y)ᵀ r − ½‖A y‖².
    pub(super) fn predicted(&self, y: &[f64]) -> f64 {
        (self.image(y).iter().zip(&self.residual))
            .map(|(image, r)| -image * r - 0.5 * image * image)
            .sum()
    }

    /// With rows Σ aₖ yₖ − b below: [A; C] and [r; −d].
    pub(super) fn with_rows(&self, rows: &[(Vec<(usize, f64)>, f64)]) -> Self {
        let mut more = vec![Vec::new(); self.cols()];
        for (row, (terms, _)) in rows.iter().enumerate() {
            for (k, a) in terms {
                more[*k].push((self.rows + row, *a));
            }
        }
        let mut extended = Self {
            free: self.free.clone(),
            rows: self.rows + rows.len(),
            starts: vec![0],
            residual: self.residual.clone(),
            ..Self::default()
        };
        extended.residual.extend(rows.iter().map(|(_, d)| -d));
        for (k, more) in more.into_iter().enumerate() {
            for (row, a) in self.column(k).chain(more) {
                extended.indices.push(row);
                extended.values.push(a);
            }
            extended.starts.push(extended.indices.len());
        }
        extended
    }
}
