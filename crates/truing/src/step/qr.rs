//! Steps by dense QR.

use super::{Dependent, Step, StepSolver, box_qp};
use crate::least_squares::{Linearization, StepBounds};
use faer::Mat;

/// Dense QR by faer: rows stream in chunks through one small triangle, so that memory does not grow
/// with the number of rows, and JᵀJ, which would square the condition number, is never formed.
#[derive(Debug, Clone, Default)]
pub struct Qr {
    /// Upper triangle of [J D⁻¹ | r] ((n + 1) × (n + 1)): R, and Qᵀr in the last column.
    triangle: Option<Mat<f64>>,
    /// The triangle of the last damped system.
    damped: Option<Mat<f64>>,
    free: Vec<usize>,
    scale: Vec<f64>,
    cols: usize,
}

/// The triangle R of A = QR (at most `cols` rows), sequentially.
fn triangularise(a: Mat<f64>) -> Mat<f64> {
    a.qr().thin_R().to_owned()
}

/// Upper triangle of [J D⁻¹ | r] over the `free` columns ((n + 1) × (n + 1)), by streaming QR.
pub fn triangle(lin: &Linearization, free: &[usize], scale: &[f64]) -> Mat<f64> {
    let n = free.len();
    let rows = lin.structure.rows;
    let chunk = (4 * (n + 1)).max(512);
    let mut cursor: Vec<usize> = free
        .iter()
        .map(|c| lin.structure.column_starts[*c])
        .collect();
    let mut triangle = Mat::<f64>::zeros(0, n + 1);
    let mut first = 0;
    while first < rows {
        let last = (first + chunk).min(rows);
        let kept = triangle.nrows();
        let mut a = Mat::<f64>::zeros(kept + last - first, n + 1);
        a.as_mut()
            .submatrix_mut(0, 0, kept, n + 1)
            .copy_from(&triangle);
        for (k, column) in free.iter().enumerate() {
            let end = lin.structure.column_starts[column + 1];
            let mut target = a.col_mut(k);
            while cursor[k] < end && lin.structure.row_indices[cursor[k]] < last {
                target[kept + lin.structure.row_indices[cursor[k]] - first] =
                    lin.values[cursor[k]] / scale[k];
                cursor[k] += 1;
            }
        }
        let mut target = a.col_mut(n);
        for row in first..last {
            target[kept + row - first] = lin.residual[row];
        }
        triangle = triangularise(a);
        first = last;
    }
    let mut full = Mat::<f64>::zeros(n + 1, n + 1);
    full.as_mut()
        .submatrix_mut(0, 0, triangle.nrows(), n + 1)
        .copy_from(&triangle);
    full
}

impl StepSolver for Qr {
    fn factor(&mut self, lin: &Linearization, free: &[usize], scale: &[f64]) {
        self.triangle = Some(triangle(lin, free, scale));
        self.free = free.to_vec();
        self.scale = scale.to_vec();
        self.cols = lin.structure.cols();
    }

    fn step(&mut self, lambda: f64, bounds: Option<&StepBounds>) -> Result<Step, Dependent> {
        let n = self.free.len();
        let Some(triangle) = &self.triangle else {
            panic!("`step` needs `factor` before it");
        };
        let damped = if lambda > 0.0 {
            let root = lambda.sqrt();
            let mut a = Mat::<f64>::zeros(2 * n, n + 1);
            a.as_mut()
                .submatrix_mut(0, 0, n, n + 1)
                .copy_from(triangle.as_ref().submatrix(0, 0, n, n + 1));
            for k in 0..n {
                a[(n + k, k)] = root;
            }
            triangularise(a)
        } else {
            triangle.clone()
        };
        let threshold = f64::EPSILON * 16.0 * (n.max(1) as f64);
        if let Some(k) = (0..n).find(|k| damped[(*k, *k)].abs() <= threshold) {
            return Err(Dependent {
                column: self.free[k],
                pivot: damped[(k, k)].abs(),
                threshold,
            });
        }
        let mut y = vec![0.0; n];
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| damped[(i, k)] * y[k]).sum();
            y[i] = -(damped[(i, n)] + known) / damped[(i, i)];
        }
        if let Some(bounds) = bounds {
            let limit = |side: &[f64]| -> Vec<f64> {
                self.free
                    .iter()
                    .zip(&self.scale)
                    .map(|(c, s)| side[*c] * s)
                    .collect()
            };
            let (lower, upper) = (limit(&bounds.lower), limit(&bounds.upper));
            let inside = y
                .iter()
                .zip(lower.iter().zip(&upper))
                .all(|(y, (l, u))| l <= y && y <= u);
            if !inside {
                y = box_qp(&damped, &lower, &upper);
            }
        }
        // Model decrease: ½‖z‖² − ½‖Ry + z‖² = −(Ry)ᵀz − ½‖Ry‖².
        let mut predicted = 0.0;
        for i in 0..n {
            let image: f64 = (i..n).map(|k| triangle[(i, k)] * y[k]).sum();
            predicted -= image * triangle[(i, n)] + 0.5 * image * image;
        }
        let mut delta = vec![0.0; self.cols];
        for ((y, scale), column) in y.iter().zip(&self.scale).zip(&self.free) {
            delta[*column] = y / scale;
        }
        if let Some(bounds) = bounds {
            // Scaling there and back may round: bounds are kept exactly.
            for (delta, (lower, upper)) in
                delta.iter_mut().zip(bounds.lower.iter().zip(&bounds.upper))
            {
                *delta = delta.clamp(*lower, *upper);
            }
        }
        self.damped = Some(damped);
        let scaled_norm = y.iter().map(|y| y * y).sum::<f64>().sqrt();
        Ok(Step {
            delta,
            predicted: predicted.max(0.0),
            scaled_norm,
        })
    }

    fn correction(&self, g: &[f64]) -> Option<Vec<f64>> {
        let r = self.damped.as_ref()?;
        let n = self.free.len();
        // Rᵀ u = −D⁻¹ g, then R y = u, then a = D⁻¹ y.
        let mut y = vec![0.0; n];
        for i in 0..n {
            let known: f64 = (0..i).map(|k| r[(k, i)] * y[k]).sum();
            y[i] = (-g[self.free[i]] / self.scale[i] - known) / r[(i, i)];
        }
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| r[(i, k)] * y[k]).sum();
            y[i] = (y[i] - known) / r[(i, i)];
        }
        let mut a = vec![0.0; self.cols];
        for ((y, scale), column) in y.iter().zip(&self.scale).zip(&self.free) {
            a[*column] = y / scale;
        }
        a.iter().all(|a| a.is_finite()).then_some(a)
    }
}
