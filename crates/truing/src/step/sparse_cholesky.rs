//! Steps by sparse Cholesky.

use super::Quadratic;
use super::cholesky::{breakdown, check_pivot};
use super::factored::{Factor, Factored, Pivot};
use super::jacobian::ScaledJacobian;
use super::normal::Normal;
use super::work::Work;
use faer::linalg::cholesky::llt::factor::LltError;
use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use faer::sparse::linalg::cholesky::{
    LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};
use std::sync::Arc;

/// Steps by sparse Cholesky, P(H + λI)Pᵀ = LLᵀ, by faer, with an approximate minimum degree ordering P.
///
/// The pattern of H and the ordering are found once for a structure of J; new numbers and new
/// damping only refactor. The one for thousands of columns of which each meets few others: pose
/// graphs, bundles, maps. Held components keep their place in the pattern.
///
/// JᵀJ squares the condition number: with columns of length one it breaks down at
/// κ(J) ≈ 1/√(16 ε √n), about 10⁷. A breakdown is
/// [`NoStep::Dependent`](super::NoStep::Dependent) with and without damping, which names the first
/// such column in the order P, and Levenberg–Marquardt damps more. Short of it, steps are refined with J; see [`Factored`].
pub type SparseCholesky = Factored<SparseLlt>;

/// The sparse factorisation of [`SparseCholesky`].
#[derive(Debug, Clone, Default)]
pub struct SparseLlt {
    normal: Normal,
    symbolic: Option<Arc<SymbolicCholesky<usize>>>,
    /// K's entries.
    values: Vec<f64>,
    /// L's entries.
    l: Vec<f64>,
    work: Work,
}

impl SparseLlt {
    /// Which part of H (n × n) is not zero, and which part of L's triangle.
    pub(super) fn fill(&self) -> (f64, f64) {
        let n = self.normal.starts.len().saturating_sub(1) as f64;
        // Supernodes have squares on the diagonal, of which half is not used.
        let unused = self.symbolic.as_ref().map_or(0, |symbolic| {
            let SymbolicCholeskyRaw::Supernodal(supernodal) = symbolic.raw() else {
                return 0;
            };
            let ends = supernodal.supernode_end().iter();
            let widths = ends.zip(supernodal.supernode_begin()).map(|(e, b)| e - b);
            widths.map(|width| width * (width - 1) / 2).sum()
        });
        let l = (self.l.len() - unused) as f64;
        let h = self.normal.rows.len() as f64;
        ((2.0 * h - n) / (n * n), l / (0.5 * n * (n + 1.0)))
    }

    /// The pivots of L with their components.
    fn pivots(&self, mut visit: impl FnMut(usize, f64) -> Result<(), Pivot>) -> Result<(), Pivot> {
        let Some(symbolic) = &self.symbolic else {
            return Ok(());
        };
        let order = symbolic.perm().map(|perm| perm.arrays().0);
        let mut visit = |k: usize, pivot| visit(order.map_or(k, |order| order[k]), pivot);
        match symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(simplicial) => {
                let starts = simplicial.col_ptr();
                (0..simplicial.ncols()).try_for_each(|k| visit(k, self.l[starts[k]]))
            }
            SymbolicCholeskyRaw::Supernodal(supernodal) => {
                let l = SupernodalLltRef::new(supernodal, &self.l);
                each_pivot(l, visit)
            }
        }
    }
}

/// The diagonal of L, column by column.
pub(super) fn each_pivot<E>(
    l: SupernodalLltRef<'_, usize, f64>,
    mut visit: impl FnMut(usize, f64) -> Result<(), E>,
) -> Result<(), E> {
    for s in 0..l.symbolic().n_supernodes() {
        let supernode = l.supernode(s);
        for k in 0..supernode.val().ncols() {
            visit(supernode.start() + k, supernode.val()[(k, k)])?;
        }
    }
    Ok(())
}

impl Factor for SparseLlt {
    const NAME: &'static str = "sparse Cholesky";

    fn take(&mut self, a: &ScaledJacobian, same: bool) {
        if !same {
            self.normal = Normal::new(a);
            let n = a.cols();
            let pattern = SymbolicSparseColMatRef::new_checked(
                n,
                n,
                &self.normal.starts,
                None,
                &self.normal.rows,
            );
            let ordering = SymmetricOrdering::Amd;
            let symbolic =
                factorize_symbolic_cholesky(pattern, Side::Upper, ordering, Default::default());
            // It can only fail for want of memory; then every step says so as a breakdown.
            self.symbolic = symbolic.ok().map(Arc::new);
            let len = self.symbolic.as_ref().map_or(0, |s| s.len_val());
            self.l = vec![0.0; len];
        }
        self.normal.update(a);
    }

