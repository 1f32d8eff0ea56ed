//! Steps from a factorisation of H + λI, the same way for every factorisation.

use super::jacobian::ScaledJacobian;
use super::normal::Normal;
use super::null_space::RowSpace;
use super::{Equalities, NoStep, Quadratic, StepSolver};
use crate::least_squares::Linearization;
use faer::Mat;
use faer::linalg::solvers::{PartialPivLu, Solve};

/// A pivot that is too small.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pivot {
    /// Its component.
    pub component: usize,
    /// What is left of the scaled column.
    pub pivot: f64,
    /// What would have sufficed.
    pub threshold: f64,
}

/// A factorisation of K = AᵀA + λI, in which held components have the row and column of the identity.
pub trait Factor {
    /// Its name in reports.
    const NAME: &'static str;

    /// Takes in A; `same` says that its structure is the one of the last call.
    fn take(&mut self, a: &ScaledJacobian, same: bool);

    /// Factors K. `held` is empty where nothing is held; `residual` is A y + r with the held
    /// components at their values and the others zero.
    ///
    /// # Errors
    /// If a pivot is zero to rounding, names it.
    fn factor(
        &mut self,
        a: &ScaledJacobian,
        lambda: f64,
        held: &[Option<f64>],
        residual: &[f64],
    ) -> Result<(), Pivot>;

    /// v ← K⁻¹ v.
    fn solve(&self, v: &mut [f64]);

    /// −K⁻¹ g, g = Aᵀ residual without the held components: the first step, which is then refined.
    /// A factorisation that knows the residual can do better than the gradient.
    fn minimiser(&self, g: &[f64]) -> Vec<f64> {
        let mut y: Vec<f64> = g.iter().map(|g| -g).collect();
        self.solve(&mut y);
        y
    }

    /// H and q.
    fn quadratic(&self, a: &ScaledJacobian) -> Quadratic {
        let mut normal = Normal::new(a);
        normal.update(a);
        normal.quadratic(a.back(&a.residual))
    }
}

/// Steps by a factorisation of K = H + λI, H = AᵀA and A = J D⁻¹.
///
/// Every step is refined with A itself: with e = Ay + r, the correction −K⁻¹(Aᵀe + λy) is added while
/// it shrinks to less than half, at most [`REFINEMENTS`] times. Each correction gains the digits that
/// κ(K) ε leaves to a Cholesky factorisation, κ(R) ε to a QR, so that a factorisation of JᵀJ, which
/// squares the condition number, still gives steps about as good as those of a QR, up to where
/// it breaks down (κ(J) about 10⁷).
///
/// Rows C y = d of equalities are solved for by the Schur complement on the factorisation, with
/// multipliers z: K y + Cᵀz = −q, C K⁻¹Cᵀ z = −C K⁻¹q − d; dependent rows are left out. Where K
/// alone is singular but not on the rows' null space (an equality that fixes a gauge) the rows are
/// put below A: ½‖Ay + r‖² + ½‖Cy − d‖² has the same minimiser under C y = d, and a regular K.
///
/// # Reference
/// Björck 1996, "Numerical methods for least squares problems", sections 2.9 (iterative refinement)
/// and 6.6.5 (corrected semi-normal equations); Nocedal & Wright, section 16.2 (Schur complement)
/// and 17.3 (augmented Lagrangian).
#[derive(Debug, Clone, Default)]
pub struct Factored<F> {
    jacobian: ScaledJacobian,
    factor: F,
    /// λ and what is held in the factorisation that there is.
    done: Option<(f64, Vec<Option<f64>>)>,
}

/// Corrections of a step, at most.
pub const REFINEMENTS: usize = 4;

impl<F: Factor + Default> Factored<F> {
    /// The factorisation.
    pub(super) fn inner(&self) -> &F {
        &self.factor
    }

    /// The same linearisation by another factorisation.
    pub(super) fn by<G: Factor + Default>(&self) -> Factored<G> {
        let mut other = Factored::<G> {
            jacobian: self.jacobian.clone(),
            ..Factored::default()
        };
        if other.jacobian.cols() > 0 {
            other.factor.take(&other.jacobian, false);
        }
        other
    }

