//! Steps by dense QR.

use super::null_space::{NullSpace, null_space};
use super::{Equalities, NoStep, Quadratic, StepSolver};
use crate::least_squares::Linearization;
use faer::Mat;

/// Dense QR by faer: rows stream in chunks through one small triangle, so that memory does not grow
/// with the number of rows, and JᵀJ, which would square the condition number, is never formed.
#[derive(Debug, Clone)]
pub struct Qr {
    /// Upper triangle of [J D⁻¹ | r] ((n + 1) × (n + 1)): R, and Qᵀr in the last column.
    triangle: Mat<f64>,
    /// The triangle of the last damped system.
    damped: Option<(f64, Mat<f64>)>,
    free: Vec<usize>,
}

impl Default for Qr {
    fn default() -> Self {
        Self {
            triangle: Mat::zeros(0, 0),
            damped: None,
            free: Vec::new(),
        }
    }
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

/// R y = −z for the upper triangle [R | z], y of n numbers; the first component whose pivot is not
/// above the threshold, if there is one.
fn back_substitute(triangle: &Mat<f64>, n: usize) -> Result<Vec<f64>, (usize, f64, f64)> {
    let threshold = f64::EPSILON * 16.0 * (n.max(1) as f64);
    let pivot = |k: usize| {
        if k < triangle.nrows() {
            triangle[(k, k)].abs()
        } else {
            0.0
        }
    };
    // Also where the pivot is NaN.
    let sufficient = |k: &usize| pivot(*k) > threshold;
    if let Some(k) = (0..n).find(|k| !sufficient(k)) {
        return Err((k, pivot(k), threshold));
    }
    let mut y = vec![0.0; n];
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|k| triangle[(i, k)] * y[k]).sum();
        y[i] = -(triangle[(i, n)] + known) / triangle[(i, i)];
    }
    Ok(y)
}

/// The minimiser of ½‖R y + z‖² under the equalities, [R | z] an upper triangle.
fn constrained(
    triangle: &Mat<f64>,
    equalities: &Equalities,
) -> Result<Vec<f64>, (usize, f64, f64)> {
    let n = equalities.held.len();
    let mut y: Vec<f64> = equalities.held.iter().map(|y| y.unwrap_or(0.0)).collect();
    let moving: Vec<usize> = (0..n).filter(|k| equalities.held[*k].is_none()).collect();
    let m = moving.len();
    let rows = triangle.nrows();
    let mut a = Mat::<f64>::zeros(rows, m + 1);
    for row in 0..rows {
        for (k, column) in moving.iter().enumerate() {
            a[(row, k)] = if row <= *column {
                triangle[(row, *column)]
            } else {
                0.0
            };
        }
        let held: f64 = (row..n).map(|k| triangle[(row, k)] * y[k]).sum();
        a[(row, m)] = triangle[(row, n)] + held;
    }
    let named = |(k, pivot, threshold): (usize, f64, f64)| (moving[k], pivot, threshold);
    if equalities.rows.is_empty() {
        let moved = back_substitute(&triangularise(a), m).map_err(named)?;
        for (component, moved) in moving.iter().zip(moved) {
            y[*component] = moved;
        }
        return Ok(y);
    }
    let mut index = vec![None; n];
    for (k, component) in moving.iter().enumerate() {
        index[*component] = Some(k);
    }
    let mut c = Mat::<f64>::zeros(equalities.rows.len(), m);
    let mut d = Vec::with_capacity(equalities.rows.len());
    for (row, (terms, right)) in equalities.rows.iter().enumerate() {
        let mut left = *right;
        for (component, coefficient) in terms {
            match index[*component] {
                Some(k) => c[(row, k)] += coefficient,
                None => left -= coefficient * y[*component],
            }
        }
        d.push(left);
    }
    let space = null_space(&c, &d);
    let NullSpace { point, basis, .. } = &space;
    let left = basis.ncols();
    let mut b = Mat::<f64>::zeros(rows, left + 1);
    let columns = a.submatrix(0, 0, rows, m);
    b.as_mut()
        .submatrix_mut(0, 0, rows, left)
        .copy_from(&(columns * basis));
    for row in 0..rows {
        let at: f64 = (0..m).map(|k| a[(row, k)] * point[k]).sum();
        b[(row, left)] = a[(row, m)] + at;
    }
    let w = back_substitute(&triangularise(b), left)
        .map_err(|(_, pivot, threshold)| (moving[0], pivot, threshold))?;
    let mut moved: Vec<f64> = (0..m)
        .map(|k| point[k] + (0..left).map(|i| basis[(k, i)] * w[i]).sum::<f64>())
        .collect();
    // Large components may have rounded rows of small ones away: once more for what is left.
    let missed: Vec<f64> = (d.iter().enumerate())
        .map(|(row, d)| d - (0..m).map(|k| c[(row, k)] * moved[k]).sum::<f64>())
        .collect();
    let again = space.fixed.reach(&missed);
    moved.iter_mut().zip(again).for_each(|(y, more)| *y += more);
    for (component, moved) in moving.iter().zip(moved) {
        y[*component] = moved;
    }
    Ok(y)
}

