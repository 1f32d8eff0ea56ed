//! Steps by sparse QR.

use super::factored::{Factor, Factored, Pivot};
use super::jacobian::ScaledJacobian;
use super::sparse_cholesky::each_pivot;
use super::work::Work;
use faer::dyn_stack::StackReq;
use faer::perm::PermRef;
use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use faer::sparse::linalg::qr::supernodal::{
    SymbolicSupernodalQr, factorize_supernodal_numeric_qr, factorize_supernodal_numeric_qr_scratch,
    factorize_supernodal_symbolic_qr, factorize_supernodal_symbolic_qr_scratch,
};
use faer::sparse::linalg::{colamd, qr};
use faer::sparse::{FaerError, SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par};
use std::sync::Arc;

/// Steps by sparse QR of [A; √λ I] P = QR, by faer, with a column approximate minimum degree ordering P.
///
/// JᵀJ is never formed, so that it goes on where [`SparseCholesky`](super::SparseCholesky) breaks
/// down, for several times its work: every damping factors all of A again. The ordering and the
/// pattern are found once for a structure of J. Held components have a zero column and a one in their
/// row of damping.
pub type SparseQr = Factored<SparseTriangle>;

/// The sparse triangle R of [`SparseQr`], with −Qᵀr.
#[derive(Debug, Clone, Default)]
pub struct SparseTriangle {
    symbolic: Option<Arc<Symbolic>>,
    /// The rows of [A; √λ I].
    values: Vec<f64>,
    right: Vec<f64>,
    indices: [Vec<usize>; 4],
    /// R, the Householder vectors and their factors.
    numbers: [Vec<f64>; 3],
    work: Work,
}

/// What is found once.
#[derive(Debug)]
struct Symbolic {
    rows: usize,
    order: Vec<usize>,
    places: Vec<usize>,
    /// [A; √λ I]ᵀ in compressed columns: the rows one after the other.
    row_starts: Vec<usize>,
    columns: Vec<usize>,
    /// Where each entry of A goes among them, and each of the damping.
    entries: Vec<usize>,
    damping: Vec<usize>,
    qr: SymbolicSupernodalQr<usize>,
}

impl Symbolic {
    fn new(a: &ScaledJacobian) -> Result<Self, FaerError> {
        let (n, rows) = (a.cols(), a.rows + a.cols());
        // [A; √λ I] in compressed columns, and its transpose.
        let (mut starts, mut indices) = (vec![0], Vec::with_capacity(a.indices.len() + n));
        let mut row_starts = vec![0; rows + 1];
        for k in 0..n {
            indices.extend_from_slice(&a.indices[a.starts[k]..a.starts[k + 1]]);
            indices.push(a.rows + k);
            starts.push(indices.len());
        }
        indices.iter().for_each(|row| row_starts[row + 1] += 1);
        for row in 0..rows {
            row_starts[row + 1] += row_starts[row];
        }
        let mut cursor = row_starts.clone();
        let mut columns = vec![0; indices.len()];
        let mut entries = Vec::with_capacity(a.indices.len());
        let mut damping = Vec::with_capacity(n);
        for k in 0..n {
            for row in &indices[starts[k]..starts[k + 1]] {
                let place = cursor[*row];
                cursor[*row] += 1;
                columns[place] = k;
                if *row < a.rows {
                    entries.push(place);
                } else {
                    damping.push(place);
                }
            }
        }
        let pattern = SymbolicSparseColMatRef::new_checked(rows, n, &starts, None, &indices);
        let across = SymbolicSparseColMatRef::new_checked(n, rows, &row_starts, None, &columns);
        let mut work = Work::default();
        let req = StackReq::any_of(&[
            colamd::order_scratch::<usize>(rows, n, indices.len()),
            qr::col_etree_scratch::<usize>(rows, n),
            qr::postorder_scratch::<usize>(n),
            qr::column_counts_aat_scratch::<usize>(n, rows),
            factorize_supernodal_symbolic_qr_scratch::<usize>(rows, n),
            StackReq::new::<usize>(rows + n).array(6),
        ]);
        let (mut order, mut places) = (vec![0; n], vec![0; n]);
        colamd::order(
            &mut order,
            &mut places,
            pattern,
            Default::default(),
            work.stack(req),
        )?;
        let perm = PermRef::new_checked(&order, &places, n);
        let (mut tree, mut post) = (vec![0; n], vec![0; n]);
        let tree = qr::col_etree(pattern, Some(perm), &mut tree, work.stack(req));
        qr::postorder(&mut post, tree, work.stack(req));
        let (mut counts, mut min_col) = (vec![0; n], vec![0; rows]);
        qr::column_counts_ata(
            &mut counts,
            &mut min_col,
            across,
            Some(perm),
            tree,
            &post,
            work.stack(req),
        );
        let qr = factorize_supernodal_symbolic_qr(
            pattern,
            Some(perm),
            min_col,
            tree,
            &counts,
            work.stack(req),
            Default::default(),
        )?;
        Ok(Self {
            rows,
            order,
            places,
            row_starts,
            columns,
            entries,
            damping,
            qr,
        })
    }
}