    /// The minimiser under the equalities.
    fn minimise(
        &mut self,
        lambda: f64,
        equalities: Option<&Equalities>,
    ) -> Result<Vec<f64>, Pivot> {
        let a = &self.jacobian;
        let n = a.cols();
        let held: &[Option<f64>] = match equalities {
            Some(equalities) if equalities.held.iter().any(Option::is_some) => &equalities.held,
            _ => &[],
        };
        let moves = |k: usize| held.is_empty() || held[k].is_none();
        let mut y: Vec<f64> = (0..n)
            .map(|k| held.get(k).copied().flatten().unwrap_or(0.0))
            .collect();
        let residual = a.residual_at(&y);
        let known = matches!(&self.done, Some((of, what)) if *of == lambda && what == held);
        if !known {
            self.done = None;
            self.factor.factor(a, lambda, held, &residual)?;
            self.done = Some((lambda, held.to_vec()));
        }
        let mut gradient = a.back(&residual);
        for k in (0..n).filter(|k| !moves(*k)) {
            gradient[k] = 0.0;
        }
        let rows = equalities.map_or(&[][..], |equalities| &equalities.rows);
        let rows = Rows::new(rows, held, n, &self.factor);
        let mut z = vec![0.0; rows.terms.len()];
        let mut first = self.factor.minimiser(&gradient);
        rows.correct(&mut first, &rows.missed(&y), &mut z);
        let mut last = norm(&first);
        add(&mut y, &first);
        for _ in 0..REFINEMENTS {
            let mut left = a.gradient(&y);
            for (k, left) in left.iter_mut().enumerate() {
                *left = if moves(k) { *left + lambda * y[k] } else { 0.0 };
            }
            for (terms, z) in rows.terms.iter().zip(&z) {
                terms.iter().for_each(|(k, c)| left[*k] += c * z);
            }
            left.iter_mut().for_each(|left| *left = -*left);
            self.factor.solve(&mut left);
            let mut more = vec![0.0; z.len()];
            rows.correct(&mut left, &rows.missed(&y), &mut more);
            let size = norm(&left);
            // Also where it is NaN.
            let shrinks = size < 0.5 * last;
            if !shrinks {
                break;
            }
            add(&mut y, &left);
            add(&mut z, &more);
            // The next one would be shorter by the same factor.
            if size * size <= f64::EPSILON * last * norm(&y) {
                break;
            }
            last = size;
        }
        rows.keep(&mut y);
        Ok(y)
    }
}

fn norm(y: &[f64]) -> f64 {
    y.iter().map(|y| y * y).sum::<f64>().sqrt()
}

fn add(y: &mut [f64], more: &[f64]) {
    y.iter_mut().zip(more).for_each(|(y, more)| *y += more);
}

/// Rows C y = d over the components that move, none of which depends on others.
struct Rows {
    terms: Vec<Vec<(usize, f64)>>,
    right: Vec<f64>,
    /// K⁻¹Cᵀ, row by row.
    reached: Vec<Vec<f64>>,
    /// C K⁻¹ Cᵀ.
    schur: Option<PartialPivLu<f64>>,
    /// The components that occur, and the rows over them.
    touched: Vec<usize>,
    space: Option<RowSpace>,
}

impl Rows {
    fn new(
        rows: &[(Vec<(usize, f64)>, f64)],
        held: &[Option<f64>],
        n: usize,
        factor: &impl Factor,
    ) -> Self {
        let mut all = Self {
            terms: Vec::new(),
            right: Vec::new(),
            reached: Vec::new(),
            schur: None,
            touched: Vec::new(),
            space: None,
        };
        if rows.is_empty() {
            return all;
        }
        let fixed = |k: usize| held.get(k).copied().flatten();
        let moving = |terms: &[(usize, f64)]| {
            let moving = terms.iter().filter(|(k, _)| fixed(*k).is_none());
            moving.copied().collect::<Vec<_>>()
        };
        let terms: Vec<Vec<(usize, f64)>> = rows.iter().map(|(terms, _)| moving(terms)).collect();
        let matrix = |terms: &[Vec<(usize, f64)>], touched: &[usize]| {
            let mut c = Mat::<f64>::zeros(terms.len(), touched.len());
            for (row, terms) in terms.iter().enumerate() {
                for (k, a) in terms {
                    if let Ok(place) = touched.binary_search(k) {
                        c[(row, place)] += a;
                    }
                }
            }
            c
        };
        let mut touched: Vec<usize> = terms.iter().flatten().map(|(k, _)| *k).collect();
        touched.sort_unstable();
        touched.dedup();
        if touched.is_empty() {
            return all;
        }
        let mut chosen = RowSpace::new(&matrix(&terms, &touched))
            .independent()
            .to_vec();
        chosen.sort_unstable();
        for row in chosen {
            let known: f64 = (rows[row].0.iter())
                .filter_map(|(k, a)| fixed(*k).map(|y| a * y))
                .sum();
            all.right.push(rows[row].1 - known);
            all.terms.push(terms[row].clone());
        }
        all.space = Some(RowSpace::new(&matrix(&all.terms, &touched)));
        all.touched = touched;
        for terms in &all.terms {
            let mut column = vec![0.0; n];
            terms.iter().for_each(|(k, a)| column[*k] += a);
            factor.solve(&mut column);
            all.reached.push(column);
        }
        let m = all.terms.len();
        let schur = Mat::from_fn(m, m, |i, j| dot(&all.terms[i], &all.reached[j]));
        all.schur = Some(schur.partial_piv_lu());
        all
    }