impl Qr {
    /// The triangle of [J D⁻¹; √λ I | r; 0].
    fn damp(&mut self, lambda: f64) -> &Mat<f64> {
        let n = self.free.len();
        let known = matches!(&self.damped, Some((of, _)) if *of == lambda);
        if !known {
            let damped = if lambda > 0.0 {
                let mut a = Mat::<f64>::zeros(2 * n, n + 1);
                a.as_mut()
                    .submatrix_mut(0, 0, n, n + 1)
                    .copy_from(self.triangle.as_ref().submatrix(0, 0, n, n + 1));
                for k in 0..n {
                    a[(n + k, k)] = lambda.sqrt();
                }
                triangularise(a)
            } else {
                self.triangle.clone()
            };
            self.damped = Some((lambda, damped));
        }
        match &self.damped {
            Some((_, damped)) => damped,
            None => &self.triangle,
        }
    }

    /// R y + z, row by row.
    fn image<'a>(&'a self, y: &'a [f64]) -> impl Iterator<Item = (f64, f64)> + 'a {
        let n = y.len();
        (0..n).map(move |i| {
            let image: f64 = (i..n).map(|k| self.triangle[(i, k)] * y[k]).sum();
            (image, self.triangle[(i, n)])
        })
    }
}

impl StepSolver for Qr {
    fn factor(&mut self, lin: &Linearization, free: &[usize], scale: &[f64]) {
        self.triangle = triangle(lin, free, scale);
        self.damped = None;
        self.free = free.to_vec();
    }

    fn solve(&mut self, lambda: f64, equalities: Option<&Equalities>) -> Result<Vec<f64>, NoStep> {
        let n = self.free.len();
        let damped = self.damp(lambda);
        let solved = match equalities {
            None => back_substitute(damped, n),
            Some(equalities) => constrained(damped, equalities),
        };
        solved.map_err(|(k, pivot, threshold)| NoStep::Dependent {
            column: self.free[k],
            pivot,
            threshold,
        })
    }

    fn gradient(&self, y: &[f64]) -> Vec<f64> {
        let mut g = vec![0.0; y.len()];
        for (i, (image, z)) in self.image(y).enumerate() {
            for k in i..y.len() {
                g[k] += self.triangle[(i, k)] * (image + z);
            }
        }
        g
    }

    /// ½‖z‖² − ½‖Ry + z‖² = −(Ry)ᵀz − ½‖Ry‖².
    fn predicted(&self, y: &[f64]) -> f64 {
        self.image(y)
            .map(|(image, z)| -image * z - 0.5 * image * image)
            .sum()
    }

    fn quadratic(&self) -> Quadratic {
        let n = self.free.len();
        let r = &self.triangle;
        let mut quadratic = Quadratic {
            starts: vec![0],
            linear: self.gradient(&vec![0.0; n]),
            ..Quadratic::default()
        };
        for k in 0..n {
            for i in 0..=k {
                quadratic.rows.push(i);
                let product: f64 = (0..=i).map(|row| r[(row, i)] * r[(row, k)]).sum();
                quadratic.values.push(product);
            }
            quadratic.starts.push(quadratic.rows.len());
        }
        quadratic
    }

    /// Rᵀ u = −g, then R a = u.
    fn correction(&self, g: &[f64]) -> Option<Vec<f64>> {
        let (_, r) = self.damped.as_ref()?;
        let n = self.free.len();
        let mut a = vec![0.0; n];
        for i in 0..n {
            let known: f64 = (0..i).map(|k| r[(k, i)] * a[k]).sum();
            a[i] = (-g[i] - known) / r[(i, i)];
        }
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| r[(i, k)] * a[k]).sum();
            a[i] = (a[i] - known) / r[(i, i)];
        }
        a.iter().all(|a| a.is_finite()).then_some(a)
    }

    fn name(&self) -> &'static str {
        "dense QR"
    }
}