impl SparseTriangle {
    /// Applies `solve` to v in the order of R's columns.
    fn permuted(
        &self,
        v: &mut [f64],
        solve: impl FnOnce(SupernodalLltRef<'_, usize, f64>, &mut [f64], &mut Work),
    ) {
        let Some(symbolic) = &self.symbolic else {
            return;
        };
        let mut inner: Vec<f64> = symbolic.order.iter().map(|k| v[*k]).collect();
        let r = SupernodalLltRef::new(symbolic.qr.R_adjoint(), &self.numbers[0]);
        solve(r, &mut inner, &mut Work::default());
        for (k, inner) in symbolic.order.iter().zip(inner) {
            v[*k] = inner;
        }
    }
}

impl Factor for SparseTriangle {
    const NAME: &'static str = "sparse QR";

    fn take(&mut self, a: &ScaledJacobian, same: bool) {
        if same {
            return;
        }
        // It can only fail for want of memory; then every step says so as a breakdown.
        self.symbolic = Symbolic::new(a).ok().map(Arc::new);
        let Some(symbolic) = &self.symbolic else {
            return;
        };
        let reflections = symbolic.qr.householder();
        let (rows, blocks) = (
            reflections.len_householder_row_idx(),
            reflections.n_supernodes(),
        );
        self.values = vec![0.0; symbolic.columns.len()];
        self.right = vec![0.0; symbolic.rows];
        self.indices = [rows, rows + blocks, rows + blocks, rows + blocks].map(|len| vec![0; len]);
        self.numbers = [
            symbolic.qr.R_adjoint().len_val(),
            reflections.len_householder_val(),
            reflections.len_tau_val(),
        ]
        .map(|len| vec![0.0; len]);
    }

    fn factor(
        &mut self,
        a: &ScaledJacobian,
        lambda: f64,
        held: &[Option<f64>],
        residual: &[f64],
    ) -> Result<(), Pivot> {
        let n = a.cols();
        let threshold = f64::EPSILON * 16.0 * (n as f64);
        let Some(symbolic) = &self.symbolic else {
            return Err(Pivot {
                component: 0,
                pivot: 0.0,
                threshold,
            });
        };
        for k in 0..n {
            let is_held = !held.is_empty() && held[k].is_some();
            for entry in a.starts[k]..a.starts[k + 1] {
                let value = if is_held { 0.0 } else { a.values[entry] };
                self.values[symbolic.entries[entry]] = value;
            }
            self.values[symbolic.damping[k]] = if is_held { 1.0 } else { lambda.sqrt() };
        }
        self.right[..a.rows].copy_from_slice(residual);
        self.right[a.rows..].fill(0.0);
        let rows = SymbolicSparseColMatRef::new_checked(
            n,
            symbolic.rows,
            &symbolic.row_starts,
            None,
            &symbolic.columns,
        );
        let rows = SparseColMatRef::new(rows, &self.values);
        let [row_idx, block_size, block_rows, block_cols] = &mut self.indices;
        let [r, householder, tau] = &mut self.numbers;
        let req = factorize_supernodal_numeric_qr_scratch::<usize, f64>(
            &symbolic.qr,
            Par::Seq,
            Default::default(),
        );
        let factors = factorize_supernodal_numeric_qr(
            row_idx,
            block_size,
            block_rows,
            block_cols,
            r,
            householder,
            tau,
            rows,
            Some(PermRef::new_checked(&symbolic.order, &symbolic.places, n)),
            &symbolic.qr,
            Par::Seq,
            self.work.stack(req),
            Default::default(),
        );
        let req = symbolic
            .qr
            .apply_Q_transpose_in_place_scratch::<f64>(1, Par::Seq);
        let len = self.right.len();
        factors.apply_Q_transpose_in_place_with_conj(
            Conj::Yes,
            MatMut::from_column_major_slice_mut(&mut self.right, len, 1),
            Par::Seq,
            self.work.stack(req),
        );
        let r = SupernodalLltRef::new(symbolic.qr.R_adjoint(), &self.numbers[0]);
        each_pivot(r, |k, pivot| {
            // Also where the pivot is NaN.
            let sufficient = pivot.abs() > threshold;
            let component = symbolic.order[k];
            (sufficient).then_some(()).ok_or(Pivot {
                component,
                pivot: pivot.abs(),
                threshold,
            })
        })
    }

    /// RᵀR x = v.
    fn solve(&self, v: &mut [f64]) {
        let n = v.len();
        self.permuted(v, |r, v, work| {
            let req = r.symbolic().solve_in_place_scratch::<f64>(1, Par::Seq);
            let v = MatMut::from_column_major_slice_mut(v, n, 1);
            r.solve_in_place_with_conj(Conj::No, v, Par::Seq, work.stack(req));
        });
    }

    /// R y = −Qᵀr.
    fn minimiser(&self, g: &[f64]) -> Vec<f64> {
        let n = g.len();
        let mut y = vec![0.0; n];
        let Some(symbolic) = &self.symbolic else {
            return y;
        };
        for (k, right) in symbolic.order.iter().zip(&self.right) {
            y[*k] = -right;
        }
        self.permuted(&mut y, |r, y, work| {
            let req = r.symbolic().solve_in_place_scratch::<f64>(1, Par::Seq);
            let y = MatMut::from_column_major_slice_mut(y, n, 1);
            r.l_transpose_solve_with_conj(Conj::No, y, Par::Seq, work.stack(req));
        });
        y
    }
}
