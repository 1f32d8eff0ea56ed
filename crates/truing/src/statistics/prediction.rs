//! How sure a function of the unknowns is.

use super::Covariance;
use crate::autodiff::Scratch;
use crate::constraint::{Constraint, Jacobian, Point};
use crate::noise::Noise;
use crate::variable::{MAX_VARS, Values, Vars};
use nalgebra::DMatrix;

/// The value of a function of the unknowns, with its covariance.
#[derive(Debug, Clone, PartialEq)]
pub struct Prediction {
    /// The value.
    pub value: Vec<f64>,
    /// Its covariance G Σ Gᵀ, as uncertain as the unknowns make it.
    pub covariance: DMatrix<f64>,
}

impl Prediction {
    /// Standard deviations of the components.
    pub fn std_devs(&self) -> Vec<f64> {
        self.covariance
            .diagonal()
            .iter()
            .map(|v| v.sqrt())
            .collect()
    }

    /// Covariance of a new measurement of it, which was not used in the estimate: its own noise comes
    /// on top.
    ///
    /// # Panics
    /// If the noise is made for another number of rows.
    #[track_caller]
    pub fn measured_with(&self, noise: &Noise) -> DMatrix<f64> {
        &self.covariance + noise.covariance(self.value.len())
    }
}

impl Covariance {
    /// Covariance G Σ Gᵀ (m × m) of a function whose derivatives by some columns are those of G, and
    /// zero by all others: G is m × `columns`. Columns that are fixed add nothing.
    ///
    /// # Panics
    /// If G does not have a column for each.
    #[track_caller]
    pub fn propagate(&self, columns: &[usize], g: &DMatrix<f64>) -> DMatrix<f64> {
        assert_eq!(
            g.ncols(),
            columns.len(),
            "derivatives by {} columns, {} are named",
            g.ncols(),
            columns.len()
        );
        // (S Gᵀ)ᵀ (S Gᵀ) is symmetric and no variance is negative.
        let mut image = DMatrix::zeros(self.rank(), g.nrows());
        for (column, derivatives) in columns.iter().zip(g.column_iter()) {
            if let Some(place) = self.position(*column) {
                let root = self.root().column(place);
                for (mut target, derivative) in image.column_iter_mut().zip(&derivatives) {
                    target.axpy(*derivative, &root, 1.0);
                }
            }
        }
        image.tr_mul(&image)
    }

    /// Value and covariance of a function of some variables at `x`: any [`Constraint`] is one, and its
    /// derivatives are had in the same way. Its residual is the value, in its own units.
    ///
    /// A constraint that was not used says how far off a measurement may be that nobody has made
    /// yet; see [`Prediction::measured_with`]. Where the noise is known up to a factor only, the
    /// covariance is to be multiplied by σ₀².
    ///
    /// ```
    /// use truing::{Constraint, Covariance, Problem, Scalar, Views, manifold::Vector};
    ///
    /// /// a + b·t − y
    /// struct Line { t: f64, y: f64 }
    /// impl Constraint for Line {
    ///     type Vars = (Vector,);
    ///     const DIM: usize = 1;
    ///     fn residual<T: Scalar>(&self, (p,): Views<'_, Self, T>, r: &mut [T]) {
    ///         r[0] = p[1] * self.t + p[0] - self.y;
    ///     }
    /// }
    ///
    /// let mut problem = Problem::new();
    /// let line = problem.add_variable::<Vector>("line", &vec![0.0, 0.0]);
    /// for t in [-1.0, 0.0, 1.0] {
    ///     problem.add("reading", (line,), Line { t, y: 2.0 * t });
    /// }
    /// let solution = truing::solve(&problem, &Default::default())?;
    /// let covariance = Covariance::at(&problem, &solution.values)?;
    /// let later = covariance.predict((line,), &Line { t: 3.0, y: 0.0 }, &solution.values);
    /// assert!((later.value[0] - 6.0).abs() < 1e-12);
    /// // 1/n + t²/Σt²
    /// assert!((later.covariance[(0, 0)] - (1.0 / 3.0 + 9.0 / 2.0)).abs() < 1e-12);
    /// # Ok::<(), truing::Error>(())
    /// ```
    pub fn predict<C: Constraint>(
        &self,
        vars: <C::Vars as Vars>::Handles,
        function: &C,
        x: &Values,
    ) -> Prediction {
        let slots = C::Vars::slots(vars);
        let mut slices: [&[f64]; MAX_VARS] = [&[]; MAX_VARS];
        for (slice, slot) in slices.iter_mut().zip(&slots[..C::Vars::COUNT]) {
            *slice = &x.as_slice()[slot.offset..slot.offset + slot.len];
        }
        let dims = C::Vars::tangent_dims(slices);
        let mut panel = vec![0.0; C::DIM * dims.iter().sum::<usize>()];
        let mut value = vec![0.0; C::DIM];
        let mut scratch = Scratch::default();
        function.linearize(
            &mut Point::new(slices, &mut scratch),
            &mut value,
            &mut Jacobian::new(C::DIM, dims, &mut panel),
        );
        let columns: Vec<usize> = slots
            .iter()
            .zip(dims)
            .take(C::Vars::COUNT)
            .flat_map(|(slot, dim)| slot.column..slot.column + dim)
            .collect();
        let g = DMatrix::from_vec(C::DIM, columns.len(), panel);
        Prediction {
            value,
            covariance: self.propagate(&columns, &g),
        }
    }
}
