//! Steps by dense Cholesky.

use super::factored::{Factor, Factored, Pivot};
use super::jacobian::ScaledJacobian;
use super::normal::Normal;
use super::work::Work;
use faer::linalg::cholesky::llt;
use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::{Accum, Mat, Par};

/// Steps by dense Cholesky, H + λI = LLᵀ, by faer.
///
/// Half the work of [`Qr`](super::Qr) and less a trial, but JᵀJ squares the condition number: with columns of
/// length one, it breaks down at κ(J) ≈ 1/√(16 ε √n), about 10⁷, where QR goes on to 10¹³. A
/// breakdown is [`NoStep::Dependent`](super::NoStep::Dependent) with and without damping, and
/// Levenberg–Marquardt damps more.
/// Short of it, steps are refined with J; see [`Factored`].
pub type Cholesky = Factored<DenseLlt>;

/// The dense factorisation H + λI = LLᵀ of [`Cholesky`].
#[derive(Debug, Clone)]
pub struct DenseLlt {
    /// H, lower triangle.
    h: Mat<f64>,
    l: Mat<f64>,
    normal: Option<Normal>,
    work: Work,
}

impl Default for DenseLlt {
    fn default() -> Self {
        Self {
            h: Mat::zeros(0, 0),
            l: Mat::zeros(0, 0),
            normal: None,
            work: Work::default(),
        }
    }
}

/// Rows of A that are multiplied at a time.
const CHUNK: usize = 512;

/// A with more of its entries than this part is multiplied as a dense matrix.
const DENSE: f64 = 0.2;

/// The square of a pivot, relative to the diagonal, that rounding in H alone could leave of a column
/// which depends on others.
pub(super) fn breakdown(n: usize) -> f64 {
    16.0 * f64::EPSILON * (n.max(1) as f64).sqrt()
}

/// Whether the pivot p of a column with diagonal d is one: p² > breakdown · d, and p beyond what QR
/// calls zero.
pub(super) fn check_pivot(n: usize, component: usize, p: f64, diagonal: f64) -> Result<(), Pivot> {
    let threshold = (breakdown(n) * diagonal)
        .sqrt()
        .max(f64::EPSILON * 16.0 * (n.max(1) as f64));
    // Also where the pivot is NaN.
    let sufficient = p > threshold;
    if sufficient {
        return Ok(());
    }
    Err(Pivot {
        component,
        pivot: p,
        threshold,
    })
}

/// H = AᵀA, lower triangle, by chunks of rows.
fn multiply(a: &ScaledJacobian, h: &mut Mat<f64>) {
    let n = a.cols();
    h.fill(0.0);
    let mut cursor = a.starts[..n].to_vec();
    let mut panel = Mat::<f64>::zeros(CHUNK, n);
    for first in (0..a.rows).step_by(CHUNK) {
        panel.fill(0.0);
        for k in 0..n {
            let mut column = panel.col_mut(k);
            while cursor[k] < a.starts[k + 1] && a.indices[cursor[k]] < first + CHUNK {
                column[a.indices[cursor[k]] - first] = a.values[cursor[k]];
                cursor[k] += 1;
            }
        }
        matmul(
            h.as_mut(),
            BlockStructure::TriangularLower,
            Accum::Add,
            panel.transpose(),
            BlockStructure::Rectangular,
            panel.as_ref(),
            BlockStructure::Rectangular,
            1.0,
            Par::Seq,
        );
    }
}

impl Factor for DenseLlt {
    const NAME: &'static str = "dense Cholesky";

    fn take(&mut self, a: &ScaledJacobian, same: bool) {
        let n = a.cols();
        if !same {
            self.h = Mat::zeros(n, n);
            self.l = Mat::zeros(n, n);
            let full = (a.rows * n) as f64;
            self.normal = (a.indices.len() as f64 <= DENSE * full).then(|| Normal::new(a));
        }
        let Some(normal) = &mut self.normal else {
            return multiply(a, &mut self.h);
        };
        normal.update(a);
        for k in 0..n {
            for entry in normal.starts[k]..normal.starts[k + 1] {
                self.h[(k, normal.rows[entry])] = normal.values[entry];
            }
        }
    }

    fn factor(
        &mut self,
        a: &ScaledJacobian,
        lambda: f64,
        held: &[Option<f64>],
        _: &[f64],
    ) -> Result<(), Pivot> {
        let n = a.cols();
        self.l.copy_from(&self.h);
        for k in 0..n {
            self.l[(k, k)] += lambda;
        }
        for k in (0..held.len()).filter(|k| held[*k].is_some()) {
            (0..k).for_each(|i| self.l[(k, i)] = 0.0);
            (k + 1..n).for_each(|i| self.l[(i, k)] = 0.0);
            self.l[(k, k)] = 1.0;
        }
        let req = llt::factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default());
        let diagonal = |k: usize| {
            let free = held.is_empty() || held[k].is_none();
            if free { self.h[(k, k)] + lambda } else { 1.0 }
        };
        llt::factor::cholesky_in_place(
            self.l.as_mut(),
            Default::default(),
            Par::Seq,
            self.work.stack(req),
            Default::default(),
        )
        .map_err(|llt::factor::LltError::NonPositivePivot { index }| {
            let component = index.min(n - 1);
            Pivot {
                component,
                pivot: 0.0,
                threshold: (breakdown(n) * diagonal(component)).sqrt(),
            }
        })?;
        (0..n).try_for_each(|k| check_pivot(n, k, self.l[(k, k)], diagonal(k)))
    }

    fn solve(&self, v: &mut [f64]) {
        let n = v.len();
        let req = llt::solve::solve_in_place_scratch::<f64>(n, 1, Par::Seq);
        let right = faer::MatMut::from_column_major_slice_mut(v, n, 1);
        let mut work = Work::default();
        llt::solve::solve_in_place(self.l.as_ref(), right, Par::Seq, work.stack(req));
    }
}
