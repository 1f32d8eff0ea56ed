//! Jacobians of few rows.

use crate::model::Assembly;
use truing::nalgebra::DMatrix;
use truing::{LeastSquares, Linearization, step};

/// What is left of a scaled column at configurations that satisfy the constraints exactly: true
/// rank keeps about 1e-2, a dependent column about 1e-16; tables written to five digits in between.
pub const STRUCTURE: f64 = 1e-5;

/// The Jacobian of an assembly, compressed to the triangle of its QR: same column geometry, few rows.
pub fn compressed(assembly: &Assembly, wanted: &[usize]) -> DMatrix<f64> {
    let mut lin = Linearization::new(assembly.problem.structure());
    assembly
        .problem
        .linearize(assembly.problem.initial(), &mut lin);
    let scale = vec![1.0; wanted.len()];
    let t = step::triangle(&lin, wanted, &scale);
    let n = wanted.len();
    DMatrix::from_fn(n, n, |i, k| if i <= k { t[(i, k)] } else { 0.0 })
}