    fn factor(
        &mut self,
        a: &ScaledJacobian,
        lambda: f64,
        held: &[Option<f64>],
        _: &[f64],
    ) -> Result<(), Pivot> {
        let n = a.cols();
        let normal = &self.normal;
        let is_held = |k: usize| !held.is_empty() && held[k].is_some();
        self.values.clone_from(&normal.values);
        for k in 0..n {
            let (start, diagonal) = (normal.starts[k], normal.starts[k + 1] - 1);
            if !held.is_empty() {
                for entry in start..diagonal {
                    if is_held(k) || is_held(normal.rows[entry]) {
                        self.values[entry] = 0.0;
                    }
                }
            }
            if is_held(k) {
                self.values[diagonal] = 1.0;
            } else {
                self.values[diagonal] += lambda;
            }
        }
        let diagonal = |k: usize| self.values[normal.starts[k + 1] - 1];
        let broken = |component: usize| Pivot {
            component,
            pivot: 0.0,
            threshold: (breakdown(n) * diagonal(component)).sqrt(),
        };
        let Some(symbolic) = &self.symbolic else {
            return Err(broken(0));
        };
        let pattern =
            SymbolicSparseColMatRef::new_checked(n, n, &normal.starts, None, &normal.rows);
        let k = SparseColMatRef::new(pattern, &self.values);
        let req = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        symbolic
            .factorize_numeric_llt(
                &mut self.l,
                k,
                Side::Upper,
                Default::default(),
                Par::Seq,
                self.work.stack(req),
                Default::default(),
            )
            .map_err(|LltError::NonPositivePivot { index: place }| {
                // faer counts from one in one of its two ways to factor, from zero in the other.
                let simplicial = matches!(symbolic.raw(), SymbolicCholeskyRaw::Simplicial(_));
                let place = place.saturating_sub(usize::from(simplicial)).min(n - 1);
                broken(symbolic.perm().map_or(place, |perm| perm.arrays().0[place]))
            })?;
        self.pivots(|k, pivot| check_pivot(n, k, pivot, diagonal(k)))
    }

    fn solve(&self, v: &mut [f64]) {
        let Some(symbolic) = &self.symbolic else {
            return;
        };
        let n = v.len();
        let mut work = Work::default();
        LltRef::new(symbolic, &self.l).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(v, n, 1),
            Par::Seq,
            work.stack(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq)),
        );
    }

    fn quadratic(&self, a: &ScaledJacobian) -> Quadratic {
        self.normal.quadratic(a.back(&a.residual))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::least_squares::{Linearization, Structure};
    use crate::step::StepSolver;

    /// Differences of neighbours, and the first.
    fn path(n: usize) -> Linearization {
        let mut structure = Structure {
            rows: n,
            column_starts: vec![0],
            row_indices: Vec::new(),
        };
        for k in 0..n {
            structure.row_indices.extend(k..(k + 2).min(n));
            structure.column_starts.push(structure.row_indices.len());
        }
        let mut lin = Linearization::new(Arc::new(structure));
        lin.values.fill(1.0);
        lin
    }

    #[test]
    fn the_pattern_is_analysed_once_for_a_structure_and_its_free_columns() {
        let lin = path(20);
        let mut solver = SparseCholesky::default();
        let mut analysed = |lin: &Linearization, free: &[usize]| {
            solver.factor(lin, free, &vec![1.0; free.len()]);
            for lambda in [0.0, 1.0] {
                assert!(solver.solve(lambda, None).is_ok());
            }
            solver.inner().symbolic.clone().unwrap()
        };
        let all: Vec<usize> = (0..20).collect();
        let first = analysed(&lin, &all);
        assert!(Arc::ptr_eq(&first, &analysed(&lin.clone(), &all)));
        assert!(!Arc::ptr_eq(&first, &analysed(&lin, &all[1..])));
        assert!(!Arc::ptr_eq(&first, &analysed(&path(20), &all)));
    }

    #[test]
    fn fill_is_what_is_not_zero() {
        // Tridiagonal: 3n − 2 of n², and without any fill 2n − 1 of the triangle.
        let n = 20;
        let mut solver = SparseCholesky::default();
        let all: Vec<usize> = (0..n).collect();
        solver.factor(&path(n), &all, &vec![1.0; n]);
        let (h, l) = solver.inner().fill();
        assert_eq!(h, 58.0 / 400.0);
        assert_eq!(l, 39.0 / 210.0);
    }
}
