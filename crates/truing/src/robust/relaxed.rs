//! A problem whose losses are milder than stated.

use crate::error::Error;
use crate::least_squares::{LeastSquares, Linearization, StepBounds, Structure};
use crate::problem::Problem;
use crate::variable::Values;
use std::sync::Arc;

/// A view of a [`Problem`] in which the scale of every loss is multiplied by a factor; made by
/// [`Problem::relaxed`]. Everything else is the problem's.
#[derive(Clone, Copy)]
pub struct Relaxed<'a> {
    problem: &'a Problem,
    factor: f64,
}

impl Problem {
    /// The same problem with the scale of every loss multiplied by `factor`; with ∞ every loss is the
    /// trivial one, so that measurements count by their standard deviations alone.
    ///
    /// # Panics
    /// If the factor is less than 1 or NaN.
    #[track_caller]
    pub fn relaxed(&self, factor: f64) -> Relaxed<'_> {
        assert!(
            factor >= 1.0,
            "found a relaxation by {factor}, expected at least 1"
        );
        Relaxed {
            problem: self,
            factor,
        }
    }
}

impl Relaxed<'_> {
    /// By what the scales are multiplied.
    pub fn factor(&self) -> f64 {
        self.factor
    }
}

impl LeastSquares for Relaxed<'_> {
    type Point = Values;

    fn structure(&self) -> Arc<Structure> {
        self.problem.structure()
    }
    fn residual(&self, x: &Values, r: &mut [f64]) -> f64 {
        self.problem.residual_relaxed(x, self.factor, r)
    }
    fn linearize(&self, x: &Values, lin: &mut Linearization) {
        self.problem.linearize_relaxed(x, self.factor, lin);
    }
    fn plus(&self, x: &Values, delta: &[f64]) -> Values {
        self.problem.plus(x, delta)
    }
    fn norm(&self, x: &Values) -> f64 {
        self.problem.norm(x)
    }
    fn sizes(&self, x: &Values) -> Vec<f64> {
        self.problem.sizes(x)
    }
    fn free(&self) -> Vec<usize> {
        self.problem.free()
    }
    fn step_bounds(&self, x: &Values) -> Option<StepBounds> {
        self.problem.step_bounds(x)
    }
    fn is_robust(&self) -> bool {
        self.factor.is_finite() && self.problem.is_robust()
    }
    fn describe_row(&self, row: usize) -> String {
        self.problem.describe_row(row)
    }
    fn describe_column(&self, column: usize) -> String {
        self.problem.describe_column(column)
    }
    fn describe_limit(&self, row: usize) -> String {
        self.problem.describe_limit(row)
    }

    fn feasible(&self, x: &Values) -> Result<Values, Error> {
        self.problem.feasible(x)
    }
}
