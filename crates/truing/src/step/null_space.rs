//! What rows C y = d fix, and what they leave.

use faer::Mat;
use faer::linalg::solvers::ColPivQr;

/// A row whose part across the rows before it is shorter than this, relative, depends on them.
const DEPENDENT_ROW: f64 = 1e-11;

/// The directions that rows fix: Cᵀ P = Q R over the rows that do not depend on others.
#[derive(Debug, Clone)]
pub(crate) struct RowSpace {
    q: Mat<f64>,
    r: Mat<f64>,
    order: Vec<usize>,
}

impl RowSpace {
    /// Of `rows` (m × n), by QR with pivoting; dependent rows are left out.
    pub fn new(rows: &Mat<f64>) -> Self {
        let qr = rows.transpose().to_owned().col_piv_qr();
        Self::from_qr(&qr, &qr.compute_thin_Q())
    }

    fn from_qr(qr: &ColPivQr<f64>, q: &Mat<f64>) -> Self {
        let r = qr.thin_R();
        let most = r.nrows().min(r.ncols());
        let largest = if most > 0 { r[(0, 0)].abs() } else { 0.0 };
        let rank = (0..most)
            .take_while(|k| r[(*k, *k)].abs() > DEPENDENT_ROW * largest)
            .count();
        Self {
            q: q.submatrix(0, 0, q.nrows(), rank).to_owned(),
            r: r.submatrix(0, 0, rank, rank).to_owned(),
            order: qr.P().arrays().0.to_vec(),
        }
    }

    /// Rows that do not depend on each other, as many as there are.
    pub fn independent(&self) -> &[usize] {
        &self.order[..self.r.ncols()]
    }

    /// The shortest y with C y = d, d in the order of the rows.
    pub fn reach(&self, right: &[f64]) -> Vec<f64> {
        let rank = self.r.ncols();
        // Rᵀ (Q₁ᵀ y) = Pᵀ d.
        let mut u = vec![0.0; rank];
        for i in 0..rank {
            let known: f64 = (0..i).map(|k| self.r[(k, i)] * u[k]).sum();
            u[i] = (right[self.order[i]] - known) / self.r[(i, i)];
        }
        (0..self.q.nrows())
            .map(|i| (0..rank).map(|k| self.q[(i, k)] * u[k]).sum())
            .collect()
    }
}

/// What is left to choose where rows C y = d must hold: y = y₀ + N w, with N orthonormal.
pub(crate) struct NullSpace {
    /// The shortest y with C y = d.
    pub point: Vec<f64>,
    /// N (components × dimensions left).
    pub basis: Mat<f64>,
    /// What the rows fix.
    pub fixed: RowSpace,
}

/// The null space of `rows` (m × n), by QR with pivoting; dependent rows are left out.
pub(crate) fn null_space(rows: &Mat<f64>, right: &[f64]) -> NullSpace {
    let n = rows.ncols();
    let qr = rows.transpose().to_owned().col_piv_qr();
    let q = qr.compute_Q();
    let fixed = RowSpace::from_qr(&qr, &q);
    let rank = fixed.independent().len();
    NullSpace {
        point: fixed.reach(right),
        basis: q.submatrix(0, rank, n, n - rank).to_owned(),
        fixed,
    }
}