    /// d − C y.
    fn missed(&self, y: &[f64]) -> Vec<f64> {
        (self.terms.iter().zip(&self.right))
            .map(|(terms, right)| right - dot(terms, y))
            .collect()
    }

    /// From the free correction y, that with C y = `missed`; adds the multipliers to z.
    fn correct(&self, y: &mut [f64], missed: &[f64], z: &mut [f64]) {
        let Some(schur) = &self.schur else { return };
        let mut right = Mat::from_fn(missed.len(), 1, |i, _| dot(&self.terms[i], y) - missed[i]);
        schur.solve_in_place(right.as_mut());
        for (i, reached) in self.reached.iter().enumerate() {
            let multiplier = right[(i, 0)];
            z[i] += multiplier;
            (y.iter_mut().zip(reached)).for_each(|(y, reached)| *y -= reached * multiplier);
        }
    }

    /// Removes what rounding has left of d − C y, by the shortest way.
    fn keep(&self, y: &mut [f64]) {
        if let Some(space) = &self.space {
            let missed = self.missed(y);
            for (k, more) in self.touched.iter().zip(space.reach(&missed)) {
                y[*k] += more;
            }
        }
    }
}

fn dot(terms: &[(usize, f64)], y: &[f64]) -> f64 {
    terms.iter().map(|(k, a)| a * y[*k]).sum()
}

impl<F: Factor + Default> StepSolver for Factored<F> {
    fn factor(&mut self, lin: &Linearization, free: &[usize], scale: &[f64]) {
        let same = self.jacobian.take(lin, free, scale);
        self.done = None;
        if !free.is_empty() {
            self.factor.take(&self.jacobian, same);
        }
    }

    fn solve(&mut self, lambda: f64, equalities: Option<&Equalities>) -> Result<Vec<f64>, NoStep> {
        if self.jacobian.cols() == 0 {
            return Ok(Vec::new());
        }
        let solved = self.minimise(lambda, equalities).or_else(|pivot| {
            let Some(equalities) = equalities.filter(|equalities| !equalities.rows.is_empty())
            else {
                return Err(pivot);
            };
            let mut extended = Self {
                jacobian: self.jacobian.with_rows(&equalities.rows),
                ..Self::default()
            };
            extended.factor.take(&extended.jacobian, false);
            extended.minimise(lambda, Some(equalities))
        });
        solved.map_err(|found| NoStep::Dependent {
            column: self.jacobian.column_of(found.component),
            pivot: found.pivot,
            threshold: found.threshold,
        })
    }

    fn gradient(&self, y: &[f64]) -> Vec<f64> {
        self.jacobian.gradient(y)
    }

    fn predicted(&self, y: &[f64]) -> f64 {
        self.jacobian.predicted(y)
    }

    fn quadratic(&self) -> Quadratic {
        if self.jacobian.cols() == 0 {
            return Quadratic {
                starts: vec![0],
                ..Quadratic::default()
            };
        }
        self.factor.quadratic(&self.jacobian)
    }

    /// `None` where the last step held components: the factorisation is then not that of H + λI.
    fn correction(&self, g: &[f64]) -> Option<Vec<f64>> {
        let (_, held) = self.done.as_ref()?;
        if !held.is_empty() {
            return None;
        }
        let mut a: Vec<f64> = g.iter().map(|g| -g).collect();
        self.factor.solve(&mut a);
        a.iter().all(|a| a.is_finite()).then_some(a)
    }

    fn name(&self) -> &'static str {
        F::NAME
    }
}
